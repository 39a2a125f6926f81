/// \file
/// The settings of the scene assessment: those of each score and its weight, then those of the decision.
#pragma once

#include <array>
#include <limits>

#include <apso/config.hpp>
#include <apso/options.hpp>
#include <apso/quality/assessment.hpp>
#include <apso/quality/benchmark.hpp>
#include <apso/quality/decision.hpp>
#include <apso/quality/score_list.hpp>
#include <apso/quality/threshold.hpp>
#include <apso/quality/weighted_mean.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

/// Which dynamic ratio enters the weights.
enum class DynamicRatio {
  MaskArea,  ///< the ratio given with the frame, or the mean dynamic probability of the pixels
  Count,     ///< moving objects / objects; 0 without objects
  Features,  ///< dynamic keypoints / keypoints; 0 without keypoints
  Max        ///< the larger of MaskArea and Features
};
constexpr std::array<const char*, 4> enum_names(DynamicRatio) { return {"mask_area", "count", "features", "max"}; }

template <class FrameScores = PaperFrameScores, class ChangeScores = PaperChangeScores>
struct BasicAssessorOptions {
  ScoreOptions<FrameScores> frame_scores;
  ScoreOptions<ChangeScores> change_scores;
  ScoreWeights<FrameScores> frame_weights;
  ScoreWeights<ChangeScores> change_weights;
  DepthRange depth_range;  ///< depths that the scores use [m]
  ChangeBaseline change_baseline = ChangeBaseline::Reference;
  DynamicRatio dynamic_ratio = DynamicRatio::MaskArea;
  InitialisationOptions initialisation;
  DecisionOptions decision;
  BenchmarkOptions benchmark;

  /// Options of a score, e.g. `options.get<Feature>().n_ref`.
  template <class S>
  [[nodiscard]] auto& get() {
    if constexpr (contains_score_v<S, FrameScores>) return frame_scores.template get<S>();
    else return change_scores.template get<S>();
  }
  template <class S>
  [[nodiscard]] const auto& get() const {
    if constexpr (contains_score_v<S, FrameScores>) return frame_scores.template get<S>();
    else return change_scores.template get<S>();
  }
  /// Weight of a score, [0,1]; the weights of a list sum to 1.
  template <class S>
  [[nodiscard]] double& weight() {
    if constexpr (contains_score_v<S, FrameScores>) return frame_weights.template get<S>();
    else return change_weights.template get<S>();
  }

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    ScoreOptions<FrameScores>::fields(s.frame_scores, v);
    v("frame_weights", s.frame_weights);
    ScoreOptions<ChangeScores>::fields(s.change_scores, v);
    v("change_weights", s.change_weights);
    v("depth_range", s.depth_range);
    v("change_baseline", s.change_baseline);
    v("dynamic_ratio", s.dynamic_ratio);
    v("initialisation", s.initialisation);
    v("decision", s.decision);
    v("benchmark", s.benchmark);
  }
};
using AssessorOptions = BasicAssessorOptions<>;

/// Throws contract_error naming the option that is out of its range, or the weights that do not sum to 1.
template <class F, class C>
void validate_assessor(const BasicAssessorOptions<F, C>& o) {
  apso::validate(o, "assessor");
  validate_weights(o.frame_weights.values(), "assessor.frame_weights");
  validate_weights(o.change_weights.values(), "assessor.change_weights");
}

/// For each score that has a weight: `f(std::string name, options)`, the options with this score taken out and its weight
/// given to the others of its list. What an ablation compares; "S_feature" is called "no_feature".
template <class F, class C, class Function>
void for_each_without_score(const BasicAssessorOptions<F, C>& o, Function&& f) {
  const auto each = [&](auto weights_of) {
    auto weights = o.*weights_of;
    using Weights = decltype(weights);
    std::size_t i = 0;
    const auto one = [&](const char* key) {
      BasicAssessorOptions<F, C> without = o;
      (without.*weights_of).switch_off(i++);
      f("no_" + std::string(key), without);
    };
    detail::for_each_key(typename Weights::List{}, one);
  };
  each(&BasicAssessorOptions<F, C>::frame_weights);
  each(&BasicAssessorOptions<F, C>::change_weights);
}

/// Equations (1) to (11) as printed, as far as they can be computed:
/// - (2) has no missing scores: S_conf is 0 without objects; S_feature is from keypoints alone
/// - (5) th_s by its recursion
/// - (6) S_change raises S_final, which is from the images alone
/// - (8) W_base falls from frame to frame; Dynamic_ratio is the proportion of dynamic objects
/// - (10) only the number of the benchmark is updated, it is never lowered, and no reference is handed on
template <class F = PaperFrameScores, class C = PaperChangeScores>
[[nodiscard]] BasicAssessorOptions<F, C> paper_assessor_options(BasicAssessorOptions<F, C> o = {}) {
  if constexpr (contains_score_v<Confidence, F>) o.template get<Confidence>().without_objects = WithoutObjects::Zero;
  if constexpr (contains_score_v<Feature, F>) o.template get<Feature>().sharpness = false;
  o.initialisation.quality_threshold = QualityThreshold::Literal;
  o.decision.polarity = ChangePolarity::Literal;
  o.decision.base_weight = BaseWeight::Cumulative;
  o.decision.innovation = false;
  o.dynamic_ratio = DynamicRatio::Count;
  o.benchmark.update = BenchmarkUpdate::NumberOnly;
  o.benchmark.half_life = o.benchmark.max_age = std::numeric_limits<double>::infinity();
  o.benchmark.hand_over = false;
  return o;
}

APSO_NAMESPACE_END
