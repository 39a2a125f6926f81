/// \file
/// S_change of the paper: how far the scene departs from the reference (eq. Change Score). A Deviation.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/quality/weighted_mean.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// What the current frame is compared with.
enum class ChangeBaseline {
  Reference,  ///< the benchmark frame
  Previous    ///< the frame before
};
constexpr std::array<const char*, 2> enum_names(ChangeBaseline) { return {"reference", "previous"}; }

/// Weights of the change score. They sum to 1.
struct ChangeWeights {
  double motion = 0.50;
  double depth = 0.40;
  double detection = 0.10;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("motion", s.motion, 0.0, 1.0);
    v("depth", s.depth, 0.0, 1.0);
    v("detection", s.detection, 0.0, 1.0);
  }
};

/// S_change = f(S_mc, S_dc, S_dec; w).
[[nodiscard]] inline MaybeDeviation change_score(MaybeDeviation S_mc, MaybeDeviation S_dc, MaybeDeviation S_dec,
                                                 const ChangeWeights& w = {}) {
  return weighted_mean<Deviation, 3>({S_mc, S_dc, S_dec}, {w.motion, w.depth, w.detection});
}

/// Calibrates a scale (s_m, s_mu, s_sigma) on a slow static sequence: the 95th percentile of the raw values (flow in
/// image diagonals, relative depth), measured at the reference age that occurs in operation, maps to a deviation of
/// 0.3. Values that are not finite are ignored; 0 when none is left.
[[nodiscard]] inline double calibrate_change_scale(std::vector<double> raw) {
  raw.erase(std::remove_if(raw.begin(), raw.end(), [](double v) { return !std::isfinite(v); }), raw.end());
  if (raw.empty()) return 0;
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(0.95 * static_cast<double>(raw.size()))) - 1;
  std::nth_element(raw.begin(), raw.begin() + rank, raw.end());
  return raw[static_cast<std::size_t>(rank)] / -std::log(1.0 - 0.3);
}

APSO_NAMESPACE_END
