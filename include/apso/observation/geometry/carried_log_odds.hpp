/// \file
/// Evidence that goes with the surfaces it was seen on, from frame to frame, and adds up: masks that neither flicker nor
/// stick.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/options.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Log-odds per pixel of a small image. The past of a pixel is that of the surface it shows: it is looked up where the
/// point was in the last frame, if the depth there fits; without depth, at the same pixel.
class CarriedLogOdds {
 public:
  /// Makes the log-odds of a frame from those of the last one.
  /// \param depth small depth of the frame [m]; \param camera of that size
  /// \param now float now(int x, int y, float past): the new log-odds of a pixel; past is 0 where there is none
  template <class Now>
  void update(const Image<float>& depth, const Pinhole& camera, const Pose& T_world_camera, Now&& now) {
    const int w = depth.width();
    const int h = depth.height();
    const bool has_past = past_.width() == w && past_.height() == h;
    next_.resize(w, h);
    const Pose T = has_past ? compose(inverse(T_world_past_), T_world_camera) : identity_pose();
    const FloatPose past_from_current(T);
    const auto fx = static_cast<float>(camera.fx);
    const auto fy = static_cast<float>(camera.fy);
    const auto cx = static_cast<float>(camera.cx);
    const auto cy = static_cast<float>(camera.cy);
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        const float z = depth(x, y);
        float past = 0;
        if (has_past && z > 0) {
          const Eigen::Vector3f p = past_from_current(z * (static_cast<float>(x) - cx) / fx, z * (static_cast<float>(y) - cy) / fy, z);
          if (p.z() > 0.05F) {
            const float u = fx * p.x() / p.z() + cx + 0.5F;
            const float v = fy * p.y() / p.z() + cy + 0.5F;
            if (u >= 0 && v >= 0 && u < static_cast<float>(w) && v < static_cast<float>(h)) {
              const int iu = static_cast<int>(u);
              const int iv = static_cast<int>(v);
              if (std::abs(past_depth_(iu, iv) - p.z()) < 0.1F + 3.0F * depth_sigma(z)) past = past_(iu, iv);
            }
          }
        } else if (has_past && !(past_depth_(x, y) > 0)) {
          past = past_(x, y);
        }
        next_(x, y) = now(x, y, past);
      }
    }
    std::swap(past_, next_);
    past_depth_ = depth;
    T_world_past_ = T_world_camera;
  }

  /// Corrects the pose of the last frame, once it is final.
  void correct(const Pose& T_world_camera) { T_world_past_ = T_world_camera; }
  void reset() { past_.resize(0, 0); }

  /// Of the last frame; empty before the first.
  [[nodiscard]] const Image<float>& values() const { return past_; }

 private:
  Image<float> next_;
  Image<float> past_;
  Image<float> past_depth_;
  Pose T_world_past_ = identity_pose();
};

struct TemporalFilterOptions {
  double persistence = 0.75;  ///< share of the past log-odds that is kept per frame where there is new evidence
  double hold = 0.7;          ///< time constant of the past log-odds where there is no new evidence [s]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("persistence", s.persistence, 0.0, 0.99);
    v("hold", s.hold, 1e-3, 60.0);
  }
};

/// What frames say about the pixels of a small image, one after the other.
class TemporalEvidence {
 public:
  explicit TemporalEvidence(const TemporalFilterOptions& options = {}) : options_(options) { validate(options, "temporal_filter"); }

  /// \param depth small depth of this frame [m]; \param camera of that size
  /// \param dt time since the last frame [s]
  /// \param probability in: what this frame says, [0,1]; out: what all frames say
  /// \param known in: 1 where this frame says anything; out: where any frame still does, elsewhere the probability is 0
  void update(const Image<float>& depth, const Pinhole& camera, const Pose& T_world_camera, double dt, Image<float>& probability,
              Image<std::uint8_t>& known) {
    const auto keep_seen = static_cast<float>(options_.persistence);
    const auto keep_blind = static_cast<float>(std::exp(-std::max(0.0, dt) / options_.hold));
    constexpr float kStep = 1.2F;   // largest change of the log-odds by one frame
    constexpr float kLimit = 4.0F;  // largest log-odds; what is certain takes kLimit / kStep frames to change
    carried_.update(depth, camera, T_world_camera, [&](int x, int y, float past) {
      float& p = probability(x, y);
      std::uint8_t& k = known(x, y);
      float now = 0;
      if (k != 0) {
        const float q = p >= 0.01F ? std::min(p, 0.99F) : 0.01F;
        now = std::clamp(std::log(q / (1.0F - q)), -kStep, kStep);
      }
      const float l = std::clamp((k != 0 ? keep_seen : keep_blind) * past + now, -kLimit, kLimit);
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

APSO_NAMESPACE_END
