// The same hook as apso_hook.hpp, for a fork that stays at C++11 or C++14: it talks to apso_bridge.cpp, which is compiled as
// C++17 on its own. The lines in the host are the same.
#pragma once

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <vector>

#include <opencv2/core.hpp>
#include <sophus/se3.hpp>

#include "apso_bridge.h"

class ApsoHook {
 public:
  ApsoHook(float fx, float fy, float cx, float cy, int width, int height)
      : bridge_(apso_bridge_create(fx, fy, cx, cy, width, height)), report_() {
    if (!bridge_) throw std::invalid_argument("ApsoHook: fx, fy, width and height must be positive");
  }
  ~ApsoHook() { apso_bridge_destroy(bridge_); }
  ApsoHook(const ApsoHook&) = delete;
  ApsoHook& operator=(const ApsoHook&) = delete;

  template <class Frame>
  void BeforeTracking(const cv::Mat& grey, const cv::Mat& depth, const Sophus::SE3f& Tcw, Frame& frame) {
    double T[12];
    Invert(Tcw, T);
    Check(apso_bridge_observe(bridge_, frame.mTimeStamp, grey.data, static_cast<int>(grey.step), depth.ptr<float>(),
                              static_cast<int>(depth.step), T));
    moving_.assign(frame.mvKeysUn.size(), false);
    for (std::size_t i = 0; i < moving_.size(); ++i) {
      moving_[i] = apso_bridge_moves(bridge_, frame.mvKeysUn[i].pt.x, frame.mvKeysUn[i].pt.y) != 0;
      if (moving_[i]) frame.mvDepth[i] = frame.mvuRight[i] = -1;
    }
    for (auto& column : frame.mGrid) {
      for (auto& cell : column) {
        cell.erase(std::remove_if(cell.begin(), cell.end(), [this](std::size_t i) { return moving_[i]; }), cell.end());
      }
    }
  }

  template <class Frame>
  bool AfterTracking(Frame& frame, bool ok) {
    keypoints_.clear();
    for (std::size_t i = 0; i < frame.mvKeysUn.size(); ++i) {
      const cv::KeyPoint& k = frame.mvKeysUn[i];
      const bool matched = frame.mvpMapPoints[i] && !frame.mvbOutlier[i];
      keypoints_.push_back({k.pt.x, k.pt.y, k.response, k.angle < 0 ? 0.0F : k.angle, k.octave,
                            matched ? static_cast<long long>(frame.mvpMapPoints[i]->mnId) : -1});
    }
    double T[12] = {};
    if (ok) Invert(frame.GetPose(), T);
    Check(apso_bridge_conclude(bridge_, keypoints_.data(), static_cast<int>(keypoints_.size()), T, ok ? 1 : 0, &report_));
    if (report_.refined) {
      Eigen::Matrix3f R;
      Eigen::Vector3f t;
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) R(i, j) = static_cast<float>(report_.T_world_camera[4 * i + j]);
        t(i) = static_cast<float>(report_.T_world_camera[4 * i + 3]);
      }
      frame.SetPose(Sophus::SE3f(Eigen::Quaternionf(R).normalized(), t).inverse());
    }
    return report_.pose_ok != 0;
  }

  bool KeyframeAllowed() const { return report_.keyframe_allowed != 0; }
  void Reset() { apso_bridge_reset(bridge_); }
  const ApsoBridgeReport& Report() const { return report_; }

 private:
  static void Invert(const Sophus::SE3f& Tcw, double* T) {
    const Eigen::Matrix3f R = Tcw.rotationMatrix().transpose();
    const Eigen::Vector3f t = -(R * Tcw.translation());
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) T[4 * i + j] = static_cast<double>(R(i, j));
      T[4 * i + 3] = static_cast<double>(t(i));
    }
  }
  void Check(int failed) const {
    if (failed) throw std::runtime_error(apso_bridge_error(bridge_));
  }

  ApsoBridge* bridge_;
  ApsoBridgeReport report_;
  std::vector<bool> moving_;
  std::vector<ApsoBridgeKeypoint> keypoints_;
};
