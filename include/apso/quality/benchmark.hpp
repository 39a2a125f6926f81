/// \file
/// The reference frame of the change scores and when another frame takes its place (eq. Benchmark Update).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/quality/scores/depth_change.hpp>
#include <apso/quality/scores/motion_change.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/score.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// What a frame must keep to be compared with later ones. Owns everything; copying into an old one reuses its memory.
struct FrameSnapshot {
  struct Point {
    std::int64_t id;
    float x;
    float y;
  };
  double timestamp = 0;            ///< [s]
  Quality S_total;                 ///< quality of the frame
  std::vector<Point> points;       ///< static tracks, by rising id
  DepthSamples depth;              ///< static depth
  std::vector<Detection> objects;  ///< without their masks
  bool has_tracks = false;         ///< tracks were given (there may be none)
  bool has_objects = false;        ///< objects were given (there may be none)
};

/// Points that are in both frames.
inline void match_points(const FrameSnapshot& reference, const FrameSnapshot& current, std::vector<Correspondence>& out) {
  out.clear();
  auto r = reference.points.begin();
  for (const FrameSnapshot::Point& p : current.points) {
    while (r != reference.points.end() && r->id < p.id) ++r;
    if (r == reference.points.end()) break;
    if (r->id == p.id) out.push_back({r->x, r->y, p.x, p.y});
  }
}

struct BenchmarkOptions {
  double half_life = 10;     ///< h [s]: the score to beat halves in this time; infinity = the paper's ratchet
  double max_age = 10;       ///< [s] an older reference is replaced; infinity = never
  double min_overlap = 0.3;  ///< rho_t below which the reference is losing sight of the scene
  int overlap_frames = 5;    ///< ... in this many frames in a row
  double recent = 2;         ///< [s] among the GOOD frames of this last time a replacement is sought
  bool hand_over = true;     ///< see Benchmark::update; false = the paper, which never lets a reference go this way
  double max_change = 0.25;  ///< S_change from which the camera has left the reference behind, [0,1]
  double max_step = 0.6;     ///< S_change to the frame before, up to which a frame continues it, [0,1]
  double max_dynamic = 0.5;  ///< dynamic ratio up to which a frame shows enough of the background, [0,1]
  int steady_frames = 5;     ///< so many such frames in a row make a frame a reference
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    v("half_life", s.half_life, 1e-3, infinity);
    v("max_age", s.max_age, 1e-3, infinity);
    v("min_overlap", s.min_overlap, 0.0, 1.0);
    v("overlap_frames", s.overlap_frames, 1, 1000000);
    v("recent", s.recent, 0.0, 60.0);
    v("hand_over", s.hand_over);
    v("max_change", s.max_change, 0.0, 1.0);
    v("max_step", s.max_step, 0.0, 1.0);
    v("max_dynamic", s.max_dynamic, 0.0, 1.0);
    v("steady_frames", s.steady_frames, 1, 1000000);
  }
};

/// Holds the reference frame. Frame and score are always replaced together.
class Benchmark {
 public:
  explicit Benchmark(const BenchmarkOptions& options = {}) : o_(options) {}

  void reset() {
    present_ = false;
    low_overlap_ = 0;
    while (!recent_.empty()) recycle(recent_.size() - 1);
  }
  [[nodiscard]] bool present() const { return present_; }
  [[nodiscard]] const FrameSnapshot& reference() const { return reference_; }
  void set(const FrameSnapshot& frame) {
    reference_ = frame;
    present_ = true;
    low_overlap_ = 0;
  }
  /// S_ref 2^(-age / h), the score a frame must beat.
  [[nodiscard]] double score_to_beat(double now) const {
    return reference_.S_total.value() * std::exp2(-std::max(0.0, now - reference_.timestamp) / o_.half_life);
  }
  /// After the decision about a frame: a GOOD frame that beats the reference replaces it. A stale reference (few of
  /// its tracks left for several frames, or too old) gives way to the best GOOD frame of the last time.
  ///
  /// Hand-over: a camera that turns away smoothly leaves every reference behind. S_change then says BAD although
  /// nothing is wrong, and since a BAD frame may not become the reference, it would say so until the camera comes
  /// back. So the reference is handed on to a steady frame as soon as S_change exceeds BenchmarkOptions::max_change.
  /// \param change  S_change against the reference; missing counts as none
  /// \param overlap rho_t of the frame, [0,1]; NaN when not measured
  /// \param steady  frames in a row, up to this one, that are good by themselves and continue the one before: after
  ///                a jump (occlusion, flash, wrong place) the reference stays until the scene has settled
  /// \return whether the reference was replaced
  bool update(const FrameSnapshot& frame, bool good, MaybeDeviation change, double overlap, int steady) {
    const double now = frame.timestamp;
    // Keep only candidates that can still be chosen: a newer frame that is as good outlives an older one.
    if (good) {
      while (!recent_.empty() && !(frame.S_total < recent_.back().S_total)) recycle(recent_.size() - 1);
      FrameSnapshot slot;
      if (!pool_.empty()) {
        slot = std::move(pool_.back());
        pool_.pop_back();
      }
      slot = frame;
      recent_.push_back(std::move(slot));
    }
    while (!recent_.empty() && now - recent_.front().timestamp > o_.recent) recycle(0);

    low_overlap_ = overlap < o_.min_overlap ? low_overlap_ + 1 : 0;  // NaN counts as fine
    if (!present_) return false;
    if (good && frame.S_total.value() > score_to_beat(now)) {
      set(frame);
      return true;
    }
    const bool may_hand_over = o_.hand_over && steady >= o_.steady_frames;
    if (may_hand_over && change && change->value() > o_.max_change) {
      set(frame);
      return true;
    }
    const bool stale = low_overlap_ >= o_.overlap_frames || now - reference_.timestamp > o_.max_age;
    if (!stale) return false;
    for (const FrameSnapshot& candidate : recent_) {
      if (candidate.timestamp <= reference_.timestamp) continue;
      set(candidate);
      return true;
    }
    if (may_hand_over) {
      set(frame);
      return true;
    }
    return false;
  }

 private:
  void recycle(std::size_t i) {
    pool_.push_back(std::move(recent_[i]));
    recent_.erase(recent_.begin() + static_cast<std::ptrdiff_t>(i));
  }
  BenchmarkOptions o_;
  FrameSnapshot reference_;
  bool present_ = false;
  int low_overlap_ = 0;
  std::vector<FrameSnapshot> recent_;  ///< GOOD frames, oldest and best first
  std::vector<FrameSnapshot> pool_;    ///< snapshots to be used again
};

APSO_NAMESPACE_END
