/// \file
/// A policy around a slow one: it is asked for every n-th frame only, and its mask is carried along in between (after
/// NGD-SLAM, Zhang et al. 2024).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/geometry/low_res_depth.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/options.hpp>

APSO_NAMESPACE_BEGIN

struct MaskPropagationOptions {
  DepthRange depth;  ///< depth that is used
  int every = 5;     ///< the inner policy sees every n-th frame
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("depth", s.depth);
    v("every", s.every, 1, 1000);
  }
};

/// Between two looks of the inner policy each region of the mask moves by the median flow of the tracks in it, towards
/// or away from the camera by their median change of depth, and keeps only pixels whose depth fits. Boxes go along.
template <class Inner>
class MaskPropagation : public PolicyOperators {
 public:
  using Options = MaskPropagationOptions;

  MaskPropagation(Inner inner, const Pinhole& camera, const MaskPropagationOptions& options = {})
      : inner_(std::move(inner)), every_(options.every), reducer_(camera, kMotionWidth, options.depth) {
    check_motion_policy<Inner>();
    validate(options, "mask_propagation");
  }

  void observe(const AnyFrame& frame, const AnyPose& T_world_camera_prior, const AnyTracks& any_tracks, DynamicMask& out) {
    const Pose& prior = T_world_camera_prior;
    const std::vector<PointTrack>& tracks = any_tracks.in(tracks_);
    reducer_.depth(frame, depth_);
    asked_ = count_ % every_ == 0;
    ++count_;
    if (asked_) {
      inner_.observe(frame, prior, tracks, out);
      reduce_mask(out, reducer_.factor(), depth_.width(), depth_.height(), mask_, known_);
      detections_ = detections_of(inner_);
      begin();
    } else {
      carry(tracks);
      move_boxes(tracks);
      enlarge_(mask_, known_, reducer_.factor(), reducer_.camera().width, reducer_.camera().height, out);
    }
    std::swap(depth_, previous_depth_);
  }
  void remember(const AnyFrame& frame, const AnyPose& T_world_camera, const DynamicMask& mask) {
    const Pose& T = T_world_camera;
    if (asked_) inner_.remember(frame, T, mask);
  }
  void reset() {
    inner_.reset();
    count_ = 0;
    asked_ = false;
    detections_.clear();
  }
  [[nodiscard]] const std::vector<Detection>& detections() const { return detections_; }
  /// The inner policy was asked for the last frame.
  [[nodiscard]] bool asked() const { return asked_; }

 private:
  static constexpr std::size_t kMinTracks = 3;  // fewer in a region do not tell where it goes; it then stays where it is
  static constexpr float kDepthGate = 0.2F;     // a pixel stays in the region if its depth changed by less than this [m]
  static constexpr float kDepthGap = 0.25F;     // regions are cut where neighbouring depths differ by more [m]

  [[nodiscard]] int pixel_of(float x, float y) const {
    return small_pixel(x, y, reducer_.factor(), reducer_.small().width, reducer_.small().height);
  }

  /// A region of the mask at the last look, and where it has gone since.
  struct Region {
    float x = 0, y = 0, z = 0;     // centre [small px] and mean depth [m] at the look; z = 0 without depth
    float du = 0, dv = 0, dz = 0;  // since then [small px], [m]
  };

  // Cuts the mask of a look into regions.
  void begin() {
    const int w = mask_.width();
    const int h = mask_.height();
    region_.assign(w, h, 0);
    look_ = mask_;
    look_depth_ = depth_;
    regions_.clear();
    for_each_component(
        w, h, scratch_, [&](int i) { return mask_.data()[i] >= 0.5F; },
        [&](int i, int j) {
          const float a = depth_.data()[i];
          const float b = depth_.data()[j];
          return !(a > 0 && b > 0) || std::abs(a - b) <= kDepthGap;
        },
        [&](const int* first, const int* last) {
          Region r;
          float n = 0;
          for (const int* i = first; i != last; ++i) {
            region_.data()[*i] = static_cast<int>(regions_.size()) + 1;
            const int row = *i / w;
            r.x += static_cast<float>(*i % w);
            r.y += static_cast<float>(row);
            if (depth_.data()[*i] > 0) {
              r.z += depth_.data()[*i];
              n += 1;
            }
          }
          r.x /= static_cast<float>(last - first);
          r.y /= static_cast<float>(last - first);
          r.z = n > 0 ? r.z / n : 0.0F;
          regions_.push_back(r);
        });
    look_region_ = region_;
  }

  void carry(const std::vector<PointTrack>& tracks) {
    const int w = depth_.width();
    const int h = depth_.height();
    const auto f = static_cast<float>(reducer_.factor());
    for (std::size_t k = 0; k < regions_.size(); ++k) {
      du_.clear();
      dv_.clear();
      dz_.clear();
      for (const PointTrack& t : tracks) {
        const int from = t.age >= 1 ? pixel_of(t.previous_x, t.previous_y) : -1;
        const int to = from >= 0 ? pixel_of(t.x, t.y) : -1;
        if (to < 0 || region_.data()[from] != static_cast<int>(k) + 1) continue;
        du_.push_back(t.x - t.previous_x);
        dv_.push_back(t.y - t.previous_y);
        if (previous_depth_.data()[from] > 0 && depth_.data()[to] > 0) {
          dz_.push_back(depth_.data()[to] - previous_depth_.data()[from]);
        }
      }
      if (du_.size() >= kMinTracks) {
        regions_[k].du += upper_median(du_) / f;
        regions_[k].dv += upper_median(dv_) / f;
      }
      if (dz_.size() >= kMinTracks) regions_[k].dz += upper_median(dz_);
    }
    // always from the look itself, so that rounding does not add up
    mask_.assign(w, h, 0.0F);
    region_.assign(w, h, 0);
    for (int i = 0; i < w * h; ++i) {
      const int number = look_region_.data()[i];
      if (number == 0) continue;
      const Region& r = regions_[static_cast<std::size_t>(number) - 1];
      const float scale = r.z > 0 && r.z + r.dz > 0.2F ? r.z / (r.z + r.dz) : 1.0F;  // nearer looks larger
      const int x0 = static_cast<int>(std::lround(r.x + (static_cast<float>(i % w) - r.x) * scale + r.du));
      const int row = i / w;
      const int y0 = static_cast<int>(std::lround(r.y + (static_cast<float>(row) - r.y) * scale + r.dv));
      const float z = look_depth_.data()[i];
      // with the neighbours of the new place, so that no gaps open when a region comes nearer
      for (int y = std::max(0, y0 - 1); y <= std::min(h - 1, y0 + 1); ++y) {
        for (int x = std::max(0, x0 - 1); x <= std::min(w - 1, x0 + 1); ++x) {
          const bool centre = x == x0 && y == y0;
          const float now = depth_(x, y);
          // a neighbour joins only on the surface itself; the place itself also where depth is missing
          const bool fits = now > 0 && z > 0 ? std::abs(now - z - r.dz) <= (centre ? kDepthGate : same_surface(z)) : centre;
          if (!fits) continue;
          mask_(x, y) = std::max(mask_(x, y), look_.data()[i]);
          region_(x, y) = number;
          known_(x, y) = 1;
        }
      }
    }
  }

  void move_boxes(const std::vector<PointTrack>& tracks) {
    for (Detection& d : detections_) {
      d.mask = {};  // belonged to an earlier frame
      du_.clear();
      dv_.clear();
      for (const PointTrack& t : tracks) {
        const int from = t.age >= 1 ? pixel_of(t.previous_x, t.previous_y) : -1;
        if (from < 0 || region_.data()[from] == 0) continue;  // only tracks on the object itself, not beside it
        const bool in = t.previous_x >= d.box.x && t.previous_y >= d.box.y && t.previous_x < d.box.x + d.box.width &&
                        t.previous_y < d.box.y + d.box.height;
        if (!in) continue;
        du_.push_back(t.x - t.previous_x);
        dv_.push_back(t.y - t.previous_y);
      }
      if (du_.size() < kMinTracks) continue;
      d.box.x += upper_median(du_);
      d.box.y += upper_median(dv_);
    }
  }

  Inner inner_;
  int every_;
  FrameReducer reducer_;
  long count_ = 0;
  bool asked_ = false;
  std::vector<Detection> detections_;
  Image<float> depth_;
  Image<float> previous_depth_;
  Image<float> mask_;
  Image<std::uint8_t> known_;
  Image<int> region_;  // of the last frame, 0 = none
  Image<float> look_;  // at the last look: mask, depth, regions
  Image<float> look_depth_;
  Image<int> look_region_;
  std::vector<Region> regions_;
  std::vector<PointTrack> tracks_;
  RegionScratch scratch_;
  MaskEnlarger enlarge_;
  std::vector<float> du_;
  std::vector<float> dv_;
  std::vector<float> dz_;
};

APSO_NAMESPACE_END
