/// \file
/// The epipolar geometry of two images from pairs of points: fundamental matrix and distance to its lines.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/linear_congruential.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>

APSO_NAMESPACE_BEGIN

/// A point in two images.
struct PointPair {
  Eigen::Vector2d past;     ///< [px]
  Eigen::Vector2d current;  ///< [px]
};

/// Distance of the current point to the epipolar line F past [px]; 0 where the line is not defined.
[[nodiscard]] inline double epipolar_distance(const Eigen::Matrix3d& F, const PointPair& p) {
  const Eigen::Vector3d line = F * Eigen::Vector3d(p.past.x(), p.past.y(), 1.0);
  const double n = std::sqrt(line.x() * line.x() + line.y() * line.y());
  return n > 1e-12 ? std::abs(line.x() * p.current.x() + line.y() * p.current.y() + line.z()) / n : 0.0;
}

/// Fundamental matrix of eight or more pairs by the normalised eight-point algorithm (Hartley, PAMI 1997):
/// current^T F past = 0, rank 2, Frobenius norm 1. False when the pairs do not determine it.
[[nodiscard]] inline bool eight_point(const std::vector<PointPair>& pairs, const std::vector<int>& chosen, Eigen::Matrix3d& F) {
  if (chosen.size() < 8) return false;
  const auto point = [&](int i, int image) -> const Eigen::Vector2d& {
    const PointPair& p = pairs[static_cast<std::size_t>(i)];
    return image == 0 ? p.past : p.current;
  };
  const auto n = static_cast<double>(chosen.size());
  Eigen::Matrix3d N[2];  // what makes the points of an image centred and of mean distance sqrt(2)
  for (int k = 0; k < 2; ++k) {
    double x = 0;
    double y = 0;
    for (int i : chosen) {
      x += point(i, k).x() / n;
      y += point(i, k).y() / n;
    }
    double spread = 0;
    for (int i : chosen) {
      const double dx = point(i, k).x() - x;
      const double dy = point(i, k).y() - y;
      spread += std::sqrt(dx * dx + dy * dy);
    }
    if (!(spread > 1e-9)) return false;
    const double s = std::sqrt(2.0) * n / spread;
    N[k] = zeros<Eigen::Matrix3d>();
    N[k](0, 0) = N[k](1, 1) = s;
    N[k](0, 2) = -s * x;
    N[k](1, 2) = -s * y;
    N[k](2, 2) = 1;
  }
  double A[9][9] = {};  // lower triangle
  for (int i : chosen) {
    const Eigen::Vector3d a = N[0] * Eigen::Vector3d(point(i, 0).x(), point(i, 0).y(), 1.0);
    const Eigen::Vector3d b = N[1] * Eigen::Vector3d(point(i, 1).x(), point(i, 1).y(), 1.0);
    double row[9];
    for (int k = 0; k < 9; ++k) row[k] = b(k / 3) * a(k % 3);
    for (int k = 0; k < 9; ++k) {
      for (int l = 0; l <= k; ++l) A[k][l] += row[k] * row[l];
    }
  }
  double values[9];
  double vectors[9][9];
  eigen_symmetric(A, values, vectors);
  if (!(values[1] > 1e-12 * values[8])) return false;
  Eigen::Matrix3d M;
  for (int k = 0; k < 9; ++k) M(k / 3, k % 3) = vectors[k][0];
  // the nearest matrix of rank 2 lacks the direction v of the smallest singular value: M - M v v^T
  double squared[3][3];
  double squares[3];
  double directions[3][3];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) squared[r][c] = M(0, r) * M(0, c) + M(1, r) * M(1, c) + M(2, r) * M(2, c);
  }
  eigen_symmetric(squared, squares, directions);
  for (int r = 0; r < 3; ++r) {
    double along = 0;
    for (int c = 0; c < 3; ++c) along += M(r, c) * directions[c][0];
    for (int c = 0; c < 3; ++c) M(r, c) -= along * directions[c][0];
  }
  F = transposed_times(N[1], M) * N[0];
  double sum = 0;
  for (int k = 0; k < 9; ++k) sum += F(k / 3, k % 3) * F(k / 3, k % 3);
  if (!(sum > 0) || !std::isfinite(sum)) return false;
  F = 1.0 / std::sqrt(sum) * F;
  return true;
}

/// Finds the epipolar lines that most pairs agree with, by random samples of eight (RANSAC, Fischler & Bolles 1981). The
/// same pairs always give the same lines.
class EpipolarLines {
 public:
  /// \param F the matrix of the lines; unchanged when there are none
  /// \returns false when fewer than 16 pairs agree on any lines
  [[nodiscard]] bool find(const std::vector<PointPair>& pairs, Eigen::Matrix3d& F) {
    constexpr double kInlier = 1.0;     // a pair this close to its line agrees with the motion of the camera [px]
    constexpr int kTrials = 120;        // finds eight right pairs in 99 % of searches while a third of the pairs is wrong
    constexpr std::size_t kAgree = 16;  // twice the pairs that any eight give for free
    LinearCongruential random(2654435761U + 1U);
    const auto count = static_cast<std::uint32_t>(pairs.size());
    std::size_t best = 0;
    Eigen::Matrix3d candidate;
    for (int trial = 0; trial < kTrials; ++trial) {
      sample_.clear();
      while (sample_.size() < 8) {
        const int i = static_cast<int>((random() >> 8) % count);
        if (std::find(sample_.begin(), sample_.end(), i) == sample_.end()) sample_.push_back(i);
      }
      if (!eight_point(pairs, sample_, candidate)) continue;
      std::size_t n = 0;
      for (const PointPair& p : pairs) n += epipolar_distance(candidate, p) <= kInlier ? 1U : 0U;
      if (n > best) {
        best = n;
        F = candidate;
      }
    }
    if (best < kAgree) return false;
    for (int again = 0; again < 2; ++again) {  // from all that agree
      sample_.clear();
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        if (epipolar_distance(F, pairs[i]) <= kInlier) sample_.push_back(static_cast<int>(i));
      }
      if (!eight_point(pairs, sample_, candidate)) break;
      F = candidate;
    }
    return true;
  }

 private:
  std::vector<int> sample_;
};

APSO_NAMESPACE_END
