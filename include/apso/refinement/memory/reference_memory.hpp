/// \file
/// The good frames of the recent past, and which of them to align a frame to: the paper's eq. (12), and the time decay
/// B_k of eq. (16).
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
#include <apso/math/se3.hpp>
#include <apso/options.hpp>
#include <apso/refinement/alignment_result.hpp>
#include <apso/refinement/memory/frame_descriptor.hpp>
#include <apso/refinement/memory/motion_distance.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/traits/any.hpp>

APSO_NAMESPACE_BEGIN

enum class DistanceForm {
  Euclidean,  ///< sqrt of the sum of the squares of the two parts
  Sum,        ///< sum of the two parts, as eq. (12) prints; larger by a factor of 1 to sqrt(2)
};
constexpr std::array<const char*, 2> enum_names(DistanceForm) { return {"euclidean", "sum"}; }

/// The motion characteristic M of eq. (12), which the paper does not define.
enum class MotionForm {
  RelativePose,  ///< the motion from the reference to the predicted pose
  FlowGrid,      ///< the optical flow of both frames by cell, each against the frame before it; needs tracks
};
constexpr std::array<const char*, 2> enum_names(MotionForm) { return {"relative_pose", "flow_grid"}; }

enum class DecayForm {
  Age,      ///< B_k = exp(-lambda |t_c - t_k|): recent references weigh more, as the text says
  Printed,  ///< B_k = exp(-lambda (t_k - t_c)), as printed: with t_k < t_c older references weigh more
};
constexpr std::array<const char*, 2> enum_names(DecayForm) { return {"age", "printed"}; }

/// MemoryOptions::references where nothing is known of the camera.
inline constexpr int kReferences = 3;

struct MemoryOptions {
  int capacity = 20;          ///< frames kept; as many as the geometry database of DynaSLAM
  double th_keyframes = 1.2;  ///< largest distance of a reference, dimensionless; see motion_distance()
  int references = 0;         ///< K of eq. (16): most references at once; 0: references_for_depth() where a program knows its camera,
                              ///< else kReferences
  double decay = 0.5;         ///< lambda of eq. (16) [1/s]
  DistanceForm form = DistanceForm::Euclidean;
  MotionForm motion = MotionForm::RelativePose;
  DecayForm decay_form = DecayForm::Age;
  bool previous = true;  ///< the frame before is one more reference (see kPreviousWeight); the paper has stored ones only
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("capacity", s.capacity, 1, 1000);
    v("th_keyframes", s.th_keyframes, 0.0, 1e6);
    v("references", s.references, 0, 8);
    v("decay", s.decay, 0.0, 1e6);
    v("form", s.form);
    v("motion", s.motion);
    v("decay_form", s.decay_form);
    v("previous", s.previous);
  }
  [[nodiscard]] int most_references() const { return references > 0 ? references : kReferences; }
};

/// Weight B_k of a reference of time t_k at time t_c [s].
/// \param lambda [1/s]
[[nodiscard]] inline double time_decay(double t_c, double t_k, double lambda, DecayForm form = DecayForm::Age) {
  return std::exp(-lambda * (form == DecayForm::Printed ? t_k - t_c : std::abs(t_c - t_k)));
}

/// Distance of a frame to a reference, dimensionless.
/// \param depth_difference of the depth grids [1/m]
/// \param motion_difference motion_distance(), or the difference of the flow grids in units of kFlowSigma
[[nodiscard]] inline double reference_distance(double depth_difference, double motion_difference,
                                               DistanceForm form = DistanceForm::Euclidean) {
  constexpr double kDepthSigma = 0.10;  // [1/m]: as much as 0.15 m at 1.2 m
  const double d = depth_difference / kDepthSigma;
  return form == DistanceForm::Sum ? d + motion_difference : std::sqrt(d * d + motion_difference * motion_difference);
}
/// Weight of the frame before among the references, besides B_k: it looks most alike, which makes poses smooth, but its own
/// pose errs as much as the one that is sought, so that they drift. Of 0.1 to 1, this keeps most of the first for little of
/// the second.
inline constexpr double kPreviousWeight = 0.3;
inline constexpr double kFlowSigma = 20;  ///< unit of the difference of two flow grids [px]

/// A ring of good frames. Poses of any type go in. Reuses the memory of the frames it forgets: once it is full, nothing is
/// allocated.
class ReferenceMemory {
 public:
  struct Entry {
    std::int64_t id = -1;
    double timestamp = 0;
    Pose T_world_reference = identity_pose();
    FrameDescriptor descriptor;
    FramePyramid pyramid;  ///< selected pixels only
  };
  struct Selection {
    std::vector<AlignmentReference> references;                 ///< nearest first
    std::vector<std::int64_t> ids;                              ///< of the same; -1 = the frame before, which is not stored
    double distance = std::numeric_limits<double>::infinity();  ///< of the nearest
    bool far_reference = false;                                 ///< none was near enough, the nearest is used all the same
    bool masked = false;                                        ///< a mask of some reference carries information

    void clear() {
      references.clear();
      ids.clear();
      distance = std::numeric_limits<double>::infinity();
      far_reference = masked = false;
    }
  };

  explicit ReferenceMemory(const MemoryOptions& options = {}) : options_(options) { validate(options_, "memory"); }

  [[nodiscard]] const MemoryOptions& options() const { return options_; }
  [[nodiscard]] int size() const { return static_cast<int>(entries_.size()); }
  [[nodiscard]] const Entry& entry(int i) const { return entries_[static_cast<std::size_t>(i)]; }
  void clear() {
    entries_.clear();
    has_previous_ = false;
    latest_ = -1;
  }

  /// True when a frame is far enough in time or space from the latest one to be worth storing.
  [[nodiscard]] bool wants(double timestamp, const AnyPose& T_world_camera) const {
    if (latest_ < 0) return true;
    const Entry& e = entries_[static_cast<std::size_t>(latest_)];
    const Pose motion = compose(inverse(e.T_world_reference), T_world_camera);
    return std::abs(timestamp - e.timestamp) >= kSpacingTime || norm(translation(motion)) >= kSpacingTranslation ||
           rotation_angle(motion) >= kSpacingRotation;
  }

  /// Keeps a frame until the next one comes, beside the stored ones: add_previous() makes it a reference.
  void keep_previous(const FramePyramid& reference, const AnyPose& T_world_camera) {
    has_previous_ = true;
    previous_.timestamp = reference.timestamp();
    previous_.T_world_reference = T_world_camera;
    previous_.pyramid.assign_reference(reference);
  }
  /// Adds the frame kept last to a selection, if it is recent and not one of the selected.
  void add_previous(double timestamp, Selection& out) const {
    const double age = timestamp - previous_.timestamp;
    if (!has_previous_ || !(age > 0) || age > kPreviousAge) return;
    for (std::int64_t id : out.ids) {
      for (const Entry& e : entries_) {
        if (e.id == id && !(e.timestamp < previous_.timestamp)) return;  // the same frame, stored
      }
    }
    add(previous_, timestamp, out);
    out.references.back().weight *= kPreviousWeight;
  }

  /// Stores a frame in place of the oldest one; its id is returned.
  std::int64_t insert(const FramePyramid& reference, const FrameDescriptor& descriptor, const AnyPose& T_world_camera) {
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

  /// Takes over a pose that a back end has corrected; false if the frame is not stored any more. The frame kept by
  /// keep_previous() moves along if it is the same or a later one, since its pose hangs on the stored ones.
  bool correct(std::int64_t id, const AnyPose& T_world_reference) {
    for (Entry& e : entries_) {
      if (e.id != id) continue;
      if (has_previous_ && !(previous_.timestamp < e.timestamp)) {
        const Pose T_reference_previous = compose(inverse(e.T_world_reference), previous_.T_world_reference);
        previous_.T_world_reference = compose(T_world_reference, T_reference_previous);
      }
      e.T_world_reference = T_world_reference;
      return true;
    }
    return false;
  }

  /// The same for all frames, the one kept by keep_previous() among them.
  /// \param pose_of of the timestamp of a frame and its pose so far: its pose now, as std::optional<Pose>; nullopt leaves it
  template <class PoseOf>
  void correct(PoseOf&& pose_of) {
    const auto one = [&](Entry& e) {
      if (const std::optional<Pose> now = pose_of(e.timestamp, e.T_world_reference)) e.T_world_reference = *now;
    };
    for (Entry& e : entries_) one(e);
    if (has_previous_) one(previous_);
  }

  /// The K nearest references, with their weights B_k. Ties go to the more recent one. A reference of which too little is
  /// known to be compared is not chosen. If none is near enough: the nearest up to kFarDistance, else the latest of the last
  /// kFallbackAge seconds, marked as far.
  void select(double timestamp, const AnyPose& T_world_predicted, const FrameDescriptor& descriptor, Selection& out) {
    out.clear();
    order_.clear();
    for (int i = 0; i < size(); ++i) {
      const std::optional<double> distance = distance_to(entry(i), T_world_predicted, descriptor);
      if (distance && std::isfinite(*distance)) order_.push_back({*distance, i});
    }
    std::sort(order_.begin(), order_.end(), [&](const Candidate& a, const Candidate& b) {
      return a.distance != b.distance ? a.distance < b.distance : entry(a.index).id > entry(b.index).id;
    });
    if (!order_.empty()) out.distance = order_.front().distance;
    for (const Candidate& c : order_) {
      if (c.distance > options_.th_keyframes || static_cast<int>(out.references.size()) >= options_.most_references()) break;
      add(c.index, timestamp, out);
    }
    if (!out.references.empty()) return;
    if (!order_.empty() && order_.front().distance <= kFarDistance) {
      out.far_reference = true;
      add(order_.front().index, timestamp, out);
      return;
    }
    int nearest = -1;  // in time
    for (int i = 0; i < size(); ++i) {
      if (std::abs(entry(i).timestamp - timestamp) > kFallbackAge) continue;
      if (nearest < 0 || std::abs(entry(i).timestamp - timestamp) < std::abs(entry(nearest).timestamp - timestamp)) {
        nearest = i;
      }
    }
    if (nearest >= 0) {
      out.far_reference = true;
      add(nearest, timestamp, out);
    }
  }

 private:
  // A frame is stored when this much time has passed or the camera has moved so far since the last one.
  static constexpr double kSpacingTime = 0.2;              // [s]
  static constexpr double kSpacingTranslation = 0.05;      // [m]
  static constexpr double kSpacingRotation = 3 * kDegree;  // [rad]
  static constexpr double kPreviousAge = 0.5;              // [s]: an older one is not the frame before any more
  // Where no reference is near: what is tried all the same.
  static constexpr double kFarDistance = 2.5;
  static constexpr double kFallbackAge = 2.0;  // [s]

  struct Candidate {
    double distance;
    int index;
  };
  [[nodiscard]] std::optional<double> distance_to(const Entry& e, const Pose& T_world_predicted, const FrameDescriptor& descriptor) const {
    const std::optional<double> depth = grid_distance(descriptor.depth, e.descriptor.depth);
    if (!depth) return std::nullopt;
    if (options_.motion == MotionForm::RelativePose) {
      return reference_distance(*depth, motion_distance(e.T_world_reference, T_world_predicted), options_.form);
    }
    const std::optional<double> flow = grid_distance(descriptor.flow, e.descriptor.flow);
    if (!flow) return std::nullopt;
    return reference_distance(*depth, *flow / kFlowSigma, options_.form);
  }
  void add(int i, double timestamp, Selection& out) const { add(entry(i), timestamp, out); }
  void add(const Entry& e, double timestamp, Selection& out) const {
    const double weight = time_decay(timestamp, e.timestamp, options_.decay, options_.decay_form);
    out.references.push_back({&e.pyramid, e.T_world_reference, weight});
    out.ids.push_back(e.id);
    out.masked = out.masked || e.pyramid.masked();
  }

  MemoryOptions options_;
  std::vector<Entry> entries_;
  Entry previous_;  // not stored, hence without an id
  bool has_previous_ = false;
  std::vector<Candidate> order_;
  std::int64_t next_id_ = 0;
  int latest_ = -1;
};

APSO_NAMESPACE_END
