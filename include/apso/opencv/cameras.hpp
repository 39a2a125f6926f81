/// \file
/// Lens distortion removed from colour and depth images of type cv::Mat.
#pragma once

#include <cmath>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/config.hpp>
#include <apso/io/camera_model.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

using apso::camera_by_name;
using apso::CameraModel;

/// Maps distorted images to images of the plain pinhole camera; colour is interpolated, depth never is. apso::Rectifier does
/// the same for any image and camera type, in floating point; this one keeps 8-bit colour as it is, in fixed point.
class Rectifier {
 public:
  explicit Rectifier(const CameraModel& camera) : identity_(!camera.distorted()) {
    if (identity_) return;
    const Pinhole& p = camera.pinhole;
    map_.create(p.height, p.width, CV_32FC2);
    nearest_.create(p.height, p.width, CV_16SC2);
    for (int y = 0; y < p.height; ++y)
      for (int x = 0; x < p.width; ++x) {
        const Eigen::Vector2d d = camera.distort((x - p.cx) / p.fx, (y - p.cy) / p.fy);
        const double u = p.fx * d.x() + p.cx;
        const double v = p.fy * d.y() + p.cy;
        map_.at<cv::Vec2f>(y, x) = {static_cast<float>(u), static_cast<float>(v)};
        nearest_.at<cv::Vec2s>(y, x) = {cv::saturate_cast<short>(u), cv::saturate_cast<short>(v)};
      }
    cv::convertMaps(map_, cv::Mat(), fixed_, fraction_, CV_16SC2);
  }
  void colour(const cv::Mat& distorted, cv::Mat& out) const {
    if (identity_) distorted.copyTo(out);
    else cv::remap(distorted, out, fixed_, fraction_, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  }
  void depth(const cv::Mat& distorted, cv::Mat& out) const {
    if (identity_) distorted.copyTo(out);
    else cv::remap(distorted, out, nearest_, cv::Mat(), cv::INTER_NEAREST, cv::BORDER_CONSTANT);
  }

 private:
  bool identity_;
  cv::Mat map_, nearest_, fixed_, fraction_;
};

}  // namespace opencv
APSO_NAMESPACE_END
