/// \file
/// The feature tracker with its front end: ORB features and Lucas-Kanade tracks of a grey image.
///
/// It gives the pipeline its keypoints, its point tracks and T_feature.
#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include <apso/config.hpp>
#include <apso/opencv/adapters.hpp>
#include <apso/opencv/feature_front_end.hpp>
#include <apso/options.hpp>
#include <apso/tracker/landmark_tracker.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// Settings of the tracker and of its front end. `levels` and `scale_factor` are those of `orb`.
struct FeatureTrackerOptions : LandmarkTrackerOptions {
  OrbOptions orb;
  LkOptions lk;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("orb", s.orb);
    v("lk", s.lk);
    fields_but_octaves(s, v);
  }
};

/// Use per frame: begin, estimate (once or more), commit.
/// \tparam PoseT your pose type; any with pose_traits
template <class PoseT = Pose>
class BasicFeatureTracker {
 public:
  using Result = BasicFeatureResult<PoseT>;

  explicit BasicFeatureTracker(const Pinhole& camera, const FeatureTrackerOptions& options = {})
      : camera_(camera), front_end_(options.orb, options.lk), core_(camera, with_octaves_of_orb(options)) {}

  /// Extracts features and follows the tracks. Nothing given is used after this call.
  /// \param gray8 8-bit grey image of the size of the camera
  /// \param frame a Frame of any images (see frame()) or an RgbdFrame; only the time and the depth are read
  template <class FrameT>
  void begin(const cv::Mat& gray8, const FrameT& frame) {
    expects(gray8.type() == CV_8UC1, "FeatureTracker::begin: the grey image must be CV_8UC1");
    expects(gray8.cols == camera_.width && gray8.rows == camera_.height,
            "FeatureTracker::begin: the grey image must have the size of the camera");
    front_end_.extract(gray8, features_);
    core_.begin(frame, features_.keypoints, features_.descriptors, features_.tracks);
  }
  /// The same with features that a front end of yours has found, e.g. on another thread.
  template <class FrameT>
  void begin(const ImageFeatures& features, const FrameT& frame) {
    features_.keypoints = features.keypoints;
    features_.tracks = features.tracks;
    core_.begin(frame, features.keypoints, features.descriptors, features.tracks);
  }

  [[nodiscard]] const std::vector<Keypoint>& keypoints() const { return features_.keypoints; }
  [[nodiscard]] const std::vector<PointTrack>& tracks() const { return features_.tracks; }

  /// Pose of the frame begun. May be called again with a better mask.
  /// \param dynamic_probability any image of [0,1] with the size of the camera; none or empty = nothing is dynamic
  template <class Mask = None>
  Result estimate(const Mask& dynamic_probability = {}) {
    return core_.estimate(dynamic_probability);
  }

  /// Ends the frame with its final pose.
  /// \param dynamic_probability as for estimate(): the final mask
  /// \param allow_keyframe false on frames that are not trusted: the map stays as it is
  template <class Mask = None>
  void commit(const PoseT& T_world_camera, const Mask& dynamic_probability, bool allow_keyframe) {
    core_.commit(T_world_camera, dynamic_probability, allow_keyframe);
  }

  /// For programs that can deal with a map that moves and has several parts; see BasicLandmarkTracker::reconnect().
  BasicPartChange<PoseT> reconnect() { return core_.reconnect(); }

  /// Where the camera is expected: by constant velocity after begin, refined by the tracks after estimate.
  [[nodiscard]] PoseT predicted() const { return core_.predicted(); }
  [[nodiscard]] int keyframes() const { return core_.keyframes(); }
  [[nodiscard]] int landmarks() const { return core_.landmarks(); }
  [[nodiscard]] const LocalMap& map() const { return core_.map(); }

 private:
  [[nodiscard]] static LandmarkTrackerOptions with_octaves_of_orb(const FeatureTrackerOptions& options) {
    LandmarkTrackerOptions core = options;
    core.levels = options.orb.levels;
    core.scale_factor = options.orb.scale_factor;
    return core;
  }

  Pinhole camera_;
  FeatureFrontEnd front_end_;
  BasicLandmarkTracker<PoseT> core_;
  ImageFeatures features_;
};

using FeatureTracker = BasicFeatureTracker<>;
using apso::FeatureResult;

}  // namespace opencv
APSO_NAMESPACE_END
