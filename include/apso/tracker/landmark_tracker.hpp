/// \file
/// A small feature-based RGB-D tracker: keypoints with binary descriptors against a local map of landmarks, point tracks for
/// the motion from frame to frame, windowed bundle adjustment at keyframes, loops closed on a pose graph of the keyframes.
///
/// It gives the pipeline its T_feature. Keypoints, descriptors and tracks come from elsewhere; opencv/feature_tracker.hpp is
/// the same tracker with ORB and Lucas-Kanade in front.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/options.hpp>
#include <apso/status.hpp>
#include <apso/tracker/features.hpp>
#include <apso/tracker/landmark_matching.hpp>
#include <apso/tracker/landmark_tracker_options.hpp>
#include <apso/tracker/map/keyframes.hpp>
#include <apso/tracker/map/local_map.hpp>
#include <apso/tracker/map/loop_closing.hpp>
#include <apso/tracker/map/map_parts.hpp>
#include <apso/tracker/map/map_update.hpp>
#include <apso/tracker/map/relocalisation.hpp>
#include <apso/tracker/track_motion.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/pose.hpp>
#include <apso/traits/ranges.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Use per frame: begin, estimate (once or more), commit. Deterministic for a seed. Not thread-safe; use one per camera.
/// \tparam PoseT your pose type; any with pose_traits
template <class PoseT = Pose>
class BasicLandmarkTracker {
 public:
  using Result = BasicFeatureResult<PoseT>;

  explicit BasicLandmarkTracker(const Pinhole& camera, const LandmarkTrackerOptions& options = {})
      : camera_(camera),
        options_(options),
        matcher_(camera, Octaves{options.levels, options.scale_factor}),
        decision_(options.keyframe_interval, kKeyframeShare) {
    check_pose<PoseT>();
    camera_.validate();
    validate(options_, "tracker");
    if (options_.inverse_depth_sigma == 0) options_.inverse_depth_sigma = kInverseDepthSigma;
    expects(options_.inverse_depth_sigma >= 1e-6, "tracker: inverse_depth_sigma must be 0 (not known) or in [1e-6, 1] 1/m");
  }

  /// Takes the features of a new frame. Nothing given is used after this call.
  /// \param frame       a Frame of any images (see frame()) or an RgbdFrame; only the time and the depth are read
  /// \param keypoints   any range with keypoint_traits; angle and octave help if they are there
  /// \param descriptors one of 32 bytes for each keypoint: an image of bytes with 32 columns, or a range of `Descriptor`
  /// \param tracks      any range with track_traits; `none` = there are none
  template <class FrameT, class Keypoints, class Descriptors, class Tracks>
  void begin(const FrameT& frame, const Keypoints& keypoints, const Descriptors& descriptors, const Tracks& tracks) {
    const auto& depth = depth_of(frame);
    using DepthImage = std::decay_t<decltype(depth)>;
    check_image<DepthImage>();
    expects(image_traits<DepthImage>::width(depth) == camera_.width && image_traits<DepthImage>::height(depth) == camera_.height,
            "LandmarkTracker::begin: the depth image must have the size of the camera");
    timestamp_ = frame.timestamp;
    const auto sigma = static_cast<float>(options_.inverse_depth_sigma);
    copy_keypoints(keypoints, depth, options_.depth, sigma, features_);
    copy_descriptors(descriptors, features_.descriptors);
    expects(features_.descriptors.size() == features_.keypoints.size(),
            "LandmarkTracker::begin: there must be as many descriptors as keypoints");
    features_.grid.build(features_.keypoints, camera_.width, camera_.height);
    motion_.begin(tracks, depth, options_.depth, sigma);
    begun_ = true;
    ok_ = from_tracks_ = relocalised_ = false;
    ++frame_number_;
    T_world_predicted_ = frame_number_ == 1 ? identity_pose() : moved_on();
  }

  /// Pose of the frame begun. May be called again with a better mask.
  /// \param dynamic_probability any image of [0,1] with the size of the camera; none or empty = nothing is dynamic
  template <class Mask = None>
  Result estimate(const Mask& dynamic_probability = {}) {
    expects(begun_, "LandmarkTracker::estimate: call begin first");
    weigh(dynamic_probability);
    return find_pose();
  }

  /// Ends the frame with its final pose.
  /// \param dynamic_probability as for estimate(): the final mask
  /// \param allow_keyframe whether the pose is right, wherever it comes from: the map may grow from it. A frame that the map
  ///        did not recognise starts a new part of it
  template <class Mask = None>
  void commit(const PoseT& T_world_camera, const Mask& dynamic_probability, bool allow_keyframe) {
    expects(begun_, "LandmarkTracker::commit: call begin first");
    const Pose T = to_pose(T_world_camera);
    expects(is_finite(T), "LandmarkTracker::commit: the pose is not finite");
    weigh(dynamic_probability);
    motion_.leave_out_bodies(camera_, T, features_);
    finish(T, allow_keyframe);
  }

  /// For programs that can deal with a map that moves and has several parts, after each commit(): a camera that is lost for a second on
  /// good images begins a new part, or finds an earlier one; a part that is recognised in an earlier one is joined with it; a loop whose
  /// drift is seen is closed. Where this is never called the map has one part, and a lost camera waits until it recognises it.
  /// \return what became of the part. If it was left, forget all poses (Pipeline::reset()); if its poses have moved, take them along
  ///         (Pipeline::correct()). PartedTrajectory keeps the poses of all parts
  BasicPartChange<PoseT> reconnect() {
    expects(!begun_, "LandmarkTracker::reconnect: call commit first");
    PlacedFrame frame{timestamp_, frame_number_, T_world_previous_, lost_, placed_};
    PartChange found = parts_.update(features_, whole_keyframes(), options_.max_keyframes, matcher_, map_, frame, seen_);
    if (found.event != PartEvent::None) {
      loops_.forget();
    } else {
      found = loops_.update(features_, whole_keyframes(), matcher_, map_, frame, seen_);
      found.part = found.before = parts_.current();
    }
    if (found.event != PartEvent::None) T_world_previous_ = T_world_predicted_ = frame.T_world_camera;
    if (found.event == PartEvent::Left) {
      step_ = identity_pose();
      step_time_ = 0;
      lost_ = map_.living_keyframes() > 0;  // a new part begins with the next frame
      misses_ = lost_ ? 1 : 0;
      relocalised_at_ = timestamp_;
    }
    return in_type<PoseT>(found);
  }

  [[nodiscard]] const std::vector<Keypoint>& keypoints() const { return features_.keypoints; }
  /// Where the camera is expected: by constant velocity after begin, refined by the tracks after estimate.
  [[nodiscard]] PoseT predicted() const { return from_pose<PoseT>(T_world_predicted_); }
  [[nodiscard]] int keyframes() const { return map_.living_keyframes(); }
  [[nodiscard]] int landmarks() const { return map_.living_landmarks(); }
  [[nodiscard]] const LocalMap& map() const { return map_; }

 private:
  // A pose found again is doubted for a while: a wrong one would be built upon (ORB-SLAM2: 50 inliers for a second).
  static constexpr int kMinInliersRelocalised = 50;
  static constexpr double kRelocalisedFor = 1.0;  // [s]
  static constexpr double kFading = 0.8;          // of a motion that is only guessed, per frame
  static constexpr double kRefinedRadius = 8.0;   // of the search around a pose that is known [px]

  template <class Mask>
  void weigh(const Mask& mask) {
    if constexpr (!is_none_v<Mask>) {
      check_image<Mask>();
      const int width = image_traits<Mask>::width(mask);
      const int height = image_traits<Mask>::height(mask);
      expects(width == 0 || height == 0 || (width == camera_.width && height == camera_.height),
              "LandmarkTracker: the mask must be empty or have the size of the camera");
    }
    apso::weigh(mask, options_.dynamic_threshold, features_);
    motion_.weigh(mask, options_.dynamic_threshold);
  }

  /// The previous pose moved on with the velocity of the last step.
  [[nodiscard]] Pose moved_on() const {
    if (step_time_ <= 0) return normalized(T_world_previous_);
    const double s = std::clamp((timestamp_ - previous_timestamp_) / step_time_, 0.0, 3.0);
    return normalized(compose(T_world_previous_, se3_exp(s * se3_log(step_))));
  }

  [[nodiscard]] std::uint64_t frame_seed() const { return options_.seed + static_cast<std::uint64_t>(frame_number_); }
  [[nodiscard]] int needed_inliers() const {
    const bool recently = lost_ || timestamp_ - relocalised_at_ < kRelocalisedFor;
    return recently ? kMinInliersRelocalised : options_.min_inliers;
  }
  [[nodiscard]] bool accepted(const MapPose& found) const {
    const bool again = found.relocalised || lost_;
    return succeeded(found.status) && (again ? found.lasting >= kMinInliersRelocalised : found.inliers >= needed_inliers());
  }

  Result find_pose() {
    matcher_.clear();
    MapPose found;
    found.status = Status::TooFewMatches;
    found.T_world_camera = T_world_predicted_;
    track_inliers_ = 0;
    ok_ = from_tracks_ = false;
    if (map_.living_keyframes() == 0) {  // nothing to compare with: this frame defines the world
      ok_ = features_.with_depth >= options_.min_inliers;
      if (ok_) found.status = Status::Converged;
      return result(found);
    }
    track_inliers_ = motion_.find_pose(camera_, T_world_previous_, moved_on(), frame_seed(), T_world_predicted_);
    motion_.leave_out_bodies(camera_, T_world_predicted_, features_);
    found.T_world_camera = T_world_predicted_;
    matcher_.collect(map_, seen_, kWindowKeyframes, T_world_predicted_);
    search_near_prediction(found);
    if (!accepted(found)) relocalise(map_, features_, whole_keyframes(), matcher_, seen_, found);
    ok_ = accepted(found);
    if (!ok_) {
      found.T_world_camera = T_world_predicted_;
      if (succeeded(found.status)) found.status = Status::TooFewMatches;
      ok_ = from_tracks_ = track_inliers_ >= kMinimumTrackInliers && misses_ < options_.max_frames_on_tracks && !lost_;
      if (ok_) found.status = Status::Converged;
    }
    return result(found);
  }

  [[nodiscard]] RelocalisationInput whole_keyframes() const {
    return {T_world_predicted_, misses_ > 0, kWindowKeyframes, kMinInliersRelocalised, needed_inliers(), frame_seed()};
  }

  void search_near_prediction(MapPose& found) {
    constexpr double kRadii[] = {15.0, 30.0};  // [px]
    constexpr std::size_t kMinMatches = 20;
    for (double radius : kRadii) {
      matcher_.match_projections(map_, features_, T_world_predicted_, radius);
      if (matcher_.matches().size() >= kMinMatches && matcher_.solve(map_, features_, T_world_predicted_, found)) {
        // once more with everything that projects close to the refined pose
        const Pose refined = found.T_world_camera;
        matcher_.match_projections(map_, features_, refined, kRefinedRadius);
        matcher_.solve(map_, features_, refined, found);
      }
      if (accepted(found)) return;
    }
  }

  Result result(const MapPose& found) {
    relocalised_ = found.relocalised;
    Result r;
    r.status = found.status;
    r.ok = ok_;
    r.T_world_camera = from_pose<PoseT>(found.T_world_camera);
    r.matches = found.matches;
    r.inliers = found.inliers;
    r.T_world_predicted = from_pose<PoseT>(T_world_predicted_);
    r.track_inliers = track_inliers_;
    r.first = map_.living_keyframes() == 0;
    r.relocalised = found.relocalised;
    r.from_tracks = from_tracks_;
    if (ok_ && !from_tracks_) r.information = found.information;
    return r;
  }

  void finish(const Pose& T_world_camera, bool allow_keyframe) {
    begun_ = false;
    Pose T = normalized(T_world_camera);
    const bool from_map = ok_ && !from_tracks_;
    placed_ = from_map && allow_keyframe;
    misses_ = from_map ? 0 : misses_ + 1;
    lost_ = !ok_ && !allow_keyframe;
    if (relocalised_ && ok_) relocalised_at_ = timestamp_;
    const bool empty = map_.living_keyframes() == 0;
    if (allow_keyframe) {
      bool due = features_.with_depth >= options_.min_inliers;
      if (!empty) {
        if (!from_map) matcher_.match_projections(map_, features_, T, kRefinedRadius);
        const int inliers = update_landmarks(features_, T, matcher_, map_, marks_, seen_);
        // Where the map failed it has to grow; else what it shows decides.
        if (from_map) due = decision_.due(map_, features_, matcher_.matches(), inliers, timestamp_);
      }
      if (due) T = insert_keyframe(T, from_map);
    }
    // Velocity of a frame found again says nothing.
    const double dt = timestamp_ - previous_timestamp_;
    if (frame_number_ > 1 && dt > 0 && !relocalised_) {
      step_ = compose(inverse(T_world_previous_), normalized(T_world_camera));
      step_time_ = dt;
      // What was only predicted fades: a camera that is lost is sooner found near the place where it was seen last.
      const Pose off = compose(inverse(T_world_predicted_), T_world_camera);
      const bool guessed = !ok_ && norm(translation(off)) < 1e-9 && rotation_angle(off) < 1e-9;
      if (guessed) step_ = se3_exp(kFading * se3_log(step_));
    } else {
      step_ = identity_pose();
      step_time_ = 0;
    }
    T_world_previous_ = T;
    previous_timestamp_ = timestamp_;
    T_world_predicted_ = T;
  }

  /// \param from_map else the pose is known otherwise: the few pairs that there are, too few for a pose, must not move it
  /// \return the pose of the new keyframe after bundle adjustment
  Pose insert_keyframe(const Pose& T_world_camera, bool from_map) {
    const double max_sigma = 5 * options_.inverse_depth_sigma;  // more is an edge, and its depth may be of either side
    const KeyframeInput input{timestamp_, T_world_camera, frame_number_, options_.landmark_depth, max_sigma};
    const int k = new_keyframe(camera_, features_, matcher_.matches(), input, map_);
    decision_.made();
    if (from_map) adjust_last_keyframes(camera_, matcher_.octaves(), kAdjustedKeyframes, map_, marks_, adjustment_);
    seen_.clear();
    for (int l : map_.keyframe(k).landmark)
      if (l >= 0) {
        map_.refresh(l, matcher_.octaves());
        seen_.push_back(l);
      }
    while (map_.living_keyframes() > options_.max_keyframes) map_.forget_keyframe(map_.first_keyframe());
    return map_.keyframe(k).T_world_camera;
  }

  Pinhole camera_;
  LandmarkTrackerOptions options_;
  LocalMap map_;  // the part that the camera is in
  MapParts parts_;
  LoopClosing loops_;
  PassMarks marks_;
  AdjustmentBuffers adjustment_;
  LandmarkMatcher matcher_;
  KeyframeDecision decision_;
  TrackMotion motion_;
  WeightedFeatures features_;
  std::vector<int> seen_;  // landmarks of the previous frame

  bool begun_ = false;
  int frame_number_ = 0;
  double timestamp_ = 0;
  double previous_timestamp_ = 0;
  double relocalised_at_ = -1e300;
  double step_time_ = 0;
  Pose step_ = identity_pose();
  Pose T_world_previous_ = identity_pose();
  Pose T_world_predicted_ = identity_pose();

  // of the last estimate
  bool ok_ = false;
  bool from_tracks_ = false;
  bool relocalised_ = false;
  int track_inliers_ = 0;
  bool lost_ = false;    // neither features nor a sure pose told where the frame before was: tracks from there lead to no place
  int misses_ = 0;       // frames in a row without a pose from the map
  bool placed_ = false;  // by the map, and trusted
};

using LandmarkTracker = BasicLandmarkTracker<>;

APSO_NAMESPACE_END
