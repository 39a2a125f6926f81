/// \file
/// Settings and result of the feature tracker.
#pragma once

#include <cstdint>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/options.hpp>
#include <apso/status.hpp>
#include <apso/traits/pose.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

inline constexpr int kWindowKeyframes = 10;      ///< of the local map; as many again that see the same landmarks
inline constexpr int kAdjustedKeyframes = 6;     ///< poses refined by bundle adjustment at a new keyframe
inline constexpr int kMinimumTrackInliers = 15;  ///< tracks that must agree to carry the pose where the map fails
/// A keyframe is due when inliers fall below this share of the most since the last (ORB-SLAM2).
inline constexpr double kKeyframeShare = 0.75;

/// Settings of the tracker. Where no source is named the value was chosen by hand; docs/quality.md shows what the tracker
/// reaches with it.
struct LandmarkTrackerOptions {
  int levels = 8;                  ///< octaves of the keypoints: a setting of whoever finds them
  double scale_factor = 1.2;       ///< between octaves
  DepthRange depth{0.3F, 8.0F};    ///< depth used at keypoints [m]
  double landmark_depth = 5.0;     ///< landmarks are created up to here [m]
  double inverse_depth_sigma = 0;  ///< of a depth measurement [1/m]; 0: that of the camera if it is known, else kInverseDepthSigma
  double dynamic_threshold = 0.5;  ///< features at least this likely to be dynamic are not used
  int min_inliers = 30;            ///< of the local map, for a valid pose (ORB-SLAM2)
  int max_frames_on_tracks = 15;   ///< frames in a row that tracks may carry it; errors add up
  double keyframe_interval = 1.0;  ///< a keyframe is due after this time [s] (ORB-SLAM2: the frame rate), or when kKeyframeShare says so
  int max_keyframes = 300;         ///< older ones are forgotten
  std::uint64_t seed = 1;          ///< of RANSAC
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("levels", s.levels, 1, 16);
    v("scale_factor", s.scale_factor, 1.05, 2.0);
    fields_but_octaves(s, v);
  }
  /// For front ends that know their octaves themselves.
  template <class Self, class V>
  static void fields_but_octaves(Self& s, V&& v) {
    v("depth", s.depth);
    v("landmark_depth", s.landmark_depth, 0.1, 1000.0);
    v("inverse_depth_sigma", s.inverse_depth_sigma, 0.0, 1.0);
    v("dynamic_threshold", s.dynamic_threshold, 0.01, 1.0);
    v("min_inliers", s.min_inliers, 3, 10000);
    v("max_frames_on_tracks", s.max_frames_on_tracks, 0, 1000000);
    v("keyframe_interval", s.keyframe_interval, 0.0, 1000.0);
    v("max_keyframes", s.max_keyframes, 2, 100000);
    v("seed", s.seed, std::uint64_t{0}, ~std::uint64_t{0});
  }
};

/// What LandmarkTracker::estimate found.
/// \tparam PoseT your pose type
template <class PoseT = Pose>
struct BasicFeatureResult {
  Status status = Status::NotRun;
  bool ok = false;                                              ///< the pose may be used
  PoseT T_world_camera = from_pose<PoseT>(identity_pose());     ///< the prediction when not ok
  int matches = 0;                                              ///< landmarks paired with keypoints
  int inliers = 0;                                              ///< of them, after optimisation
  bool first = false;                                           ///< there is no map yet: nothing to match
  PoseT T_world_predicted = from_pose<PoseT>(identity_pose());  ///< constant velocity, or the motion of the tracks where they agree
  int track_inliers = 0;                                        ///< tracks that agree with the predicted motion
  bool relocalised = false;                                     ///< found again among the keyframes
  bool from_tracks = false;                                     ///< the map failed; the pose is the last one moved along the tracks
  Matrix6 information = zeros<Matrix6>();  ///< of the twist that multiplies T_camera_world from the left, translation first;
                                           ///< zero unless the pose is from the map

  /// For FeaturePose::matches: landmarks, or where the map failed tracks, that agree with the pose; -1 without a map.
  [[nodiscard]] int confirmed_matches() const { return first ? -1 : !ok ? 0 : from_tracks ? track_inliers : inliers; }
};
using FeatureResult = BasicFeatureResult<>;

APSO_NAMESPACE_END
