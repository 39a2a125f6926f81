/// \file
/// Camera pose from known points: robust Gauss-Newton on SE(3) over reprojection and inverse-depth residuals, and a
/// three-point RANSAC for when no initial guess is good enough.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SVD>

#include <apso/config.hpp>
#include <apso/options.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/status.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// A world point seen in the image.
struct PointObservation {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< world frame [m]
  double u = 0;                                     ///< [px]
  double v = 0;                                     ///< [px]
  double inverse_depth = 0;                         ///< measured 1/z [1/m]; 0 = no depth at this pixel
  double sigma = 1;                                 ///< of u and v [px]
  double inverse_depth_sigma = 1;                   ///< of inverse_depth [1/m]
  double weight = 1;                                ///< (0,1], e.g. the probability of being static
  bool inlier = true;                               ///< set by the optimisation
};

struct PoseOptimisationOptions {
  int rounds = 4;       ///< after each round inliers and outliers are told apart anew
  int iterations = 10;  ///< Gauss-Newton steps of a round
  int least = 10;       ///< fewer inliers are no result
  double least_scale = 0.4;  ///< the noise is measured, but is not believed to be less than this share of sigma
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("rounds", s.rounds, 1, 20);
    v("iterations", s.iterations, 1, 100);
    v("least", s.least, 3, 1000);
    v("least_scale", s.least_scale, 0.01, 1.0);
  }
};

struct PoseOptimisation {
  Status status = Status::NotRun;
  Pose T_world_camera = Pose::Identity();
  int inliers = 0;
  Matrix6 information = Matrix6::Zero();  ///< of the twist that multiplies T_camera_world from the left
};

/// 95 % points of the chi-square distribution with two and three degrees of freedom.
inline constexpr double kChi2Point = 5.991;
inline constexpr double kChi2PointDepth = 7.815;

/// Whitened residual (du, dv, d(1/z)) of a point given in the camera frame, and its derivative with respect to
/// that camera point. The third row is zero when no depth was measured.
/// \return false when the point lies behind the camera
inline bool point_residual(const Pinhole& camera, const PointObservation& o, const Eigen::Vector3d& p_camera,
                           Eigen::Vector3d& residual, Eigen::Matrix3d* jacobian = nullptr) {
  if (!(p_camera.z() > 0.05)) return false;
  const double iz = 1.0 / p_camera.z();
  const double is = 1.0 / o.sigma;
  const double id = o.inverse_depth > 0 ? 1.0 / o.inverse_depth_sigma : 0.0;
  residual = {(camera.fx * p_camera.x() * iz + camera.cx - o.u) * is,
              (camera.fy * p_camera.y() * iz + camera.cy - o.v) * is, (iz - o.inverse_depth) * id};
  if (jacobian != nullptr) {
    jacobian->topRows<2>() = is * camera.project_jacobian(p_camera);
    jacobian->row(2) << 0, 0, -iz * iz * id;
  }
  return true;
}

/// Derivative of a camera point with respect to the twist that multiplies T_camera_world from the left.
[[nodiscard]] inline Eigen::Matrix<double, 3, 6> point_twist_jacobian(const Eigen::Vector3d& p_camera) {
  Eigen::Matrix<double, 3, 6> j;
  j.leftCols<3>().setIdentity();
  j.rightCols<3>() = -skew(p_camera);
  return j;
}

/// Chi-square limit of an observation.
[[nodiscard]] inline double chi2_limit(const PointObservation& o) {
  return o.inverse_depth > 0 ? kChi2PointDepth : kChi2Point;
}

/// Squared norm of a whitened residual when the noise of u and v is `scale` times sigma.
[[nodiscard]] inline double scaled_norm2(const Eigen::Vector3d& r, double scale) {
  return r.head<2>().squaredNorm() / (scale * scale) + r.z() * r.z();
}

/// Marks the inliers at a pose and counts them.
/// \param scale noise of u and v, in sigma
/// \param widen factor on the chi-square limits
inline int classify(const Pinhole& camera, std::vector<PointObservation>& observations, const Pose& T_world_camera,
                    double scale = 1, double widen = 1) {
  const Pose T_camera_world = inverse(T_world_camera);
  int inliers = 0;
  Eigen::Vector3d r;
  for (PointObservation& o : observations) {
    o.inlier = point_residual(camera, o, T_camera_world * o.point, r) && scaled_norm2(r, scale) <= widen * chi2_limit(o);
    inliers += o.inlier ? 1 : 0;
  }
  return inliers;
}

/// Noise of u and v in units of sigma, from the median residual of the inliers: for two Gaussian components the
/// median of the squared norm is 2 ln 2.
[[nodiscard]] inline double pixel_noise_scale(const Pinhole& camera, const std::vector<PointObservation>& observations,
                                              const Pose& T_camera_world, double least, std::vector<double>& scratch) {
  scratch.clear();
  Eigen::Vector3d r;
  for (const PointObservation& o : observations) {
    if (o.inlier && point_residual(camera, o, T_camera_world * o.point, r)) scratch.push_back(r.head<2>().squaredNorm());
  }
  if (scratch.empty()) return 1;
  const auto middle = scratch.begin() + static_cast<std::ptrdiff_t>(scratch.size() / 2);
  std::nth_element(scratch.begin(), middle, scratch.end());
  return std::clamp(std::sqrt(*middle / 1.3862943611198906), least, 1.0);
}

/// Pose that minimises the robust cost of the observations, starting at T_world_camera.
///
/// The kernel is Geman-McClure with the 95 % chi-square points as bounds: what is far off at the start has no pull.
/// Huber's has, and a moving body in front of a distant wall then drags the pose along, because a small turn and a
/// small shift together explain both. For the same reason the noise is measured (pixel_noise_scale) and not assumed:
/// at half a pixel the wall says clearly that the camera did not turn, at one or two pixels it does not. The last two
/// rounds use the inliers without kernel. When most observations are far off at the start, all take part at first.
[[nodiscard]] inline PoseOptimisation optimise_pose(const Pinhole& camera, std::vector<PointObservation>& observations,
                                                    const Pose& T_world_camera,
                                                    const PoseOptimisationOptions& options = {}) {
  constexpr double far_off = 16;  // on squared residuals: four times the bound
  PoseOptimisation result;
  result.T_world_camera = T_world_camera;
  result.status = Status::TooFewMatches;
  if (static_cast<int>(observations.size()) < options.least) return result;
  Pose T = inverse(T_world_camera);
  if (2 * classify(camera, observations, T_world_camera, 1, far_off) < static_cast<int>(observations.size())) {
    for (PointObservation& o : observations) o.inlier = true;
  }
  Matrix6 information = Matrix6::Zero();
  std::vector<double> scratch;
  double scale = 1;
  for (int round = 0; round < options.rounds; ++round) {
    const bool robust = round + 2 < options.rounds || options.rounds < 3;
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
      if (robust) scale = pixel_noise_scale(camera, observations, T, options.least_scale, scratch);
      const double per_pixel = 1 / scale;
      Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
      Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
      Eigen::Vector3d r;
      Eigen::Matrix3d J_point = Eigen::Matrix3d::Zero();
      for (const PointObservation& o : observations) {
        if (!o.inlier) continue;
        const Eigen::Vector3d p = T * o.point;
        if (!point_residual(camera, o, p, r, &J_point)) continue;
        r.head<2>() *= per_pixel;
        J_point.topRows<2>() *= per_pixel;
        const double limit = chi2_limit(o);
        const double share = limit / (limit + r.squaredNorm());
        const double w = o.weight * (robust ? share * share : 1.0);
        const Eigen::Matrix<double, 3, 6> J = J_point * point_twist_jacobian(p);
        H.noalias() += w * J.transpose() * J;
        b.noalias() -= w * J.transpose() * r;
      }
      H.diagonal().array() += 1e-9 * H.trace() + 1e-12;
      const Eigen::Matrix<double, 6, 1> step = solve_symmetric(H, b);
      if (!step.allFinite()) {
        result.status = Status::SingularSystem;
        return result;
      }
      if (step.norm() > 2.0) {  // two metres or radians in one step is no refinement
        result.status = Status::Diverged;
        return result;
      }
      T = normalized(se3_exp(step) * T);
      information = H;
      if (step.norm() < 1e-6) break;
    }
    scale = pixel_noise_scale(camera, observations, T, options.least_scale, scratch);
    result.inliers = classify(camera, observations, inverse(T), scale);
    if (result.inliers < options.least) return result;
  }
  result.status = Status::Converged;
  result.T_world_camera = inverse(T);
  result.information = information;
  return result;
}

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
  double threshold = 3.0;             ///< reprojection error of an inlier [px], times sigma
  double inverse_depth_tolerance = 0.03;  ///< [1/m], where depth was measured
  double confidence = 0.99;           ///< of having drawn one clean sample
  int iterations = 300;               ///< at most
  std::uint64_t seed = 1;
};

struct RansacPose {
  bool ok = false;
  Pose T_world_camera = Pose::Identity();
  int inliers = 0;
};

namespace detail {
inline double ransac_score(const Pinhole& camera, const std::vector<PointObservation>& observations,
                           const Pose& T_camera_world, const RansacOptions& options, int& inliers) {
  double score = 0;
  inliers = 0;
  for (const PointObservation& o : observations) {
    const Eigen::Vector3d p = T_camera_world * o.point;
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
}  // namespace detail

/// Pose with the most support (MSAC score) among the given hypotheses and those from random triples of points with
/// measured depth (rigid alignment of three points, Umeyama 1991). Every hypothesis that leads is refined over all
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
    Eigen::Matrix3d world;
    Eigen::Matrix3d seen;
    for (int j = 0; j < 3; ++j) {
      const PointObservation& o = observations[pick[static_cast<std::size_t>(j)]];
      world.col(j) = o.point;
      seen.col(j) = camera.unproject(o.u, o.v, 1.0 / o.inverse_depth);
    }
    // The sides of the two triangles must agree, and the triangle must not be a needle.
    const Eigen::Vector3d a = world.col(1) - world.col(0);
    const Eigen::Vector3d b = world.col(2) - world.col(0);
    const double area = a.cross(b).norm();
    if (area < 1e-3) continue;
    const auto differs = [](double s, double t) { return std::abs(s - t) > 0.05 + 0.1 * std::max(s, t); };
    if (differs(a.norm(), (seen.col(1) - seen.col(0)).norm()) || differs(b.norm(), (seen.col(2) - seen.col(0)).norm()) ||
        differs((a - b).norm(), (seen.col(1) - seen.col(2)).norm()))
      continue;
    const Eigen::Matrix4d M = Eigen::umeyama(world, seen, false);
    if (!M.allFinite()) continue;
    Pose T = Pose::Identity();
    T.matrix() = M;
    if (offer_refined(T, false)) update_wanted();
  }
  return best;
}

}  // namespace opencv
APSO_NAMESPACE_END
