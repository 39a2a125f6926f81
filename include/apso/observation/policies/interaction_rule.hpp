/// \file
/// A policy around one that finds objects: a movable object that something moving touches moves with it (after Blitz-SLAM,
/// Fan et al., Pattern Recognition 2022).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Marks, of the objects that the inner policy found but does not mark, those that a marked surface touches: the chair that a person
/// moves, the bag that a person carries. For policies that leave out what can move but rests, such as `boxes & geometric`. What is
/// touched by an object that was only marked here is not marked.
template <class Inner>
class InteractionRule : public detail::PolicyAround<Inner> {
  using Around = detail::PolicyAround<Inner>;
  using Around::inner_;

 public:
  using Options = NoOptions;

  InteractionRule(Inner inner, const Pinhole& camera) : Around(std::move(inner)), reducer_(camera, kMotionWidth, kAnyDepth) {}
  void observe(const AnyFrame& frame, const AnyPose& T_world_camera_prior, const AnyTracks& tracks, DynamicMask& out) {
    const Pose& prior = T_world_camera_prior;
    Around::observe_inner(frame, prior, tracks, out);
    const std::vector<Detection>& objects = detections_of(inner_);
    if (objects.empty()) return;
    reducer_.depth(frame, depth_);
    reduce_mask(out, reducer_.factor(), depth_.width(), depth_.height(), given_, known_);
    added_.assign(depth_.width(), depth_.height(), 0.0F);
    bool changed = false;
    for (const Detection& d : objects) {
      if (d.movable && touched(d)) changed = mark() || changed;
    }
    if (changed) add(out);
  }

 private:
  static constexpr DepthRange kAnyDepth{0.05F, 100.0F};  // [m]
  static constexpr float kReach = 0.3F;                  // surfaces that touch are this near in depth [m]: half the depth of a body
  static constexpr float kExtent = 0.5F;                 // in a box without a mask the object is this near to its median depth [m]
  static constexpr int kTouches = 4;                     // in as many small pixels; fewer are a border or noise

  // Gathers the small pixels of an object. True if a marked surface lies on or beside them at their depth.
  bool touched(const Detection& d) {
    const int w = depth_.width();
    const int h = depth_.height();
    const int f = reducer_.factor();
    const PixelRange r = pixels_of(d, reducer_.camera().width, reducer_.camera().height);
    pixels_.clear();
    depths_.clear();
    for (int y = r.y0 / f; y < std::min(h, (r.y1 + f - 1) / f); ++y) {
      for (int x = r.x0 / f; x < std::min(w, (r.x1 + f - 1) / f); ++x) {
        if (!covers(d, x * f + f / 2, y * f + f / 2)) continue;
        pixels_.push_back(y * w + x);
        if (depth_(x, y) > 0) depths_.push_back(depth_(x, y));
      }
    }
    if (depths_.empty()) return false;
    const auto middle = depths_.begin() + static_cast<std::ptrdiff_t>(depths_.size() / 2);
    std::nth_element(depths_.begin(), middle, depths_.end());
    surface_ = *middle;
    all_ = !d.mask.empty();
    int touches = 0;
    for (const int i : pixels_) {
      if (!on_surface(i)) continue;
      touches += near_marked(i % w, i / w) ? 1 : 0;
    }
    return touches >= kTouches;
  }

  [[nodiscard]] bool on_surface(int i) const {
    const float z = depth_.data()[i];
    return all_ || (z > 0 && std::abs(z - surface_) < kExtent);
  }
  [[nodiscard]] bool near_marked(int x, int y) const {
    for (int j = std::max(0, y - 1); j <= std::min(depth_.height() - 1, y + 1); ++j) {
      for (int i = std::max(0, x - 1); i <= std::min(depth_.width() - 1, x + 1); ++i) {
        if (given_(i, j) >= 0.5F && depth_(i, j) > 0 && std::abs(depth_(i, j) - surface_) < kReach) return true;
      }
    }
    return false;
  }

  // The object whose pixels were gathered last. False if all of it was marked before.
  bool mark() {
    bool changed = false;
    for (const int i : pixels_) {
      if (!on_surface(i) || given_.data()[i] >= 0.5F) continue;
      added_.data()[i] = 1.0F;
      changed = true;
    }
    return changed;
  }

  // What the inner policy marks keeps its border: only the objects come from small images.
  void add(DynamicMask& out) {
    known_.assign(depth_.width(), depth_.height(), 0);
    for (std::size_t i = 0; i < known_.size(); ++i) known_.data()[i] = added_.data()[i] > 0 ? 1 : 0;
    enlarge_(added_, known_, reducer_.factor(), reducer_.camera().width, reducer_.camera().height, large_);
    for (std::size_t i = 0; i < out.probability.size(); ++i) {
      float& p = out.probability.data()[i];
      const float added = large_.probability.data()[i];
      if (!(p >= added)) p = added;
      if (large_.known.data()[i] != 0) out.known.data()[i] = 1;
    }
  }

  FrameReducer reducer_;
  Image<float> depth_;
  Image<float> given_;  // the mask of the inner policy
  Image<float> added_;  // the objects that are touched
  DynamicMask large_;   // the same in the size of the frame
  Image<std::uint8_t> known_;
  std::vector<int> pixels_;  // of one object
  std::vector<float> depths_;
  float surface_ = 0;  // median depth [m]
  bool all_ = false;   // the object has a mask, all of which belongs to it
  MaskEnlarger enlarge_;
};

APSO_NAMESPACE_END
