/// \file
/// The features of one image as the tracker keeps them: keypoints, descriptors, and the depth measured at each.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <apso/config.hpp>
#include <apso/tracker/descriptor_matching.hpp>
#include <apso/tracker/solvers/pose_optimisation.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/images/rows.hpp>
#include <apso/traits/ranges.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/keypoint.hpp>

APSO_NAMESPACE_BEGIN

/// Features of one image, with the depth measured at each.
struct FeatureSet {
  std::vector<Keypoint> keypoints;
  std::vector<float> inverse_depth;        ///< [1/m], 0 = none
  std::vector<float> inverse_depth_sigma;  ///< [1/m]
  std::vector<Descriptor> descriptors;     ///< one for each keypoint
};

/// Features of the current image, and how much each counts.
struct WeightedFeatures : FeatureSet {
  KeypointGrid grid;
  std::vector<float> weight;  ///< probability of being static; 0 = not used
  int with_depth = 0;         ///< features that are used and have depth
};

/// The pyramid that the keypoints were found in.
struct Octaves {
  int levels = 8;
  double scale_factor = 1.2;
  /// Standard deviation of a keypoint's position in its octave [px].
  [[nodiscard]] double sigma(int octave) const { return std::pow(scale_factor, octave); }
};

/// An inverse depth and its standard deviation.
struct InverseDepth {
  float value = 0;  ///< [1/m], 0 = none
  float sigma = 1;  ///< [1/m]
};

/// Inverse depth at a pixel. The deviation is larger where the surface jumps within two pixels.
/// \param depth any image in metres
/// \param sigma of a depth measurement on a smooth surface [1/m]
template <class DepthImage>
[[nodiscard]] InverseDepth measure_depth(const DepthImage& depth, float x, float y, const DepthRange& range, float sigma) {
  const int width = image_traits<DepthImage>::width(depth);
  const int height = image_traits<DepthImage>::height(depth);
  const int cx = std::clamp(static_cast<int>(x + 0.5F), 0, width - 1);
  const int cy = std::clamp(static_cast<int>(y + 0.5F), 0, height - 1);
  const float z = pixel(depth, cx, cy);
  if (!depth_valid(z, range)) return {};
  const float inverse = 1.0F / z;
  float lowest = inverse;
  float highest = inverse;
  for (int dy = -2; dy <= 2; dy += 2)
    for (int dx = -2; dx <= 2; dx += 2) {
      const int px = cx + dx;
      const int py = cy + dy;
      if (px < 0 || py < 0 || px >= width || py >= height) continue;
      const float q = pixel(depth, px, py);
      if (!depth_valid(q, range)) continue;
      lowest = std::min(lowest, 1.0F / q);
      highest = std::max(highest, 1.0F / q);
    }
  const float jump = std::max(0.0F, highest - lowest - sigma);
  return {inverse, std::sqrt(sigma * sigma + 0.25F * jump * jump)};
}

/// Probability of being static at a pixel; 0 where the mask says dynamic with at least `threshold`. An undefined
/// probability is not trusted.
/// \param dynamic_probability any image of [0,1]; `none` or an empty image = nothing is dynamic
template <class Mask>
[[nodiscard]] float static_weight(const Mask& dynamic_probability, float x, float y, double threshold) {
  if constexpr (is_none_v<Mask>) {
    (void)dynamic_probability, (void)x, (void)y, (void)threshold;
    return 1.0F;
  } else {
    const int width = image_traits<Mask>::width(dynamic_probability);
    const int height = image_traits<Mask>::height(dynamic_probability);
    if (width == 0 || height == 0) return 1.0F;
    const int cx = std::clamp(static_cast<int>(x + 0.5F), 0, width - 1);
    const int cy = std::clamp(static_cast<int>(y + 0.5F), 0, height - 1);
    const float p = pixel(dynamic_probability, cx, cy);
    if (!(p >= 0.0F && p <= 1.0F) || static_cast<double>(p) >= threshold) return 0.0F;
    return 1.0F - p;
  }
}

/// Weighs all features by their probability of being static, and counts those that are left with depth.
template <class Mask>
void weigh(const Mask& dynamic_probability, double threshold, WeightedFeatures& features) {
  const std::size_t n = features.keypoints.size();
  features.weight.resize(n);
  features.with_depth = 0;
  for (std::size_t i = 0; i < n; ++i) {
    features.weight[i] = static_weight(dynamic_probability, features.keypoints[i].x, features.keypoints[i].y, threshold);
    if (features.weight[i] > 0 && features.inverse_depth[i] > 0) ++features.with_depth;
  }
}

/// Takes in keypoints, and measures the depth at each.
/// \param keypoints any range with keypoint_traits
/// \param depth     any image in metres
/// \param sigma     of a depth measurement on a smooth surface [1/m]
template <class Keypoints, class DepthImage>
void copy_keypoints(const Keypoints& keypoints, const DepthImage& depth, const DepthRange& range, float sigma, FeatureSet& out) {
  out.keypoints.clear();
  out.inverse_depth.clear();
  out.inverse_depth_sigma.clear();
  for_each_keypoint(keypoints, [&](const Keypoint& k) {
    out.keypoints.push_back(k);
    const InverseDepth d = measure_depth(depth, k.x, k.y, range, sigma);
    out.inverse_depth.push_back(d.value);
    out.inverse_depth_sigma.push_back(d.sigma);
  });
}

/// Takes in descriptors of 32 bytes: an image of bytes with one row of 32 for each keypoint (e.g. a `cv::Mat_<uchar>`), or
/// a range of `Descriptor`. Their number is checked by the caller.
template <class Descriptors>
void copy_descriptors(const Descriptors& descriptors, std::vector<Descriptor>& out) {
  if constexpr (is_image_v<Descriptors>) {
    static_assert(sizeof(typename image_traits<Descriptors>::value_type) == 1, "apso: descriptors are rows of 32 bytes");
    const int n = image_traits<Descriptors>::height(descriptors);
    expects(n == 0 || image_traits<Descriptors>::width(descriptors) == 32, "descriptors: a row must have 32 bytes");
    out.resize(static_cast<std::size_t>(n));
    for (int i = 0; i < n; ++i) {
      Descriptor& d = out[static_cast<std::size_t>(i)];
      for (int k = 0; k < 32; ++k)
        d[static_cast<std::size_t>(k)] = static_cast<std::uint8_t>(image_traits<Descriptors>::at(descriptors, k, i));
    }
  } else {
    static_assert(std::is_convertible_v<detail::range_value_t<Descriptors>, Descriptor>,
                  "apso: descriptors are an image of bytes with 32 columns, or a range of std::array<std::uint8_t, 32>");
    out.assign(std::begin(descriptors), std::end(descriptors));
  }
}

/// A feature as an observation of a world point.
[[nodiscard]] inline PointObservation observation_of(const FeatureSet& set, int feature, const Eigen::Vector3d& point, float weight,
                                                     const Octaves& octaves) {
  const auto f = static_cast<std::size_t>(feature);
  PointObservation o;
  o.point = point;
  o.u = set.keypoints[f].x;
  o.v = set.keypoints[f].y;
  o.inverse_depth = set.inverse_depth[f];
  o.sigma = octaves.sigma(set.keypoints[f].octave);
  o.inverse_depth_sigma = set.inverse_depth_sigma[f];
  o.weight = weight;
  return o;
}

APSO_NAMESPACE_END
