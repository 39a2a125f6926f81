/// \file
/// When the mask leaves too few keypoints: dynamic ones then count a little instead of not at all.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/options.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/keypoint.hpp>

APSO_NAMESPACE_BEGIN

struct SoftWeightOptions {
  double weight = 0.1;  ///< weight a dynamic point keeps when there are not enough, [0,1]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("weight", s.weight, 0.0, 1.0);
  }
};

/// How many keypoints the mask leaves.
struct StaticSupport {
  static constexpr int kMinimumPoints = 60;     ///< static keypoints that are enough for a pose
  static constexpr double kMinimumShare = 0.1;  ///< share of all keypoints that must be static as well
  int points = 0;                               ///< all keypoints inside the image
  int static_points = 0;                        ///< those on pixels with a dynamic probability below 0.5
  [[nodiscard]] bool enough() const { return static_points >= kMinimumPoints && static_points >= kMinimumShare * points; }
};

/// \param probability dynamic probability, any image, [0,1]; empty or `none` = everything is static
/// \param keypoints   any range of keypoints
[[nodiscard]] inline StaticSupport static_support(const AnyImage& probability, const AnyKeypoints& keypoints) {
  StaticSupport s;
  std::vector<Keypoint> buffer;
  for (const Keypoint& k : keypoints.in(buffer)) {
    if (probability.empty()) {
      ++s.points;
      ++s.static_points;
      continue;
    }
    if (!(k.x >= -0.5F && k.y >= -0.5F && k.x < static_cast<float>(probability.width()) - 0.5F &&
          k.y < static_cast<float>(probability.height()) - 0.5F))
      continue;
    ++s.points;
    const float p = probability.at(static_cast<int>(std::lround(k.x)), static_cast<int>(std::lround(k.y)));
    s.static_points += p < 0.5F ? 1 : 0;  // false for NaN
  }
  return s;
}

/// Lowers the probabilities to 1 - weight where too few keypoints are static, so that a user who weighs points by one
/// minus the probability has something left to estimate a pose from; robust estimation sorts out which of them rest.
/// \returns whether it did
inline bool soften(const AnyKeypoints& keypoints, const SoftWeightOptions& options, Image<float>& probability) {
  if (static_support(probability, keypoints).enough()) return false;
  const auto limit = static_cast<float>(1.0 - options.weight);
  for (std::size_t i = 0; i < probability.size(); ++i) probability.data()[i] = std::min(probability.data()[i], limit);
  return true;
}

APSO_NAMESPACE_END
