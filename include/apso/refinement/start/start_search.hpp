/// \file
/// Where a descent on the images may start again when the pose that it found is in doubt.
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

/// A pose from which to descend.
struct Start {
  Pose T_camera_world;
  double support;  ///< AlignmentCost::Evidence; infinite for the pose that was found
};

/// Gathers starts: the pose that was found, the initial guess, motions through three matches of corners, and motions of
/// which the directions of surfaces give the rotation and one match of corners the translation. The last kind needs a
/// single right match and does not fall for a body that moves, which is seldom as large as the walls. Deterministic;
/// keeps its buffers.
class StartSearch {
 public:
  /// \param cost with the frames of the alignment; entered anew
  /// \param level about 160 x 120 pixels
  /// \param T_found,T_guess poses T_camera_world
  /// \return the pose that was found, then the others, those with the most support first
  template <class Executor>
  const std::vector<Start>& operator()(AlignmentCost& cost, int level, const Pose& T_found, const Pose& T_guess,
                                       const Executor& executor) {
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
    find_by_surfaces(cost, level, compose(T_guess, T_world_reference), executor);
    add_motions();
    std::sort(starts_.begin(), starts_.end(), [](const Start& a, const Start& b) { return a.support > b.support; });
    return starts_;
  }

 private:
  static constexpr std::size_t kPromising = 6;  // motions by surfaces that are looked at closely

  struct Trial {
    Pose T_current_reference;
    double support;
  };

  // Half a pixel from the pose that was found is the same.
  template <class Executor>
  void add(AlignmentCost& cost, int level, const Pose& T, const Executor& executor) {
    const Twist e = se3_log(compose(T, inverse(starts_.front().T_camera_world)));
    const double moved = std::max(translation_norm(e) / depth_, rotation_norm(e));
    if (cost.current(level).camera.fx * moved > 0.5) starts_.push_back({T, cost.evidence(level, T, executor).support});
  }

  // As far from the guess as the turns move the image. There may be hundreds; what remains has the most support in
  // smaller images, and is apart by a pixel of these.
  template <class Executor>
  void find_by_surfaces(AlignmentCost& cost, int level, const Pose& T_guess, const Executor& executor) {
    orientation_search_(cost.first_reference().halved(cost.halvings(level)), cost.current(level), rotation(T_guess),
                        rotations_);
    corner_search_.with_rotations(rotations_, translation(T_guess), OrientationSearch::kReach * depth_, 0.01 * depth_,
                                  motions_);
    const Pose T_reference_world = inverse(cost.first_T_world_reference());
    const int smaller = std::min(level + 2, cost.levels() - 1);
    (void)cost.evidence(smaller, starts_.front().T_camera_world, executor);  // for the brightness
    trials_.clear();
    for (const Pose& T : motions_) {
      trials_.push_back(
          {T, cost.evidence_as_lit(smaller, normalized(compose(T, T_reference_world)), executor).support});
    }
    std::sort(trials_.begin(), trials_.end(), [](const Trial& a, const Trial& b) { return a.support > b.support; });
    motions_.clear();
    for (const Trial& t : trials_) {
      if (motions_.size() == kPromising) break;
      const bool same = std::any_of(motions_.begin(), motions_.end(), [&](const Pose& T) {
        const Twist e = se3_log(compose(t.T_current_reference, inverse(T)));
        return translation_norm(e) / depth_ + rotation_norm(e) < 0.02;
      });
      if (!same) motions_.push_back(t.T_current_reference);
    }
  }

  CornerSearch corner_search_;
  OrientationSearch orientation_search_;
  double depth_ = 1;           // typical [m]
  std::vector<Pose> motions_;  // T_current_reference
  std::vector<Eigen::Matrix3d> rotations_;
  std::vector<Start> starts_;
  std::vector<Trial> trials_;
};

APSO_NAMESPACE_END
