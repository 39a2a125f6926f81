/// \file
/// Masks and detections that another program wrote before, as a motion policy: any network, offline.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <apso/config.hpp>
#include <apso/io/detection_text.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/opencv/adapters.hpp>
#include <apso/opencv/detectors/detector_policy.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// Reads the mask image and the detections of the stamp of each frame. With a mask everything is known; with detections
/// alone only what lies on movable objects is, at probability (1 + score) / 2. A frame without a file is unknown.
class PrecomputedMotion : public PolicyOperators {
 public:
  /// \param masks folder of images named by the stamp (nonzero = dynamic); may be empty
  /// \param detections file or folder, see DetectionLog; may be empty, but not both
  /// Throws io_error when nothing usable is there.
  PrecomputedMotion(const Pinhole& camera, const std::string& masks, const std::string& detections,
                    const ClassList& classes = {})
      : camera_(camera) {
    expects(!masks.empty() || !detections.empty(), "PrecomputedMotion: needs a folder of masks, or detections");
    if (!masks.empty()) masks_.emplace(masks, std::vector<std::string>{".png", ".jpg", ".bmp", ".pgm"});
    if (!detections.empty()) log_.emplace(detections, camera.width, camera.height, classes);
  }

  /// Throws io_error when a mask cannot be read or has another size than the camera.
  void observe(const AnyFrame& frame, const AnyPose&, const AnyTracks&, DynamicMask& out) {
    set_unknown(camera_.width, camera_.height, out);
    detections_.clear();
    if (log_) {
      detections_ = log_->at(frame.timestamp);
      mark_detections(detections_, camera_.width, camera_.height, marked_, out);
    }
    if (!masks_) return;
    const std::string file = masks_->at(frame.timestamp);
    if (file.empty()) return;
    image_ = cv::imread(file, cv::IMREAD_GRAYSCALE);
    if (image_.empty()) throw io_error(file + ": not a readable image");
    if (image_.cols != camera_.width || image_.rows != camera_.height) {
      throw io_error(file + ": the mask is " + std::to_string(image_.cols) + "x" + std::to_string(image_.rows) +
                     ", expected the size of the images, " + std::to_string(camera_.width) + "x" + std::to_string(camera_.height));
    }
    mask_from_labels(as_image<std::uint8_t>(image_), other_);
    combine(other_, MaskCombination::Union, out);
  }
  void remember(const AnyFrame&, const AnyPose&, const DynamicMask&) {}
  void reset() { detections_.clear(); }
  [[nodiscard]] const std::vector<Detection>& detections() const { return detections_; }

 private:
  Pinhole camera_;
  std::optional<StampedFiles> masks_;
  std::optional<DetectionLog> log_;
  cv::Mat image_;
  DynamicMask other_;
  std::vector<Detection> detections_;
  std::vector<Detection> marked_;
};

}  // namespace opencv
APSO_NAMESPACE_END
