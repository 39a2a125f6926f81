/// \file
/// Finds the constants of the assessment on recordings: the scales of the change scores from calm ones, th_differ by a
/// rule, and, if wanted, the weights that tell hard frames from others best.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <apso/config.hpp>
#include <apso/quality/change_score.hpp>
#include <apso/quality/scores/depth_change.hpp>
#include <apso/quality/frame_score.hpp>
#include <apso/quality/scores/motion_change.hpp>
#include <apso/quality/decision.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// What calibration needs to know about one assessed frame.
struct CalibrationSample {
  MaybeQuality S_conf, S_spatial, S_feature, S_depth;
  MaybeDeviation S_mc, S_dc, S_dec;
  double dynamic_ratio = 0;                                        ///< [0,1]
  double flow = std::numeric_limits<double>::quiet_NaN();          ///< mean of m_point and m_grid [image diagonals]
  double track_overlap = 0;                                        ///< rho_t
  double step_flow = std::numeric_limits<double>::quiet_NaN();     ///< the same against the frame before
  double depth_mean = std::numeric_limits<double>::quiet_NaN();    ///< relative
  double depth_spread = std::numeric_limits<double>::quiet_NaN();  ///< relative
  double depth_overlap = 0;                                        ///< rho_v
  bool hard = false;  ///< the tracker failed, or the frame is known to be hard
};

/// The settings that calibration finds.
struct CalibratedScales {
  double motion = 0;           ///< s_m against the reference [image diagonals]
  double motion_previous = 0;  ///< s_m against the frame before [image diagonals]
  double depth_mean = 0;       ///< s_mu
  double depth_spread = 0;     ///< s_sigma
};

/// Scales at which 95 % of calm frames have a change score of at most 0.3. 0 where no frame had the value.
[[nodiscard]] inline CalibratedScales calibrate_scales(const std::vector<CalibrationSample>& calm) {
  std::vector<double> flow, step, mean, spread;
  for (const CalibrationSample& s : calm) {
    if (s.hard) continue;
    flow.push_back(s.flow);
    step.push_back(s.step_flow);
    mean.push_back(s.depth_mean);
    spread.push_back(s.depth_spread);
  }
  return {calibrate_change_scale(flow), calibrate_change_scale(step), calibrate_change_scale(mean),
          calibrate_change_scale(spread)};
}

/// th_differ = median - 4 sigma of the S_final of frames that are not hard, limited to [lowest, highest]; sigma is
/// 1.4826 times the median absolute deviation. `highest` when there is no frame.
[[nodiscard]] inline double calibrate_threshold(std::vector<double> S_final, double lowest = 0.45,
                                                double highest = 0.70) {
  expects(lowest <= highest, "calibrate_threshold: lowest must be <= highest");
  S_final.erase(std::remove_if(S_final.begin(), S_final.end(), [](double v) { return !std::isfinite(v); }),
                S_final.end());
  if (S_final.empty()) return highest;
  const double median = median_in_place(S_final);
  for (double& v : S_final) v = std::abs(v - median);
  return std::clamp(median - 4 * 1.4826 * median_in_place(S_final), lowest, highest);
}

/// S_final of a sample under other weights and settings. Components are taken as they were measured; which frame was
/// the reference does not change.
[[nodiscard]] inline Quality rescore(const CalibrationSample& s, const FrameWeights& frame, const ChangeWeights& change,
                                     SceneDecision& decision) {
  const MaybeQuality total = frame_score(s.S_conf, s.S_spatial, s.S_feature, s.S_depth, frame);
  return decision
      .decide(total.value_or(Quality(0.0)), s.S_feature, s.S_conf, change_score(s.S_mc, s.S_dc, s.S_dec, change),
              s.dynamic_ratio)
      .S_final;
}

/// Weights found by fit_weights, and how well they do.
struct FittedWeights {
  FrameWeights frame;
  ChangeWeights change;
  double loss_before = 0;
  double loss = 0;
  int steps = 0;
};

/// Fits the weights so that hard frames fall below th_differ and others stay above it: the mean logistic loss of
/// (S_final - th_differ) / softness is made small, hard and other frames counting the same in sum. Weight is moved from
/// one component to another in steps of 0.05 as long as that helps; no weight falls below `least`, so that no
/// component is switched off because the recordings at hand did not need it.
/// Without a hard or without another frame the weights stay as they are.
[[nodiscard]] inline FittedWeights fit_weights(const std::vector<CalibrationSample>& samples, const FrameWeights& frame,
                                               const ChangeWeights& change, const DecisionOptions& decision,
                                               double softness = 0.05, double least = 0.10) {
  expects(softness > 0, "fit_weights: softness must be > 0");
  const auto hard =
      static_cast<double>(std::count_if(samples.begin(), samples.end(), [](const auto& s) { return s.hard; }));
  const double other = static_cast<double>(samples.size()) - hard;
  FittedWeights best;
  best.frame = frame;
  best.change = change;
  if (!(hard > 0) || !(other > 0)) return best;
  using Vector = std::array<double, 7>;
  const auto loss_of = [&](const Vector& w) {
    const FrameWeights f{w[0], w[1], w[2], w[3]};
    const ChangeWeights c{w[4], w[5], w[6]};
    SceneDecision scene(decision);
    double loss = 0;
    for (const CalibrationSample& s : samples) {
      const double margin = (rescore(s, f, c, scene).value() - decision.th_differ) / softness;
      loss += s.hard ? std::log1p(std::exp(margin)) / hard : std::log1p(std::exp(-margin)) / other;
    }
    return loss;
  };
  Vector w{frame.conf, frame.spatial, frame.feature, frame.depth, change.motion, change.depth, change.detection};
  best.loss_before = best.loss = loss_of(w);
  constexpr double step = 0.05;
  for (bool better = true; better && best.steps < 200;) {
    better = false;
    Vector next = w;
    for (std::size_t from = 0; from < w.size(); ++from) {
      for (std::size_t to = 0; to < w.size(); ++to) {
        if (from == to || (from < 4) != (to < 4) || w[from] < least + step - 1e-9) continue;
        Vector v = w;
        v[from] -= step;
        v[to] += step;
        const double loss = loss_of(v);
        if (loss < best.loss - 1e-6) {
          best.loss = loss;
          next = v;
          better = true;
        }
      }
    }
    w = next;
    best.steps += better;
  }
  best.frame = {w[0], w[1], w[2], w[3]};
  best.change = {w[4], w[5], w[6]};
  return best;
}

APSO_NAMESPACE_END
