/// \file
/// From evidence on a small image to the mask of the frame: threshold, cleaning, growth along the depth, widening.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Enlarges a small probability map to the size of the frame: probabilities bilinearly, knowledge by the nearest pixel.
/// Pixel (x,y) of the small image covers factor x factor pixels of the frame. Keeps the weights of a row between calls.
class MaskEnlarger {
 public:
  void operator()(const Image<float>& probability, const Image<std::uint8_t>& known, int factor, int width, int height, DynamicMask& out) {
    const int w = probability.width();
    const int h = probability.height();
    expects(w > 0 && h > 0 && known.width() == w && known.height() == h, "MaskEnlarger: probability and known differ in size");
    out.probability.resize(width, height);
    out.known.resize(width, height);
    columns_.resize(static_cast<std::size_t>(width));
    const float scale = 1.0F / static_cast<float>(factor);
    for (int x = 0; x < width; ++x) {
      const float s = std::clamp((static_cast<float>(x) + 0.5F) * scale - 0.5F, 0.0F, static_cast<float>(w - 1));
      const int left = std::min(static_cast<int>(s), std::max(0, w - 2));
      columns_[static_cast<std::size_t>(x)] = {static_cast<std::size_t>(left), std::min(x / factor, w - 1), s - static_cast<float>(left)};
    }
    line_.assign(static_cast<std::size_t>(w) + 1, 0.0F);
    for (int y = 0; y < height; ++y) {
      const float s = std::clamp((static_cast<float>(y) + 0.5F) * scale - 0.5F, 0.0F, static_cast<float>(h - 1));
      const int j = std::min(static_cast<int>(s), std::max(0, h - 2));
      const float share = s - static_cast<float>(j);
      const float* above = probability.row(j);
      const float* below = probability.row(std::min(j + 1, h - 1));
      for (int x = 0; x < w; ++x) line_[static_cast<std::size_t>(x)] = above[x] + share * (below[x] - above[x]);
      line_[static_cast<std::size_t>(w)] = line_[static_cast<std::size_t>(w) - 1];
      const std::uint8_t* seen = known.row(std::min(y / factor, h - 1));
      float* p = out.probability.row(y);
      std::uint8_t* k = out.known.row(y);
      for (int x = 0; x < width; ++x) {
        const Column& c = columns_[static_cast<std::size_t>(x)];
        p[x] = line_[c.left] + c.share * (line_[c.left + 1] - line_[c.left]);
        k[x] = seen[c.nearest];
      }
    }
  }

 private:
  struct Column {
    std::size_t left;
    int nearest;
    float share;
  };
  std::vector<Column> columns_;
  std::vector<float> line_;
};

/// The reverse: every factor-th pixel of a mask.
inline void reduce_mask(const DynamicMask& mask, int factor, int width, int height, Image<float>& probability, Image<std::uint8_t>& known) {
  probability.resize(width, height);
  known.resize(width, height);
  const int c = factor / 2;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float p = mask.probability(x * factor + c, y * factor + c);
      probability(x, y) = p >= 0.0F ? std::min(p, 1.0F) : 0.0F;
      known(x, y) = mask.known(x * factor + c, y * factor + c);
    }
  }
}

/// Which evidence becomes a region, and how far it reaches. All policies that work at low resolution share these rules.
struct RegionRules {
  int reach = 12;           ///< steps a region grows over pixels that may join [small px]: a tenth of a person at 2 m
  float depth_span = 0.4F;  ///< ... and over which depth difference to its seed [m]: a body with its arms
  int min_pixels = 24;      ///< smaller regions are dropped [small px]: noise of the sensor at edges
  float min_area = 0.015F;  ///< regions that are smaller in the world are dropped [m^2]: about half a forearm
  int dilation = 4;         ///< the mask is widened by this [px], for what blurs across the border
};

/// Makes masks from evidence; owns the buffers. Either make() from probabilities, or fill seeds() and may_join() and call
/// grow() and write().
class EvidenceMask {
 public:
  /// \param depth small depth [m]; \param camera of that size
  /// \param probability evidence, [0,1]; \param known 1 where there is evidence, 0 elsewhere
  /// \param out see write()
  void make(const Image<float>& depth, const Image<float>& probability, const Image<std::uint8_t>& known, const Pinhole& camera, int factor,
            int width, int height, const RegionRules& rules, DynamicMask& out) {
    constexpr float kThreshold = 0.5F;  // more likely dynamic than not
    start(depth.width(), depth.height());
    for (std::size_t i = 0; i < labels_.size(); ++i) {
      const float p = probability.data()[i];
      const bool valid = depth.data()[i] > 0;
      const bool seen = known.data()[i] != 0;
      labels_.data()[i] = valid && seen && p >= kThreshold ? 1 : 0;
      may_join_.data()[i] = valid && (!seen || p >= 0.5F * kThreshold) ? 1 : 0;
    }
    grow(depth, camera, rules);
    write(known, factor, width, height, rules.dilation, out);
  }

  /// Prepares small images of this size.
  void start(int width, int height) {
    labels_.assign(width, height, 0);
    may_join_.assign(width, height, 0);
  }
  [[nodiscard]] Image<std::uint8_t>& seeds() { return labels_; }       ///< 1 = certainly dynamic
  [[nodiscard]] Image<std::uint8_t>& may_join() { return may_join_; }  ///< 1 = a region may grow over it
  /// From seeds to regions: lines of one pixel and small regions go, the others grow, holes of the depth are filled.
  void grow(const Image<float>& depth, const Pinhole& camera, const RegionRules& rules) {
    open_2x2(labels_, opened_);
    const auto area = static_cast<float>(1.0 / (camera.fx * camera.fy));
    remove_small(depth, area, rules.min_pixels, rules.min_area, labels_, scratch_);
    grow_region(depth, may_join_, rules.reach, rules.depth_span, labels_, scratch_);
    fill_depth_holes(depth, labels_, scratch_);
  }
  /// \param known small, 1 where there was evidence
  /// \param out 1 inside moving regions (widened), falling to 0 at their border; known where there was evidence and
  ///   inside the regions
  void write(const Image<std::uint8_t>& known, int factor, int width, int height, int dilation, DynamicMask& out) {
    const int w = labels_.width();
    const int h = labels_.height();
    wide_ = labels_;
    dilate(wide_, small_dilation(dilation, factor), dilation_scratch_);
    small_.resize(w, h);
    seen_.resize(w, h);
    for (std::size_t i = 0; i < wide_.size(); ++i) {
      small_.data()[i] = wide_.data()[i] != 0 ? 1.0F : 0.0F;
      seen_.data()[i] = known.data()[i] != 0 || wide_.data()[i] != 0 ? 1 : 0;
    }
    enlarge_(small_, seen_, factor, width, height, out);
  }

  /// The last regions before they were widened, small.
  [[nodiscard]] const Image<std::uint8_t>& labels() const { return labels_; }
  /// A widening in pixels of the frame, in small pixels.
  [[nodiscard]] static int small_dilation(int dilation, int factor) { return (dilation + factor / 2) / factor; }

 private:
  Image<std::uint8_t> labels_;
  Image<std::uint8_t> may_join_;
  Image<std::uint8_t> opened_;
  Image<std::uint8_t> wide_;
  Image<std::uint8_t> seen_;
  Image<float> small_;
  MaskEnlarger enlarge_;
  RegionScratch scratch_;
  std::vector<std::uint8_t> dilation_scratch_;
};

APSO_NAMESPACE_END
