/// \file
/// S_final by equation (6) with the weights (8) and (9), the three scenarios, the innovation of the pose, and the decision GOOD or BAD
/// by equation (11).
#pragma once

#include <algorithm>
#include <array>
#include <limits>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/statistics.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// How S_change enters S_final.
enum class ChangePolarity {
  Complement,  ///< W_base S_total + W_change (1 - S_change): change lowers the score
  Literal      ///< W_base S_total + W_change S_change, as printed: rates fast rotation as better
};
constexpr std::array<const char*, 2> enum_names(ChangePolarity) { return {"complement", "literal"}; }

/// From which value W_base is lowered.
enum class BaseWeight {
  PerFrame,   ///< from its nominal value
  Cumulative  ///< from the value of the last frame, as printed: soon 0 for ever
};
constexpr std::array<const char*, 2> enum_names(BaseWeight) { return {"per_frame", "cumulative"}; }

struct DecisionOptions {
  double w_base = 0.7;          ///< nominal W_base, [0,1]
  double a = 1.0;               ///< how much the dynamic ratio lowers it, >= 0
  double th_static = 0.05;      ///< dynamic ratio up to which the scene is static, [0,1]
  double th_dynamic = 0.35;     ///< dynamic ratio from which it is dynamic, [0,1]
  double w_dyn = 0.2;           ///< W_base is at most this in a dynamic scene, [0,1]
  double boost_static = 0.15;   ///< of a static scene with good features, [0,1]
  double boost_object = 0.05;   ///< of a scene with confident detections, [0,1]
  double th_differ = 0.70;      ///< GOOD from here on, [0,1]; found by apso_calibrate (docs/quality.md)
  bool auto_calibrate = false;  ///< th_differ from the last GOOD frames, see calibrated_threshold()
  ChangePolarity polarity = ChangePolarity::Complement;
  BaseWeight base_weight = BaseWeight::PerFrame;
  bool innovation = true;  ///< S_final is multiplied by S_inn; false: from the images alone, as printed
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("w_base", s.w_base, 0.0, 1.0);
    v("a", s.a, 0.0, 1000.0);
    v("th_static", s.th_static, 0.0, 1.0);
    v("th_dynamic", s.th_dynamic, 0.0, 1.0);
    v("w_dyn", s.w_dyn, 0.0, 1.0);
    v("boost_static", s.boost_static, 0.0, 1.0);
    v("boost_object", s.boost_object, 0.0, 1.0);
    v("th_differ", s.th_differ, 0.0, 1.0);
    v("auto_calibrate", s.auto_calibrate);
    v("polarity", s.polarity);
    v("base_weight", s.base_weight);
    v("innovation", s.innovation);
  }
};

/// S_static: S_feature that a static scene needs for its boost.
inline constexpr double kFeatureQualityOfStatic = 0.7;
/// th_obj: S_conf from which the objects boost.
inline constexpr double kConfidenceOfObjects = 0.8;

/// Raises a score by the share b of what is missing to 1: S + b (1 - S).
[[nodiscard]] constexpr Quality boost(Quality s, double b) { return Quality(s.value() + clamp01(b) * (1.0 - s.value())); }

/// Equation (8): W_base = max(0, W - a Dynamic_ratio), before the scenarios.
[[nodiscard]] inline double base_weight(double from, double dynamic_ratio, double a) { return std::max(0.0, from - a * dynamic_ratio); }

/// Equation (6): S_final without the boosts; a missing change leaves S_total.
[[nodiscard]] inline Quality combine_final(Quality S_total, MaybeDeviation S_change, double W_base,
                                           ChangePolarity polarity = ChangePolarity::Complement) {
  if (!S_change) return S_total;
  const double part = polarity == ChangePolarity::Complement ? S_change->complement().value() : S_change->value();
  return Quality(W_base * S_total.value() + (1.0 - W_base) * part);
}

/// An innovation that is typical is never taken as less [m], so that a camera that stands still may start.
inline constexpr double kLeastTypicalInnovation = 0.002;
/// So many times more than what is typical halve S_inn (docs/quality.md).
inline constexpr double kInnovationOfHalf = 4;

/// Distance from the predicted pose to that of the feature tracker [m]; NaN where one is not known (null) or no rigid motion.
[[nodiscard]] inline double pose_innovation(const Pose* T_world_camera, const Pose* T_world_predicted) {
  const auto known = [](const Pose* T) { return T != nullptr && is_rigid(*T); };
  if (!known(T_world_camera) || !known(T_world_predicted)) return std::numeric_limits<double>::quiet_NaN();
  return norm(translation(compose(inverse(*T_world_predicted), *T_world_camera)));
}

/// S_inn: 1 for an innovation that is typical here, falling with a greater one.
/// \param innovation see pose_innovation() [m]; NaN counts as typical
/// \param typical    of the frames before [m]
[[nodiscard]] inline Quality innovation_score(double innovation, double typical) {
  const double more = (innovation / std::max(kLeastTypicalInnovation, typical) - 1) / kInnovationOfHalf;
  return Quality(more > 0 ? 1 / (1 + more * more) : 1.0);
}

/// S_inn from frame to frame. No image shows that a feature pose is off by a few centimetres; the prediction does, since it rests on other
/// measurements or on the camera having mass. What is typical is the running median of the frames before, BAD ones too, or a camera that
/// begins to move otherwise would stay BAD.
class InnovationMonitor {
 public:
  /// \param innovation see pose_innovation() [m]; NaN is not learned
  [[nodiscard]] Quality score(double innovation) {
    const Quality s = innovation_score(innovation, typical_.median());
    typical_.add(innovation);
    return s;
  }
  void reset() { typical_.clear(); }

 private:
  RunningMedian typical_{300};  // 10 s of a 30 Hz camera
};

/// The outcome for one frame.
struct Decision {
  double W_base = 0;
  double W_change = 0;
  Quality S_final;
  double th_differ = 0;           ///< threshold that was applied
  bool scenario_static = false;   ///< static and rich in features: boosted
  bool scenario_dynamic = false;  ///< dynamic: the change counts most
  bool scenario_objects = false;  ///< well detected objects: boosted
  bool good_scene = false;        ///< GOOD, or BAD for S_inn alone
  bool good = false;
};

/// Lowest and highest th_differ that a calibration gives: below, blank images are GOOD; above, ordinary ones BAD.
inline constexpr double kLowestThreshold = 0.45;
inline constexpr double kHighestThreshold = 0.70;

/// th_differ of frames whose S_final has this median and this median absolute deviation: median - 4 sigma with
/// sigma = 1.4826 mad, limited to [lowest, highest].
[[nodiscard]] inline double calibrated_threshold(double median, double mad, double lowest = kLowestThreshold,
                                                 double highest = kHighestThreshold) {
  return std::clamp(median - 4 * 1.4826 * mad, lowest, highest);
}

/// th_differ from frame to frame: fixed, or calibrated on the last GOOD frames, as the options choose. A
/// rule of your own has the same members.
class DecisionThreshold {
 public:
  explicit DecisionThreshold(const DecisionOptions& options = {}) : o_(options) {}
  void reset() { good_scores_.clear(); }
  /// For the next frame, [0,1].
  [[nodiscard]] double value() {
    // a short quiet start is not enough to calibrate on
    const bool calibrated = o_.auto_calibrate && good_scores_.full();
    return calibrated ? calibrated_threshold(good_scores_.median(), good_scores_.mad()) : o_.th_differ;
  }
  /// What became of the frame.
  void remember(Quality S_final, bool good) {
    if (good) good_scores_.add(S_final.value());
  }

 private:
  DecisionOptions o_;
  RunningMedian good_scores_{300};  // 10 s of a 30 Hz camera
};

/// Decides frame after frame. It has a memory only for the cumulative weight and the threshold.
/// \tparam Threshold the rule for th_differ; see DecisionThreshold
template <class Threshold = DecisionThreshold>
class BasicSceneDecision {
 public:
  explicit BasicSceneDecision(const DecisionOptions& options = {}) : o_(options), threshold_(options) {
    expects(o_.th_static < o_.th_dynamic, "decision: th_static must be < th_dynamic");
    reset();
  }
  void reset() {
    w_ = o_.w_base;
    threshold_.reset();
  }
  /// Weights, S_final and the verdict.
  /// \param feature_quality   S_feature, for the static scenario
  /// \param object_confidence S_conf, for the scenario of confident detections
  /// \param dynamic_ratio     [0,1]
  /// \param S_inn             see InnovationMonitor
  Decision decide(Quality S_total, MaybeQuality feature_quality, MaybeQuality object_confidence, MaybeDeviation S_change,
                  double dynamic_ratio, Quality S_inn = Quality(1.0)) {
    Decision d;
    const double ratio = Deviation(dynamic_ratio).value();  // NaN counts as all dynamic
    d.W_base = base_weight(o_.base_weight == BaseWeight::PerFrame ? o_.w_base : w_, ratio, o_.a);
    w_ = d.W_base;
    d.scenario_dynamic = ratio >= o_.th_dynamic;
    if (d.scenario_dynamic) d.W_base = std::min(d.W_base, o_.w_dyn);
    d.W_change = 1.0 - d.W_base;
    d.S_final = combine_final(S_total, S_change, d.W_base, o_.polarity);
    d.scenario_static = ratio <= o_.th_static && feature_quality && feature_quality->value() >= kFeatureQualityOfStatic;
    if (d.scenario_static) d.S_final = boost(d.S_final, o_.boost_static);
    d.scenario_objects = object_confidence && object_confidence->value() >= kConfidenceOfObjects;
    if (d.scenario_objects) d.S_final = boost(d.S_final, o_.boost_object);
    d.th_differ = threshold_.value();
    d.good_scene = d.S_final.value() >= d.th_differ;
    d.S_final = Quality(d.S_final.value() * S_inn.value());
    d.good = d.S_final.value() >= d.th_differ;
    return d;
  }
  /// Reports what became of the frame: its state may differ from decide() when tracking failed.
  void remember(const Decision& d, bool good) { threshold_.remember(d.S_final, good); }

 private:
  DecisionOptions o_;
  Threshold threshold_;
  double w_ = 0;
};
using SceneDecision = BasicSceneDecision<>;

APSO_NAMESPACE_END
