/// \file
/// Everything that was found out about one frame: scores, weights, thresholds, state.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>

#include <apso/config.hpp>
#include <apso/quality/benchmark.hpp>
#include <apso/quality/score_list.hpp>
#include <apso/quality/scores/confidence.hpp>
#include <apso/quality/scores/depth.hpp>
#include <apso/quality/scores/depth_change.hpp>
#include <apso/quality/scores/detection_change.hpp>
#include <apso/quality/scores/feature.hpp>
#include <apso/quality/scores/motion_change.hpp>
#include <apso/quality/scores/spatial.hpp>
#include <apso/quality/weighted_mean.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// The scores of the paper. This is the one place that names them.
using PaperFrameScores = ScoreList<Confidence, Spatial, Feature, Depth>;          // equation (1)
using PaperChangeScores = ScoreList<MotionChange, DepthChange, DetectionChange>;  // equation (7)

enum class SceneState { Initialising, Good, Bad, Lost };
constexpr std::array<const char*, 4> enum_names(SceneState) { return {"INITIALISING", "GOOD", "BAD", "LOST"}; }
/// Name of a state, for reports.
[[nodiscard]] constexpr const char* to_string(SceneState s) { return enum_names(SceneState{})[static_cast<std::size_t>(s)]; }

/// What does not depend on the lists of scores.
struct AssessmentSummary {
  double timestamp = 0;  ///< [s]
  int frame = 0;         ///< frames assessed since the start or reset(), 1 for the first

  Quality S_total;               ///< equation (2); 0 when every component is missing
  bool S_total_missing = false;  ///< every component is missing
  MaybeDeviation S_change;       ///< equation (7); missing as long as there is nothing to compare with
  MaybeDeviation S_step;         ///< the same score against the frame before; decides about hand-over only
  int steady_frames = 0;         ///< consecutive frames that are good by themselves and continue the one before

  double dynamic_ratio = 0;  ///< [0,1], the one that entered the weights
  double W_base = 0;         ///< equation (8)
  double W_change = 0;       ///< equation (9)
  MaybeQuality S_final;      ///< equation (6); missing while initialising
  double innovation =
      std::numeric_limits<double>::quiet_NaN();  ///< distance of the feature pose from the predicted one [m]; NaN = not known
  Quality S_inn = Quality(1.0);                  ///< the factor of S_final that follows from it; see innovation_score()
  bool good_scene = false;                       ///< GOOD, or BAD for S_inn alone: its images are fit to build upon
  double th_f = 0;                               ///< equation (4) [frames]
  double th_s = 0;                               ///< equation (5), [0,1]
  double th_differ = 0;                          ///< equation (11), [0,1]; 0 while initialising
  bool scenario_static = false;                  ///< static, rich in features: S_final boosted
  bool scenario_dynamic = false;                 ///< dynamic: the change counts most
  bool scenario_objects = false;                 ///< confident detections: S_final boosted

  SceneState state = SceneState::Initialising;  ///< never Lost: that is for whoever owns the pose to say
  bool feature_tracking_ok = true;              ///< false also for a feature pose that was refused
  bool feature_pose_refused = false;            ///< the feature tracker's pose is no rigid motion (is_rigid()), e.g. NaN: it counts as none
  bool degraded = false;                        ///< the reference was committed by timeout with too low a score
  bool initialisation_failed = false;           ///< the search for a reference began anew with this frame
  bool benchmark_updated = false;               ///< the reference was set or replaced after this frame, equation (10)
  double benchmark_age = 0;                     ///< age of the frame compared with [s]; 0 without one
  double S_reference = 0;                       ///< S_total of the frame compared with
};

/// Everything that was computed about a frame.
/// \tparam FrameScores  ScoreList of scores of a frame by itself
/// \tparam ChangeScores ScoreList of scores of change
template <class FrameScores = PaperFrameScores, class ChangeScores = PaperChangeScores>
struct BasicAssessment : AssessmentSummary {
  ScoreResults<FrameScores> frame_scores;
  ScoreResults<ChangeScores> change_scores;  ///< against the reference
  ScoreResults<ChangeScores> step_scores;    ///< against the frame before

  /// A score with its weight and what it measured, e.g. `assessment.result<Feature>().measured`.
  template <class S>
  [[nodiscard]] const ScoreResult<S>& result() const {
    if constexpr (contains_score_v<S, FrameScores>) return frame_scores.template get<S>();
    else return change_scores.template get<S>();
  }
  template <class S>
  [[nodiscard]] ScoreResult<S>& result() {
    if constexpr (contains_score_v<S, FrameScores>) return frame_scores.template get<S>();
    else return change_scores.template get<S>();
  }
  /// The value of a score, e.g. `assessment.get<Feature>()`.
  template <class S>
  [[nodiscard]] const std::optional<typename S::Value>& get() const {
    return result<S>().value;
  }
  /// The value of a score by its name, e.g. "S_feature"; nothing when it is missing or there is no such score.
  [[nodiscard]] std::optional<double> get(std::string_view name) const;
  /// The score of a role; missing when no score of the lists has it.
  [[nodiscard]] MaybeQuality of(ScoreRole role) const {
    MaybeQuality found;
    std::apply(
        [&](const auto&... r) {
          const auto look = [&](const auto& one) {
            using S = typename std::decay_t<decltype(one)>::Score;
            if constexpr (std::is_same_v<typename S::Value, Quality>) {
              if (score_traits<S>::role() == role) found = one.value;
            }
          };
          (look(r), ...);
        },
        frame_scores.each);
    return found;
  }
};
using Assessment = BasicAssessment<>;

namespace detail {
/// f(ScoreResult) for each score of a list.
template <class Results, class F>
void for_each_result(Results& results, F&& f) {
  std::apply([&](auto&... r) { (f(r), ...); }, results.each);
}
template <class R, class F>
void score_value(const R& r, F& f) {
  using S = typename R::Score;
  f(S::name, r.value ? std::optional<double>(r.value->value()) : std::nullopt, r.weight, score_traits<S>::better);
}
/// Columns of one score, NaN when it is missing.
template <class R, class F>
void score_columns(const std::string& prefix, const R& r, F& f) {
  score_traits<typename R::Score>::Measured::columns(
      r.measured, [&](const char* name, const double& v) { f(prefix + name, r.value ? v : std::numeric_limits<double>::quiet_NaN()); });
}
}  // namespace detail

/// `f(const char* name, std::optional<double> value, double weight, Better)` for each score of the frame by itself.
template <class F, class C, class Function>
void for_each_frame_score(const BasicAssessment<F, C>& a, Function&& f) {
  detail::for_each_result(a.frame_scores, [&](const auto& r) { detail::score_value(r, f); });
}
/// The same for each score of the change since the reference.
template <class F, class C, class Function>
void for_each_change_score(const BasicAssessment<F, C>& a, Function&& f) {
  detail::for_each_result(a.change_scores, [&](const auto& r) { detail::score_value(r, f); });
}
/// The same for all scores: those of the frame, then those of change. Also tells the columns of a table, from
/// `Assessment{}`.
template <class F, class C, class Function>
void for_each_score(const BasicAssessment<F, C>& a, Function&& f) {
  for_each_frame_score(a, f);
  for_each_change_score(a, f);
}
/// `f(std::string name, double value)` for whatever the scores measured, NaN where a score is missing. Names that begin
/// with "step_" are the scores of change against the frame before, and what they measured.
template <class F, class C, class Function>
void for_each_measurement(const BasicAssessment<F, C>& a, Function&& f) {
  detail::for_each_result(a.frame_scores, [&](const auto& r) { detail::score_columns("", r, f); });
  detail::for_each_result(a.change_scores, [&](const auto& r) { detail::score_columns("", r, f); });
  detail::for_each_result(a.step_scores, [&](const auto& r) {
    const std::string name = std::string("step_") + std::decay_t<decltype(r)>::Score::name;
    f(name, r.value ? r.value->value() : std::numeric_limits<double>::quiet_NaN());
    detail::score_columns("step_", r, f);
  });
}
/// Fills the scores and measurements of an assessment from a table: `value(std::string column)` gives a number, NaN where
/// there is none. The inverse of for_each_score and for_each_measurement.
template <class F, class C, class Function>
void read_scores(BasicAssessment<F, C>& a, Function&& value) {
  const auto read = [&](const std::string& prefix) {
    return [&value, prefix](auto& r) {
      using S = typename std::decay_t<decltype(r)>::Score;
      const double v = value(prefix + S::name);
      if (v == v) r.value = typename S::Value(v);
      score_traits<S>::Measured::columns(r.measured, [&](const char* name, double& to) { to = value(prefix + name); });
    };
  };
  detail::for_each_result(a.frame_scores, read(""));
  detail::for_each_result(a.change_scores, read(""));
  detail::for_each_result(a.step_scores, read("step_"));
}

template <class F, class C>
std::optional<double> BasicAssessment<F, C>::get(std::string_view name) const {
  std::optional<double> found;
  for_each_score(*this, [&](const char* n, const std::optional<double>& v, double, Better) {
    if (name == n) found = v;
  });
  return found;
}

/// What the assessor keeps of a frame: what each score of change remembers. Copying into an old one reuses its memory.
template <class ChangeScores>
struct FrameSnapshot;
template <class... S>
struct FrameSnapshot<ScoreList<S...>> : ScoredFrame {
  std::tuple<typename S::Memory...> memories;
};

APSO_NAMESPACE_END
