/// \file
/// A policy around another one that makes its mask steady.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/geometry/carried_log_odds.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Smooths the mask of another policy over time: single frames with and without a mark go.
template <class Inner>
class TemporalFilter : public detail::PolicyAround<Inner> {
  using Around = detail::PolicyAround<Inner>;

 public:
  using Options = TemporalFilterOptions;

  TemporalFilter(Inner inner, const Pinhole& camera, const TemporalFilterOptions& options = {})
      : Around(std::move(inner)), reducer_(camera, kMotionWidth, kAnyDepth), evidence_(options) {}
  void observe(const AnyFrame& frame, const AnyPose& T_world_camera_prior, const AnyTracks& tracks, DynamicMask& out) {
    const Pose& prior = T_world_camera_prior;
    Around::observe_inner(frame, prior, tracks, out);
    const double dt = clock_.tick(frame.timestamp);
    reducer_.depth(frame, depth_);
    const Pinhole& small = reducer_.small();
    reduce_mask(out, reducer_.factor(), small.width, small.height, probability_, known_);
    evidence_.update(depth_, small, prior, dt, probability_, known_);
    enlarge_(probability_, known_, reducer_.factor(), reducer_.camera().width, reducer_.camera().height, out);
  }
  void remember(const AnyFrame& frame, const AnyPose& T_world_camera, const DynamicMask& mask) {
    const Pose& T = T_world_camera;
    Around::remember(frame, T, mask);
    evidence_.correct(T);
  }
  void reset() {
    Around::reset();
    evidence_.reset();
    clock_ = {};
  }

 private:
  static constexpr DepthRange kAnyDepth{0.05F, 100.0F};  // [m]; depth only says which surface a pixel shows

  FrameReducer reducer_;
  TemporalEvidence evidence_;
  FrameClock clock_;
  MaskEnlarger enlarge_;
  Image<float> depth_;
  Image<float> probability_;
  Image<std::uint8_t> known_;
};

APSO_NAMESPACE_END
