// OpenCV's RGB-D odometry (module rgbd of its contributed part) with apso around it: a host of another kind than ORB-SLAM3. It has no
// keypoints, no tracks and no map; it aligns each frame to the one before, and can be steered by a mask alone.
#pragma once

#include <opencv2/core.hpp>
#include <opencv2/rgbd/depth.hpp>

#include <apso/opencv/adapters.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/traits/frame.hpp>

class Odometry {
 public:
  /// \param with_apso false: OpenCV alone, to compare
  explicit Odometry(const apso::Pinhole& camera, bool with_apso = true) : pipeline_(camera), with_apso_(with_apso) {
    const cv::Mat K = (cv::Mat_<float>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
    odometry_ = cv::rgbd::RgbdICPOdometry::create(K);
  }

  /// \param grey  8-bit, rectified
  /// \param depth 32-bit float, metres, registered to grey
  // [track]
  apso::Pose track(double timestamp, const cv::Mat& grey, const cv::Mat& depth) {
    const apso::Pose T_world_predicted = T_world_last_ * motion_;
    cv::Mat usable;  // 255 where OpenCV may look
    if (with_apso_) {
      // 1. What moves? OpenCV aligns the rest.
      const auto now =
          apso::frame(timestamp, apso::opencv::as_image<unsigned char>(grey), apso::opencv::as_image<float>(depth), pipeline_.camera());
      const apso::Image<float>& moving = pipeline_.observe(now, T_world_predicted).mask.probability;
      usable = cv::Mat(grey.size(), CV_32F, const_cast<float*>(moving.data())) < 0.5F;
    }
    auto frame = cv::rgbd::OdometryFrame::create(grey, depth, usable);
    apso::Pose T_world_found = T_world_predicted;
    const bool ok = !last_ || align(frame, T_world_found);
    last_ = frame;
    apso::Pose T_world_camera = T_world_found;
    if (with_apso_) {
      // 2. Can it be trusted? There are no keypoints and no tracks, so the scores of depth and of motion decide.
      pipeline_.assess(apso::none, apso::none, {T_world_found, T_world_predicted, ok});
      // 3. The pose is refined with trusted frames, not only with the one before.
      T_world_camera = pipeline_.conclude().T_world_camera;
    }
    motion_ = ok ? apso::inverse(T_world_last_) * T_world_camera : apso::Pose::Identity();
    T_world_last_ = T_world_camera;
    return T_world_camera;
  }
  // [/track]
  [[nodiscard]] const apso::FrameReport& report() const { return pipeline_.report(); }

 private:
  bool align(cv::Ptr<cv::rgbd::OdometryFrame>& frame, apso::Pose& T_world_camera) {
    const apso::Pose T_now_last = apso::inverse(T_world_camera) * T_world_last_;
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> guess = T_now_last.matrix();
    const cv::Mat initial(4, 4, CV_64F, const_cast<double*>(guess.data()));
    cv::Mat found;
    if (!odometry_->compute(last_, frame, found, initial) || found.total() != 16) return false;
    apso::Pose T = apso::Pose::Identity();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) T.matrix()(r, c) = found.at<double>(r, c);
    }
    if (!apso::is_rigid(T)) return false;
    T_world_camera = T_world_last_ * apso::inverse(T);
    return true;
  }

  apso::Pipeline pipeline_;
  bool with_apso_;
  cv::Ptr<cv::rgbd::RgbdICPOdometry> odometry_;
  cv::Ptr<cv::rgbd::OdometryFrame> last_;
  apso::Pose T_world_last_ = apso::Pose::Identity();
  apso::Pose motion_ = apso::Pose::Identity();
};
