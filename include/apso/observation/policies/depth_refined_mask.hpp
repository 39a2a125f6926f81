/// \file
/// A policy around a coarse one: its boxes or masks are cut to the surface they mean (after Blitz-SLAM, Fan et al.,
/// Pattern Recognition 2022, and CFP-SLAM, Hu et al., IROS 2022).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/geometry/low_res_depth.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/options.hpp>

APSO_NAMESPACE_BEGIN

struct DepthRefinedMaskOptions {
  DepthRange depth;     ///< depth that is used
  double window = 0.1;  ///< the object may reach this share of its box beyond it
  int dilation = 4;     ///< the mask is widened by this [px]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("depth", s.depth);
    v("window", s.window, 0.0, 1.0);
    v("dilation", s.dilation, 0, 200);
  }
};

/// Range of depth [m] of the nearest surface that fills at least `share` of the values, from a histogram with bins of
/// `bin` metres, else of the largest; false when there are no values. A surface is a run of bins with more than 2 % each.
[[nodiscard]] inline bool foreground_range(const std::vector<float>& depths, double bin, double share, float& lo, float& hi) {
  constexpr int kBins = 256;
  std::array<int, kBins> count{};
  const auto n = static_cast<double>(depths.size());
  if (depths.empty()) return false;
  for (const float z : depths) {
    const double b = static_cast<double>(z) / bin;
    ++count[static_cast<std::size_t>(b < kBins - 1 ? std::max(0.0, b) : kBins - 1)];
  }
  // a peak is a run of bins above 2 % of all values; the nearest with enough of them wins, else the largest
  int best_begin = -1;
  int best_end = -1;
  int largest = 0;
  for (int b = 0; b < kBins;) {
    if (count[static_cast<std::size_t>(b)] <= 0.02 * n) {
      ++b;
      continue;
    }
    const int begin = b;
    int sum = 0;
    while (b < kBins && count[static_cast<std::size_t>(b)] > 0.02 * n) sum += count[static_cast<std::size_t>(b++)];
    if (sum > largest) {
      largest = sum;
      best_begin = begin;
      best_end = b;
    }
    if (sum >= share * n) break;
  }
  if (best_begin < 0) return false;
  lo = static_cast<float>(best_begin * bin);
  hi = static_cast<float>(best_end * bin);
  return true;
}

/// Cuts every object of the inner policy to the surfaces in its range of depth: background inside a box is left out,
/// what a mask misses of a surface is added. Pixels without depth stay as the inner policy has them, unless the object
/// is only a box: then they go with what surrounds them.
template <class Inner>
class DepthRefinedMask : public detail::PolicyAround<Inner> {
  using Around = detail::PolicyAround<Inner>;
  using Around::inner_;

 public:
  using Options = DepthRefinedMaskOptions;

  DepthRefinedMask(Inner inner, const Pinhole& camera, const DepthRefinedMaskOptions& options = {})
      : Around(std::move(inner)), options_(options), reducer_(camera, kMotionWidth, options.depth) {
    validate(options, "depth_refined_mask");
  }

  void observe(const AnyFrame& frame, const AnyPose& T_world_camera_prior, const AnyTracks& tracks, DynamicMask& out) {
    const Pose& prior = T_world_camera_prior;
    Around::observe_inner(frame, prior, tracks, out);
    reducer_.depth(frame, depth_);
    const int w = depth_.width();
    const int h = depth_.height();
    reduce_mask(out, reducer_.factor(), w, h, given_, known_);
    refined_.assign(w, h, 0.0F);
    marked_.assign(w, h, 0);
    const std::vector<Detection>& objects = detections_of(inner_);
    for (const Detection& d : objects) {
      if (d.movable) refine_object(d);
    }
    if (objects.empty()) refine_regions();
    write(out);
  }

 private:
  static constexpr double kBin = 0.1;         // width of a bin of the depth histogram of an object [m]
  static constexpr double kForeground = 0.2;  // the object is the nearest peak with this share of the depth in its middle
  static constexpr float kMargin = 0.1F;      // the depth of the object is widened by this [m]
  static constexpr double kOverlap = 0.25;    // a surface belongs to it when this share is marked by the inner policy

  struct Window {
    int x0, y0, x1, y1;  // small pixels, x1 and y1 not included
  };

  void refine_object(const Detection& d) {
    const int factor = reducer_.factor();
    const Pinhole& small = reducer_.small();
    const auto f = static_cast<float>(factor);
    const auto limit = [f](float v, int n) { return static_cast<int>(v == v ? std::clamp(v / f, 0.0F, static_cast<float>(n)) : 0.0F); };
    const Window b{limit(d.box.x, small.width), limit(d.box.y, small.height), limit(d.box.x + d.box.width + f - 1, small.width),
                   limit(d.box.y + d.box.height + f - 1, small.height)};
    if (b.x0 >= b.x1 || b.y0 >= b.y1) return;
    depths_.clear();
    const bool only_box = d.mask.empty();
    const int mx = only_box ? (b.x1 - b.x0) / 4 : 0;  // the object is in the middle of its box
    const int my = only_box ? (b.y1 - b.y0) / 8 : 0;
    const int c = factor / 2;
    float value = 0;
    for (int y = b.y0; y < b.y1; ++y) {
      for (int x = b.x0; x < b.x1; ++x) {
        if (!only_box && d.mask(x * factor + c, y * factor + c) == 0) continue;
        marked_(x, y) = 1;
        value = std::max(value, given_(x, y));
        const bool middle = x >= b.x0 + mx && x < b.x1 - mx && y >= b.y0 + my && y < b.y1 - my;
        if (middle && depth_(x, y) > 0) depths_.push_back(depth_(x, y));
      }
    }
    cut(b, value, only_box);
    for (int y = b.y0; y < b.y1; ++y) {
      for (int x = b.x0; x < b.x1; ++x) marked_(x, y) = 0;
    }
  }

  void refine_regions() {
    const int w = given_.width();
    const int h = given_.height();
    for_each_component(
        w, h, regions_, [&](int i) { return given_.data()[i] >= 0.5F; }, [](int, int) { return true; },
        [&](const int* first, const int* last) {
          Window b{w, h, 0, 0};
          depths_.clear();
          float value = 0;
          for (const int* i = first; i != last; ++i) {
            const int x = *i % w;
            const int y = *i / w;
            b = {std::min(b.x0, x), std::min(b.y0, y), std::max(b.x1, x + 1), std::max(b.y1, y + 1)};
            value = std::max(value, given_.data()[*i]);
            if (depth_.data()[*i] > 0) depths_.push_back(depth_.data()[*i]);
            marked_.data()[*i] = 1;
          }
          cut(b, value, false);
          for (const int* i = first; i != last; ++i) marked_.data()[*i] = 0;
        });
  }

  // Surfaces within the window and the object's depth of which enough is marked.
  void cut(const Window& box, float value, bool only_box) {
    float lo = 0;
    float hi = 0;
    if (!foreground_range(depths_, kBin, kForeground, lo, hi)) {  // no depth: nothing better is known
      for (int y = box.y0; y < box.y1; ++y) {
        for (int x = box.x0; x < box.x1; ++x) {
          if (marked_(x, y) != 0) refined_(x, y) = std::max(refined_(x, y), value);
        }
      }
      return;
    }
    lo -= kMargin;
    hi += kMargin;
    const int w = depth_.width();
    const int h = depth_.height();
    const int gx = static_cast<int>(std::lround(options_.window * (box.x1 - box.x0)));
    const int gy = static_cast<int>(std::lround(options_.window * (box.y1 - box.y0)));
    const Window b{std::max(0, box.x0 - gx), std::max(0, box.y0 - gy), std::min(w, box.x1 + gx), std::min(h, box.y1 + gy)};
    const auto inside = [&](int i) {
      const int x = i % w;
      const int y = i / w;
      const float z = depth_.data()[i];
      return x >= b.x0 && x < b.x1 && y >= b.y0 && y < b.y1 && z >= lo && z <= hi;
    };
    for_each_component(
        w, h, scratch_, inside, [&](int i, int j) { return depth_connected(depth_.data()[i], depth_.data()[j]); },
        [&](const int* first, const int* last) {
          std::ptrdiff_t n = 0;
          for (const int* i = first; i != last; ++i) n += marked_.data()[*i];
          if (static_cast<double>(n) < kOverlap * static_cast<double>(last - first)) return;
          for (const int* i = first; i != last; ++i) refined_.data()[*i] = std::max(refined_.data()[*i], value);
        });
    if (only_box) return;
    for (int y = box.y0; y < box.y1; ++y) {
      for (int x = box.x0; x < box.x1; ++x) {
        if (marked_(x, y) != 0 && !(depth_(x, y) > 0)) refined_(x, y) = std::max(refined_(x, y), given_(x, y));
      }
    }
  }

  void write(DynamicMask& out) {
    labels_.resize(depth_.width(), depth_.height());
    for (std::size_t i = 0; i < labels_.size(); ++i) labels_.data()[i] = refined_.data()[i] > 0 ? 1 : 0;
    fill_depth_holes(depth_, labels_, scratch_);
    for (std::size_t i = 0; i < labels_.size(); ++i) {
      if (labels_.data()[i] != 0 && !(refined_.data()[i] > 0)) refined_.data()[i] = 1.0F;
    }
    dilate(refined_, EvidenceMask::small_dilation(options_.dilation, reducer_.factor()), dilation_scratch_);
    for (std::size_t i = 0; i < known_.size(); ++i) {
      if (refined_.data()[i] > 0) known_.data()[i] = 1;
    }
    enlarge_(refined_, known_, reducer_.factor(), reducer_.camera().width, reducer_.camera().height, out);
  }

  DepthRefinedMaskOptions options_;
  FrameReducer reducer_;
  Image<float> depth_;
  Image<float> given_;
  Image<float> refined_;
  Image<std::uint8_t> known_;
  Image<std::uint8_t> marked_;
  Image<std::uint8_t> labels_;
  std::vector<float> depths_;
  RegionScratch regions_;
  RegionScratch scratch_;
  std::vector<float> dilation_scratch_;
  MaskEnlarger enlarge_;
};

APSO_NAMESPACE_END
