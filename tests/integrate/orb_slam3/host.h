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
  int no_keyframe;           // the host wants none of it
  float adjusted;            // before this frame, an adjustment moves the newest keyframe along x by this [m]
};
struct HostResult {
  float returned[12];  // T_camera_world that GrabImageRGBD returned
  float pose[12];      // T_camera_world that the frame has when the next one is tracked
  float velocity[12];  // mVelocity by then
  int keyframes;   // so far
  int hidden;      // keypoints taken out of the frame, so far
  int consistent;  // all lists of the frame have as many entries, and say the same of each keypoint
  int on_mask;     // keypoints of the frame that lie on the mask
  int refined;
  int tracking;        // mState is OK
  float relative[12];  // T_frame_reference, as it is kept for the trajectory
  int reference;       // the frame of that keyframe
  int parent;          // of the newest keyframe: its frame, -1: none
  int retries;         // so far
  int dropped;         // map points, so far
  double observed_ms;  // time of the first stage
};
struct HostPoint {
  float position[3];
  int bad;  // the hook has taken it out of the map
};
struct HostEdge {
  int keyframes[2];    // their numbers
  int frames[2];       // the frames that they are made of
  float measured[12];  // T_1_0
  double sigma;        // of each component [m, rad]
};
// At the end. The lists have room for so many; their lengths are told.
struct HostMap {
  HostPoint* points;
  int points_room;
  int points_count;
  HostEdge* edges;  // of a bundle adjustment of all keyframes but every fifth, those of even numbers fixed
  int edges_room;
  int edges_count;
  int silent;       // before the first frame the hook had neither a mask nor times
  int two_parents;  // keyframes that are children of two, once each shares map points with the one made after it
};

struct HostOptions {
  int refine;  // APSO_REFINE_*
  int own_thread;
  double inverse_depth_sigma;  // [1/m]; 0: not known
};
void run_host(const PlayedFrame* frames, int count, float f, float cx, float cy, int width, int height, HostResult* out, HostMap* map,
              const HostOptions& chosen);
