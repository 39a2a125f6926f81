/// \file
/// The 6x6 normal equations of a Gauss-Newton step, and the sums over the pixels of a tile that they are made of.
///
///     H = sum gamma (alpha^2 w(s_I)/sigma_I^2 J_I^T J_I + w(s_D)/sigma_D^2 J_D^T J_D)
///     b = -sum gamma (alpha^2 w(s_I)/sigma_I^2 J_I^T r_I + w(s_D)/sigma_D^2 J_D^T r_D)
#pragma once

#include <cstring>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>

APSO_NAMESPACE_BEGIN

struct NormalEquations {
  Matrix6 H = zeros<Matrix6>();
  Twist b = zeros<Twist>();
  NormalEquations& operator+=(const NormalEquations& o) {
    H += o.H;
    b += o.b;
    return *this;
  }
};

/// The sums of one tile, or of several with T = double. The increment is (v, w) in the frame of the reference,
/// T <- T Exp(d).
template <class T>
struct PixelSums {
  T vv[6];   ///< H of v and v: 00 01 02 11 12 22
  T wv[9];   ///< H of w and v, row by row
  T ww[6];   ///< H of w and w
  T v[3];    ///< minus b of v
  T w[3];    ///< minus b of w
  T cost;    ///< robust cost, lost pixels charged
  T weight;  ///< what the cost is divided by
  T lost;    ///< gamma of the pixels without a residual
  static constexpr int kSize = 30;

  [[nodiscard]] NormalEquations equations() const {
    NormalEquations n;
    int k = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j, ++k) {
        n.H(i, j) = n.H(j, i) = static_cast<double>(vv[k]);
        n.H(3 + i, 3 + j) = n.H(3 + j, 3 + i) = static_cast<double>(ww[k]);
      }
      for (int j = 0; j < 3; ++j) n.H(3 + i, j) = n.H(j, 3 + i) = static_cast<double>(wv[3 * i + j]);
      n.b(i) = -static_cast<double>(v[i]);
      n.b(3 + i) = -static_cast<double>(w[i]);
    }
    return n;
  }
};
using TileSums = PixelSums<float>;
static_assert(sizeof(TileSums) == TileSums::kSize * sizeof(float), "TileSums is read as an array");

/// sum += factor * tile.
inline void add(PixelSums<double>& sum, const TileSums& tile, float factor) {
  float from[TileSums::kSize];
  double to[TileSums::kSize];
  std::memcpy(from, &tile, sizeof from);
  std::memcpy(to, &sum, sizeof to);
  for (int i = 0; i < TileSums::kSize; ++i) to[i] += static_cast<double>(factor * from[i]);
  std::memcpy(&sum, to, sizeof to);
}

/// The same equations for an increment from the left, in the frame T maps into: T <- Exp(e) T with e = Ad(T) d.
[[nodiscard]] inline NormalEquations moved_to_left(const NormalEquations& n, const Pose& T) {
  const Matrix6 A = adjoint_inverse(T);
  NormalEquations out;
  out.H = transposed_times(A, n.H) * A;
  out.b = transposed_times(A, n.b);
  return out;
}

APSO_NAMESPACE_END
