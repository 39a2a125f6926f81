/// \file
/// S_dc, the depth residual: a score of equation (7), on coarse samples of two depth images.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <apso/config.hpp>
#include <apso/quality/score_list.hpp>
#include <apso/quality/scores/change_scale.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

struct DepthChangeOptions {
  double scale_mean = 0.19;    ///< s_mu, relative depth; found by apso_calibrate (docs/quality.md)
  double scale_spread = 0.38;  ///< s_sigma, relative depth; found by apso_calibrate
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("scale_mean", s.scale_mean, 1e-6, 100.0);
    v("scale_spread", s.scale_spread, 1e-6, 100.0);
  }
};

/// Every fourth pixel both ways is compared, for a sixteenth of the time.
inline constexpr int kDepthSampleStride = 4;
/// Share of the smaller frame's pixels, seen in both, that counts as all of them.
inline constexpr double kFullDepthOverlap = 0.5;

/// Every fourth pixel of a depth image both ways; 0 where the depth is invalid or the pixel dynamic.
struct DepthSamples {
  Image<float> depth;    ///< [m]
  int valid = 0;         ///< samples that are not 0
  bool present = false;  ///< false: there was no depth image
};

/// Samples a depth image [m]. An empty image gives samples that are not present.
/// \param scratch_depth,scratch_dynamic working memory for rows that are not floats
inline void sample_depth(const AnyImage& depth, const AnyImage& dynamic_probability, const DepthRange& range, DepthSamples& out,
                         std::vector<float>& scratch_depth, std::vector<float>& scratch_dynamic) {
  out.valid = 0;
  out.present = !depth.empty();
  if (!out.present) {
    out.depth.resize(0, 0);
    return;
  }
  const bool masked = !dynamic_probability.empty();
  expects(!masked || (dynamic_probability.width() == depth.width() && dynamic_probability.height() == depth.height()),
          "sample_depth: the depth image and the dynamic map differ in size");
  constexpr int stride = kDepthSampleStride;
  out.depth.resize((depth.width() + stride - 1) / stride, (depth.height() + stride - 1) / stride);
  auto depth_row = rows(depth, scratch_depth);
  auto dynamic_row = rows(masked ? dynamic_probability : depth, scratch_dynamic);
  for (int y = 0; y < out.depth.height(); ++y) {
    const float* z = depth_row(y * stride);
    const float* p = masked ? dynamic_row(y * stride) : nullptr;
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
/// The same with working memory of its own.
inline void sample_depth(const AnyImage& depth, const AnyImage& dynamic_probability, DepthSamples& out, const DepthRange& range = {}) {
  std::vector<float> scratch_depth, scratch_dynamic;
  sample_depth(depth, dynamic_probability, range, out, scratch_depth, scratch_dynamic);
}

/// What S_dc is made of.
struct DepthChangeMeasure {
  double mean = 0;     ///< mean |q|, q = (Z_i - Z_r) / Z_r limited to [-1,1]
  double spread = 0;   ///< population standard deviation of q
  double overlap = 0;  ///< rho_v, [0,1]
  int common = 0;      ///< samples valid in both frames
  Deviation score{1.0};
};

/// S_dc of the measured numbers: 1 - rho_v exp(-(mean / s_mu + spread / s_sigma) / 2).
[[nodiscard]] inline Deviation depth_deviation(double mean, double spread, double overlap, const DepthChangeOptions& options = {}) {
  return Deviation(1.0 - overlap * std::exp(-0.5 * (mean / options.scale_mean + spread / options.scale_spread)));
}

/// S_dc between two sampled frames; 1 when they have no valid static sample in common.
[[nodiscard]] inline DepthChangeMeasure depth_change(const DepthSamples& reference, const DepthSamples& current,
                                                     const DepthChangeOptions& options = {}) {
  expects(reference.depth.width() == current.depth.width() && reference.depth.height() == current.depth.height(),
          "depth_change: the samples differ in size");
  DepthChangeMeasure r;
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
  r.overlap = std::min(1.0, r.common / std::max(1.0, kFullDepthOverlap * std::min(reference.valid, current.valid)));
  r.score = depth_deviation(r.mean, r.spread, r.overlap, options);
  return r;
}

/// S_dc as a score of a list.
struct DepthChange {
  static constexpr const char* name = "S_dc";
  static constexpr const char* options_name = "depth_change";
  static constexpr const char* weight_name = "depth";
  static constexpr double default_weight = 0.40;
  using Value = Deviation;
  using Options = DepthChangeOptions;
  using Memory = DepthSamples;
  struct Measured {
    double mean = 0;     ///< relative
    double spread = 0;   ///< relative
    double overlap = 0;  ///< rho_v, [0,1]
    template <class Self, class V>
    static void columns(Self& m, V&& column) {
      column("depth_mean", m.mean);
      column("depth_spread", m.spread);
      column("depth_overlap", m.overlap);
    }
  };
  Options options;
  Measured measured;

  void remember(const FrameContext& frame, Memory& memory) {
    sample_depth(frame.depth, frame.dynamic_probability, frame.depth_range, memory, scratch_depth_, scratch_dynamic_);
  }
  MaybeDeviation operator()(const ChangeContext<Memory>& frames) {
    measured = {};
    if (!frames.reference.present || !frames.current.present) return std::nullopt;
    const DepthChangeMeasure m = depth_change(frames.reference, frames.current, options);
    measured = {m.mean, m.spread, m.overlap};
    return m.score;
  }
  static std::string reason(Deviation, const Measured& m) { return "depth differs by " + std::to_string(std::lround(100 * m.mean)) + " %"; }
  /// The score that other options would have given.
  static Deviation revalue(const Measured& m, const Options& o) { return depth_deviation(m.mean, m.spread, m.overlap, o); }
  /// Finds the scales on calm frames.
  static void calibrate(const std::vector<Measured>& reference, const std::vector<Measured>&, Options& o) {
    adopt_change_scale(reference, &Measured::mean, o.scale_mean);
    adopt_change_scale(reference, &Measured::spread, o.scale_spread);
  }

 private:
  std::vector<float> scratch_depth_;
  std::vector<float> scratch_dynamic_;
};

APSO_NAMESPACE_END
