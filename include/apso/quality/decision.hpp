/// \file
/// S_final and the decision GOOD or BAD (eq. Final Score, eq. W_base, eq. W_change, the three scenarios,
/// eq. Final Decision).
#pragma once

#include <algorithm>
#include <array>

#include <apso/config.hpp>
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
  double w_base = 0.7;         ///< nominal W_base, [0,1]
  double a = 1.0;              ///< how much the dynamic ratio lowers it, >= 0
  double th_static = 0.05;     ///< dynamic ratio up to which the scene is static
  double th_dynamic = 0.35;    ///< dynamic ratio from which it is dynamic
  double w_dyn = 0.2;          ///< W_base is at most this in a dynamic scene
  double s_static = 0.7;       ///< S_feature a static scene needs for its boost
  double th_obj = 0.8;         ///< S_conf from which the objects boost
  double boost_static = 0.15;  ///< [0,1]
  double boost_object = 0.05;  ///< [0,1]
  double th_differ = 0.70;     ///< GOOD from here on
  double hysteresis = 0;       ///< once BAD, th_differ is this much higher
  bool auto_calibrate = false; ///< th_differ from the last GOOD frames: median - 4 sigma, limited to [0.45, 0.70]
  ChangePolarity polarity = ChangePolarity::Complement;
  BaseWeight base_weight = BaseWeight::PerFrame;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("w_base", s.w_base, 0.0, 1.0);
    v("a", s.a, 0.0, 1000.0);
    v("th_static", s.th_static, 0.0, 1.0);
    v("th_dynamic", s.th_dynamic, 0.0, 1.0);
    v("w_dyn", s.w_dyn, 0.0, 1.0);
    v("s_static", s.s_static, 0.0, 1.0);
    v("th_obj", s.th_obj, 0.0, 1.0);
    v("boost_static", s.boost_static, 0.0, 1.0);
    v("boost_object", s.boost_object, 0.0, 1.0);
    v("th_differ", s.th_differ, 0.0, 1.0);
    v("hysteresis", s.hysteresis, 0.0, 1.0);
    v("auto_calibrate", s.auto_calibrate);
    v("polarity", s.polarity);
    v("base_weight", s.base_weight);
  }
};

/// Raises a score by the share b of what is missing to 1: S + b (1 - S).
[[nodiscard]] constexpr Quality boost(Quality s, double b) { return Quality(s.value() + clamp01(b) * (1.0 - s.value())); }

/// W_base = max(0, W - a DR), before the scenarios.
[[nodiscard]] inline double base_weight(double from, double dynamic_ratio, double a) {
  return std::max(0.0, from - a * dynamic_ratio);
}

/// S_final without the boosts; a missing change leaves S_total.
[[nodiscard]] inline Quality combine_final(Quality S_total, MaybeDeviation S_change, double W_base,
                                           ChangePolarity polarity = ChangePolarity::Complement) {
  if (!S_change) return S_total;
  const double part = polarity == ChangePolarity::Complement ? S_change->complement().value() : S_change->value();
  return Quality(W_base * S_total.value() + (1.0 - W_base) * part);
}

/// The outcome for one frame.
struct Decision {
  double W_base = 0;
  double W_change = 0;
  Quality S_final;
  double th_differ = 0;           ///< threshold that was applied
  bool scenario_static = false;   ///< static and rich in features: boosted
  bool scenario_dynamic = false;  ///< dynamic: the change counts most
  bool scenario_objects = false;  ///< well detected objects: boosted
  bool good = false;
};

/// Decides frame after frame. It has a memory only for hysteresis, the cumulative weight and the calibration.
class SceneDecision {
 public:
  explicit SceneDecision(const DecisionOptions& options = {}) : o_(options), good_scores_(300) {
    expects(o_.th_static < o_.th_dynamic, "decision: th_static must be < th_dynamic");
    reset();
  }
  void reset() {
    w_ = o_.w_base;
    was_bad_ = false;
    good_scores_.clear();
  }
  /// Weights, S_final and the verdict.
  /// \param dynamic_ratio [0,1]
  Decision decide(Quality S_total, MaybeQuality S_feature, MaybeQuality S_conf, MaybeDeviation S_change,
                  double dynamic_ratio) {
    Decision d;
    const double ratio = Deviation(dynamic_ratio).value();  // NaN counts as all dynamic
    d.W_base = base_weight(o_.base_weight == BaseWeight::PerFrame ? o_.w_base : w_, ratio, o_.a);
    w_ = d.W_base;
    d.scenario_dynamic = ratio >= o_.th_dynamic;
    if (d.scenario_dynamic) d.W_base = std::min(d.W_base, o_.w_dyn);
    d.W_change = 1.0 - d.W_base;
    d.S_final = combine_final(S_total, S_change, d.W_base, o_.polarity);
    d.scenario_static = ratio <= o_.th_static && S_feature && S_feature->value() >= o_.s_static;
    if (d.scenario_static) d.S_final = boost(d.S_final, o_.boost_static);
    d.scenario_objects = S_conf && S_conf->value() >= o_.th_obj;
    if (d.scenario_objects) d.S_final = boost(d.S_final, o_.boost_object);
    d.th_differ = threshold();
    d.good = d.S_final.value() >= d.th_differ;
    return d;
  }
  /// Reports what became of the frame: its state may differ from decide() when tracking failed.
  void remember(const Decision& d, bool good) {
    was_bad_ = !good;
    if (good) good_scores_.add(d.S_final.value());
  }

 private:
  [[nodiscard]] double threshold() {
    double th = o_.th_differ;
    if (o_.auto_calibrate && good_scores_.full()) {  // a short quiet start is not enough to calibrate on
      th = std::clamp(good_scores_.median() - 4 * 1.4826 * good_scores_.mad(), 0.45, 0.70);
    }
    return was_bad_ ? std::min(1.0, th + o_.hysteresis) : th;
  }
  DecisionOptions o_;
  double w_ = 0;
  bool was_bad_ = false;
  RunningMedian good_scores_;
};

APSO_NAMESPACE_END
