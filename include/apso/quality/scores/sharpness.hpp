/// \file
/// Motion blur, the part of S_feature that keypoints hide: a detector that lowers its threshold finds as many of them
/// in a blurred image, in other places.
///
/// Along rows and along columns the mean squared difference of pixels 4 apart is divided by that of pixels 32 apart.
/// A sharp edge gives 1/8, a ramp of length L much less (about 2/L for 4 < L < 32), whatever its contrast. Blur by a
/// turning camera lies in one direction, so the worse direction counts. How soft a scene looks when it is sharp differs
/// from scene to scene; so the ratio is compared with the running median of earlier GOOD frames, like the response.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <apso/config.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

struct SharpnessOptions {
  bool enabled = true;         ///< false: S_feature as printed, from keypoints alone
  double image_noise = 0.008;  ///< standard deviation that is taken out of the differences [grey in 0..1]
  double full = 0.5;           ///< share of the usual ratio that still counts as sharp
  double floor = 0.02;         ///< the usual ratio is never taken as less; keeps blur from calibrating itself
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("enabled", s.enabled);
    v("image_noise", s.image_noise, 0.0, 1.0);
    v("full", s.full, 1e-3, 1.0);
    v("floor", s.floor, 1e-6, 1.0);
  }
};

/// Ratio of fine to coarse contrast in both directions, >= 0.
struct SharpnessMeasure {
  double ratio_x = 0;  ///< along the rows
  double ratio_y = 0;  ///< along the columns
  bool valid = false;  ///< false: the image is too small, or flat but for its noise
};

/// Measures every fourth row and, across, every fourth pair of rows. Pixels that are not finite spoil the measure,
/// which is then not valid.
[[nodiscard]] inline SharpnessMeasure measure_sharpness(ImageView<const float> intensity,
                                                        const SharpnessOptions& options = {}) {
  constexpr int fine = 4;
  constexpr int coarse = 32;
  constexpr int step = 4;
  SharpnessMeasure m;
  if (intensity.width <= 2 * coarse || intensity.height <= 2 * coarse) return m;
  double fine_x = 0, coarse_x = 0, fine_y = 0, coarse_y = 0;
  int rows = 0;
  const int nx = intensity.width - coarse;
  for (int y = 0; y + coarse < intensity.height; y += step) {
    const float* a = intensity.row(y);
    const float* below = intensity.row(y + fine);
    const float* far_below = intensity.row(y + coarse);
    constexpr int lanes = 8;  // sums of their own, so that the loop can be vectorised in a fixed order
    float fx[lanes] = {}, cx[lanes] = {}, fy[lanes] = {}, cy[lanes] = {};
    for (int x = 0; x + lanes <= nx; x += lanes) {
      for (int k = 0; k < lanes; ++k) {
        const float v = a[x + k];
        const float d1 = a[x + k + fine] - v;
        const float d2 = a[x + k + coarse] - v;
        const float d3 = below[x + k] - v;
        const float d4 = far_below[x + k] - v;
        fx[k] += d1 * d1;
        cx[k] += d2 * d2;
        fy[k] += d3 * d3;
        cy[k] += d4 * d4;
      }
    }
    for (int k = 0; k < lanes; ++k) {
      fine_x += static_cast<double>(fx[k]);
      coarse_x += static_cast<double>(cx[k]);
      fine_y += static_cast<double>(fy[k]);
      coarse_y += static_cast<double>(cy[k]);
    }
    ++rows;
  }
  const double n = static_cast<double>(rows) * (nx / 8 * 8);
  const double noise = 2 * options.image_noise * options.image_noise;
  const auto ratio = [&](double f, double c) {
    const double rest = c / n - noise;
    return rest > noise ? std::max(0.0, f / n - noise) / rest : std::numeric_limits<double>::quiet_NaN();
  };
  m.ratio_x = ratio(fine_x, coarse_x);
  m.ratio_y = ratio(fine_y, coarse_y);
  m.valid = std::isfinite(m.ratio_x) && std::isfinite(m.ratio_y);
  if (!m.valid) m.ratio_x = m.ratio_y = 0;
  return m;
}

/// S_sharp: 1 for what is usual, falling with the blur of the worse direction.
/// \param usual_x,usual_y ratios of earlier frames; the floor of the options is applied to them
[[nodiscard]] inline Quality sharpness_score(const SharpnessMeasure& m, double usual_x, double usual_y,
                                             const SharpnessOptions& options = {}) {
  const auto share = [&](double ratio, double usual) {
    return ratio / (options.full * std::max(options.floor, usual));
  };
  return Quality(std::min(share(m.ratio_x, usual_x), share(m.ratio_y, usual_y)));
}

APSO_NAMESPACE_END
