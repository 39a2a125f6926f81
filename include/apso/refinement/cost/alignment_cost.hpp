/// \file
/// The cost of direct alignment at one level, as a function of the pose: sums over all references, robust scales, brightness
/// and labels of regions.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/kernels.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/options.hpp>
#include <apso/refinement/alignment_options.hpp>
#include <apso/refinement/alignment_result.hpp>
#include <apso/refinement/cost/illumination.hpp>
#include <apso/refinement/cost/normal_equations.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/refinement/cost/region_labels.hpp>
#include <apso/refinement/cost/residuals.hpp>
#include <apso/status.hpp>

APSO_NAMESPACE_BEGIN

/// Evaluates the cost of poses T_camera_world of the current frame against all references, at the level that was entered
/// last. Sums are kept twice, at the pose that was accepted and at one on trial. Keeps its buffers. Deterministic for any
/// executor.
class AlignmentCost {
 public:
  enum Buffer { kAccepted = 0, kTrial = 1 };

  explicit AlignmentCost(const AlignmentOptions& options) : options_(options) { validate(options_, "alignment"); }
  [[nodiscard]] const AlignmentOptions& options() const { return options_; }

  /// Takes up the frames. References of weight 0 and such without a finite pose are left out.
  /// \return false if no reference remains
  bool begin(const std::vector<AlignmentReference>& references, const FramePyramid& current) {
    expects(!current.empty(), "DirectAligner: the current pyramid was not built");
    expects(!current.level(0).texture.empty(), "DirectAligner: the current pyramid was prepared as reference only");
    current_ = &current;
    finest_ = current.finest();
    if (terms_.size() < references.size()) terms_.resize(references.size());
    used_ = 0;
    for (const AlignmentReference& r : references) {
      expects(r.pyramid != nullptr && !r.pyramid->empty(), "DirectAligner: a reference pyramid was not built");
      const FramePyramid& p = *r.pyramid;
      expects(p.nominal_finest() == current.nominal_finest() && p.finest() + p.size() == current.finest() + current.size() &&
                  p.halved(p.nominal_finest()).camera.width == current.halved(p.nominal_finest()).camera.width &&
                  p.halved(p.nominal_finest()).camera.height == current.halved(p.nominal_finest()).camera.height,
              "DirectAligner: reference and current pyramid differ in levels or size");
      if (!(r.weight > 0) || !std::isfinite(r.weight) || !is_finite(r.T_world_reference)) continue;
      Term& t = terms_[used_++];
      t.pyramid = r.pyramid;
      t.T_world_reference = r.T_world_reference;
      t.weight = r.weight;
      t.light = Illumination{};
      finest_ = std::max(finest_, p.finest());
    }
    return used_ > 0;
  }

  /// Turns to a level: all regions count as static, and the scales have to be estimated or set.
  void enter(int level) {
    level_ = level;
    parts_.clear();
    for (std::size_t k = 0; k < used_; ++k) {
      Term& t = terms_[k];
      const PixelList& list = level_of(t, level).pixels;
      const int n = static_cast<int>(list.tiles.size());
      for (auto& s : t.sums) s.resize(static_cast<std::size_t>(n));
      t.labels.reset(static_cast<std::size_t>(n));
      const int count = std::clamp(list.blocks() / kLeastPart, 1, kParts);
      for (int part = 0, b = 0; part < count; ++part) {
        Part p;
        p.term = static_cast<int>(k);
        p.begin = b;
        const int last = list.blocks() * (part + 1) / count;
        while (b < n && list.tiles[static_cast<std::size_t>(b)].end <= last) ++b;
        p.end = b;
        if (p.end > p.begin) parts_.push_back(p);
      }
      t.scales.alpha = schedule(level) < 0 ? options_.alpha_finer : options_.alpha.at(schedule(level));
      t.level_weight = options_.per_reference_mean ? t.weight * 2e4 / std::max(1, list.count) : t.weight;
    }
    gate_factor_ = static_cast<float>(std::pow(static_cast<double>(options_.warp.gate_growth), std::max(0, schedule(level))));
    kernel_ = options_.kernel;
    if (options_.graduated && level == 0) {
      kernel_.kind = KernelKind::Tukey;
      kernel_.k = 0;
    }
  }
  void set_scales(double scale) {
    for (std::size_t k = 0; k < used_; ++k) terms_[k].scales.scale_intensity = terms_[k].scales.scale_depth = scale;
  }

  /// Levels that all frames have; 0 is the finest of them.
  [[nodiscard]] int levels() const { return current_->finest() + current_->size() - finest_; }
  /// Counted from the usual finest level, as options are: -1 for the one more of frames that are mostly masked.
  [[nodiscard]] int schedule(int level) const { return halvings(level) - current_->nominal_finest(); }
  /// All frames have that one.
  [[nodiscard]] bool mostly_masked() const { return schedule(0) < 0; }
  /// Halvings from the full size.
  [[nodiscard]] int halvings(int level) const { return finest_ + level; }
  [[nodiscard]] const FramePyramid& current() const { return *current_; }
  [[nodiscard]] const PyramidLevel& current(int level) const { return current_->halved(halvings(level)); }
  [[nodiscard]] const FramePyramid& first_reference() const { return *terms_.front().pyramid; }
  [[nodiscard]] const Pose& first_T_world_reference() const { return terms_.front().T_world_reference; }

  /// Mean over the references of the median depth of their pixels [m].
  [[nodiscard]] double typical_depth() const {
    double sum = 0;
    double weight = 0;
    for (std::size_t k = 0; k < used_; ++k) {
      const PyramidLevel& l = level_of(terms_[k], level_);
      sum += static_cast<double>(l.median_depth) * l.pixels.count;
      weight += l.pixels.count;
    }
    return weight > 0 && sum > 0 ? sum / weight : 1.0;
  }

  /// One pass over all pixels: the sums that costs and equations are made of.
  template <class Executor>
  void sum(const Pose& T_camera_world, Buffer buffer, const Executor& executor) {
    pass(T_camera_world, buffer, executor, 1, [](TileSummer& summer, const PixelList& list, const PixelList::Tile& tile, TileSums& out) {
      summer(list, tile, out);
    });
  }
  /// The same of every `step`-th tile, for costs alone.
  template <class Executor>
  void sum_cost(const Pose& T_camera_world, Buffer buffer, const Executor& executor, int step = 1) {
    pass(T_camera_world, buffer, executor, step, [](TileSummer& summer, const PixelList& list, const PixelList::Tile& tile, TileSums& out) {
      summer.cost(list, tile, out);
    });
  }
  /// What was on trial is accepted.
  void accept_trial() {
    for (std::size_t k = 0; k < used_; ++k) {
      Term& t = terms_[k];
      std::swap(t.sums[kAccepted], t.sums[kTrial]);
      std::swap(t.counts[kAccepted], t.counts[kTrial]);
    }
  }

  [[nodiscard]] WarpCounts counts() const {
    WarpCounts c;
    for (std::size_t k = 0; k < used_; ++k) c += terms_[k].counts[kAccepted];
    return c;
  }
  /// Mean robust cost of every `step`-th tile, by the labels; infinite if nothing is seen.
  [[nodiscard]] double mean(Buffer buffer, std::size_t step = 1) const {
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
  /// Of the accepted sums, for an increment of T_camera_world from the left.
  template <class Executor>
  [[nodiscard]] NormalEquations normal_equations(const Pose& T_camera_world, const Executor& executor) {
    executor(static_cast<int>(parts_.size()), [&](int i) {
      Part& p = parts_[static_cast<std::size_t>(i)];
      const Term& t = terms_[static_cast<std::size_t>(p.term)];
      PixelSums<double> sum{};
      for (auto k = static_cast<std::size_t>(p.begin); k < static_cast<std::size_t>(p.end); ++k) {
        add(sum, t.sums[kAccepted][k], t.labels[k]);
      }
      p.sum = sum;
    });
    NormalEquations all;
    for (std::size_t k = 0; k < used_; ++k) {
      const Term& t = terms_[k];
      NormalEquations n;
      for (const Part& p : parts_) {
        if (static_cast<std::size_t>(p.term) == k) n += p.sum.equations();
      }
      n = moved_to_left(n, compose(T_camera_world, t.T_world_reference));
      n.H = times(t.level_weight, n.H);
      n.b = times(t.level_weight, n.b);
      all += n;
    }
    return all;
  }

  /// Labels of the regions from the accepted sums.
  void update_labels() {
    if (!options_.regions.on) return;
    for (std::size_t k = 0; k < used_; ++k) {
      Term& t = terms_[k];
      const double both = 1 + t.scales.alpha * t.scales.alpha;
      t.labels.update(t.sums[kAccepted], level_of(t, level_).pixels.tiles, options_.regions, both * kernel_.rho(3.0), both);
    }
  }
  /// Share of the area whose label says that it moves.
  [[nodiscard]] double moving_share() const {
    double moving = 0;
    double all = 0;
    for (std::size_t k = 0; k < used_; ++k) {
      const Term& t = terms_[k];
      for (std::size_t i = 0; i < t.sums[kAccepted].size(); ++i) {
        const double w = static_cast<double>(t.sums[kAccepted][i].weight);
        all += w;
        moving += w * (1 - static_cast<double>(t.labels[i]));
      }
    }
    return all > 0 ? moving / all : 0.0;
  }

  /// Robust scales, and brightness, from about `most` pixels of each reference. They are kept unless one of them differs
  /// by more than `tolerated`, since costs can be compared only at the same scales.
  /// \return whether they were changed
  template <class Executor>
  bool estimate_scales(const Pose& T_camera_world, int most, double tolerated, const Executor& executor) {
    bool changed = false;
    for (std::size_t k = 0; k < used_; ++k) {
      Term& t = terms_[k];
      sample(t, T_camera_world, most, executor);
      executor(2, [&](int task) { (task == 0 ? intensities_ : depths_).estimate(options_.scale); });
      if (intensities_.crowded() || depths_.crowded()) {
        executor(2, [&](int task) { (task == 0 ? intensities_ : depths_).spread_over_surface(); });
        for (std::vector<float>* v : {&pairs_.reference, &pairs_.current, &pairs_.inverse_sigma}) intensities_.pick(*v);
      }
      Illumination light = t.light;
      const double floor = std::max(1e-6, options_.scale_floor.at(schedule(level_)));
      executor(2, [&](int task) {
        if (task == 0) {
          if (options_.illumination && pairs_.size() >= 32) {
            fit_illumination(pairs_, floor, intensities_.residuals, intensities_.scratch, light);
            intensities_.scale = robust_scale_in_place(options_.scale, intensities_.residuals);
          }
        } else {
          t.correlation = intensity_correlation(pairs_, static_cast<double>(options_.noise.sigma_intensity), options_.depth_alone);
        }
      });
      const double i = std::max(floor, intensities_.scale);
      const double d = std::max(floor, depths_.scale);
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
  /// Scales as geometric mean over the references, weighted by B_k N_k; brightness; least correlation.
  void report_scales(AlignmentResult& r) const {
    double weight = 0;
    double i = 0;
    double d = 0;
    r.correlation = 1;
    for (std::size_t k = 0; k < used_; ++k) {
      const Term& t = terms_[k];
      const double w = t.weight * t.counts[kAccepted].valid;
      weight += w;
      i += w * std::log(t.scales.scale_intensity);
      d += w * std::log(t.scales.scale_depth);
      r.correlation = std::min(r.correlation, t.correlation);
    }
    r.scale_intensity = weight > 0 ? std::exp(i / weight) : 0.0;
    r.scale_depth = weight > 0 ? std::exp(d / weight) : 0.0;
    r.illumination = terms_.front().light;
  }

  /// How well a pose explains the view, by a bounded cost at one scale for all poses.
  struct Evidence {
    double contradicted = 1;  ///< share of what both images show that does not agree, [0,1]
    double support = 0;       ///< what agrees minus twice what does not, as share of all pixels, [-2,1]
  };
  /// Tiles count by the surface that they show, depth^2, not by the image that they fill: what moves is mostly near, what
  /// does not is mostly large. What leaves the view counts neither way, and what contradicts counts twice: a wrong pose brings
  /// bare walls together, which agree with each other anywhere.
  template <class Executor>
  [[nodiscard]] Evidence evidence(int level, const Pose& T_camera_world, const Executor& executor) {
    enter(level);
    estimate_scales(T_camera_world, options_.scale_samples, 0, executor);  // for the brightness
    return weigh(T_camera_world, executor);
  }
  /// The same with the brightness as it was estimated last: faster.
  template <class Executor>
  [[nodiscard]] Evidence evidence_as_lit(int level, const Pose& T_camera_world, const Executor& executor) {
    enter(level);
    return weigh(T_camera_world, executor);
  }

 private:
  static constexpr int kParts = 16;      // most units of work that a reference gives at a level
  static constexpr int kShares = 4;      // units of work of a sample
  static constexpr int kLeastPart = 16;  // blocks of pixels of the smallest

  struct Term {
    const FramePyramid* pyramid = nullptr;
    Pose T_world_reference = Pose::Identity();
    double weight = 1;        // B_k
    double level_weight = 1;  // the same, divided by the pixels if asked for
    TermScales scales;
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
    PixelSums<double> sum;
  };

  [[nodiscard]] const PyramidLevel& level_of(const Term& t, int level) const { return t.pyramid->halved(halvings(level)); }
  [[nodiscard]] Warper warper(const Term& t, const Pose& T_camera_world) const {
    WarpOptions options = options_.warp;
    options.esm = options.esm && level_ > 0;
    return Warper(current(level_), compose(T_camera_world, t.T_world_reference), t.light, options, options_.noise, gate_factor_,
                  current_->background());
  }

  // Residuals of some pixels, in units of the noise. Those of the image are spread as the pixels are that are aligned, but what
  // moves sets their median as soon as it fills half of the image, and a scale that lets it pass brings the pose to it. The
  // surface that is seen is the measure of the labels too: what moves is mostly near. It is taken where its scale is so much
  // smaller that something near does not agree.
  struct Samples {
    std::vector<float> residuals;
    std::vector<float> surface;  // that each stands for, depth^2
    double scale = 0;            // of the residuals as they are
    double scale_over_surface = 0;
    std::vector<std::uint32_t> picked;  // as many, spread evenly over the surface
    std::vector<float> scratch, all;

    void resize(std::size_t n) {
      residuals.resize(n);
      surface.resize(n);
    }
    void estimate(ScaleKind kind) {
      scratch = residuals;
      scale = robust_scale_in_place(kind, scratch);
      double whole = 0;
      for (const float s : surface) whole += static_cast<double>(s);
      picked.clear();
      double until = 0;
      for (std::size_t i = 0; i < surface.size(); ++i) {
        until += static_cast<double>(surface[i]);
        while ((static_cast<double>(picked.size()) + 0.5) * whole < until * static_cast<double>(surface.size())) {
          picked.push_back(static_cast<std::uint32_t>(i));
        }
      }
      scratch = residuals;
      pick(scratch);
      scale_over_surface = robust_scale_in_place(kind, scratch);
    }
    [[nodiscard]] bool crowded() const { return scale_over_surface < 0.67 * scale; }
    void spread_over_surface() {
      pick(residuals);
      scale = scale_over_surface;
    }
    void pick(std::vector<float>& values) {
      all.swap(values);
      values.clear();
      for (const std::uint32_t i : picked) values.push_back(all[i]);
    }
  };

  // At the level that was entered, with the brightness as it is.
  template <class Executor>
  Evidence weigh(const Pose& T_camera_world, const Executor& executor) {
    set_scales(0.5);
    kernel_.kind = KernelKind::GemanMcClure;
    kernel_.k = 2.0;
    sum_cost(T_camera_world, kTrial, executor);
    const double outlier = 0.5 * kernel_.k * kernel_.k;
    double against = 0;
    double seen = 0;
    double all = 0;
    for (std::size_t k = 0; k < used_; ++k) {
      const Term& t = terms_[k];
      const double both = 1 + t.scales.alpha * t.scales.alpha;
      const double charge = both * kernel_.rho(3.0);
      for (std::size_t i = 0; i < t.sums[kTrial].size(); ++i) {
        const TileSums& s = t.sums[kTrial][i];
        const auto depth = static_cast<double>(level_of(t, level_).pixels.tiles[i].depth);
        const double w = t.level_weight * depth * depth;
        const double lost = static_cast<double>(s.lost);
        against += w * std::max(0.0, static_cast<double>(s.cost) - charge * lost) / outlier;
        seen += w * (static_cast<double>(s.weight) - both * lost);
        all += w * static_cast<double>(s.weight);
      }
    }
    Evidence e;
    if (seen > 0) e.contradicted = against / seen;
    if (all > 0) e.support = (seen - 3 * against) / all;
    return e;
  }

  // of_tile(summer, list, tile, out) for every `step`-th tile, and what became of the pixels.
  template <class Executor, class OfTile>
  void pass(const Pose& T_camera_world, Buffer buffer, const Executor& executor, int step, const OfTile& of_tile) {
    executor(static_cast<int>(parts_.size()), [&](int i) {
      Part& p = parts_[static_cast<std::size_t>(i)];
      Term& t = terms_[static_cast<std::size_t>(p.term)];
      const PixelList& list = level_of(t, level_).pixels;
      TileSummer summer(warper(t, T_camera_world), kernel_, t.scales);
      for (int k = (p.begin + step - 1) / step * step; k < p.end; k += step) {
        const auto n = static_cast<std::size_t>(k);
        of_tile(summer, list, list.tiles[n], t.sums[buffer][n]);
      }
      p.counts = summer.counts();
    });
    for (std::size_t k = 0; k < used_; ++k) terms_[k].counts[buffer] = WarpCounts{};
    for (const Part& p : parts_) terms_[static_cast<std::size_t>(p.term)].counts[buffer] += p.counts;
  }

  // Residuals and intensities of about `most` pixels.
  template <class Executor>
  void sample(const Term& t, const Pose& T_camera_world, int most, const Executor& executor) {
    const PixelList& list = level_of(t, level_).pixels;
    const Warper warp = warper(t, T_camera_world);
    const int blocks = list.blocks();
    const int n = std::min(blocks, std::max(1, most / PixelList::kBlock));
    // each share of the work has room for all its pixels and one more
    const auto room = [&](int share) { return static_cast<std::size_t>(n * share / kShares * PixelList::kBlock + share); };
    intensities_.resize(room(kShares));
    depths_.resize(room(kShares));
    pairs_.resize(room(kShares));
    std::size_t with_intensity[kShares];
    std::size_t with_depth[kShares];
    executor(kShares, [&](int share) {
      std::size_t a = room(share);
      std::size_t b = a;
      std::size_t k = 0;
      for (int i = n * share / kShares; i < n * (share + 1) / kShares; ++i) {
        const int at_block = static_cast<int>(static_cast<long long>(i) * blocks / n);
        while (list.tiles[k].end <= at_block) ++k;
        const float surface = list.tiles[k].depth * list.tiles[k].depth;
        const float* block = list.block(at_block);
        for (int at = 0; at < PixelList::kBlock; at += kLanes) {
          WarpedLanes o;
          warp.warp(block, at, o);
          const Lanes inverse_intensity = sqrt(o.inverse_intensity);
          const Lanes intensity = o.residual_intensity * inverse_intensity;
          const Lanes depth = o.residual_depth * sqrt(o.inverse_depth);
          for (int j = 0; j < kLanes; ++j) {  // each is written, and overwritten by the next unless it counts
            intensities_.residuals[a] = intensity[j];
            intensities_.surface[a] = surface;
            pairs_.reference[a] = block[PixelList::kIntensity * PixelList::kBlock + at + j];
            pairs_.current[a] = o.current[j];
            pairs_.inverse_sigma[a] = inverse_intensity[j];
            depths_.residuals[b] = depth[j];
            depths_.surface[b] = surface;
            a += o.weight_intensity[j] > 0 ? 1 : 0;
            b += o.weight_depth[j] > 0 ? 1 : 0;
          }
        }
      }
      with_intensity[share] = a - room(share);
      with_depth[share] = b - room(share);
    });
    const auto close_up = [&](std::vector<float>& v, const std::size_t* counts) {
      std::size_t end = 0;
      for (int share = 0; share < kShares; ++share) {
        const auto first = v.begin() + static_cast<std::ptrdiff_t>(room(share));
        std::copy(first, first + static_cast<std::ptrdiff_t>(counts[share]), v.begin() + static_cast<std::ptrdiff_t>(end));
        end += counts[share];
      }
      v.resize(end);
    };
    for (std::vector<float>* v : {&intensities_.residuals, &intensities_.surface, &pairs_.reference, &pairs_.current,
                                  &pairs_.inverse_sigma}) {
      close_up(*v, with_intensity);
    }
    close_up(depths_.residuals, with_depth);
    close_up(depths_.surface, with_depth);
  }

  AlignmentOptions options_;
  RobustKernel kernel_;
  const FramePyramid* current_ = nullptr;
  int level_ = 0;   // counted from finest_
  int finest_ = 0;  // halvings of the finest level that all frames have
  float gate_factor_ = 1;  // of the level
  std::size_t used_ = 0;  // terms of this call
  std::vector<Term> terms_;
  std::vector<Part> parts_;
  Samples intensities_, depths_;
  IntensityPairs pairs_;
};

APSO_NAMESPACE_END
