/// \file
/// The reference frame of the change scores and when another frame takes its place: equation (10).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// What a GOOD frame with a higher score replaces.
enum class BenchmarkUpdate {
  SwapReference,  ///< the reference frame and its score
  NumberOnly      ///< the score alone, as printed: later frames are still compared with the first reference
};
constexpr std::array<const char*, 2> enum_names(BenchmarkUpdate) { return {"swap_reference", "number_only"}; }

struct BenchmarkOptions {
  BenchmarkUpdate update = BenchmarkUpdate::SwapReference;
  double half_life = 10;  ///< h [s]: the score to beat halves in this time; infinity = the paper's ratchet
  double max_age = 10;    ///< [s] an older reference is replaced; infinity = never
  bool hand_over = true;  ///< see Benchmark::update; false = the paper, which never lets a reference go this way
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    v("update", s.update);
    v("half_life", s.half_life, 1e-3, infinity);
    v("max_age", s.max_age, 1e-3, infinity);
    v("hand_over", s.hand_over);
  }
};

/// rho_t below which the reference is losing sight of the scene, [0,1] ...
inline constexpr double kMinimumVisibleShare = 0.3;
/// ... in this many consecutive frames.
inline constexpr int kLowOverlapFrames = 5;
/// Among the GOOD frames of this last time a replacement is sought [s].
inline constexpr double kRecentTime = 2;
/// S_change from which the camera has left the reference behind, [0,1].
inline constexpr double kHandOverChange = 0.25;
/// S_change to the frame before, up to which a frame continues it, [0,1].
inline constexpr double kSteadyStep = 0.6;
/// Dynamic ratio up to which a frame shows enough of the background to continue the one before, [0,1].
inline constexpr double kSteadyDynamicRatio = 0.5;
/// So many such frames in succession make a frame a reference.
inline constexpr int kSteadyFrames = 5;

/// The least that a Benchmark keeps of a frame.
struct ScoredFrame {
  double timestamp = 0;  ///< [s]
  Quality S_total;       ///< quality of the frame
};

/// Holds the reference frame and the score that the next one must beat.
/// \tparam Snapshot has `timestamp` and `S_total`, and whatever a later frame is compared with
template <class Snapshot = ScoredFrame>
class Benchmark {
 public:
  explicit Benchmark(const BenchmarkOptions& options = {}) : o_(options) {}

  void reset() {
    present_ = false;
    low_overlap_ = 0;
    while (!recent_.empty()) recycle(recent_.size() - 1);
  }
  [[nodiscard]] bool present() const { return present_; }
  [[nodiscard]] const Snapshot& reference() const { return reference_; }
  /// S_Initial of the paper: the score of the reference, or the last that beat it.
  [[nodiscard]] Quality S_reference() const { return S_reference_; }
  void set(const Snapshot& frame) {
    reference_ = frame;
    present_ = true;
    low_overlap_ = 0;
    set_score(frame);
  }
  /// S_ref 2^(-age / h), the score a frame must beat.
  [[nodiscard]] double score_to_beat(double now) const {
    return S_reference_.value() * std::exp2(-std::max(0.0, now - score_timestamp_) / o_.half_life);
  }
  /// After the decision about a frame: a GOOD frame that beats the reference replaces it. A stale reference (few of
  /// its tracks left for several frames, or too old) gives way to the best GOOD frame of the last kRecentTime.
  ///
  /// Hand-over: a camera that turns away smoothly leaves every reference behind. S_change then says BAD although
  /// nothing is wrong, and since a BAD frame may not become the reference, it would say so until the camera comes
  /// back. So the reference is handed on to a steady frame as soon as S_change exceeds kHandOverChange.
  /// \param change  S_change against the reference; missing counts as none
  /// \param overlap rho_t of the frame, [0,1]; NaN when not measured
  /// \param steady  consecutive frames, up to this one, that are good by themselves and continue the one before: after
  ///                a jump (occlusion, flash, wrong place) the reference stays until the scene has settled
  /// \return whether the reference, or with BenchmarkUpdate::NumberOnly its score, was replaced
  bool update(const Snapshot& frame, bool good, MaybeDeviation change, double overlap, int steady) {
    const double now = frame.timestamp;
    // Keep only candidates that can still be chosen: a newer frame that is as good outlives an older one.
    if (good) {
      while (!recent_.empty() && !(frame.S_total < recent_.back().S_total)) recycle(recent_.size() - 1);
      Snapshot slot;
      if (!pool_.empty()) {
        slot = std::move(pool_.back());
        pool_.pop_back();
      }
      slot = frame;
      recent_.push_back(std::move(slot));
    }
    while (!recent_.empty() && now - recent_.front().timestamp > kRecentTime) recycle(0);

    low_overlap_ = overlap < kMinimumVisibleShare ? low_overlap_ + 1 : 0;  // NaN counts as fine
    if (!present_) return false;
    if (good && frame.S_total.value() > score_to_beat(now)) {
      if (o_.update == BenchmarkUpdate::NumberOnly) set_score(frame);
      else set(frame);
      return true;
    }
    if (o_.update == BenchmarkUpdate::NumberOnly) return false;  // the frame stays for ever
    const bool may_hand_over = o_.hand_over && steady >= kSteadyFrames;
    if (may_hand_over && change && change->value() > kHandOverChange) {
      set(frame);
      return true;
    }
    const bool stale = low_overlap_ >= kLowOverlapFrames || now - reference_.timestamp > o_.max_age;
    if (!stale) return false;
    for (const Snapshot& candidate : recent_) {
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
  void set_score(const Snapshot& frame) {
    S_reference_ = frame.S_total;
    score_timestamp_ = frame.timestamp;
  }
  void recycle(std::size_t i) {
    pool_.push_back(std::move(recent_[i]));
    recent_.erase(recent_.begin() + static_cast<std::ptrdiff_t>(i));
  }
  BenchmarkOptions o_;
  Snapshot reference_;
  Quality S_reference_;
  double score_timestamp_ = 0;  ///< [s]
  bool present_ = false;
  int low_overlap_ = 0;
  std::vector<Snapshot> recent_;  ///< GOOD frames, oldest and best first
  std::vector<Snapshot> pool_;    ///< snapshots to be used again
};

APSO_NAMESPACE_END
