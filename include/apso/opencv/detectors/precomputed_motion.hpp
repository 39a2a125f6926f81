/// \file
/// Masks and detections that another program wrote before, as a motion policy: any network, offline.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include <apso/config.hpp>
#include <apso/io/detection_text.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/opencv/adapters.hpp>
#include <apso/opencv/detectors/detector_policy.hpp>
#include <apso/opencv/mask_image.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// How far the files of another program could be used, in frames.
struct FileUse {
  int masks = 0;                      ///< frames with a mask that fits
  int detections = 0;                 ///< frames with detections, if only an empty file
  std::vector<std::string> problems;  ///< masks that are there and do not fit: file and what is wrong
};

/// Reads the mask image and the detections of the stamp of each frame. With a mask everything is known; with detections
/// alone only what lies on movable objects is, at probability (1 + score) / 2. A frame without a file is unknown.
class PrecomputedMotion : public PolicyOperators {
 public:
  /// \param masks folder of images named by the stamp (nonzero = dynamic); may be empty
  /// \param detections file or folder, see DetectionLog; may be empty, but not both
  /// \param use counts what could be used, and must outlive the policy; a mask that does not fit is then a problem in it
  /// Throws io_error when nothing usable is there.
  PrecomputedMotion(const Pinhole& camera, const std::string& masks, const std::string& detections, const ClassList& classes = {},
                    FileUse* use = nullptr)
      : camera_(camera), use_(use) {
    expects(!masks.empty() || !detections.empty(), "PrecomputedMotion: needs a folder of masks, or detections");
    if (!masks.empty()) masks_.emplace(masks, std::vector<std::string>{".png", ".jpg", ".bmp", ".pgm"});
    if (!detections.empty()) log_.emplace(detections, camera.width, camera.height, classes);
  }

  /// Throws io_error when a mask cannot be read or has another size than the camera, and nothing counts the use of files.
  void observe(const AnyFrame& frame, const AnyPose&, const AnyTracks&, DynamicMask& out) {
    set_unknown(camera_.width, camera_.height, out);
    detections_.clear();
    if (log_) {
      if (use_ != nullptr && log_->covers(frame.timestamp)) ++use_->detections;
      detections_ = log_->at(frame.timestamp);
      mark_detections(detections_, camera_.width, camera_.height, marked_, out);
    }
    if (!masks_) return;
    const std::string file = masks_->at(frame.timestamp);
    if (file.empty()) return;
    cv::Mat image;
    try {
      image = read_mask(file, {camera_.width, camera_.height});
    } catch (const io_error& e) {
      if (use_ == nullptr) throw;
      use_->problems.emplace_back(e.what());
      return;
    }
    if (use_ != nullptr) ++use_->masks;
    mask_from_labels(as_image<std::uint8_t>(image), other_);
    combine(other_, MaskCombination::Union, out);
  }
  void remember(const AnyFrame&, const AnyPose&, const DynamicMask&) {}
  void reset() { detections_.clear(); }
  [[nodiscard]] const std::vector<Detection>& detections() const { return detections_; }

 private:
  Pinhole camera_;
  std::optional<StampedFiles> masks_;
  std::optional<DetectionLog> log_;
  FileUse* use_;
  DynamicMask other_;
  std::vector<Detection> detections_;
  std::vector<Detection> marked_;
};

}  // namespace opencv
APSO_NAMESPACE_END
