/// \file
/// Rigid motions: exponential, logarithm, screw-linear interpolation.
///
/// T_a_b maps points of frame b into frame a. A twist is (v, w): translation [m] first, rotation [rad] second.
/// Increments multiply from the left: T <- compose(se3_exp(delta), T), which is se3_exp(delta) * T.
/// Functions of a pose or a twist that is not finite give one that is not finite either, never a finite wrong one: check the
/// result once, with is_finite() or all_finite().
#pragma once

#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/math/small_matrix.hpp>

APSO_NAMESPACE_BEGIN

/// A rigid motion. Unaligned on purpose: its layout must not change with the compiler flags of the user.
using Pose = Eigen::Transform<double, 3, Eigen::Isometry, Eigen::DontAlign>;
using Twist = Eigen::Matrix<double, 6, 1, Eigen::DontAlign>;
using Matrix6 = Eigen::Matrix<double, 6, 6, Eigen::DontAlign>;

/// Rotation of a motion as a matrix.
[[nodiscard]] inline Eigen::Matrix3d rotation(const Pose& T) {
  Eigen::Matrix3d R;
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) R(i, j) = T(i, j);
  }
  return R;
}

/// Translation of a motion [m].
[[nodiscard]] inline Eigen::Vector3d translation(const Pose& T) { return {T(0, 3), T(1, 3), T(2, 3)}; }

/// The motion p -> R p + t.
[[nodiscard]] APSO_NOINLINE inline Pose make_pose(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
  Pose::MatrixType T;  // a Pose without values would set its last row by an expression, in every place that makes one
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) T(i, j) = R(i, j);
    T(3, j) = 0;
  }
  for (int i = 0; i < 3; ++i) T(i, 3) = t(i);
  T(3, 3) = 1;
  return Pose(T);
}

/// No motion. Pose::Identity() is the same, but assigns an expression.
[[nodiscard]] APSO_NOINLINE inline Pose identity_pose() { return Pose(identity<Pose::MatrixType>()); }

/// T_a_b p_b, the point in frame a.
[[nodiscard]] inline Eigen::Vector3d transform(const Pose& T, const Eigen::Vector3d& p) {
  return {T(0, 0) * p(0) + T(0, 1) * p(1) + T(0, 2) * p(2) + T(0, 3), T(1, 0) * p(0) + T(1, 1) * p(1) + T(1, 2) * p(2) + T(1, 3),
          T(2, 0) * p(0) + T(2, 1) * p(1) + T(2, 2) * p(2) + T(2, 3)};
}

/// T_a_b T_b_c = T_a_c.
[[nodiscard]] APSO_NOINLINE inline Pose compose(const Pose& T_a_b, const Pose& T_b_c) {
  return make_pose(rotation(T_a_b) * rotation(T_b_c), transform(T_a_b, translation(T_b_c)));
}

/// A motion in float, for loops over pixels.
struct FloatPose {
  float R[3][3];
  float t[3];
  explicit FloatPose(const Pose& T) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R[i][j] = static_cast<float>(T(i, j));
      t[i] = static_cast<float>(T(i, 3));
    }
  }
  /// R (x, y, z).
  [[nodiscard]] Eigen::Vector3f rotate(float x, float y, float z) const {
    return {R[0][0] * x + R[0][1] * y + R[0][2] * z, R[1][0] * x + R[1][1] * y + R[1][2] * z, R[2][0] * x + R[2][1] * y + R[2][2] * z};
  }
  /// R (x, y, z) + t.
  [[nodiscard]] Eigen::Vector3f operator()(float x, float y, float z) const {
    return {R[0][0] * x + R[0][1] * y + R[0][2] * z + t[0], R[1][0] * x + R[1][1] * y + R[1][2] * z + t[1],
            R[2][0] * x + R[2][1] * y + R[2][2] * z + t[2]};
  }
};

/// Cross-product matrix: skew(a) b = a x b.
[[nodiscard]] inline Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m(0, 0) = m(1, 1) = m(2, 2) = 0;
  m(2, 1) = a.x();
  m(1, 2) = -a.x();
  m(0, 2) = a.y();
  m(2, 0) = -a.y();
  m(1, 0) = a.z();
  m(0, 1) = -a.z();
  return m;
}

/// q / |q|.
[[nodiscard]] inline Eigen::Quaterniond unit(const Eigen::Quaterniond& q) {
  const double n = std::sqrt(q.w() * q.w() + q.x() * q.x() + q.y() * q.y() + q.z() * q.z());
  return n > 0 ? Eigen::Quaterniond(q.w() / n, q.x() / n, q.y() / n, q.z() / n) : q;
}

/// Rotation matrix of a unit quaternion.
[[nodiscard]] inline Eigen::Matrix3d rotation(const Eigen::Quaterniond& q) {
  const double w = q.w(), x = q.x(), y = q.y(), z = q.z();
  Eigen::Matrix3d R;
  R(0, 0) = 1 - 2 * (y * y + z * z);
  R(0, 1) = 2 * (x * y - w * z);
  R(0, 2) = 2 * (x * z + w * y);
  R(1, 0) = 2 * (x * y + w * z);
  R(1, 1) = 1 - 2 * (x * x + z * z);
  R(1, 2) = 2 * (y * z - w * x);
  R(2, 0) = 2 * (x * z - w * y);
  R(2, 1) = 2 * (y * z + w * x);
  R(2, 2) = 1 - 2 * (x * x + y * y);
  return R;
}

/// Unit quaternion of the rotation of a motion, from the largest of its four components, which loses no digits
/// (Shepperd, J. Guidance and Control 1978).
[[nodiscard]] APSO_NOINLINE inline Eigen::Quaterniond quaternion(const Pose& T) {
  if (!all_finite(rotation(T))) {  // an infinite trace would divide the rest away
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    return {kNaN, kNaN, kNaN, kNaN};
  }
  double q[4];  // x, y, z, w
  const double trace = T(0, 0) + T(1, 1) + T(2, 2);
  if (trace > 0) {
    double s = std::sqrt(trace + 1.0);
    q[3] = 0.5 * s;
    s = 0.5 / s;
    q[0] = (T(2, 1) - T(1, 2)) * s;
    q[1] = (T(0, 2) - T(2, 0)) * s;
    q[2] = (T(1, 0) - T(0, 1)) * s;
  } else {
    int i = T(1, 1) > T(0, 0) ? 1 : 0;
    if (T(2, 2) > T(i, i)) i = 2;
    const int j = (i + 1) % 3;
    const int k = (j + 1) % 3;
    double s = std::sqrt(T(i, i) - T(j, j) - T(k, k) + 1.0);
    q[i] = 0.5 * s;
    s = 0.5 / s;
    q[3] = (T(k, j) - T(j, k)) * s;
    q[j] = (T(j, i) + T(i, j)) * s;
    q[k] = (T(k, i) + T(i, k)) * s;
  }
  return {q[3], q[0], q[1], q[2]};
}

/// Rotation between two unit quaternions at constant angular velocity along the shorter way; s = 0 gives a, 1 gives b.
[[nodiscard]] inline Eigen::Quaterniond slerp(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b, double s) {
  const double d = a.w() * b.w() + a.x() * b.x() + a.y() * b.y() + a.z() * b.z();
  const double cosine = std::abs(d);
  double from = 1 - s;
  double to = s;
  if (cosine < 1 - 1e-15) {  // else the two are the same to rounding
    const double theta = std::acos(cosine);
    from = std::sin((1 - s) * theta) / std::sin(theta);
    to = std::sin(s * theta) / std::sin(theta);
  }
  if (d < 0) to = -to;
  return {from * a.w() + to * b.w(), from * a.x() + to * b.x(), from * a.y() + to * b.y(), from * a.z() + to * b.z()};
}

/// Rotation of the vector w (axis times angle [rad]) as a unit quaternion; exact near 0.
[[nodiscard]] APSO_NOINLINE inline Eigen::Quaterniond so3_exp(const Eigen::Vector3d& w) {
  const double theta2 = squared_norm(w);
  const double theta = std::sqrt(theta2);
  // sin(theta/2)/theta, by its series where the quotient loses digits
  const double s = theta < 1e-4 ? 0.5 - theta2 / 48.0 : std::sin(0.5 * theta) / theta;
  return unit({std::cos(0.5 * theta), s * w.x(), s * w.y(), s * w.z()});
}

/// Rotation vector of a unit quaternion, angle in [0, pi] [rad]; exact near 0 and near pi.
[[nodiscard]] inline Eigen::Vector3d so3_log(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0 ? -1.0 : 1.0;  // q and -q are the same rotation; take the short way
  const double w = sign * q.w();
  const double n = std::sqrt(q.x() * q.x() + q.y() * q.y() + q.z() * q.z());
  // 2 atan2(n, w) / n, by its series for small n: 2/w (1 - n^2/(3 w^2))
  const double f = sign * (n < 1e-6 ? 2.0 / w * (1.0 - n * n / (3.0 * w * w)) : 2.0 * std::atan2(n, w) / n);
  return {f * q.x(), f * q.y(), f * q.z()};
}

/// Exponential of a twist (v, w). Not finite for a twist that is not.
[[nodiscard]] APSO_NOINLINE inline Pose se3_exp(const Twist& xi) {
  const Eigen::Vector3d v(xi(0), xi(1), xi(2));
  const Eigen::Vector3d w(xi(3), xi(4), xi(5));
  const double theta2 = squared_norm(w);
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
  const Eigen::Vector3d wv = cross(w, v);
  const Eigen::Vector3d wwv = cross(w, wv);
  return make_pose(rotation(so3_exp(w)), v + (a * wv + b * wwv));
}

/// Logarithm of a rigid motion, rotation angle in [0, pi]. Not finite for a motion that is not.
[[nodiscard]] APSO_NOINLINE inline Twist se3_log(const Pose& T) {
  const Eigen::Vector3d w = so3_log(quaternion(T));
  const Eigen::Vector3d t = translation(T);
  const double theta2 = squared_norm(w);
  const double theta = std::sqrt(theta2);
  // V^-1 = I - 1/2 [w] + c [w]^2 with c = (1 - (theta/2) cot(theta/2)) / theta^2
  double c;
  if (theta < 1e-3) {
    c = 1.0 / 12.0 + theta2 / 720.0;
  } else {
    const double h = 0.5 * theta;
    c = (1.0 - h * std::cos(h) / std::sin(h)) / theta2;
  }
  const Eigen::Vector3d wt = cross(w, t);
  const Eigen::Vector3d wwt = cross(w, wt);
  Twist xi;
  for (int i = 0; i < 3; ++i) {
    xi(i) = t(i) - 0.5 * wt(i) + c * wwt(i);
    xi(3 + i) = w(i);
  }
  return xi;
}

/// Lengths of the two parts of a twist.
[[nodiscard]] inline double translation_norm(const Twist& xi) { return std::sqrt(xi(0) * xi(0) + xi(1) * xi(1) + xi(2) * xi(2)); }
[[nodiscard]] inline double rotation_norm(const Twist& xi) { return std::sqrt(xi(3) * xi(3) + xi(4) * xi(4) + xi(5) * xi(5)); }

/// Inverse without a matrix factorisation.
[[nodiscard]] APSO_NOINLINE inline Pose inverse(const Pose& T) {
  Pose::MatrixType r;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) r(i, j) = T(j, i);
    r(i, 3) = -(T(0, i) * T(0, 3) + T(1, i) * T(1, 3) + T(2, i) * T(2, 3));
    r(3, i) = 0;
  }
  r(3, 3) = 1;
  return Pose(r);
}

/// Nearest rotation: removes the drift that products of many poses gather.
[[nodiscard]] APSO_NOINLINE inline Pose normalized(const Pose& T) { return make_pose(rotation(unit(quaternion(T))), translation(T)); }

/// Ad(T)^-1 = [R^T, -R^T [t]x; 0, R^T]: an increment from the left, Exp(e) T, as one from the right, T Exp(d).
[[nodiscard]] inline Matrix6 adjoint_inverse(const Pose& T) {
  const Eigen::Matrix3d R = rotation(T);
  const Eigen::Matrix3d B = transposed_times(R, skew(translation(T)));
  Matrix6 A = zeros<Matrix6>();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      A(i, j) = A(3 + i, 3 + j) = R(j, i);
      A(i, 3 + j) = -B(i, j);
    }
  }
  return A;
}

/// Rotation angle of a motion [rad], in [0, pi].
[[nodiscard]] APSO_NOINLINE inline double rotation_angle(const Pose& T) { return norm(so3_log(quaternion(T))); }

/// True when every element is finite.
[[nodiscard]] inline bool is_finite(const Pose& T) { return all_finite(T.matrix()); }

/// Limits of is_rigid(): farther away a double no longer resolves a micrometre, and a rotation that is less exact than what
/// drifting products of floats make is none.
inline constexpr double kMaxDistance = 1e9;         ///< of a pose from the origin [m]
inline constexpr double kRotationTolerance = 0.01;  ///< of the elements of R^T R - I

/// True for a rigid motion that can be computed with: R right-handed and orthonormal within kRotationTolerance, t within
/// kMaxDistance. False when an element is not finite, and for finite ones whose products overflow.
[[nodiscard]] APSO_NOINLINE inline bool is_rigid(const Pose& T) {
  const auto column = [&](int j) { return Eigen::Vector3d(T(0, j), T(1, j), T(2, j)); };
  for (int i = 0; i < 3; ++i) {
    if (!(std::abs(T(i, 3)) <= kMaxDistance)) return false;  // true for NaN, as below
    for (int j = 0; j <= i; ++j) {
      if (!(std::abs(dot(column(i), column(j)) - (i == j ? 1.0 : 0.0)) <= kRotationTolerance)) return false;
    }
  }
  return dot(cross(column(0), column(1)), column(2)) > 0 && is_finite(T);
}

/// Screw-linear interpolation T_0 Exp(s Log(T_0^-1 T_1)); s = 0 gives T_0 and s = 1 gives T_1 exactly.
/// It is left- and right-invariant, so it does not matter whether T_w_c or T_c_w is blended. A NaN s gives a pose that is not
/// finite.
[[nodiscard]] inline Pose sclerp(const Pose& T_0, const Pose& T_1, double s) {
  if (s <= 0) return T_0;
  if (s >= 1) return T_1;
  return compose(T_0, se3_exp(s * se3_log(compose(inverse(T_0), T_1))));
}

APSO_NAMESPACE_END
