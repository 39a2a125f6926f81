/// \file
/// All references of one alignment: what the cost keeps of them, at the level that was entered last.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/refinement/alignment_result.hpp>
#include <apso/refinement/cost/cost_term.hpp>
#include <apso/refinement/cost/residuals.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>

APSO_NAMESPACE_BEGIN

/// The terms of the sum over k in eq. (16), and what can be read off their sums. Sums are kept twice, at the pose that was accepted and
/// at one on trial. Keeps its buffers.
class CostTerms {
 public:
  enum Buffer { kAccepted = 0, kTrial = 1 };

  /// Levels that all frames have; 0 is the finest of them.
  [[nodiscard]] int levels() const { return current_->finest() + current_->size() - finest_; }
  /// Counted from the usual finest level, as options are: -1 for the one more of frames that are mostly masked.
  [[nodiscard]] int schedule(int level) const { return std::min(level, halvings(level) - current_->nominal_finest()); }
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
      const PyramidLevel& l = *terms_[k].level;
      sum += static_cast<double>(l.median_depth) * l.pixels.count;
      weight += l.pixels.count;
    }
    return weight > 0 && sum > 0 ? sum / weight : 1.0;
  }

  /// Leaves out what is nearer, at all levels until the frames are others.
  /// \param nearest [m]; 0: nothing is
  void look_beyond(float nearest) {
    for (std::size_t k = 0; k < used_; ++k) terms_[k].look_beyond(nearest);
  }

  /// What was on trial is accepted.
  void accept_trial() {
    for (std::size_t k = 0; k < used_; ++k) {
      CostTerm& t = terms_[k];
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
    for (std::size_t k = 0; k < used_; ++k) terms_[k].add_cost(buffer, step, cost, weight);
    return weight > 0 ? cost / weight : std::numeric_limits<double>::infinity();
  }
  /// Calls f(term, T_current_reference) for each reference.
  template <class F>
  void for_each_term(const Pose& T_camera_world, const F& f) const {
    for (std::size_t k = 0; k < used_; ++k) f(terms_[k], compose(T_camera_world, terms_[k].T_world_reference));
  }

  /// Share of the area whose label says that it moves.
  [[nodiscard]] double moving_share() const {
    double moving = 0;
    double all = 0;
    for (std::size_t k = 0; k < used_; ++k) terms_[k].add_moving(kAccepted, moving, all);
    return all > 0 ? moving / all : 0.0;
  }
  /// Scales as geometric mean over the references, weighted by B_k N_k; brightness; smallest correlation.
  void report_scales(AlignmentResult& r) const {
    double weight = 0;
    double i = 0;
    double d = 0;
    r.correlation = 1;
    for (std::size_t k = 0; k < used_; ++k) {
      const CostTerm& t = terms_[k];
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

 protected:
  /// \return false if no reference remains
  bool take_up(const std::vector<AlignmentReference>& references, const FramePyramid& current) {
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
      terms_[used_++].begin(r);
      // where depth has many holes, a level may have less to compare than the next: it is left out
      finest_ = std::max(finest_, p.finest());
      const int last = p.finest() + p.size() - 1;
      while (finest_ < last && p.halved(finest_).pixels.compared < p.halved(finest_ + 1).pixels.compared) ++finest_;
    }
    return used_ > 0;
  }

  void enter_terms(int level) {
    level_ = level;
    parts_.clear();
    for (std::size_t k = 0; k < used_; ++k) terms_[k].enter(halvings(level), static_cast<int>(k), parts_);
  }

  const FramePyramid* current_ = nullptr;
  int level_ = 0;         // counted from finest_
  int finest_ = 0;        // halvings of the finest level that all frames have
  std::size_t used_ = 0;  // terms of this call
  std::vector<CostTerm> terms_;
  std::vector<CostPart> parts_;
};

APSO_NAMESPACE_END
