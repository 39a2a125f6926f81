/// \file
/// Detectors as motion policies: what can move is taken as moving.
#pragma once

#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// A motion policy from a detector, i.e. a type with `const std::vector<Detection>& detect(const RgbdFrame&)`.
///
/// Every movable object has the probability (1 + score) / 2 on its mask or in its box: what passed the detector's own
/// threshold counts as dynamic. Outside of all objects nothing is known: a detector sees classes, not motion.
template <class Detector>
class DetectorPolicy {
 public:
  explicit DetectorPolicy(Detector detector) : detector_(std::move(detector)) {}

  void observe(const RgbdFrame& frame, const Pose&, const std::vector<PointTrack>&, DynamicMask& out) {
    detections_ = detector_.detect(frame);
    marked_ = detections_;
    for (Detection& d : marked_) d.motion_probability = 0.5F + 0.5F * d.score;
    mask_from_detections(marked_, frame.depth.width, frame.depth.height, false, out);
  }
  void remember(const RgbdFrame&, const Pose&, const DynamicMask&) {}
  void reset() { detections_.clear(); }
  [[nodiscard]] const std::vector<Detection>& detections() const { return detections_; }

 private:
  Detector detector_;
  std::vector<Detection> detections_;
  std::vector<Detection> marked_;
};

}  // namespace opencv
APSO_NAMESPACE_END
