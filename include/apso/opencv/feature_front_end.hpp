/// \file
/// What the tracker needs of a grey image: ORB features, and Lucas-Kanade tracks from image to image.
///
/// Neither poses nor masks are needed for it, so it can be done on another thread, an image ahead of the tracker.
#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include <apso/config.hpp>
#include <apso/opencv/lk_tracker.hpp>
#include <apso/opencv/orb_front_end.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// Features of an image, and the tracks that reach it.
struct ImageFeatures {
  std::vector<Keypoint> keypoints;
  cv::Mat_<uchar> descriptors;  ///< one row of 32 bytes for each keypoint
  std::vector<PointTrack> tracks;
};

/// One per camera: the tracks follow from image to image. Not thread-safe.
class FeatureFrontEnd {
 public:
  explicit FeatureFrontEnd(const OrbOptions& orb = {}, const LkOptions& lk = {}) : orb_(orb), lk_(lk) {}

  /// \param gray8 8-bit grey image, the one after that of the last call
  /// \param[out] features its memory is used again; nothing in it refers to the image or to this object
  void extract(const cv::Mat& gray8, ImageFeatures& features) {
    expects(gray8.type() == CV_8UC1, "FeatureFrontEnd::extract: the grey image must be CV_8UC1");
    orb_.extract(gray8, features.keypoints, features.descriptors);
    lk_.track(gray8, features.keypoints);
    features.tracks = lk_.tracks();
  }

 private:
  OrbFrontEnd orb_;
  LkTracker lk_;
};

}  // namespace opencv
APSO_NAMESPACE_END
