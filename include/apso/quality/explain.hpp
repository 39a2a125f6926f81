/// \file
/// Why a frame got its state, in one sentence.
#pragma once

#include <cmath>
#include <sstream>
#include <string>

#include <apso/config.hpp>
#include <apso/quality/assessment.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
/// "S_depth 0.41: coverage 0.30, ..." for a score that speaks against the frame, else nothing.
template <class R>
std::string explain_score(const R& r) {
  using S = typename R::Score;
  if (!r.value) return {};
  const double v = r.value->value();
  if (score_traits<S>::better == Better::Higher ? v >= 0.7 : v <= 0.4) return {};
  std::string reason;
  if constexpr (detected_v<score_reason_t, S>) reason = S::reason(*r.value, r.measured);
  return S::name + (" " + two_digits(v)) + (reason.empty() ? "" : ": " + reason);
}
}  // namespace detail

/// One readable sentence, e.g. "BAD: S_final 0.41 < 0.70; S_total 0.45; S_feature 0.12: 41 static keypoints in 9 of 48
/// cells; S_change 0.71 (S_mc 0.90: 18 % of the reference's 500 points tracked); 40 % of the image is dynamic". Only scores
/// that speak against the frame are named, with their reason.
template <class F, class C>
[[nodiscard]] std::string explain(const BasicAssessment<F, C>& a) {
  std::ostringstream s;
  s.setf(std::ios::fixed);
  s.precision(2);
  s << to_string(a.state);
  if (a.state == SceneState::Initialising) {
    s << ": frame " << a.frame << ", S_total " << a.S_total.value() << ", needs " << a.th_s << " after " << std::lround(a.th_f)
      << " frames";
    if (a.initialisation_failed) s << ", no frame was good enough, the search begins anew";
    if (a.benchmark_updated) s << (a.degraded ? ", timeout: the best frame is taken although it is poor" : ", reference found");
  } else {
    if (a.S_final) {
      s << ": S_final " << a.S_final->value() << (a.S_final->value() >= a.th_differ ? " >= " : " < ") << a.th_differ;
    }
    if (a.S_inn.value() < 0.7)
      s << "; the feature pose is " << 100 * a.innovation << " cm off the prediction (S_inn " << a.S_inn.value() << ')';
    if (!a.feature_tracking_ok && !a.feature_pose_refused) s << "; the feature tracker has no pose";
    s << "; S_total " << a.S_total.value();
  }
  if (a.feature_pose_refused) s << "; the pose of the feature tracker is not finite or no rigid motion";
  if (a.S_total_missing) s << "; nothing to judge the frame by";
  detail::for_each_result(a.frame_scores, [&](const auto& r) {
    const std::string text = detail::explain_score(r);
    if (!text.empty()) s << "; " << text;
  });
  if (a.S_change) {
    s << "; S_change " << a.S_change->value();
    const char* separator = " (";
    detail::for_each_result(a.change_scores, [&](const auto& r) {
      const std::string text = detail::explain_score(r);
      if (text.empty()) return;
      s << separator << text;
      separator = ", ";
    });
    if (separator[0] == ',') s << ')';
  }
  if (a.scenario_dynamic) s << "; " << std::lround(100.0 * a.dynamic_ratio) << " % of the image is dynamic";
  if (a.degraded && a.state != SceneState::Initialising) s << "; the reference is poor";
  return s.str();
}

APSO_NAMESPACE_END
