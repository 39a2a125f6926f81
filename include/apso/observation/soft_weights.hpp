/// \file
/// When the mask leaves too little: what is dynamic then counts a little instead of nothing.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/options.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/keypoint.hpp>

APSO_NAMESPACE_BEGIN

struct SoftWeightOptions {
  int least_points = 60;       ///< static keypoints that are enough
  double least_share = 0.1;    ///< share of all keypoints that is enough
  double weight = 0.1;         ///< what a dynamic point keeps when there are not enough
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("least_points", s.least_points, 0, 100000);
    v("least_share", s.least_share, 0.0, 1.0);
    v("weight", s.weight, 0.0, 1.0);
  }
};

/// How many keypoints the mask leaves.
struct StaticSupport {
  int points = 0;         ///< all keypoints inside the image
  int static_points = 0;  ///< those on pixels with a dynamic probability below 0.5
  [[nodiscard]] bool enough(const SoftWeightOptions& o) const {
    return static_points >= o.least_points && static_points >= o.least_share * points;
  }
};

/// \param probability dynamic probability, [0,1]; empty = everything is static
[[nodiscard]] inline StaticSupport static_support(ImageView<const float> probability, const std::vector<Keypoint>& keypoints) {
  StaticSupport s;
  for (const Keypoint& k : keypoints) {
    if (probability.empty()) {
      ++s.points;
      ++s.static_points;
      continue;
    }
    if (!(k.x >= -0.5F && k.y >= -0.5F && k.x < static_cast<float>(probability.width) - 0.5F &&
          k.y < static_cast<float>(probability.height) - 0.5F))
      continue;
    ++s.points;
    const float p = probability(static_cast<int>(std::lround(k.x)), static_cast<int>(std::lround(k.y)));
    s.static_points += p < 0.5F ? 1 : 0;  // false for NaN
  }
  return s;
}

/// Lowers the probabilities to 1 - weight where too few keypoints are static, so that a user who weighs points by one
/// minus the probability still has something to hold on to; robust estimation sorts out which of them rest.
/// \returns whether it did
inline bool soften(const std::vector<Keypoint>& keypoints, const SoftWeightOptions& options, Image<float>& probability) {
  if (static_support(probability, keypoints).enough(options)) return false;
  const auto most = static_cast<float>(1.0 - options.weight);
  for (std::size_t i = 0; i < probability.size(); ++i) probability.data()[i] = std::min(probability.data()[i], most);
  return true;
}

APSO_NAMESPACE_END
