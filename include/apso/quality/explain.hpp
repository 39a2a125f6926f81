/// \file
/// Why a frame got its state, in one sentence.
#pragma once

#include <cmath>
#include <sstream>
#include <string>

#include <apso/config.hpp>
#include <apso/quality/assessor.hpp>

APSO_NAMESPACE_BEGIN

/// One readable sentence, e.g. "BAD: S_final 0.41 < 0.70; S_feature 0.12: 41 static keypoints in 9 of 48 cells;
/// S_change 0.71: 18 % of the reference's 500 points tracked; 40 % of the image is dynamic". Parts that speak
/// against the frame come with their reason; the others are only named by their value.
[[nodiscard]] inline std::string explain(const Assessment& a) {
  std::ostringstream s;
  s.setf(std::ios::fixed);
  s.precision(2);
  const auto percent = [](double share) { return std::to_string(std::lround(100.0 * share)) + " %"; };
  s << to_string(a.state);
  if (a.state == SceneState::Initialising) {
    s << ": frame " << a.frame << ", S_total " << a.S_total.value() << ", needs " << a.th_s << " after "
      << std::lround(a.th_f) << " frames";
    if (a.initialisation_failed) s << ", no frame was good enough, the search begins anew";
    if (a.benchmark_updated) s << (a.degraded ? ", timeout: the best frame is taken although it is poor" : ", reference found");
  } else {
    if (a.S_final) {
      s << ": S_final " << a.S_final->value() << (a.S_final->value() >= a.th_differ ? " >= " : " < ") << a.th_differ;
    }
    if (!a.feature_tracking_ok) s << "; the feature tracker has no pose";
  }
  if (a.S_total_missing) s << "; nothing to judge the frame by";
  if (a.S_feature) {
    s << "; S_feature " << a.S_feature->value();
    if (a.S_feature->value() < 0.7) {
      s << ": " << a.static_keypoints << " static keypoints in " << a.features.occupied_cells << " of "
        << a.features.valid_cells << " cells";
      if (a.S_sharp && a.S_sharp->value() < 0.7) s << ", blurred (S_sharp " << a.S_sharp->value() << ')';
      if (a.feature_parts.S_resp < 0.7) s << ", weak response " << a.features.median_response;
    }
  }
  if (a.S_depth && a.S_depth->value() < 0.8) {
    s << "; S_depth " << a.S_depth->value() << ": coverage " << a.depth_parts.S_cov << ", consistency "
      << a.depth_parts.S_cons << ", smoothness " << a.depth_parts.S_smo;
  }
  if (a.S_spatial && a.S_spatial->value() < 0.7) {
    s << "; S_spatial " << a.S_spatial->value() << ": " << a.objects << (a.objects == 1 ? " object" : " objects");
  }
  if (a.S_change) {
    s << "; S_change " << a.S_change->value();
    if (a.S_change->value() > 0.4) {
      const char* separator = ": ";
      if (a.S_mc && a.reference_tracks > 0) {
        s << separator << percent(static_cast<double>(a.tracks_from_reference) / a.reference_tracks)
          << " of the reference's " << a.reference_tracks << " points tracked";
        separator = ", ";
      }
      if (a.S_dc && a.S_dc->value() > 0.4) {
        s << separator << "depth differs by " << percent(a.depth_change_parts.mean);
        separator = ", ";
      }
      if (a.S_dec && a.S_dec->value() > 0.4) {
        s << separator << a.detection_parts.matched << " of " << a.detection_parts.reference_count
          << " objects found again among " << a.detection_parts.current_count;
      }
    }
  }
  if (a.scenario_dynamic) s << "; " << percent(a.dynamic_ratio) << " of the image is dynamic";
  if (a.degraded && a.state != SceneState::Initialising) s << "; the reference is poor";
  return s.str();
}

APSO_NAMESPACE_END
