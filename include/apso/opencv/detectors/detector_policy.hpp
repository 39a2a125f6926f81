/// \file
/// Detectors as motion policies: what can move is taken as moving.
#pragma once

#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/detection.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// Intensity in [0,1] as 8 bit, read by rows.
/// \param row buffer
inline void gray_of(const AnyImage& intensity, std::vector<float>& row, cv::Mat& gray) {
  gray.create(intensity.height(), intensity.width(), CV_8U);
  auto read = rows(intensity, row);
  for (int y = 0; y < gray.rows; ++y) {
    cv::Mat out = gray.row(y);
    cv::Mat(1, gray.cols, CV_32F, const_cast<float*>(read(y))).convertTo(out, CV_8U, 255.0);
  }
}

/// The mask of what a detector found: every movable object has the probability (1 + score) / 2, since what passed the
/// detector's own threshold counts as dynamic. Outside of all objects nothing is known.
/// \param marked buffer
inline void mark_detections(const std::vector<Detection>& found, int width, int height, std::vector<Detection>& marked, DynamicMask& out) {
  marked = found;
  for (Detection& d : marked) d.motion_probability = 0.5F + 0.5F * d.score;
  mask_from_detections(marked, width, height, false, out);
}

/// A motion policy from a detector, i.e. a type with `const std::vector<Detection>& detect(const AnyFrame&)`.
///
/// Outside of all objects nothing is known: a detector sees classes, not motion. See mark_detections().
template <class Detector>
class DetectorPolicy : public PolicyOperators {
 public:
  explicit DetectorPolicy(Detector detector) : detector_(std::move(detector)) {}

  void observe(const AnyFrame& frame, const AnyPose&, const AnyTracks&, DynamicMask& out) {
    detections_ = detector_.detect(frame);
    mark_detections(detections_, frame.depth().width(), frame.depth().height(), marked_, out);
  }
  void remember(const AnyFrame&, const AnyPose&, const DynamicMask&) {}
  void reset() { detections_.clear(); }
  [[nodiscard]] const std::vector<Detection>& detections() const { return detections_; }

 private:
  Detector detector_;
  std::vector<Detection> detections_;
  std::vector<Detection> marked_;
};

}  // namespace opencv
APSO_NAMESPACE_END
