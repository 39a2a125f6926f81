/// \file
/// From the decoded outputs of a network to objects in the image: suppression of repeated boxes, and masks.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/config.hpp>
#include <apso/opencv/detectors/network_outputs.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// How an image was put into the input of a network: scaled by one factor, then moved, so that it fits.
struct Letterbox {
  float scale = 1;  ///< input pixels per image pixel
  float left = 0;   ///< [input px]
  float top = 0;    ///< [input px]
  int input_width = 0;
  int input_height = 0;

  static Letterbox fit(int width, int height, int input_width, int input_height) {
    Letterbox l;
    l.scale = std::min(static_cast<float>(input_width) / static_cast<float>(width),
                       static_cast<float>(input_height) / static_cast<float>(height));
    l.left = std::floor((static_cast<float>(input_width) - l.scale * static_cast<float>(width)) / 2);
    l.top = std::floor((static_cast<float>(input_height) - l.scale * static_cast<float>(height)) / 2);
    l.input_width = input_width;
    l.input_height = input_height;
    return l;
  }
  /// Box in the image of a box in the input.
  [[nodiscard]] Box to_image(const Box& b) const { return {(b.x - left) / scale, (b.y - top) / scale, b.width / scale, b.height / scale}; }
};

/// Indices of the objects that survive: the best first; others of its class that overlap it by more than `overlap`
/// (IoU) are dropped, and so on, up to kMaxObjects.
[[nodiscard]] inline std::vector<std::size_t> suppress(const std::vector<NetworkObject>& objects, float overlap) {
  std::vector<std::size_t> order(objects.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return objects[a].score > objects[b].score; });
  std::vector<std::size_t> kept;
  for (const std::size_t i : order) {
    if (kept.size() == kMaxObjects) break;
    const bool repeated = std::any_of(kept.begin(), kept.end(), [&](std::size_t k) {
      return objects[k].class_id == objects[i].class_id && iou(objects[k].box, objects[i].box) > overlap;
    });
    if (!repeated) kept.push_back(i);
  }
  return kept;
}

/// Mask of an object in the size of the image, 255 = object; false when the network gives none.
/// A YOLO mask is sigmoid(sum of coefficients and prototypes) inside the box, an Rcnn mask is stretched over the box;
/// both are cut at 0.5.
[[nodiscard]] inline bool mask_of(const NetworkObjects& found, const NetworkObject& o, const Letterbox& letterbox, int width, int height,
                                  Image<std::uint8_t>& out) {
  const Box box = letterbox.to_image(o.box);
  const cv::Rect whole(0, 0, width, height);
  const auto limit = [](float v) { return static_cast<int>(std::clamp(v, -1e6F, 1e6F)); };
  const cv::Rect full(limit(std::floor(box.x)), limit(std::floor(box.y)), std::max(1, limit(std::ceil(box.width))),
                      std::max(1, limit(std::ceil(box.height))));
  const cv::Rect r = full & whole;
  if (o.coefficients.empty() ? o.mask < 0 || found.masks.empty() : found.prototypes.empty()) return false;
  out.assign(width, height, 0);
  if (r.empty()) return true;
  cv::Mat value;  // over `sampled`, positive inside
  cv::Mat_<float> map_x(r.size()), map_y(r.size());
  float offset = 0;
  if (!o.coefficients.empty()) {
    const cv::Mat& p = found.prototypes;
    const int h = p.size[2];
    const int w = p.size[3];
    value = cv::Mat::zeros(h, w, CV_32F);
    for (std::size_t c = 0; c < o.coefficients.size(); ++c) {
      const cv::Mat plane(h, w, CV_32F, const_cast<float*>(p.ptr<float>(0, static_cast<int>(c))));
      cv::scaleAdd(plane, static_cast<double>(o.coefficients[c]), value, value);
    }
    const float sx = static_cast<float>(w) / static_cast<float>(letterbox.input_width) * letterbox.scale;
    const float sy = static_cast<float>(h) / static_cast<float>(letterbox.input_height) * letterbox.scale;
    const float ox = letterbox.left / letterbox.scale;
    const float oy = letterbox.top / letterbox.scale;
    for (int y = 0; y < r.height; ++y) {
      for (int x = 0; x < r.width; ++x) {
        map_x(y, x) = (static_cast<float>(r.x + x) + 0.5F + ox) * sx - 0.5F;
        map_y(y, x) = (static_cast<float>(r.y + y) + 0.5F + oy) * sy - 0.5F;
      }
    }
  } else {
    const cv::Mat& m = found.masks;
    const int plane = m.size[1] > 1 ? std::clamp(o.class_id, 0, m.size[1] - 1) : 0;
    value = cv::Mat(m.size[2], m.size[3], CV_32F, const_cast<float*>(m.ptr<float>(o.mask, plane)));
    offset = 0.5F;
    // beyond its borders the mask goes on as it is there; cv::remap cannot take the numbers that a box without extent gives
    const auto near = [](float v, int size) { return std::clamp(v, -1.0F, static_cast<float>(size)); };
    for (int y = 0; y < r.height; ++y) {
      for (int x = 0; x < r.width; ++x) {
        map_x(y, x) = near((static_cast<float>(r.x + x) + 0.5F - box.x) / box.width * static_cast<float>(m.size[3]) - 0.5F, m.size[3]);
        map_y(y, x) = near((static_cast<float>(r.y + y) + 0.5F - box.y) / box.height * static_cast<float>(m.size[2]) - 0.5F, m.size[2]);
      }
    }
  }
  cv::Mat_<float> sampled;
  cv::remap(value, sampled, map_x, map_y, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  for (int y = 0; y < r.height; ++y) {
    for (int x = 0; x < r.width; ++x) {
      if (sampled(y, x) > offset) out(r.x + x, r.y + y) = 255;
    }
  }
  return true;
}

}  // namespace opencv
APSO_NAMESPACE_END
