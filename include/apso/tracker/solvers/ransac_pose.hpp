/// \file
/// Camera pose from known points without an initial guess: RANSAC over three points with depth.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/rigid_alignment.hpp>
#include <apso/math/se3.hpp>
#include <apso/status.hpp>
#include <apso/tracker/solvers/pose_optimisation.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// A small deterministic generator for RANSAC (xorshift, Marsaglia 2003).
class RansacGenerator {
 public:
  explicit RansacGenerator(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15ULL + 1) {}
  /// Uniform in [0, n).
  std::size_t operator()(std::size_t n) {
    state_ ^= state_ << 13U;
    state_ ^= state_ >> 7U;
    state_ ^= state_ << 17U;
    return static_cast<std::size_t>((state_ >> 11U) % n);
  }

 private:
  std::uint64_t state_;
};

struct RansacOptions {
  double threshold = 3.0;                 ///< reprojection error of an inlier [px], times sigma
  double inverse_depth_tolerance = 0.03;  ///< [1/m], where depth was measured
  double confidence = 0.99;               ///< of having drawn one clean sample
  int iterations = 300;                   ///< at most
  std::uint64_t seed = 1;
};

struct RansacPose {
  bool ok = false;
  Pose T_world_camera = identity_pose();
  int inliers = 0;
};

namespace detail {
inline double ransac_score(const Pinhole& camera, const std::vector<PointObservation>& observations, const Pose& T_camera_world,
                           const RansacOptions& options, int& inliers) {
  double score = 0;
  inliers = 0;
  for (const PointObservation& o : observations) {
    const Eigen::Vector3d p = transform(T_camera_world, o.point);
    if (!(p.z() > 0.05)) continue;
    const double iz = 1.0 / p.z();
    const double du = (camera.fx * p.x() * iz + camera.cx - o.u) / o.sigma;
    const double dv = (camera.fy * p.y() * iz + camera.cy - o.v) / o.sigma;
    const double e2 = (du * du + dv * dv) / (options.threshold * options.threshold);
    if (!(e2 < 1)) continue;
    if (o.inverse_depth > 0 && std::abs(iz - o.inverse_depth) > options.inverse_depth_tolerance) continue;
    score += o.weight * (1 - e2);
    ++inliers;
  }
  return score;
}

/// Whether the sides of two triangles agree, and they are no needles.
inline bool same_triangle(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b) {
  const Eigen::Vector3d a1 = a[1] - a[0];
  const Eigen::Vector3d a2 = a[2] - a[0];
  const Eigen::Vector3d b1 = b[1] - b[0];
  const Eigen::Vector3d b2 = b[2] - b[0];
  if (norm(cross(a1, a2)) < 1e-3) return false;
  const auto differs = [](const Eigen::Vector3d& u, const Eigen::Vector3d& v) {
    const double s = norm(u);
    const double t = norm(v);
    return std::abs(s - t) > 0.05 + 0.1 * std::max(s, t);
  };
  return !differs(a1, b1) && !differs(a2, b2) && !differs(a1 - a2, b1 - b2);
}
}  // namespace detail

/// Pose with the most support (MSAC score) among the given hypotheses and those from random triples of points with
/// measured depth (rigid alignment of three points, align_horn). Every hypothesis that leads is refined over all
/// observations near it (local optimisation, Chum, Matas & Kittler 2003): three noisy depths alone rarely tell the
/// background from a body that moves a little. Deterministic for a seed.
[[nodiscard]] inline RansacPose ransac_pose(const Pinhole& camera, const std::vector<PointObservation>& observations,
                                            const std::vector<Pose>& hypotheses, const RansacOptions& options = {}) {
  RansacPose best;
  double best_score = 0;
  const auto offer = [&](const Pose& T_camera_world) {
    int inliers = 0;
    const double score = detail::ransac_score(camera, observations, T_camera_world, options, inliers);
    if (score > best_score) {
      best_score = score;
      best.ok = true;
      best.T_world_camera = inverse(T_camera_world);
      best.inliers = inliers;
      return true;
    }
    return false;
  };
  std::vector<PointObservation> near;
  const auto offer_refined = [&](const Pose& T_camera_world, bool always) {
    const bool leads = offer(T_camera_world);
    if (!leads && !always) return false;
    near = observations;
    PoseOptimisationOptions local;
    local.rounds = 2;
    local.iterations = 5;
    const PoseOptimisation refined = optimise_pose(camera, near, inverse(T_camera_world), local);
    return (succeeded(refined.status) && offer(inverse(refined.T_world_camera))) || leads;
  };
  for (const Pose& T : hypotheses) offer_refined(inverse(T), true);

  std::vector<std::size_t> with_depth;
  with_depth.reserve(observations.size());
  for (std::size_t i = 0; i < observations.size(); ++i)
    if (observations[i].inverse_depth > 0) with_depth.push_back(i);
  if (with_depth.size() < 3) return best;

  std::vector<Eigen::Vector3d> world(3);
  std::vector<Eigen::Vector3d> seen(3);
  RansacGenerator random(options.seed);
  int wanted = options.iterations;
  const auto update_wanted = [&] {
    const double share = static_cast<double>(best.inliers) / static_cast<double>(observations.size());
    const double miss = 1 - share * share * share;
    const double n = miss < 1e-9 ? 1.0 : std::log(1 - options.confidence) / std::log(miss);
    if (n < wanted) wanted = std::max(10, static_cast<int>(n) + 1);
  };
  if (best.ok) update_wanted();
  for (int k = 0; k < wanted; ++k) {
    const std::array<std::size_t, 3> pick{with_depth[random(with_depth.size())], with_depth[random(with_depth.size())],
                                          with_depth[random(with_depth.size())]};
    if (pick[0] == pick[1] || pick[0] == pick[2] || pick[1] == pick[2]) continue;
    for (std::size_t j = 0; j < 3; ++j) {
      const PointObservation& o = observations[pick[j]];
      world[j] = o.point;
      seen[j] = camera.unproject(o.u, o.v, 1.0 / o.inverse_depth);
    }
    if (!detail::same_triangle(world, seen)) continue;
    const Pose T = align_horn(seen, world).T_target_source;
    if (offer_refined(T, false)) update_wanted();
  }
  return best;
}

APSO_NAMESPACE_END
