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
#include <vector>

#include <apso/config.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// Standard deviation of the noise of a grey value that is taken out of the differences [grey in 0..1]: two
/// of 255 grey values.
inline constexpr double kImageNoise = 0.008;
/// Share of the typical ratio that still counts as sharp.
inline constexpr double kFullSharpness = 0.5;
/// The typical ratio is never taken as less, so that a recording that begins blurred does not set its own standard.
inline constexpr double kMinimumTypicalRatio = 0.02;

/// Ratio of fine to coarse contrast in both directions, >= 0.
struct SharpnessMeasure {
  double ratio_x = 0;  ///< along the rows
  double ratio_y = 0;  ///< along the columns
  bool valid = false;  ///< false: the image is too small, or flat but for its noise
};

/// Measures every fourth row and, across, every fourth pair of rows. Pixels that are not finite spoil the measure,
/// which is then not valid.
/// \param intensity any image in [0,1]
/// \param scratch   working memory for rows that are not floats
[[nodiscard]] inline SharpnessMeasure measure_sharpness(const AnyImage& intensity, std::vector<float>& scratch) {
  constexpr int fine = 4;
  constexpr int coarse = 32;
  constexpr int step = 4;
  SharpnessMeasure m;
  if (intensity.width() <= 2 * coarse || intensity.height() <= 2 * coarse) return m;
  auto row = rows(intensity, scratch, 5);  // rows 0, 4 and 32 below each other have places of their own
  double fine_x = 0, coarse_x = 0, fine_y = 0, coarse_y = 0;
  int rows = 0;
  const int nx = intensity.width() - coarse;
  for (int y = 0; y + coarse < intensity.height(); y += step) {
    const float* a = row(y);
    const float* below = row(y + fine);
    const float* far_below = row(y + coarse);
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
  const int columns = nx / 8 * 8;
  const double n = static_cast<double>(rows) * columns;
  const double noise = 2 * kImageNoise * kImageNoise;
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

/// The same with working memory of its own.
[[nodiscard]] inline SharpnessMeasure measure_sharpness(const AnyImage& intensity) {
  std::vector<float> scratch;
  return measure_sharpness(intensity, scratch);
}

/// S_sharp: 1 for what is typical here, falling with the blur of the worse direction.
/// \param typical_x,typical_y ratios of earlier frames; never taken as less than kMinimumTypicalRatio
[[nodiscard]] inline Quality sharpness_score(const SharpnessMeasure& m, double typical_x, double typical_y) {
  const auto share = [](double ratio, double typical) { return ratio / (kFullSharpness * std::max(kMinimumTypicalRatio, typical)); };
  return Quality(std::min(share(m.ratio_x, typical_x), share(m.ratio_y, typical_y)));
}

APSO_NAMESPACE_END
