/// \file
/// Objects by a network in an ONNX file, run by cv::dnn on the CPU. The library brings no network of its own.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/config.hpp>
#include <apso/io/detection_text.hpp>
#include <apso/opencv/detectors/detector_policy.hpp>
#include <apso/opencv/detectors/network_objects.hpp>
#include <apso/opencv/detectors/network_outputs.hpp>
#include <apso/options.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/detection.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

struct DnnOptions {
  int input_width = 640;                 ///< size of the network's input [px]
  int input_height = 640;                ///< [px]
  float score = 0.4F;                    ///< objects with less are left out
  float nms = 0.5F;                      ///< of two objects of a class that overlap more (IoU), the weaker one is dropped
  NetworkHead head = NetworkHead::Auto;  ///< what the outputs mean
  int first_class = 0;                   ///< id the network gives to the first name of the class list (1 for torchvision)
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("input_width", s.input_width, 8, 8192);
    v("input_height", s.input_height, 8, 8192);
    v("score", s.score, 0.0F, 1.0F);
    v("nms", s.nms, 0.0F, 1.0F);
    v("head", s.head);
    v("first_class", s.first_class, 0, 1000);
  }
};

/// Runs a detection or instance segmentation network on the colour image, or on the grey one where there is no colour.
/// The image is scaled to fit the input and padded with grey; values go from 0 to 1, in the order red, green, blue.
class DnnDetector {
 public:
  /// \param model an ONNX file
  /// \param classes names in the network's order, and which of them can move
  /// Throws io_error when the file cannot be read as a network.
  DnnDetector(const std::string& model, const DnnOptions& options = {}, ClassList classes = {})
      : model_(model), options_(options), classes_(std::move(classes)) {
    validate(options, "dnn");
    try {
      network_ = cv::dnn::readNetFromONNX(model);
    } catch (const cv::Exception& e) {
      throw io_error(model + ": cannot be read as an ONNX network by OpenCV " CV_VERSION ": " + e.err);
    }
    if (network_.empty()) throw io_error(model + ": the network is empty");
    network_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    network_.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
    names_ = network_.getUnconnectedOutLayersNames();
  }

  /// Valid until the next call, masks included. Throws io_error when the network does not take the input, or gives
  /// outputs that are not understood.
  const std::vector<Detection>& detect(const AnyFrame& frame) {
    prepare(frame);
    const int width = colour_.cols;
    const int height = colour_.rows;
    const Letterbox box = Letterbox::fit(width, height, options_.input_width, options_.input_height);
    input_.create(options_.input_height, options_.input_width, CV_8UC3);
    input_.setTo(cv::Scalar(114, 114, 114));
    const cv::Rect inside(static_cast<int>(box.left), static_cast<int>(box.top),
                          std::min(options_.input_width, static_cast<int>(std::lround(box.scale * static_cast<float>(width)))),
                          std::min(options_.input_height, static_cast<int>(std::lround(box.scale * static_cast<float>(height)))));
    cv::Mat place = input_(inside);
    cv::resize(colour_, place, inside.size(), 0, 0, box.scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    try {
      cv::dnn::blobFromImage(input_, blob_, 1.0 / 255.0, {}, {}, true, false);
      network_.setInput(blob_);
      network_.forward(outputs_, names_);
    } catch (const cv::Exception& e) {
      throw io_error(model_ + ": does not run on an input of " + std::to_string(options_.input_width) + "x" +
                     std::to_string(options_.input_height) + " (is that the size it was exported for?): " + e.err);
    }
    try {
      found_ = decode(names_, outputs_, options_.head, options_.input_width, options_.input_height, options_.score);
    } catch (const io_error& e) {
      throw io_error(model_ + ": " + e.what());
    }
    detections_.clear();
    const std::vector<std::size_t> kept = suppress(found_.objects, options_.nms);
    if (masks_.size() < kept.size()) masks_.resize(kept.size());
    for (std::size_t k = 0; k < kept.size(); ++k) {
      const NetworkObject& o = found_.objects[kept[k]];
      Detection d;
      const Box image{0, 0, static_cast<float>(width), static_cast<float>(height)};
      d.box = box.to_image(o.box).intersect(image);
      if (!(d.box.area() > 0)) continue;
      d.score = o.score;
      d.class_id = o.class_id - options_.first_class;
      d.movable = classes_.can_move(d.class_id);
      if (mask_of(found_, o, box, width, height, masks_[k])) d.mask = masks_[k].view();
      detections_.push_back(d);
    }
    return detections_;
  }

  [[nodiscard]] const ClassList& classes() const { return classes_; }

 private:
  void prepare(const AnyFrame& frame) {
    if (!frame.colour.empty()) {
      colour_ = cv::Mat(frame.colour.height, frame.colour.width, CV_8UC3, const_cast<Bgr8*>(frame.colour.data),
                        static_cast<std::size_t>(frame.colour.stride) * sizeof(Bgr8));
      return;
    }
    expects(!frame.intensity().empty(), "DnnDetector: the frame has neither colour nor intensity");
    gray_of(frame.intensity(), row_, gray_);
    cv::cvtColor(gray_, colour_, cv::COLOR_GRAY2BGR);
  }

  std::string model_;
  DnnOptions options_;
  ClassList classes_;
  cv::dnn::Net network_;
  std::vector<cv::String> names_;
  std::vector<float> row_;
  cv::Mat gray_;
  cv::Mat colour_;
  cv::Mat input_;
  cv::Mat blob_;
  std::vector<cv::Mat> outputs_;
  NetworkObjects found_;
  std::vector<Image<std::uint8_t>> masks_;
  std::vector<Detection> detections_;
};

}  // namespace opencv
APSO_NAMESPACE_END
