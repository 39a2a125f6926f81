/// \file
/// How the brightness of two images is related, from pixels that show the same points.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/robust_scale.hpp>

APSO_NAMESPACE_BEGIN

/// Brightness of the current frame against the reference: I_c = gain I_k + offset.
struct Illumination {
  float gain = 1;
  float offset = 0;
};

/// Intensities of the same points in both images, the same index for the same point.
struct IntensityPairs {
  std::vector<float> reference, current;
  std::vector<float> inverse_sigma;  ///< of their difference
  [[nodiscard]] std::size_t size() const { return reference.size(); }
  void resize(std::size_t n) {
    reference.resize(n);
    current.resize(n);
    inverse_sigma.resize(n);
  }
  /// f(reference, current, inverse_sigma) for kLanes pairs at once; the last ones are filled up with inverse_sigma = 0.
  template <class F>
  void for_lanes(F&& f) const {
    const std::size_t n = size();
    std::size_t i = 0;
    for (; i + kLanes <= n; i += kLanes) {
      f(Lanes::load(reference.data() + i), Lanes::load(current.data() + i), Lanes::load(inverse_sigma.data() + i));
    }
    if (i == n) return;
    float rest[3][kLanes] = {};
    std::copy(reference.begin() + static_cast<std::ptrdiff_t>(i), reference.end(), rest[0]);
    std::copy(current.begin() + static_cast<std::ptrdiff_t>(i), current.end(), rest[1]);
    std::copy(inverse_sigma.begin() + static_cast<std::ptrdiff_t>(i), inverse_sigma.end(), rest[2]);
    f(Lanes::load(rest[0]), Lanes::load(rest[1]), Lanes::load(rest[2]));
  }
};

/// Correlation of the intensities, [-1,1]; 0 where the current image shows nothing.
/// \param noise standard deviation of the intensity: a reference without more contrast than that has nothing to compare, 1
/// \param blank_is_fine the same for the current image
[[nodiscard]] inline double intensity_correlation(const IntensityPairs& pairs, double noise, bool blank_is_fine) {
  const auto n = static_cast<double>(pairs.size());
  if (n < 2) return 0;
  // about the first pair: the differences of large numbers stay small
  const float a0 = pairs.reference.front();
  const float b0 = pairs.current.front();
  Lanes x = 0.0F, y = 0.0F, xx = 0.0F, xy = 0.0F, yy = 0.0F;
  pairs.for_lanes([&](const Lanes& reference, const Lanes& current, const Lanes& inverse_sigma) {
    const Mask given = inverse_sigma > Lanes(0.0F);
    const Lanes a = select(given, reference - a0, 0.0F);
    const Lanes b = select(given, current - b0, 0.0F);
    x += a;
    y += b;
    xx += a * a;
    xy += a * b;
    yy += b * b;
  });
  const double mx = static_cast<double>(x.sum()) / n;
  const double my = static_cast<double>(y.sum()) / n;
  const double vx = static_cast<double>(xx.sum()) / n - mx * mx;
  const double vy = static_cast<double>(yy.sum()) / n - my * my;
  const double bare = 2 * noise * noise;
  if (vx < bare || (blank_is_fine && vy < bare)) return 1;
  if (!(vy > 1e-9)) return 0;
  return (static_cast<double>(xy.sum()) / n - mx * my) / std::sqrt(vx * vy);
}

/// Robust line I_c = gain I_k + offset through the pairs, held at (1, 0) by a weak prior; Cauchy weights with the MAD scale.
/// \param floor least scale of the residuals, in units of sigma
/// \param residuals of the pairs under `light`, divided by sigma; brought up to date
/// \param sorted scratch
/// \param light where to start; unchanged if the line is not plausible (gain outside [0.3, 3])
inline void fit_illumination(const IntensityPairs& pairs, double floor, std::vector<float>& residuals, std::vector<float>& sorted,
                             Illumination& light) {
  constexpr double kPrior = 100;  // 1 / 0.1^2
  sorted = residuals;
  const double scale = std::max(floor, mad_scale_in_place(sorted)) * 2.3849;
  const auto inverse_scale = static_cast<float>(1.0 / scale);
  double gain = static_cast<double>(light.gain);
  double offset = static_cast<double>(light.offset);
  for (int it = 0; it < 3; ++it) {
    const auto g = static_cast<float>(gain);
    const auto o = static_cast<float>(offset);
    Lanes aa = 0.0F, ab = 0.0F, bb = 0.0F, ya = 0.0F, yb = 0.0F;
    pairs.for_lanes([&](const Lanes& a, const Lanes& y, const Lanes& inverse_sigma) {
      const Lanes inverse = inverse_sigma * inverse_scale;
      const Lanes s = (y - g * a - o) * inverse;
      const Lanes w = inverse * inverse / (1.0F + s * s);
      const Lanes wa = w * a;
      aa += wa * a;
      ab += wa;
      bb += w;
      ya += wa * y;
      yb += w * y;
    });
    const auto sum = [](const Lanes& l) { return static_cast<double>(l.sum()); };
    const double A = sum(aa) + kPrior, B = sum(ab), D = sum(bb) + kPrior;
    const double Y = sum(ya) + kPrior, Z = sum(yb);
    const double det = A * D - B * B;
    gain = (Y * D - Z * B) / det;
    offset = (A * Z - B * Y) / det;
  }
  if (!std::isfinite(gain) || !std::isfinite(offset) || gain < 0.3 || gain > 3) return;
  light.gain = static_cast<float>(gain);
  light.offset = static_cast<float>(offset);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    residuals[i] = (pairs.current[i] - light.gain * pairs.reference[i] - light.offset) * pairs.inverse_sigma[i];
  }
}

APSO_NAMESPACE_END
