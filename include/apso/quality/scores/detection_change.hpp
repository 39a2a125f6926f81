/// \file
/// S_dec, the detection residual: a score of equation (7).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <string>
#include <vector>

#include <apso/config.hpp>
#include <apso/quality/score_list.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// Boxes whose intersection over union is less are different objects.
inline constexpr double kMinimumIou = 0.1;

/// What S_dec is made of.
struct DetectionMeasure {
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
/// in the order of falling overlap. Time and memory grow with the product of the counts; in an assessor the kMaxObjects objects of
/// the highest scores count.
[[nodiscard]] inline DetectionMeasure detection_change(const std::vector<Detection>& reference, const std::vector<Detection>& current,
                                                       DetectionScratch& scratch) {
  DetectionMeasure r;
  r.reference_count = static_cast<int>(reference.size());
  r.current_count = static_cast<int>(current.size());
  if (reference.empty() && current.empty()) return r;
  scratch.pairs.clear();
  for (std::size_t i = 0; i < reference.size(); ++i) {
    for (std::size_t j = 0; j < current.size(); ++j) {
      if (reference[i].class_id != current[j].class_id) continue;
      const float overlap = iou(reference[i].box, current[j].box);
      if (overlap > 0.0F && static_cast<double>(overlap) >= kMinimumIou) scratch.pairs.push_back({overlap, i, j});
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

/// The same of any ranges of detections, with working memory of its own.
[[nodiscard]] inline DetectionMeasure detection_change(const AnyDetections& reference, const AnyDetections& current) {
  std::vector<Detection> buffer_r, buffer_c;
  DetectionScratch scratch;
  return detection_change(reference.in(buffer_r), current.in(buffer_c), scratch);
}

/// S_dec as a score of a list.
struct DetectionChange {
  static constexpr const char* name = "S_dec";
  static constexpr const char* weight_name = "detection";
  static constexpr double default_weight = 0.10;
  using Value = Deviation;
  struct Measured {
    int reference_count = 0;
    int current_count = 0;
    int matched = 0;
    template <class Self, class V>
    static void columns(Self&, V&&) {}
  };
  struct Memory {
    std::vector<Detection> objects;  ///< without their masks
    bool present = false;            ///< objects were given (there may be none)
  };
  Measured measured;

  void remember(const FrameContext& frame, Memory& memory) {
    memory.present = frame.objects != nullptr;
    memory.objects.clear();
    for (const Detection& d : frame.object_list()) {
      memory.objects.push_back(d);
      memory.objects.back().mask = {};  // the pixels belong to the caller
    }
    keep_strongest(memory.objects);
  }
  MaybeDeviation operator()(const ChangeContext<Memory>& frames) {
    measured = {};
    if (!frames.reference.present || !frames.current.present) return std::nullopt;
    const DetectionMeasure m = detection_change(frames.reference.objects, frames.current.objects, scratch_);
    measured = {m.reference_count, m.current_count, m.matched};
    return m.score;
  }
  static std::string reason(Deviation, const Measured& m) {
    return std::to_string(m.matched) + " of " + std::to_string(m.reference_count) + " objects found again among " +
           std::to_string(m.current_count);
  }

 private:
  DetectionScratch scratch_;
};

APSO_NAMESPACE_END
