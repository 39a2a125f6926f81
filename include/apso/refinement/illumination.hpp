/// \file
/// How the brightness of two images is related, from pixels that show the same points.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/robust_scale.hpp>

APSO_NAMESPACE_BEGIN

/// Brightness of the current frame against the reference: I_c = gain I_k + offset.
struct Illumination {
  float gain = 1;
  float offset = 0;
};

/// Intensities of one point in both images.
struct IntensityPair {
  float reference, current;
  float inverse_sigma;  ///< of their difference
};

/// Correlation of the intensities, [-1,1]; 0 where the current image shows nothing.
/// \param noise standard deviation of the intensity: a reference without more contrast than that has nothing to compare, 1
/// \param blank_is_fine the same for the current image
[[nodiscard]] inline double intensity_correlation(const std::vector<IntensityPair>& pairs, double noise, bool blank_is_fine) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  for (const IntensityPair& p : pairs) {
    const double a = static_cast<double>(p.reference);
    const double b = static_cast<double>(p.current);
    n += 1;
    x += a;
    y += b;
    xx += a * a;
    xy += a * b;
    yy += b * b;
  }
  if (n < 2) return 0;
  const double vx = xx / n - x / n * (x / n);
  const double vy = yy / n - y / n * (y / n);
  const double bare = 2 * noise * noise;
  if (vx < bare || (blank_is_fine && vy < bare)) return 1;
  if (!(vy > 1e-12)) return 0;
  return (xy / n - x / n * (y / n)) / std::sqrt(vx * vy);
}

/// Robust line I_c = gain I_k + offset through the pairs, held at (1, 0) by a weak prior; Cauchy weights with the MAD scale.
/// \param floor least scale of the residuals, in units of sigma
/// \param residuals of the pairs under `light`, divided by sigma; brought up to date
/// \param sorted scratch
/// \param light where to start; unchanged if the line is not plausible (gain outside [0.3, 3])
inline void fit_illumination(const std::vector<IntensityPair>& pairs, double floor, std::vector<float>& residuals,
                             std::vector<float>& sorted, Illumination& light) {
  constexpr double kPrior = 100;  // 1 / 0.1^2
  sorted = residuals;
  const double scale = std::max(floor, mad_scale_in_place(sorted)) * 2.3849;
  double gain = static_cast<double>(light.gain);
  double offset = static_cast<double>(light.offset);
  for (int it = 0; it < 3; ++it) {
    double aa = kPrior;
    double ab = 0;
    double bb = kPrior;
    double ya = kPrior;
    double yb = 0;
    for (const IntensityPair& p : pairs) {
      const double a = static_cast<double>(p.reference);
      const double y = static_cast<double>(p.current);
      const double inverse = static_cast<double>(p.inverse_sigma);
      const double s = (y - gain * a - offset) * inverse / scale;
      const double w = inverse * inverse / (scale * scale) / (1 + s * s);
      aa += w * a * a;
      ab += w * a;
      bb += w;
      ya += w * a * y;
      yb += w * y;
    }
    const double det = aa * bb - ab * ab;
    gain = (ya * bb - yb * ab) / det;
    offset = (aa * yb - ab * ya) / det;
  }
  if (!std::isfinite(gain) || !std::isfinite(offset) || gain < 0.3 || gain > 3) return;
  light.gain = static_cast<float>(gain);
  light.offset = static_cast<float>(offset);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const IntensityPair& p = pairs[i];
    residuals[i] = (p.current - light.gain * p.reference - light.offset) * p.inverse_sigma;
  }
}

APSO_NAMESPACE_END
