/// \file
/// S_depth of the paper: coverage, consistency and smoothness of the depth image (eq. quality_score_initial).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <apso/config.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// Standard deviation of a measured depth.
enum class DepthNoise {
  Khoshelham,  ///< max(1 mm, 1.425e-3 z^2), Khoshelham & Elberink, Sensors 2012
  Nguyen       ///< 0.0012 + 0.0019 (z - 0.4)^2, Nguyen, Izadi & Lovell, 3DIMPVT 2012
};
constexpr std::array<const char*, 2> enum_names(DepthNoise) { return {"khoshelham", "nguyen"}; }

struct DepthQualityOptions {
  DepthRange range;
  int border = 8;               ///< pixels ignored at the image edge
  int stride = 4;               ///< every stride-th pixel both ways is judged
  double full_coverage = 0.8;   ///< share of valid pixels of a full S_cov
  double w_coverage = 0.5;      ///< the three weights sum to 1
  double w_consistency = 0.25;  ///<
  double w_smoothness = 0.25;   ///<
  DepthNoise noise = DepthNoise::Khoshelham;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("range", s.range);
    v("border", s.border, 1, 1000);
    v("stride", s.stride, 1, 64);
    v("full_coverage", s.full_coverage, 1e-3, 1.0);
    v("w_coverage", s.w_coverage, 0.0, 1.0);
    v("w_consistency", s.w_consistency, 0.0, 1.0);
    v("w_smoothness", s.w_smoothness, 0.0, 1.0);
    v("noise", s.noise);
  }
};

/// The parts of S_depth.
struct DepthScore {
  double S_cov = 0;   ///< coverage, [0,1]
  double S_cons = 0;  ///< consistency with the 3x3 neighbours, [0,1]
  double S_smo = 0;   ///< smoothness of the inverse depth, [0,1]
  int valid = 0;      ///< judged pixels with a valid depth
  int judged = 0;     ///< judged pixels
  Quality score;      ///< S_depth
};

/// The parts of S_depth with a noise model of the user.
/// Consistent: at least 5 of 8 neighbours are valid and the median of the 3x3 pixels is within 3 sigma. (Tested by
/// counting: at most half of the values lie above the band and at most half below it.)
/// Smooth: the second difference of 1/z, which is 0 on every plane however slanted, is within 3 sqrt(6) sigma of
/// 1/z in u and in v; over pixels whose four neighbours are valid.
/// \param sigma callable: depth [m] -> standard deviation [m], > 0
template <class Sigma>
[[nodiscard]] DepthScore depth_score(ImageView<const float> depth, const DepthQualityOptions& options, Sigma&& sigma) {
  DepthScore s;
  const DepthRange range = options.range;
  const int border = std::max(1, options.border);
  int consistent = 0;
  int smooth = 0;
  int crosses = 0;
  for (int y = border; y < depth.height - border; y += options.stride) {
    const float* up = depth.row(y - 1);
    const float* mid = depth.row(y);
    const float* down = depth.row(y + 1);
    for (int x = border; x < depth.width - border; x += options.stride) {
      ++s.judged;
      const float z = mid[x];
      if (!depth_valid(z, range)) continue;
      ++s.valid;
      const float sz = static_cast<float>(sigma(z));
      const float low = z - 3 * sz;
      const float high = z + 3 * sz;
      const std::array<float, 8> n{mid[x - 1], mid[x + 1], up[x], down[x], up[x - 1], up[x + 1], down[x - 1], down[x + 1]};
      int valid = 0;
      int above = 0;
      int below = 0;
      for (const float v : n) {
        const int ok = static_cast<int>(v >= range.min) & static_cast<int>(v <= range.max) & static_cast<int>(v > 0.0F);
        valid += ok;
        above += ok & static_cast<int>(v > high);
        below += ok & static_cast<int>(v < low);
      }
      // the centre is a ninth value and lies inside the band
      consistent += static_cast<int>(valid >= 5 && 2 * above <= valid + 1 && 2 * below <= valid + 1);
      if (valid == 8 || (depth_valid(n[0], range) && depth_valid(n[1], range) && depth_valid(n[2], range) &&
                         depth_valid(n[3], range))) {
        ++crosses;
        const float rho = 1 / z;
        const float limit = 3 * 2.44948974F * sz * rho * rho;
        smooth += static_cast<int>(std::abs(1 / n[0] - 2 * rho + 1 / n[1]) <= limit &&
                                   std::abs(1 / n[2] - 2 * rho + 1 / n[3]) <= limit);
      }
    }
  }
  if (s.valid == 0) return s;
  s.S_cov = clamp01(static_cast<double>(s.valid) / s.judged / options.full_coverage);
  s.S_cons = static_cast<double>(consistent) / s.valid;
  s.S_smo = crosses > 0 ? static_cast<double>(smooth) / crosses : 0.0;
  s.score = Quality(options.w_coverage * s.S_cov + options.w_consistency * s.S_cons + options.w_smoothness * s.S_smo);
  return s;
}

/// The parts of S_depth. Without a valid pixel all are 0; an empty image is the caller's "missing".
[[nodiscard]] inline DepthScore depth_score(ImageView<const float> depth, const DepthQualityOptions& options = {}) {
  if (options.noise == DepthNoise::Nguyen) {
    return depth_score(depth, options, [](float z) { return 0.0012F + 0.0019F * (z - 0.4F) * (z - 0.4F); });
  }
  return depth_score(depth, options, [](float z) { return depth_sigma(z); });
}

APSO_NAMESPACE_END
