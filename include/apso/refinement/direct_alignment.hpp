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
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/robust_kernel.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/options.hpp>
#include <apso/refinement/alignment_options.hpp>
#include <apso/refinement/noise_model.hpp>
#include <apso/refinement/normal_equations.hpp>
#include <apso/refinement/pyramid.hpp>
#include <apso/refinement/region_labels.hpp>
#include <apso/refinement/residuals.hpp>
#include <apso/refinement/rotation_search.hpp>
#include <apso/status.hpp>

APSO_NAMESPACE_BEGIN

/// A frame that the current one is aligned to.
struct AlignmentReference {
  const FramePyramid* pyramid = nullptr;       ///< prepared as reference
  Pose T_world_reference = Pose::Identity();
  double weight = 1;                           ///< B_k, >= 0
};

struct AlignmentResult {
  Status status = Status::NotRun;
  Pose T_world_camera = Pose::Identity();      ///< the first candidate if the status is a failure
  Matrix6 information = zeros<Matrix6>();       ///< of the increment (v, w) in the camera frame, T_c_w <- Exp(d) T_c_w
  Matrix6 covariance = zeros<Matrix6>();        ///< its inverse on the directions that are determined [m^2, m rad, rad^2]
  Twist eigenvalues = zeros<Twist>();           ///< of the scaled normal matrix, rising
  int degenerate_count = 0;                    ///< directions that kept the initial guess
  Matrix6 degenerate_projector = zeros<Matrix6>(); ///< onto those directions, for twists scaled by (1/l, 1), l = median_depth
  double median_depth = 0;                     ///< l [m]
  double valid_share = 0;                      ///< valid ones of the pixels that are not masked, at the finest level
  double static_share = 1;                     ///< of the area, by the labels of the regions; 1 without labels
  double correlation = 0;                      ///< of the intensities of both images, [-1,1]; 1 when there is nothing to compare
  double scale_intensity = 0;                  ///< final robust scale in units of the noise model; 0 = unset
  double scale_depth = 0;                      ///< the same for depth
  double cost = 0;                             ///< final mean robust cost
  WarpCounts counts;                           ///< at the finest level
  int iterations = 0;                          ///< outer iterations over all levels
  Illumination illumination;                   ///< of the current frame against the first reference
  int start_candidate = -1;                    ///< index of the candidate it began with; the number of candidates = pre-alignment
};

/// Aligns frames. Keeps its buffers, so that a second call of the same size allocates nothing. Deterministic.
class DirectAligner {
 public:
  explicit DirectAligner(const AlignmentOptions& options = {}) : options_(options) { validate(options_, "alignment"); }

  [[nodiscard]] const AlignmentOptions& options() const { return options_; }

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
    const Pose T_start = T;

    bool converged = false;
    const int middle = middle_level();
    for (int level = levels_ - 1; level >= 0; --level) {
      const Status s = solve_level(level, T_guess, T, converged, result, executor);
      if (!succeeded(s) && level == 0) return fail(result, s);  // a coarse level may be too small; finer ones have more
      if (level == middle && level > 0) {
        T = try_other_starts(T_guess, T_start, T, result, executor);
      }
    }
    finish(T_guess, T_start, T, converged, result, executor);
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
    enter(0);
    estimate_scales(0, T, 4 * options_.scale_samples, 0);
    sum(0, T, accepted_, executor);
    result.counts = counts(accepted_);
    result.valid_share = share(result.counts);
    if (result.counts.valid < options_.min_pixels) return fail(result, Status::TooFewPixels);
    if (result.valid_share < options_.min_valid_share) return fail(result, Status::NoOverlap);
    report_scales(result);
    result.cost = mean_cost(accepted_);
    result.status = Status::Converged;
    return result;
  }

 private:
  static constexpr int kPart = 128;  // blocks of pixels of one unit of work

  enum Buffer { accepted_ = 0, trial_ = 1 };
  struct Term {
    const FramePyramid* pyramid = nullptr;
    Pose T_world_reference = Pose::Identity();
    double weight = 1;        // B_k
    double level_weight = 1;  // the same, divided by the pixels if asked for
    TermScales scales, common;
    Illumination light;
    double correlation = 0;  // of the sampled intensities
    std::vector<TileSums> sums[2];
    RegionLabels labels;
    WarpCounts counts[2];
  };
  struct Part {
    int term = 0;
    int begin = 0;  // tiles
    int end = 0;
    WarpCounts counts;
  };

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

  bool begin(const std::vector<AlignmentReference>& references, const FramePyramid& current,
             const std::vector<Pose>& candidates, AlignmentResult& result) {
    expects(!current.empty(), "DirectAligner: the current pyramid was not built");
    expects(!current.level(0).texture.empty(), "DirectAligner: the current pyramid was prepared as reference only");
    expects(!candidates.empty(), "DirectAligner: at least one candidate pose is needed");
    bool found = false;
    for (const Pose& c : candidates) {
      if (!found && is_finite(c)) {
        result.T_world_camera = c;
        found = true;
      }
    }
    if (!found) {
      result.status = Status::Diverged;
      return false;
    }
    current_ = &current;
    levels_ = current.size();
    if (terms_.size() < references.size()) terms_.resize(references.size());
    used_ = 0;
    for (const AlignmentReference& r : references) {
      expects(r.pyramid != nullptr && !r.pyramid->empty(), "DirectAligner: a reference pyramid was not built");
      expects(r.pyramid->size() == current.size() &&
                  r.pyramid->level(0).camera.width == current.level(0).camera.width &&
                  r.pyramid->level(0).camera.height == current.level(0).camera.height,
              "DirectAligner: reference and current pyramid differ in levels or size");
      if (!(r.weight > 0) || !std::isfinite(r.weight) || !is_finite(r.T_world_reference)) continue;
      Term& t = terms_[used_++];
      t.pyramid = r.pyramid;
      t.T_world_reference = r.T_world_reference;
      t.weight = r.weight;
      t.light = Illumination{};
    }
    if (used_ == 0) {
      result.status = Status::NoReference;
      return false;
    }
    return true;
  }

  // The finest level that is narrower than 100 pixels: good enough to compare poses, and cheap.
  [[nodiscard]] int middle_level() const {
    for (int level = 0; level < levels_; ++level) {
      if (current_->level(level).camera.width < 100) return level;
    }
    return 0;
  }

  // Share of the area whose label says that it moves.
  [[nodiscard]] double moving_share() const {
    double moving = 0;
    double all = 0;
    for (std::size_t k = 0; k < used_; ++k) {
      const Term& t = terms_[k];
      for (std::size_t i = 0; i < t.sums[accepted_].size(); ++i) {
        const double w = static_cast<double>(t.sums[accepted_][i].weight);
        all += w;
        moving += w * (1 - static_cast<double>(t.labels[i]));
      }
    }
    return all > 0 ? moving / all : 0.0;
  }

  // Parts of the view that are supposed to be static.
  enum class View { All, Far, Left, Right, Sides };
  [[nodiscard]] static bool belongs(View view, const PixelList& list, std::size_t i, float median_depth) {
    const auto column = static_cast<float>(static_cast<int>(i) % list.columns);
    const float x = (column + 0.5F) / static_cast<float>(list.columns);
    switch (view) {
      case View::All: break;
      case View::Far: return list.tiles[i].depth > 0.9F * median_depth;
      case View::Left: return x < 0.5F;
      case View::Right: return x > 0.5F;
      case View::Sides: return x < 0.3F || x > 0.7F;
    }
    return true;
  }

  // The share of what is seen that a pose does not explain, at the same scale for all poses. Tiles count by the surface
  // that they show, depth^2, not by the image that they fill: what moves is mostly near, what does not is mostly large.
  template <class Executor>
  double unexplained(int level, const Pose& T, const Executor& executor) {
    enter(level);
    estimate_scales(level, T, options_.scale_samples, 0);  // for the brightness
    for (std::size_t k = 0; k < used_; ++k) terms_[k].scales.scale_intensity = terms_[k].scales.scale_depth = 0.5;
    kernel_.kind = KernelKind::GemanMcClure;
    kernel_.k = 2.0;
    sum(level, T, trial_, executor);
    double cost = 0;
    double weight = 0;
    for (std::size_t k = 0; k < used_; ++k) {
      const Term& t = terms_[k];
      const double both = (1 + t.scales.alpha * t.scales.alpha) * 0.5 * kernel_.k * kernel_.k;  // of an outlier
      for (std::size_t i = 0; i < t.sums[trial_].size(); ++i) {
        const auto depth = static_cast<double>(t.pyramid->level(level).pixels.tiles[i].depth);
        const double w = t.level_weight * depth * depth;
        cost += w * static_cast<double>(t.sums[trial_][i].cost) / both;
        weight += w * static_cast<double>(t.sums[trial_][i].weight) / (1 + t.scales.alpha * t.scales.alpha);
      }
    }
    return weight > 0 ? cost / weight : 1.0;
  }

  // Solves the coarse levels again from other starts and for parts of the view, and takes the pose that explains most.
  template <class Executor>
  Pose try_other_starts(const Pose& T_guess, const Pose& T_start, const Pose& T_found, AlignmentResult& result,
                        const Executor& executor) {
    const int middle = middle_level();
    const int coarse = std::min(middle + 1, levels_ - 1);
    const bool moving = options_.regions.on && moving_share() > options_.regions.moving_share;
    double correlation = 1;
    for (std::size_t k = 0; k < used_; ++k) correlation = std::min(correlation, terms_[k].correlation);
    if (!moving && correlation >= options_.search_correlation) return T_found;
    double least = unexplained(middle, T_found, executor);
    const bool poor = correlation < options_.search_correlation && least > options_.search_unexplained;
    if (!moving && !poor) return T_found;
    const double focal = current_->level(levels_ - 1).camera.fx;
    bool converged = false;
    hypotheses_.clear();
    places_.clear();
    const auto explore = [&](Pose T, View view) {
      for (int level = levels_ - 1; level >= coarse; --level) {
        view_ = view;
        (void)solve_level(level, T_guess, T, converged, result, executor);
        view_ = View::All;
        if (view != View::All || level < levels_ - 1) continue;
        for (const Pose& other : places_) {  // half a pixel from where an earlier one came to rest: the same
          if (scaled_distance(T, other, typical_depth(level)) * focal < 0.5) return;
        }
        places_.push_back(T);
      }
      hypotheses_.push_back({T, unexplained(coarse, T, executor)});
    };
    if (moving) {
      for (const View view : {View::Far, View::Left, View::Right, View::Sides}) explore(T_start, view);
    }
    if (poor) {
      // 27 directions of view, 8 degrees apart
      const double step = options_.search_angle;
      for (int i = 0; i < 27; ++i) {
        Twist turn = zeros<Twist>();
        turn(3) = step * (i / 3 % 3 - 1);
        turn(4) = step * (i % 3 - 1);
        turn(5) = step * (i / 9 - 1);
        explore(normalized(compose(se3_exp(turn), T_guess)), View::All);
      }
    }
    constexpr std::size_t kFinalists = 6;
    const std::size_t n = std::min(kFinalists, hypotheses_.size());
    std::partial_sort(hypotheses_.begin(), hypotheses_.begin() + static_cast<std::ptrdiff_t>(n), hypotheses_.end(),
                      [](const Hypothesis& a, const Hypothesis& b) { return a.unexplained < b.unexplained; });
    Pose best = T_found;
    for (std::size_t i = 0; i < n; ++i) {
      Pose T = hypotheses_[i].T;
      (void)solve_level(middle, T_guess, T, converged, result, executor);
      const double u = unexplained(middle, T, executor);
      if (u < least) {
        least = u;
        best = T;
      }
    }
    return best;
  }

  // How far two poses are apart, translations divided by a depth: about the tangent of the shift in the image.
  [[nodiscard]] static double scaled_distance(const Pose& a, const Pose& b, double depth) {
    const Twist e = se3_log(compose(a, inverse(b)));
    return std::max(translation_norm(e) / depth, rotation_norm(e));
  }

  // Cuts the work of a level into parts.
  void enter(int level) {
    parts_.clear();
    for (std::size_t k = 0; k < used_; ++k) {
      Term& t = terms_[k];
      const PixelList& list = t.pyramid->level(level).pixels;
      const int n = static_cast<int>(list.tiles.size());
      for (auto& s : t.sums) s.resize(static_cast<std::size_t>(n));
      t.labels.reset(static_cast<std::size_t>(n));
      if (view_ != View::All) {
        for (std::size_t i = 0; i < list.tiles.size(); ++i) {
          if (!belongs(view_, list, i, t.pyramid->level(level).median_depth)) t.labels.forbid(i);
        }
      }
      for (int b = 0; b < n;) {
        Part p;
        p.term = static_cast<int>(k);
        p.begin = b;
        const int first = list.tiles[static_cast<std::size_t>(b)].begin;
        while (b < n && list.tiles[static_cast<std::size_t>(b)].end - first <= kPart) ++b;
        p.end = b = std::max(b, p.begin + 1);
        parts_.push_back(p);
      }
      t.scales.alpha = options_.alpha.at(level);
      t.level_weight = options_.per_reference_mean ? t.weight * 2e4 / std::max(1, list.count) : t.weight;
    }
    kernel_ = options_.kernel;
    if (options_.graduated && level == 0) {
      kernel_.kind = KernelKind::Tukey;
      kernel_.k = 0;
    }
  }

  [[nodiscard]] Warper warper(int level, const Term& t, const Pose& T_camera_world) const {
    const auto gate = static_cast<float>(std::pow(static_cast<double>(options_.warp.gate_growth), level));
    WarpOptions options = options_.warp;
    options.esm = options.esm && level > 0;
    return Warper(current_->level(level), compose(T_camera_world, t.T_world_reference), t.light, options, options_.noise, gate,
                  current_->background());
  }

  // One pass over all pixels: the sums of every `step`-th tile.
  template <class Executor>
  void sum(int level, const Pose& T_camera_world, Buffer buffer, const Executor& executor, int step = 1) {
    executor(static_cast<int>(parts_.size()), [&](int i) {
      Part& p = parts_[static_cast<std::size_t>(i)];
      Term& t = terms_[static_cast<std::size_t>(p.term)];
      const PixelList& list = t.pyramid->level(level).pixels;
      TileSummer summer(warper(level, t, T_camera_world), kernel_, t.scales);
      for (int k = (p.begin + step - 1) / step * step; k < p.end; k += step) {
        const auto n = static_cast<std::size_t>(k);
        summer(list, list.tiles[n], t.sums[buffer][n]);
      }
      p.counts = summer.counts();
    });
    for (std::size_t k = 0; k < used_; ++k) terms_[k].counts[buffer] = WarpCounts{};
    for (const Part& p : parts_) terms_[static_cast<std::size_t>(p.term)].counts[buffer] += p.counts;
  }
  void accept_trial() {
    for (std::size_t k = 0; k < used_; ++k) {
      Term& t = terms_[k];
      std::swap(t.sums[accepted_], t.sums[trial_]);
      std::swap(t.counts[accepted_], t.counts[trial_]);
    }
  }
  [[nodiscard]] WarpCounts counts(Buffer buffer) const {
    WarpCounts c;
    for (std::size_t k = 0; k < used_; ++k) c += terms_[k].counts[buffer];
    return c;
  }
  // Mean cost of every `step`-th tile.
  [[nodiscard]] double mean_cost(Buffer buffer, std::size_t step = 1) const {
    double cost = 0;
    double weight = 0;
    for (std::size_t k = 0; k < used_; ++k) {
      const Term& t = terms_[k];
      for (std::size_t i = 0; i < t.sums[buffer].size(); i += step) {
        const double w = t.level_weight * static_cast<double>(t.labels[i]);
        cost += w * static_cast<double>(t.sums[buffer][i].cost);
        weight += w * static_cast<double>(t.sums[buffer][i].weight);
      }
    }
    return weight > 0 ? cost / weight : std::numeric_limits<double>::infinity();
  }
  // For an increment of T_camera_world from the left, summed over the references.
  [[nodiscard]] NormalEquations normal_equations(const Pose& T_camera_world) const {
    NormalEquations all;
    for (std::size_t k = 0; k < used_; ++k) {
      PixelSums<double> sum{};
      const Term& t = terms_[k];
      for (std::size_t i = 0; i < t.sums[accepted_].size(); ++i) add(sum, t.sums[accepted_][i], t.labels[i]);
      NormalEquations n = moved_to_left(sum.equations(), compose(T_camera_world, terms_[k].T_world_reference));
      n.H = times(terms_[k].level_weight, n.H);
      n.b = times(terms_[k].level_weight, n.b);
      all += n;
    }
    return all;
  }

  // Robust scales, and brightness, from about `most` pixels of each reference. They are kept unless one of them differs
  // by more than `tolerated`, since costs can be compared only at the same scales.
  // \return whether they were changed
  bool estimate_scales(int level, const Pose& T_camera_world, int most, double tolerated) {
    bool changed = false;
    for (std::size_t k = 0; k < used_; ++k) {
      Term& t = terms_[k];
      const PixelList& list = t.pyramid->level(level).pixels;
      const Warper warp = warper(level, t, T_camera_world);
      const int blocks = list.blocks();
      const int n = std::min(blocks, std::max(1, most / PixelList::kBlock));
      samples_intensity_.clear();
      samples_depth_.clear();
      pairs_.clear();
      for (int i = 0; i < n; ++i) {
        const float* block = list.block(static_cast<int>(static_cast<long long>(i) * blocks / n));
        for (int at = 0; at < PixelList::kBlock; at += kLanes) {
          WarpedLanes o;
          warp.warp(block, at, o);
          for (int j = 0; j < kLanes; ++j) {
            if (o.weight_intensity[j] > 0) {
              const float inverse_sigma = std::sqrt(o.inverse_intensity[j]);
              samples_intensity_.push_back(o.residual_intensity[j] * inverse_sigma);
              pairs_.push_back({block[PixelList::kIntensity * PixelList::kBlock + at + j], o.current[j], inverse_sigma});
            }
            if (o.weight_depth[j] > 0) samples_depth_.push_back(o.residual_depth[j] * std::sqrt(o.inverse_depth[j]));
          }
        }
      }
      t.correlation = correlate();
      Illumination light = t.light;
      const double floor = std::max(1e-6, options_.scale_floor.at(level));
      if (options_.illumination && pairs_.size() >= 32) fit_light(floor, light);
      const double i = std::max(floor, robust_scale_in_place(options_.scale, samples_intensity_));
      const double d = std::max(floor, robust_scale_in_place(options_.scale, samples_depth_));
      const auto differs = [&](double a, double b) { return std::abs(a - b) > tolerated * std::min(a, b); };
      const double brighter = std::abs(0.5 * static_cast<double>(light.gain - t.light.gain) +
                                       static_cast<double>(light.offset - t.light.offset));
      if (differs(i, t.scales.scale_intensity) || differs(d, t.scales.scale_depth) ||
          brighter > tolerated * static_cast<double>(options_.noise.sigma_intensity) * i) {
        t.scales.scale_intensity = i;
        t.scales.scale_depth = d;
        t.light = light;
        changed = true;
      }
    }
    return changed;
  }

  // Correlation of the sampled intensities; 1 where there is nothing to compare, as on a reference without contrast.
  [[nodiscard]] double correlate() const {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
    for (const LightSample& p : pairs_) {
      const double a = static_cast<double>(p.reference);
      const double b = static_cast<double>(p.current);
      n += 1;
      x += a;
      y += b;
      xx += a * a;
      xy += a * b;
      yy += b * b;
    }
    if (n < 2) return 0;
    const double noise = static_cast<double>(options_.noise.sigma_intensity);
    const double vx = xx / n - x / n * (x / n);
    const double vy = yy / n - y / n * (y / n);
    const double bare = 2 * noise * noise;
    if (vx < bare || (options_.depth_alone && vy < bare)) return 1;
    if (!(vy > 1e-12)) return 0;
    return (xy / n - x / n * (y / n)) / std::sqrt(vx * vy);
  }

  // Robust line I_c = gain I_k + offset through the sampled pairs, held at (1, 0) by a weak prior. The residuals of the
  // sample are brought up to date.
  void fit_light(double floor, Illumination& light) {
    constexpr double kPrior = 100;  // 1 / 0.1^2
    sorted_ = samples_intensity_;
    const double scale = std::max(floor, mad_scale_in_place(sorted_)) * 2.3849;
    double gain = static_cast<double>(light.gain);
    double offset = static_cast<double>(light.offset);
    for (int it = 0; it < 3; ++it) {
      double aa = kPrior;
      double ab = 0;
      double bb = kPrior;
      double ya = kPrior;
      double yb = 0;
      for (const LightSample& p : pairs_) {
        const double a = static_cast<double>(p.reference);
        const double y = static_cast<double>(p.current);
        const double inverse = static_cast<double>(p.inverse_sigma);
        const double s = (y - gain * a - offset) * inverse / scale;
        const double w = inverse * inverse / (scale * scale) / (1 + s * s);
        aa += w * a * a;
        ab += w * a;
        bb += w;
        ya += w * a * y;
        yb += w * y;
      }
      const double det = aa * bb - ab * ab;
      gain = (ya * bb - yb * ab) / det;
      offset = (aa * yb - ab * ya) / det;
    }
    if (!std::isfinite(gain) || !std::isfinite(offset) || gain < 0.3 || gain > 3) return;
    light.gain = static_cast<float>(gain);
    light.offset = static_cast<float>(offset);
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const LightSample& p = pairs_[i];
      samples_intensity_[i] = (p.current - light.gain * p.reference - light.offset) * p.inverse_sigma;
    }
  }

  // Geometric mean over the references, weighted by B_k N_k.
  void report_scales(AlignmentResult& r) const {
    double weight = 0;
    double i = 0;
    double d = 0;
    for (std::size_t k = 0; k < used_; ++k) {
      const Term& t = terms_[k];
      const double w = t.weight * t.counts[accepted_].valid;
      weight += w;
      i += w * std::log(t.scales.scale_intensity);
      d += w * std::log(t.scales.scale_depth);
    }
    r.scale_intensity = weight > 0 ? std::exp(i / weight) : 0.0;
    r.scale_depth = weight > 0 ? std::exp(d / weight) : 0.0;
    r.illumination = terms_.front().light;
    r.correlation = 1;
    for (std::size_t k = 0; k < used_; ++k) r.correlation = std::min(r.correlation, terms_[k].correlation);
  }

  // The candidate with the lowest cost at the coarsest level, all at the same scale.
  template <class Executor>
  Pose choose_start(const std::vector<Pose>& candidates, AlignmentResult& result, const Executor& executor) {
    const int level = levels_ - 1;
    double best = std::numeric_limits<double>::infinity();
    Pose T = inverse(result.T_world_camera);
    enter(level);
    for (std::size_t k = 0; k < used_; ++k) terms_[k].scales.scale_intensity = terms_[k].scales.scale_depth = 1.0;
    const auto consider = [&](const Pose& T_camera_world, int index) {
      sum(level, T_camera_world, trial_, executor);
      const double c = mean_cost(trial_);
      if (c < best) {
        best = c;
        T = T_camera_world;
        result.start_candidate = index;
      }
    };
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (is_finite(candidates[i])) consider(inverse(candidates[i]), static_cast<int>(i));
    }
    if (options_.prealign_rotation) {
      const Term& t = terms_.front();
      const Pose found = rotation_search_(t.pyramid->level(level).pixels, current_->level(level),
                                          compose(T, t.T_world_reference), options_.prealign_iterations);
      // the camera turns about itself
      const Pose reference_world = inverse(compose(T, t.T_world_reference));
      const Eigen::Matrix3d turn = times(rotation(found), rotation(reference_world));
      const Pose rotated = compose(make_pose(turn, Eigen::Vector3d(0, 0, 0)), T);
      if (is_finite(rotated)) consider(normalized(rotated), static_cast<int>(candidates.size()));
    }
    return T;
  }

  [[nodiscard]] double typical_depth(int level) const {
    double sum = 0;
    double weight = 0;
    for (std::size_t k = 0; k < used_; ++k) {
      const PyramidLevel& l = terms_[k].pyramid->level(level);
      sum += static_cast<double>(l.median_depth) * l.pixels.count;
      weight += l.pixels.count;
    }
    return weight > 0 && sum > 0 ? sum / weight : 1.0;
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
  int degenerate(const Matrix6& H, double depth, Matrix6& P, Twist* eigenvalues) const {
    const SymmetricEigen<6> eigen = eigen_symmetric(scaled_both(unit_twist(depth), H));
    P = zeros<Matrix6>();
    int count = 0;
    const double largest = eigen.values(5);
    for (int i = 0; i < 6; ++i) {
      const double value = eigen.values(i);
      if (value < options_.degenerate_ratio * largest || value < options_.degenerate_floor) {
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
    if (!(options_.prior_sigma_translation > 0) || !(options_.prior_sigma_rotation > 0)) return;
    const Twist e = se3_log(compose(T_guess, inverse(T)));
    for (int i = 0; i < 6; ++i) {
      const double sigma = i < 3 ? options_.prior_sigma_translation : options_.prior_sigma_rotation;
      const double p = 1.0 / (sigma * sigma * options_.information_deflation);
      n.H(i, i) += p;
      n.b(i) += p * e(i);
    }
  }

  template <class Executor>
  Status solve_level(int level, const Pose& T_guess, Pose& T, bool& converged, AlignmentResult& result,
                     const Executor& executor) {
    converged = false;
    enter(level);
    estimate_scales(level, T, options_.scale_samples, 0);
    sum(level, T, accepted_, executor);
    // a coarse image has fewer pixels in all
    const int enough = std::max(6, options_.min_pixels >> (2 * level));
    if (counts(accepted_).selected < enough) return Status::TooFewPixels;
    if (counts(accepted_).valid < enough) return Status::NoOverlap;
    const double depth = typical_depth(level);
    const double focal = current_->level(level).camera.fx;
    const Twist D = unit_twist(depth);
    double mu = options_.damping;
    const int most = static_cast<int>(options_.iterations.at(level));
    for (int it = 0; it < most && !converged; ++it) {
      ++result.iterations;
      if (options_.regions.on) {
        for (std::size_t k = 0; k < used_; ++k) {
          Term& t = terms_[k];
          const double both = 1 + t.scales.alpha * t.scales.alpha;
          t.labels.update(t.sums[accepted_], t.pyramid->level(level).pixels.tiles, options_.regions,
                          both * kernel_.rho(3.0), both);
        }
      }
      const double before = mean_cost(accepted_);
      NormalEquations n = normal_equations(T);
      if (!std::isfinite(before) || !all_finite(n.H) || !all_finite(n.b)) return Status::Diverged;
      add_prior(T_guess, T, n);
      Matrix6 P;
      if (degenerate(n.H, depth, P, nullptr) == 6) return level > 0 ? Status::TooFewPixels : Status::SingularSystem;
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
      for (int reject = 0; reject <= options_.max_rejects; ++reject) {
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
        const bool tiny = focal * largest < options_.stop_pixels.at(level);
        const Pose T_trial = normalized(compose(se3_exp(step), T));
        if (tiny && reject == 0) {  // taken without another look
          T = T_trial;
          converged = moved = true;
          break;
        }
        sum(level, T_trial, trial_, executor);
        const double after = mean_cost(trial_);
        if (after < before) {
          T = T_trial;
          accept_trial();
          moved = true;
          mu = std::max(1e-9, mu / 10);
          converged = tiny || before - after < options_.stop_relative_cost * before;
          break;
        }
        mu = std::max(1e-9, mu * 10);
        if (tiny) break;
      }
      if (!moved) {  // no step lowers the cost: a minimum
        converged = true;
      } else if (!converged && estimate_scales(level, T, options_.scale_samples, options_.scale_change)) {
        sum(level, T, accepted_, executor);
      }
    }
    if (counts(accepted_).valid < enough) return Status::NoOverlap;
    return Status::Converged;
  }

  template <class Executor>
  void finish(const Pose& T_guess, const Pose& T_start, Pose T, bool converged, AlignmentResult& r,
              const Executor& executor) {
    r.counts = counts(accepted_);
    r.valid_share = share(r.counts);
    r.static_share = 1 - moving_share();
    r.cost = mean_cost(accepted_);
    const NormalEquations n = normal_equations(T);
    if (!is_finite(T) || !std::isfinite(r.cost) || !all_finite(n.H)) {
      r.cost = 0;
      fail(r, Status::Diverged);
      return;
    }
    estimate_scales(0, T, 4 * options_.scale_samples, 0);
    report_scales(r);
    r.median_depth = typical_depth(0);
    Matrix6 P;
    r.degenerate_count = degenerate(n.H, r.median_depth, P, &r.eigenvalues);
    r.degenerate_projector = P;
    if (r.counts.valid_depth < options_.min_pixels) {
      fail(r, Status::TooFewPixels);
      return;
    }
    if (r.valid_share < options_.min_valid_share || r.correlation < options_.min_correlation) {
      fail(r, Status::NoOverlap);
      return;
    }
    if (r.degenerate_count == 6) {
      fail(r, Status::SingularSystem);
      return;
    }
    const Twist D = unit_twist(r.median_depth);
    const auto scaled_to_guess = [&] {
      Twist e = se3_log(compose(T_guess, inverse(T)));
      for (int i = 0; i < 6; ++i) e(i) /= D(i);
      return e;
    };
    if (r.degenerate_count > 0 && norm(se3_log(compose(T_start, inverse(T_guess)))) > 1e-12) {
      // it did not start at the guess: bring the undetermined directions back to it
      Twist back = times(P, scaled_to_guess());
      for (int i = 0; i < 6; ++i) back(i) *= D(i);
      T = normalized(compose(se3_exp(back), T));
    }
    if (options_.check_against_guess) {
      constexpr int kStep = 8;  // an eighth of the pixels will do
      sum(0, T_guess, trial_, executor, kStep);
      // Within the reach of a few pixels the two costs differ by noise and by what the references disagree on: a good
      // guess may well come out ahead there, and the result is no worse for it.
      const bool far = norm(scaled_to_guess()) * current_->level(0).camera.fx > 3;
      if (far && mean_cost(trial_, kStep) < 0.99 * mean_cost(accepted_, kStep)) {
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
    r.information = times(options_.information_deflation, n.H);
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        r.covariance(i, j) = 0.5 / options_.information_deflation * (covariance(i, j) + covariance(j, i));
      }
    }
    r.T_world_camera = normalized(inverse(T));
    r.status = r.degenerate_count > 0 ? Status::Degenerate : (converged ? Status::Converged : Status::MaxIterations);
  }

  struct LightSample {
    float reference, current, inverse_sigma;
  };

  AlignmentOptions options_;
  RobustKernel kernel_;
  const FramePyramid* current_ = nullptr;
  int levels_ = 0;
  View view_ = View::All;
  std::size_t used_ = 0;  // terms of this call
  std::vector<Term> terms_;
  std::vector<Part> parts_;
  RotationSearch rotation_search_;
  std::vector<float> samples_intensity_, samples_depth_, sorted_;
  std::vector<LightSample> pairs_;
  std::vector<Pose> one_;
  struct Hypothesis {
    Pose T;
    double unexplained;
  };
  std::vector<Hypothesis> hypotheses_;
  std::vector<Pose> places_;
};

APSO_NAMESPACE_END
