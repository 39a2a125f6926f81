/// \file
/// Motion of clusters: the scene is cut into pieces, and pose and the probability of each piece to rest are solved
/// together (after Jaimez et al., Joint-VO-SF, ICRA 2017, and Scona et al., StaticFusion, ICRA 2018).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/geometry/low_res_alignment.hpp>
#include <apso/observation/policies/past_comparison.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/options.hpp>
#include <apso/types/track.hpp>

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
inline void cluster_points(const Image<float>& depth, const Pinhole& camera, int columns, int rows, int iterations,
                           PointClusters& out) {
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
      const float d = squared_norm(minus(p, out.centre[i]));
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
        sum[i] = plus(sum[i], p);
        ++out.size[i];
      }
    }
    for (std::size_t i = 0; i < K; ++i) {
      if (out.size[i] > 0) out.centre[i] = times(1.0F / static_cast<float>(out.size[i]), sum[i]);
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
inline void solve_rest(const std::vector<float>& d, const std::vector<float>& p, const std::vector<std::uint8_t>& neighbours,
                       double prior, double smooth, std::vector<float>& b) {
  constexpr int kMost = 64;
  const int k = static_cast<int>(d.size());
  expects(p.size() == d.size() && neighbours.size() == d.size() * d.size() && prior > 0 && smooth >= 0,
          "solve_rest: sizes or weights do not fit");
  expects(k <= kMost, "solve_rest: at most 64 clusters");
  float A[kMost][kMost];  // room on the stack, so that nothing is allocated per frame
  float x[kMost];
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

struct ClusterResidualOptions : PastComparisonOptions {
  int columns = 6;            ///< clusters across
  int rows = 4;               ///< clusters down
  int rounds = 3;             ///< how often pose and probabilities are solved in turn
  double lambda_prior = 0.5;  ///< weight of the prior of a cluster
  double lambda_smooth = 0.35;///< weight of the agreement of neighbours
  double depth_prior = 1.5;   ///< prior of rest: 1 - depth_prior * mean difference of depth [1/m]
  double reference = 1.5;     ///< a cluster moves when its cost is above this multiple of the mean of resting ones
  double least_cost = 0.8;    ///< ... or of this cost, if the mean is smaller
  LowResAlignmentOptions alignment;
  ClusterResidualOptions() {
    mask.reach = 0;  // clusters are regions already
    alignment.iterations = 4;
  }
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    PastComparisonOptions::fields(s, v);
    v("columns", s.columns, 1, 8);
    v("rows", s.rows, 1, 8);
    v("rounds", s.rounds, 1, 20);
    v("lambda_prior", s.lambda_prior, 1e-3, 100.0);
    v("lambda_smooth", s.lambda_smooth, 0.0, 100.0);
    v("depth_prior", s.depth_prior, 0.0, 100.0);
    v("reference", s.reference, 1.0, 100.0);
    v("least_cost", s.least_cost, 0.01, 100.0);
    v("alignment", s.alignment);
  }
};

/// Solves in turn for the motion of the camera, with the clusters weighted by their probability of rest b, and for b
/// from the residuals that are left. Needs that most of the view rests when it starts; edges of the mask are those of
/// the clusters.
class ClusterResidual {
 public:
  explicit ClusterResidual(const Pinhole& camera, const ClusterResidualOptions& options = {})
      : options_(options), comparison_(camera, options) {
    validate(options, "cluster_residual");
  }

  void observe(const RgbdFrame& frame, const Pose& T_world_camera_prior, const std::vector<PointTrack>&,
               DynamicMask& out) {
    const auto compare = [this](const SmallFrame& current, const SmallFrame& past, const Pose& T_prior,
                                Image<float>& probability, Image<std::uint8_t>& known) {
      cluster_points(current.depth, comparison_.small_camera(), options_.columns, options_.rows, 4, clusters_);
      solve(current, past, T_prior);
      mark(probability, known);
    };
    comparison_.observe(frame, T_world_camera_prior, compare, out);
  }
  void remember(const RgbdFrame&, const Pose& T_world_camera, const DynamicMask&) { comparison_.remember(T_world_camera); }
  void reset() {
    comparison_.reset();
    rest_.clear();
  }

  [[nodiscard]] const PointClusters& clusters() const { return clusters_; }
  /// Probability of rest of each cluster of the last frame, [0,1]; empty before there was a past frame.
  [[nodiscard]] const std::vector<float>& rest() const { return rest_; }

 private:
  void solve(const SmallFrame& current, const SmallFrame& past, const Pose& T_prior) {
    const Pinhole& camera = comparison_.small_camera();
    const std::size_t k = clusters_.centre.size();
    rest_.assign(k, 1.0F);
    for (int round = 0; round < options_.rounds; ++round) {
      weight_.resize(camera.width, camera.height);
      for (std::size_t i = 0; i < weight_.size(); ++i) {
        const std::uint8_t c = clusters_.label.data()[i];
        weight_.data()[i] = c == PointClusters::kNone ? 0.0F : rest_[c];
      }
      const LowResAlignment a = align_low_res(current, past, camera, T_prior, &weight_, options_.alignment, scratch_);
      measure(current, past, a.T_past_current);
      double sum = 0;
      double n = 0;
      for (std::size_t i = 0; i < k; ++i) {
        const double weight = static_cast<double>(rest_[i]) * seen_[i];
        sum += weight * static_cast<double>(cost_[i]);
        n += weight;
      }
      const auto mean = static_cast<float>(n > 0 ? sum / n : 0.0);
      const float limit = static_cast<float>(options_.reference) * std::max(static_cast<float>(options_.least_cost), mean);
      for (std::size_t i = 0; i < k; ++i) {
        benefit_[i] = seen_[i] > 0 ? std::clamp((limit - cost_[i]) / limit, -1.0F, 1.0F) : 0.0F;
        prior_[i] = std::clamp(1.0F - static_cast<float>(options_.depth_prior) * change_[i], 0.0F, 1.0F);
      }
      solve_rest(benefit_, prior_, clusters_.neighbours, options_.lambda_prior, options_.lambda_smooth, rest_);
    }
  }

  void mark(Image<float>& probability, Image<std::uint8_t>& known) const {
    for (std::size_t i = 0; i < probability.size(); ++i) {
      const std::uint8_t c = clusters_.label.data()[i];
      if (c == PointClusters::kNone || 4 * seen_[c] < clusters_.size[c]) continue;  // mostly not seen then: unknown
      probability.data()[i] = 1.0F - rest_[c];
      known.data()[i] = 1;
    }
  }

  // Mean Cauchy cost and mean difference of depth of each cluster.
  void measure(const SmallFrame& current, const SmallFrame& past, const Pose& T) {
    const Pinhole& camera = comparison_.small_camera();
    const std::size_t k = clusters_.centre.size();
    cost_.assign(k, 0.0F);
    change_.assign(k, 0.0F);
    seen_.assign(k, 0);
    benefit_.resize(k);
    prior_.resize(k);
    const FloatPose warp(T);
    constexpr float c = 2.3849F;
    WarpedPixel p;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const std::uint8_t i = clusters_.label(x, y);
        if (i == PointClusters::kNone || !warp_pixel(current, x, y, past, camera, warp, options_.alignment, p)) continue;
        const float d = p.r_depth / p.sigma_depth;
        if (d < -4.0F) continue;  // uncovered: says nothing about the point
        const float g = p.r_intensity / p.sigma_intensity;
        cost_[i] += 0.5F * c * c * std::log1p(0.5F * (d * d + g * g) / (c * c));
        change_[i] += std::abs(p.r_depth);
        ++seen_[i];
      }
    }
    for (std::size_t i = 0; i < k; ++i) {
      if (seen_[i] == 0) continue;
      cost_[i] /= static_cast<float>(seen_[i]);
      change_[i] /= static_cast<float>(seen_[i]);
    }
  }

  ClusterResidualOptions options_;
  PastComparison comparison_;
  PointClusters clusters_;
  std::vector<float> rest_;
  std::vector<float> cost_;
  std::vector<float> change_;
  std::vector<float> benefit_;
  std::vector<float> prior_;
  std::vector<int> seen_;
  Image<float> weight_;
  std::vector<float> scratch_;
};

APSO_NAMESPACE_END
