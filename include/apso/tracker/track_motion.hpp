/// \file
/// The motion since the previous frame from point tracks with depth.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/status.hpp>
#include <apso/tracker/features.hpp>
#include <apso/tracker/solvers/moving_bodies.hpp>
#include <apso/tracker/solvers/pose_optimisation.hpp>
#include <apso/tracker/solvers/ransac_pose.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// Keeps the tracks of a frame with the depth at their ends, and finds the pose that most of them agree with.
class TrackMotion {
 public:
  /// Takes the tracks of a new frame, in any order, and the depth at each.
  template <class Tracks, class DepthImage>
  void begin(const Tracks& tracks, const DepthImage& depth, const DepthRange& range, float sigma) {
    tracks_.clear();
    for_each_track(tracks, [&](const PointTrack& t) { tracks_.push_back(t); });
    std::swap(previous_depth_, depth_);
    std::swap(previous_ids_, ids_);
    depth_.clear();
    ids_.clear();
    for (const PointTrack& t : tracks_) {
      depth_.push_back(measure_depth(depth, t.x, t.y, range, sigma));
      ids_.push_back(t.id);
    }
    find_previous_depths();
  }

  /// \param threshold tracks at least this likely to be dynamic are not used
  template <class Mask>
  void weigh(const Mask& dynamic_probability, double threshold) {
    weight_.resize(tracks_.size());
    for (std::size_t i = 0; i < tracks_.size(); ++i) weight_[i] = static_weight(dynamic_probability, tracks_[i].x, tracks_[i].y, threshold);
  }

  /// \param T_world_previous pose of the previous frame
  /// \param T_world_predicted a first guess of the current one
  /// \param[out] T_world_camera the pose found; unchanged when 0 is returned
  /// \return tracks that agree with it; 0 when too few do
  int find_pose(const Pinhole& camera, const Pose& T_world_previous, const Pose& T_world_predicted, std::uint64_t seed,
                Pose& T_world_camera) {
    observations_.clear();
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      const PointTrack& t = tracks_[i];
      if (t.age < 1 || weight_[i] <= 0 || !(previous_[i].value > 0)) continue;
      PointObservation o;
      o.point = transform(T_world_previous, camera.unproject(t.previous_x, t.previous_y, 1.0 / static_cast<double>(previous_[i].value)));
      o.u = t.x;
      o.v = t.y;
      o.inverse_depth = depth_[i].value;
      o.inverse_depth_sigma = std::hypot(depth_[i].sigma, previous_[i].sigma);
      o.weight = weight_[i];
      observations_.push_back(o);
    }
    bodies_.clear();
    if (observations_.size() < kMinTracks) return 0;
    RansacOptions ransac;
    ransac.threshold = 1.0;
    ransac.iterations = 150;
    ransac.seed = seed;
    const RansacPose found = ransac_pose(camera, observations_, {T_world_predicted, T_world_previous}, ransac);
    if (!found.ok || found.inliers < static_cast<int>(kMinTracks)) return 0;
    const std::size_t all = observations_.size();
    const Pose T_rest = bodies_.separate(camera, observations_, found.T_world_camera);
    const PoseOptimisation refined = optimise_pose(camera, observations_, T_rest);
    if (!succeeded(refined.status) || refined.inliers * 3 < static_cast<int>(all)) return 0;
    T_world_camera = refined.T_world_camera;
    return refined.inliers;
  }
  /// Features on bodies that the tracks show to move are not used.
  /// \param[in,out] features their weights
  void leave_out_bodies(const Pinhole& camera, const Pose& T_world_camera, WeightedFeatures& features) const {
    if (!bodies_.any()) return;
    for (std::size_t i = 0; i < features.weight.size(); ++i) {
      const float inverse_depth = features.inverse_depth[i];
      if (!(features.weight[i] > 0) || !(inverse_depth > 0)) continue;
      const Keypoint& k = features.keypoints[i];
      const Eigen::Vector3d p = camera.unproject(k.x, k.y, 1.0 / static_cast<double>(inverse_depth));
      if (!bodies_.moves(transform(T_world_camera, p))) continue;
      features.weight[i] = 0;
      --features.with_depth;
    }
  }
  /// Bodies that move, by the tracks of the last find_pose().
  [[nodiscard]] const MovingBodies& bodies() const { return bodies_; }

 private:
  static constexpr std::size_t kMinTracks = 12;  // four times what determines a pose

  void find_previous_depths() {
    previous_.assign(tracks_.size(), InverseDepth{});
    // Most trackers keep their order, and then one pass finds each; where the order breaks, the search starts again.
    std::size_t j = 0;
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      if (tracks_[i].age < 1) continue;
      const std::size_t n = previous_ids_.size();
      for (std::size_t tried = 0; tried < n; ++tried, j = j + 1 < n ? j + 1 : 0) {
        if (previous_ids_[j] != ids_[i]) continue;
        previous_[i] = previous_depth_[j];
        break;
      }
    }
  }

  std::vector<PointTrack> tracks_;
  std::vector<InverseDepth> depth_;
  std::vector<std::int64_t> ids_;
  std::vector<InverseDepth> previous_depth_;
  std::vector<std::int64_t> previous_ids_;
  std::vector<InverseDepth> previous_;  // of each track, at its previous position
  std::vector<float> weight_;
  std::vector<PointObservation> observations_;
  MovingBodies bodies_;
};

APSO_NAMESPACE_END
