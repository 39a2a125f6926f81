/// \file
/// S_dec of the paper: the detection residual of S_change (eq. Change Score).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <vector>

#include <apso/config.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

struct DetectionChangeOptions {
  double min_iou = 0.1;  ///< boxes that overlap less are different objects
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("min_iou", s.min_iou, 0.0, 1.0);
  }
};

struct DetectionChange {
  int reference_count = 0;
  int current_count = 0;
  int matched = 0;
  double iou_sum = 0;  ///< over the matched pairs
  Deviation score;     ///< S_dec
};

/// Working memory of detection_change.
struct DetectionScratch {
  struct Pair {
    float iou;
    std::size_t reference;
    std::size_t current;
  };
  std::vector<Pair> pairs;
  std::vector<char> reference_taken;
  std::vector<char> current_taken;
};

/// S_dec = (c + 1 - i) / 2 with the relative difference of the counts c and the mean overlap i of matched boxes,
/// both over the larger count; 0 when both frames are empty. Objects of one class are matched one to one, greedily
/// in the order of falling overlap.
[[nodiscard]] inline DetectionChange detection_change(const std::vector<Detection>& reference,
                                                      const std::vector<Detection>& current,
                                                      const DetectionChangeOptions& options, DetectionScratch& scratch) {
  DetectionChange r;
  r.reference_count = static_cast<int>(reference.size());
  r.current_count = static_cast<int>(current.size());
  if (reference.empty() && current.empty()) return r;
  scratch.pairs.clear();
  for (std::size_t i = 0; i < reference.size(); ++i) {
    for (std::size_t j = 0; j < current.size(); ++j) {
      if (reference[i].class_id != current[j].class_id) continue;
      const float overlap = iou(reference[i].box, current[j].box);
      if (overlap > 0.0F && static_cast<double>(overlap) >= options.min_iou) scratch.pairs.push_back({overlap, i, j});
    }
  }
  std::sort(scratch.pairs.begin(), scratch.pairs.end(), [](const auto& a, const auto& b) {
    if (a.iou != b.iou) return a.iou > b.iou;
    return a.reference != b.reference ? a.reference < b.reference : a.current < b.current;
  });
  scratch.reference_taken.assign(reference.size(), 0);
  scratch.current_taken.assign(current.size(), 0);
  for (const auto& p : scratch.pairs) {
    if (scratch.reference_taken[p.reference] || scratch.current_taken[p.current]) continue;
    scratch.reference_taken[p.reference] = scratch.current_taken[p.current] = 1;
    ++r.matched;
    r.iou_sum += std::min(1.0, static_cast<double>(p.iou));
  }
  const double larger = std::max(r.reference_count, r.current_count);
  const double count = std::abs(r.current_count - r.reference_count) / larger;
  r.score = Deviation(0.5 * (count + 1.0 - r.iou_sum / larger));
  return r;
}

/// The same with working memory of its own.
[[nodiscard]] inline DetectionChange detection_change(const std::vector<Detection>& reference,
                                                      const std::vector<Detection>& current,
                                                      const DetectionChangeOptions& options = {}) {
  DetectionScratch scratch;
  return detection_change(reference, current, options, scratch);
}

APSO_NAMESPACE_END
