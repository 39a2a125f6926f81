/// \file
/// The rigid motion that lays points onto points, in closed form.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>

APSO_NAMESPACE_BEGIN

/// The rigid motion that lays one set of points onto another.
struct HornAlignment {
  Pose T_target_source = identity_pose();
  /// Directions the points fix: 3 in space, 2 in a plane (still unique), 1 on a line, 0 in one point. Below 2 the
  /// rotation is one of many that are equally good.
  int rank = 0;
};

/// Least-squares rigid motion without scale: minimises sum |R source_i + t - target_i|^2 over proper rotations R
/// (det R = +1, also for planar and mirrored points). Closed form: the unit quaternion of R is the eigenvector of the
/// largest eigenvalue of a symmetric 4x4 matrix made of the cross-covariance, B. K. P. Horn, JOSA A 1987.
/// \param target,source points of the same length [m], at least one
[[nodiscard]] inline HornAlignment align_horn(const std::vector<Eigen::Vector3d>& target, const std::vector<Eigen::Vector3d>& source) {
  expects(!target.empty() && target.size() == source.size(), "align_horn: need equally many points, at least one");
  const double n = static_cast<double>(target.size());
  Eigen::Vector3d mean_target(0, 0, 0);
  Eigen::Vector3d mean_source(0, 0, 0);
  for (std::size_t i = 0; i < target.size(); ++i) {
    mean_target += target[i];
    mean_source += source[i];
  }
  mean_target *= 1.0 / n;
  mean_source *= 1.0 / n;
  expects(all_finite(mean_target) && all_finite(mean_source), "align_horn: points must be finite");
  double S[3][3] = {};  // sum of source times target^T, as in the article
  double spread_target = 0;
  double spread_source = 0;
  for (std::size_t i = 0; i < target.size(); ++i) {
    const Eigen::Vector3d q = target[i] - mean_target;
    const Eigen::Vector3d p = source[i] - mean_source;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) S[r][c] += p(r) * q(c);
    }
    spread_target += squared_norm(q);
    spread_source += squared_norm(p);
  }
  HornAlignment result;
  const double scale = std::sqrt(spread_target) * std::sqrt(spread_source);
  expects(std::isfinite(scale), "align_horn: points must be finite and not overflow when squared");
  // Points that only differ by rounding have no spread: 1e-12 of the coordinates' own size.
  const double rounding = 1e-12 * std::max(norm(mean_target), norm(mean_source));
  const bool spread = scale > 0 && std::sqrt(spread_target / n) > rounding && std::sqrt(spread_source / n) > rounding;
  Eigen::Quaterniond q(1, 0, 0, 0);
  if (spread) {
    for (auto& row : S) {
      for (double& s : row) s /= scale;
    }
    double N[4][4];  // lower triangle
    N[0][0] = S[0][0] + S[1][1] + S[2][2];
    N[1][0] = S[1][2] - S[2][1];
    N[2][0] = S[2][0] - S[0][2];
    N[3][0] = S[0][1] - S[1][0];
    N[1][1] = S[0][0] - S[1][1] - S[2][2];
    N[2][1] = S[0][1] + S[1][0];
    N[3][1] = S[2][0] + S[0][2];
    N[2][2] = S[1][1] - S[0][0] - S[2][2];
    N[3][2] = S[1][2] + S[2][1];
    N[3][3] = S[2][2] - S[0][0] - S[1][1];
    double values[4];
    double vectors[4][4];
    eigen_symmetric(N, values, vectors);
    // With the largest eigenvalue l_0, (l_0 + l_k) / 2 are the singular values of S (the last one signed).
    for (int k = 0; k < 3; ++k) result.rank += std::abs(values[3] + values[k]) > 2e-12 ? 1 : 0;
    q = unit({vectors[0][3], vectors[1][3], vectors[2][3], vectors[3][3]});
  }
  const Eigen::Matrix3d R = rotation(q);
  result.T_target_source = make_pose(R, mean_target - R * mean_source);
  return result;
}

APSO_NAMESPACE_END
