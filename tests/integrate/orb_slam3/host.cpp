// Runs the test double of ORB-SLAM3 with the integration lines in it. Compiled twice: as C++17 with apso_hook.hpp, and as
// C++14 with apso_hook_14.hpp.
#include "host.h"

#ifdef APSO_HOST_IS_CXX14
static_assert(__cplusplus < 201703L, "this file has to be compiled as C++14");
#define RUN_HOST run_host_cxx14
#else
#define RUN_HOST run_host_cxx17
#endif

#include "Tracking.cc"

void RUN_HOST(const PlayedFrame* frames, int count, float f, float cx, float cy, int width, int height, HostResult* out) {
  ORB_SLAM3::Tracking tracking(f, f, cx, cy, width, height);
  for (int k = 0; k < count; ++k) {
    const PlayedFrame& p = frames[k];
    Eigen::Matrix3f R;
    Eigen::Vector3f t;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R(i, j) = p.pose[4 * i + j];
      t(i) = p.pose[4 * i + 3];
    }
    tracking.mPlayedPose = Sophus::SE3f(Eigen::Quaternionf(R).normalized(), t);
    tracking.mPlayedResponse = p.response;
    tracking.mbPlayedOK = p.ok != 0;
    tracking.mpAtlas->mnBigChangeIdx = p.big_change;
    const cv::Mat rgb(height, width, CV_8UC3, const_cast<unsigned char*>(p.rgb));
    const cv::Mat depth(height, width, CV_32F, const_cast<float*>(p.depth));
    const Sophus::SE3f Tcw = tracking.GrabImageRGBD(rgb, depth, p.timestamp, "");
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) out[k].pose[4 * i + j] = Tcw.rotationMatrix()(i, j);
      out[k].pose[4 * i + 3] = Tcw.translation()(i);
    }
    out[k].keyframes = tracking.mnKeyFrames;
    out[k].hidden = tracking.mnHidden;
    out[k].refined = tracking.mApso.Report().refined ? 1 : 0;
    out[k].tracking = tracking.mState == ORB_SLAM3::Tracking::OK;
  }
}
