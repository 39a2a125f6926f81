/// \file
/// The assignment problem: which rows go with which columns, so that the sum of the costs is smallest.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// Buffers of assign(), to keep warm calls free of allocations.
struct AssignmentScratch {
  std::vector<double> u, v, least;
  std::vector<std::size_t> row_of, way;
  std::vector<char> used;
  std::vector<double> square;
};

/// Hungarian method by shortest augmenting paths (Kuhn 1955; Munkres 1957), O(n^3). Pairs that cost `limit` or more are
/// never made: leaving both alone costs `limit` as well.
/// \param cost rows x columns, row by row; finite or +infinity, NaN counts as forbidden
/// \param column_of out: column of each row, or -1
inline void assign(const std::vector<double>& cost, std::size_t rows, std::size_t columns, double limit, std::vector<int>& column_of,
                   AssignmentScratch& s) {
  expects(cost.size() == rows * columns, "assign: the costs do not have the size rows x columns");
  column_of.assign(rows, -1);
  const std::size_t n = std::max(rows, columns);
  if (rows == 0 || columns == 0) return;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  // a square problem: what is missing, and what is forbidden, costs `limit`
  s.square.assign(n * n, limit);
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t j = 0; j < columns; ++j) {
      const double c = cost[i * columns + j];
      s.square[i * n + j] = c < limit ? c : limit;
    }
  }
  // potentials u of rows and v of columns, 1-based; column 0 is the start of each path
  s.u.assign(n + 1, 0);
  s.v.assign(n + 1, 0);
  s.row_of.assign(n + 1, 0);
  s.way.assign(n + 1, 0);
  for (std::size_t i = 1; i <= n; ++i) {
    s.row_of[0] = i;
    std::size_t j0 = 0;
    s.least.assign(n + 1, kInfinity);
    s.used.assign(n + 1, 0);
    do {
      s.used[j0] = 1;
      const std::size_t i0 = s.row_of[j0];
      double delta = kInfinity;
      std::size_t j1 = 0;
      for (std::size_t j = 1; j <= n; ++j) {
        if (s.used[j] != 0) continue;
        const double reduced = s.square[(i0 - 1) * n + (j - 1)] - s.u[i0] - s.v[j];
        if (reduced < s.least[j]) {
          s.least[j] = reduced;
          s.way[j] = j0;
        }
        if (s.least[j] < delta) {
          delta = s.least[j];
          j1 = j;
        }
      }
      for (std::size_t j = 0; j <= n; ++j) {
        if (s.used[j] != 0) {
          s.u[s.row_of[j]] += delta;
          s.v[j] -= delta;
        } else {
          s.least[j] -= delta;
        }
      }
      j0 = j1;
    } while (s.row_of[j0] != 0);
    do {
      const std::size_t j1 = s.way[j0];
      s.row_of[j0] = s.row_of[j1];
      j0 = j1;
    } while (j0 != 0);
  }
  for (std::size_t j = 1; j <= columns; ++j) {
    const std::size_t i = s.row_of[j];
    if (i == 0 || i > rows) continue;
    if (cost[(i - 1) * columns + (j - 1)] < limit) column_of[i - 1] = static_cast<int>(j - 1);
  }
}

APSO_NAMESPACE_END
