/// \file
/// The pipeline's own copy of a frame: the one place where an image of the host is copied.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/config.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/images/rows.hpp>
#include <apso/traits/ranges.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN
namespace detail {

/// Intensity and depth of a frame as float, and its detections with their masks. Allocates only when it grows.
class WorkingCopy {
 public:
  /// Reads both images in one pass, row by row.
  template <class FrameT>
  void take(const FrameT& frame, int width, int height) {
    const auto& intensity = intensity_of(frame);
    const auto& depth = depth_of(frame);
    intensity_.resize(width, height);
    depth_.resize(width, height);
    for (int y = 0; y < height; ++y) {
      copy_row(intensity, y, width, intensity_.row(y));
      copy_row(depth, y, width, depth_.row(y));
    }
    frame_.timestamp = frame.timestamp;
    frame_.intensity = intensity_.view();
    frame_.depth = depth_.view();
    frame_.colour = frame.colour;
  }
  /// Lets go of the colour image, which was not copied.
  void forget_colour() { frame_.colour = {}; }
  [[nodiscard]] const RgbdFrame& frame() const { return frame_; }

  /// Of more than kMaxObjects detections the strongest. \param range null for none
  template <class Range>
  const std::vector<Detection>& take_detections(const Range* range) {
    detections_.clear();
    if (range == nullptr) return detections_;
    strongest_.clear();
    for_each_detection(*range, [&](const Detection& d) { strongest_.add(d.score); });
    strongest_.choose();
    std::size_t i = 0;
    std::size_t masks = 0;
    for_each_detection(*range, [&](const Detection& d) {
      if (!strongest_.contains(d.score, i++)) return;
      detections_.push_back(d);
      if (d.mask.empty()) return;
      if (masks == masks_.size()) masks_.emplace_back();
      Image<std::uint8_t>& own = masks_[masks++];
      own.resize(d.mask.width, d.mask.height);
      for (int y = 0; y < d.mask.height; ++y) std::copy_n(d.mask.row(y), d.mask.width, own.row(y));
    });
    masks = 0;  // views last: the vector may have moved
    for (Detection& d : detections_) {
      if (!d.mask.empty()) d.mask = masks_[masks++].view();
    }
    return detections_;
  }

 private:
  template <class ImageT>
  static void copy_row(const ImageT& image, int y, int width, float* out) {
    if (const float* in_place = row_in_place(image, y)) {
      std::copy_n(in_place, width, out);
    } else {
      read_row(image, y, out);
    }
  }

  Image<float> intensity_;
  Image<float> depth_;
  RgbdFrame frame_;
  std::vector<Detection> detections_;
  StrongestObjects strongest_;
  std::vector<Image<std::uint8_t>> masks_;
};

}  // namespace detail
APSO_NAMESPACE_END
