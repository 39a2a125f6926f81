/// \file
/// Absolute trajectory error: how far the estimated positions are from the true ones once the estimate has been aligned with the
/// ground truth, by a rigid motion unless asked otherwise. J. Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems",
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
#include <apso/math/similarity_alignment.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/options.hpp>
#include <apso/status.hpp>
#include <apso/traits/pose.hpp>
#include <apso/traits/stamped_pose.hpp>

APSO_NAMESPACE_BEGIN

/// How the estimate is laid onto the ground truth. RGB-D, stereo and inertial sensors measure scale, and a free scale hides its error:
/// Sim3 is for one camera alone.
enum class TrajectoryAlignment {
  Se3,   ///< rigid motion of least squares, align_horn()
  None,  ///< both already share one world frame
  Sim3,  ///< rigid motion and scale, align_umeyama()
  Yaw    ///< translation and turn about the axis of gravity, align_about_axis(): both worlds know where down is
};
[[nodiscard]] constexpr std::array<const char*, 4> enum_names(TrajectoryAlignment) { return {"se3", "none", "sim3", "yaw"}; }

/// Fewest pairs of positions that an alignment can be computed from.
[[nodiscard]] constexpr int pairs_needed(TrajectoryAlignment alignment) {
  return alignment == TrajectoryAlignment::None ? 1 : alignment == TrajectoryAlignment::Yaw ? 2 : 3;
}

struct AteOptions {
  TrajectoryAlignment alignment = TrajectoryAlignment::Se3;
  AssociationRule association = AssociationRule::Tum;
  double max_difference = 0;    ///< of the stamps of a pair [s]; 0 = what the association rule uses by default
  double time_offset = 0;       ///< added to the stamps of the estimate [s]
  Axis gravity_axis = Axis::Z;  ///< of both worlds, up or down; read for TrajectoryAlignment::Yaw only

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("alignment", s.alignment);
    v("association", s.association);
    v("max_difference", s.max_difference, 0.0, 1e9);
    v("time_offset", s.time_offset, -1e12, 1e12);
    v("gravity_axis", s.gravity_axis);
  }
};

/// \tparam PoseT the pose type of the estimate
template <class PoseT = Pose>
struct BasicAteResult {
  /// TooFewMatches: fewer pairs than pairs_needed(alignment), and nothing else below is set but `pairs`.
  /// Degenerate: the positions lie on a line (for a turn about gravity: a vertical one) or in a point, so the rotation of the alignment
  /// is not unique (the errors are). Converged otherwise.
  Status status = Status::NotRun;
  Statistics statistics;                                             ///< of the position errors [m]
  PoseT T_groundtruth_estimate = from_pose<PoseT>(identity_pose());  ///< maps the world of the estimate into that of the
                                                                     ///< ground truth
  std::vector<StampMatch> pairs;                                     ///< first: index of the ground truth, second: of the estimate
  std::vector<double> errors;                                        ///< one per pair [m]
  double scale = 1;  ///< of the estimate, before T_groundtruth_estimate; 1 unless aligned by Sim3
};
using AteResult = BasicAteResult<>;

/// The estimate, laid onto the ground truth by an alignment of it: p -> scale * R p + t, with the rotation of each pose turned by R.
[[nodiscard]] inline Trajectory aligned(const Trajectory& estimate, const AteResult& ate) {
  Trajectory out;
  out.reserve(estimate.size());
  for (const StampedPose& p : estimate) {
    const Pose scaled = make_pose(rotation(p.T_world_body), ate.scale * translation(p.T_world_body));
    out.push_back({p.timestamp, compose(ate.T_groundtruth_estimate, scaled)});
  }
  return out;
}

namespace detail {
[[nodiscard]] inline AteResult ate_of(const Trajectory& groundtruth, const Trajectory& estimate, const AteOptions& options) {
  validate(options, "ate");
  validate(groundtruth, "ate: ground truth");
  validate(estimate, "ate: estimate");
  AteResult result;
  result.pairs = associate(groundtruth, estimate, options.association, options.max_difference, options.time_offset);
  result.status = Status::TooFewMatches;
  if (result.pairs.size() < static_cast<std::size_t>(pairs_needed(options.alignment))) return result;
  result.status = Status::Converged;
  std::vector<Eigen::Vector3d> truth;
  std::vector<Eigen::Vector3d> positions;
  truth.reserve(result.pairs.size());
  positions.reserve(result.pairs.size());
  for (const StampMatch& m : result.pairs) {
    truth.push_back(translation(groundtruth[m.first].T_world_body));
    positions.push_back(translation(estimate[m.second].T_world_body));
  }
  bool unique = true;
  if (options.alignment == TrajectoryAlignment::Se3) {
    const HornAlignment horn = align_horn(truth, positions);
    result.T_groundtruth_estimate = horn.T_target_source;
    unique = horn.rank >= 2;
  } else if (options.alignment == TrajectoryAlignment::Sim3) {
    const SimilarityAlignment similarity = align_umeyama(truth, positions);
    result.T_groundtruth_estimate = similarity.T_target_source;
    result.scale = similarity.scale;
    unique = similarity.rank >= 2;
  } else if (options.alignment == TrajectoryAlignment::Yaw) {
    const YawAlignment yaw = align_about_axis(truth, positions, options.gravity_axis);
    result.T_groundtruth_estimate = yaw.T_target_source;
    unique = yaw.unique;
  }
  if (!unique) result.status = Status::Degenerate;
  result.errors.reserve(truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    result.errors.push_back((transform(result.T_groundtruth_estimate, result.scale * positions[i]) - truth[i]).norm());
  }
  result.statistics = compute_statistics(result.errors);
  return result;
}
}  // namespace detail

/// Absolute trajectory error, e_i = |s R p_i + t - q_i| with the estimated position p_i and the true one q_i.
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
    return BasicAteResult<PoseT>{r.status,           r.statistics,        from_pose<PoseT>(r.T_groundtruth_estimate),
                                 std::move(r.pairs), std::move(r.errors), r.scale};
  }
}

APSO_NAMESPACE_END
