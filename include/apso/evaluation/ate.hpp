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
#include <apso/math/rigid_alignment.hpp>
#include <apso/math/se3.hpp>
#include <apso/options.hpp>
#include <apso/status.hpp>
#include <apso/traits/pose.hpp>
#include <apso/traits/stamped_pose.hpp>

APSO_NAMESPACE_BEGIN

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
  PoseT T_groundtruth_estimate = from_pose<PoseT>(identity_pose());  ///< maps the world of the estimate into that of the
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
