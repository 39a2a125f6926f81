/// \file
/// Pairs of landmarks and keypoints: near the projections of the local map, or of a whole keyframe by descriptor alone.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/status.hpp>
#include <apso/tracker/descriptor_matching.hpp>
#include <apso/tracker/features.hpp>
#include <apso/tracker/map/local_map.hpp>
#include <apso/tracker/solvers/pose_optimisation.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// A landmark paired with a keypoint of the current image.
struct LandmarkMatch {
  int landmark;
  int feature;
  bool inlier;
};

/// A landmark of the local map and where it appears in the current image.
struct LocalLandmark {
  int landmark;
  double u, v;  ///< projection [px]
  int feature;  ///< matched, -1 = none
  bool inside;  ///< it should be visible
};

/// A pose found from landmarks.
struct MapPose {
  Status status = Status::NotRun;
  Pose T_world_camera = identity_pose();
  int matches = 0;
  int inliers = 0;
  int lasting = 0;                         ///< of them on landmarks that were seen again after the frame that made them
  Matrix6 information = zeros<Matrix6>();  ///< of the twist that multiplies T_camera_world from the left
  bool relocalised = false;                ///< found by comparing with whole keyframes
};

/// Landmarks in common that make two keyframes neighbours.
inline constexpr int kMinShared = 10;

/// Finds the landmarks that the current image shows. The thresholds on distances of descriptors are those of ORB-SLAM
/// (Mur-Artal et al., T-RO 2015), a little tighter where depth cannot help.
class LandmarkMatcher {
 public:
  LandmarkMatcher(const Pinhole& camera, const Octaves& octaves) : camera_(camera), octaves_(octaves) { local_.reserve(kUsual); }

  /// Chooses the local map: landmarks of the last keyframes and of those that share landmarks with the previous frame.
  /// \param seen landmarks of the previous frame
  /// \param window how many of the last keyframes, and how many others at most
  void collect(const LocalMap& map, const std::vector<int>& seen, int window) {
    keyframes_.clear();
    for (int k = map.last_keyframe(); k >= map.first_keyframe() && static_cast<int>(keyframes_.size()) < window; --k)
      if (map.keyframe(k).alive) keyframes_.push_back(k);
    add_sharing(map, seen, window, map.last_keyframe());
    add_landmarks(map);
  }

  /// Chooses landmarks of one place alone: of keyframes that share landmarks with those given.
  /// \param window how many keyframes at most
  /// \param newest none later than this one
  void collect_place(const LocalMap& map, const std::vector<int>& landmarks, int window, int newest) {
    keyframes_.clear();
    add_sharing(map, landmarks, window, newest);
    add_landmarks(map);
  }

  /// The same, and where the path comes back to a place, landmarks of keyframes that stood near the pose and looked the same way before
  /// it was left. What is seen there is on the map twice, and nothing is shared: the older landmarks undo the drift of the way round.
  void collect(const LocalMap& map, const std::vector<int>& seen, int window, const Pose& T_world_camera) {
    collect(map, seen, window);
    remoteness_.assign(map.kept_keyframes(), 1.0);
    const Pose T_camera_world = inverse(T_world_camera);
    bool left = false;
    for (int k = map.last_keyframe(); k >= map.first_keyframe(); --k) {
      if (!map.keyframe(k).alive) continue;
      const Pose T_camera_keyframe = compose(T_camera_world, map.keyframe(k).T_world_camera);
      const double remote = std::max(norm(translation(T_camera_keyframe)) / kNearby, rotation_angle(T_camera_keyframe) / kSameView);
      left = left || remote > kElsewhere;
      if (left) remoteness_[map.slot(k)] = remote;
    }
    for (int k : keyframes_) remoteness_[map.slot(k)] = 1.0;
    const std::size_t local = keyframes_.size();
    while (keyframes_.size() < local + kMaxNearby) {
      const auto nearest = std::min_element(remoteness_.begin(), remoteness_.end());
      if (nearest == remoteness_.end() || *nearest >= 1.0) break;
      keyframes_.push_back(map.first_keyframe() + static_cast<int>(nearest - remoteness_.begin()));
      *nearest = 1.0;
    }
    if (keyframes_.size() > local) add_landmarks(map);
  }

  /// Pairs local landmarks with keypoints near their projections.
  /// \param radius of the search at octave 0 [px]
  void match_projections(const LocalMap& map, const WeightedFeatures& features, const Pose& T_world_camera, double radius) {
    const Pose T_camera_world = inverse(T_world_camera);
    const Eigen::Vector3d centre = translation(T_world_camera);
    const double log_scale = std::log(octaves_.scale_factor);
    const int max_distance = radius > kNear ? 80 : 100;
    begin_matches(features);
    for (std::size_t i = 0; i < local_.size(); ++i) {
      LocalLandmark& entry = local_[i];
      entry.feature = -1;
      entry.inside = false;
      const MapLandmark& l = map.landmark(entry.landmark);
      const Eigen::Vector3d p = transform(T_camera_world, l.point);
      if (p.z() < 0.1) continue;
      const Eigen::Vector2d uv = camera_.project(p);
      if (!camera_.contains(uv.x(), uv.y(), kBorder)) continue;
      const Eigen::Vector3d ray = centre - l.point;
      const double distance = norm(ray);
      if (dot(ray, l.direction) < kMinCosine * distance) continue;
      const double exact_level = std::log(std::max(1e-6, l.unit_distance / distance)) / log_scale;
      const int level = static_cast<int>(std::lround(exact_level));
      if (level < -1 || level > octaves_.levels) continue;
      entry.u = uv.x();
      entry.v = uv.y();
      entry.inside = true;
      const double r = radius * std::min(2.0, octaves_.sigma(std::clamp(level, 0, 3)));
      const Nearest found = nearest(features, l, entry, level, r, 1 / p.z());
      if (found.feature < 0 || found.distance > max_distance) continue;
      if (found.octave == found.second_octave && found.distance > 0.9 * found.second) continue;
      claim(found.feature, static_cast<int>(i), found.distance);
    }
    for (const LocalLandmark& entry : local_) {
      if (entry.feature < 0) continue;
      matches_.push_back({entry.landmark, entry.feature, true});
      turns_.push_back(map.landmark(entry.landmark).angle - features.keypoints[static_cast<std::size_t>(entry.feature)].angle);
    }
    if (radius > kNear) keep_consistent_turns();
  }

  /// Pairs all landmarks of a keyframe with keypoints by descriptor alone.
  /// \return whether there are enough pairs to try a pose
  bool match_keyframe(const LocalMap& map, const WeightedFeatures& features, int keyframe) {
    const MapKeyframe& k = map.keyframe(keyframe);
    begin_matches(features);
    for (std::size_t i = 0; i < k.landmark.size(); ++i) {
      if (k.landmark[i] < 0) continue;
      const Descriptor& descriptor = k.features.descriptors[i];
      int best = kNoDistance;
      int second = kNoDistance;
      std::size_t best_feature = 0;
      for (std::size_t f = 0; f < features.keypoints.size(); ++f) {
        if (features.weight[f] <= 0) continue;
        const int d = hamming(descriptor, features.descriptors[f]);
        if (d < best) {
          second = best;
          best = d;
          best_feature = f;
        } else if (d < second) {
          second = d;
        }
      }
      if (best > 60 || best > 0.8 * second) continue;
      Owner& owner = owners_[best_feature];
      if (best < owner.distance) owner = {static_cast<int>(i), best};
    }
    for (std::size_t f = 0; f < owners_.size(); ++f) {
      if (owners_[f].index < 0) continue;
      const auto i = static_cast<std::size_t>(owners_[f].index);
      matches_.push_back({k.landmark[i], static_cast<int>(f), true});
      turns_.push_back(k.features.keypoints[i].angle - features.keypoints[f].angle);
    }
    keep_consistent_turns();
    return matches_.size() >= 15;
  }

  /// The pairs as observations of world points.
  std::vector<PointObservation>& observe(const LocalMap& map, const WeightedFeatures& features) {
    observations_.clear();
    for (const LandmarkMatch& m : matches_)
      observations_.push_back(observation_of(features, m.feature, map.landmark(m.landmark).point,
                                             features.weight[static_cast<std::size_t>(m.feature)], octaves_));
    return observations_;
  }

  /// The pose that the pairs agree on, and which of them do.
  /// \param[out] result unchanged but for status and counts when false is returned
  bool solve(const LocalMap& map, const WeightedFeatures& features, const Pose& guess, MapPose& result) {
    const PoseOptimisation found = optimise_pose(camera_, observe(map, features), guess);
    result.matches = static_cast<int>(matches_.size());
    result.status = found.status;
    result.inliers = succeeded(found.status) ? found.inliers : 0;
    if (!succeeded(found.status)) return false;
    result.T_world_camera = found.T_world_camera;
    result.information = found.information;
    result.lasting = 0;
    copy_inliers();
    for (const LandmarkMatch& m : matches_) result.lasting += m.inlier && map.landmark(m.landmark).found > 1 ? 1 : 0;
    return true;
  }

  /// Tells anew which pairs agree with a pose.
  void check(const LocalMap& map, const WeightedFeatures& features, const Pose& T_world_camera) {
    mark_inliers(camera_, observe(map, features), T_world_camera);
    copy_inliers();
  }

  void clear() { matches_.clear(); }
  [[nodiscard]] const std::vector<LandmarkMatch>& matches() const { return matches_; }
  [[nodiscard]] const std::vector<LocalLandmark>& local() const { return local_; }
  [[nodiscard]] const Pinhole& camera() const { return camera_; }
  [[nodiscard]] const Octaves& octaves() const { return octaves_; }

 private:
  /// Of the keyframes up to `newest`, those that share most with the landmarks given.
  void add_sharing(const LocalMap& map, const std::vector<int>& landmarks, int window, int newest) {
    shared_.assign(map.kept_keyframes(), 0);
    for (int l : landmarks)
      if (map.landmark(l).alive)
        for (const LandmarkView& v : map.landmark(l).views) shared_[map.slot(v.keyframe)] += v.keyframe <= newest ? 1 : 0;
    for (int k : keyframes_) shared_[map.slot(k)] = 0;
    for (int i = 0; i < window; ++i) {
      const auto most = std::max_element(shared_.begin(), shared_.end());
      if (most == shared_.end() || *most < kMinShared) break;
      keyframes_.push_back(map.first_keyframe() + static_cast<int>(most - shared_.begin()));
      *most = 0;
    }
  }
  void add_landmarks(const LocalMap& map) {
    local_.clear();
    taken_landmarks_.begin(map.landmarks().size());
    for (int k : keyframes_)
      for (int l : map.keyframe(k).landmark)
        if (l >= 0 && taken_landmarks_.mark(l)) local_.push_back({l, 0, 0, -1, false});
  }

  static constexpr std::size_t kUsual = 4096;       // room for so many landmarks of the local map from the beginning
  static constexpr std::size_t kMaxNearby = 5;      // keyframes that share nothing with what is seen
  static constexpr double kNearby = 0.5;            // [m]
  static constexpr double kSameView = 0.5;          // [rad]
  static constexpr double kElsewhere = 2;           // times as far off: 1 m or 57 degrees
  static constexpr double kNear = 10;               // a search radius up to this is a search around a pose that is known [px]
  static constexpr double kBorder = 16;             // descriptors need this much of the image [px]
  static constexpr double kMinCosine = 0.5;         // seen from more than 60 degrees elsewhere a point looks different
  static constexpr double kMaxInverseDepth = 0.15;  // difference of a landmark and a keypoint that may be the same [1/m]
  static constexpr int kNoDistance = 257;

  struct Nearest {
    int feature = -1;
    int distance = kNoDistance;
    int second = kNoDistance;
    int octave = -1;
    int second_octave = -1;
  };
  struct Owner {
    int index = -1;
    int distance = kNoDistance;
  };

  void begin_matches(const WeightedFeatures& features) {
    owners_.assign(features.keypoints.size(), Owner{});
    matches_.clear();
    turns_.clear();
  }

  [[nodiscard]] static Nearest nearest(const WeightedFeatures& features, const MapLandmark& l, const LocalLandmark& at, int level,
                                       double radius, double inverse_depth) {
    Nearest best;
    features.grid.near(at.u, at.v, radius, [&](int f) {
      const auto fi = static_cast<std::size_t>(f);
      if (features.weight[fi] <= 0) return;
      const Keypoint& k = features.keypoints[fi];
      if (k.octave < level - 1 || k.octave > level + 1) return;
      const double du = static_cast<double>(k.x) - at.u;
      const double dv = static_cast<double>(k.y) - at.v;
      if (du * du + dv * dv > radius * radius) return;
      const float measured = features.inverse_depth[fi];
      if (measured > 0 && std::abs(static_cast<double>(measured) - inverse_depth) > kMaxInverseDepth) return;
      const int d = hamming(l.descriptor, features.descriptors[fi]);
      if (d < best.distance) {
        best = {f, d, best.distance, k.octave, best.octave};
      } else if (d < best.second) {
        best.second = d;
        best.second_octave = k.octave;
      }
    });
    return best;
  }

  /// A keypoint belongs to the landmark that is most like it.
  void claim(int feature, int entry, int distance) {
    Owner& owner = owners_[static_cast<std::size_t>(feature)];
    if (distance >= owner.distance) return;
    if (owner.index >= 0) local_[static_cast<std::size_t>(owner.index)].feature = -1;
    owner = {entry, distance};
    local_[static_cast<std::size_t>(entry)].feature = feature;
  }

  void keep_consistent_turns() {
    const std::vector<char> keep = rotation_consistent(turns_);
    std::size_t n = 0;
    for (std::size_t i = 0; i < matches_.size(); ++i)
      if (keep[i]) matches_[n++] = matches_[i];
    matches_.resize(n, LandmarkMatch{});
  }

  void copy_inliers() {
    for (std::size_t i = 0; i < matches_.size(); ++i) matches_[i].inlier = observations_[i].inlier;
  }

  Pinhole camera_;
  Octaves octaves_;
  std::vector<int> keyframes_;
  std::vector<int> shared_;
  std::vector<double> remoteness_;  // of each keyframe kept, 1 and more = elsewhere
  PassMarks taken_landmarks_;
  std::vector<LocalLandmark> local_;
  std::vector<LandmarkMatch> matches_;
  std::vector<PointObservation> observations_;
  std::vector<Owner> owners_;
  std::vector<float> turns_;
};

APSO_NAMESPACE_END
