/// \file
/// Which of the objects of a frame is which of the known ones.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/assignment.hpp>
#include <apso/observation/objects/object_prediction.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// Matches objects with predictions so that the sum of their agreements is largest (Hungarian method, Kuhn 1955).
class ObjectMatching {
 public:
  /// Agreement from which an object can be a known one, in [0,1]: half overlap of the boxes, half share of the pixels.
  static constexpr double kMinAgreement = 0.15;

  /// \param objects of this frame; one with a track_id is identified already and takes no part
  /// \param object  number of the object of a small pixel plus one, 0 = none
  /// \param depth_gap depths that differ by more than four times this are not the same object [m]
  void match(const ObjectGrid& grid, const ObjectPrediction& prediction, const std::vector<Detection>& objects, const Image<int>& object,
             const std::vector<KnownObject>& known, double depth_gap) {
    const std::size_t n = objects.size();
    const std::size_t m = known.size();
    shared_.assign(n * m, 0);
    depth_sum_.assign(n, 0.0);
    depth_count_.assign(n, 0);
    for (std::size_t i = 0; i < object.size(); ++i) {
      const int o = object.data()[i] - 1;
      if (o < 0) continue;
      const int seed = prediction.seed().data()[i];
      if (seed > 0) ++shared_[static_cast<std::size_t>(o) * m + static_cast<std::size_t>(seed) - 1];
      if (grid.depth.data()[i] > 0) {
        depth_sum_[static_cast<std::size_t>(o)] += static_cast<double>(grid.depth.data()[i]);
        ++depth_count_[static_cast<std::size_t>(o)];
      }
    }
    cost_.assign(n * m, std::numeric_limits<double>::infinity());
    for (std::size_t o = 0; o < n; ++o) {
      if (objects[o].track_id >= 0) continue;  // whoever detected it also tracks it
      for (std::size_t k = 0; k < m; ++k) {
        const bool classes_fit =
            objects[o].class_id == known[k].class_id || objects[o].class_id == kUnknownClass || known[k].class_id == kUnknownClass;
        if (!classes_fit) continue;
        const double shared = static_cast<double>(shared_[o * m + k]);
        cost_[o * m + k] = 1.0 - agreement(objects[o].box, depth(o), known[k], shared, prediction.count()[k], depth_gap);
      }
    }
    // a tiny part more, so that an agreement of just the minimum counts
    assign(cost_, n, m, 1.0 - kMinAgreement + 1e-9, match_, assignment_);
  }

  /// Number of the known object that each object is; -1 = none.
  [[nodiscard]] std::vector<int>& match() { return match_; }
  /// Mean depth of an object [m], 0 = not known.
  [[nodiscard]] double depth(std::size_t o) const { return depth_count_[o] > 0 ? depth_sum_[o] / depth_count_[o] : 0.0; }

 private:
  // Agreement of a box at depth z with what a known object predicts, in [0,1].
  [[nodiscard]] static double agreement(const Box& b, double z, const KnownObject& known, double shared, int seeds, double depth_gap) {
    const double overlap = static_cast<double>(iou(b, known.box));
    if (seeds > 0) return 0.5 * overlap + 0.5 * shared / seeds;
    // not seen lately: by distance, which may be larger than the box
    const double dx = static_cast<double>(b.x + b.width / 2 - known.box.x - known.box.width / 2);
    const double dy = static_cast<double>(b.y + b.height / 2 - known.box.y - known.box.height / 2);
    const double reach = 0.75 * std::hypot(static_cast<double>(known.box.width), static_cast<double>(known.box.height));
    if (known.z > 0 && z > 0 && std::abs(z - static_cast<double>(known.z)) > 4.0 * depth_gap) return 0.0;
    return 0.5 * overlap + 0.5 * std::max(0.0, 1.0 - std::hypot(dx, dy) / std::max(1.0, reach));
  }

  std::vector<int> shared_, depth_count_, match_;
  std::vector<double> cost_, depth_sum_;
  AssignmentScratch assignment_;
};

APSO_NAMESPACE_END
