/// \file
/// An object in one image: box, confidence, class, optional mask.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include <apso/config.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// Axis-aligned box, covers [x, x+width) x [y, y+height) in pixels.
struct Box {
  float x = 0;       ///< left edge [px]
  float y = 0;       ///< top edge [px]
  float width = 0;   ///< [px]
  float height = 0;  ///< [px]

  [[nodiscard]] float area() const { return std::max(0.0F, width) * std::max(0.0F, height); }
  [[nodiscard]] Box intersect(const Box& o) const {
    const float x0 = std::max(x, o.x);
    const float y0 = std::max(y, o.y);
    const float x1 = std::min(x + width, o.x + o.width);
    const float y1 = std::min(y + height, o.y + o.height);
    return {x0, y0, std::max(0.0F, x1 - x0), std::max(0.0F, y1 - y0)};
  }
};

/// Intersection over union of two boxes, in [0,1]; 0 when both are empty.
[[nodiscard]] inline float iou(const Box& a, const Box& b) {
  const float i = a.intersect(b).area();
  const float u = a.area() + b.area() - i;
  return u > 0 ? i / u : 0.0F;
}

struct Detection {
  Box box;
  float score = 0;           ///< confidence of the detector, [0,1]
  int class_id = 0;          ///< meaning is the detector's; 0 = person in COCO order
  bool movable = true;       ///< may it move by itself or be moved?
  float motion_probability = std::numeric_limits<float>::quiet_NaN();  ///< [0,1]; NaN = not known
  int track_id = -1;         ///< identity over time; -1 = none
  ImageView<const std::uint8_t> mask;  ///< image-sized, nonzero = object; empty = only the box is known
};

APSO_NAMESPACE_END
