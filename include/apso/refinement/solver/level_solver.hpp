/// \file
/// Descent of the pose at one level of the pyramid: iteratively reweighted least squares with Levenberg-Marquardt damping.
#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/refinement/cost/alignment_cost.hpp>
#include <apso/refinement/cost/normal_equations.hpp>
#include <apso/refinement/solver/degeneracy.hpp>
#include <apso/status.hpp>

APSO_NAMESPACE_BEGIN

/// Fewer valid pixels at the finest level are a failure.
inline constexpr int kMinimumAlignedPixels = 300;

/// Solves one level after the other for T_camera_world.
class LevelSolver {
 public:
  Pose T = identity_pose();          ///< T_camera_world
  bool converged = false;            ///< at the level that was solved last
  Twist last_step = zeros<Twist>();  ///< there, scaled by unit_twist()
  int iterations = 0;                ///< outer ones over all levels

  /// \param ratio share of the largest eigenvalue below which a direction keeps what it is
  [[nodiscard]] Status solve(AlignmentCost& cost, int level, double ratio, const ExecutorRef& executor) {
    cost.enter(level);
    cost.estimate_scales(T, AlignmentCost::kScaleSamples, 0, executor);
    cost.sum(T, AlignmentCost::kAccepted, executor);
    return go_on(cost, level, ratio, executor);
  }
  /// The same from sums that are accepted already, by the scales and labels of now.
  [[nodiscard]] Status go_on(AlignmentCost& cost, int level, double ratio, const ExecutorRef& executor) {
    constexpr auto kAccepted = AlignmentCost::kAccepted;
    constexpr auto kTrial = AlignmentCost::kTrial;
    converged = false;
    const int schedule = std::max(0, cost.schedule(level));
    // a coarse image has fewer pixels in all
    const int enough = std::max(6, kMinimumAlignedPixels >> (2 * schedule));
    if (cost.counts().selected < enough) return Status::TooFewPixels;
    if (cost.counts().valid < enough) return Status::NoOverlap;
    const double focal = cost.current(level).camera.fx;
    const Twist D = unit_twist(cost.typical_depth());
    const double smallest_step = kStopPixels[std::min(schedule, 3)];
    const int most = kIterations[std::min(schedule, 3)];
    double mu = 1e-4;  // Levenberg-Marquardt factor
    for (int it = 0; it < most && !converged; ++it) {
      ++iterations;
      cost.update_labels();
      const double before = cost.mean(kAccepted);
      const NormalEquations n = cost.normal_equations(T, executor);
      if (!std::isfinite(before) || !all_finite(n.H) || !all_finite(n.b)) return Status::Diverged;
      const Matrix6 scaled = scaled_both(D, n.H);
      const Degeneracy open(scaled, ratio);
      if (open.count == 6) return level > 0 ? Status::TooFewPixels : Status::SingularSystem;
      const Matrix6 keep = open.keep();
      Twist right;
      double trace = 0;
      for (int i = 0; i < 6; ++i) {
        right(i) = D(i) * n.b(i);
        trace += scaled(i, i);
      }
      right = keep * right;
      const Matrix6 determined = open.regular(scaled, scaled(0, 0));
      bool moved = false;
      double gained = 0;  // share of the cost
      for (int reject = 0; reject <= kRejects; ++reject) {
        Matrix6 A = determined;
        for (int i = 0; i < 6; ++i) A(i, i) += 1e-12 * trace + mu * scaled(i, i);
        const Twist scaled_step = keep * solve_symmetric(A, right);
        Twist step;
        double largest = 0;  // of the scaled step
        for (int i = 0; i < 6; ++i) {
          largest = std::max(largest, std::abs(scaled_step(i)));
          step(i) = D(i) * scaled_step(i);
        }
        if (!all_finite(step)) return Status::Diverged;
        const bool tiny = focal * largest < smallest_step;
        const Pose T_trial = normalized(compose(se3_exp(step), T));
        if (tiny && reject == 0) {  // taken without another look
          T = T_trial;
          last_step = scaled_step;
          converged = moved = true;
          break;
        }
        cost.sum(T_trial, kTrial, executor);
        const double after = cost.mean(kTrial);
        if (after < before) {
          T = T_trial;
          last_step = scaled_step;
          cost.accept_trial();
          moved = true;
          gained = (before - after) / before;
          mu = std::max(1e-9, mu / 10);
          converged = tiny || gained < kStopRelativeCost;
          break;
        }
        if (focal * largest < kShortStep * smallest_step) break;
        mu = std::max(kRejectedDamping, mu * 10);
      }
      if (!moved) {  // no step lowers the cost: a minimum
        converged = true;
      } else if (!converged && gained > kScaleGain && cost.estimate_scales(T, AlignmentCost::kScaleSamples, kScaleChange, executor)) {
        cost.sum(T, kAccepted, executor);
      }
    }
    if (cost.counts().valid < enough) return Status::NoOverlap;
    return Status::Converged;
  }

 private:
  // By level, finest first; the last holds for all coarser ones. Most iterations where they cost least.
  static constexpr int kIterations[4] = {8, 10, 15, 20};
  static constexpr double kStopPixels[4] = {0.01, 0.03, 0.05, 0.05};  // a step that moves the image by less is the last one [px]
  static constexpr double kStopRelativeCost = 1e-4;                   // a relative decrease below stops
  static constexpr int kRejects = 3;                                  // rejected steps in a row
  // mu after a rejected step: one that is hardly shorter would be rejected like it, by pixels that come into view and leave it
  static constexpr double kRejectedDamping = 0.03;
  static constexpr double kShortStep = 10;     // a step below so many of kStopPixels that is rejected is not tried shorter: a minimum
  static constexpr double kScaleGain = 0.02;   // share of the cost that a step must have gained for another look at the scales
  static constexpr double kScaleChange = 0.2;  // relative change of a scale from which on the sums are made again with the new
};

APSO_NAMESPACE_END
