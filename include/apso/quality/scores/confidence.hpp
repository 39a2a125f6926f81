/// \file
/// S_conf, the detection confidence across all objects: a score of equation (1).
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <apso/config.hpp>
#include <apso/quality/score_list.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// How the confidences p_j of the objects become one number.
enum class ConfidenceAggregation {
  Mean,           ///< (1/n) sum p_j
  AreaWeighted,   ///< sum a_j p_j / sum a_j, a_j the area in the image
  Min,            ///< the worst one
  GeometricMean,  ///< (prod p_j)^(1/n)
  NoisyOr         ///< 1 - prod (1 - p_j)
};
constexpr std::array<const char*, 5> enum_names(ConfidenceAggregation) {
  return {"mean", "area_weighted", "min", "geometric_mean", "noisy_or"};
}

/// What S_conf is when there is no object. A static room must not become BAD for lack of people, so it is missing.
enum class WithoutObjects { Missing, Zero, One, Neutral };
constexpr std::array<const char*, 4> enum_names(WithoutObjects) { return {"missing", "zero", "one", "neutral"}; }

struct ConfidenceOptions {
  ConfidenceAggregation aggregation = ConfidenceAggregation::Mean;
  WithoutObjects without_objects = WithoutObjects::Missing;  ///< Neutral is 0.5
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("aggregation", s.aggregation);
    v("without_objects", s.without_objects);
  }
};

/// Area of an object inside the image [px^2]: of its mask when it has one, else of its box. 0 for a box that is
/// not finite.
[[nodiscard]] inline double visible_area(const Detection& d, int width, int height) {
  if (!d.mask.empty()) {
    double n = 0;
    for (int y = 0; y < d.mask.height; ++y) {
      int in_row = 0;
      const std::uint8_t* row = d.mask.row(y);
      for (int x = 0; x < d.mask.width; ++x) in_row += row[x] != 0;
      n += in_row;
    }
    return n;
  }
  const double area = d.box.intersect({0, 0, static_cast<float>(width), static_cast<float>(height)}).area();
  return std::isfinite(area) ? area : 0.0;
}

/// S_conf. Only movable objects count. Confidences that are not finite are dropped, others limited to [0,1].
/// \param objects      any range of detections
/// \param width,height of the image [px]
[[nodiscard]] inline MaybeQuality confidence_score(const AnyDetections& objects, int width, int height,
                                                   const ConfidenceOptions& options = {}) {
  std::vector<Detection> buffer;
  double n = 0;
  double sum = 0;
  double area_sum = 0;
  double area_weighted = 0;
  double minimum = 1;
  double log_sum = 0;
  double all_wrong = 1;
  const bool by_area = options.aggregation == ConfidenceAggregation::AreaWeighted;
  for (const Detection& d : objects.in(buffer)) {
    if (!d.movable || !std::isfinite(d.score)) continue;
    const double p = clamp01(static_cast<double>(d.score));
    const double area = by_area ? visible_area(d, width, height) : 1.0;
    n += 1;
    sum += p;
    area_sum += area;
    area_weighted += area * p;
    minimum = p < minimum ? p : minimum;
    log_sum += std::log(p);  // -inf for p = 0 makes the geometric mean 0
    all_wrong *= 1 - p;
  }
  if (n == 0 || (by_area && !(area_sum > 0))) {
    switch (options.without_objects) {
      case WithoutObjects::Missing:
        return std::nullopt;
      case WithoutObjects::Zero:
        return Quality(0.0);
      case WithoutObjects::One:
        return Quality(1.0);
      case WithoutObjects::Neutral:
        return Quality(0.5);
    }
  }
  switch (options.aggregation) {
    case ConfidenceAggregation::Mean:
      return Quality(sum / n);
    case ConfidenceAggregation::AreaWeighted:
      return Quality(area_weighted / area_sum);
    case ConfidenceAggregation::Min:
      return Quality(minimum);
    case ConfidenceAggregation::GeometricMean:
      return Quality(std::exp(log_sum / n));
    case ConfidenceAggregation::NoisyOr:
      return Quality(1 - all_wrong);
  }
  return std::nullopt;
}

/// S_conf as a score of a list.
struct Confidence {
  static constexpr const char* name = "S_conf";
  static constexpr const char* options_name = "confidence";
  static constexpr ScoreRole role = ScoreRole::ObjectConfidence;
  static constexpr double default_weight = 0.10;  // it hardly tells which frames fail (docs/quality.md)
  using Value = Quality;
  using Options = ConfidenceOptions;
  using Measured = CountedObjects;
  Options options;
  Measured measured;

  MaybeQuality operator()(const FrameContext& frame) {
    measured.objects = static_cast<int>(frame.object_list().size());
    return confidence_score(frame.object_list(), frame.width(), frame.height(), options);
  }
  static std::string reason(Quality, const Measured& m) { return m.text(); }
};

APSO_NAMESPACE_END
