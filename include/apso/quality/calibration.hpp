/// \file
/// Finds the constants of the assessment on recordings: the scales of the change scores from calm ones, th_differ by a
/// rule, and, if wanted, the weights that tell hard frames from others best.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/statistics.hpp>
#include <apso/quality/assessor.hpp>
#include <apso/quality/decision.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// One assessed frame, from an assessor or from a table (read_scores()). Scores, measurements and the dynamic ratio count.
template <class FrameScores = PaperFrameScores, class ChangeScores = PaperChangeScores>
struct BasicCalibrationSample {
  BasicAssessment<FrameScores, ChangeScores> assessment;
  bool hard = false;  ///< the tracker failed, or the frame is known to be hard
};
using CalibrationSample = BasicCalibrationSample<>;

/// Sets the scales of the change scores to those at which 95 % of the calm frames have a score of at most 0.3. A scale
/// stays where no frame had the value.
template <class F, class C>
void calibrate_scales(const std::vector<BasicCalibrationSample<F, C>>& calm, BasicAssessorOptions<F, C>& options) {
  const auto of_score = [&](const auto& prototype) {
    using S = typename std::decay_t<decltype(prototype)>::Score;
    if constexpr (detail::detected_v<detail::score_calibrate_t, S>) {
      std::vector<typename S::Measured> reference, previous;
      for (const auto& sample : calm) {
        if (sample.hard) continue;
        const auto& r = sample.assessment.change_scores.template get<S>();
        const auto& p = sample.assessment.step_scores.template get<S>();
        if (r.value) reference.push_back(r.measured);
        if (p.value) previous.push_back(p.measured);
      }
      S::calibrate(reference, previous, options.template get<S>());
    }
  };
  const ScoreResults<C> prototypes;
  detail::for_each_result(prototypes, of_score);
}

/// Gives the scores of change the values that other options would have given, from what was measured.
template <class F, class C>
void revalue(BasicCalibrationSample<F, C>& sample, const BasicAssessorOptions<F, C>& options) {
  detail::for_each_result(sample.assessment.change_scores, [&](auto& r) {
    using S = typename std::decay_t<decltype(r)>::Score;
    if constexpr (detail::detected_v<detail::score_revalue_t, S>) {
      if (r.value) r.value = S::revalue(r.measured, options.template get<S>());
    }
  });
}

/// th_differ by calibrated_threshold() of the S_final of frames that are not hard. `highest` when there is no frame.
[[nodiscard]] inline double calibrate_threshold(std::vector<double> S_final, double lowest = kLowestThreshold,
                                                double highest = kHighestThreshold) {
  expects(lowest <= highest, "calibrate_threshold: lowest must be <= highest");
  S_final.erase(std::remove_if(S_final.begin(), S_final.end(), [](double v) { return !std::isfinite(v); }), S_final.end());
  if (S_final.empty()) return highest;
  const double median = median_in_place(S_final);
  for (double& v : S_final) v = std::abs(v - median);
  return calibrated_threshold(median, median_in_place(S_final), lowest, highest);
}

/// S_final of a sample under other weights and settings. Scores are taken as they are; which frame was the reference does
/// not change.
template <class F, class C>
[[nodiscard]] Quality rescore(const BasicCalibrationSample<F, C>& s, const ScoreWeights<F>& frame, const ScoreWeights<C>& change,
                              SceneDecision& decision) {
  const BasicAssessment<F, C>& a = s.assessment;
  const MaybeQuality total = mean_of_scores<Quality>(a.frame_scores, frame);
  return decision
      .decide(total.value_or(Quality(0.0)), a.of(ScoreRole::FeatureQuality), a.of(ScoreRole::ObjectConfidence),
              mean_of_scores<Deviation>(a.change_scores, change), a.dynamic_ratio, a.S_inn)
      .S_final;
}

/// Weights found by fit_weights, and how well they do.
template <class FrameScores = PaperFrameScores, class ChangeScores = PaperChangeScores>
struct FittedWeights {
  ScoreWeights<FrameScores> frame;
  ScoreWeights<ChangeScores> change;
  double loss_before = 0;
  double loss = 0;
  int steps = 0;
};

/// Fits the weights so that hard frames fall below th_differ and others stay above it: the mean logistic loss of
/// (S_final - th_differ) / softness is made small, hard and other frames counting the same in sum. Weight is moved from
/// one score to another of its list in steps of 0.05 as long as that helps; no weight falls below `minimum`, so that no
/// score is switched off because the recordings at hand did not need it.
/// Without a hard or without another frame the weights stay as they are.
template <class F, class C>
[[nodiscard]] FittedWeights<F, C> fit_weights(const std::vector<BasicCalibrationSample<F, C>>& samples, const ScoreWeights<F>& frame,
                                              const ScoreWeights<C>& change, const DecisionOptions& decision, double softness = 0.05,
                                              double minimum = 0.10) {
  expects(softness > 0, "fit_weights: softness must be > 0");
  const auto hard = static_cast<double>(std::count_if(samples.begin(), samples.end(), [](const auto& s) { return s.hard; }));
  const double other = static_cast<double>(samples.size()) - hard;
  FittedWeights<F, C> best;
  best.frame = frame;
  best.change = change;
  if (!(hard > 0) || !(other > 0)) return best;
  const auto loss_of = [&](const ScoreWeights<F>& f, const ScoreWeights<C>& c) {
    SceneDecision scene(decision);
    double loss = 0;
    for (const auto& s : samples) {
      const double margin = (rescore(s, f, c, scene).value() - decision.th_differ) / softness;
      loss += s.hard ? std::log1p(std::exp(margin)) / hard : std::log1p(std::exp(-margin)) / other;
    }
    return loss;
  };
  best.loss_before = best.loss = loss_of(best.frame, best.change);
  constexpr double step = 0.05;
  for (bool better = true; better && best.steps < 200;) {
    better = false;
    FittedWeights<F, C> next = best;
    const auto try_moves = [&](auto weights_of) {
      const std::size_t n = (best.*weights_of).size();
      for (std::size_t from = 0; from < n; ++from) {
        for (std::size_t to = 0; to < n; ++to) {
          if (from == to || (best.*weights_of)[from] < minimum + step - 1e-9) continue;
          FittedWeights<F, C> moved = best;
          (moved.*weights_of)[from] -= step;
          (moved.*weights_of)[to] += step;
          moved.loss = loss_of(moved.frame, moved.change);
          if (moved.loss >= next.loss - 1e-6) continue;
          next = moved;
          better = true;
        }
      }
    };
    try_moves(&FittedWeights<F, C>::frame);
    try_moves(&FittedWeights<F, C>::change);
    best = next;
    best.steps += better;
  }
  return best;
}

APSO_NAMESPACE_END
