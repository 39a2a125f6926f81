/// \file
/// How far a direct pose may be trusted: c_dir in [0,1].
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <apso/config.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/options.hpp>
#include <apso/refinement/alignment_result.hpp>
#include <apso/status.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// Robust scales of the residuals on good frames of a structured-light camera, in units of the noise model: what the
/// confidence compares with until there are measurements (medians over fr1_desk, fr1_rpy and Bonn recordings).
inline constexpr double kTypicalScaleIntensity = 0.65;
inline constexpr double kTypicalScaleDepth = 1.1;

struct DirectConfidenceOptions {
  double intensity_share = 0.0;    ///< share a of the intensity scale in u; 0.5 = geometric mean of both
  double min_entropy_ratio = 0.0;  ///< a pose whose entropy is a smaller share of the typical one gets 0 (0.6 in DVO-SLAM,
                                   ///< Kerl et al., IROS 2013); 0 = not asked
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("intensity_share", s.intensity_share, 0.0, 1.0);
    v("min_entropy_ratio", s.min_entropy_ratio, 0.0, 10.0);
  }
};

namespace detail {
// 0 up to `zero`, 1 from `one` on, linear between; a step where both are the same.
inline double rising(double x, double zero, double one) {
  if (x >= one) return 1;
  return x > zero ? (x - zero) / (one - zero) : 0.0;
}
// 1 up to `one`, 0 from `zero` on, linear between; a step where both are the same.
inline double falling(double x, double one, double zero) {
  if (x <= one) return 1;
  return x < zero ? (x - zero) / (one - zero) : 0.0;
}

// Between which values the factors of the confidence go from one to zero.
inline constexpr double kSpreadFull = 1.0, kSpreadNone = 1.75;  // right results stay below 1.15 on synthetic recordings
inline constexpr double kCorrelationNone = 0.7, kCorrelationFull = 0.9;
inline constexpr double kSigmaFull = 0.01, kSigmaNone = 0.02;  // [m]
inline constexpr double kMinValidShare = 0.3;
inline constexpr double kMaxIterationsFactor = 0.5;
}  // namespace detail

/// c_dir = sqrt(rho_v) (1 - n_deg/6)^2 f(u) f(r) f(sigma), halved when the iterations ran out; each f goes from one to
/// zero between two limits.
/// - u: final robust scale of the depth residuals relative to what it is on good frames. That of the intensities is left
///   out (`intensity_share`): blur, darkness and flashes raise it tenfold on frames whose direct pose is right to
///   millimetres, and these are the frames that need it.
/// - r: correlation of the images, which blur and brightness leave alone. It misses no pose that follows moving bodies in
///   front of a bare wall, where the scales stay small.
/// - sigma: standard deviation of the position. A pose that hangs on little, as along a wall or in a crowd, is not better
///   than the feature pose even when all that is seen fits.
/// The share of small residuals is of no use: after scaling by the residuals themselves it rises when alignment fails.
/// \param typical_intensity,typical_depth the scales on good frames; unset (<= 0) gives 0
[[nodiscard]] inline double direct_confidence(const AlignmentResult& r, double typical_intensity, double typical_depth,
                                              const DirectConfidenceOptions& o = {}) {
  using namespace detail;
  if (!succeeded(r.status) || !(r.valid_share >= kMinValidShare)) return 0;
  if (!(typical_intensity > 0) || !(typical_depth > 0) || !(r.scale_intensity > 0) || !(r.scale_depth > 0)) return 0;
  const double u = std::pow(r.scale_intensity / typical_intensity, o.intensity_share) *
                   std::pow(r.scale_depth / typical_depth, 1.0 - o.intensity_share);
  const double sigma = std::sqrt(std::max(0.0, r.covariance(0, 0) + r.covariance(1, 1) + r.covariance(2, 2)));
  const double fit = falling(u, kSpreadFull, kSpreadNone);
  const double agreement = rising(r.correlation, kCorrelationNone, kCorrelationFull);
  const double precision = falling(sigma, kSigmaFull, kSigmaNone);
  const double determined = 1.0 - r.degenerate_count / 6.0;
  const double finished = r.status == Status::MaxIterations ? kMaxIterationsFactor : 1.0;
  return clamp01(std::sqrt(r.valid_share) * determined * determined * fit * agreement * precision * finished);
}

/// Differential entropy of a pose, ln((2 pi e)^6 det(covariance)) / 2, with metres and radians; more negative = more
/// certain. Infinite when a direction is not determined. For DirectConfidenceOptions::min_entropy_ratio.
[[nodiscard]] inline double pose_entropy(const AlignmentResult& r) {
  if (r.degenerate_count > 0) return std::numeric_limits<double>::infinity();
  double log_determinant = 0;
  const Twist eigenvalues = eigen_symmetric(r.covariance).values;
  for (int i = 0; i < 6; ++i) log_determinant += std::log(eigenvalues(i));
  return 0.5 * (6 * std::log(2 * kPi * std::exp(1.0)) + log_determinant);
}

/// How certain a pose is against a typical one, 1 = as much, by their entropies, which are negative for poses that are known
/// to centimetres; 0 for a pose that is not determined.
[[nodiscard]] inline double entropy_ratio(double entropy, double typical) {
  return std::isfinite(entropy) && typical < 0 ? std::max(0.0, entropy / typical) : 0.0;
}

APSO_NAMESPACE_END
