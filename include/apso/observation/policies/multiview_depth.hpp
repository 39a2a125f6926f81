/// \file
/// Motion from the depth of a few key views: what stands in front of where a key view saw a surface has moved in
/// (the geometric part of DynaSLAM, Bescos et al., RA-L 2018).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/constants.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/options.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// A point this much in front of the projected surface has moved in [m]: the threshold of DynaSLAM.
inline constexpr float kMovedInDepth = 0.4F;

struct MultiViewDepthOptions {
  DepthRange depth;  ///< depth that is used
  int dilation = 4;  ///< the mask is widened by this [px]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("depth", s.depth);
    v("dilation", s.dilation, 0, 200);
  }
};

/// Projects the static surfaces of the nearest key views into the frame and compares depths.
///
/// Against GeometricMotion, which asks the reverse question with a threshold that follows the noise, this finds only
/// what is well in front of the background, and it has no memory besides the key views.
class MultiViewDepth : public PolicyOperators {
 public:
  using Options = MultiViewDepthOptions;

  explicit MultiViewDepth(const Pinhole& camera, const MultiViewDepthOptions& options = {})
      : reducer_(camera, kMotionWidth, options.depth) {
    validate(options, "multiview_depth");
    rules_.depth_span = 0.2F;  // a region stays in front of the background it was told from
    rules_.dilation = options.dilation;
  }

  void observe(const AnyFrame& frame, const AnyPose& T_world_camera_prior, const AnyTracks&, DynamicMask& out) {
    const Pinhole& small = reducer_.small();
    reducer_.depth(frame, depth_);
    clock_.tick(frame.timestamp);
    moved_in_.assign(small.width, small.height, 0);
    agrees_.assign(small.width, small.height, 0);
    choose(T_world_camera_prior);
    for (std::size_t i : order_) compare(views_[i], T_world_camera_prior);
    probability_.resize(small.width, small.height);
    known_.resize(small.width, small.height);
    for (std::size_t i = 0; i < probability_.size(); ++i) {
      const auto in = static_cast<float>(moved_in_.data()[i]);
      const auto rest = static_cast<float>(agrees_.data()[i]);
      known_.data()[i] = in + rest > 0 ? 1 : 0;
      probability_.data()[i] = in + rest > 0 ? in / (in + rest) : 0.0F;
    }
    maker_.make(depth_, probability_, known_, small, reducer_.factor(), reducer_.camera().width, reducer_.camera().height, rules_, out);
  }

  void remember(const AnyFrame&, const AnyPose& T_world_camera_final, const DynamicMask& mask) {
    if (depth_.empty()) return;
    const Pose& T_world_camera = T_world_camera_final;
    expects(mask.probability.width() == reducer_.camera().width && mask.probability.height() == reducer_.camera().height,
            "MultiViewDepth::remember: the mask has another size than the frame");
    if (!views_.empty()) {
      const View& last = views_.back();
      const Pose T = compose(inverse(last.T_world_camera), T_world_camera);
      const bool new_place =
          norm(translation(T)) >= kViewDistance || rotation_angle(T) >= kViewAngle || clock_.now() - last.time >= kViewInterval;
      if (!new_place) return;
    }
    View v;
    if (views_.size() >= kViews) {
      v = std::move(views_.front());
      views_.erase(views_.begin());
    }
    v.time = clock_.now();
    v.T_world_camera = T_world_camera;
    v.depth = depth_;
    const int factor = reducer_.factor();
    for (int y = 0; y < v.depth.height(); ++y) {  // only what rests is a reference
      for (int x = 0; x < v.depth.width(); ++x) {
        const float p = mask.probability(x * factor + factor / 2, y * factor + factor / 2);
        if (!(p < 0.5F) || maker_.labels()(x, y) != 0) v.depth(x, y) = 0;
      }
    }
    views_.push_back(std::move(v));
  }
  void reset() {
    views_.clear();
    clock_ = {};
    depth_.resize(0, 0);
  }
  [[nodiscard]] std::size_t view_count() const { return views_.size(); }

 private:
  static constexpr std::size_t kViews = 20;            // key views that are kept
  static constexpr std::size_t kReferences = 5;        // key views a frame is compared with, as in DynaSLAM
  static constexpr double kViewDistance = 0.05;        // a key view is taken after this much translation [m]
  static constexpr double kViewAngle = 3.0 * kDegree;  // ... or this much rotation [rad]
  static constexpr double kViewInterval = 0.5;         // ... or this much time [s]
  static constexpr double kParallax = 30.0 * kDegree;  // larger angles between the two rays are not compared [rad]; DynaSLAM
  static constexpr float kPatchDeviation = 0.1F;       // pixels with a larger spread of depth around them are left out [m]

  struct View {
    double time = 0;
    Pose T_world_camera = identity_pose();
    Image<float> depth;  // static surfaces only
  };

  // The views nearest in place (0.7) and rotation (0.3), each relative to the farthest kept.
  void choose(const Pose& T_world_camera) {
    order_.clear();
    rank_.clear();
    double farthest = 1e-6;
    double widest = 1e-6;
    for (const View& v : views_) {
      const Pose T = compose(inverse(v.T_world_camera), T_world_camera);
      farthest = std::max(farthest, norm(translation(T)));
      widest = std::max(widest, rotation_angle(T));
    }
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const Pose T = compose(inverse(views_[i].T_world_camera), T_world_camera);
      rank_.push_back(0.7 * norm(translation(T)) / farthest + 0.3 * rotation_angle(T) / widest);
      order_.push_back(i);
    }
    std::sort(order_.begin(), order_.end(),
              [&](std::size_t a, std::size_t b) { return rank_[a] != rank_[b] ? rank_[a] < rank_[b] : a < b; });
    if (order_.size() > kReferences) order_.resize(kReferences);
  }

  void compare(const View& view, const Pose& T_world_camera) {
    const FloatPose T(compose(inverse(T_world_camera), view.T_world_camera));
    const Pinhole& small = reducer_.small();
    const auto fx = static_cast<float>(small.fx);
    const auto fy = static_cast<float>(small.fy);
    const auto cx = static_cast<float>(small.cx);
    const auto cy = static_cast<float>(small.cy);
    const auto smallest_cosine = static_cast<float>(std::cos(kParallax));
    for (int y = 0; y < small.height; ++y) {
      for (int x = 0; x < small.width; ++x) {
        const float z = view.depth(x, y);
        if (!(z > 0)) continue;
        const Eigen::Vector3f X = T.rotate((static_cast<float>(x) - cx) / fx * z, (static_cast<float>(y) - cy) / fy * z, z);
        const Eigen::Vector3f Y(X.x() + T.t[0], X.y() + T.t[1],
                                X.z() + T.t[2]);  // seen from this frame; X is the same point seen from the view
        if (!(Y.z() > 0.05F)) continue;
        if (dot(X, Y) < smallest_cosine * norm(X) * norm(Y)) continue;
        const float u = fx * Y.x() / Y.z() + cx + 0.5F;
        const float v = fy * Y.y() / Y.z() + cy + 0.5F;
        if (!(u >= 1 && v >= 1 && u < static_cast<float>(small.width - 1) && v < static_cast<float>(small.height - 1))) continue;
        const int iu = static_cast<int>(u);
        const int iv = static_cast<int>(v);
        const float now = depth_(iu, iv);
        if (!(now > 0) || spread(iu, iv) > kPatchDeviation) continue;
        const float in_front = Y.z() - now;
        if (in_front > kMovedInDepth) {
          moved_in_(iu, iv) = static_cast<std::uint8_t>(std::min(255, moved_in_(iu, iv) + 1));
        } else if (std::abs(in_front) < 0.1F + 3.0F * depth_sigma(now)) {
          agrees_(iu, iv) = static_cast<std::uint8_t>(std::min(255, agrees_(iu, iv) + 1));
        }
      }
    }
  }
  [[nodiscard]] float spread(int x, int y) const {
    float lo = depth_(x, y);
    float hi = lo;
    for (const auto& d : {std::pair{-1, 0}, std::pair{1, 0}, std::pair{0, -1}, std::pair{0, 1}}) {
      const float z = depth_(x + d.first, y + d.second);
      if (!(z > 0)) continue;
      lo = std::min(lo, z);
      hi = std::max(hi, z);
    }
    return hi - lo;
  }

  FrameReducer reducer_;
  RegionRules rules_;
  FrameClock clock_;
  std::vector<View> views_;
  std::vector<std::size_t> order_;
  std::vector<double> rank_;
  EvidenceMask maker_;
  Image<float> depth_;
  Image<std::uint8_t> moved_in_;
  Image<std::uint8_t> agrees_;
  Image<float> probability_;
  Image<std::uint8_t> known_;
};

APSO_NAMESPACE_END
