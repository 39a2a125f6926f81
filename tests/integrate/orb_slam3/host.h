// The line between the test (C++17) and a host that may be C++14: plain data.
#pragma once

struct PlayedFrame {
  double timestamp;
  const unsigned char* rgb;  // 3 * width * height
  const float* depth;        // [m]
  float pose[12];            // T_camera_world that the feature tracker is made to find
  float response;            // of all its keypoints
  int ok;                    // it found a pose at all
  int big_change;            // index of the last big change of the map
};
struct HostResult {
  float pose[12];  // T_camera_world that GrabImageRGBD returned
  int keyframes;   // so far
  int hidden;      // keypoints hidden from matching, so far
  int refined;
  int tracking;  // mState is OK
};

using Host = void (*)(const PlayedFrame* frames, int count, float f, float cx, float cy, int width, int height, HostResult* out);
void run_host_cxx17(const PlayedFrame*, int, float, float, float, int, int, HostResult*);
void run_host_cxx14(const PlayedFrame*, int, float, float, float, int, int, HostResult*);
