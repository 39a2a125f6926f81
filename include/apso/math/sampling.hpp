/// \file
/// Reading an image between its pixels: bilinear value with the exact derivative of that same interpolant.
#pragma once

#include <algorithm>

#include <apso/config.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// Value of an image at a real position, and its derivative per pixel.
struct Sample {
  float value = 0;
  float dx = 0;  ///< d value / du [1/px]
  float dy = 0;  ///< d value / dv [1/px]
};

/// True when the four pixels around (u,v) exist. False for NaN.
[[nodiscard]] inline bool can_sample(const ImageView<const float>& image, double u, double v) {
  return u >= 0 && v >= 0 && u <= image.width - 1 && v <= image.height - 1 && image.width > 1 && image.height > 1;
}

/// Bilinear value and its exact derivative at (u,v). Precondition (not checked): can_sample(image, u, v).
[[nodiscard]] inline Sample bilinear(const ImageView<const float>& image, double u, double v) {
  const int x = std::min(static_cast<int>(u), image.width - 2);
  const int y = std::min(static_cast<int>(v), image.height - 2);
  const float a = static_cast<float>(u - x);
  const float b = static_cast<float>(v - y);
  const float* p = image.row(y) + x;
  const float* q = p + image.stride;
  const float top = p[1] - p[0];
  const float bottom = q[1] - q[0];
  const float upper = p[0] + a * top;
  const float lower = q[0] + a * bottom;
  return {upper + b * (lower - upper), top + b * (bottom - top), lower - upper};
}

APSO_NAMESPACE_END
