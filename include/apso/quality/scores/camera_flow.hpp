/// \file
/// The part of the optical flow that the camera's own motion explains: by an affine flow, by a homography, or by two poses
/// and the depth of the points. S_mc can be measured on what is left.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// One point in the reference and in the current frame.
struct Correspondence {
  float reference_x = 0;  ///< [px]
  float reference_y = 0;  ///< [px]
  float x = 0;            ///< in the current frame [px]
  float y = 0;            ///< in the current frame [px]
};

/// Which flow is measured.
enum class FlowKind {
  Raw,           ///< all of it: motion of the camera counts, because an abrupt change of viewpoint is to be found
  Residual,      ///< what the best affine flow leaves, which takes most of the camera's own motion out
  Homography,    ///< what the best homography leaves: exact for a camera that turns and for a plane
  PosePredicted  ///< what the poses of the two frames and the depth leave; needs both. Points without depth are dropped
};
constexpr std::array<const char*, 4> enum_names(FlowKind) { return {"raw", "residual", "homography", "pose"}; }

/// Displacement of a point [px].
struct PlanarFlow {
  double x = 0;
  double y = 0;
};

/// The affine flow (2x3, applied to (x, y, 1) of the reference) that fits the correspondences best: four rounds of least
/// squares in which flows far from it count less (Cauchy weights, scale 2 px). Zero for fewer than six of them.
[[nodiscard]] inline Eigen::Matrix<double, 2, 3> affine_flow(const std::vector<Correspondence>& matches) {
  Eigen::Matrix<double, 2, 3> A;
  for (int k = 0; k < 6; ++k) A(k / 3, k % 3) = 0;
  for (int round = 0; round < 4; ++round) {
    double H[3][3] = {};  // lower triangle
    double b[2][3] = {};  // right side of each row of A
    int n = 0;
    for (const Correspondence& m : matches) {
      const double x[3] = {static_cast<double>(m.reference_x), static_cast<double>(m.reference_y), 1};
      const double f[2] = {static_cast<double>(m.x) - x[0], static_cast<double>(m.y) - x[1]};
      if (!std::isfinite(x[0]) || !std::isfinite(x[1]) || !(f[0] * f[0] + f[1] * f[1] <= 1e10)) continue;
      double e[2];
      for (int i = 0; i < 2; ++i) e[i] = f[i] - (A(i, 0) * x[0] + A(i, 1) * x[1] + A(i, 2));
      const double w = round == 0 ? 1.0 : 1.0 / (1.0 + (e[0] * e[0] + e[1] * e[1]) / 4.0);
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j <= i; ++j) H[i][j] += w * x[i] * x[j];
        for (int j = 0; j < 2; ++j) b[j][i] += w * x[i] * f[j];
      }
      ++n;
    }
    if (n < 6) return A;
    for (int i = 0; i < 3; ++i) H[i][i] += 1e-6;
    Eigen::Matrix<double, 2, 3> next;
    for (int j = 0; j < 2; ++j) {
      double L[3][3];
      for (int k = 0; k < 9; ++k) L[k / 3][k % 3] = H[k / 3][k % 3];
      solve_definite(L, 3, b[j]);
      for (int i = 0; i < 3; ++i) next(j, i) = b[j][i];
    }
    if (!all_finite(next)) return A;
    A = next;
  }
  return A;
}

/// A homography from the reference to the current frame, in coordinates of about [-1,1]: in pixels its equations would
/// be badly scaled.
struct Homography {
  double h[8] = {1, 0, 0, 0, 1, 0, 0, 0};  ///< row by row, the ninth number is 1
  double scale = 1;                        ///< [1/px]
  double cx = 0;                           ///< [px]
  double cy = 0;                           ///< [px]

  /// Where a point [px] moves by.
  [[nodiscard]] PlanarFlow flow(double u, double v) const {
    const double a = scale * (u - cx);
    const double b = scale * (v - cy);
    const double w = h[6] * a + h[7] * b + 1;
    return {((h[0] * a + h[1] * b + h[2]) / w - a) / scale, ((h[3] * a + h[4] * b + h[5]) / w - b) / scale};
  }
};

/// The homography that fits the correspondences best: six rounds of least squares in which points far from it count less
/// (Cauchy weights, scale 2 px). The identity for fewer than twelve of them.
[[nodiscard]] inline Homography fit_homography(const std::vector<Correspondence>& matches, int width, int height) {
  Homography H;
  H.scale = 2.0 / (width + height);
  H.cx = 0.5 * width;
  H.cy = 0.5 * height;
  const auto along_x = [&](float x) { return H.scale * (static_cast<double>(x) - H.cx); };
  const auto along_y = [&](float y) { return H.scale * (static_cast<double>(y) - H.cy); };
  const double tolerance2 = 4 * H.scale * H.scale;  // (2 px)^2
  for (int round = 0; round < 6; ++round) {
    double A[8][8] = {};  // lower triangle
    double b[8] = {};
    int n = 0;
    for (const Correspondence& m : matches) {
      const double u = along_x(m.reference_x), v = along_y(m.reference_y), x = along_x(m.x), y = along_y(m.y);
      if (!(u * u + v * v + x * x + y * y <= 1e4)) continue;  // not finite or absurd
      const double w = H.h[6] * u + H.h[7] * v + 1;
      const double ex = (H.h[0] * u + H.h[1] * v + H.h[2]) / w - x;
      const double ey = (H.h[3] * u + H.h[4] * v + H.h[5]) / w - y;
      const double weight = (round == 0 ? 1.0 : 1.0 / (1.0 + (ex * ex + ey * ey) / tolerance2)) / (w * w);
      const double rows[2][8] = {{u, v, 1, 0, 0, 0, -x * u, -x * v}, {0, 0, 0, u, v, 1, -y * u, -y * v}};
      const double right[2] = {x, y};
      for (int k = 0; k < 2; ++k) {
        for (int i = 0; i < 8; ++i) {
          for (int j = 0; j <= i; ++j) A[i][j] += weight * rows[k][i] * rows[k][j];
          b[i] += weight * rows[k][i] * right[k];
        }
      }
      ++n;
    }
    if (n < 12) break;
    for (int i = 0; i < 8; ++i) A[i][i] += 1e-9;
    solve_definite(A, 8, b);
    bool finite = true;
    for (const double value : b) finite = finite && std::isfinite(value);
    if (!finite) break;
    for (int i = 0; i < 8; ++i) H.h[i] = b[i];
  }
  return H;
}

/// The flow of the camera's own motion at each correspondence, into `out`. FlowKind::Raw and PosePredicted give none.
inline void camera_flow(FlowKind kind, const std::vector<Correspondence>& matches, int width, int height, std::vector<PlanarFlow>& out) {
  out.assign(matches.size(), PlanarFlow{});
  if (kind == FlowKind::Residual) {
    const Eigen::Matrix<double, 2, 3> A = affine_flow(matches);
    for (std::size_t i = 0; i < matches.size(); ++i) {
      const double u = static_cast<double>(matches[i].reference_x);
      const double v = static_cast<double>(matches[i].reference_y);
      out[i] = {A(0, 0) * u + A(0, 1) * v + A(0, 2), A(1, 0) * u + A(1, 1) * v + A(1, 2)};
    }
  } else if (kind == FlowKind::Homography) {
    const Homography H = fit_homography(matches, width, height);
    for (std::size_t i = 0; i < matches.size(); ++i) {
      out[i] = H.flow(static_cast<double>(matches[i].reference_x), static_cast<double>(matches[i].reference_y));
    }
  }
}

/// The flow that a static point shows between two poses; NaN when it has no depth or falls behind the camera.
/// \param z depth of the point in the reference [m], 0 = none
[[nodiscard]] inline PlanarFlow flow_of_poses(const Pose& T_current_reference, const Pinhole& camera, double u, double v, double z) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  if (!(z > 0)) return {nan, nan};
  const Eigen::Vector3d p = transform(T_current_reference, camera.unproject(u, v, z));
  if (!(p.z() > 0)) return {nan, nan};
  return {camera.fx * p.x() / p.z() + camera.cx - u, camera.fy * p.y() / p.z() + camera.cy - v};
}

APSO_NAMESPACE_END
