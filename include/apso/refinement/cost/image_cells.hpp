/// \file
/// How much the right side of the normal equations differs from place to place in the image.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>

APSO_NAMESPACE_BEGIN

/// The right sides of all tiles, and their sums over the cells of a coarse grid. What disturbs residuals, such as steps of the disparity,
/// moving things, a bent lens or a rolling shutter, reaches over several tiles, so that tiles differ less than they err: the cells, which
/// are larger, tell by how much. All references add to the same cells, since the noise of the current frame is in all of them.
class ImageCells {
 public:
  static constexpr int kRows = 6, kColumns = 8;

  /// \param b right side of a tile, for an increment of T_camera_world from the left
  void add(int row, int column, const Twist& b) {
    Cell& c = cells_[row * kColumns + column];
    c.seen = true;
    for (int i = 0; i < 6; ++i) {
      c.b[i] += b(i);
      for (int k = 0; k < 6; ++k) tiles_(i, k) += b(i) * b(k);
    }
  }

  /// Covariance of the sum of all right sides: its shape is that of the covariance by tiles, of which there are many; its size that of the
  /// one by cells, of which there are too few to tell single directions (shrinkage: Ledoit and Wolf, J. Multivariate Analysis 2004).
  /// Singular where fewer than six tiles are seen.
  [[nodiscard]] Matrix6 scatter() const {
    Matrix6 by_cells = zeros<Matrix6>();
    int count = 0;
    for (const Cell& c : cells_) {
      if (!c.seen) continue;
      ++count;
      for (int i = 0; i < 6; ++i) {
        for (int k = 0; k < 6; ++k) by_cells(i, k) += c.b[i] * c.b[k];
      }
    }
    by_cells *= static_cast<double>(count) / std::max(1, count - kLost);
    Matrix6 by_tiles = tiles_;
    for (int i = 0; i < 6; ++i) by_tiles(i, i) *= 1 + kRidge;
    const double larger = solve_symmetric(by_tiles, by_cells).trace() / 6;  // mean over the directions
    if (!std::isfinite(larger)) return by_cells;
    by_tiles *= larger;
    return by_tiles;
  }

 private:
  static constexpr int kLost = 7;         // of N cells N - 7 are left to tell six directions: Hotelling's T^2
  static constexpr double kRidge = 1e-9;  // so that few tiles can be inverted
  struct Cell {
    double b[6] = {};
    bool seen = false;
  };
  Cell cells_[static_cast<std::size_t>(kRows) * kColumns];
  Matrix6 tiles_ = zeros<Matrix6>();
};

APSO_NAMESPACE_END
