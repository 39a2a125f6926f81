/// \file
/// Model of a depth camera of another kind than that of sense_depth(): disparity with noise of its own in every pixel, rounded to
/// eighths of a pixel, and read at a place that errs. Direct alignment expects the noise of sense_depth(); what holds with this one
/// too does not rest on that.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <apso/config.hpp>
#include <apso/testing/synthetic_render.hpp>
#include <apso/testing/synthetic_sensor.hpp>
#include <apso/testing/synthetic_texture.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

/// Disparity against a projector or a second camera 7.5 cm beside. The figures are round ones, of the size that is published for
/// such cameras (e.g. Nguyen et al., 3DIMPVT 2012: a lateral error of about 0.8 px between two surfaces), and not fitted to any.
struct DisparitySensor {
  double baseline = 0.075;        ///< [m]
  double disparity_sigma = 0.15;  ///< [px]
  double lateral_sigma = 0.4;     ///< of the place that is read, in u and in v [px]
  double nearest = 0.4;           ///< [m]
  double farthest = 5;            ///< [m]

  /// What the camera says at a pixel [m]; 0 = nothing.
  /// \param depth  depth(x, y) without noise at any place [px], 0 = none
  /// \param normal normal() gives values of a normal distribution of variance 1
  template <class Depth, class Normal>
  [[nodiscard]] double operator()(const Pinhole& camera, const Depth& depth, double x, double y, Normal&& normal) const {
    const double u = x + lateral_sigma * normal();
    const double v = y + lateral_sigma * normal();
    const double z = depth(u, v);
    const double noise = disparity_sigma * normal();
    if (!(z > nearest) || z > farthest) return 0;
    const double product = camera.fx * baseline;
    const double disparity = std::round(8 * (product / z + noise)) / 8;
    return disparity > 0 ? product / disparity : 0;
  }
};

/// The depth image of such a camera.
inline void sense_disparity(const Canvas3d& drawn, const Pinhole& camera, std::uint64_t seed, const NormalTable& normal,
                            Image<float>& depth, const DisparitySensor& sensor = {}) {
  const auto exact = [&](double u, double v) {
    const int x = std::clamp(static_cast<int>(std::lround(u)), 0, camera.width - 1);
    const int y = std::clamp(static_cast<int>(std::lround(v)), 0, camera.height - 1);
    const float iz = drawn.inverse_depth(x, y);
    return iz > 0 ? 1 / static_cast<double>(iz) : 0.0;
  };
  Random rng(hash64(seed ^ 0xD15BA217ULL));
  const auto next = [&] { return static_cast<double>(normal(rng.next())); };
  depth.resize(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) depth(x, y) = static_cast<float>(sensor(camera, exact, x, y, next));
  }
}

}  // namespace testing
APSO_NAMESPACE_END
