/// \file
/// People by histograms of oriented gradients (Dalal & Triggs, CVPR 2005) with the weights that come with OpenCV: needs
/// no file and no network.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/objdetect.hpp>

#include <apso/config.hpp>
#include <apso/opencv/detectors/detector_policy.hpp>
#include <apso/options.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/detection.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

struct HogPeopleOptions {
  double minimum_margin = 0.0;  ///< smallest distance to the separating plane; less finds more people and more furniture
  double resize = 0.5;          ///< the image is searched at this share of its size; people are found from 100 px there
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("minimum_margin", s.minimum_margin, -10.0, 10.0);
    v("resize", s.resize, 0.05, 4.0);
  }
};

/// Finds upright people that are seen from head to foot. Much weaker than a network.
class HogPeople {
 public:
  explicit HogPeople(const HogPeopleOptions& options = {}) : options_(options) {
    validate(options, "hog_people");
    hog_.setSVMDetector(cv::HOGDescriptor::getDefaultPeopleDetector());
  }

  /// Score: 1 / (1 + exp(-2 margin)). None in an image smaller than the trained window. Valid until the next call.
  const std::vector<Detection>& detect(const AnyFrame& frame) {
    constexpr double kStep = 1.08;    // ratio of the sizes that are searched; OpenCV's own 1.05 searches 1.6 times as many
    constexpr float kOverlap = 0.4F;  // of two boxes that overlap more (IoU), the weaker one is dropped
    constexpr float kShrink = 0.15F;  // boxes are made smaller by this share, since the trained ones have a wide border
    expects(!frame.intensity().empty(), "HogPeople: the intensity image is empty");
    gray_of(frame.intensity(), row_, gray_);
    found_.clear();
    const cv::Size size(cvRound(gray_.cols * options_.resize), cvRound(gray_.rows * options_.resize));
    if (size.width < hog_.winSize.width || size.height < hog_.winSize.height) return found_;
    cv::resize(gray_, small_, size, 0, 0, options_.resize < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    // people who fill the view reach beyond it: the search window must, too
    const int border = 16;
    cv::copyMakeBorder(small_, wide_, border, border, border, border, cv::BORDER_REPLICATE);
    boxes_.clear();
    margins_.clear();
    hog_.detectMultiScale(wide_, boxes_, margins_, options_.minimum_margin, {8, 8}, {0, 0}, kStep, 0.0, false);
    order_.clear();
    for (std::size_t i = 0; i < boxes_.size(); ++i) order_.push_back(i);
    std::stable_sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) { return margins_[a] > margins_[b]; });
    const auto scale = static_cast<float>(1.0 / options_.resize);
    for (const std::size_t i : order_) {
      if (margins_[i] < options_.minimum_margin) continue;
      const cv::Rect& r = boxes_[i];
      Detection d;
      const auto w = static_cast<float>(r.width) * scale;
      const auto h = static_cast<float>(r.height) * scale;
      d.box = {static_cast<float>(r.x - border) * scale + kShrink * w / 2, static_cast<float>(r.y - border) * scale + kShrink * h / 2,
               (1 - kShrink) * w, (1 - kShrink) * h};
      bool repeated = false;
      for (const Detection& o : found_) repeated = repeated || iou(o.box, d.box) > kOverlap;
      if (repeated) continue;
      d.score = static_cast<float>(1.0 / (1.0 + std::exp(-2.0 * margins_[i])));
      found_.push_back(d);
    }
    return found_;
  }

 private:
  HogPeopleOptions options_;
  cv::HOGDescriptor hog_;
  std::vector<float> row_;
  cv::Mat gray_;
  cv::Mat small_;
  cv::Mat wide_;
  std::vector<cv::Rect> boxes_;
  std::vector<double> margins_;
  std::vector<std::size_t> order_;
  std::vector<Detection> found_;
};

}  // namespace opencv
APSO_NAMESPACE_END
