/// \file
/// An object in one image: box, confidence, class, optional mask.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

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
  float score = 0;                                                     ///< confidence of the detector, [0,1]
  int class_id = 0;                                                    ///< meaning is the detector's; 0 = person in COCO order
  bool movable = true;                                                 ///< may it move by itself or be moved?
  float motion_probability = std::numeric_limits<float>::quiet_NaN();  ///< [0,1]; NaN = not known
  int track_id = -1;                                                   ///< identity over time; -1 = none
  ImageView<const std::uint8_t> mask;                                  ///< image-sized, nonzero = object; empty = only the box is known
};

/// Objects of one image that count; of more, those with the highest scores. Objects are compared with each other, in time that grows
/// with the cube of their number in the worst case. Detectors give 100 to 300 after suppression.
inline constexpr std::size_t kMaxObjects = 300;

/// Tells by their scores which objects of an image count: add() all, choose(), then ask. In linear time; keeps its memory.
class StrongestObjects {
 public:
  void clear() { places_.clear(); }
  void add(float score) { places_.push_back(place(score, places_.size())); }
  void choose() {
    if (places_.size() <= kMaxObjects) return;
    const auto last = places_.begin() + static_cast<std::ptrdiff_t>(kMaxObjects) - 1;
    std::nth_element(places_.begin(), last, places_.end());
    last_ = *last;
  }
  /// True for the kMaxObjects highest scores, of equal ones the first. \param i in the order of add()
  [[nodiscard]] bool contains(float score, std::size_t i) const { return places_.size() <= kMaxObjects || !(last_ < place(score, i)); }

 private:
  using Place = std::pair<float, std::size_t>;  // the smallest is the strongest
  static Place place(float score, std::size_t i) { return {score == score ? -score : std::numeric_limits<float>::infinity(), i}; }
  std::vector<Place> places_;
  Place last_;
};

/// Drops all detections that do not count; the others keep their order.
inline void keep_strongest(std::vector<Detection>& detections) {
  if (detections.size() <= kMaxObjects) return;
  StrongestObjects strongest;
  for (const Detection& d : detections) strongest.add(d.score);
  strongest.choose();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < detections.size(); ++i) {
    if (strongest.contains(detections[i].score, i)) detections[kept++] = detections[i];
  }
  detections.resize(kept);
}

APSO_NAMESPACE_END
