/// \file
/// How far a direct pose may be trusted: c_dir in [0,1].
#pragma once

#include <cmath>

#include <apso/config.hpp>
#include <apso/options.hpp>
#include <apso/refinement/aligner.hpp>
#include <apso/status.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

struct DirectConfidenceOptions {
  double intensity_share = 0.0;   ///< share a of the intensity scale in u; 0.5 = geometric mean of both
  double u_low = 1.0;        ///< relative residual spread up to which the confidence is full
  double u_high = 1.75;      ///< and from which it is zero; right results stay below 1.15 on synthetic recordings
  double min_valid_share = 0.3;
  double correlation_low = 0.7;   ///< correlation of the two images up to which the confidence is zero
  double correlation_high = 0.9;  ///< and from which it is full
  double sigma_low = 0.01;        ///< standard deviation of the position up to which the confidence is full [m]
  double sigma_high = 0.02;       ///< and from which it is zero [m]
  double max_iterations = 0.5;    ///< factor when the iterations ran out
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("intensity_share", s.intensity_share, 0.0, 1.0);
    v("u_low", s.u_low, 0.0, 100.0);
    v("u_high", s.u_high, 0.0, 100.0);
    v("min_valid_share", s.min_valid_share, 0.0, 1.0);
    v("correlation_low", s.correlation_low, -1.0, 1.0);
    v("correlation_high", s.correlation_high, -1.0, 1.0);
    v("sigma_low", s.sigma_low, 0.0, 100.0);
    v("sigma_high", s.sigma_high, 0.0, 100.0);
    v("max_iterations", s.max_iterations, 0.0, 1.0);
  }
};

namespace detail {
// 0 at `zero` and beyond, 1 at `one` and beyond, linear between; a step at `one` when both are the same.
inline double ramp(double x, double zero, double one) {
  if (zero == one) return x == one ? 1.0 : 0.0;
  return clamp01((x - zero) / (one - zero));
}
}  // namespace detail

/// c_dir = sqrt(rho_v) (1 - n_deg/6)^2 ramp(u) ramp(r) ramp(sigma), halved when the iterations ran out; each ramp falls
/// from one to zero between the two limits of the options.
/// - u: final robust scale of the depth residuals relative to what it is on good frames. That of the intensities is left
///   out (`intensity_share`): blur, darkness and flashes raise it tenfold on frames whose direct pose is right to
///   millimetres, and these are the frames that need it.
/// - r: correlation of the images, which blur and brightness leave alone. It misses no pose that follows moving bodies in
///   front of a bare wall, where the scales stay small.
/// - sigma: standard deviation of the position. A pose that hangs on little, as along a wall or in a crowd, is not better
///   than the feature pose even when all that is seen fits.
/// The share of small residuals is of no use: after scaling by the residuals themselves it rises when alignment fails.
/// \param usual_intensity,usual_depth the scales on good frames; unset (<= 0) gives 0
[[nodiscard]] inline double direct_confidence(const AlignmentResult& r, double usual_intensity, double usual_depth,
                                              const DirectConfidenceOptions& o = {}) {
  if (!succeeded(r.status) || !(r.valid_share >= o.min_valid_share)) return 0;
  if (!(usual_intensity > 0) || !(usual_depth > 0) || !(r.scale_intensity > 0) || !(r.scale_depth > 0)) return 0;
  const double u = std::pow(r.scale_intensity / usual_intensity, o.intensity_share) *
                   std::pow(r.scale_depth / usual_depth, 1.0 - o.intensity_share);
  const double sigma = std::sqrt(std::max(0.0, r.covariance(0, 0) + r.covariance(1, 1) + r.covariance(2, 2)));
  const double fit = detail::ramp(u, o.u_high, o.u_low);
  const double agreement = detail::ramp(r.correlation, o.correlation_low, o.correlation_high);
  const double precision = detail::ramp(sigma, o.sigma_high, o.sigma_low);
  const double determined = 1.0 - r.degenerate_count / 6.0;
  const double finished = r.status == Status::MaxIterations ? o.max_iterations : 1.0;
  return clamp01(std::sqrt(r.valid_share) * determined * determined * fit * agreement * precision * finished);
}

APSO_NAMESPACE_END
