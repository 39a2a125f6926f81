/// \file
/// S_dc of the paper: the depth residual of S_change (eq. Change Score), on coarse samples of two depth images.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <apso/config.hpp>
#include <apso/quality/static_pixel.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

struct DepthChangeOptions {
  DepthRange range;
  int stride = 4;              ///< every stride-th pixel both ways is compared
  double scale_mean = 0.19;    ///< s_mu, relative depth
  double scale_spread = 0.38;  ///< s_sigma, relative depth
  double full_overlap = 0.5;   ///< share of the smaller frame's pixels that counts as all of them
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("range", s.range);
    v("stride", s.stride, 1, 64);
    v("scale_mean", s.scale_mean, 1e-6, 100.0);
    v("scale_spread", s.scale_spread, 1e-6, 100.0);
    v("full_overlap", s.full_overlap, 1e-3, 1.0);
  }
};

/// Every stride-th pixel of a depth image; 0 where the depth is invalid or the pixel dynamic.
struct DepthSamples {
  Image<float> depth;  ///< [m]
  int valid = 0;       ///< samples that are not 0
  bool present = false;  ///< false: there was no depth image
};

/// Samples a depth image. An empty image gives samples that are not present.
inline void sample_depth(ImageView<const float> depth, ImageView<const float> dynamic_probability,
                         const DepthChangeOptions& options, DepthSamples& out) {
  out.valid = 0;
  out.present = !depth.empty();
  if (!out.present) {
    out.depth.resize(0, 0);
    return;
  }
  expects(dynamic_probability.empty() ||
              (dynamic_probability.width == depth.width && dynamic_probability.height == depth.height),
          "sample_depth: the depth image and the dynamic map differ in size");
  const int stride = options.stride;
  const DepthRange range = options.range;
  out.depth.resize((depth.width + stride - 1) / stride, (depth.height + stride - 1) / stride);
  for (int y = 0; y < out.depth.height(); ++y) {
    const float* z = depth.row(y * stride);
    const float* p = dynamic_probability.empty() ? nullptr : dynamic_probability.row(y * stride);
    float* o = out.depth.row(y);
    int n = 0;
    for (int x = 0; x < out.depth.width(); ++x) {
      const float value = z[x * stride];
      const bool use = depth_valid(value, range) && (p == nullptr || p[x * stride] < kDynamicThreshold);
      o[x] = use ? value : 0.0F;
      n += use;
    }
    out.valid += n;
  }
}

struct DepthChange {
  double mean = 0;     ///< mean |q|, q = (Z_i - Z_r) / Z_r limited to [-1,1]
  double spread = 0;   ///< population standard deviation of q
  double overlap = 0;  ///< rho_v, [0,1]
  int common = 0;      ///< samples valid in both frames
  Deviation score{1.0};
};

/// S_dc of the measured numbers: 1 - rho_v exp(-(mean / s_mu + spread / s_sigma) / 2).
[[nodiscard]] inline Deviation depth_deviation(double mean, double spread, double overlap,
                                               const DepthChangeOptions& options = {}) {
  return Deviation(1.0 - overlap * std::exp(-0.5 * (mean / options.scale_mean + spread / options.scale_spread)));
}

/// S_dc between two sampled frames; 1 when they have no valid static sample in common.
[[nodiscard]] inline DepthChange depth_change(const DepthSamples& reference, const DepthSamples& current,
                                              const DepthChangeOptions& options = {}) {
  expects(reference.depth.width() == current.depth.width() && reference.depth.height() == current.depth.height(),
          "depth_change: the samples differ in size");
  DepthChange r;
  double sum = 0;
  double sum_abs = 0;
  double sum_squares = 0;
  for (int y = 0; y < current.depth.height(); ++y) {
    const float* a = reference.depth.row(y);
    const float* b = current.depth.row(y);
    int n = 0;
    float row = 0;
    float row_abs = 0;
    float row_squares = 0;
    for (int x = 0; x < current.depth.width(); ++x) {
      const bool both = a[x] > 0.0F && b[x] > 0.0F;
      float q = both ? (b[x] - a[x]) / a[x] : 0.0F;
      q = q < 1.0F ? q : 1.0F;  // it cannot be below -1
      n += both;
      row += q;
      row_abs += std::abs(q);
      row_squares += q * q;
    }
    r.common += n;
    sum += static_cast<double>(row);
    sum_abs += static_cast<double>(row_abs);
    sum_squares += static_cast<double>(row_squares);
  }
  if (r.common == 0) return r;
  const double mean = sum / r.common;
  r.mean = sum_abs / r.common;
  r.spread = std::sqrt(std::max(0.0, sum_squares / r.common - mean * mean));
  r.overlap = std::min(1.0, r.common / std::max(1.0, options.full_overlap * std::min(reference.valid, current.valid)));
  r.score = depth_deviation(r.mean, r.spread, r.overlap, options);
  return r;
}

APSO_NAMESPACE_END
