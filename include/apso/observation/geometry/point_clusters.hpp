/// \file
/// A small depth image cut into clusters of points, and the probability of each cluster to rest, solved over all of them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Clusters of the points of a small depth image.
struct PointClusters {
  Image<std::uint8_t> label;             ///< cluster of a pixel; kNone without depth
  std::vector<Eigen::Vector3f> centre;   ///< in the camera frame [m]
  std::vector<int> size;                 ///< pixels
  std::vector<std::uint8_t> neighbours;  ///< k x k, 1 = the two touch in depth
  static constexpr std::uint8_t kNone = 255;
};

/// K-means of the points of a small depth image, started from the middles of a grid of the image, so the result does
/// not depend on chance. \param columns, rows of the grid; their product is the number of clusters, at most 250
inline void cluster_points(const Image<float>& depth, const Pinhole& camera, int columns, int rows, int iterations, PointClusters& out) {
  expects(columns > 0 && rows > 0 && columns * rows <= 250, "cluster_points: between 1 and 250 clusters");
  const int w = depth.width();
  const int h = depth.height();
  const int k = columns * rows;
  const auto K = static_cast<std::size_t>(k);
  const auto fx = static_cast<float>(camera.fx);
  const auto fy = static_cast<float>(camera.fy);
  const auto cx = static_cast<float>(camera.cx);
  const auto cy = static_cast<float>(camera.cy);
  const auto point = [&](int x, int y) {
    const float z = depth(x, y);
    return Eigen::Vector3f((static_cast<float>(x) - cx) / fx * z, (static_cast<float>(y) - cy) / fy * z, z);
  };
  constexpr float kNowhere = std::numeric_limits<float>::infinity();
  out.centre.assign(K, Eigen::Vector3f(kNowhere, kNowhere, kNowhere));
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      // the valid pixel of the cell that is nearest to its middle, along its row
      const int y = (2 * r + 1) * h / (2 * rows);
      const int middle = (2 * c + 1) * w / (2 * columns);
      for (int d = 0; d <= w / columns; ++d) {
        const int x = middle + (d % 2 == 0 ? d / 2 : -(d + 1) / 2);
        if (x < 0 || x >= w || !(depth(x, y) > 0)) continue;
        out.centre[static_cast<std::size_t>(r * columns + c)] = point(x, y);
        break;
      }
    }
  }
  const auto nearest = [&](const Eigen::Vector3f& p) {
    std::size_t best = 0;
    float least = std::numeric_limits<float>::infinity();
    for (std::size_t i = 0; i < K; ++i) {
      const float d = squared_norm(p - out.centre[i]);
      if (d < least) {
        least = d;
        best = i;
      }
    }
    return least < std::numeric_limits<float>::infinity() ? static_cast<std::uint8_t>(best) : PointClusters::kNone;
  };
  std::array<Eigen::Vector3f, 250> sum;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    sum.fill(Eigen::Vector3f(0, 0, 0));
    out.size.assign(K, 0);
    for (int y = 1; y < h; y += 3) {
      for (int x = 1; x < w; x += 3) {
        if (!(depth(x, y) > 0)) continue;
        const Eigen::Vector3f p = point(x, y);
        const std::size_t i = nearest(p);
        if (i == PointClusters::kNone) continue;
        sum[i] += p;
        ++out.size[i];
      }
    }
    for (std::size_t i = 0; i < K; ++i) {
      if (out.size[i] > 0) out.centre[i] = 1.0F / static_cast<float>(out.size[i]) * sum[i];
    }
  }
  out.label.assign(w, h, PointClusters::kNone);
  out.size.assign(K, 0);
  out.neighbours.assign(K * K, 0);
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      if (!(depth(x, y) > 0)) continue;
      const std::uint8_t i = nearest(point(x, y));
      out.label(x, y) = i;
      if (i != PointClusters::kNone) ++out.size[i];
    }
  }
  const auto touch = [&](int x0, int y0, int x1, int y1) {
    const std::size_t a = out.label(x0, y0);
    const std::size_t b = out.label(x1, y1);
    if (a == b || a == PointClusters::kNone || b == PointClusters::kNone) return;
    if (!depth_connected(depth(x0, y0), depth(x1, y1))) return;
    out.neighbours[a * K + b] = out.neighbours[b * K + a] = 1;
  };
  for (int y = 0; y + 1 < h; ++y) {
    for (int x = 0; x + 1 < w; ++x) {
      touch(x, y, x + 1, y);
      touch(x, y, x, y + 1);
    }
  }
}

/// Probabilities of rest of k clusters: minimises
///     -sum d_i b_i + prior/2 sum (b_i - p_i)^2 + smooth/2 sum_neighbours (b_i - b_j)^2,  b in [0,1] (clipped)
/// where d_i in [-1,1] is how much better rest explains cluster i than the mean cluster does.
inline void solve_rest(const std::vector<float>& d, const std::vector<float>& p, const std::vector<std::uint8_t>& neighbours, double prior,
                       double smooth, std::vector<float>& b) {
  constexpr int kMaximum = 64;
  const int k = static_cast<int>(d.size());
  expects(p.size() == d.size() && neighbours.size() == d.size() * d.size() && prior > 0 && smooth >= 0,
          "solve_rest: sizes or weights do not fit");
  expects(k <= kMaximum, "solve_rest: at most 64 clusters");
  float A[kMaximum][kMaximum];  // room on the stack, so that nothing is allocated per frame
  float x[kMaximum];
  for (int i = 0; i < k; ++i) {
    x[i] = static_cast<float>(prior) * p[static_cast<std::size_t>(i)] + d[static_cast<std::size_t>(i)];
    std::fill_n(A[i], k, 0.0F);
    A[i][i] = static_cast<float>(prior);
    for (int j = 0; j < k; ++j) {
      if (i == j || neighbours[static_cast<std::size_t>(i * k + j)] == 0) continue;
      A[i][i] += static_cast<float>(smooth);
      A[i][j] -= static_cast<float>(smooth);
    }
  }
  solve_definite(A, k, x);
  b.resize(d.size());
  for (int i = 0; i < k; ++i) {
    b[static_cast<std::size_t>(i)] = x[i] == x[i] ? std::clamp(x[i], 0.0F, 1.0F) : 1.0F;
  }
}

APSO_NAMESPACE_END
