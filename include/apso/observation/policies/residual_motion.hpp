/// \file
/// Motion from what a dense alignment with a recent frame cannot explain.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/geometry/low_res_alignment.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/observation/policies/past_comparison.hpp>
#include <apso/options.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

struct ResidualMotionOptions {
  DepthRange depth;     ///< depth that is used
  double moving = 3.5;  ///< residual at which motion is as likely as rest [standard deviations]
  int dilation = 4;     ///< the mask is widened by this [px]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("depth", s.depth);
    v("moving", s.moving, 0.1, 100.0);
    v("dilation", s.dilation, 0, 200);
  }
};

/// Aligns the frame densely with one of about 0.2 seconds ago and reads the residuals: r^2 is the mean squared
/// residual around a pixel, in variances, and r^2 / (r^2 + moving^2) its probability to have moved (one minus the
/// Cauchy weight).
///
/// A point behind what was seen then has just been uncovered: nothing is known about it. A surface without texture
/// that moves in its own plane leaves no residual. When most of the view moves, the alignment follows what moves.
class ResidualMotion : public PolicyOperators {
 public:
  using Options = ResidualMotionOptions;

  explicit ResidualMotion(const Pinhole& camera, const ResidualMotionOptions& options = {})
      : moving_(checked(options).moving), comparison_(camera, options.depth, rules(options)) {}

  void observe(const AnyFrame& frame, const AnyPose& T_world_camera_prior, const AnyTracks&, DynamicMask& out) {
    const auto compare = [this](const SmallFrame& current, const SmallFrame& past, const Pose& T_prior, Image<float>& probability,
                                Image<std::uint8_t>& known) {
      const Pinhole& camera = comparison_.small_camera();
      const LowResAlignment found = align_low_res(current, past, camera, T_prior, nullptr, kIterations, scratch_);
      read_residuals(current, past, camera, found.T_past_current);
      average(current.depth, probability, known);
    };
    comparison_.observe(frame, T_world_camera_prior, compare, out);
  }
  void remember(const AnyFrame&, const AnyPose& T_world_camera, const DynamicMask&) { comparison_.remember(T_world_camera); }
  void reset() { comparison_.reset(); }

 private:
  static constexpr int kIterations = 8;  // of the alignment, from a prior that may be off by centimetres

  static const Options& checked(const Options& options) {
    validate(options, "residual");
    return options;
  }
  static RegionRules rules(const Options& options) {
    RegionRules r;
    r.dilation = options.dilation;
    return r;
  }

  void read_residuals(const SmallFrame& current, const SmallFrame& past, const Pinhole& camera, const Pose& T) {
    const FloatPose warp(T);
    squared_.assign(camera.width, camera.height, -1.0F);
    WarpedPixel p;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        if (!warp_pixel(current, x, y, past, camera, warp, p)) continue;
        const float d = p.r_depth / p.sigma_depth;
        if (d < -4.0F) continue;  // uncovered: says nothing about the point
        const float i = p.r_intensity / p.sigma_intensity;
        squared_(x, y) = std::min(100.0F, 0.5F * (d * d + i * i));
      }
    }
  }
  void average(const Image<float>& depth, Image<float>& probability, Image<std::uint8_t>& known) {
    const auto c2 = static_cast<float>(moving_ * moving_);
    constexpr int n = 1;  // residuals are averaged over (2 n + 1)^2 pixels of one surface
    for (int y = 0; y < depth.height(); ++y) {
      for (int x = 0; x < depth.width(); ++x) {
        if (squared_(x, y) < 0) continue;
        const float z = depth(x, y);
        float sum = 0;
        float count = 0;
        for (int j = std::max(0, y - n); j <= std::min(depth.height() - 1, y + n); ++j) {
          for (int i = std::max(0, x - n); i <= std::min(depth.width() - 1, x + n); ++i) {
            const float s = squared_(i, j);
            if (s < 0 || std::abs(depth(i, j) - z) > same_surface(z)) continue;
            sum += s;
            count += 1;
          }
        }
        const float mean = sum / count;  // the pixel itself always counts
        probability(x, y) = mean / (mean + c2);
        known(x, y) = 1;
      }
    }
  }

  double moving_;
  PastComparison comparison_;
  Image<float> squared_;
  std::vector<float> scratch_;
};

APSO_NAMESPACE_END
