/// \file
/// Two more measures of how evenly points lie, for comparison with those on the grid: harmonic mean distance
/// ("coverage", after Ehsan et al.), and suppression by square covering (Bailo et al., Pattern Recognition Letters 106,
/// 2018).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// Harmonic mean of the distances of all pairs in half diagonals, [0,1]; distances below a pixel count as one. 0 for
/// fewer than two points. Takes time with the square of the number of points.
[[nodiscard]] inline double coverage_spread(const std::vector<Keypoint>& points, int width, int height) {
  if (points.size() < 2) return 0;
  double inverse = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t j = i + 1; j < points.size(); ++j) {
      const double dx = static_cast<double>(points[i].x - points[j].x);
      const double dy = static_cast<double>(points[i].y - points[j].y);
      inverse += 1.0 / std::max(1.0, std::sqrt(dx * dx + dy * dy));
    }
  }
  const double n = static_cast<double>(points.size());
  const double half_diagonal = 0.5 * std::sqrt(static_cast<double>(width) * width + static_cast<double>(height) * height);
  return clamp01(0.5 * n * (n - 1) / inverse / half_diagonal);
}

/// Points that stay when, from the strongest down, each forbids others less than r pixels away (in x and in y).
/// \param points by falling response
/// \param kept   working memory
[[nodiscard]] inline int square_covering(const std::vector<Keypoint>& points, double r, int width, int height, std::vector<int>& kept) {
  const int nx = static_cast<int>(width / r) + 3;
  const int ny = static_cast<int>(height / r) + 3;
  kept.assign(static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny), -1);  // a cell of side r holds at most one
  int n = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const int cx = 1 + std::clamp(static_cast<int>(static_cast<double>(points[i].x) / r), 0, nx - 3);
    const int cy = 1 + std::clamp(static_cast<int>(static_cast<double>(points[i].y) / r), 0, ny - 3);
    bool free = true;
    for (int v = cy - 1; v <= cy + 1 && free; ++v) {
      for (int u = cx - 1; u <= cx + 1 && free; ++u) {
        const int k = kept[static_cast<std::size_t>(v) * static_cast<std::size_t>(nx) + static_cast<std::size_t>(u)];
        if (k < 0) continue;
        const Keypoint& p = points[static_cast<std::size_t>(k)];
        const double d = static_cast<double>(std::max(std::abs(p.x - points[i].x), std::abs(p.y - points[i].y)));
        free = d >= r;
      }
    }
    if (!free) continue;
    kept[static_cast<std::size_t>(cy) * static_cast<std::size_t>(nx) + static_cast<std::size_t>(cx)] = static_cast<int>(i);
    ++n;
  }
  return n;
}

/// Largest r at which 90 % of min(N, n_ref) points stay, over the r of a perfect lattice, sqrt(area / min(N, n_ref)),
/// [0,1]. 0 for fewer than two points.
/// \param points are sorted by falling response
/// \param area   of the image that may hold points [px^2]
[[nodiscard]] inline double covering_spread(std::vector<Keypoint>& points, int n_ref, double area, int width, int height,
                                            std::vector<int>& kept) {
  if (points.size() < 2 || !(area > 0)) return 0;
  std::stable_sort(points.begin(), points.end(), [](const Keypoint& a, const Keypoint& b) { return a.response > b.response; });
  const double n = std::min(static_cast<double>(points.size()), static_cast<double>(n_ref));
  const double largest = std::sqrt(area / n);
  double low = 0;
  double high = largest;
  for (int i = 0; i < 8; ++i) {
    const double r = 0.5 * (low + high);
    (r >= 1 && square_covering(points, r, width, height, kept) < 0.9 * n ? high : low) = r;
  }
  return clamp01(low / (largest * (1 - 1.0 / 256)));  // 8 bisections end at most that far below
}

APSO_NAMESPACE_END
