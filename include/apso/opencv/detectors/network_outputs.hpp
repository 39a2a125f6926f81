/// \file
/// What the outputs of detection networks mean: from matrices of numbers to boxes, classes, scores and masks.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include <apso/config.hpp>
#include <apso/io/detection_text.hpp>
#include <apso/io/field_reader.hpp>
#include <apso/types/detection.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// Forms of outputs. N boxes, C classes, M mask coefficients.
enum class NetworkHead {
  Auto,         ///< found out from the shapes and names
  YoloRows,     ///< 1 x N x (4 + 1 + C [+ M]): centre, size, objectness, classes (YOLOv5, v7)
  YoloColumns,  ///< 1 x (4 + C [+ M]) x N: centre, size, classes (YOLOv8, v9, 11)
  YoloEnd,      ///< 1 x N x 6: corners, score, class, after the network's own suppression (YOLOv10)
  Rcnn          ///< boxes N x 4 (corners), labels N, scores N [, masks N x 1 x h x w]; or 1 x 1 x N x 7 [, N x C x h x w]
};
constexpr std::array<const char*, 5> enum_names(NetworkHead) { return {"auto", "yolo_rows", "yolo_columns", "yolo_end", "rcnn"}; }

/// One object as a network gives it.
struct NetworkObject {
  Box box;  ///< [input px]
  float score = 0;
  int class_id = 0;
  std::vector<float> coefficients;  ///< of the mask prototypes; empty = no mask
  int mask = -1;                    ///< row of the masks of an Rcnn head; -1 = none
};

/// Decoded outputs, before suppression.
struct NetworkObjects {
  std::vector<NetworkObject> objects;
  cv::Mat prototypes;  ///< 1 x M x h x w, of a YOLO head with masks
  cv::Mat masks;       ///< N x C x h x w, of an Rcnn head
};

namespace detail {
[[nodiscard]] inline std::string shape_of(const cv::Mat& m) {
  std::string s;
  for (int i = 0; i < m.dims; ++i) s += (i > 0 ? "x" : "") + std::to_string(m.size[i]);
  return s;
}
[[noreturn]] inline void unknown_outputs(const std::vector<std::string>& names, const std::vector<cv::Mat>& outputs,
                                         const std::string& why) {
  std::string text = "the network has outputs that are not understood (" + why + "):";
  for (std::size_t i = 0; i < outputs.size(); ++i)
    text += " '" + names[i] + "' " + shape_of(outputs[i]) + (i + 1 < outputs.size() ? "," : ".");
  text +=
      " Understood are: 1 x N x (5+C[+M]) as of YOLOv5 and v7; 1 x (4+C[+M]) x N as of YOLOv8, v9 and 11; either with mask "
      "prototypes 1 x M x h x w; 1 x N x 6 as of YOLOv10; boxes N x 4, labels N, scores N [, masks N x 1 x h x w] as of "
      "Mask R-CNN; 1 x 1 x N x 7 [, masks N x C x h x w]. Export the network with such a head, or write its detections to "
      "files and use the policy 'precomputed'";
  throw io_error(text);
}
[[nodiscard]] inline bool is_list(const cv::Mat& m) {  // N or N x 1
  return m.dims == 1 || (m.dims == 2 && (m.size[1] == 1 || m.size[0] == 1) && m.size[1] != 4);
}

/// The class that a number names; -1 for what names none: a negative one, NaN, a million or more.
[[nodiscard]] inline int class_of(float number) { return number > -1 && number < 1e6F ? static_cast<int>(number) : -1; }
/// True for an object to be kept: scored high enough, of a class, with a box of some size within kMaxBoxCoordinate.
[[nodiscard]] inline bool usable(const NetworkObject& o, float minimum_score) {
  const auto limited = [](float v) { return std::abs(v) <= static_cast<float>(kMaxBoxCoordinate); };  // false for NaN
  return o.score >= minimum_score && o.class_id >= 0 && o.box.width > 0 && o.box.height > 0 && limited(o.box.x) && limited(o.box.y) &&
         limited(o.box.width) && limited(o.box.height);
}

inline void decode_yolo(const cv::Mat& out, NetworkHead head, int coefficients, float minimum_score, NetworkObjects& result) {
  const bool columns = head == NetworkHead::YoloColumns;
  const int n = out.size[columns ? 2 : 1];
  const int channels = out.size[columns ? 1 : 2];
  const int first = head == NetworkHead::YoloRows ? 5 : 4;
  const int classes = channels - first - coefficients;
  const float* data = out.ptr<float>();
  const auto at = [&](int i, int c) {
    return columns ? data[static_cast<std::size_t>(c) * static_cast<std::size_t>(n) + static_cast<std::size_t>(i)]
                   : data[static_cast<std::size_t>(i) * static_cast<std::size_t>(channels) + static_cast<std::size_t>(c)];
  };
  for (int i = 0; i < n; ++i) {
    NetworkObject o;
    if (head == NetworkHead::YoloEnd) {
      o.score = at(i, 4);
      o.class_id = class_of(at(i, 5));
      o.box = {at(i, 0), at(i, 1), at(i, 2) - at(i, 0), at(i, 3) - at(i, 1)};
    } else {
      float best = 0;
      for (int c = 0; c < classes; ++c) {
        const float s = at(i, first + c);
        if (!(s > best)) continue;
        best = s;
        o.class_id = c;
      }
      o.score = head == NetworkHead::YoloRows ? best * at(i, 4) : best;
      o.box = {at(i, 0) - at(i, 2) / 2, at(i, 1) - at(i, 3) / 2, at(i, 2), at(i, 3)};
    }
    if (!usable(o, minimum_score)) continue;
    o.score = std::min(o.score, 1.0F);
    for (int c = 0; c < coefficients; ++c) o.coefficients.push_back(at(i, first + classes + c));
    result.objects.push_back(std::move(o));
  }
}

inline void decode_rcnn(const std::vector<std::string>& names, const std::vector<cv::Mat>& outputs, float input_width, float input_height,
                        float minimum_score, NetworkObjects& result) {
  const cv::Mat* boxes = nullptr;
  const cv::Mat* rows7 = nullptr;
  const cv::Mat* labels = nullptr;
  const cv::Mat* scores = nullptr;
  const cv::Mat* masks = nullptr;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const cv::Mat& m = outputs[i];
    const auto called = [&](const char* part) { return names[i].find(part) != std::string::npos; };
    if (m.dims == 4 && m.size[3] == 7 && m.size[0] == 1 && m.size[1] == 1) rows7 = &m;
    else if (m.dims == 4) masks = &m;
    else if (m.dims == 2 && m.size[1] == 4) boxes = &m;
    else if (is_list(m) && (called("label") || called("class"))) labels = &m;
    else if (is_list(m) && called("score")) scores = &m;
  }
  if (rows7 != nullptr) {  // corners as shares of the input
    const float* r = rows7->ptr<float>();
    if (masks != nullptr && masks->size[0] < rows7->size[2]) unknown_outputs(names, outputs, "there are fewer masks than rows of objects");
    for (int i = 0; i < rows7->size[2]; ++i, r += 7) {
      NetworkObject o;
      o.class_id = class_of(r[1]);
      o.score = r[2];
      o.box = {r[3] * input_width, r[4] * input_height, (r[5] - r[3]) * input_width, (r[6] - r[4]) * input_height};
      o.mask = masks != nullptr ? i : -1;
      if (usable(o, minimum_score)) result.objects.push_back(o);
    }
  } else {
    if (boxes == nullptr || scores == nullptr || labels == nullptr) {
      unknown_outputs(names, outputs, "boxes, labels or scores not found by shape and name");
    }
    const int n = boxes->size[0];
    if (static_cast<int>(scores->total()) != n || static_cast<int>(labels->total()) != n || (masks != nullptr && masks->size[0] != n)) {
      unknown_outputs(names, outputs, "boxes, labels, scores and masks differ in number");
    }
    const float* b = boxes->ptr<float>();
    for (int i = 0; i < n; ++i, b += 4) {
      NetworkObject o;
      o.class_id = class_of(labels->ptr<float>()[i]);
      o.score = scores->ptr<float>()[i];
      o.box = {b[0], b[1], b[2] - b[0], b[3] - b[1]};
      o.mask = masks != nullptr ? i : -1;
      if (usable(o, minimum_score)) result.objects.push_back(o);
    }
  }
  if (masks != nullptr) result.masks = *masks;
}
}  // namespace detail

/// Reads the outputs of a network. Boxes come in pixels of the input. Throws io_error for outputs it does not know, with
/// their names and shapes and what would be understood.
/// \param minimum_score objects with less are left out, as are those whose box or class is no number (NaN, infinite, huge)
[[nodiscard]] inline NetworkObjects decode(const std::vector<std::string>& names, const std::vector<cv::Mat>& outputs, NetworkHead head,
                                           int input_width, int input_height, float minimum_score) {
  expects(names.size() == outputs.size(), "decode: one name per output");
  const cv::Mat* rows = nullptr;
  const cv::Mat* prototypes = nullptr;
  bool has_boxes = false;
  bool has_rows7 = false;
  for (const cv::Mat& m : outputs) {
    if (m.depth() != CV_32F) detail::unknown_outputs(names, outputs, "not 32-bit floating point");
    if (m.dims == 3 && m.size[0] == 1 && rows == nullptr) rows = &m;
    if (m.dims == 4 && m.size[0] == 1) prototypes = &m;
    has_boxes = has_boxes || (m.dims == 2 && m.size[1] == 4);
    has_rows7 = has_rows7 || (m.dims == 4 && m.size[0] == 1 && m.size[1] == 1 && m.size[3] == 7);
  }
  NetworkObjects result;
  if (head == NetworkHead::Auto) {
    if (rows != nullptr) {
      const bool end = rows->size[2] == 6 && rows->size[1] == 300 && prototypes == nullptr;
      head = end ? NetworkHead::YoloEnd : rows->size[1] < rows->size[2] ? NetworkHead::YoloColumns : NetworkHead::YoloRows;
    } else if (has_boxes || has_rows7) {
      head = NetworkHead::Rcnn;
    } else {
      detail::unknown_outputs(names, outputs, "no output has the shape of boxes");
    }
  }
  if (head == NetworkHead::Rcnn) {
    detail::decode_rcnn(names, outputs, static_cast<float>(input_width), static_cast<float>(input_height), minimum_score, result);
    return result;
  }
  if (rows == nullptr) detail::unknown_outputs(names, outputs, "no output of three dimensions");
  const int coefficients = prototypes != nullptr && head != NetworkHead::YoloEnd ? prototypes->size[1] : 0;
  const int channels = rows->size[head == NetworkHead::YoloColumns ? 1 : 2];
  const int needed = head == NetworkHead::YoloRows || head == NetworkHead::YoloEnd ? 6 : 5;
  if (channels - coefficients < needed || (head == NetworkHead::YoloEnd && channels != 6)) {
    detail::unknown_outputs(names, outputs, "too few numbers per box");
  }
  detail::decode_yolo(*rows, head, coefficients, minimum_score, result);
  if (coefficients > 0) result.prototypes = *prototypes;
  return result;
}

}  // namespace opencv
APSO_NAMESPACE_END
