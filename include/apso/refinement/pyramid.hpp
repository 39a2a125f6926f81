/// \file
/// One frame at several resolutions, prepared for direct alignment: as the image that is looked into (current) and as
/// the set of pixels that are looked for (reference).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/lanes.hpp>
#include <apso/options.hpp>
#include <apso/refinement/pixel_list.hpp>
#include <apso/refinement/plane.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/rgbd_frame.hpp>

APSO_NAMESPACE_BEGIN

struct PyramidOptions {
  int levels = 6;                       ///< resolutions, counted from the full one (level 0)
  int finest = 1;                       ///< finest level used; 1 = half resolution
  int min_width = 20;                   ///< levels narrower than this are not built (the finest always is) [px]
  SelectionOptions selection;           ///< which pixels of a reference are aligned
  float gamma_background = 1.0F;        ///< weight of a pixel that is not dynamic
  float gamma_potential = 0.1F;         ///< weight of a pixel that may be dynamic
  float gamma_confirmed = 0.0F;         ///< weight of a dynamic pixel
  float potential_probability = 0.3F;   ///< dynamic probability from which a pixel may be dynamic
  float confirmed_probability = 0.7F;   ///< dynamic probability from which a pixel is dynamic
  DepthRange depth;                     ///< depth that is used [m]

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("levels", s.levels, 1, 8);
    v("finest", s.finest, 0, 7);
    v("min_width", s.min_width, 8, 10000);
    v("pixels", s.selection);  // short: a longer prefix would cost an allocation per frame
    v("gamma_background", s.gamma_background, 0.0F, 1.0F);
    v("gamma_potential", s.gamma_potential, 0.0F, 1.0F);
    v("gamma_confirmed", s.gamma_confirmed, 0.0F, 1.0F);
    v("potential_probability", s.potential_probability, 0.0F, 1.0F);
    v("confirmed_probability", s.confirmed_probability, 0.0F, 1.0F);
    v("depth", s.depth);
  }
};

/// One resolution of a frame.
struct PyramidLevel {
  Pinhole camera;
  Plane intensity;             ///< [0,1]
  Plane depth;                 ///< [m], 0 = invalid
  Plane gamma;                 ///< weight [0,1]; empty when all weights are those of the background
  std::vector<float> texture;  ///< intensity and depth of each pixel side by side, as they are looked up together;
                               ///< intensity smoothed if finest; empty unless prepared as current
  PixelList pixels;            ///< of the same images; empty unless prepared as reference
  float median_depth = 0;      ///< of the selected pixels [m]
};

/// What a pyramid is prepared for.
enum class PyramidRole { Current, Reference, Both };

/// A frame at the levels finest .. coarsest. What is aligned at the finest level is the image smoothed by 1 2 1: noise in a
/// gradient weights the pixel that has it, and reading between pixels errs by their curvature. Halving does as much for the
/// coarser levels, and corners are found in images as they are. Building again with the same sizes allocates nothing.
class FramePyramid {
 public:
  static constexpr int kCornerWidth = 400;  ///< images wider than this are not kept of a reference [px]

  /// \param frame intensity in [0,1] and depth [m]; non-finite intensities get weight 0, invalid depth is dropped
  /// \param dynamic_probability [0,1], 1 = dynamic, of the size of the frame; empty = nothing is dynamic
  void build(const RgbdFrame& frame, const Pinhole& camera, ImageView<const float> dynamic_probability = {},
             const PyramidOptions& options = {}, PyramidRole role = PyramidRole::Both) {
    check(frame, camera, dynamic_probability, options);
    timestamp_ = frame.timestamp;
    finest_ = options.finest;
    background_ = options.gamma_background;
    int used = finest_ + 1;
    while (used < options.levels && (camera.width >> used) >= options.min_width && (camera.height >> used) >= 8) ++used;
    levels_.resize(static_cast<std::size_t>(used - finest_));
    Pinhole cam = camera;
    PyramidLevel* last = nullptr;
    for (int l = 0; l < used; ++l) {
      // levels above the finest one are passed through, not kept
      PyramidLevel& level = l < finest_ ? skipped_[l & 1] : levels_[static_cast<std::size_t>(l - finest_)];
      if (last == nullptr) {
        sanitise(frame, dynamic_probability, options, level);
      } else {
        filter(halve_intensity, last->intensity, last->gamma, level.intensity);
        halve_depth(last->depth, level.depth);
        if (last->gamma.empty()) level.gamma.clear();
        else halve_mean(last->gamma, level.gamma);
        cam = cam.halved();
      }
      level.camera = cam;
      last = &level;
      if (l < finest_) continue;
      if (l == finest_) filter(smooth_intensity, level.intensity, level.gamma, smooth_);
      const Plane& aligned = l == finest_ ? smooth_ : level.intensity;
      if (role != PyramidRole::Reference) interleave(aligned, level.depth, level.texture);
      else level.texture.clear();
      if (role != PyramidRole::Current) {
        const int most = l == finest_ ? options.selection.max_pixels : options.selection.max_coarse_pixels;
        selector_(aligned, level.depth, level.gamma, background_, cam, l, gradient_noise(l, finest_), most,
                  options.selection, level.pixels);
        find_median_depth(level);
      }
    }
  }

  /// Takes over what a reference needs: the selected pixels, the cameras, and of the images only the small ones in which
  /// corners are looked for.
  void assign_reference(const FramePyramid& o) {
    timestamp_ = o.timestamp_;
    finest_ = o.finest_;
    masked_ = o.masked_;
    background_ = o.background_;
    levels_.resize(o.levels_.size());
    for (std::size_t i = 0; i < levels_.size(); ++i) {
      levels_[i].camera = o.levels_[i].camera;
      levels_[i].pixels = o.levels_[i].pixels;
      levels_[i].median_depth = o.levels_[i].median_depth;
      if (o.levels_[i].camera.width > kCornerWidth) continue;
      levels_[i].intensity = o.levels_[i].intensity;
      levels_[i].depth = o.levels_[i].depth;
      levels_[i].gamma = o.levels_[i].gamma;
    }
  }

  [[nodiscard]] bool empty() const { return levels_.empty(); }
  /// Number of levels kept; 0 is the finest of them.
  [[nodiscard]] int size() const { return static_cast<int>(levels_.size()); }
  [[nodiscard]] const PyramidLevel& level(int i) const { return levels_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] double timestamp() const { return timestamp_; }
  /// Weight of a pixel that is not dynamic.
  [[nodiscard]] float background() const { return background_; }
  /// True when some pixel had a weight below that of the background, i.e. the mask said something.
  [[nodiscard]] bool masked() const { return masked_; }

 private:
  static void check(const RgbdFrame& f, const Pinhole& camera, const ImageView<const float>& p, const PyramidOptions& o) {
    camera.validate();
    validate(o, "pyramid");
    expects(!f.intensity.empty() && !f.depth.empty(), "FramePyramid: intensity or depth is empty");
    expects(f.intensity.width == camera.width && f.intensity.height == camera.height,
            "FramePyramid: intensity and camera differ in size");
    expects(f.depth.width == camera.width && f.depth.height == camera.height,
            "FramePyramid: depth and camera differ in size");
    expects(p.empty() || (p.width == camera.width && p.height == camera.height),
            "FramePyramid: dynamic probability and camera differ in size");
    expects((camera.width >> o.finest) >= 8 && (camera.height >> o.finest) >= 8,
            "FramePyramid: the finest level is smaller than 8 x 8 pixels");
  }

  // Copies the frame; what cannot be used becomes 0. Weights are kept only if they say something.
  void sanitise(const RgbdFrame& f, const ImageView<const float>& p, const PyramidOptions& o, PyramidLevel& out) {
    const int w = f.intensity.width;
    const int h = f.intensity.height;
    out.intensity.resize(w, h);
    out.depth.resize(w, h);
    masked_ = false;
    const Lanes lowest = std::max(o.depth.min, 1e-6F);
    const Lanes highest = o.depth.max;
    bool broken = false;
    for (int y = 0; y < h; ++y) {
      float* i = out.intensity.row(y);
      float* z = out.depth.row(y);
      std::copy(f.intensity.row(y), f.intensity.row(y) + w, i);
      std::copy(f.depth.row(y), f.depth.row(y) + w, z);
      std::fill(i + w, i + w + Plane::kPad, 0.0F);
      Mask bad = Lanes(0.0F) < Lanes(0.0F);
      for (int x = 0; x < w; x += kLanes) {
        const Lanes depth = Lanes::load(z + x);
        select((depth >= lowest) & (depth <= highest), depth, 0.0F).store(z + x);
        const Lanes grey = Lanes::load(i + x);
        const Mask ok = abs(grey) <= Lanes(1e6F);  // false for NaN and inf
        bad = bad | !ok;
        select(ok, grey, 0.0F).store(i + x);
      }
      for (int k = 0; k < kLanes; ++k) broken |= bad[k] != 0;
    }
    if (p.empty() && !broken) {
      out.gamma.clear();
      return;
    }
    out.gamma.resize(w, h);
    for (int y = 0; y < h; ++y) {
      float* g = out.gamma.row(y);
      std::fill(g, g + w, o.gamma_background);
      if (!p.empty()) {
        const float* fp = p.row(y);
        bool any = false;
        for (int x = 0; x < w; ++x) {
          // NaN fails both comparisons and counts as dynamic
          g[x] = fp[x] < o.potential_probability
                     ? o.gamma_background
                     : (fp[x] < o.confirmed_probability ? o.gamma_potential : o.gamma_confirmed);
          any |= g[x] < o.gamma_background;
        }
        masked_ |= any;
      }
      const float* fi = f.intensity.row(y);
      for (int x = 0; broken && x < w; ++x) {
        if (!(std::abs(fi[x]) <= 1e6F)) g[x] = 0.0F;
      }
      float* z = out.depth.row(y);
      for (int x = 0; x < w; ++x) z[x] = g[x] > 0 ? z[x] : 0.0F;  // nor does the depth of what is masked
    }
    if (!masked_ && !broken) out.gamma.clear();
  }

  // out = f(in), in which each pixel counts by its weight, so that what is masked does not mix in.
  template <class F>
  void filter(const F& f, const Plane& in, const Plane& gamma, Plane& out) {
    if (gamma.empty()) {
      f(in, out, line_);
      return;
    }
    multiply(in, gamma, weighted_);
    f(weighted_, out, line_);
    f(gamma, smooth_gamma_, line_);
    divide(out, smooth_gamma_, 1e-3F);
  }

  static void interleave(const Plane& intensity, const Plane& depth, std::vector<float>& texture) {
    const int w = intensity.width();
    const int h = intensity.height();
    // rows follow each other without a gap; the last one is written beyond its end
    texture.resize(2 * (static_cast<std::size_t>(w) * static_cast<std::size_t>(h) + Plane::kPad));
    for (int y = 0; y < h; ++y) {
      float* t = texture.data() + 2 * static_cast<std::ptrdiff_t>(y) * w;
      for (int x = 0; x < w; x += kLanes) {
        store_pairs(Lanes::load(intensity.row(y) + x), Lanes::load(depth.row(y) + x), t + 2 * x);
      }
    }
  }

  // Of about a thousand of the pixels.
  void find_median_depth(PyramidLevel& l) {
    l.median_depth = 0;
    sample_.clear();
    const int step = std::max(1, l.pixels.blocks() * PixelList::kBlock / 1024);
    for (int k = 0; k < l.pixels.blocks() * PixelList::kBlock; k += step) {
      const float z = l.pixels.at(k / PixelList::kBlock, PixelList::kZ, k % PixelList::kBlock);
      if (z > 0) sample_.push_back(z);
    }
    if (sample_.empty()) return;
    const auto middle = sample_.begin() + static_cast<std::ptrdiff_t>(sample_.size() / 2);
    std::nth_element(sample_.begin(), middle, sample_.end());
    l.median_depth = *middle;
  }

  std::vector<PyramidLevel> levels_;
  PyramidLevel skipped_[2];
  Plane smooth_, line_, weighted_, smooth_gamma_;
  PixelSelector selector_;
  std::vector<float> sample_;
  double timestamp_ = 0;
  float background_ = 1;
  int finest_ = 0;
  bool masked_ = false;
};

APSO_NAMESPACE_END
