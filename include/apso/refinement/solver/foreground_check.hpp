/// \file
/// Whether what stands in front moves: somebody near the camera has more texture than the wall behind him, and a shift of the camera with
/// a turn against it explains both.
#pragma once

#include <algorithm>
#include <cmath>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/refinement/cost/alignment_cost.hpp>
#include <apso/refinement/cost/cost_term.hpp>
#include <apso/refinement/cost/depth_split.hpp>
#include <apso/refinement/solver/degeneracy.hpp>
#include <apso/refinement/solver/level_solver.hpp>
#include <apso/refinement/solver/pose_information.hpp>
#include <apso/status.hpp>

APSO_NAMESPACE_BEGIN

/// Solves a coarse level again without what is near, and once more without what is near of the rest. What is far is static more often, and
/// there is more of it than the image shows. A scene at rest tells the same pose by either part, within what the far one knows of it; where
/// the far one contradicts by many of its standard deviations, what is near moves. Keeps its buffer.
class ForegroundCheck {
 public:
  /// \param solver has solved `level`; goes on from the pose that is believed
  /// \param ratio as in LevelSolver::solve
  /// \return distance that is looked beyond from now on [m]; 0: all of the view is
  double operator()(AlignmentCost& cost, LevelSolver& solver, int level, double ratio, const ExecutorRef& executor) {
    split_.clear();
    cost.for_each_term(solver.T, [this](const CostTerm& t, const Pose&) { split_.add(t.level->pixels); });
    split_.sort();
    const LevelSolver whole = solver;
    LevelSolver best = whole;
    double most = kDeviations;
    float beyond = 0;
    DepthSplit::At at;
    for (int cut = 0; cut < kCuts; ++cut) {
      at = split_.find(at.distance);
      if (at.beyond < kSmallestShare) break;
      if (cut > 0) cost.sum(whole.T, AlignmentCost::kAccepted, executor);
      solver = whole;
      const double deviations = contradiction(cost, solver, level, ratio, at.distance, executor);
      if (deviations <= most) continue;
      most = deviations;
      best = solver;
      beyond = at.distance;
    }
    cost.look_beyond(beyond);
    solver = best;
    return static_cast<double>(beyond);
  }

 private:
  static constexpr int kCuts = 2;                      // two people at different distances
  static constexpr double kSmallestShare = 1.0 / 3.0;  // of the pixels, that may judge the others
  static constexpr double kLeastPixels = 0.3;          // a pose that is nearer to that of the whole is the same [px, at the finest level]
  // Of 203 far parts of two recordings at rest (consecutive frames) three contradict by more, 7.3 at most, since the lines of a rolling
  // shutter and colour and depth of different moments let near and far things move differently as well.
  static constexpr double kDeviations = 6;

  // By how many standard deviations of its own the pose of what is beyond contradicts that of the whole; 0 if it cannot tell.
  static double contradiction(AlignmentCost& cost, LevelSolver& solver, int level, double ratio, float distance,
                              const ExecutorRef& executor) {
    const Pose T_whole = solver.T;
    cost.look_beyond(distance);
    if (!succeeded(solver.go_on(cost, level, ratio, executor))) return 0;
    const Twist D = unit_twist(cost.typical_depth());
    Twist apart = se3_log(compose(solver.T, inverse(T_whole)));
    double largest = 0;
    for (int i = 0; i < 6; ++i) {
      apart(i) /= D(i);
      largest = std::max(largest, std::abs(apart(i)));
    }
    if (!(largest * cost.current(0).camera.fx > kLeastPixels)) return 0;
    cost.sum(solver.T, AlignmentCost::kAccepted, executor);
    cost.update_labels();
    const PoseInformation known = measure_information(cost, cost.normal_equations(solver.T, executor).H, solver.T, ratio, executor);
    if (known.open_count > 0) return 0;
    const Twist weighted = known.information * apart;
    double squared = 0;
    for (int i = 0; i < 6; ++i) squared += apart(i) * weighted(i);
    return std::sqrt(std::max(0.0, squared));
  }

  DepthSplit split_;
};

APSO_NAMESPACE_END
