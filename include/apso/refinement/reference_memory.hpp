/// \file
/// The good frames of the recent past, and which of them to align a bad frame to: the paper's eq. (Reference Frame)
/// and the time decay B_k.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/se3.hpp>
#include <apso/options.hpp>
#include <apso/refinement/aligner.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

enum class DistanceForm {
  Euclidean,  ///< sqrt of the sum of the squares of the two parts
  Sum,        ///< sum of the two parts, as printed in the paper
};
constexpr std::array<const char*, 2> enum_names(DistanceForm) { return {"euclidean", "sum"}; }

struct MemoryOptions {
  int capacity = 20;                ///< frames kept
  double spacing_time = 0.2;        ///< a frame is stored when this much time has passed [s],
  double spacing_translation = 0.05;                            ///< or the camera has moved [m],
  double spacing_rotation = 3 * kDegree;  ///< or turned [rad]
  double sigma_depth = 0.10;        ///< unit of the depth part [1/m]
  double sigma_translation = 0.15;  ///< unit of the motion part [m]
  double sigma_rotation = 10 * kDegree;   ///< unit of the motion part [rad]
  double min_common_cells = 0.3;    ///< references that share fewer depth cells are rejected
  double near_distance = 1.2;       ///< th_keyframes: largest distance of a reference
  double far_distance = 2.5;        ///< if there is none: the nearest up to this, flagged
  double fallback_age = 2.0;        ///< if there is none either: the latest up to this age [s]
  int references = 3;               ///< K: most references at once
  double decay = 0.5;               ///< lambda of the time decay [1/s]
  DistanceForm form = DistanceForm::Euclidean;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("capacity", s.capacity, 1, 1000);
    v("spacing_time", s.spacing_time, 0.0, 1e6);
    v("spacing_translation", s.spacing_translation, 0.0, 1e6);
    v("spacing_rotation", s.spacing_rotation, 0.0, 4.0);
    v("sigma_depth", s.sigma_depth, 1e-9, 1e6);
    v("sigma_translation", s.sigma_translation, 1e-9, 1e6);
    v("sigma_rotation", s.sigma_rotation, 1e-9, 1e6);
    v("min_common_cells", s.min_common_cells, 0.0, 1.0);
    v("near_distance", s.near_distance, 0.0, 1e6);
    v("far_distance", s.far_distance, 0.0, 1e6);
    v("fallback_age", s.fallback_age, 0.0, 1e6);
    v("references", s.references, 1, 8);
    v("decay", s.decay, 0.0, 1e6);
    v("form", s.form);
  }
};

/// Weight of a reference of time t_k at time t_c [s]: B_k = exp(-lambda |t_c - t_k|). Older references weigh less; with
/// the sign that the paper prints they would weigh more.
[[nodiscard]] inline double time_decay(double t_c, double t_k, double lambda) {
  return std::exp(-lambda * std::abs(t_c - t_k));
}

/// Median inverse depth [1/m] of the static part of an image on a grid of 8 x 6 cells; 0 = unknown.
struct DepthDescriptor {
  static constexpr int kColumns = 8;
  static constexpr int kRows = 6;
  std::array<float, kColumns * kRows> inverse_depth{};
};

/// \param dynamic_probability of the size of the depth, or empty
[[nodiscard]] inline DepthDescriptor depth_descriptor(const ImageView<const float>& depth,
                                                      const ImageView<const float>& dynamic_probability = {},
                                                      const DepthRange& range = {}, float static_below = 0.3F) {
  expects(dynamic_probability.empty() ||
              (dynamic_probability.width == depth.width && dynamic_probability.height == depth.height),
          "depth_descriptor: depth and dynamic probability differ in size");
  DepthDescriptor d;
  std::vector<float> values;
  const int step = std::max(1, depth.width / 160);
  for (int r = 0; r < DepthDescriptor::kRows; ++r) {
    for (int c = 0; c < DepthDescriptor::kColumns; ++c) {
      values.clear();
      int looked_at = 0;
      for (int y = depth.height * r / DepthDescriptor::kRows; y < depth.height * (r + 1) / DepthDescriptor::kRows; y += step) {
        for (int x = depth.width * c / DepthDescriptor::kColumns; x < depth.width * (c + 1) / DepthDescriptor::kColumns;
             x += step) {
          ++looked_at;
          if (!depth_valid(depth(x, y), range)) continue;
          if (!dynamic_probability.empty() && !(dynamic_probability(x, y) < static_below)) continue;
          values.push_back(1.0F / depth(x, y));
        }
      }
      const bool enough = values.size() >= 4 && values.size() * 10 >= static_cast<std::size_t>(looked_at);
      d.inverse_depth[static_cast<std::size_t>(r * DepthDescriptor::kColumns + c)] = enough ? upper_median(values) : 0.0F;
    }
  }
  return d;
}

/// Root mean square difference of two descriptors over the cells known in both [1/m]; nothing if these are fewer than
/// the given share of all cells.
[[nodiscard]] inline std::optional<double> descriptor_distance(const DepthDescriptor& a, const DepthDescriptor& b,
                                                               double min_common) {
  double sum = 0;
  int n = 0;
  for (std::size_t i = 0; i < a.inverse_depth.size(); ++i) {
    if (!(a.inverse_depth[i] > 0) || !(b.inverse_depth[i] > 0)) continue;
    const double d = static_cast<double>(a.inverse_depth[i]) - static_cast<double>(b.inverse_depth[i]);
    sum += d * d;
    ++n;
  }
  if (n == 0 || n < min_common * static_cast<double>(a.inverse_depth.size())) return std::nullopt;
  return std::sqrt(sum / n);
}

/// Distance of a frame to a reference, dimensionless.
/// \param depth_difference of the descriptors [1/m]
/// \param motion Log(T_reference_current)
[[nodiscard]] inline double reference_distance(double depth_difference, const Twist& motion, const MemoryOptions& o = {}) {
  const double d = depth_difference / o.sigma_depth;
  const double t = translation_norm(motion) / o.sigma_translation;
  const double w = rotation_norm(motion) / o.sigma_rotation;
  const double m = std::sqrt(t * t + w * w);
  return o.form == DistanceForm::Sum ? d + m : std::sqrt(d * d + m * m);
}

/// A ring of good frames. Reuses the memory of the frames it forgets.
class ReferenceMemory {
 public:
  struct Entry {
    std::int64_t id = -1;
    double timestamp = 0;
    Pose T_world_reference = Pose::Identity();
    DepthDescriptor descriptor;
    FramePyramid pyramid;  ///< selected pixels only
  };
  struct Selection {
    std::vector<AlignmentReference> references;  ///< nearest first
    std::vector<std::int64_t> ids;               ///< of the same
    double distance = std::numeric_limits<double>::infinity();  ///< of the nearest
    bool far_reference = false;                  ///< none was near enough, the nearest is used all the same
    bool masked = false;                         ///< a mask of some reference carries information
  };

  explicit ReferenceMemory(const MemoryOptions& options = {}) : options_(options) { validate(options_, "memory"); }

  [[nodiscard]] const MemoryOptions& options() const { return options_; }
  [[nodiscard]] int size() const { return static_cast<int>(entries_.size()); }
  [[nodiscard]] const Entry& entry(int i) const { return entries_[static_cast<std::size_t>(i)]; }
  void clear() {
    entries_.clear();
    latest_ = -1;
  }

  /// True when a frame is far enough in time or space from the latest one to be worth storing.
  [[nodiscard]] bool wants(double timestamp, const Pose& T_world_camera) const {
    if (latest_ < 0) return true;
    const Entry& e = entries_[static_cast<std::size_t>(latest_)];
    const Pose motion = compose(inverse(e.T_world_reference), T_world_camera);
    return std::abs(timestamp - e.timestamp) >= options_.spacing_time ||
           norm(translation(motion)) >= options_.spacing_translation ||
           rotation_angle(motion) >= options_.spacing_rotation;
  }

  /// Stores a frame in place of the oldest one; its id is returned.
  std::int64_t insert(const FramePyramid& reference, const DepthDescriptor& descriptor, const Pose& T_world_camera) {
    std::size_t slot = 0;
    if (size() < options_.capacity) {
      slot = entries_.size();
      entries_.emplace_back();
    } else {
      for (std::size_t i = 1; i < entries_.size(); ++i) {
        if (entries_[i].id < entries_[slot].id) slot = i;
      }
    }
    Entry& e = entries_[slot];
    e.id = next_id_++;
    e.timestamp = reference.timestamp();
    e.T_world_reference = T_world_camera;
    e.descriptor = descriptor;
    e.pyramid.assign_reference(reference);
    latest_ = static_cast<int>(slot);
    return e.id;
  }

  /// Takes over a pose that a back end has corrected; false if the frame is not stored any more.
  bool correct(std::int64_t id, const Pose& T_world_reference) {
    for (Entry& e : entries_) {
      if (e.id != id) continue;
      e.T_world_reference = T_world_reference;
      return true;
    }
    return false;
  }

  /// The K nearest references, with their weights B_k. Ties go to the more recent one.
  void select(double timestamp, const Pose& T_world_predicted, const DepthDescriptor& descriptor, Selection& out) {
    out = Selection{};
    order_.clear();
    for (int i = 0; i < size(); ++i) {
      const Entry& e = entry(i);
      const auto d = descriptor_distance(descriptor, e.descriptor, options_.min_common_cells);
      if (!d) continue;
      const double distance = reference_distance(*d, se3_log(compose(inverse(e.T_world_reference), T_world_predicted)), options_);
      if (std::isfinite(distance)) order_.push_back({distance, i});
    }
    std::sort(order_.begin(), order_.end(), [&](const Candidate& a, const Candidate& b) {
      return a.distance != b.distance ? a.distance < b.distance : entry(a.index).id > entry(b.index).id;
    });
    if (!order_.empty()) out.distance = order_.front().distance;
    for (const Candidate& c : order_) {
      if (c.distance > options_.near_distance || static_cast<int>(out.references.size()) >= options_.references) break;
      add(c.index, timestamp, out);
    }
    if (!out.references.empty()) return;
    if (!order_.empty() && order_.front().distance <= options_.far_distance) {
      out.far_reference = true;
      add(order_.front().index, timestamp, out);
      return;
    }
    int nearest = -1;  // in time
    for (int i = 0; i < size(); ++i) {
      if (std::abs(entry(i).timestamp - timestamp) > options_.fallback_age) continue;
      if (nearest < 0 ||
          std::abs(entry(i).timestamp - timestamp) < std::abs(entry(nearest).timestamp - timestamp)) {
        nearest = i;
      }
    }
    if (nearest >= 0) {
      out.far_reference = true;
      add(nearest, timestamp, out);
    }
  }

 private:
  struct Candidate {
    double distance;
    int index;
  };
  void add(int i, double timestamp, Selection& out) const {
    const Entry& e = entry(i);
    out.references.push_back({&e.pyramid, e.T_world_reference, time_decay(timestamp, e.timestamp, options_.decay)});
    out.ids.push_back(e.id);
    out.masked = out.masked || e.pyramid.masked();
  }

  MemoryOptions options_;
  std::vector<Entry> entries_;
  std::vector<Candidate> order_;
  std::int64_t next_id_ = 0;
  int latest_ = -1;
};

APSO_NAMESPACE_END
