/// \file
/// The frame of policies that compare each frame with an earlier one: reducing images, keeping views, joining evidence.
#pragma once

#include <cstdint>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/policies/temporal_filter.hpp>
#include <apso/observation/geometry/view_history.hpp>

APSO_NAMESPACE_BEGIN

/// Options of PastComparison, part of those of the policy.
struct PastComparisonOptions {
  int width = 160;    ///< width of the images that are worked on [px]
  DepthRange depth;   ///< depth that is used
  double span = 0.2;  ///< age of the frame that is compared with [s]
  TemporalFilterOptions filter;
  EvidenceMaskOptions mask;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("width", s.width, 16, 4096);
    v("depth", s.depth);
    v("span", s.span, 0.0, 10.0);
    v("filter", s.filter);
    v("mask", s.mask);
  }
};

/// Reduces each frame, hands it with a view of about `span` seconds ago to the policy, carries what the policy finds
/// through time and makes the mask. Views older than two seconds are forgotten: the scene may have changed altogether.
class PastComparison {
 public:
  PastComparison(const Pinhole& camera, const PastComparisonOptions& options)
      : camera_(camera), options_(options), filter_(options.filter), history_(options.span) {
    camera.validate();
    factor_ = reduction_factor(camera, options.width);
    small_ = reduced_camera(camera, factor_);
  }

  /// \param compare called as compare(current, past, T_past_current_prior, probability, known) when there is a past
  /// view: writes what this pair of frames says, probability of motion [0,1] and 1 where it says anything; both
  /// images have the size of `small_camera()` and are zero before
  template <class Compare>
  void observe(const RgbdFrame& frame, const Pose& T_world_camera_prior, Compare&& compare, DynamicMask& out) {
    expects(frame.depth.width == camera_.width && frame.depth.height == camera_.height &&
                frame.intensity.width == camera_.width && frame.intensity.height == camera_.height,
            "motion policy: the images do not have the size of the camera");
    const double dt = clock_.tick(frame.timestamp);
    current_.time = clock_.now();
    current_.T_world_camera = T_world_camera_prior;
    reduce_frame(frame, factor_, options_.depth, small_, current_);
    probability_.assign(small_.width, small_.height, 0.0F);
    known_.assign(small_.width, small_.height, 0);
    history_.forget_before(current_.time - 2.0);
    if (const SmallFrame* past = history_.reference(current_.time)) {
      compare(current_, *past, compose(inverse(past->T_world_camera), T_world_camera_prior), probability_, known_);
    }
    filter_.update(current_.depth, small_, T_world_camera_prior, dt, probability_, known_);
    maker_.make(current_.depth, probability_, known_, small_, factor_, camera_.width, camera_.height, options_.mask, out);
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
  [[nodiscard]] const Pinhole& small_camera() const { return small_; }

 private:
  Pinhole camera_;
  Pinhole small_;
  PastComparisonOptions options_;
  int factor_ = 1;
  FrameClock clock_;
  SmallFrame current_;
  TemporalEvidence filter_;
  ViewHistory history_;
  EvidenceMask maker_;
  Image<float> probability_;
  Image<std::uint8_t> known_;
};

APSO_NAMESPACE_END
