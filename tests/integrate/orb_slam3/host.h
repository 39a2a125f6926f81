// The line between the test (C++17) and the host (C++14): plain data.
#pragma once

struct PlayedFrame {
  double timestamp;
  const unsigned char* rgb;  // 3 * width * height
  const float* depth;        // [m]
  float pose[12];            // T_camera_world that the feature tracker is made to find
  float response;            // of all its keypoints
  int ok;                    // it found a pose at all
  int retry;                 // it finds one when it looks near the true pose
  float map_shift;           // before this frame, the back end moves the map along x by this [m]
  int new_map;               // before this frame, the map begins anew
  int matches;               // inliers at most; 0: all
  int keypoints;             // at most; 0: all
};
struct HostResult {
  float pose[12];  // T_camera_world that GrabImageRGBD returned
  int keyframes;   // so far
  int hidden;      // keypoints taken out of the frame, so far
  int consistent;  // all lists of the frame have as many entries, and say the same of each keypoint
  int on_mask;     // keypoints of the frame that lie on the mask
  int refined;
  int tracking;        // mState is OK
  int retries;         // so far
  int dropped;         // map points, so far
  double observed_ms;  // time of the first stage
};
struct HostPoint {
  float position[3];
  int bad;  // the hook has taken it out of the map
};

// refine: APSO_REFINE_*. points: of the map at the end, at most `room` of them; their number is returned.
int run_host(const PlayedFrame* frames, int count, float f, float cx, float cy, int width, int height, HostResult* out, HostPoint* points,
             int room, int refine);
