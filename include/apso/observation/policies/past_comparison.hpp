/// \file
/// The frame of policies that compare each frame with an earlier one: reducing images, keeping views, joining evidence.
#pragma once

#include <cstdint>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/geometry/carried_log_odds.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Reduces each frame, hands it with a view of about 0.2 seconds ago to the policy, carries what the policy finds
/// through time and makes the mask. Views older than two seconds are forgotten: the scene may have changed altogether.
class PastComparison {
 public:
  static constexpr double kSpan = 0.2;       ///< age of the frame that is compared with [s]; a walking person moves by 0.2 m
  static constexpr double kForgotten = 2.0;  ///< age of the oldest view [s]

  PastComparison(const Pinhole& camera, const DepthRange& range, const RegionRules& rules)
      : reducer_(camera, kMotionWidth, range), rules_(rules), history_(kSpan) {}

  /// \param compare called as compare(current, past, T_past_current_prior, probability, known) when there is a past
  /// view: writes what this pair of frames says, probability of motion [0,1] and 1 where it says anything; both
  /// images have the size of `small_camera()` and are zero before
  template <class Compare>
  void observe(const AnyFrame& frame, const Pose& T_world_camera_prior, Compare&& compare, DynamicMask& out) {
    reducer_.frame(frame, current_);
    const double dt = clock_.tick(frame.timestamp);
    current_.time = clock_.now();
    current_.T_world_camera = T_world_camera_prior;
    const Pinhole& small = reducer_.small();
    probability_.assign(small.width, small.height, 0.0F);
    known_.assign(small.width, small.height, 0);
    history_.forget_before(current_.time - kForgotten);
    if (const SmallFrame* past = history_.reference(current_.time)) {
      compare(current_, *past, compose(inverse(past->T_world_camera), T_world_camera_prior), probability_, known_);
    }
    filter_.update(current_.depth, small, T_world_camera_prior, dt, probability_, known_);
    maker_.make(current_.depth, probability_, known_, small, reducer_.factor(), reducer_.camera().width, reducer_.camera().height, rules_,
                out);
  }
  /// Keeps the frame that was observed last, now that its pose is known.
  void remember(const Pose& T_world_camera) {
    if (current_.depth.empty()) return;
    current_.T_world_camera = T_world_camera;
    filter_.correct(T_world_camera);
    history_.add(current_);
  }
  void reset() {
    history_.clear();
    filter_.reset();
    clock_ = {};
    current_ = {};
  }
  [[nodiscard]] const Pinhole& small_camera() const { return reducer_.small(); }

 private:
  FrameReducer reducer_;
  RegionRules rules_;
  FrameClock clock_;
  SmallFrame current_;
  TemporalEvidence filter_;
  ViewHistory history_;
  EvidenceMask maker_;
  Image<float> probability_;
  Image<std::uint8_t> known_;
};

APSO_NAMESPACE_END
