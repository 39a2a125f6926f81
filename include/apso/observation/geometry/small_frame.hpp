/// \file
/// A frame at the low resolution on which moving regions are looked for, and a clock that always runs forward.
#pragma once

#include <algorithm>
#include <cmath>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/geometry/low_res_depth.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

/// One frame, reduced by a whole factor.
struct SmallFrame {
  double time = 0;                       ///< [s]
  Pose T_world_camera = Pose::Identity();
  Image<float> depth;                    ///< [m], 0 invalid
  Image<float> intensity;                ///< [0,1]
};

/// Whole factor by which a camera is reduced to about `width` columns.
[[nodiscard]] inline int reduction_factor(const Pinhole& camera, int width) {
  return std::max(1, static_cast<int>(std::lround(static_cast<double>(camera.width) / width)));
}

/// Reduces intensity to the mean of each block of factor x factor pixels.
inline void reduce_intensity(ImageView<const float> image, int factor, int width, int height, Image<float>& out) {
  out.resize(width, height);
  const float scale = 1.0F / static_cast<float>(factor * factor);
  for (int y = 0; y < height; ++y) {
    float* o = out.row(y);
    std::fill(o, o + width, 0.0F);
    for (int j = 0; j < factor; ++j) {
      const float* r = image.row(y * factor + j);
      for (int x = 0; x < width; ++x) {
        for (int i = 0; i < factor; ++i) o[x] += r[x * factor + i];
      }
    }
    for (int x = 0; x < width; ++x) {
      const float mean = o[x] * scale;
      o[x] = mean >= 0 && mean <= 1e3F ? mean : 0.0F;  // also catches NaN
    }
  }
}

/// Reduces depth and intensity of a frame; `camera` is the small one.
inline void reduce_frame(const RgbdFrame& frame, int factor, const DepthRange& range, const Pinhole& camera,
                         SmallFrame& out) {
  reduce_depth(frame.depth, factor, range, camera.width, camera.height, out.depth);
  reduce_intensity(frame.intensity, factor, camera.width, camera.height, out.intensity);
}

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
