/// \file
/// A recording of a camera with a rolling shutter, as if each frame had been read at one time.
#pragma once

#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/opencv/adapters.hpp>
#include <apso/refinement/camera_velocity.hpp>
#include <apso/traits/images/rolling_shutter.hpp>

#include "frame_source.hpp"

namespace track {

/// Reads one frame ahead, since the velocity of the camera at a frame is known from the motion to the next one.
class ShutterSource final : public ChangedSource {
 public:
  /// \param readout time from the first row to the last [s]
  ShutterSource(std::unique_ptr<FrameSource> source, double readout)
      : ChangedSource(std::move(source)), velocity_(source_->camera()), shutter_(source_->camera(), readout) {}

  void load(int i, LoadedFrame& out) override {
    if (ahead_ != i) {  // not the frame after the last one
      velocity_.reset();
      if (i > 0) look(i - 1);
      look(i);
    }
    std::swap(out, frame_);
    const bool last = i + 1 == size();
    if (!last) look(i + 1);
    out.from_x.release();
    out.from_y.release();
    if (!out.ok()) return;
    const std::optional<apso::Twist> v = last || !frame_.ok() ? velocity_.of_latest_frame() : velocity_.of_frame_before();
    if (!v || std::abs(out.depth_delay) > apso::RollingShutter::kLongest) return;
    shutter_.follow(out.rgbd(), *v, out.depth_delay);
    out.depth = shutter_.depth();
    const auto copy = [](const apso::Image<float>& m, cv::Mat& to) {
      cv::Mat(m.height(), m.width(), CV_32FC1, const_cast<float*>(m.data())).copyTo(to);
    };
    copy(shutter_.map_x(), out.from_x);
    copy(shutter_.map_y(), out.from_y);
    cv::remap(out.colour, colour_, out.from_x, out.from_y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    cv::swap(out.colour, colour_);
    out.take_colour();
  }

 private:
  /// Frame i is the latest that the velocity knows of, if it is not broken.
  void look(int i) {
    source_->load(i, frame_);
    ahead_ = i;
    if (frame_.ok()) velocity_.push(frame_.rgbd());
  }

  apso::CameraVelocity velocity_;
  apso::RollingShutter shutter_;
  LoadedFrame frame_;  ///< the one ahead
  int ahead_ = -1;     ///< its number
  cv::Mat colour_;
};

}  // namespace track
