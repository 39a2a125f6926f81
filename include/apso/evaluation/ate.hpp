/// \file
/// Absolute trajectory error: how far the estimated positions are from the true ones after one rigid motion has laid
/// the estimate onto the ground truth. J. Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems",
/// IROS 2012.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/evaluation/association.hpp>
#include <apso/evaluation/trajectory.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/options.hpp>
#include <apso/status.hpp>
#include <apso/traits/pose.hpp>
#include <apso/traits/stamped_pose.hpp>

APSO_NAMESPACE_BEGIN

/// The rigid motion that lays one set of points onto another.
struct HornAlignment {
  Pose T_target_source = Pose::Identity();
  /// Directions the points fix: 3 in space, 2 in a plane (still unique), 1 on a line, 0 in one point. Below 2 the
  /// rotation is one of many that are equally good.
  int rank = 0;
};

/// Least-squares rigid motion without scale: minimises sum |R source_i + t - target_i|^2 over proper rotations R
/// (det R = +1, also for planar and mirrored points). Closed form: the unit quaternion of R is the eigenvector of the
/// largest eigenvalue of a symmetric 4x4 matrix made of the cross-covariance, B. K. P. Horn, JOSA A 1987.
/// \param target,source points of the same length [m], at least one
[[nodiscard]] inline HornAlignment align_horn(const std::vector<Eigen::Vector3d>& target,
                                              const std::vector<Eigen::Vector3d>& source) {
  expects(!target.empty() && target.size() == source.size(), "align_horn: need equally many points, at least one");
  const double n = static_cast<double>(target.size());
  Eigen::Vector3d mean_target = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_source = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < target.size(); ++i) {
    mean_target += target[i];
    mean_source += source[i];
  }
  mean_target *= 1.0 / n;
  mean_source *= 1.0 / n;
  expects(all_finite(mean_target) && all_finite(mean_source), "align_horn: points must be finite");
  double S[3][3] = {};  // sum of source times target^T, as in the article
  double spread_target = 0;
  double spread_source = 0;
  for (std::size_t i = 0; i < target.size(); ++i) {
    const Eigen::Vector3d q = target[i] - mean_target;
    const Eigen::Vector3d p = source[i] - mean_source;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) S[r][c] += p(r) * q(c);
    }
    spread_target += squared_norm(q);
    spread_source += squared_norm(p);
  }
  HornAlignment result;
  const double scale = std::sqrt(spread_target) * std::sqrt(spread_source);
  expects(std::isfinite(scale), "align_horn: points must be finite and not overflow when squared");
  // Points that only differ by rounding have no spread: 1e-12 of the coordinates' own size.
  const double rounding = 1e-12 * std::max(norm(mean_target), norm(mean_source));
  const bool spread = scale > 0 && std::sqrt(spread_target / n) > rounding && std::sqrt(spread_source / n) > rounding;
  Eigen::Quaterniond q(1, 0, 0, 0);
  if (spread) {
    for (auto& row : S) {
      for (double& s : row) s /= scale;
    }
    double N[4][4];  // lower triangle
    N[0][0] = S[0][0] + S[1][1] + S[2][2];
    N[1][0] = S[1][2] - S[2][1];
    N[2][0] = S[2][0] - S[0][2];
    N[3][0] = S[0][1] - S[1][0];
    N[1][1] = S[0][0] - S[1][1] - S[2][2];
    N[2][1] = S[0][1] + S[1][0];
    N[3][1] = S[2][0] + S[0][2];
    N[2][2] = S[1][1] - S[0][0] - S[2][2];
    N[3][2] = S[1][2] + S[2][1];
    N[3][3] = S[2][2] - S[0][0] - S[1][1];
    double values[4];
    double vectors[4][4];
    eigen_symmetric(N, values, vectors);
    // With the largest eigenvalue l_0, (l_0 + l_k) / 2 are the singular values of S (the last one signed).
    for (int k = 0; k < 3; ++k) result.rank += std::abs(values[3] + values[k]) > 2e-12 ? 1 : 0;
    q = unit({vectors[0][3], vectors[1][3], vectors[2][3], vectors[3][3]});
  }
  const Eigen::Matrix3d R = rotation(q);
  result.T_target_source = make_pose(R, mean_target - R * mean_source);
  return result;
}

/// How the estimate is laid onto the ground truth. There is no similarity with scale on purpose: RGB-D measures
/// scale, and a free scale hides its error.
enum class TrajectoryAlignment {
  Se3,  ///< rigid motion of least squares, align_horn()
  None  ///< both already share one world frame
};
[[nodiscard]] constexpr std::array<const char*, 2> enum_names(TrajectoryAlignment) { return {"se3", "none"}; }

struct AteOptions {
  TrajectoryAlignment alignment = TrajectoryAlignment::Se3;
  AssociationRule association = AssociationRule::Tum;
  double max_difference = 0;  ///< of the stamps of a pair [s]; 0 = what the association rule uses by default
  double time_offset = 0;     ///< added to the stamps of the estimate [s]

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("alignment", s.alignment);
    v("association", s.association);
    v("max_difference", s.max_difference, 0.0, 1e9);
    v("time_offset", s.time_offset, -1e12, 1e12);
  }
};

/// \tparam PoseT the pose type of the estimate
template <class PoseT = Pose>
struct BasicAteResult {
  /// TooFewMatches: no pair, or fewer than 3 for an alignment, and nothing else below is set but `pairs`.
  /// Degenerate: the positions lie on a line or in a point, so the rotation of the alignment is not unique (the errors
  /// are). Converged otherwise.
  Status status = Status::NotRun;
  Statistics statistics;                            ///< of the position errors [m]
  PoseT T_groundtruth_estimate = from_pose<PoseT>(Pose::Identity());  ///< maps the world of the estimate into that of the
                                                                      ///< ground truth
  std::vector<StampMatch> pairs;                    ///< first: index of the ground truth, second: of the estimate
  std::vector<double> errors;                       ///< one per pair [m]
};
using AteResult = BasicAteResult<>;

namespace detail {
[[nodiscard]] inline AteResult ate_of(const Trajectory& groundtruth, const Trajectory& estimate, const AteOptions& options) {
  validate(options, "ate");
  validate(groundtruth, "ate: ground truth");
  validate(estimate, "ate: estimate");
  AteResult result;
  result.pairs =
      associate(groundtruth, estimate, options.association, options.max_difference, options.time_offset);
  const bool align = options.alignment == TrajectoryAlignment::Se3;
  result.status = Status::TooFewMatches;
  if (result.pairs.size() < (align ? 3U : 1U)) return result;
  result.status = Status::Converged;
  std::vector<Eigen::Vector3d> truth;
  std::vector<Eigen::Vector3d> positions;
  truth.reserve(result.pairs.size());
  positions.reserve(result.pairs.size());
  for (const StampMatch& m : result.pairs) {
    truth.push_back(translation(groundtruth[m.first].T_world_body));
    positions.push_back(translation(estimate[m.second].T_world_body));
  }
  if (align) {
    const HornAlignment horn = align_horn(truth, positions);
    result.T_groundtruth_estimate = horn.T_target_source;
    if (horn.rank < 2) result.status = Status::Degenerate;
  }
  result.errors.reserve(truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    result.errors.push_back((transform(result.T_groundtruth_estimate, positions[i]) - truth[i]).norm());
  }
  result.statistics = compute_statistics(result.errors);
  return result;
}
}  // namespace detail

/// Absolute trajectory error, e_i = |R p_i + t - q_i| with the estimated position p_i and the true one q_i.
/// \param groundtruth,estimate any ranges whose entries have stamped_pose_traits (a Trajectory, pairs of seconds and a pose of
///        yours, ...): strictly increasing stamps, finite poses; their world frames may differ
/// \returns with T_groundtruth_estimate of the pose type of the estimate
template <class Truth = Trajectory, class Estimate = Trajectory>
[[nodiscard]] auto ate(const Truth& groundtruth, const Estimate& estimate, const AteOptions& options = {}) {
  check_stamped_pose<detail::range_value_t<Truth>>();
  check_stamped_pose<detail::range_value_t<Estimate>>();
  Trajectory truth_buffer;
  Trajectory estimate_buffer;
  AteResult r = detail::ate_of(as_trajectory(groundtruth, truth_buffer), as_trajectory(estimate, estimate_buffer), options);
  using PoseT = detail::stamped_pose_call_t<detail::range_value_t<Estimate>>;
  if constexpr (std::is_same_v<PoseT, Pose>) {
    return r;
  } else {
    return BasicAteResult<PoseT>{r.status, r.statistics, from_pose<PoseT>(r.T_groundtruth_estimate), std::move(r.pairs),
                                 std::move(r.errors)};
  }
}

APSO_NAMESPACE_END
