/// \file
/// The motion of the camera by tracks of which some are on bodies that move: each body has a rigid motion of its own.
///
/// A body before a distant wall can drag a pose along, because a small turn and a small shift together explain both: the pose
/// that most single tracks agree with is then that of the body. Whole bodies tell them apart. The tracks are cut into clusters
/// in space, as in Joint-VO-SF (Jaimez et al., ICRA 2017); each cluster follows the camera or a motion of its own, which costs
/// it the freedom of six parameters (penalised likelihood, Torr, Phil. Trans. R. Soc. A 1998).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/status.hpp>
#include <apso/tracker/solvers/pose_optimisation.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Cuts observations into clusters and tells which of them move. Keeps its buffers: once they have grown, a call allocates nothing.
class MovingBodies {
 public:
  /// \param T_world_camera a pose that many observations agree with, which may be that of a body
  /// \param[in,out] observations those of clusters that do not follow the camera are removed, at most half of all
  /// \return the pose of the camera by the others; T_world_camera where nothing moves or too much does
  Pose separate(const Pinhole& camera, std::vector<PointObservation>& observations, const Pose& T_world_camera) {
    camera_ = camera;
    clear();
    if (observations.size() < 2 * kMinPoints) return T_world_camera;
    cluster(observations);
    fit_each(T_world_camera);
    best_cost_ = cost(T_world_camera, best_);
    best_pose_ = T_world_camera;
    if (best_ == Chosen{}) return T_world_camera;
    for (std::size_t k = 0; k < count_; ++k) {
      if (!clusters_[k].fitted) continue;
      Chosen one{};
      one[k] = true;
      Pose T = T_world_camera;
      if (fit_rest(one, T)) improve(T);
      improve(clusters_[k].T_world_camera);
    }
    if (!std::isfinite(best_cost_)) return T_world_camera;
    for (std::size_t k = 0; k < count_; ++k) {
      clusters_[k].moving = best_[k] && typical_residual(clusters_[k].points, best_pose_) > kClearMotion;
      any_ = any_ || clusters_[k].moving;
    }
    collect_resting(best_);
    observations = rest_;
    return best_pose_;
  }

  /// Forgets what was found.
  void clear() {
    count_ = 0;
    any_ = false;
  }
  /// Whether the motion of some body is clear to see.
  [[nodiscard]] bool any() const { return any_; }
  /// Whether a place belongs to such a body.
  /// \param point in the world of the observations [m]
  [[nodiscard]] bool moves(const Eigen::Vector3d& point) const {
    double least = kReach * kReach;
    bool moving = false;
    for (std::size_t k = 0; k < count_; ++k) {
      const double d = squared_norm(point - clusters_[k].centre);
      if (!(d < least)) continue;
      least = d;
      moving = clusters_[k].moving;
    }
    return moving;
  }

 private:
  static constexpr std::size_t kClusters = 12;
  static constexpr int kRounds = 6;                     // of k-means
  static constexpr std::size_t kMinPoints = 10;         // fewer have no motion of their own
  static constexpr double kMotionCost = 30;             // of a motion of its own: 3 ln n of six parameters, and what a lens or a
                                                        // rolling shutter gives a part of the image
  static constexpr double kOutlierCost = 6;             // of a point: from 3.5 standard deviations on it is an outlier
  static constexpr double kMinPixelNoise = 0.3;         // tracks are not believed to be better [px]
  static constexpr double kClearMotion = 1.5;           // typical residual of a body that moves for certain [px]
  static constexpr PoseOptimisationOptions kFit{2, 4};  // motions are compared here, and the one chosen is refined by the caller
  static constexpr double kReach = 0.6;                 // how far a cluster speaks for points around its centre [m]

  struct Cluster {
    Eigen::Vector3d centre = zeros<Eigen::Vector3d>();
    std::vector<PointObservation> points;
    Pose T_world_camera = identity_pose();  // if the cluster were at rest
    double own_cost = 0;
    bool fitted = false;
    bool moving = false;
  };
  using Chosen = std::array<bool, kClusters>;

  // K-means from points that are as far from each other as can be, so that the result does not depend on chance.
  void cluster(const std::vector<PointObservation>& observations) {
    const std::size_t n = observations.size();
    count_ = std::min(kClusters, n / kMinPoints);
    distance_.assign(n, std::numeric_limits<double>::infinity());
    std::size_t farthest = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      clusters_[k].centre = observations[farthest].point;
      for (std::size_t i = 0; i < n; ++i) {
        distance_[i] = std::min(distance_[i], squared_norm(observations[i].point - clusters_[k].centre));
      }
      farthest = static_cast<std::size_t>(std::max_element(distance_.begin(), distance_.end()) - distance_.begin());
    }
    for (int round = 0; round < kRounds; ++round) {
      for (std::size_t k = 0; k < count_; ++k) clusters_[k].points.clear();
      for (const PointObservation& o : observations) nearest(o.point).points.push_back(o);
      for (std::size_t k = 0; k < count_; ++k) {
        Cluster& c = clusters_[k];
        if (c.points.empty()) continue;
        Eigen::Vector3d sum = zeros<Eigen::Vector3d>();
        for (const PointObservation& o : c.points) sum += o.point;
        c.centre = 1.0 / static_cast<double>(c.points.size()) * sum;
      }
    }
  }
  Cluster& nearest(const Eigen::Vector3d& point) {
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < count_; ++k) {
      const double d = squared_norm(point - clusters_[k].centre);
      if (!(d < least)) continue;
      least = d;
      best = k;
    }
    return clusters_[best];
  }

  // The motion of each cluster by itself; what is left then is the noise of the tracks. A cluster that the pose explains for less than a
  // motion costs, however exact the tracks are, is not fitted: its own motion is that pose. The body that the pose follows may be one.
  void fit_each(const Pose& T_world_camera) {
    noise_ = kMinPixelNoise;
    errors_.clear();
    for (std::size_t k = 0; k < count_; ++k) {
      Cluster& c = clusters_[k];
      c.T_world_camera = T_world_camera;
      c.moving = false;
      const bool explained = cost(c.points, T_world_camera) <= kMotionCost;
      c.fitted = c.points.size() >= kMinPoints && (explained || fit(c.points, c.T_world_camera));
      add_errors(c.points, c.T_world_camera);
    }
    if (!errors_.empty()) noise_ = std::max(kMinPixelNoise, std::sqrt(median_error() / kMedianNorm2));
    for (std::size_t k = 0; k < count_; ++k) {
      Cluster& c = clusters_[k];
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
  bool fit_rest(const Chosen& moving, Pose& T) {
    collect_resting(moving);
    return fit(rest_, T);
  }
  void collect_resting(const Chosen& moving) {
    rest_.clear();
    for (std::size_t k = 0; k < count_; ++k) {
      if (!moving[k]) rest_.insert(rest_.end(), clusters_[k].points.begin(), clusters_[k].points.end());
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
      if (point_residual(camera_, o, transform(T_camera_world, o.point), r)) {
        errors_.push_back(static_cast<float>(r.x() * r.x() + r.y() * r.y()));
      }
    }
  }
  [[nodiscard]] double median_error() { return static_cast<double>(upper_median(errors_)); }
  bool fit(std::vector<PointObservation>& observations, Pose& T) const {
    const PoseOptimisation found = optimise_pose(camera_, observations, T, kFit);
    if (!succeeded(found.status)) return false;
    T = found.T_world_camera;
    return true;
  }

  // Minus the logarithm of the likelihood of all, each cluster with the motion that explains it better.
  [[nodiscard]] double cost(const Pose& T_world_camera, Chosen& moving) const {
    moving = {};
    double sum = 0;
    std::size_t moved = 0;
    std::size_t all = 0;
    for (std::size_t k = 0; k < count_; ++k) {
      const Cluster& c = clusters_[k];
      const double resting = cost(c.points, T_world_camera);
      moving[k] = c.own_cost < resting;
      sum += std::min(resting, c.own_cost);
      all += c.points.size();
      moved += moving[k] ? c.points.size() : 0;
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
  std::array<Cluster, kClusters> clusters_;
  std::size_t count_ = 0;
  bool any_ = false;
  std::vector<double> distance_;
  std::vector<float> errors_;
  std::vector<PointObservation> rest_;
  Chosen best_{}, trial_{};
  Pose best_pose_ = identity_pose();
  double best_cost_ = 0;
  double noise_ = 1;  // of tracks [px]
};

APSO_NAMESPACE_END
