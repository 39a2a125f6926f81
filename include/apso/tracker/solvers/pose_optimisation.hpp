/// \file
/// Camera pose from known points: robust Gauss-Newton on SE(3) over reprojection and inverse-depth residuals.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/status.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// A world point seen in the image.
struct PointObservation {
  Eigen::Vector3d point = zeros<Eigen::Vector3d>();  ///< world frame [m]
  double u = 0;                                      ///< [px]
  double v = 0;                                      ///< [px]
  double inverse_depth = 0;                          ///< measured 1/z [1/m]; 0 = no depth at this pixel
  double sigma = 1;                                  ///< of u and v [px]
  double inverse_depth_sigma = 1;                    ///< of inverse_depth [1/m]
  double weight = 1;                                 ///< (0,1], e.g. the probability of being static
  bool inlier = true;                                ///< set by the optimisation
};

struct PoseOptimisationOptions {
  int rounds = 4;       ///< after each round inliers and outliers are told apart anew (ORB-SLAM2)
  int iterations = 10;  ///< Gauss-Newton steps of a round, at most
};

struct PoseOptimisation {
  Status status = Status::NotRun;
  Pose T_world_camera = identity_pose();
  int inliers = 0;
  Matrix6 information = zeros<Matrix6>();  ///< of the twist that multiplies T_camera_world from the left
};

/// 95 % points of the chi-square distribution with two and three degrees of freedom.
inline constexpr double kChi2Point = 5.991;
inline constexpr double kChi2PointDepth = 7.815;

inline constexpr int kMinPoseInliers = 10;     ///< fewer give no pose
inline constexpr double kMinPixelScale = 0.4;  ///< the noise of pixels is measured, but not believed to be less than this many sigma

/// Whitened residual (du, dv, d(1/z)) of a point given in the camera frame, and its derivative with respect to
/// that camera point. The third row is zero when no depth was measured.
/// \return false when the point lies behind the camera
inline bool point_residual(const Pinhole& camera, const PointObservation& o, const Eigen::Vector3d& p_camera, Eigen::Vector3d& residual,
                           Eigen::Matrix3d* jacobian = nullptr) {
  if (!(p_camera.z() > 0.05)) return false;
  const double iz = 1.0 / p_camera.z();
  const double is = 1.0 / o.sigma;
  const double id = o.inverse_depth > 0 ? 1.0 / o.inverse_depth_sigma : 0.0;
  residual = {(camera.fx * p_camera.x() * iz + camera.cx - o.u) * is, (camera.fy * p_camera.y() * iz + camera.cy - o.v) * is,
              (iz - o.inverse_depth) * id};
  if (jacobian != nullptr) {
    Eigen::Matrix3d& J = *jacobian;
    J(0, 0) = is * (camera.fx * iz);
    J(1, 1) = is * (camera.fy * iz);
    J(0, 1) = J(1, 0) = J(2, 0) = J(2, 1) = 0;
    J(0, 2) = is * (-camera.fx * p_camera.x() * iz * iz);
    J(1, 2) = is * (-camera.fy * p_camera.y() * iz * iz);
    J(2, 2) = -iz * iz * id;
  }
  return true;
}

/// Derivative of a residual with respect to the twist that multiplies T_camera_world from the left.
/// \param J with respect to the camera point p
/// \param[out] J_twist J [I, -skew(p)]
inline void twist_jacobian(const Eigen::Matrix3d& J, const Eigen::Vector3d& p, double (&J_twist)[3][6]) {
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 3; ++i) J_twist[k][i] = J(k, i);
    J_twist[k][3] = J(k, 2) * p.y() - J(k, 1) * p.z();
    J_twist[k][4] = J(k, 0) * p.z() - J(k, 2) * p.x();
    J_twist[k][5] = J(k, 1) * p.x() - J(k, 0) * p.y();
  }
}

/// Chi-square limit of an observation.
[[nodiscard]] inline double chi2_limit(const PointObservation& o) { return o.inverse_depth > 0 ? kChi2PointDepth : kChi2Point; }

/// Squared norm of a whitened residual when the noise of u and v is `scale` times sigma.
[[nodiscard]] inline double scaled_norm2(const Eigen::Vector3d& r, double scale) {
  return (r.x() * r.x() + r.y() * r.y()) / (scale * scale) + r.z() * r.z();
}

/// Marks the inliers at a pose and counts them.
/// \param scale noise of u and v, in sigma
/// \param widen factor on the chi-square limits
inline int mark_inliers(const Pinhole& camera, std::vector<PointObservation>& observations, const Pose& T_world_camera, double scale = 1,
                        double widen = 1) {
  const Pose T_camera_world = inverse(T_world_camera);
  int inliers = 0;
  Eigen::Vector3d r;
  for (PointObservation& o : observations) {
    o.inlier = point_residual(camera, o, transform(T_camera_world, o.point), r) && scaled_norm2(r, scale) <= widen * chi2_limit(o);
    inliers += o.inlier ? 1 : 0;
  }
  return inliers;
}

/// Median of the squared norm of two Gaussian components: 2 ln 2.
inline constexpr double kMedianNorm2 = 1.3862943611198906;

/// Noise of u and v in units of sigma, from the median residual of the inliers.
[[nodiscard]] inline double pixel_noise_scale(const Pinhole& camera, const std::vector<PointObservation>& observations,
                                              const Pose& T_camera_world, std::vector<float>& scratch) {
  scratch.clear();
  Eigen::Vector3d r;
  for (const PointObservation& o : observations) {
    if (o.inlier && point_residual(camera, o, transform(T_camera_world, o.point), r)) {
      scratch.push_back(static_cast<float>(r.x() * r.x() + r.y() * r.y()));
    }
  }
  if (scratch.empty()) return 1;
  return std::clamp(std::sqrt(static_cast<double>(upper_median(scratch)) / kMedianNorm2), kMinPixelScale, 1.0);
}

namespace detail {
/// Normal equations H x = b of a Gauss-Newton step on the pose.
struct PoseEquations {
  Matrix6 H;
  Twist b;
};
/// With M = w J^T J of a point p in the camera, J the derivative with respect to p, the blocks of H are sum M, sum [p]x M and
/// -sum [p]x M [p]x. u does not depend on y, nor v on x, so that M_01 is 0: half as many multiplications as J_twist^T J_twist takes.
/// \param per_pixel inverse of the noise of u and v, in sigma
/// \param robust weigh by Geman-McClure; else all inliers count alike
inline PoseEquations pose_equations(const Pinhole& camera, const std::vector<PointObservation>& observations, const Pose& T_camera_world,
                                    double per_pixel, bool robust) {
  double vv[3][3] = {}, wv[3][3] = {}, ww[3][3] = {}, v[3] = {}, w[3] = {};
  Eigen::Vector3d r;
  Eigen::Matrix3d J;
  for (const PointObservation& o : observations) {
    if (!o.inlier) continue;
    const Eigen::Vector3d p = transform(T_camera_world, o.point);
    if (!point_residual(camera, o, p, r, &J)) continue;
    const double limit = chi2_limit(o);
    const double squared = per_pixel * per_pixel;
    const double share = limit / (limit + squared * (r(0) * r(0) + r(1) * r(1)) + r(2) * r(2));
    const double weight = o.weight * (robust ? share * share : 1.0);
    const double pixel_weight = weight * squared;
    const double u0 = pixel_weight * J(0, 0), v1 = pixel_weight * J(1, 1), d2 = weight * J(2, 2);
    const double M00 = u0 * J(0, 0), M02 = u0 * J(0, 2), M11 = v1 * J(1, 1), M12 = v1 * J(1, 2);
    const double M22 = pixel_weight * (J(0, 2) * J(0, 2) + J(1, 2) * J(1, 2)) + d2 * J(2, 2);
    const double f0 = u0 * r(0), f1 = v1 * r(1);
    const double f2 = pixel_weight * (J(0, 2) * r(0) + J(1, 2) * r(1)) + d2 * r(2);
    const double x = p.x(), y = p.y(), z = p.z();
    const double R[3][3] = {{y * M02, y * M12 - z * M11, y * M22 - z * M12},  // [p]x M
                            {z * M00 - x * M02, -x * M12, z * M02 - x * M22},
                            {-y * M00, x * M11, x * M12 - y * M02}};
    vv[0][0] += M00;
    vv[2][0] += M02;
    vv[1][1] += M11;
    vv[2][1] += M12;
    vv[2][2] += M22;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) wv[i][j] += R[i][j];
    }
    ww[0][0] += y * R[0][2] - z * R[0][1];
    ww[1][0] += y * R[1][2] - z * R[1][1];
    ww[2][0] += y * R[2][2] - z * R[2][1];
    ww[1][1] += z * R[1][0] - x * R[1][2];
    ww[2][1] += z * R[2][0] - x * R[2][2];
    ww[2][2] += x * R[2][1] - y * R[2][0];
    v[0] -= f0;
    v[1] -= f1;
    v[2] -= f2;
    w[0] -= y * f2 - z * f1;
    w[1] -= z * f0 - x * f2;
    w[2] -= x * f1 - y * f0;
  }
  PoseEquations e;
  double trace = 0;
  for (int i = 0; i < 3; ++i) {
    trace += vv[i][i] + ww[i][i];
    for (int j = 0; j < 3; ++j) {
      e.H(i, j) = vv[std::max(i, j)][std::min(i, j)];
      e.H(3 + i, 3 + j) = ww[std::max(i, j)][std::min(i, j)];
      e.H(3 + i, j) = e.H(j, 3 + i) = wv[i][j];
    }
    e.b(i) = v[i];
    e.b(3 + i) = w[i];
  }
  for (int i = 0; i < 6; ++i) e.H(i, i) += 1e-9 * trace + 1e-12;
  return e;
}
}  // namespace detail

/// Information of a pose that somebody else has found from these observations: of the twist that multiplies T_camera_world from the
/// left, as in PoseOptimisation. Those marked as inliers count, each the less the worse it fits. Zero for fewer than kMinPoseInliers.
[[nodiscard]] inline Matrix6 pose_information(const Pinhole& camera, const std::vector<PointObservation>& observations,
                                              const Pose& T_world_camera) {
  const auto inliers = std::count_if(observations.begin(), observations.end(), [](const PointObservation& o) { return o.inlier; });
  if (inliers < kMinPoseInliers || !is_finite(T_world_camera)) return zeros<Matrix6>();
  const Pose T_camera_world = inverse(T_world_camera);
  std::vector<float> scratch;
  const double scale = pixel_noise_scale(camera, observations, T_camera_world, scratch);
  return detail::pose_equations(camera, observations, T_camera_world, 1 / scale, true).H;
}

/// Pose that minimises the robust cost of the observations, starting at T_world_camera.
///
/// The kernel is Geman-McClure with the 95 % chi-square points as bounds: what is far off at the start has no pull.
/// Huber's has, and a moving body in front of a distant wall then drags the pose along, because a small turn and a
/// small shift together explain both. For the same reason the noise is measured (pixel_noise_scale) and not assumed:
/// at half a pixel the wall says clearly that the camera did not turn, at one or two pixels it does not. The last two
/// rounds use the inliers without kernel. When most observations are far off at the start, all take part at first.
[[nodiscard]] inline PoseOptimisation optimise_pose(const Pinhole& camera, std::vector<PointObservation>& observations,
                                                    const Pose& T_world_camera, const PoseOptimisationOptions& options = {}) {
  constexpr double kFarOff = 16;              // on squared residuals: four times the bound
  constexpr double kEnoughForInliers = 1e-4;  // a step by less leaves the inliers of the next round what they are [m, rad]
  PoseOptimisation result;
  result.T_world_camera = T_world_camera;
  result.status = Status::TooFewMatches;
  if (static_cast<int>(observations.size()) < kMinPoseInliers) return result;
  Pose T = inverse(T_world_camera);
  if (2 * mark_inliers(camera, observations, T_world_camera, 1, kFarOff) < static_cast<int>(observations.size())) {
    for (PointObservation& o : observations) o.inlier = true;
  }
  Matrix6 information = zeros<Matrix6>();
  std::vector<float> scratch;
  double scale = 1;
  for (int round = 0; round < options.rounds; ++round) {
    const bool robust = round + 2 < options.rounds || options.rounds < 3;
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
      if (robust) scale = pixel_noise_scale(camera, observations, T, scratch);
      const detail::PoseEquations e = detail::pose_equations(camera, observations, T, 1 / scale, robust);
      const Twist step = solve_symmetric(e.H, e.b);
      if (!all_finite(step)) {
        result.status = Status::SingularSystem;
        return result;
      }
      if (norm(step) > 2.0) {  // two metres or radians in one step is no refinement
        result.status = Status::Diverged;
        return result;
      }
      T = normalized(compose(se3_exp(step), T));
      information = e.H;
      if (norm(step) < (round + 1 < options.rounds ? kEnoughForInliers : 1e-6)) break;
    }
    scale = pixel_noise_scale(camera, observations, T, scratch);
    result.inliers = mark_inliers(camera, observations, inverse(T), scale);
    if (result.inliers < kMinPoseInliers) return result;
  }
  result.status = Status::Converged;
  result.T_world_camera = inverse(T);
  result.information = information;
  return result;
}

APSO_NAMESPACE_END
