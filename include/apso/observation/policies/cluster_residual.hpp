/// \file
/// Motion of clusters: the scene is cut into pieces, and pose and the probability of each piece to rest are solved
/// together (after Jaimez et al., Joint-VO-SF, ICRA 2017, and Scona et al., StaticFusion, ICRA 2018).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/geometry/low_res_alignment.hpp>
#include <apso/observation/geometry/point_clusters.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/observation/policies/past_comparison.hpp>
#include <apso/options.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

struct ClusterResidualOptions {
  DepthRange depth;        ///< depth that is used
  double reference = 1.5;  ///< a cluster moves when its cost is above this multiple of the mean of resting ones
  int dilation = 4;        ///< the mask is widened by this [px]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("depth", s.depth);
    v("reference", s.reference, 1.0, 100.0);
    v("dilation", s.dilation, 0, 200);
  }
};

/// Solves in turn for the motion of the camera, with the clusters weighted by their probability of rest b, and for b
/// from the residuals that are left. Needs that most of the view rests when it starts; edges of the mask are those of
/// the clusters.
class ClusterResidual : public PolicyOperators {
 public:
  using Options = ClusterResidualOptions;

  explicit ClusterResidual(const Pinhole& camera, const ClusterResidualOptions& options = {})
      : reference_(checked(options).reference), comparison_(camera, options.depth, rules(options)) {}

  void observe(const AnyFrame& frame, const AnyPose& T_world_camera_prior, const AnyTracks&, DynamicMask& out) {
    const auto compare = [this](const SmallFrame& current, const SmallFrame& past, const Pose& T_prior, Image<float>& probability,
                                Image<std::uint8_t>& known) {
      cluster_points(current.depth, comparison_.small_camera(), kColumns, kRows, kClusterSteps, clusters_);
      solve(current, past, T_prior);
      mark(probability, known);
    };
    comparison_.observe(frame, T_world_camera_prior, compare, out);
  }
  void remember(const AnyFrame&, const AnyPose& T_world_camera, const DynamicMask&) { comparison_.remember(T_world_camera); }
  void reset() {
    comparison_.reset();
    rest_.clear();
  }

 private:
  static constexpr int kColumns = 6;             // clusters across: 24 in all, as many as Joint-VO-SF uses
  static constexpr int kRows = 4;                // clusters down
  static constexpr int kClusterSteps = 4;        // of k-means
  static constexpr int kRounds = 3;              // how often pose and probabilities are solved in turn
  static constexpr int kIterations = 4;          // of the alignment in each round
  static constexpr double kPriorWeight = 0.5;    // of the prior of a cluster
  static constexpr double kSmoothWeight = 0.35;  // of the agreement of neighbours
  static constexpr float kDepthPrior = 1.5F;     // prior of rest: 1 - kDepthPrior * mean difference of depth [1/m]
  static constexpr float kMinimumCost = 0.8F;    // a cluster that costs less than this times `reference` rests

  static const Options& checked(const Options& options) {
    validate(options, "cluster_residual");
    return options;
  }
  static RegionRules rules(const Options& options) {
    RegionRules r;
    r.reach = 0;  // clusters are regions already
    r.dilation = options.dilation;
    return r;
  }

  void solve(const SmallFrame& current, const SmallFrame& past, const Pose& T_prior) {
    const Pinhole& camera = comparison_.small_camera();
    const std::size_t k = clusters_.centre.size();
    rest_.assign(k, 1.0F);
    for (int round = 0; round < kRounds; ++round) {
      weight_.resize(camera.width, camera.height);
      for (std::size_t i = 0; i < weight_.size(); ++i) {
        const std::uint8_t c = clusters_.label.data()[i];
        weight_.data()[i] = c == PointClusters::kNone ? 0.0F : rest_[c];
      }
      const LowResAlignment a = align_low_res(current, past, camera, T_prior, &weight_, kIterations, scratch_);
      measure(current, past, a.T_past_current);
      double sum = 0;
      double n = 0;
      for (std::size_t i = 0; i < k; ++i) {
        const double weight = static_cast<double>(rest_[i]) * seen_[i];
        sum += weight * static_cast<double>(cost_[i]);
        n += weight;
      }
      const auto mean = static_cast<float>(n > 0 ? sum / n : 0.0);
      const float limit = static_cast<float>(reference_) * std::max(kMinimumCost, mean);
      for (std::size_t i = 0; i < k; ++i) {
        benefit_[i] = seen_[i] > 0 ? std::clamp((limit - cost_[i]) / limit, -1.0F, 1.0F) : 0.0F;
        prior_[i] = std::clamp(1.0F - kDepthPrior * change_[i], 0.0F, 1.0F);
      }
      solve_rest(benefit_, prior_, clusters_.neighbours, kPriorWeight, kSmoothWeight, rest_);
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
        if (i == PointClusters::kNone || !warp_pixel(current, x, y, past, camera, warp, p)) continue;
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

  double reference_;
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
