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
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/low_res_alignment.hpp>
#include <apso/observation/small_frame.hpp>
#include <apso/observation/temporal_filter.hpp>
#include <apso/observation/view_history.hpp>
#include <apso/options.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

struct ResidualMotionOptions {
  int width = 160;          ///< width of the images that are worked on [px]
  DepthRange depth;         ///< depth that is used
  double span = 0.2;        ///< age of the frame that is compared with [s]
  double moving = 3.5;      ///< residual at which motion is as likely as rest [standard deviations]
  int patch = 1;            ///< residuals are averaged over (2 patch + 1)^2 pixels of one surface
  LowResAlignmentOptions alignment;
  TemporalFilterOptions filter;
  EvidenceMaskOptions mask;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("width", s.width, 16, 4096);
    v("depth", s.depth);
    v("span", s.span, 0.0, 10.0);
    v("moving", s.moving, 0.1, 100.0);
    v("patch", s.patch, 0, 10);
    v("alignment", s.alignment);
    v("filter", s.filter);
    v("mask", s.mask);
  }
};

/// Aligns the frame densely with one of about `span` seconds ago and reads the residuals: r^2 is the mean squared
/// residual around a pixel, in variances, and r^2 / (r^2 + moving^2) its probability to have moved (one minus the
/// Cauchy weight).
///
/// A point behind what was seen then has just been uncovered: nothing is known about it. A surface without texture
/// that moves in its own plane leaves no residual. When most of the view moves, the alignment follows what moves.
class ResidualMotion {
 public:
  explicit ResidualMotion(const Pinhole& camera, const ResidualMotionOptions& options = {})
      : camera_(camera), options_(options), filter_(options.filter), history_(options.span) {
    camera.validate();
    validate(options, "residual");
    factor_ = reduction_factor(camera, options.width);
    small_ = reduced_camera(camera, factor_);
  }

  void observe(const RgbdFrame& frame, const Pose& T_world_camera_prior, const std::vector<PointTrack>&,
               DynamicMask& out) {
    expects(frame.depth.width == camera_.width && frame.depth.height == camera_.height &&
                frame.intensity.width == camera_.width && frame.intensity.height == camera_.height,
            "ResidualMotion: the images do not have the size of the camera");
    const double dt = clock_.tick(frame.timestamp);
    current_.time = clock_.now();
    current_.T_world_camera = T_world_camera_prior;
    reduce_frame(frame, factor_, options_.depth, small_, current_);
    probability_.assign(small_.width, small_.height, 0.0F);
    known_.assign(small_.width, small_.height, 0);
    history_.forget_before(current_.time - 2.0);
    if (const SmallFrame* past = history_.reference(current_.time)) {
      const Pose prior = inverse(past->T_world_camera) * T_world_camera_prior;
      alignment_ = align_low_res(current_, *past, small_, prior, nullptr, options_.alignment, scratch_);
      read_residuals(*past, alignment_.T_past_current);
      average();
    }
    filter_.update(current_.depth, small_, T_world_camera_prior, dt, probability_, known_);
    maker_.make(current_.depth, probability_, known_, small_, factor_, camera_.width, camera_.height, options_.mask, out);
  }
  void remember(const RgbdFrame&, const Pose& T_world_camera, const DynamicMask&) {
    if (current_.depth.empty()) return;
    current_.T_world_camera = T_world_camera;
    filter_.correct(T_world_camera);
    history_.add(current_);
  }
  void reset() {
    history_.clear();
    filter_.reset();
    clock_ = {};
    current_ = {};
  }

  /// How the alignment of the last frame ended.
  [[nodiscard]] const LowResAlignment& alignment() const { return alignment_; }

 private:
  void read_residuals(const SmallFrame& past, const Pose& T) {
    const Eigen::Matrix3f R = T.linear().cast<float>();
    const Eigen::Vector3f t = T.translation().cast<float>();
    squared_.assign(small_.width, small_.height, -1.0F);
    WarpedPixel p;
    for (int y = 0; y < small_.height; ++y) {
      for (int x = 0; x < small_.width; ++x) {
        if (!warp_pixel(current_, x, y, past, small_, R, t, options_.alignment, p)) continue;
        const float d = p.r_depth / p.sigma_depth;
        if (d < -4.0F) continue;  // uncovered: says nothing about the point
        const float i = p.r_intensity / p.sigma_intensity;
        squared_(x, y) = std::min(100.0F, 0.5F * (d * d + i * i));
      }
    }
  }
  void average() {
    const auto c2 = static_cast<float>(options_.moving * options_.moving);
    const int n = options_.patch;
    for (int y = 0; y < small_.height; ++y) {
      for (int x = 0; x < small_.width; ++x) {
        if (squared_(x, y) < 0) continue;
        const float z = current_.depth(x, y);
        float sum = 0;
        float count = 0;
        for (int j = std::max(0, y - n); j <= std::min(small_.height - 1, y + n); ++j) {
          for (int i = std::max(0, x - n); i <= std::min(small_.width - 1, x + n); ++i) {
            const float s = squared_(i, j);
            if (s < 0 || std::abs(current_.depth(i, j) - z) > same_surface(z)) continue;
            sum += s;
            count += 1;
          }
        }
        const float mean = sum / count;  // the pixel itself always counts
        probability_(x, y) = mean / (mean + c2);
        known_(x, y) = 1;
      }
    }
  }

  Pinhole camera_;
  Pinhole small_;
  ResidualMotionOptions options_;
  int factor_ = 1;
  FrameClock clock_;
  SmallFrame current_;
  TemporalEvidence filter_;
  ViewHistory history_;
  EvidenceMask maker_;
  LowResAlignment alignment_;
  Image<float> squared_;
  Image<float> probability_;
  Image<std::uint8_t> known_;
  std::vector<float> scratch_;
};

APSO_NAMESPACE_END
