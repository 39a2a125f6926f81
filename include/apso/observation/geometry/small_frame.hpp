/// \file
/// Frames at the low resolution on which moving regions are looked for: how they are made, the last few of them, and a
/// clock that always runs forward.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/geometry/low_res_depth.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Width of the images on which motion is looked for [px]. A person at 4 m is 16 px wide there, and a frame takes about
/// 5 ms (docs/observation.md).
inline constexpr int kMotionWidth = 160;

/// One frame, reduced by a whole factor.
struct SmallFrame {
  double time = 0;  ///< [s]
  Pose T_world_camera = identity_pose();
  Image<float> depth;      ///< [m], 0 invalid
  Image<float> intensity;  ///< [0,1]
};

/// Whole factor by which a camera is reduced to about `width` columns.
[[nodiscard]] inline int reduction_factor(const Pinhole& camera, int width) {
  return std::max(1, static_cast<int>(std::lround(static_cast<double>(camera.width) / width)));
}

/// Reduces frames of one camera by a whole factor. Reads each image once by rows and keeps nothing of it.
class FrameReducer {
 public:
  /// \param width about the width of the small images [px]
  /// \param range depth that is used; the rest becomes invalid
  FrameReducer(const Pinhole& camera, int width, const DepthRange& range)
      : camera_(camera), factor_(reduction_factor(camera, width)), range_(range) {
    camera.validate();
    small_ = reduced_camera(camera, factor_);
  }

  [[nodiscard]] const Pinhole& camera() const { return camera_; }  ///< of the frames
  [[nodiscard]] const Pinhole& small() const { return small_; }    ///< of the small images
  [[nodiscard]] int factor() const { return factor_; }             ///< pixels of the frame per small pixel, each way

  /// Small depth [m], 0 invalid; see reduce_depth. Throws contract_error if the frame does not have the size of the camera.
  void depth(const AnyFrame& frame, Image<float>& out) {
    expects(frame.depth().width() == camera_.width && frame.depth().height() == camera_.height,
            "motion policy: the depth image does not have the size of the camera");
    reduce_depth(frame.depth(), factor_, range_, small_.width, small_.height, rows_, out);
  }

  /// Small intensity: the mean of each block, 0 where that is not a number. Throws as depth() does.
  void intensity(const AnyFrame& frame, Image<float>& out) {
    expects(frame.intensity().width() == camera_.width && frame.intensity().height() == camera_.height,
            "motion policy: the intensity image does not have the size of the camera");
    out.resize(small_.width, small_.height);
    const float scale = 1.0F / static_cast<float>(factor_ * factor_);
    for (int y = 0; y < small_.height; ++y) {
      float* o = out.row(y);
      std::fill(o, o + small_.width, 0.0F);
      const float* const* block = rows_.read(frame.intensity(), y * factor_, factor_);
      for (int j = 0; j < factor_; ++j) {
        const float* r = block[j];
        for (int x = 0; x < small_.width; ++x) {
          for (int i = 0; i < factor_; ++i) o[x] += r[x * factor_ + i];
        }
      }
      for (int x = 0; x < small_.width; ++x) {
        const float mean = o[x] * scale;
        o[x] = mean >= 0 && mean <= 1e3F ? mean : 0.0F;  // also catches NaN
      }
    }
  }

  /// Both images of a frame; time and pose stay as they are.
  void frame(const AnyFrame& frame, SmallFrame& out) {
    depth(frame, out.depth);
    intensity(frame, out.intensity);
  }

 private:
  Pinhole camera_;
  Pinhole small_;
  int factor_;
  DepthRange range_;
  BlockRows rows_;
};

/// Small frames of the last `span` seconds, oldest first. Buffers are used again.
class ViewHistory {
 public:
  /// \param span age of the frame that is compared with [s]
  explicit ViewHistory(double span) : span_(span) {}

  /// Takes in a copy of a frame.
  void add(const SmallFrame& frame) {
    // the oldest may go when the next one is old enough as well
    while (frames_.size() > kMaximum || (frames_.size() > 1 && frame.time - frames_[1].time >= span_)) drop();
    SmallFrame f;
    if (!spare_.empty()) {
      f = std::move(spare_.back());
      spare_.pop_back();
    }
    f = frame;
    frames_.push_back(std::move(f));
  }
  /// The youngest frame that is at least `span` old at time `now`, else the oldest there is; null when there is none.
  [[nodiscard]] const SmallFrame* reference(double now) const {
    const SmallFrame* best = frames_.empty() ? nullptr : &frames_.front();
    for (const SmallFrame& f : frames_) {
      if (now - f.time >= span_) best = &f;
    }
    return best;
  }
  /// Forgets frames that are so old that the scene may have changed altogether.
  void forget_before(double time) {
    while (!frames_.empty() && frames_.front().time < time) drop();
  }
  void clear() {
    while (!frames_.empty()) drop();
  }

 private:
  void drop() {
    spare_.push_back(std::move(frames_.front()));
    frames_.erase(frames_.begin());
  }
  static constexpr std::size_t kMaximum = 32;
  double span_;
  std::vector<SmallFrame> frames_;
  std::vector<SmallFrame> spare_;
};

/// Time that always grows, also for data without usable stamps (then 30 frames per second).
class FrameClock {
 public:
  /// \returns seconds since the last call, >= 1e-4; 1/30 at the first
  double tick(double stamp) {
    const bool usable = std::isfinite(stamp) && started_ && stamp > stamp_;
    const double dt = usable ? std::max(1e-4, stamp - stamp_) : 1.0 / 30.0;
    if (std::isfinite(stamp)) stamp_ = stamp;
    if (started_) time_ += dt;
    started_ = true;
    return dt;
  }
  [[nodiscard]] double now() const { return time_; }  ///< [s] since the first call

 private:
  double time_ = 0;
  double stamp_ = 0;
  bool started_ = false;
};

APSO_NAMESPACE_END
