/// \file
/// Objects from a dynamic mask and from detections, with identities that last.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/options.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// class_id of an object that was found by its motion alone.
inline constexpr int kUnknownClass = -1;

struct ObjectTrackerOptions {
  int factor = 4;             ///< the mask is looked at in steps of this many pixels
  int min_pixels = 600;       ///< smaller regions of the mask are no objects [px]
  double depth_gap = 0.25;    ///< regions are cut where neighbouring depths differ by more [m]
  double min_iou = 0.3;       ///< overlap from which two boxes of successive frames are the same object
  double covered = 0.7;       ///< a region with this share inside a detection belongs to it
  int max_missed = 10;        ///< frames an identity is kept without being seen
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("factor", s.factor, 1, 64);
    v("min_pixels", s.min_pixels, 1, 100000000);
    v("depth_gap", s.depth_gap, 0.0, 100.0);
    v("min_iou", s.min_iou, 0.01, 1.0);
    v("covered", s.covered, 0.0, 1.0);
    v("max_missed", s.max_missed, 0, 100000);
  }
};

/// Turns what moves into objects with boxes and lasting identities.
///
/// Detections from outside come first: they keep box, class and score, and get their motion probability from the
/// mask where it is missing. Regions of the mask which no detection explains follow, with class kUnknownClass.
class ObjectTracker {
 public:
  explicit ObjectTracker(const ObjectTrackerOptions& options = {}) : options_(options) {
    apso::validate(options, "object_tracker");
  }

  /// \param depth [m], size of the mask, may be empty: then regions are not cut at depth steps
  /// \param detections may be empty; their masks must outlive the result
  /// \returns valid until the next call
  const std::vector<Detection>& update(const DynamicMask& mask, ImageView<const float> depth,
                                       const std::vector<Detection>& detections = {}) {
    const int w = mask.probability.width();
    const int h = mask.probability.height();
    expects(depth.empty() || (depth.width == w && depth.height == h),
            "ObjectTracker: depth and mask differ in size");
    objects_.clear();
    for (const Detection& d : detections) {
      expects(d.mask.empty() || (d.mask.width == w && d.mask.height == h),
              "ObjectTracker: mask of a detection has another size");
      objects_.push_back(d);
      if (!(d.motion_probability == d.motion_probability)) {
        objects_.back().motion_probability = mean_probability(mask, d);
      }
    }
    add_regions(mask, depth);
    identify();
    return objects_;
  }

  void reset() {
    known_.clear();
    objects_.clear();
    next_id_ = 0;
  }

 private:
  struct Known {
    Box box;
    int class_id = kUnknownClass;
    int id = -1;
    int missed = 0;
  };

  [[nodiscard]] float mean_probability(const DynamicMask& mask, const Detection& d) const {
    const int w = mask.probability.width();
    const int h = mask.probability.height();
    const auto limit = [](float v, int n) {
      return static_cast<int>(v == v ? std::clamp(v, 0.0F, static_cast<float>(n)) : 0.0F);
    };
    const bool has_mask = !d.mask.empty();
    const int x0 = has_mask ? 0 : limit(std::floor(d.box.x), w);
    const int x1 = has_mask ? w : limit(std::ceil(d.box.x + d.box.width), w);
    const int y0 = has_mask ? 0 : limit(std::floor(d.box.y), h);
    const int y1 = has_mask ? h : limit(std::ceil(d.box.y + d.box.height), h);
    double sum = 0;
    double n = 0;
    for (int y = y0; y < y1; y += options_.factor) {
      for (int x = x0; x < x1; x += options_.factor) {
        if (mask.known(x, y) == 0 || (has_mask && d.mask(x, y) == 0)) continue;
        sum += static_cast<double>(mask.probability(x, y));
        n += 1;
      }
    }
    return n > 0 ? static_cast<float>(clamp01(sum / n)) : std::numeric_limits<float>::quiet_NaN();
  }

  void add_regions(const DynamicMask& mask, ImageView<const float> depth) {
    const int f = options_.factor;
    const int w = mask.probability.width() / f;
    const int h = mask.probability.height() / f;
    if (w == 0 || h == 0) return;
    const auto given = objects_.size();
    const auto gap = static_cast<float>(options_.depth_gap);
    const auto at = [&](int i) { return mask.probability(i % w * f + f / 2, i / w * f + f / 2); };
    const auto z = [&](int i) { return depth(i % w * f + f / 2, i / w * f + f / 2); };
    for_each_component(
        w, h, scratch_, [&](int i) { return at(i) >= 0.5F; },
        [&](int i, int j) {
          if (depth.empty()) return true;
          const float a = z(i);
          const float b = z(j);
          return !(a > 0 && b > 0) || !(std::abs(a - b) > gap + 0.05F * std::min(a, b));
        },
        [&](const int* first, const int* last) {
          const auto count = static_cast<double>(last - first);
          if (count * f * f < options_.min_pixels) return;
          int x0 = w, x1 = -1, y0 = h, y1 = -1;
          double sum = 0;
          for (const int* i = first; i != last; ++i) {
            x0 = std::min(x0, *i % w);
            x1 = std::max(x1, *i % w);
            y0 = std::min(y0, *i / w);
            y1 = std::max(y1, *i / w);
            sum += static_cast<double>(at(*i));
          }
          Detection d;
          d.box = {static_cast<float>(x0 * f), static_cast<float>(y0 * f), static_cast<float>((x1 - x0 + 1) * f),
                   static_cast<float>((y1 - y0 + 1) * f)};
          for (std::size_t k = 0; k < given; ++k) {
            const Detection& o = objects_[k];
            if (!o.movable) continue;
            double inside = 0;
            for (const int* i = first; i != last; ++i) {
              const int x = *i % w * f + f / 2;
              const int y = *i / w * f + f / 2;
              const auto X = static_cast<float>(x);
              const auto Y = static_cast<float>(y);
              const bool in = o.mask.empty() ? X >= o.box.x && X < o.box.x + o.box.width && Y >= o.box.y &&
                                                   Y < o.box.y + o.box.height
                                             : o.mask(x, y) != 0;
              inside += in ? 1 : 0;
            }
            if (inside >= options_.covered * count) return;
          }
          d.score = static_cast<float>(clamp01(sum / count));
          d.motion_probability = d.score;
          d.class_id = kUnknownClass;
          objects_.push_back(d);
        });
  }

  // Greedy: the pair with the largest overlap first; ties go to the older identity.
  void identify() {
    pairs_.clear();
    for (std::size_t o = 0; o < objects_.size(); ++o) {
      if (objects_[o].track_id >= 0) continue;  // whoever detected it also tracks it
      for (std::size_t k = 0; k < known_.size(); ++k) {
        const float overlap = iou(objects_[o].box, known_[k].box);
        const bool classes_fit = objects_[o].class_id == known_[k].class_id ||
                                 objects_[o].class_id == kUnknownClass || known_[k].class_id == kUnknownClass;
        if (classes_fit && overlap >= static_cast<float>(options_.min_iou)) pairs_.push_back({overlap, o, k});
      }
    }
    std::stable_sort(pairs_.begin(), pairs_.end(), [](const Pair& a, const Pair& b) { return a.overlap > b.overlap; });
    taken_.assign(known_.size(), 0);
    for (const Pair& p : pairs_) {
      if (objects_[p.object].track_id >= 0 || taken_[p.known] != 0) continue;
      taken_[p.known] = 1;
      objects_[p.object].track_id = known_[p.known].id;
      known_[p.known].box = objects_[p.object].box;
      known_[p.known].class_id = objects_[p.object].class_id;
      known_[p.known].missed = -1;
    }
    for (Known& k : known_) ++k.missed;
    known_.erase(std::remove_if(known_.begin(), known_.end(),
                                [&](const Known& k) { return k.missed > options_.max_missed; }),
                 known_.end());
    for (Detection& d : objects_) {
      if (d.track_id >= 0) {
        next_id_ = std::max(next_id_, d.track_id + 1);
        continue;
      }
      d.track_id = next_id_++;
      known_.push_back({d.box, d.class_id, d.track_id, 0});
    }
  }

  struct Pair {
    float overlap;
    std::size_t object;
    std::size_t known;
  };
  ObjectTrackerOptions options_;
  std::vector<Detection> objects_;
  std::vector<Known> known_;
  std::vector<Pair> pairs_;
  std::vector<char> taken_;
  RegionScratch scratch_;
  int next_id_ = 0;
};

APSO_NAMESPACE_END
