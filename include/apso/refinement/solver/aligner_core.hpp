/// \file
/// The course of a direct alignment: which start, coarse to fine, when to start again elsewhere, and what to make of the result.
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
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/refinement/alignment_options.hpp>
#include <apso/refinement/alignment_result.hpp>
#include <apso/refinement/cost/alignment_cost.hpp>
#include <apso/refinement/cost/kernel_loop.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/refinement/solver/degeneracy.hpp>
#include <apso/refinement/solver/foreground_check.hpp>
#include <apso/refinement/solver/level_solver.hpp>
#include <apso/refinement/solver/pose_information.hpp>
#include <apso/refinement/start/repetition_search.hpp>
#include <apso/refinement/start/rotation_search.hpp>
#include <apso/refinement/start/start_search.hpp>
#include <apso/status.hpp>

APSO_NAMESPACE_BEGIN

/// Direct alignment with a kernel and a noise model by reference: compiled once, whatever they are.
class AlignerCore {
 public:
  explicit AlignerCore(const AlignmentOptions& options) : cost_(options) {}

  [[nodiscard]] const AlignmentOptions& options() const { return cost_.options(); }

  /// Kernel and noise model of the next call.
  void use(const KernelRef& kernel, const NoiseRef& noise, bool adaptive) {
    kernel_ = kernel;
    noise_ = noise;
    adaptive_ = adaptive;
  }

  [[nodiscard]] AlignmentResult align(const std::vector<AlignmentReference>& references, const FramePyramid& current,
                                      const std::vector<Pose>& candidates, const ExecutorRef& executor) {
    return descend(references, current, candidates, false, executor);
  }
  [[nodiscard]] AlignmentResult align_near(const std::vector<AlignmentReference>& references, const FramePyramid& current,
                                           const Pose& T_world_camera, const ExecutorRef& executor) {
    one_.assign(1, T_world_camera);
    return descend(references, current, one_, true, executor);
  }

  [[nodiscard]] AlignmentResult evaluate(const std::vector<AlignmentReference>& references, const FramePyramid& current,
                                         const Pose& T_world_camera, const ExecutorRef& executor) {
    AlignmentResult result;
    one_.assign(1, T_world_camera);
    if (!begin(references, current, one_, result)) return result;
    const Pose T = inverse(T_world_camera);
    cost_.enter(0);
    cost_.estimate_scales(T, 2 * AlignmentCost::kScaleSamples, 0, executor);
    cost_.sum(T, kAccepted, executor);
    result.counts = cost_.counts();
    result.valid_share = share(result.counts);
    if (result.counts.valid < kMinimumAlignedPixels) return fail(result, Status::TooFewPixels);
    cost_.report_scales(result);
    if (!overlap(result)) return fail(result, Status::NoOverlap);
    result.cost = cost_.mean(kAccepted);
    result.status = Status::Converged;
    return result;
  }

 private:
  static constexpr AlignmentCost::Buffer kAccepted = AlignmentCost::kAccepted;
  static constexpr AlignmentCost::Buffer kTrial = AlignmentCost::kTrial;
  static constexpr std::size_t kSolved = 6;     // most starts that are solved
  static constexpr double kCorrelated = 0.9;    // correlation of the intensities of right poses
  static constexpr double kUncorrelated = 0.3;  // intensities of both images that agree less are NoOverlap
  static constexpr int kPrealignIterations = 15;
  static constexpr double kContradicted = 0.01;  // share of tiles that may contradict a pose that explains the images as well

  // Near: the only candidate is known to be near the truth, and no other start is tried.
  AlignmentResult descend(const std::vector<AlignmentReference>& references, const FramePyramid& current,
                          const std::vector<Pose>& candidates, bool near, const ExecutorRef& executor) {
    AlignmentResult result;
    if (!begin(references, current, candidates, result)) return result;
    const Pose T_guess = inverse(result.T_world_camera);
    solver_ = LevelSolver{};
    solver_.T = near ? T_guess : choose_start(candidates, result, executor);
    Origin origin{T_guess, kDegenerateRatio};

    const int middle = level_narrower_than(100);
    bool searched = false;
    for (int level = cost_.levels() - 1; level >= 0; --level) {
      const Status s = solver_.solve(cost_, level, origin.ratio, executor);
      result.iterations = solver_.iterations;
      if (!succeeded(s) && level == 0) return fail(result, s);  // a coarse level may be too small; finer ones have more
      if (level == 1 && succeeded(s) && options().regions)
        result.foreground = foreground_check_(cost_, solver_, level, origin.ratio, executor);
      // with a mask a wrong pose may show at the next level only
      const bool look = level == middle || (level == middle - 1 && cost_.current().masked());
      if (look && !near && !searched && level > 0 && doubtful(level, solver_.T, executor)) {
        solver_.T = try_other_starts(middle - 1, origin, executor);
        searched = true;
      }
    }
    finish(T_guess, origin, result, executor);
    if (!near && succeeded(result.status) && result.degenerate_count == 0) look_for_repetition(origin, result, executor);
    return result;
  }

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
    const bool correlated = r.correlation >= kCorrelated && r.correlation < 1;  // 1: there was nothing to compare
    return r.valid_share >= (correlated ? 0.5 : 1.0) * options().min_valid_share;
  }

  bool begin(const std::vector<AlignmentReference>& references, const FramePyramid& current, const std::vector<Pose>& candidates,
             AlignmentResult& result) {
    expects(!candidates.empty(), "DirectAligner: at least one candidate pose is needed");
    const auto first = std::find_if(candidates.begin(), candidates.end(), [](const Pose& c) { return is_finite(c); });
    if (first != candidates.end()) result.T_world_camera = *first;
    if (!cost_.begin(references, current, kernel_, noise_, adaptive_)) {
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
    double ratio;  // share of the largest eigenvalue below which a direction is undetermined
  };

  bool doubtful(int level, const Pose& T, const ExecutorRef& executor) {
    const double bound = options().multi_start_threshold;
    if (bound >= 1) return false;
    return cost_.mostly_masked() || !(bound > 0) || cost_.evidence_as_lit(level, T, executor).contradicted >= bound;
  }

  // When images of about 80x60 contradict the pose that was found, or masks leave little of them: the most promising of other
  // starts are solved one level finer, where a body that moves and the room behind it are still told apart, and the pose that
  // explains most is taken.
  // Such a start is worth little in the directions that few pixels tell about, so that what they tell is taken sooner.
  Pose try_other_starts(int finer, Origin& origin, const ExecutorRef& executor) {
    const Pose T_guess = origin.T_kept;
    const std::vector<Start>& starts = start_search_(cost_, finer, solver_.T, T_guess, executor);
    // where little is left to go by, poses differ by what finer images show
    const int judged = cost_.mostly_masked() ? std::max(0, finer - 1) : finer;
    Pose best = solver_.T;
    double most = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < std::min<std::size_t>(starts.size(), kSolved); ++i) {
      const Pose& T_start = starts[i].T_camera_world;
      const bool other = i > 0;  // the first is the pose that was found
      const double ratio = (other ? 0.1 : 1.0) * kDegenerateRatio;
      solver_.T = T_start;
      (void)solver_.solve(cost_, finer, ratio, executor);
      const double support = cost_.evidence(judged, solver_.T, executor).support;
      if (support > most) {
        most = support;
        best = solver_.T;
        if (other) origin = {T_start, ratio};
      }
    }
    return best;
  }

  // The candidate with the lowest cost at the coarsest level, all at the same scale.
  Pose choose_start(const std::vector<Pose>& candidates, AlignmentResult& result, const ExecutorRef& executor) {
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
                                          compose(T, T_world_reference), kPrealignIterations);
      // the camera turns about itself
      const Pose reference_world = inverse(compose(T, T_world_reference));
      const Eigen::Matrix3d turn = rotation(found) * rotation(reference_world);
      const Pose rotated = compose(make_pose(turn, Eigen::Vector3d(0, 0, 0)), T);
      if (is_finite(rotated)) consider(normalized(rotated), static_cast<int>(candidates.size()));
    }
    return T;
  }

  void finish(const Pose& T_guess, const Origin& origin, AlignmentResult& r, const ExecutorRef& executor) {
    Pose T = solver_.T;
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
    r.median_depth = cost_.typical_depth();
    const Twist D = unit_twist(r.median_depth);
    PoseInformation known = measure_information(cost_, n.H, T, origin.ratio, executor);
    if (!solver_.converged) known.add_last_step(solver_.last_step);
    cost_.estimate_scales(T, 2 * AlignmentCost::kScaleSamples, 0, executor);
    cost_.report_scales(r);
    r.degenerate_count = known.open_count;
    r.degenerate_projector = known.open;
    r.eigenvalues = known.eigenvalues;
    if (r.counts.valid_depth < kMinimumAlignedPixels) {
      fail(r, Status::TooFewPixels);
      return;
    }
    if (!overlap(r) || r.correlation < kUncorrelated) {
      fail(r, Status::NoOverlap);
      return;
    }
    if (r.degenerate_count == 6) {
      fail(r, Status::SingularSystem);
      return;
    }
    const auto scaled_to = [&](const Pose& T_other) {
      Twist e = se3_log(compose(T_other, inverse(T)));
      for (int i = 0; i < 6; ++i) e(i) /= D(i);
      return e;
    };
    if (r.degenerate_count > 0) {  // noise may have moved them, or the start
      Twist back = known.open * scaled_to(origin.T_kept);
      for (int i = 0; i < 6; ++i) back(i) *= D(i);
      T = normalized(compose(se3_exp(back), T));
    }
    if (worse_than_guess(T, T_guess, norm(scaled_to(T_guess)), executor)) {
      fail(r, Status::Diverged);
      return;
    }
    r.covariance = scaled_both(D, known.covariance);
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) r.information(i, j) = known.information(i, j) / (D(i) * D(j));
    }
    r.T_world_camera = normalized(inverse(T));
    r.status = r.degenerate_count > 0 ? Status::Degenerate : (solver_.converged ? Status::Converged : Status::MaxIterations);
  }

  // Whether another pose explains the images as well. Not asked where a direction is open, along which all poses do.
  void look_for_repetition(const Origin& origin, AlignmentResult& r, const ExecutorRef& executor) {
    const Pose T = inverse(r.T_world_camera);
    const RepetitionSearch::Found found = repetition_search_(cost_, T, executor);
    for (std::size_t i = 0; i < found.count && !r.ambiguous; ++i) {
      const int coarsest = found.best[i].level;
      solver_.T = found.best[i].T_camera_world;
      bool alike = true;
      for (int level = coarsest; level >= std::max(0, coarsest - 2) && alike; --level) {
        alike = succeeded(solver_.solve(cost_, level, origin.ratio, executor));
        const Twist e = se3_log(compose(solver_.T, inverse(T)));
        const double apart = std::max(translation_norm(e) / r.median_depth, rotation_norm(e));
        alike = alike && apart * cost_.current(coarsest).camera.fx > 2;  // [px]: less is the same pose
        if (alike && (level < coarsest || level == 0)) alike = cost_.contradicted_tiles(level, solver_.T, T, executor) <= kContradicted;
      }
      r.ambiguous = alike;
      if (alike) r.T_world_camera_other = normalized(inverse(solver_.T));
    }
  }

  // A result that is pixels away from the guess and explains the images worse. Within the reach of a few pixels the two costs
  // differ by noise and by what the references disagree on: a good guess may well come out ahead there, and the result is no
  // worse for it.
  bool worse_than_guess(const Pose& T, const Pose& T_guess, double apart, const ExecutorRef& executor) {
    constexpr int kStep = 8;  // an eighth of the pixels will do
    if (!(apart * cost_.current(0).camera.fx > 3)) return false;
    cost_.sum_cost(T, kAccepted, executor, kStep);  // once more, by the scales of now
    cost_.sum_cost(T_guess, kTrial, executor, kStep);
    return cost_.mean(kTrial, kStep) < 0.99 * cost_.mean(kAccepted, kStep);
  }

  AlignmentCost cost_;
  LevelSolver solver_;
  RotationSearch rotation_search_;
  StartSearch start_search_;
  RepetitionSearch repetition_search_;
  ForegroundCheck foreground_check_;
  KernelRef kernel_;
  NoiseRef noise_;
  bool adaptive_ = false;
  std::vector<Pose> one_;
};

APSO_NAMESPACE_END
