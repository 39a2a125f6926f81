/// \file
/// Which directions of a motion the images determine (solution remapping, Zhang, Kaess, Singh, ICRA 2016).
#pragma once

#include <algorithm>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>

APSO_NAMESPACE_BEGIN

/// Share of the largest eigenvalue below which a direction is undetermined (method specification, 5.8).
inline constexpr double kDegenerateRatio = 1e-3;

/// Directions in which a scaled normal matrix is so flat that its solution would be noise. Twists are scaled by D = (l, l, l, 1, 1, 1)
/// with l the typical depth, which makes metres and radians comparable: a twist is D times a scaled twist.
struct Degeneracy {
  Matrix6 projector = zeros<Matrix6>();  ///< onto the undetermined directions, for scaled twists
  int count = 0;

  /// \param scaled normal matrix of scaled twists
  /// \param ratio share of the largest eigenvalue that is too little
  Degeneracy(const Matrix6& scaled, double ratio) {
    double trace = 0;  // at least the largest eigenvalue
    for (int i = 0; i < 6; ++i) trace += scaled(i, i);
    if (eigenvalues_exceed(std::max(ratio * trace, kFloor), scaled)) return;
    const SymmetricEigen<6> eigen = eigen_symmetric(scaled);
    for (int i = 0; i < 6; ++i) {
      const double value = eigen.values(i);
      if (!(value < ratio * eigen.values(5)) && !(value < kFloor)) continue;
      for (int r = 0; r < 6; ++r) {
        for (int c = 0; c < 6; ++c) projector(r, c) += eigen.vectors(r, i) * eigen.vectors(c, i);
      }
      ++count;
    }
  }

  /// Onto the determined directions.
  [[nodiscard]] Matrix6 keep() const { return identity<Matrix6>() - projector; }
  /// The normal matrix within the determined directions, and `fill` times the identity on the others, so that it stays regular.
  [[nodiscard]] Matrix6 regular(const Matrix6& scaled, double fill) const { return keep() * scaled * keep() + fill * projector; }

 private:
  static constexpr double kFloor = 50;  // eigenvalue below which a direction is undetermined, whatever the others are
};

/// D: what a scaled twist is multiplied by.
[[nodiscard]] inline Twist unit_twist(double depth) {
  Twist D;
  for (int i = 0; i < 6; ++i) D(i) = i < 3 ? depth : 1.0;
  return D;
}

APSO_NAMESPACE_END
