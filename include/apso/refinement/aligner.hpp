/// \file
/// Direct alignment of one frame to one or several references, the paper's eq. (direct optimization approach):
///
///     T = argmin sum_k B_k sum_p gamma_k(p) gamma_c(u) [ alpha^2 C(s_I) + C(s_D) ]
///
/// over the one pose of the current camera. T_c_k = T_c_w T_w_k, so one increment from the left serves all references.
/// Solved coarse to fine by iteratively reweighted least squares with Levenberg-Marquardt damping. Directions that the
/// images do not determine keep the initial guess (solution remapping, Zhang, Kaess, Singh, ICRA 2016).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/refinement/cost/alignment_cost.hpp>
#include <apso/refinement/alignment_options.hpp>
#include <apso/refinement/alignment_result.hpp>
#include <apso/refinement/cost/normal_equations.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/refinement/start/rotation_search.hpp>
#include <apso/refinement/start/start_search.hpp>
#include <apso/status.hpp>

APSO_NAMESPACE_BEGIN

/// Aligns frames. Keeps its buffers, so that a second call of the same size allocates nothing. Deterministic.
class DirectAligner {
 public:
  explicit DirectAligner(const AlignmentOptions& options = {}) : cost_(options) {}

  [[nodiscard]] const AlignmentOptions& options() const { return cost_.options(); }

  /// \param current prepared as current
  /// \param T_world_camera_candidates initial guesses, the most trusted first; the best is chosen by the cost at the
  ///        coarsest level. The first one is the initial guess that a failure and degenerate directions keep.
  template <class Executor = SerialExecutor>
  [[nodiscard]] AlignmentResult align(const std::vector<AlignmentReference>& references, const FramePyramid& current,
                                      const std::vector<Pose>& T_world_camera_candidates,
                                      const Executor& executor = {}) {
    AlignmentResult result;
    if (!begin(references, current, T_world_camera_candidates, result)) return result;
    const Pose T_guess = inverse(result.T_world_camera);
    Pose T = choose_start(T_world_camera_candidates, result, executor);
    Origin origin{T_guess, T, options().degenerate_ratio};

    bool converged = false;
    const int middle = level_narrower_than(100);
    bool searched = false;
    for (int level = cost_.levels() - 1; level >= 0; --level) {
      const Status s = solve_level(level, origin.ratio, T, converged, result, executor);
      if (!succeeded(s) && level == 0) return fail(result, s);  // a coarse level may be too small; finer ones have more
      // with a mask a wrong pose may show at the next level only
      const bool look = level == middle || (level == middle - 1 && cost_.current().masked());
      if (look && !searched && level > 0 && doubtful(level, T, executor)) {
        T = try_other_starts(middle - 1, T, origin, result, executor);
        searched = true;
      }
    }
    finish(T_guess, origin, T, converged, result, executor);
    return result;
  }

  /// Scales and counts of the residuals at a given pose, without optimising: how well the pose explains the frames.
  template <class Executor = SerialExecutor>
  [[nodiscard]] AlignmentResult evaluate(const std::vector<AlignmentReference>& references, const FramePyramid& current,
                                         const Pose& T_world_camera, const Executor& executor = {}) {
    AlignmentResult result;
    one_.assign(1, T_world_camera);
    if (!begin(references, current, one_, result)) return result;
    const Pose T = inverse(T_world_camera);
    cost_.enter(0);
    cost_.estimate_scales(T, 2 * options().scale_samples, 0, executor);
    cost_.sum(T, kAccepted, executor);
    result.counts = cost_.counts();
    result.valid_share = share(result.counts);
    if (result.counts.valid < options().min_pixels) return fail(result, Status::TooFewPixels);
    cost_.report_scales(result);
    if (!overlap(result)) return fail(result, Status::NoOverlap);
    result.cost = cost_.mean(kAccepted);
    result.status = Status::Converged;
    return result;
  }

 private:
  static constexpr AlignmentCost::Buffer kAccepted = AlignmentCost::kAccepted;
  static constexpr AlignmentCost::Buffer kTrial = AlignmentCost::kTrial;

  static AlignmentResult& fail(AlignmentResult& r, Status s) {
    r.status = s;
    r.information = zeros<Matrix6>();
    r.covariance = zeros<Matrix6>();
    return r;
  }
  // Pixels that fall on what is masked tell nothing about the overlap.
  static double share(const WarpCounts& c) {
    return c.selected > c.masked ? static_cast<double>(c.valid) / static_cast<double>(c.selected - c.masked) : 0.0;
  }

  // A wrong pose may well bring a few pixels together that agree by chance; that they correlate as those of one and the same
  // surface do is another matter.
  [[nodiscard]] bool overlap(const AlignmentResult& r) const {
    const AlignmentOptions& o = options();
    const bool alike = r.correlation >= o.alike && r.correlation < 1;  // 1: there was nothing to compare
    return r.valid_share >= (alike ? o.min_valid_share_alike : o.min_valid_share);
  }

  bool begin(const std::vector<AlignmentReference>& references, const FramePyramid& current,
             const std::vector<Pose>& candidates, AlignmentResult& result) {
    expects(!candidates.empty(), "DirectAligner: at least one candidate pose is needed");
    const auto first = std::find_if(candidates.begin(), candidates.end(), [](const Pose& c) { return is_finite(c); });
    if (first != candidates.end()) result.T_world_camera = *first;
    if (!cost_.begin(references, current)) {
      result.status = Status::NoReference;
      return false;
    }
    if (first == candidates.end()) {
      result.status = Status::Diverged;
      return false;
    }
    return true;
  }

  // The finest level that is narrower, or 0.
  [[nodiscard]] int level_narrower_than(int width) const {
    for (int level = 0; level < cost_.levels(); ++level) {
      if (cost_.current(level).camera.width < width) return level;
    }
    return 0;
  }

  // What directions that the images do not determine have to go by.
  struct Origin {
    Pose T_kept;   // the pose they keep
    Pose T_start;  // where the descent began
    double ratio;  // share of the largest eigenvalue below which a direction is undetermined
  };

  template <class Executor>
  bool doubtful(int level, const Pose& T, const Executor& executor) {
    const double bound = cost_.mostly_masked() ? options().search_masked : options().search_contradicted;
    return bound < 1 && (!(bound > 0) || cost_.evidence(level, T, executor).contradicted >= bound);
  }

  // When images of about 80x60 contradict the pose that was found, or masks leave little of them: the most promising of other
  // starts are solved one level finer, where a body that moves and the room behind it are still told apart, and the pose that
  // explains most is taken.
  // Such a start is worth little in the directions that few pixels tell about, so that what they tell is taken sooner.
  template <class Executor>
  Pose try_other_starts(int finer, const Pose& T_found, Origin& origin, AlignmentResult& result, const Executor& executor) {
    const std::vector<Start>& starts = start_search_(cost_, finer, T_found, origin.T_kept, executor);
    // where little is left to go by, poses differ by what finer images show
    const int judged = cost_.mostly_masked() ? std::max(0, finer - 1) : finer;
    Pose best = T_found;
    double most = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < std::min<std::size_t>(starts.size(), kSolved); ++i) {
      const Pose& T_start = starts[i].T_camera_world;
      const bool other = i > 0;  // the first is the pose that was found
      const double ratio = (other ? 0.1 : 1.0) * options().degenerate_ratio;
      Pose T = T_start;
      bool converged = false;
      (void)solve_level(finer, ratio, T, converged, result, executor);
      const double support = cost_.evidence(judged, T, executor).support;
      if (support > most) {
        most = support;
        best = T;
        if (other) origin = {T_start, T_start, ratio};
      }
    }
    return best;
  }

  // The candidate with the lowest cost at the coarsest level, all at the same scale.
  template <class Executor>
  Pose choose_start(const std::vector<Pose>& candidates, AlignmentResult& result, const Executor& executor) {
    const int level = cost_.levels() - 1;
    double best = std::numeric_limits<double>::infinity();
    Pose T = inverse(result.T_world_camera);
    cost_.enter(level);
    cost_.set_scales(1.0);
    const auto consider = [&](const Pose& T_camera_world, int index) {
      cost_.sum_cost(T_camera_world, kTrial, executor);
      const double c = cost_.mean(kTrial);
      if (c < best) {
        best = c;
        T = T_camera_world;
        result.start_candidate = index;
      }
    };
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (is_finite(candidates[i])) consider(inverse(candidates[i]), static_cast<int>(i));
    }
    if (options().prealign_rotation) {
      const Pose& T_world_reference = cost_.first_T_world_reference();
      const Pose found = rotation_search_(cost_.first_reference().halved(cost_.halvings(level)).pixels, cost_.current(level),
                                          compose(T, T_world_reference), options().prealign_iterations);
      // the camera turns about itself
      const Pose reference_world = inverse(compose(T, T_world_reference));
      const Eigen::Matrix3d turn = times(rotation(found), rotation(reference_world));
      const Pose rotated = compose(make_pose(turn, Eigen::Vector3d(0, 0, 0)), T);
      if (is_finite(rotated)) consider(normalized(rotated), static_cast<int>(candidates.size()));
    }
    return T;
  }

  // Units that make translation and rotation comparable: a twist is D times a scaled twist.
  [[nodiscard]] static Twist unit_twist(double depth) {
    Twist D;
    for (int i = 0; i < 6; ++i) D(i) = i < 3 ? depth : 1.0;
    return D;
  }
  // Identity minus P.
  [[nodiscard]] static Matrix6 complement(const Matrix6& P) { return minus(identity<Matrix6>(), P); }

  // Which directions the normal equations determine; P projects scaled twists onto the others.
  int degenerate(const Matrix6& H, double depth, double ratio, Matrix6& P, Twist* eigenvalues) const {
    const Matrix6 scaled = scaled_both(unit_twist(depth), H);
    P = zeros<Matrix6>();
    double trace = 0;  // at least the largest eigenvalue
    for (int i = 0; i < 6; ++i) trace += scaled(i, i);
    const double bound = std::max(ratio * trace, options().degenerate_floor);
    if (eigenvalues == nullptr && eigenvalues_exceed(bound, scaled)) return 0;
    const SymmetricEigen<6> eigen = eigen_symmetric(scaled);
    int count = 0;
    const double largest = eigen.values(5);
    for (int i = 0; i < 6; ++i) {
      const double value = eigen.values(i);
      if (value < ratio * largest || value < options().degenerate_floor) {
        for (int r = 0; r < 6; ++r) {
          for (int c = 0; c < 6; ++c) P(r, c) += eigen.vectors(r, i) * eigen.vectors(c, i);
        }
        ++count;
      }
    }
    if (eigenvalues != nullptr) *eigenvalues = eigen.values;
    return count;
  }

  void add_prior(const Pose& T_guess, const Pose& T, NormalEquations& n) const {
    if (!(options().prior_sigma_translation > 0) || !(options().prior_sigma_rotation > 0)) return;
    const Twist e = se3_log(compose(T_guess, inverse(T)));
    for (int i = 0; i < 6; ++i) {
      const double sigma = i < 3 ? options().prior_sigma_translation : options().prior_sigma_rotation;
      const double p = 1.0 / (sigma * sigma * options().information_deflation);
      n.H(i, i) += p;
      n.b(i) += p * e(i);
    }
  }

  template <class Executor>
  Status solve_level(int level, double ratio, Pose& T, bool& converged, AlignmentResult& result,
                     const Executor& executor) {
    const AlignmentOptions& o = options();
    converged = false;
    cost_.enter(level);
    cost_.estimate_scales(T, o.scale_samples, 0, executor);
    cost_.sum(T, kAccepted, executor);
    const int schedule = std::max(0, cost_.schedule(level));
    // a coarse image has fewer pixels in all
    const int enough = std::max(6, o.min_pixels >> (2 * schedule));
    if (cost_.counts().selected < enough) return Status::TooFewPixels;
    if (cost_.counts().valid < enough) return Status::NoOverlap;
    const double depth = cost_.typical_depth();
    const double focal = cost_.current(level).camera.fx;
    const Twist D = unit_twist(depth);
    double mu = o.damping;
    const int most = static_cast<int>(o.iterations.at(schedule));
    for (int it = 0; it < most && !converged; ++it) {
      ++result.iterations;
      cost_.update_labels();
      const double before = cost_.mean(kAccepted);
      NormalEquations n = cost_.normal_equations(T, executor);
      if (!std::isfinite(before) || !all_finite(n.H) || !all_finite(n.b)) return Status::Diverged;
      add_prior(inverse(result.T_world_camera), T, n);
      Matrix6 P;
      if (degenerate(n.H, depth, ratio, P, nullptr) == 6) return level > 0 ? Status::TooFewPixels : Status::SingularSystem;
      const Matrix6 keep = complement(P);
      const Matrix6 scaled = scaled_both(D, n.H);
      Twist right;
      double trace = 0;
      for (int i = 0; i < 6; ++i) {
        right(i) = D(i) * n.b(i);
        trace += scaled(i, i);
      }
      right = times(keep, right);
      const Matrix6 determined = plus(times(times(keep, scaled), keep), times(scaled(0, 0), P));
      bool moved = false;
      for (int reject = 0; reject <= o.max_rejects; ++reject) {
        // Solved within the determined directions only; the identity on the others keeps the system regular.
        Matrix6 A = determined;
        for (int i = 0; i < 6; ++i) A(i, i) += 1e-12 * trace + mu * scaled(i, i);
        Twist step = times(keep, solve_symmetric(A, right));
        double largest = 0;  // of the scaled step
        for (int i = 0; i < 6; ++i) {
          largest = std::max(largest, std::abs(step(i)));
          step(i) *= D(i);
        }
        if (!all_finite(step)) return Status::Diverged;
        const bool tiny = focal * largest < o.stop_pixels.at(schedule);
        const Pose T_trial = normalized(compose(se3_exp(step), T));
        if (tiny && reject == 0) {  // taken without another look
          T = T_trial;
          converged = moved = true;
          break;
        }
        cost_.sum(T_trial, kTrial, executor);
        const double after = cost_.mean(kTrial);
        if (after < before) {
          T = T_trial;
          cost_.accept_trial();
          moved = true;
          mu = std::max(1e-9, mu / 10);
          converged = tiny || before - after < o.stop_relative_cost * before;
          break;
        }
        mu = std::max(1e-9, mu * 10);
        if (tiny) break;
      }
      if (!moved) {  // no step lowers the cost: a minimum
        converged = true;
      } else if (!converged && cost_.estimate_scales(T, o.scale_samples, o.scale_change, executor)) {
        cost_.sum(T, kAccepted, executor);
      }
    }
    if (cost_.counts().valid < enough) return Status::NoOverlap;
    return Status::Converged;
  }

  template <class Executor>
  void finish(const Pose& T_guess, const Origin& origin, Pose T, bool converged, AlignmentResult& r,
              const Executor& executor) {
    r.counts = cost_.counts();
    r.valid_share = share(r.counts);
    r.static_share = 1 - cost_.moving_share();
    r.cost = cost_.mean(kAccepted);
    const NormalEquations n = cost_.normal_equations(T, executor);
    if (!is_finite(T) || !std::isfinite(r.cost) || !all_finite(n.H)) {
      r.cost = 0;
      fail(r, Status::Diverged);
      return;
    }
    cost_.estimate_scales(T, 2 * options().scale_samples, 0, executor);
    cost_.report_scales(r);
    r.median_depth = cost_.typical_depth();
    Matrix6 P;
    r.degenerate_count = degenerate(n.H, r.median_depth, origin.ratio, P, &r.eigenvalues);
    r.degenerate_projector = P;
    if (r.counts.valid_depth < options().min_pixels) {
      fail(r, Status::TooFewPixels);
      return;
    }
    if (!overlap(r) || r.correlation < options().min_correlation) {
      fail(r, Status::NoOverlap);
      return;
    }
    if (r.degenerate_count == 6) {
      fail(r, Status::SingularSystem);
      return;
    }
    const Twist D = unit_twist(r.median_depth);
    const auto scaled_to = [&](const Pose& T_other) {
      Twist e = se3_log(compose(T_other, inverse(T)));
      for (int i = 0; i < 6; ++i) e(i) /= D(i);
      return e;
    };
    if (r.degenerate_count > 0 && norm(se3_log(compose(origin.T_start, inverse(origin.T_kept)))) > 1e-12) {
      // it did not start there: bring the undetermined directions back
      Twist back = times(P, scaled_to(origin.T_kept));
      for (int i = 0; i < 6; ++i) back(i) *= D(i);
      T = normalized(compose(se3_exp(back), T));
    }
    if (options().check_against_guess) {
      constexpr int kStep = 8;  // an eighth of the pixels will do
      cost_.sum_cost(T, kAccepted, executor, kStep);  // once more, by the scales of now
      cost_.sum_cost(T_guess, kTrial, executor, kStep);
      // Within the reach of a few pixels the two costs differ by noise and by what the references disagree on: a good
      // guess may well come out ahead there, and the result is no worse for it.
      const bool far = norm(scaled_to(T_guess)) * cost_.current(0).camera.fx > 3;
      if (far && cost_.mean(kTrial, kStep) < 0.99 * cost_.mean(kAccepted, kStep)) {
        fail(r, Status::Diverged);
        return;
      }
    }
    const Matrix6 keep = complement(P);
    const Matrix6 scaled = scaled_both(D, n.H);
    double fill = 0;
    for (int i = 0; i < 6; ++i) fill += scaled(i, i) / 6;
    const Matrix6 determined = plus(times(times(keep, scaled), keep), times(fill, P));
    const Matrix6 inverted = times(times(keep, solve_symmetric(determined, identity<Matrix6>())), keep);
    const Matrix6 covariance = scaled_both(D, inverted);
    r.information = times(options().information_deflation, n.H);
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        r.covariance(i, j) = 0.5 / options().information_deflation * (covariance(i, j) + covariance(j, i));
      }
    }
    r.T_world_camera = normalized(inverse(T));
    r.status = r.degenerate_count > 0 ? Status::Degenerate : (converged ? Status::Converged : Status::MaxIterations);
  }

  AlignmentCost cost_;
  RotationSearch rotation_search_;
  StartSearch start_search_;
  static constexpr std::size_t kSolved = 6;  // most starts that are solved
  std::vector<Pose> one_;
};

APSO_NAMESPACE_END
