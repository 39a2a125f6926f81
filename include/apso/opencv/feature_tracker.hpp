/// \file
/// A feature-based RGB-D tracker: ORB features against a local map of landmarks, Lucas-Kanade tracks for the motion
/// from frame to frame, windowed bundle adjustment at keyframes. No loop closure.
///
/// It gives the pipeline its keypoints, its point tracks and T_feature.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/opencv/descriptor_matching.hpp>
#include <apso/opencv/lk_tracker.hpp>
#include <apso/opencv/local_map.hpp>
#include <apso/opencv/orb_front_end.hpp>
#include <apso/tracker/pose_optimisation.hpp>
#include <apso/tracker/windowed_adjustment.hpp>
#include <apso/options.hpp>
#include <apso/status.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

struct FeatureTrackerOptions {
  OrbOptions orb;
  LkOptions lk;
  PoseOptimisationOptions pose;
  DepthRange depth{0.3F, 8.0F};       ///< depth used at keypoints [m]
  double landmark_depth = 5.0;        ///< landmarks are created up to here [m]
  double inverse_depth_sigma = 0.003; ///< of a depth measurement: noise, registration, time offset [1/m]
  double masked = 0.5;                ///< features at least this likely to be dynamic are not used
  int window_keyframes = 10;          ///< of the local map; as many again that see the same landmarks
  int adjusted_keyframes = 6;         ///< poses refined by bundle adjustment at a new keyframe; 0 = none
  int adjustment_iterations = 4;      ///<
  int least_inliers = 30;             ///< of the local map, for a valid pose
  int least_inliers_relocalised = 50; ///< within relocalised_for of a relocalisation
  double relocalised_for = 1.0;       ///< [s]
  int least_track_inliers = 15;       ///< tracks that must agree to carry the pose where the map fails
  int most_frames_on_tracks = 15;     ///< frames in a row that tracks may carry it; errors add up
  double keyframe_interval = 1.0;     ///< a keyframe is due after this time [s]
  double keyframe_share = 0.75;       ///< ... or when inliers fall below this share of the most since the last
  int max_keyframes = 300;            ///< older ones are forgotten
  std::uint64_t seed = 1;             ///< of RANSAC
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("orb", s.orb);
    v("lk", s.lk);
    v("pose", s.pose);
    v("depth", s.depth);
    v("landmark_depth", s.landmark_depth, 0.1, 1000.0);
    v("inverse_depth_sigma", s.inverse_depth_sigma, 1e-6, 1.0);
    v("masked", s.masked, 0.01, 1.0);
    v("window_keyframes", s.window_keyframes, 1, 100);
    v("adjusted_keyframes", s.adjusted_keyframes, 0, 50);
    v("adjustment_iterations", s.adjustment_iterations, 1, 100);
    v("least_inliers", s.least_inliers, 3, 10000);
    v("least_inliers_relocalised", s.least_inliers_relocalised, 3, 10000);
    v("relocalised_for", s.relocalised_for, 0.0, 1000.0);
    v("least_track_inliers", s.least_track_inliers, 3, 10000);
    v("most_frames_on_tracks", s.most_frames_on_tracks, 0, 1000000);
    v("keyframe_interval", s.keyframe_interval, 0.0, 1000.0);
    v("keyframe_share", s.keyframe_share, 0.0, 1.0);
    v("max_keyframes", s.max_keyframes, 2, 100000);
    v("seed", s.seed, std::uint64_t{0}, ~std::uint64_t{0});
  }
};

/// What FeatureTracker::estimate found.
struct FeatureResult {
  Status status = Status::NotRun;
  bool ok = false;                                 ///< the pose may be used
  Pose T_world_camera = Pose::Identity();          ///< the prediction when not ok
  int matches = 0;                                 ///< landmarks paired with keypoints
  int inliers = 0;                                 ///< of them, after optimisation
  Pose T_world_predicted = Pose::Identity();       ///< constant velocity, or the motion of the tracks where they agree
  int track_inliers = 0;                           ///< tracks that agree with the predicted motion
  bool relocalised = false;                        ///< found again among the keyframes
  bool from_tracks = false;                        ///< the map failed; the pose is the last one moved along the tracks
  Matrix6 information = Matrix6::Zero();           ///< of the twist that multiplies T_camera_world from the left
};

/// Use per frame: begin, estimate (once or more), commit.
class FeatureTracker {
 public:
  explicit FeatureTracker(const Pinhole& camera, const FeatureTrackerOptions& options = {})
      : camera_(camera), options_(options), orb_(options.orb), lk_(options.lk) {
    camera_.validate();
    validate(options_, "tracker");
  }

  /// Extracts features and follows the tracks. The views of `frame` are not used after this call.
  /// \param gray8 8-bit grey image of the size of the camera
  void begin(const cv::Mat& gray8, const RgbdFrame& frame) {
    expects(gray8.type() == CV_8UC1, "FeatureTracker::begin: the grey image must be CV_8UC1");
    expects(gray8.cols == camera_.width && gray8.rows == camera_.height,
            "FeatureTracker::begin: the grey image must have the size of the camera");
    expects(frame.depth.width == camera_.width && frame.depth.height == camera_.height,
            "FeatureTracker::begin: the depth image must have the size of the camera");
    timestamp_ = frame.timestamp;
    orb_.extract(gray8, features_.keypoints, features_.descriptors);
    lk_.track(gray8, features_.keypoints);
    grid_.build(features_.keypoints, camera_.width, camera_.height);
    const std::size_t n = features_.keypoints.size();
    features_.inverse_depth.resize(n);
    features_.inverse_depth_sigma.resize(n);
    for (std::size_t i = 0; i < n; ++i)
      std::tie(features_.inverse_depth[i], features_.inverse_depth_sigma[i]) =
          measure_depth(frame.depth, features_.keypoints[i].x, features_.keypoints[i].y);
    const std::vector<PointTrack>& tracks = lk_.tracks();
    std::swap(previous_track_depth_, track_depth_);
    track_depth_.clear();
    for (const PointTrack& t : tracks) {
      TrackDepth d;
      d.id = t.id;
      std::tie(d.inverse_depth, d.sigma) = measure_depth(frame.depth, t.x, t.y);
      track_depth_.push_back(d);
    }
    // Tracks keep their order, so the previous depth of each is found in one pass.
    previous_of_track_.assign(tracks.size(), TrackDepth{});
    std::size_t j = 0;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      while (j < previous_track_depth_.size() && previous_track_depth_[j].id < tracks[i].id) ++j;
      if (j < previous_track_depth_.size() && previous_track_depth_[j].id == tracks[i].id)
        previous_of_track_[i] = previous_track_depth_[j];
    }
    begun_ = true;
    ++frame_number_;
    T_world_predicted_ = frame_number_ == 1 ? Pose::Identity() : normalized(T_world_previous_ * velocity());
  }

  [[nodiscard]] const std::vector<Keypoint>& keypoints() const { return features_.keypoints; }
  [[nodiscard]] const std::vector<PointTrack>& tracks() const { return lk_.tracks(); }

  /// Pose of the frame begun. May be called again with a better mask.
  /// \param dynamic_probability [0,1], of the frame's size; empty = nothing is dynamic
  FeatureResult estimate(ImageView<const float> dynamic_probability) {
    expects(begun_, "FeatureTracker::estimate: call begin first");
    check_mask(dynamic_probability);
    weigh(dynamic_probability);
    FeatureResult result;
    matches_.clear();
    if (map_.living_keyframes() == 0) {  // nothing to compare with: this frame defines the world
      result.ok = with_depth_ >= options_.least_inliers;
      result.status = result.ok ? Status::Converged : Status::TooFewMatches;
      result.T_world_camera = result.T_world_predicted = T_world_predicted_;
      result_ = result;
      return result;
    }
    result.track_inliers = predict_from_tracks();
    result.T_world_predicted = T_world_predicted_;
    result.T_world_camera = T_world_predicted_;
    result.status = Status::TooFewMatches;
    collect_local_landmarks();

    Pose guess = T_world_predicted_;
    for (double radius : {15.0, 30.0}) {
      project_and_match(guess, radius);
      if (static_cast<int>(matches_.size()) >= 20 && solve(guess, result)) {
        // once more with everything that projects close to the refined pose
        project_and_match(result.T_world_camera, 8.0);
        const Pose refined = result.T_world_camera;
        solve(refined, result);
      }
      if (accepted(result)) break;
    }
    if (!accepted(result)) relocalise(result);
    result.ok = accepted(result);
    if (!result.ok) {
      result.T_world_camera = T_world_predicted_;
      if (succeeded(result.status)) result.status = Status::TooFewMatches;
      if (result.track_inliers >= options_.least_track_inliers && misses_ < options_.most_frames_on_tracks) {
        result.ok = result.from_tracks = true;
        result.status = Status::Converged;
      }
    }
    result_ = result;
    return result;
  }

  /// Ends the frame with its final pose.
  /// \param allow_keyframe false on frames that are not trusted: the map stays as it is
  void commit(const Pose& T_world_camera, ImageView<const float> dynamic_probability, bool allow_keyframe) {
    expects(begun_, "FeatureTracker::commit: call begin first");
    expects(is_finite(T_world_camera), "FeatureTracker::commit: the pose is not finite");
    check_mask(dynamic_probability);
    begun_ = false;
    weigh(dynamic_probability);
    Pose T = normalized(T_world_camera);
    const bool from_map = result_.ok && !result_.from_tracks;
    misses_ = from_map ? 0 : misses_ + 1;
    const bool trusted = from_map || map_.living_keyframes() == 0;
    if (result_.relocalised && result_.ok) relocalised_at_ = timestamp_;
    if (allow_keyframe && trusted) {
      update_landmarks(T);
      if (keyframe_due()) T = insert_keyframe(T);
    }
    // Velocity of a frame found again says nothing.
    const double dt = timestamp_ - previous_timestamp_;
    if (frame_number_ > 1 && dt > 0 && !result_.relocalised) {
      step_ = inverse(T_world_previous_) * normalized(T_world_camera);
      step_time_ = dt;
      // What was only predicted fades: a camera that is lost is sooner found near the place where it was seen last.
      const bool guessed = !result_.ok && (T_world_camera.matrix() - T_world_predicted_.matrix()).norm() < 1e-9;
      if (guessed) step_ = se3_exp(Twist(0.8 * se3_log(step_)));
    } else {
      step_ = Pose::Identity();
      step_time_ = 0;
    }
    T_world_previous_ = T;
    previous_timestamp_ = timestamp_;
    T_world_predicted_ = T;
  }

  /// Where the camera is expected: by constant velocity after begin, refined by the tracks after estimate.
  [[nodiscard]] Pose predicted() const { return T_world_predicted_; }
  [[nodiscard]] int keyframes() const { return map_.living_keyframes(); }
  [[nodiscard]] int landmarks() const { return map_.living_landmarks(); }
  [[nodiscard]] const LocalMap& map() const { return map_; }

 private:
  struct Match {
    int landmark;
    int feature;
    bool inlier;
  };
  struct TrackDepth {
    std::int64_t id = -1;
    float inverse_depth = 0;
    float sigma = 1;
  };
  struct LocalLandmark {
    int landmark;
    double u, v;    // projection
    int feature;    // matched
    bool inside;
  };

  void check_mask(ImageView<const float> mask) const {
    expects(mask.empty() || (mask.width == camera_.width && mask.height == camera_.height),
            "FeatureTracker: the mask must be empty or have the size of the camera");
  }

  [[nodiscard]] double level_sigma(int octave) const { return std::pow(options_.orb.scale_factor, octave); }

  /// Inverse depth at a pixel and its deviation, larger where the surface jumps.
  [[nodiscard]] std::pair<float, float> measure_depth(ImageView<const float> depth, float x, float y) const {
    const int cx = std::clamp(static_cast<int>(x + 0.5F), 0, depth.width - 1);
    const int cy = std::clamp(static_cast<int>(y + 0.5F), 0, depth.height - 1);
    const float z = depth(cx, cy);
    if (!depth_valid(z, options_.depth)) return {0.0F, 1.0F};
    const float inverse = 1.0F / z;
    float lowest = inverse;
    float highest = inverse;
    for (int dy = -2; dy <= 2; dy += 2)
      for (int dx = -2; dx <= 2; dx += 2) {
        const int px = cx + dx;
        const int py = cy + dy;
        if (px < 0 || py < 0 || px >= depth.width || py >= depth.height) continue;
        const float q = depth(px, py);
        if (!depth_valid(q, options_.depth)) continue;
        lowest = std::min(lowest, 1.0F / q);
        highest = std::max(highest, 1.0F / q);
      }
    const auto base = static_cast<float>(options_.inverse_depth_sigma);
    const float jump = std::max(0.0F, highest - lowest - base);
    return {inverse, std::sqrt(base * base + 0.25F * jump * jump)};
  }

  [[nodiscard]] static float sample(ImageView<const float> mask, float x, float y) {
    if (mask.empty()) return 0.0F;
    const int cx = std::clamp(static_cast<int>(x + 0.5F), 0, mask.width - 1);
    const int cy = std::clamp(static_cast<int>(y + 0.5F), 0, mask.height - 1);
    const float p = mask(cx, cy);
    return p >= 0.0F && p <= 1.0F ? p : 1.0F;  // an undefined probability is not trusted
  }

  [[nodiscard]] float static_weight(ImageView<const float> mask, float x, float y) const {
    const float p = sample(mask, x, y);
    return static_cast<double>(p) >= options_.masked ? 0.0F : 1.0F - p;
  }

  void weigh(ImageView<const float> mask) {
    weight_.resize(features_.keypoints.size());
    with_depth_ = 0;
    for (std::size_t i = 0; i < weight_.size(); ++i) {
      weight_[i] = static_weight(mask, features_.keypoints[i].x, features_.keypoints[i].y);
      if (weight_[i] > 0 && features_.inverse_depth[i] > 0) ++with_depth_;
    }
    const std::vector<PointTrack>& tracks = lk_.tracks();
    track_weight_.resize(tracks.size());
    for (std::size_t i = 0; i < tracks.size(); ++i) track_weight_[i] = static_weight(mask, tracks[i].x, tracks[i].y);
  }

  [[nodiscard]] Pose velocity() const {
    if (step_time_ <= 0) return Pose::Identity();
    const double s = std::clamp((timestamp_ - previous_timestamp_) / step_time_, 0.0, 3.0);
    return se3_exp(Twist(s * se3_log(step_)));
  }

  /// Motion since the previous frame from the tracks with depth; replaces the prediction when most of them agree.
  int predict_from_tracks() {
    const std::vector<PointTrack>& tracks = lk_.tracks();
    observations_.clear();
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      if (tracks[i].age < 1 || track_weight_[i] <= 0 || !(previous_of_track_[i].inverse_depth > 0)) continue;
      PointObservation o;
      o.point = T_world_previous_ * camera_.unproject(tracks[i].previous_x, tracks[i].previous_y,
                                                      1.0 / static_cast<double>(previous_of_track_[i].inverse_depth));
      o.u = tracks[i].x;
      o.v = tracks[i].y;
      o.inverse_depth = track_depth_[i].inverse_depth;
      o.inverse_depth_sigma = std::hypot(track_depth_[i].sigma, previous_of_track_[i].sigma);
      o.weight = track_weight_[i];
      observations_.push_back(o);
    }
    if (observations_.size() < 12) return 0;
    RansacOptions ransac;
    ransac.threshold = 1.0;
    ransac.iterations = 150;
    ransac.seed = options_.seed + static_cast<std::uint64_t>(frame_number_);
    const RansacPose found =
        ransac_pose(camera_, observations_, {normalized(T_world_previous_ * velocity()), T_world_previous_}, ransac);
    if (!found.ok || found.inliers < 12) return 0;
    const PoseOptimisation refined = optimise_pose(camera_, observations_, found.T_world_camera, options_.pose);
    if (!succeeded(refined.status) || refined.inliers * 3 < static_cast<int>(observations_.size())) return 0;
    T_world_predicted_ = refined.T_world_camera;
    return refined.inliers;
  }

  /// Landmarks of the last keyframes and of those that share landmarks with the previous frame.
  void collect_local_landmarks() {
    const int last = map_.last_keyframe();
    local_keyframes_.clear();
    for (int k = last; k >= 0 && static_cast<int>(local_keyframes_.size()) < options_.window_keyframes; --k)
      if (map_.keyframe(k).alive) local_keyframes_.push_back(k);
    shared_.assign(map_.keyframes().size(), 0);
    for (int l : previous_landmarks_)
      if (map_.landmark(l).alive)
        for (const LandmarkView& v : map_.landmark(l).views) ++shared_[static_cast<std::size_t>(v.keyframe)];
    for (int k : local_keyframes_) shared_[static_cast<std::size_t>(k)] = 0;
    for (int i = 0; i < options_.window_keyframes; ++i) {
      const auto most = std::max_element(shared_.begin(), shared_.end());
      if (most == shared_.end() || *most < 10) break;
      local_keyframes_.push_back(static_cast<int>(most - shared_.begin()));
      *most = 0;
    }
    local_.clear();
    stamp_.resize(map_.landmarks().size(), 0);
    ++stamp_now_;
    for (int k : local_keyframes_)
      for (int l : map_.keyframe(k).landmark) {
        if (l < 0 || stamp_[static_cast<std::size_t>(l)] == stamp_now_) continue;
        stamp_[static_cast<std::size_t>(l)] = stamp_now_;
        local_.push_back({l, 0, 0, -1, false});
      }
  }

  /// Pairs local landmarks with keypoints near their projections.
  void project_and_match(const Pose& T_world_camera, double radius) {
    const Pose T = inverse(T_world_camera);
    const Eigen::Vector3d centre = T_world_camera.translation();
    const double log_scale = std::log(options_.orb.scale_factor);
    taken_.assign(features_.keypoints.size(), {-1, 257});
    turns_.clear();
    for (std::size_t i = 0; i < local_.size(); ++i) {
      LocalLandmark& entry = local_[i];
      entry.feature = -1;
      entry.inside = false;
      const Landmark& l = map_.landmark(entry.landmark);
      const Eigen::Vector3d p = T * l.point;
      if (p.z() < 0.1) continue;
      const Eigen::Vector2d uv = camera_.project(p);
      if (!camera_.contains(uv.x(), uv.y(), 16)) continue;
      const Eigen::Vector3d ray = centre - l.point;
      const double distance = ray.norm();
      if (ray.dot(l.direction) < 0.5 * distance) continue;  // seen from more than 60 degrees elsewhere
      const double exact_level = std::log(std::max(1e-6, l.unit_distance / distance)) / log_scale;
      const int level = static_cast<int>(std::lround(exact_level));
      if (level < -1 || level > options_.orb.levels) continue;
      entry.u = uv.x();
      entry.v = uv.y();
      entry.inside = true;
      const double r = radius * std::min(2.0, level_sigma(std::clamp(level, 0, 3)));
      int best = 257;
      int second = 257;
      int best_feature = -1;
      int best_octave = -1;
      int second_octave = -1;
      grid_.near(uv.x(), uv.y(), r, [&](int f) {
        const auto fi = static_cast<std::size_t>(f);
        if (weight_[fi] <= 0) return;
        const Keypoint& k = features_.keypoints[fi];
        if (k.octave < level - 1 || k.octave > level + 1) return;
        const double du = static_cast<double>(k.x) - uv.x();
        const double dv = static_cast<double>(k.y) - uv.y();
        if (du * du + dv * dv > r * r) return;
        const float inverse_depth = features_.inverse_depth[fi];
        if (inverse_depth > 0 && std::abs(static_cast<double>(inverse_depth) - 1 / p.z()) > 0.15) return;
        const int d = hamming(l.descriptor.data(), features_.descriptors.ptr<uchar>(f));
        if (d < best) {
          second = best;
          second_octave = best_octave;
          best = d;
          best_octave = k.octave;
          best_feature = f;
        } else if (d < second) {
          second = d;
          second_octave = k.octave;
        }
      });
      if (best_feature < 0 || best > (radius > 10 ? 80 : 100)) continue;
      if (best_octave == second_octave && best > 0.9 * second) continue;
      std::pair<int, int>& owner = taken_[static_cast<std::size_t>(best_feature)];
      if (best < owner.second) {
        if (owner.first >= 0) local_[static_cast<std::size_t>(owner.first)].feature = -1;
        owner = {static_cast<int>(i), best};
        entry.feature = best_feature;
      }
    }
    matches_.clear();
    for (const LocalLandmark& entry : local_) {
      if (entry.feature < 0) continue;
      matches_.push_back({entry.landmark, entry.feature, true});
      turns_.push_back(map_.landmark(entry.landmark).angle -
                       features_.keypoints[static_cast<std::size_t>(entry.feature)].angle);
    }
    if (radius > 10) keep_consistent_turns();
  }

  void keep_consistent_turns() {
    const std::vector<char> keep = rotation_consistent(turns_);
    std::size_t n = 0;
    for (std::size_t i = 0; i < matches_.size(); ++i)
      if (keep[i]) matches_[n++] = matches_[i];
    matches_.resize(n);
  }

  void observe_matches() {
    observations_.clear();
    for (const Match& m : matches_) observations_.push_back(observe(features_, m.feature, map_.landmark(m.landmark).point,
                                                                    weight_[static_cast<std::size_t>(m.feature)]));
  }

  [[nodiscard]] PointObservation observe(const FeatureSet& set, int feature, const Eigen::Vector3d& point,
                                         float weight) const {
    const auto f = static_cast<std::size_t>(feature);
    PointObservation o;
    o.point = point;
    o.u = set.keypoints[f].x;
    o.v = set.keypoints[f].y;
    o.inverse_depth = set.inverse_depth[f];
    o.sigma = level_sigma(set.keypoints[f].octave);
    o.inverse_depth_sigma = set.inverse_depth_sigma[f];
    o.weight = weight;
    return o;
  }

  bool solve(const Pose& guess, FeatureResult& result) {
    observe_matches();
    const PoseOptimisation found = optimise_pose(camera_, observations_, guess, options_.pose);
    result.matches = static_cast<int>(matches_.size());
    result.status = found.status;
    result.inliers = succeeded(found.status) ? found.inliers : 0;
    if (!succeeded(found.status)) return false;
    result.T_world_camera = found.T_world_camera;
    result.information = found.information;
    for (std::size_t i = 0; i < matches_.size(); ++i) matches_[i].inlier = observations_[i].inlier;
    return true;
  }

  [[nodiscard]] bool accepted(const FeatureResult& result) const {
    if (!succeeded(result.status)) return false;
    const bool recently = result.relocalised || timestamp_ - relocalised_at_ < options_.relocalised_for;
    return result.inliers >= (recently ? options_.least_inliers_relocalised : options_.least_inliers);
  }

  /// Compares with whole keyframes, the most recent first and then spread over the past, by descriptor alone.
  void relocalise(FeatureResult& result) {
    int tried = 0;
    int stride = 1;
    for (int k = map_.last_keyframe(); k >= 0 && tried < 12; k -= stride) {
      if (!map_.keyframe(k).alive) continue;
      ++tried;
      if (tried >= 6) stride = std::max(1, map_.last_keyframe() / 8);
      if (!match_keyframe(k)) continue;
      observe_matches();
      RansacOptions ransac;
      ransac.seed = options_.seed + static_cast<std::uint64_t>(frame_number_);
      const RansacPose found = ransac_pose(camera_, observations_, {T_world_predicted_}, ransac);
      if (!found.ok || found.inliers < 12) continue;
      FeatureResult attempt = result;
      if (!solve(found.T_world_camera, attempt) || attempt.inliers < 10) continue;
      // Gather what the neighbourhood of that keyframe knows, and solve again.
      previous_landmarks_.clear();
      for (int l : map_.keyframe(k).landmark)
        if (l >= 0) previous_landmarks_.push_back(l);
      collect_local_landmarks();
      for (double radius : {15.0, 8.0}) {
        project_and_match(attempt.T_world_camera, radius);
        if (matches_.size() < 10) break;
        const Pose start = attempt.T_world_camera;
        if (!solve(start, attempt)) break;
      }
      attempt.relocalised = k != map_.last_keyframe() || misses_ > 0;
      if (accepted(attempt)) {
        result = attempt;
        return;
      }
    }
  }

  bool match_keyframe(int index) {
    const Keyframe& k = map_.keyframe(index);
    taken_.assign(features_.keypoints.size(), {-1, 257});
    matches_.clear();
    turns_.clear();
    for (std::size_t i = 0; i < k.landmark.size(); ++i) {
      if (k.landmark[i] < 0) continue;
      const uchar* descriptor = k.features.descriptors.ptr<uchar>(static_cast<int>(i));
      int best = 257;
      int second = 257;
      int best_feature = -1;
      for (std::size_t f = 0; f < features_.keypoints.size(); ++f) {
        if (weight_[f] <= 0) continue;
        const int d = hamming(descriptor, features_.descriptors.ptr<uchar>(static_cast<int>(f)));
        if (d < best) {
          second = best;
          best = d;
          best_feature = static_cast<int>(f);
        } else if (d < second) {
          second = d;
        }
      }
      if (best_feature < 0 || best > 60 || best > 0.8 * second) continue;
      std::pair<int, int>& owner = taken_[static_cast<std::size_t>(best_feature)];
      if (best < owner.second) owner = {static_cast<int>(i), best};
    }
    for (std::size_t f = 0; f < taken_.size(); ++f) {
      if (taken_[f].first < 0) continue;
      const auto i = static_cast<std::size_t>(taken_[f].first);
      matches_.push_back({k.landmark[i], static_cast<int>(f), true});
      turns_.push_back(k.features.keypoints[i].angle - features_.keypoints[f].angle);
    }
    keep_consistent_turns();
    return matches_.size() >= 15;
  }

  /// Which landmarks were seen, which should have been; the unreliable ones go.
  void update_landmarks(const Pose& T_world_camera) {
    if (map_.living_keyframes() == 0) return;
    observe_matches();
    classify(camera_, observations_, T_world_camera);
    inliers_now_ = 0;
    previous_landmarks_.clear();
    stamp_.resize(map_.landmarks().size(), 0);
    ++stamp_now_;
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      matches_[i].inlier = observations_[i].inlier;
      if (!matches_[i].inlier) continue;
      ++inliers_now_;
      stamp_[static_cast<std::size_t>(matches_[i].landmark)] = stamp_now_;
      previous_landmarks_.push_back(matches_[i].landmark);
      ++map_.landmark(matches_[i].landmark).found;
      ++map_.landmark(matches_[i].landmark).visible;
    }
    for (const LocalLandmark& entry : local_) {
      Landmark& l = map_.landmark(entry.landmark);
      if (!l.alive || !entry.inside || stamp_[static_cast<std::size_t>(entry.landmark)] == stamp_now_) continue;
      if (masked_here(entry)) {
        if (lies_in_front(entry, T_world_camera)) ++l.on_dynamic;
      } else {
        ++l.visible;
      }
      const bool rarely = l.visible > 8 && l.found * 4 < l.visible;
      if (rarely || l.on_dynamic > 1) map_.kill(entry.landmark);
    }
  }

  [[nodiscard]] bool masked_here(const LocalLandmark& entry) const {
    bool masked = false;
    grid_.near(entry.u, entry.v, 4, [&](int f) {
      const auto fi = static_cast<std::size_t>(f);
      const double du = static_cast<double>(features_.keypoints[fi].x) - entry.u;
      const double dv = static_cast<double>(features_.keypoints[fi].y) - entry.v;
      if (du * du + dv * dv < 16 && weight_[fi] <= 0) masked = true;
    });
    return masked;
  }

  /// The landmark lies on the masked thing itself, not behind it.
  [[nodiscard]] bool lies_in_front(const LocalLandmark& entry, const Pose& T_world_camera) const {
    const Eigen::Vector3d p = inverse(T_world_camera) * map_.landmark(entry.landmark).point;
    bool same = false;
    grid_.near(entry.u, entry.v, 4, [&](int f) {
      const auto fi = static_cast<std::size_t>(f);
      const float inverse_depth = features_.inverse_depth[fi];
      if (weight_[fi] <= 0 && inverse_depth > 0 && std::abs(1 / p.z() - static_cast<double>(inverse_depth)) < 0.03)
        same = true;
    });
    return same;
  }

  [[nodiscard]] bool keyframe_due() {
    if (map_.living_keyframes() == 0) return with_depth_ >= options_.least_inliers;
    most_inliers_ = std::max(most_inliers_, inliers_now_);
    if (inliers_now_ < 15) return false;
    if (static_cast<double>(inliers_now_) < options_.keyframe_share * most_inliers_) return true;
    if (timestamp_ - map_.keyframe(map_.last_keyframe()).timestamp > options_.keyframe_interval) return true;
    int close_tracked = 0;
    for (const Match& m : matches_)
      if (m.inlier && is_close(m.feature)) ++close_tracked;
    int close = 0;
    for (std::size_t f = 0; f < weight_.size(); ++f)
      if (weight_[f] > 0 && is_close(static_cast<int>(f))) ++close;
    return close_tracked < 100 && close - close_tracked > 70;
  }

  [[nodiscard]] bool is_close(int feature) const {
    const float inverse_depth = features_.inverse_depth[static_cast<std::size_t>(feature)];
    return inverse_depth > 0 && static_cast<double>(inverse_depth) * 3.0 > 1.0;
  }

  /// \return the pose of the new keyframe after bundle adjustment
  Pose insert_keyframe(const Pose& T_world_camera) {
    const int k = map_.add_keyframe(timestamp_, T_world_camera, features_);
    most_inliers_ = 0;
    for (const Match& m : matches_)
      if (m.inlier && map_.landmark(m.landmark).alive) map_.add_view(m.landmark, k, m.feature);
    // Keypoints next to a landmark already seen would only repeat it.
    for (std::size_t f = 0; f < weight_.size(); ++f) {
      if (map_.keyframe(k).landmark[f] >= 0 || weight_[f] <= 0) continue;
      const float inverse_depth = features_.inverse_depth[f];
      if (!(inverse_depth > 0) || 1.0 / static_cast<double>(inverse_depth) > options_.landmark_depth) continue;
      if (static_cast<double>(features_.inverse_depth_sigma[f]) > 5 * options_.inverse_depth_sigma) continue;
      map_.add_landmark(camera_, k, static_cast<int>(f), frame_number_);
    }
    if (options_.adjusted_keyframes > 0) adjust_window();
    previous_landmarks_.clear();
    for (int l : map_.keyframe(k).landmark)
      if (l >= 0) {
        map_.refresh(l, options_.orb.scale_factor);
        previous_landmarks_.push_back(l);
      }
    for (int old = 0; map_.living_keyframes() > options_.max_keyframes; ++old) map_.forget_keyframe(old);
    return map_.keyframe(k).T_world_camera;
  }

  /// Refines the last keyframes and what they see; keyframes outside the window that see the same stay fixed.
  void adjust_window() {
    AdjustmentProblem problem;
    std::vector<int> pose_of(map_.keyframes().size(), -1);
    std::vector<int> keyframe_of;
    const auto take = [&](int k, bool fixed) {
      pose_of[static_cast<std::size_t>(k)] = static_cast<int>(keyframe_of.size());
      keyframe_of.push_back(k);
      problem.T_camera_world.push_back(inverse(map_.keyframe(k).T_world_camera));
      problem.fixed.push_back(fixed ? 1 : 0);
    };
    for (int k = map_.last_keyframe(); k >= 0 && static_cast<int>(keyframe_of.size()) < options_.adjusted_keyframes; --k)
      if (map_.keyframe(k).alive) take(k, k == 0);
    if (keyframe_of.size() < 2) return;
    const std::size_t window = keyframe_of.size();
    std::vector<int> points;
    std::vector<int> single;
    stamp_.resize(map_.landmarks().size(), 0);
    ++stamp_now_;
    for (std::size_t w = 0; w < window; ++w)
      for (int l : map_.keyframe(keyframe_of[w]).landmark) {
        if (l < 0 || stamp_[static_cast<std::size_t>(l)] == stamp_now_) continue;
        stamp_[static_cast<std::size_t>(l)] = stamp_now_;
        (map_.landmark(l).views.size() > 1 ? points : single).push_back(l);
      }
    bool anchored = problem.fixed[window - 1] != 0;
    for (int l : points) {
      const Landmark& landmark = map_.landmark(l);
      AdjustmentProblem::Point point;
      point.point = landmark.point;
      point.first = static_cast<int>(problem.views.size());
      for (const LandmarkView& v : landmark.views) {
        if (pose_of[static_cast<std::size_t>(v.keyframe)] < 0) {
          take(v.keyframe, true);
          anchored = true;
        }
        AdjustmentProblem::View view;
        view.pose = pose_of[static_cast<std::size_t>(v.keyframe)];
        view.observation = observe(map_.keyframe(v.keyframe).features, v.feature, landmark.point, 1.0F);
        problem.views.push_back(view);
        ++point.count;
      }
      problem.points.push_back(point);
    }
    if (!anchored) problem.fixed[window - 1] = 1;
    if (!succeeded(adjust(camera_, problem, options_.adjustment_iterations).status)) return;
    for (std::size_t i = 0; i < keyframe_of.size(); ++i)
      if (!problem.fixed[i]) map_.keyframe(keyframe_of[i]).T_world_camera = inverse(problem.T_camera_world[i]);
    for (std::size_t i = 0; i < points.size(); ++i) {
      map_.landmark(points[i]).point = problem.points[i].point;
      for (int v = problem.points[i].first; v < problem.points[i].first + problem.points[i].count; ++v) {
        const AdjustmentProblem::View& view = problem.views[static_cast<std::size_t>(v)];
        if (!view.observation.inlier) map_.remove_view(points[i], keyframe_of[static_cast<std::size_t>(view.pose)]);
      }
    }
    for (int l : single) {  // a landmark with one view moves with its keyframe
      const LandmarkView& v = map_.landmark(l).views.front();
      const Keyframe& k = map_.keyframe(v.keyframe);
      const auto f = static_cast<std::size_t>(v.feature);
      if (k.features.inverse_depth[f] > 0)
        map_.landmark(l).point = k.T_world_camera * camera_.unproject(k.features.keypoints[f].x, k.features.keypoints[f].y,
                                                                      1.0 / static_cast<double>(k.features.inverse_depth[f]));
    }
  }

  Pinhole camera_;
  FeatureTrackerOptions options_;
  OrbFrontEnd orb_;
  LkTracker lk_;
  LocalMap map_;

  FeatureSet features_;
  KeypointGrid grid_;
  std::vector<float> weight_;
  std::vector<float> track_weight_;
  std::vector<TrackDepth> track_depth_;
  std::vector<TrackDepth> previous_track_depth_;
  std::vector<TrackDepth> previous_of_track_;
  int with_depth_ = 0;

  bool begun_ = false;
  int frame_number_ = 0;
  double timestamp_ = 0;
  double previous_timestamp_ = 0;
  double relocalised_at_ = -1e300;
  double step_time_ = 0;
  Pose step_ = Pose::Identity();
  Pose T_world_previous_ = Pose::Identity();
  Pose T_world_predicted_ = Pose::Identity();
  FeatureResult result_;

  std::vector<Match> matches_;
  std::vector<PointObservation> observations_;
  std::vector<LocalLandmark> local_;
  std::vector<int> local_keyframes_;
  std::vector<int> previous_landmarks_;
  std::vector<int> shared_;
  std::vector<int> stamp_;
  int stamp_now_ = 0;
  std::vector<std::pair<int, int>> taken_;
  std::vector<float> turns_;
  int inliers_now_ = 0;
  int most_inliers_ = 0;
  int misses_ = 0;
};

}  // namespace opencv
APSO_NAMESPACE_END
