/// \file
/// Whether a pixel shows something that stands still, by a map of dynamic probability.
#pragma once

#include <cmath>

#include <apso/config.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// From this dynamic probability on a pixel counts as dynamic. A NaN counts as dynamic too.
inline constexpr float kDynamicThreshold = 0.5F;

/// True when the pixel nearest to (x, y) lies in an image of width x height and is static. An empty map calls
/// everything static.
[[nodiscard]] inline bool is_static_point(ImageView<const float> dynamic_probability, int width, int height, float x,
                                          float y) {
  if (!(x > -0.5F && y > -0.5F && x < static_cast<float>(width) - 0.5F && y < static_cast<float>(height) - 0.5F)) {
    return false;  // outside, or NaN
  }
  if (dynamic_probability.empty()) return true;
  return dynamic_probability(static_cast<int>(std::lround(x)), static_cast<int>(std::lround(y))) < kDynamicThreshold;
}

APSO_NAMESPACE_END
