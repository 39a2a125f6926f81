/// \file
/// Other poses from which to start when the pose that alignment found is in doubt: a multi-start search.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/refinement/cost/alignment_cost.hpp>
#include <apso/refinement/start/corner_search.hpp>
#include <apso/refinement/start/orientation_search.hpp>

APSO_NAMESPACE_BEGIN

/// A pose from which to start.
struct Start {
  Pose T_camera_world;
  double support;  ///< AlignmentCost::Evidence; infinite for the pose that was found
};

/// Gathers starts: the pose that was found, the initial guess, motions from three matched corners, and motions with the
/// rotation from surface normals and the translation from one matched corner. The last kind needs a single right match and
/// does not follow a moving body, which is seldom as large as the walls. Deterministic; keeps its buffers.
class StartSearch {
 public:
  /// \param cost with the frames of the alignment; entered anew
  /// \param level about 160 x 120 pixels
  /// \param T_found,T_guess poses T_camera_world
  /// \return the pose that was found, then the others, those with the most support first
  template <class Executor>
  const std::vector<Start>& operator()(AlignmentCost& cost, int level, const Pose& T_found, const Pose& T_guess, const Executor& executor) {
    const Pose& T_world_reference = cost.first_T_world_reference();
    const Pose T_reference_world = inverse(T_world_reference);
    const auto add_motions = [&] {
      for (const Pose& T : motions_) add(cost, level, normalized(compose(T, T_reference_world)), executor);
    };
    cost.enter(level);
    depth_ = cost.typical_depth();
    starts_.assign(1, {T_found, std::numeric_limits<double>::infinity()});
    add(cost, level, T_guess, executor);
    corner_search_(cost.first_reference(), cost.current(), cost.halvings(level), motions_);
    add_motions();
    add_surface_motions(cost, level, compose(T_guess, T_world_reference), executor);
    add_motions();
    std::sort(starts_.begin(), starts_.end(), [](const Start& a, const Start& b) { return a.support > b.support; });
    return starts_;
  }

 private:
  static constexpr std::size_t kMaxSurfaceMotions = 6;  // motions with rotations from surface normals

  struct Candidate {
    Pose T_current_reference;
    double support;
  };

  // Poses within half a pixel of the one that was found are the same.
  template <class Executor>
  void add(AlignmentCost& cost, int level, const Pose& T, const Executor& executor) {
    const Twist e = se3_log(compose(T, inverse(starts_.front().T_camera_world)));
    const double moved = std::max(translation_norm(e) / depth_, rotation_norm(e));
    if (cost.current(level).camera.fx * moved > 0.5) starts_.push_back({T, cost.evidence(level, T, executor).support});
  }

  // Translations up to as far as the rotations move the image. There may be hundreds; kept are those with the most support
  // in smaller images that differ by a pixel of these.
  template <class Executor>
  void add_surface_motions(AlignmentCost& cost, int level, const Pose& T_guess, const Executor& executor) {
    orientation_search_(cost.first_reference().halved(cost.halvings(level)), cost.current(level), rotation(T_guess), rotations_);
    corner_search_.with_rotations(rotations_, translation(T_guess), OrientationSearch::kMaxAngle * depth_, 0.01 * depth_, motions_);
    const Pose T_reference_world = inverse(cost.first_T_world_reference());
    const int smaller = std::min(level + 2, cost.levels() - 1);
    (void)cost.evidence(smaller, starts_.front().T_camera_world, executor);  // for the brightness
    candidates_.clear();
    for (const Pose& T : motions_) {
      candidates_.push_back({T, cost.evidence_as_lit(smaller, normalized(compose(T, T_reference_world)), executor).support});
    }
    std::sort(candidates_.begin(), candidates_.end(), [](const Candidate& a, const Candidate& b) { return a.support > b.support; });
    motions_.clear();
    for (const Candidate& t : candidates_) {
      if (motions_.size() == kMaxSurfaceMotions) break;
      const bool duplicate = std::any_of(motions_.begin(), motions_.end(), [&](const Pose& T) {
        const Twist e = se3_log(compose(t.T_current_reference, inverse(T)));
        return translation_norm(e) / depth_ + rotation_norm(e) < 0.02;
      });
      if (!duplicate) motions_.push_back(t.T_current_reference);
    }
  }

  CornerSearch corner_search_;
  OrientationSearch orientation_search_;
  double depth_ = 1;           // typical [m]
  std::vector<Pose> motions_;  // T_current_reference
  std::vector<Eigen::Matrix3d> rotations_;
  std::vector<Start> starts_;
  std::vector<Candidate> candidates_;
};

APSO_NAMESPACE_END
