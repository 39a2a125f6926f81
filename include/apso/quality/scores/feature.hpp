/// \file
/// S_feature, response strength and uniformity of the keypoints: a score of equation (1). Only static keypoints count.
/// Measuring and scoring are two steps because the reference response s_ref is a running median of what is measured.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <apso/config.hpp>
#include <apso/math/statistics.hpp>
#include <apso/quality/score_list.hpp>
#include <apso/quality/scores/feature_measure.hpp>
#include <apso/quality/scores/sharpness.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// The parts of S_feature.
struct FeatureScore {
  double S_cnt = 0;   ///< count, [0,1]
  double S_resp = 0;  ///< response strength, [0,1]
  double S_unif = 0;  ///< uniformity, [0,1]
  Quality score;      ///< S_feature
};

/// S_feature of what was measured.
/// \param s_ref reference response (ResponseScale::Relative); the floor of the options is applied to it
[[nodiscard]] inline FeatureScore feature_score(const FeatureMeasure& m, double s_ref, const FeatureOptions& options = {}) {
  FeatureScore s;
  s.S_cnt = clamp01(static_cast<double>(m.static_keypoints) / options.n_ref);
  if (m.static_keypoints > 0) {
    s.S_resp = options.response == ResponseScale::Relative
                   ? clamp01(m.median_response / (s_ref > options.response_floor ? s_ref : options.response_floor))
                   : clamp01(m.median_response / (m.median_response + kHalfSaturation));
  }
  switch (options.uniformity) {
    case Uniformity::EntropyOccupancy:
      s.S_unif = 0.5 * (m.entropy + m.occupancy);
      break;
    case Uniformity::Participation:
      s.S_unif = m.participation;
      break;
    case Uniformity::Coverage:
    case Uniformity::Covering:
      s.S_unif = m.spread;
      break;
  }
  switch (options.form) {
    case FeatureForm::Geometric:
      s.score = Quality(std::sqrt(s.S_cnt * s.S_resp * s.S_unif));
      break;
    case FeatureForm::Gated:
      s.score = Quality(std::sqrt(s.S_cnt) * (0.4 * s.S_resp + 0.6 * s.S_unif));
      break;
    case FeatureForm::Linear:
      s.score = Quality(0.3 * s.S_cnt + 0.3 * s.S_resp + 0.4 * s.S_unif);
      break;
  }
  return s;
}

/// GOOD frames that the typical response and the typical sharpness are the medians of: 10 s of a 30 Hz camera.
inline constexpr int kTypicalWindow = 300;

/// Matches that a pose needs to be no worse for their number (ORB-SLAM2): keypoints that match nothing say nothing about the pose.
inline constexpr int kEnoughMatches = 30;

/// S_feature as a score of a list: what is typical here is learned from the frames that were GOOD.
struct Feature {
  static constexpr const char* name = "S_feature";
  static constexpr ScoreRole role = ScoreRole::FeatureQuality;
  static constexpr double default_weight = 0.50;
  using Value = Quality;
  using Options = FeatureOptions;
  struct Measured {
    FeatureMeasure features;
    SharpnessMeasure sharpness;
    double static_keypoints = 0;                                ///< N
    double S_cnt = 0;                                           ///< count, [0,1]
    double S_resp = 0;                                          ///< response strength, [0,1]
    double S_unif = 0;                                          ///< uniformity, [0,1]
    double S_sharp = std::numeric_limits<double>::quiet_NaN();  ///< sharpness, [0,1]; NaN without an intensity image
    double S_match = 1;                                         ///< share of the matches that a pose needs, [0,1]
    double response_reference = 0;                              ///< s_ref, with its floor
    template <class Self, class V>
    static void columns(Self& m, V&& column) {
      column("keypoints_static", m.static_keypoints);
      column("S_cnt", m.S_cnt);
      column("S_resp", m.S_resp);
      column("S_unif", m.S_unif);
      column("S_sharp", m.S_sharp);
      column("S_match", m.S_match);
      column("sharp_x", m.sharpness.ratio_x);
      column("sharp_y", m.sharpness.ratio_y);
    }
  };
  Options options;
  Measured measured;

  MaybeQuality operator()(const FrameContext& frame) {
    measured = {};
    if (frame.keypoints == nullptr) return std::nullopt;
    measured.features = measure_features(*frame.keypoints, frame.dynamic_probability, frame.width(), frame.height(), options, scratch_);
    measured.static_keypoints = measured.features.static_keypoints;
    if (options.sharpness) measured.sharpness = measure_sharpness(frame.intensity, scratch_.row);
    if (frame.initialising) learn();
    measured.response_reference = std::max(options.response_floor, responses_.median());
    FeatureScore s = feature_score(measured.features, measured.response_reference, options);
    if (frame.matches >= 0) measured.S_match = clamp01(static_cast<double>(frame.matches) / kEnoughMatches);
    s.score = Quality(s.score.value() * measured.S_match);
    measured.S_cnt = s.S_cnt;
    measured.S_resp = s.S_resp;
    measured.S_unif = s.S_unif;
    if (!measured.sharpness.valid) return s.score;
    const Quality sharp = sharpness_score(measured.sharpness, sharpness_x_.median(), sharpness_y_.median());
    measured.S_sharp = sharp.value();
    return Quality(s.score.value() * sharp.value());
  }
  /// The response and the sharpness that are typical here.
  void learn() {
    if (measured.features.static_keypoints > 0) responses_.add(measured.features.median_response);
    if (measured.sharpness.valid) {
      sharpness_x_.add(measured.sharpness.ratio_x);
      sharpness_y_.add(measured.sharpness.ratio_y);
    }
  }
  void reset() {
    responses_.clear();
    sharpness_x_.clear();
    sharpness_y_.clear();
  }
  static std::string reason(Quality, const Measured& m) {
    std::string s = std::to_string(m.features.static_keypoints) + " static keypoints in " + std::to_string(m.features.occupied_cells) +
                    " of " + std::to_string(m.features.valid_cells) + " cells";
    if (m.S_sharp < 0.7) s += ", blurred (S_sharp " + two_digits(m.S_sharp) + ')';
    if (m.S_match < 1) s += ", too few match the map (S_match " + two_digits(m.S_match) + ')';
    if (m.S_resp < 0.7) s += ", weak response " + two_digits(m.features.median_response);
    return s;
  }

 private:
  FeatureScratch scratch_;
  RunningMedian responses_{kTypicalWindow};
  RunningMedian sharpness_x_{kTypicalWindow};
  RunningMedian sharpness_y_{kTypicalWindow};
};

APSO_NAMESPACE_END
