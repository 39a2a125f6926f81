/// \file
/// The motion of the camera by tracks of which some are on bodies that move: each body has a rigid motion of its own.
///
/// A body before a distant wall can drag a pose along, because a small turn and a small shift together explain both: the pose
/// that most single tracks agree with is then that of the body. Whole bodies tell them apart. The tracks are cut into clusters
/// in space, as in Joint-VO-SF (Jaimez et al., ICRA 2017); each cluster follows the camera or a motion of its own, which costs
/// it the freedom of six parameters (penalised likelihood, Torr, Phil. Trans. R. Soc. A 1998).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/status.hpp>
#include <apso/tracker/solvers/pose_optimisation.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Cuts observations into clusters and tells which of them move. Keeps its buffers.
class MovingBodies {
 public:
  /// \param T_world_camera a pose that many observations agree with, which may be that of a body
  /// \param[in,out] observations those of clusters that do not follow the camera are removed, at most half of all
  /// \return the pose of the camera by the others
  Pose separate(const Pinhole& camera, std::vector<PointObservation>& observations, const Pose& T_world_camera) {
    camera_ = camera;
    clusters_.clear();
    if (observations.size() < 2 * kMinPoints) return T_world_camera;
    cluster(observations);
    fit_each(T_world_camera);
    best_cost_ = cost(T_world_camera, best_);
    best_pose_ = T_world_camera;
    if (std::none_of(best_.begin(), best_.end(), [](char moving) { return moving != 0; })) return T_world_camera;
    improve(T_world_camera);
    for (std::size_t k = 0; k < clusters_.size(); ++k) {
      if (!clusters_[k].fitted) continue;
      skipped_.assign(clusters_.size(), 0);
      skipped_[k] = 1;
      Pose T = T_world_camera;
      if (fit_rest(skipped_, T)) improve(T);
      improve(clusters_[k].T_world_camera);
    }
    for (std::size_t k = 0; k < clusters_.size(); ++k) {
      clusters_[k].moving = best_[k] != 0 && typical_residual(clusters_[k].points, best_pose_) > kClearMotion;
    }
    collect_resting(best_);
    observations = scratch_;
    return best_pose_;
  }

  void clear() { clusters_.clear(); }
  /// Whether a place belongs to a body whose motion is clear to see.
  /// \param point in the world of the observations [m]
  [[nodiscard]] bool moves(const Eigen::Vector3d& point) const {
    double least = kReach * kReach;
    bool moving = false;
    for (const Cluster& c : clusters_) {
      const double d = squared_norm(minus(point, c.centre));
      if (!(d < least)) continue;
      least = d;
      moving = c.moving;
    }
    return moving;
  }

 private:
  static constexpr std::size_t kClusters = 12;
  static constexpr int kRounds = 6;               // of k-means
  static constexpr std::size_t kMinPoints = 10;   // fewer have no motion of their own
  static constexpr double kMotionCost = 30;       // of a motion of its own: 3 ln n of six parameters, and what a lens or a
                                                  // rolling shutter gives a part of the image
  static constexpr double kOutlierCost = 6;       // of a point: from 3.5 standard deviations on it is an outlier
  static constexpr double kMinPixelNoise = 0.3;   // tracks are not believed to be better [px]
  static constexpr double kClearMotion = 1.5;     // typical residual of a body that moves for certain [px]
  static constexpr double kReach = 0.6;           // how far a cluster speaks for points around its centre [m]

  struct Cluster {
    Eigen::Vector3d centre = zeros<Eigen::Vector3d>();
    std::vector<PointObservation> points;
    Pose T_world_camera = identity_pose();  // if the cluster were at rest
    double own_cost = 0;
    bool fitted = false;
    bool moving = false;
  };

  // K-means from points that are as far from each other as can be, so that the result does not depend on chance.
  void cluster(const std::vector<PointObservation>& observations) {
    const std::size_t n = observations.size();
    clusters_.resize(std::min(kClusters, n / kMinPoints));
    distance_.assign(n, std::numeric_limits<double>::infinity());
    std::size_t start = 0;
    for (Cluster& c : clusters_) {
      c.centre = observations[start].point;
      start = 0;
      for (std::size_t i = 0; i < n; ++i) {
        distance_[i] = std::min(distance_[i], squared_norm(minus(observations[i].point, c.centre)));
        if (distance_[i] > distance_[start]) start = i;
      }
    }
    for (int round = 0; round < kRounds; ++round) {
      for (Cluster& c : clusters_) c.points.clear();
      for (const PointObservation& o : observations) {
        Cluster* nearest = &clusters_.front();
        double least = std::numeric_limits<double>::infinity();
        for (Cluster& c : clusters_) {
          const double d = squared_norm(minus(o.point, c.centre));
          if (d < least) {
            least = d;
            nearest = &c;
          }
        }
        nearest->points.push_back(o);
      }
      for (Cluster& c : clusters_) {
        if (c.points.empty()) continue;
        Eigen::Vector3d sum = zeros<Eigen::Vector3d>();
        for (const PointObservation& o : c.points) sum = plus(sum, o.point);
        c.centre = times(1.0 / static_cast<double>(c.points.size()), sum);
      }
    }
  }

  // The motion of each cluster by itself; what is left then is the noise of the tracks.
  void fit_each(const Pose& T_world_camera) {
    noise_ = 1;
    errors_.clear();
    for (Cluster& c : clusters_) {
      c.T_world_camera = T_world_camera;
      c.moving = false;
      c.fitted = c.points.size() >= kMinPoints && fit(c.points, c.T_world_camera);
      add_errors(c.points, c.T_world_camera);
    }
    if (!errors_.empty()) noise_ = std::max(kMinPixelNoise, std::sqrt(median_error() / kMedianNorm2));
    for (Cluster& c : clusters_) {
      c.own_cost = c.fitted ? kMotionCost + cost(c.points, c.T_world_camera) : std::numeric_limits<double>::infinity();
    }
  }

  // Takes a pose if all is explained better by it, and then what rests by it, until that is no better.
  void improve(Pose T) {
    for (;;) {
      const double found = cost(T, trial_);
      if (!(found < best_cost_)) return;
      best_cost_ = found;
      best_pose_ = T;
      best_ = trial_;
      if (!fit_rest(best_, T)) return;
    }
  }
  bool fit_rest(const std::vector<char>& moving, Pose& T) {
    collect_resting(moving);
    return fit(scratch_, T);
  }
  void collect_resting(const std::vector<char>& moving) {
    scratch_.clear();
    for (std::size_t k = 0; k < clusters_.size(); ++k) {
      if (moving[k] == 0) scratch_.insert(scratch_.end(), clusters_[k].points.begin(), clusters_[k].points.end());
    }
  }
  [[nodiscard]] double typical_residual(const std::vector<PointObservation>& observations, const Pose& T_world_camera) {
    errors_.clear();
    add_errors(observations, T_world_camera);
    return errors_.empty() ? 0.0 : std::sqrt(median_error());
  }
  void add_errors(const std::vector<PointObservation>& observations, const Pose& T_world_camera) {
    const Pose T_camera_world = inverse(T_world_camera);
    Eigen::Vector3d r;
    for (const PointObservation& o : observations) {
      if (point_residual(camera_, o, transform(T_camera_world, o.point), r)) errors_.push_back(r.x() * r.x() + r.y() * r.y());
    }
  }
  [[nodiscard]] double median_error() {
    const auto middle = errors_.begin() + static_cast<std::ptrdiff_t>(errors_.size() / 2);
    std::nth_element(errors_.begin(), middle, errors_.end());
    return *middle;
  }
  bool fit(std::vector<PointObservation>& observations, Pose& T) const {
    const PoseOptimisation found = optimise_pose(camera_, observations, T);
    if (!succeeded(found.status)) return false;
    T = found.T_world_camera;
    return true;
  }

  // Minus the logarithm of the likelihood of all, each cluster with the motion that explains it better.
  [[nodiscard]] double cost(const Pose& T_world_camera, std::vector<char>& moving) const {
    moving.assign(clusters_.size(), 0);
    double sum = 0;
    std::size_t moved = 0;
    std::size_t all = 0;
    for (std::size_t k = 0; k < clusters_.size(); ++k) {
      const Cluster& c = clusters_[k];
      const double resting = cost(c.points, T_world_camera);
      moving[k] = c.own_cost < resting ? 1 : 0;
      sum += std::min(resting, c.own_cost);
      all += c.points.size();
      moved += moving[k] != 0 ? c.points.size() : 0;
    }
    return 2 * moved > all ? std::numeric_limits<double>::infinity() : sum;
  }
  [[nodiscard]] double cost(const std::vector<PointObservation>& observations, const Pose& T_world_camera) const {
    const Pose T_camera_world = inverse(T_world_camera);
    double sum = 0;
    Eigen::Vector3d r;
    for (const PointObservation& o : observations) {
      const bool seen = point_residual(camera_, o, transform(T_camera_world, o.point), r);
      sum += o.weight * (seen ? std::min(kOutlierCost, 0.5 * scaled_norm2(r, noise_)) : kOutlierCost);
    }
    return sum;
  }

  Pinhole camera_;
  std::vector<Cluster> clusters_;
  std::vector<double> distance_, errors_;
  std::vector<char> best_, trial_, skipped_;
  std::vector<PointObservation> scratch_;
  Pose best_pose_ = identity_pose();
  double best_cost_ = 0;
  double noise_ = 1;  // of tracks [px]
};

APSO_NAMESPACE_END
