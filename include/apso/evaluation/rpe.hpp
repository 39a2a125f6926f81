/// \file
/// Relative pose error: how far the estimated motion over a fixed interval is from the true motion. Pairs are chosen
/// exactly as by evaluate_rpe.py --fixed_delta of the TUM RGB-D benchmark, so that numbers compare with published ones.
/// J. Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", IROS 2012.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/evaluation/trajectory.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/se3.hpp>
#include <apso/options.hpp>
#include <apso/status.hpp>
#include <apso/traits/stamped_pose.hpp>

APSO_NAMESPACE_BEGIN

/// What the interval of a relative motion is measured in.
enum class DeltaUnit {
  Seconds,
  Frames,   ///< poses of the estimate
  Metres,   ///< length of the estimated path
  Radians,  ///< angle turned along the estimated path
  Degrees   ///< the same in degrees
};
[[nodiscard]] constexpr std::array<const char*, 5> enum_names(DeltaUnit) { return {"s", "f", "m", "rad", "deg"}; }

/// Which relative motion the error is. With A = P_i^-1 P_j (estimate) and B = Q_i^-1 Q_j (truth) the angles are the
/// same, the lengths are not: some per cent apart on real recordings.
enum class RpeForm {
  TumScript,  ///< A B^-1, and no pair that ends with the last pose, as in evaluate_rpe.py
  Paper       ///< B^-1 A, and over frames all n - delta pairs, as printed in Sturm et al. and computed by evo
};
[[nodiscard]] constexpr std::array<const char*, 2> enum_names(RpeForm) { return {"tum", "paper"}; }

struct RpeOptions {
  double delta = 1.0;  ///< length of the interval, > 0
  DeltaUnit unit = DeltaUnit::Seconds;
  RpeForm form = RpeForm::TumScript;
  int max_pairs = 10000;   ///< more pairs than this are sampled; 0 = never
  unsigned seed = 0;       ///< of the sample
  double time_offset = 0;  ///< added to the stamps of the estimate [s]

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("delta", s.delta, 1e-9, 1e9);
    v("unit", s.unit);
    v("form", s.form);
    v("max_pairs", s.max_pairs, 0, 1000000000);
    v("seed", s.seed, 0U, 4294967295U);
    v("time_offset", s.time_offset, -1e12, 1e12);
  }
};

/// The two poses of the estimate and of the ground truth that one error compares.
struct RpePair {
  std::size_t estimate_i = 0, estimate_j = 0;
  std::size_t groundtruth_i = 0, groundtruth_j = 0;
};

struct RpeResult {
  /// TooFewMatches when there is no pair (every statistic is then 0 with count 0); Converged otherwise.
  Status status = Status::NotRun;
  Statistics translation;   ///< [m] per interval
  Statistics rotation_deg;  ///< [deg] per interval
  std::vector<RpePair> pairs;
  std::vector<double> translation_errors;   ///< one per pair [m]
  std::vector<double> rotation_errors_deg;  ///< one per pair [deg]
};

namespace detail {
/// Index of the value closest to t in a sorted, non-empty list. Between two equally close values the script keeps the
/// one its bisection meets first; the same steps are taken here.
[[nodiscard]] inline std::size_t closest_by_bisection(const std::vector<double>& sorted, double t) {
  std::size_t begin = 0;
  std::size_t end = sorted.size();
  std::size_t best = 0;
  double difference = std::abs(sorted[0] - t);
  while (begin < end) {
    const std::size_t middle = (begin + end) / 2;
    if (std::abs(sorted[middle] - t) < difference) {
      difference = std::abs(sorted[middle] - t);
      best = middle;
    }
    if (sorted[middle] == t) return middle;
    if (sorted[middle] > t) {
      end = middle;
    } else {
      begin = middle + 1;
    }
  }
  return best;
}

/// Position of every pose on the axis that delta is measured along; never decreasing.
[[nodiscard]] inline std::vector<double> delta_axis(const Trajectory& trajectory, DeltaUnit unit) {
  std::vector<double> axis;
  axis.reserve(trajectory.size());
  double sum = 0;
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    if (unit == DeltaUnit::Seconds) {
      sum = trajectory[i].timestamp;
    } else if (unit == DeltaUnit::Frames) {
      sum = static_cast<double>(i);
    } else if (i > 0) {
      const Pose step = compose(inverse(trajectory[i].T_world_body), trajectory[i - 1].T_world_body);
      if (unit == DeltaUnit::Metres) sum += norm(translation(step));
      if (unit == DeltaUnit::Radians) sum += rotation_angle(step);
      if (unit == DeltaUnit::Degrees) sum += rotation_angle(step) / kDegree;
    }
    axis.push_back(sum);
  }
  return axis;
}

/// Keeps `count` elements chosen at random, in their order. The same on every platform: mt19937_64 is fixed by the
/// standard, the distributions of the standard library are not and are not used.
template <class T>
void keep_sample(std::vector<T>& values, std::size_t count, unsigned seed) {
  if (values.size() <= count) return;
  std::mt19937_64 random(seed);
  std::size_t kept = 0;
  const std::size_t n = values.size();
  for (std::size_t i = 0; i < n && kept < count; ++i) {  // Knuth's algorithm S
    const double u = static_cast<double>(random() >> 11U) * 0x1.0p-53;
    if (u * static_cast<double>(n - i) < static_cast<double>(count - kept)) values[kept++] = values[i];
  }
  values.resize(kept);
}
}  // namespace detail

namespace detail {
[[nodiscard]] inline RpeResult rpe_of(const Trajectory& groundtruth, const Trajectory& estimate, const RpeOptions& options) {
  validate(options, "rpe");
  validate(groundtruth, "rpe: ground truth");
  validate(estimate, "rpe: estimate");
  RpeResult result;
  result.status = Status::TooFewMatches;
  if (groundtruth.size() < 2 || estimate.size() < 2) return result;

  const std::vector<double> axis = delta_axis(estimate, options.unit);
  const bool over_frames_as_printed = options.form == RpeForm::Paper && options.unit == DeltaUnit::Frames;
  std::vector<std::pair<std::size_t, std::size_t>> chosen;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const std::size_t j = closest_by_bisection(axis, axis[i] + options.delta);
    const bool whole = over_frames_as_printed && axis[j] == axis[i] + options.delta;
    if (whole || j + 1 != estimate.size()) chosen.emplace_back(i, j);
  }
  if (options.max_pairs > 0) keep_sample(chosen, static_cast<std::size_t>(options.max_pairs), options.seed);

  const std::vector<double> stamps = timestamps(groundtruth);
  std::vector<double> intervals;
  intervals.reserve(stamps.size() - 1);
  for (std::size_t i = 1; i < stamps.size(); ++i) intervals.push_back(stamps[i] - stamps[i - 1]);
  const double max_difference = 2.0 * compute_statistics(std::move(intervals)).median;

  for (const auto& [i, j] : chosen) {
    const double t_i = estimate[i].timestamp + options.time_offset;
    const double t_j = estimate[j].timestamp + options.time_offset;
    const std::size_t g_i = closest_by_bisection(stamps, t_i);
    const std::size_t g_j = closest_by_bisection(stamps, t_j);
    if (std::abs(stamps[g_i] - t_i) > max_difference || std::abs(stamps[g_j] - t_j) > max_difference) continue;
    const Pose A = compose(inverse(estimate[i].T_world_body), estimate[j].T_world_body);
    const Pose B = compose(inverse(groundtruth[g_i].T_world_body), groundtruth[g_j].T_world_body);
    const Pose E = options.form == RpeForm::TumScript ? compose(A, inverse(B)) : compose(inverse(B), A);
    result.pairs.push_back({i, j, g_i, g_j});
    result.translation_errors.push_back(norm(translation(E)));
    result.rotation_errors_deg.push_back(rotation_angle(E) / kDegree);
  }
  if (result.pairs.empty()) return result;
  result.status = Status::Converged;
  result.translation = compute_statistics(result.translation_errors);
  result.rotation_deg = compute_statistics(result.rotation_errors_deg);
  return result;
}
}  // namespace detail

/// Relative pose error over a fixed interval. For every pose i of the estimate, j is the pose closest to i + delta. Pairs whose j
/// is the last pose are dropped, since the interval may be cut short there; RpeForm::Paper over frames keeps the one that is whole.
/// Dropped as well are pairs where the nearest pose of the ground truth is farther in time than twice the median interval of the
/// ground truth. As in the script, j may be i itself where the estimate has a gap of more than twice delta; such a pair has no error.
/// Rigid motions of either world change nothing, so no alignment is needed; but both trajectories must be of the same body: a fixed
/// motion between the bodies does change the result.
/// \param groundtruth,estimate any ranges whose entries have stamped_pose_traits (a Trajectory, pairs of seconds and a pose of
///        yours, ...): strictly increasing stamps, finite poses
template <class Truth = Trajectory, class Estimate = Trajectory>
[[nodiscard]] RpeResult rpe(const Truth& groundtruth, const Estimate& estimate, const RpeOptions& options = {}) {
  check_stamped_pose<detail::range_value_t<Truth>>();
  check_stamped_pose<detail::range_value_t<Estimate>>();
  Trajectory truth_buffer;
  Trajectory estimate_buffer;
  return detail::rpe_of(as_trajectory(groundtruth, truth_buffer), as_trajectory(estimate, estimate_buffer), options);
}

APSO_NAMESPACE_END
