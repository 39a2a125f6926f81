/// \file
/// Evidence that adds up over frames, carried along with the surfaces it was seen on: masks that neither flicker nor
/// stick.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/geometry/carried_log_odds.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/options.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

struct TemporalFilterOptions {
  double persistence = 0.75;  ///< share of the past log-odds that is kept per frame where there is new evidence
  double hold = 0.7;          ///< time constant of the past log-odds where there is no new evidence [s]
  double step = 1.2;          ///< largest change of the log-odds by one frame
  double limit = 4.0;         ///< largest log-odds; what is certain takes limit/step frames to change
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("persistence", s.persistence, 0.0, 0.99);
    v("hold", s.hold, 1e-3, 60.0);
    v("step", s.step, 0.01, 10.0);
    v("limit", s.limit, 0.1, 20.0);
  }
};

/// What frames say about the pixels of a small image, one after the other.
class TemporalEvidence {
 public:
  explicit TemporalEvidence(const TemporalFilterOptions& options = {}) : options_(options) {
    validate(options, "temporal_filter");
  }

  /// \param depth small depth of this frame [m]; \param camera of that size
  /// \param dt time since the last frame [s]
  /// \param probability in: what this frame says, [0,1]; out: what all frames say
  /// \param known in: 1 where this frame says anything; out: where any frame still does, elsewhere the probability is 0
  void update(const Image<float>& depth, const Pinhole& camera, const Pose& T_world_camera, double dt,
              Image<float>& probability, Image<std::uint8_t>& known) {
    const auto keep_seen = static_cast<float>(options_.persistence);
    const auto keep_blind = static_cast<float>(std::exp(-std::max(0.0, dt) / options_.hold));
    const auto step = static_cast<float>(options_.step);
    const auto limit = static_cast<float>(options_.limit);
    carried_.update(depth, camera, T_world_camera, [&](int x, int y, float past) {
      float& p = probability(x, y);
      std::uint8_t& k = known(x, y);
      float now = 0;
      if (k != 0) {
        const float q = p >= 0.01F ? std::min(p, 0.99F) : 0.01F;
        now = std::clamp(std::log(q / (1.0F - q)), -step, step);
      }
      const float l = std::clamp((k != 0 ? keep_seen : keep_blind) * past + now, -limit, limit);
      k = k != 0 || std::abs(l) > 0.4F ? 1 : 0;
      p = k != 0 ? 1.0F / (1.0F + std::exp(-l)) : 0.0F;
      return l;
    });
  }

  /// Corrects the pose of the last frame, once it is final.
  void correct(const Pose& T_world_camera) { carried_.correct(T_world_camera); }
  void reset() { carried_.reset(); }

 private:
  TemporalFilterOptions options_;
  CarriedLogOdds carried_;
};

/// A policy around another one that makes its mask steady: single frames with and without a mark are smoothed away.
template <class Inner>
class TemporalFilter {
 public:
  TemporalFilter(Inner inner, const Pinhole& camera, const TemporalFilterOptions& options = {}, int width = 160)
      : inner_(std::move(inner)), camera_(camera), evidence_(options), factor_(reduction_factor(camera, width)) {
    static_assert(is_motion_policy_v<Inner>, "apso: TemporalFilter<Inner> needs a motion policy, see motion_policy.hpp");
    small_ = reduced_camera(camera, factor_);
  }
  void observe(const RgbdFrame& frame, const Pose& T_world_camera_prior, const std::vector<PointTrack>& tracks,
               DynamicMask& out) {
    inner_.observe(frame, T_world_camera_prior, tracks, out);
    const double dt = clock_.tick(frame.timestamp);
    reduce_depth(frame.depth, factor_, DepthRange{0.05F, 100.0F}, small_.width, small_.height, depth_);
    reduce_mask(out, factor_, small_.width, small_.height, probability_, known_);
    evidence_.update(depth_, small_, T_world_camera_prior, dt, probability_, known_);
    enlarge_(probability_, known_, factor_, camera_.width, camera_.height, out);
  }
  void remember(const RgbdFrame& frame, const Pose& T_world_camera, const DynamicMask& mask) {
    inner_.remember(frame, T_world_camera, mask);
    evidence_.correct(T_world_camera);
  }
  void reset() {
    inner_.reset();
    evidence_.reset();
    clock_ = {};
  }
  [[nodiscard]] const std::vector<Detection>& detections() const { return detections_of(inner_); }

 private:
  Inner inner_;
  Pinhole camera_;
  Pinhole small_;
  TemporalEvidence evidence_;
  int factor_;
  FrameClock clock_;
  MaskEnlarger enlarge_;
  Image<float> depth_;
  Image<float> probability_;
  Image<std::uint8_t> known_;
};

APSO_NAMESPACE_END
