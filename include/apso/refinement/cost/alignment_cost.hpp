/// \file
/// The cost of direct alignment at one level, as a function of the pose: sums over all references, robust scales, brightness
/// and labels of regions.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/kernels.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/options.hpp>
#include <apso/refinement/alignment_options.hpp>
#include <apso/refinement/alignment_result.hpp>
#include <apso/refinement/cost/cost_terms.hpp>
#include <apso/refinement/cost/illumination.hpp>
#include <apso/refinement/cost/kernel_loop.hpp>
#include <apso/refinement/cost/normal_equations.hpp>
#include <apso/refinement/cost/residuals.hpp>
#include <apso/refinement/cost/scale/scale_estimator.hpp>
#include <apso/refinement/cost/tile_summer.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>

APSO_NAMESPACE_BEGIN

/// Evaluates the cost of poses T_camera_world of the current frame against all references, at the level that was entered
/// last. Sums are kept twice, at the pose that was accepted and at one on trial. Keeps its buffers. Deterministic for any
/// executor.
class AlignmentCost : public CostTerms {
 public:
  explicit AlignmentCost(const AlignmentOptions& options) : options_(options) { validate(options_, "alignment"); }
  [[nodiscard]] const AlignmentOptions& options() const { return options_; }

  /// Takes up the frames. References of weight 0 and such without a finite pose are left out.
  /// \param kernel,noise must outlive all other calls
  /// \param adaptive the kernel is Barron's with the alpha that the residuals ask for
  /// \return false if no reference remains
  bool begin(const std::vector<AlignmentReference>& references, const FramePyramid& current, const KernelRef& kernel, const NoiseRef& noise,
             bool adaptive) {
    expects(!current.empty(), "DirectAligner: the current pyramid was not built");
    expects(!current.level(0).texture.empty(), "DirectAligner: the current pyramid was prepared as reference only");
    given_kernel_ = kernel;
    noise_ = noise;
    adaptive_ = adaptive;
    barron_ = RobustKernel{KernelKind::Barron, options_.kernel.constant(), options_.kernel.alpha};
    return take_up(references, current);
  }

  /// Turns to a level: all regions count as static, and the scales have to be estimated or set.
  void enter(int level) {
    const int s = schedule(level);
    const double alpha = s > 0 ? options_.alpha_coarse : (s == 0 ? options_.alpha : std::min(options_.alpha, kAlphaFiner));
    enter_terms(level);
    for (std::size_t k = 0; k < used_; ++k) {
      terms_[k].scales = TermScales{1, 1, alpha, options_.alpha_place, options_.coupling, 0};
      if (options_.coupling == ScaleCoupling::BivariateT) terms_[k].scales.alpha = 1;  // the covariance says how they compare
    }
    gate_factor_ = static_cast<float>(std::pow(static_cast<double>(kGateGrowth), std::max(0, s)));
    if (options_.coupling == ScaleCoupling::BivariateT) kernel_ = KernelRef(bivariate_);
    else if (options_.graduated && level == 0) kernel_ = KernelRef(tukey_);
    else if (adaptive_) kernel_ = KernelRef(barron_);
    else kernel_ = given_kernel_;
  }
  /// The same scale for all residuals, each by itself.
  void set_scales(double scale) {
    for (std::size_t k = 0; k < used_; ++k) {
      TermScales& s = terms_[k].scales;
      s.scale_intensity = s.scale_depth = scale;
      s.slope = 0;
    }
  }

  /// One pass over all pixels: the sums that costs and equations are made of.
  void sum(const Pose& T_camera_world, Buffer buffer, const ExecutorRef& executor) { pass(T_camera_world, buffer, executor, 1, true); }
  /// H with the rows of the reference, and with those of both images, sum q a_reference a_current^T (solver/pose_information.hpp), at the
  /// accepted pose: both of the same tiles, a third of all, and brought to the size of all.
  struct SharedInformation {
    Matrix6 by_one = zeros<Matrix6>(), by_both = zeros<Matrix6>();
  };
  /// \param H the normal matrix at the accepted pose
  [[nodiscard]] SharedInformation shared_information(const Matrix6& H, const Pose& T_camera_world, const ExecutorRef& executor) {
    pass(T_camera_world, kTrial, executor, kSharedTiles, true, true);
    SharedInformation s;
    s.by_one = normal_equations(T_camera_world, executor, kAccepted, kSharedTiles).H;
    s.by_both = normal_equations(T_camera_world, executor, kTrial, kSharedTiles).H;
    const double some = s.by_one.trace();
    const double factor = some > 0 ? H.trace() / some : 0.0;
    s.by_one *= factor;
    s.by_both *= factor;
    return s;
  }
  /// Costs alone, of every `step`-th tile.
  void sum_cost(const Pose& T_camera_world, Buffer buffer, const ExecutorRef& executor, int step = 1) {
    pass(T_camera_world, buffer, executor, step, false);
  }
  /// Of the sums of every `step`-th tile, for an increment of T_camera_world from the left.
  [[nodiscard]] NormalEquations normal_equations(const Pose& T_camera_world, const ExecutorRef& executor, Buffer buffer = kAccepted,
                                                 int step = 1) {
    executor(static_cast<int>(parts_.size()), [&](int i) {
      CostPart& p = parts_[static_cast<std::size_t>(i)];
      const CostTerm& t = terms_[static_cast<std::size_t>(p.term)];
      PixelSums<double> sum{};
      for (int k = first_tile(p, step); k < p.end; k += step) {
        const auto n = static_cast<std::size_t>(k);
        add(sum, t.sums[buffer][n], t.labels[n]);
      }
      p.sum = sum;
    });
    NormalEquations all;
    for (std::size_t k = 0; k < used_; ++k) {
      const CostTerm& t = terms_[k];
      NormalEquations n;
      for (const CostPart& p : parts_) {
        if (static_cast<std::size_t>(p.term) == k) n += p.sum.equations();
      }
      n = moved_to_left(n, compose(T_camera_world, t.T_world_reference));
      n.H *= t.weight;
      n.b *= t.weight;
      all += n;
    }
    return all;
  }

  /// Labels of the regions from the accepted sums.
  void update_labels() {
    if (!options_.regions) return;
    for (std::size_t k = 0; k < used_; ++k) {
      CostTerm& t = terms_[k];
      t.labels.update(t.sums[kAccepted], t.level->pixels.tiles, t.scales.charge(kernel_), t.scales.both());
    }
  }
  /// Robust scales, and brightness, from about `most` pixels of each reference. They are kept unless one of them differs
  /// by more than `tolerated`, since costs can be compared only at the same scales.
  /// \return whether they were changed
  bool estimate_scales(const Pose& T_camera_world, int most, double tolerated, const ExecutorRef& executor) {
    const double floor = schedule(level_) > 0 && options_.scale_floor > 0 ? kCoarseScaleFloor : std::max(1e-6, options_.scale_floor);
    bool changed = false;
    scale_estimator_.begin();
    for (std::size_t k = 0; k < used_; ++k) {
      CostTerm& t = terms_[k];
      changed = scale_estimator_(t, warper(t, T_camera_world), noise_, options_, most, floor, tolerated, executor) || changed;
      if (adaptive_) scale_estimator_.keep_standardised(t.scales);
    }
    if (adaptive_ && changed) barron_.alpha = scale_estimator_.adaptive_alpha(barron_.k);
    return changed;
  }
  void report_scales(AlignmentResult& r) const {
    CostTerms::report_scales(r);
    r.kernel_alpha = adaptive_ ? barron_.alpha : 0.0;
  }

  /// How well a pose explains the view, by a bounded cost at one scale for all poses.
  struct Evidence {
    double contradicted = 1;  ///< share of what both images show that does not agree, [0,1]
    double support = 0;       ///< what agrees minus twice what does not, as share of all pixels, [-2,1]
  };
  /// Tiles count by the surface that they show, depth^2, not by the image that they fill: what moves is mostly near, what
  /// does not is mostly large. What leaves the view counts neither way, and what contradicts counts twice: a wrong pose brings
  /// bare walls together, which agree with each other anywhere.
  [[nodiscard]] Evidence evidence(int level, const Pose& T_camera_world, const ExecutorRef& executor) {
    enter(level);
    estimate_scales(T_camera_world, kScaleSamples, 0, executor);  // for the brightness
    return weigh(T_camera_world, executor);
  }
  /// The same with the brightness as it was estimated last: faster.
  [[nodiscard]] Evidence evidence_as_lit(int level, const Pose& T_camera_world, const ExecutorRef& executor) {
    enter(level);
    return weigh(T_camera_world, executor);
  }

  /// Share of the tiles that both poses show in which T_other explains a fifth of the pixels less than T, by the same bounded cost; 1 if
  /// they show nothing in common. What is seen at another distance or angle differs a little everywhere, another thing much in its place.
  [[nodiscard]] double contradicted_tiles(int level, const Pose& T_other, const Pose& T, const ExecutorRef& executor) {
    enter(level);
    estimate_scales(T, kScaleSamples, 0, executor);  // for the brightness
    judge(T, kAccepted, executor);
    judge(T_other, kTrial, executor);
    int seen = 0;
    int contradicted = 0;
    for (std::size_t k = 0; k < used_; ++k) {
      const CostTerm& t = terms_[k];
      t.count_contradicted(t.scales.charge(kernel_), 0.2 * outlier_cost(), seen, contradicted);
    }
    return seen > 0 ? static_cast<double>(contradicted) / seen : 1.0;
  }

  static constexpr int kScaleSamples = 1024;  ///< pixels looked at for the scale
  static constexpr int kSharedTiles = 3;      ///< every third tile, of 20 in a row: spread over all columns

 private:
  static constexpr double kAlphaFiner = 0.85;  // largest alpha at the extra level of frames that are mostly masked, as in dense_alignment()
  static constexpr double kCoarseScaleFloor = 0.25;  // smallest scale at coarse levels, in units of the noise model

  [[nodiscard]] Warper warper(const CostTerm& t, const Pose& T_camera_world, bool rows_of_current = false) const {
    WarpOptions options = options_.warp;
    options.esm = options.esm && level_ > 0;
    return Warper(current(level_), compose(T_camera_world, t.T_world_reference), t.light, options, gate_factor_, current_->background(),
                  rows_of_current);
  }

  // Bounded costs at one scale for all poses.
  void judge(const Pose& T_camera_world, Buffer buffer, const ExecutorRef& executor) {
    set_scales(0.5);
    kernel_ = KernelRef(judge_);
    sum_cost(T_camera_world, buffer, executor);
  }
  [[nodiscard]] double outlier_cost() const { return 0.5 * judge_.k * judge_.k; }

  // At the level that was entered, with the brightness as it is.
  Evidence weigh(const Pose& T_camera_world, const ExecutorRef& executor) {
    judge(T_camera_world, kTrial, executor);
    double against = 0;
    double seen = 0;
    double all = 0;
    for (std::size_t k = 0; k < used_; ++k) {
      const CostTerm& t = terms_[k];
      const CostTerm::OverSurface o = t.over_surface(kTrial, t.scales.charge(kernel_));
      against += o.cost / outlier_cost();
      seen += o.seen;
      all += o.all;
    }
    Evidence e;
    if (seen > 0) e.contradicted = against / seen;
    if (all > 0) e.support = (seen - 3 * against) / all;
    return e;
  }

  static int first_tile(const CostPart& p, int step) { return (p.begin + step - 1) / step * step; }

  // Every `step`-th tile, and what became of the pixels.
  void pass(const Pose& T_camera_world, Buffer buffer, const ExecutorRef& executor, int step, bool equations,
            bool rows_of_current = false) {
    executor(static_cast<int>(parts_.size()), [&](int i) {
      CostPart& p = parts_[static_cast<std::size_t>(i)];
      CostTerm& t = terms_[static_cast<std::size_t>(p.term)];
      const PixelList& list = t.level->pixels;
      TileSummer summer(warper(t, T_camera_world, rows_of_current), noise_, kernel_, t.scales);
      for (int k = first_tile(p, step); k < p.end; k += step) {
        const auto n = static_cast<std::size_t>(k);
        if (equations) summer(list, list.tiles[n], t.sums[buffer][n]);
        else summer.cost(list, list.tiles[n], t.sums[buffer][n]);
      }
      p.counts = summer.counts();
    });
    for (std::size_t k = 0; k < used_; ++k) terms_[k].counts[buffer] = WarpCounts{};
    for (const CostPart& p : parts_) terms_[static_cast<std::size_t>(p.term)].counts[buffer] += p.counts;
  }

  AlignmentOptions options_;
  float gate_factor_ = 1;  // of the level
  ScaleEstimator scale_estimator_;
  NoiseRef noise_;
  KernelRef given_kernel_, kernel_;  // of this call, of the level
  kernels::Tukey tukey_{default_constant(KernelKind::Tukey)};
  kernels::GemanMcClure judge_{2.0};
  kernels::BivariateT bivariate_;
  RobustKernel barron_;
  bool adaptive_ = false;
};

APSO_NAMESPACE_END
