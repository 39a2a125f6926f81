/// \file
/// Rigid motions: exponential, logarithm, screw-linear interpolation.
///
/// T_a_b maps points of frame b into frame a. A twist is (v, w): translation [m] first, rotation [rad] second.
/// Increments multiply from the left: T <- se3_exp(delta) * T.
#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// A rigid motion. Unaligned on purpose: its layout must not change with the compiler flags of the user.
using Pose = Eigen::Transform<double, 3, Eigen::Isometry, Eigen::DontAlign>;
using Twist = Eigen::Matrix<double, 6, 1, Eigen::DontAlign>;
using Matrix6 = Eigen::Matrix<double, 6, 6, Eigen::DontAlign>;

/// Cross-product matrix: skew(a) b = a x b.
[[nodiscard]] inline Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

/// Rotation of the vector w (axis times angle [rad]) as a unit quaternion; exact near 0.
[[nodiscard]] inline Eigen::Quaterniond so3_exp(const Eigen::Vector3d& w) {
  const double theta2 = w.squaredNorm();
  const double theta = std::sqrt(theta2);
  // sin(theta/2)/theta, by its series where the quotient loses digits
  const double s = theta < 1e-4 ? 0.5 - theta2 / 48.0 : std::sin(0.5 * theta) / theta;
  Eigen::Quaterniond q(std::cos(0.5 * theta), s * w.x(), s * w.y(), s * w.z());
  q.normalize();
  return q;
}

/// Rotation vector of a unit quaternion, angle in [0, pi] [rad]; exact near 0 and near pi.
[[nodiscard]] inline Eigen::Vector3d so3_log(const Eigen::Quaterniond& q_in) {
  const double sign = q_in.w() < 0 ? -1.0 : 1.0;  // q and -q are the same rotation; take the short way
  const Eigen::Vector3d v = sign * q_in.vec();
  const double w = sign * q_in.w();
  const double n = v.norm();
  // 2 atan2(n, w) / n, by its series for small n: 2/w (1 - n^2/(3 w^2))
  const double f = n < 1e-6 ? 2.0 / w * (1.0 - n * n / (3.0 * w * w)) : 2.0 * std::atan2(n, w) / n;
  return f * v;
}

/// Exponential of a twist (v, w).
[[nodiscard]] inline Pose se3_exp(const Twist& xi) {
  const Eigen::Vector3d v = xi.head<3>();
  const Eigen::Vector3d w = xi.tail<3>();
  const double theta2 = w.squaredNorm();
  const double theta = std::sqrt(theta2);
  double a;  // (1 - cos)/theta^2
  double b;  // (theta - sin)/theta^3
  if (theta < 1e-3) {
    a = 0.5 - theta2 / 24.0;
    b = 1.0 / 6.0 - theta2 / 120.0;
  } else {
    const double s = std::sin(0.5 * theta);
    a = 2.0 * s * s / theta2;
    b = (theta - std::sin(theta)) / (theta2 * theta);
  }
  const Eigen::Vector3d wv = w.cross(v);
  Pose T = Pose::Identity();
  T.linear() = so3_exp(w).toRotationMatrix();
  T.translation() = v + a * wv + b * w.cross(wv);
  return T;
}

/// Logarithm of a rigid motion, rotation angle in [0, pi].
[[nodiscard]] inline Twist se3_log(const Pose& T) {
  const Eigen::Matrix3d R = T.linear();
  const Eigen::Vector3d w = so3_log(Eigen::Quaterniond(R));
  const Eigen::Vector3d t = T.translation();
  const double theta2 = w.squaredNorm();
  const double theta = std::sqrt(theta2);
  // V^-1 = I - 1/2 [w] + c [w]^2 with c = (1 - (theta/2) cot(theta/2)) / theta^2
  double c;
  if (theta < 1e-3) {
    c = 1.0 / 12.0 + theta2 / 720.0;
  } else {
    const double h = 0.5 * theta;
    c = (1.0 - h * std::cos(h) / std::sin(h)) / theta2;
  }
  const Eigen::Vector3d wt = w.cross(t);
  Twist xi;
  xi.head<3>() = t - 0.5 * wt + c * w.cross(wt);
  xi.tail<3>() = w;
  return xi;
}

/// Inverse without a matrix factorisation.
[[nodiscard]] inline Pose inverse(const Pose& T) {
  Pose r = Pose::Identity();
  r.linear() = T.linear().transpose();
  r.translation() = -(T.linear().transpose() * T.translation());
  return r;
}

/// Nearest rotation: removes the drift that products of many poses gather.
[[nodiscard]] inline Pose normalized(const Pose& T) {
  Pose r = T;
  const Eigen::Matrix3d R = T.linear();
  r.linear() = Eigen::Quaterniond(R).normalized().toRotationMatrix();
  return r;
}

/// Rotation angle of a motion [rad], in [0, pi].
[[nodiscard]] inline double rotation_angle(const Pose& T) {
  const Eigen::Matrix3d R = T.linear();
  return so3_log(Eigen::Quaterniond(R)).norm();
}

/// True when every element is finite.
[[nodiscard]] inline bool is_finite(const Pose& T) { return T.matrix().allFinite(); }

/// Screw-linear interpolation T_0 Exp(s Log(T_0^-1 T_1)); s = 0 gives T_0 and s = 1 gives T_1 exactly.
/// It is left- and right-invariant, so it does not matter whether T_w_c or T_c_w is blended.
[[nodiscard]] inline Pose sclerp(const Pose& T_0, const Pose& T_1, double s) {
  if (s <= 0) return T_0;
  if (s >= 1) return T_1;
  const Twist xi = s * se3_log(inverse(T_0) * T_1);
  return T_0 * se3_exp(xi);
}

APSO_NAMESPACE_END
