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
#include <apso/options.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

struct MultiViewDepthOptions {
  int width = 160;                ///< width of the images that are worked on [px]
  DepthRange depth;               ///< depth that is used
  int views = 20;                 ///< key views that are kept
  int references = 5;             ///< key views a frame is compared with
  double view_distance = 0.05;    ///< a key view is taken after this much translation [m]
  double view_angle = 3.0;        ///< ... or this much rotation [deg]
  double view_interval = 0.5;     ///< ... or this much time [s]
  double parallax = 30.0;         ///< larger angles between the two rays are not compared [deg]
  double depth_step = 0.4;        ///< a point this much in front of the projected surface has moved in [m]
  double patch_deviation = 0.1;   ///< pixels with a larger spread of depth around them are not compared [m]
  EvidenceMaskOptions mask;
  MultiViewDepthOptions() { mask.depth_span = 0.2; }
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("width", s.width, 16, 4096);
    v("depth", s.depth);
    v("views", s.views, 1, 1000);
    v("references", s.references, 1, 100);
    v("view_distance", s.view_distance, 0.0, 100.0);
    v("view_angle", s.view_angle, 0.0, 180.0);
    v("view_interval", s.view_interval, 0.0, 3600.0);
    v("parallax", s.parallax, 0.1, 180.0);
    v("depth_step", s.depth_step, 0.01, 10.0);
    v("patch_deviation", s.patch_deviation, 1e-3, 10.0);
    v("mask", s.mask);
  }
};

/// Projects the static surfaces of the nearest key views into the frame and compares depths.
///
/// Against GeometricMotion, which asks the reverse question with a threshold that follows the noise, this finds only
/// what is well in front of the background, and it has no memory besides the key views.
class MultiViewDepth {
 public:
  explicit MultiViewDepth(const Pinhole& camera, const MultiViewDepthOptions& options = {})
      : camera_(camera), options_(options) {
    camera.validate();
    validate(options, "multiview_depth");
    factor_ = reduction_factor(camera, options.width);
    small_ = reduced_camera(camera, factor_);
  }

  void observe(const RgbdFrame& frame, const Pose& T_world_camera_prior, const std::vector<PointTrack>&,
               DynamicMask& out) {
    expects(frame.depth.width == camera_.width && frame.depth.height == camera_.height,
            "MultiViewDepth: the depth image does not have the size of the camera");
    clock_.tick(frame.timestamp);
    reduce_depth(frame.depth, factor_, options_.depth, small_.width, small_.height, depth_);
    moved_in_.assign(small_.width, small_.height, 0);
    agrees_.assign(small_.width, small_.height, 0);
    choose(T_world_camera_prior);
    for (std::size_t i : order_) compare(views_[i], T_world_camera_prior);
    probability_.resize(small_.width, small_.height);
    known_.resize(small_.width, small_.height);
    for (std::size_t i = 0; i < probability_.size(); ++i) {
      const auto in = static_cast<float>(moved_in_.data()[i]);
      const auto rest = static_cast<float>(agrees_.data()[i]);
      known_.data()[i] = in + rest > 0 ? 1 : 0;
      probability_.data()[i] = in + rest > 0 ? in / (in + rest) : 0.0F;
    }
    maker_.make(depth_, probability_, known_, small_, factor_, camera_.width, camera_.height, options_.mask, out);
  }

  void remember(const RgbdFrame&, const Pose& T_world_camera, const DynamicMask& mask) {
    if (depth_.empty()) return;
    expects(mask.probability.width() == camera_.width && mask.probability.height() == camera_.height,
            "MultiViewDepth::remember: the mask has another size than the frame");
    if (!views_.empty()) {
      const View& last = views_.back();
      const Pose T = compose(inverse(last.T_world_camera), T_world_camera);
      const bool new_place = norm(translation(T)) >= options_.view_distance ||
                             rotation_angle(T) >= options_.view_angle * kDegree ||
                             clock_.now() - last.time >= options_.view_interval;
      if (!new_place) return;
    }
    View v;
    if (static_cast<int>(views_.size()) >= options_.views) {
      v = std::move(views_.front());
      views_.erase(views_.begin());
    }
    v.time = clock_.now();
    v.T_world_camera = T_world_camera;
    v.depth = depth_;
    for (int y = 0; y < small_.height; ++y) {  // only what rests is a reference
      for (int x = 0; x < small_.width; ++x) {
        const float p = mask.probability(x * factor_ + factor_ / 2, y * factor_ + factor_ / 2);
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
  struct View {
    double time = 0;
    Pose T_world_camera = Pose::Identity();
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
              [&](std::size_t a, std::size_t b) { return rank_[a] < rank_[b] || (rank_[a] == rank_[b] && a < b); });
    if (order_.size() > static_cast<std::size_t>(options_.references)) order_.resize(static_cast<std::size_t>(options_.references));
  }

  void compare(const View& view, const Pose& T_world_camera) {
    const FloatPose T(compose(inverse(T_world_camera), view.T_world_camera));
    const auto fx = static_cast<float>(small_.fx);
    const auto fy = static_cast<float>(small_.fy);
    const auto cx = static_cast<float>(small_.cx);
    const auto cy = static_cast<float>(small_.cy);
    const auto step = static_cast<float>(options_.depth_step);
    const auto least_cosine = static_cast<float>(std::cos(options_.parallax * kDegree));
    for (int y = 0; y < small_.height; ++y) {
      for (int x = 0; x < small_.width; ++x) {
        const float z = view.depth(x, y);
        if (!(z > 0)) continue;
        const Eigen::Vector3f X = T.rotate((static_cast<float>(x) - cx) / fx * z, (static_cast<float>(y) - cy) / fy * z, z);
        const Eigen::Vector3f Y(X.x() + T.t[0], X.y() + T.t[1], X.z() + T.t[2]);  // seen from this frame; X is the same point seen from the view
        if (!(Y.z() > 0.05F)) continue;
        if (dot(X, Y) < least_cosine * norm(X) * norm(Y)) continue;
        const float u = fx * Y.x() / Y.z() + cx + 0.5F;
        const float v = fy * Y.y() / Y.z() + cy + 0.5F;
        if (!(u >= 1 && v >= 1 && u < static_cast<float>(small_.width - 1) && v < static_cast<float>(small_.height - 1))) continue;
        const int iu = static_cast<int>(u);
        const int iv = static_cast<int>(v);
        const float now = depth_(iu, iv);
        if (!(now > 0) || spread(iu, iv) > static_cast<float>(options_.patch_deviation)) continue;
        const float in_front = Y.z() - now;
        if (in_front > step) {
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

  Pinhole camera_;
  Pinhole small_;
  MultiViewDepthOptions options_;
  int factor_ = 1;
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
