/// \file
/// What the library calls a frame: intensity and registered depth of one instant.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include <apso/config.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// Blue, green, red of one pixel, as cameras and image files deliver them.
using Bgr8 = std::array<std::uint8_t, 3>;

/// Views of one RGB-D frame. All images have the same size.
struct RgbdFrame {
  double timestamp = 0;              ///< [s]
  ImageView<const float> intensity;  ///< grey value in [0,1]
  ImageView<const float> depth;      ///< depth along the optical axis [m]; see depth_valid
  ImageView<const Bgr8> colour{};    ///< optional; only networks ask for it
};

/// Range of depth values that are used [m].
struct DepthRange {
  float min = 0.3F;  ///< [m]
  float max = 6.0F;  ///< [m]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("min", s.min, 0.0F, 1000.0F);
    v("max", s.max, 0.0F, 1000.0F);
  }
};

/// The one function that decides whether a depth value may be used: finite (0 and NaN are not in the range).
[[nodiscard]] inline bool depth_valid(float z, const DepthRange& range) {
  return z >= range.min && z <= range.max && z > 0.0F;  // every comparison with NaN is false
}

/// Noise of a structured-light depth sensor: its standard deviation is max(kDepthNoiseFloor, kDepthNoise z^2).
/// Khoshelham & Elberink, Sensors 2012.
inline constexpr float kDepthNoise = 1.425e-3F;   ///< [1/m]
inline constexpr float kDepthNoiseFloor = 1e-3F;  ///< [m]

/// Standard deviation of a depth of z metres [m].
[[nodiscard]] inline float depth_sigma(float z) {
  const float s = kDepthNoise * z * z;
  return s > kDepthNoiseFloor ? s : kDepthNoiseFloor;
}

/// Standard deviation of an inverse depth of a camera that says nothing of it: noise, registration and time offset, independent from depth
/// to depth [1/m]. What is more than this is taken to be shared by neighbours (CameraModel::inverse_depth_sigma).
inline constexpr double kInverseDepthSigma = 0.003;

APSO_NAMESPACE_END
