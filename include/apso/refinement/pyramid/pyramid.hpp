/// \file
/// One frame at several resolutions, prepared for direct alignment: as the image that is looked into (current) and as
/// the set of pixels that are looked for (reference).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/lanes.hpp>
#include <apso/options.hpp>
#include <apso/refinement/pyramid/pixel_list.hpp>
#include <apso/refinement/pyramid/plane.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

struct PyramidOptions {
  int levels = 6;                       ///< resolutions, counted from the full one (level 0)
  int finest = 1;                       ///< finest level used; 1 = half resolution
  float finer_masked = 0.4F;            ///< share of pixels that may be dynamic above which a level finer is used as well, so that as
                                        ///< many others are left to choose from; 1 = never
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
    v("finer_masked", s.finer_masked, 0.0F, 1.0F);
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
                               ///< intensity smoothed at the finest levels; empty unless prepared as current
  PixelList pixels;            ///< of the same images; empty unless prepared as reference
  float median_depth = 0;      ///< of the selected pixels [m]
};

/// What a pyramid is prepared for.
enum class PyramidRole { Current, Reference, Both };

/// A frame at the levels finest .. coarsest. What is aligned at the finest level is the image smoothed by 1 2 1: noise in a
/// gradient weights the pixel that has it, and reading between pixels errs by their curvature. Halving does as much for the
/// coarser levels, and corners are found in images as they are. A frame that is mostly masked has a level more (`finer_masked`);
/// frames are aligned at the levels that all of them have. Building again with the same sizes allocates nothing.
class FramePyramid {
 public:
  static constexpr int kCornerWidth = 400;  ///< images wider than this are not kept of a reference [px]

  /// \param frame intensity in [0,1] and depth [m]; non-finite intensities get weight 0, invalid depth is dropped
  /// \param dynamic_probability [0,1], 1 = dynamic, of the size of the frame; empty = nothing is dynamic
  /// \param executor the result does not depend on its threads
  template <class Executor = SerialExecutor>
  void build(const RgbdFrame& frame, const Pinhole& camera, ImageView<const float> dynamic_probability = {},
             const PyramidOptions& options = {}, PyramidRole role = PyramidRole::Both, const Executor& executor = {}) {
    check(frame, camera, dynamic_probability, options);
    timestamp_ = frame.timestamp;
    background_ = options.gamma_background;
    usual_finest_ = options.finest;
    int used = options.finest + 1;
    while (used < options.levels && (camera.width >> used) >= options.min_width && (camera.height >> used) >= 8) ++used;
    levels_.resize(static_cast<std::size_t>(used));
    line_.resize(camera.width + 2 * Plane::kPad, Bands::kMost);
    sanitise(frame, dynamic_probability, options, levels_[0], executor);
    weighted_of_ = nullptr;
    finest_ = options.finest > 0 && masked_share_ > options.finer_masked ? options.finest - 1 : options.finest;
    Pinhole cam = camera;
    for (int l = 0; l < used; ++l) {
      PyramidLevel& level = levels_[static_cast<std::size_t>(l)];
      if (l > 0) {
        halve(levels_[static_cast<std::size_t>(l - 1)], level, executor);
        cam = cam.halved();
      }
      level.camera = cam;
      if (l < finest_) continue;
      const bool fine = l <= options.finest;
      if (fine) smooth(level, executor);
      const Plane& aligned = fine ? smooth_ : level.intensity;
      if (role != PyramidRole::Reference) interleave(aligned, level.depth, level.texture, executor);
      else level.texture.clear();
      if (role != PyramidRole::Current) {
        // the level more is as densely filled as the usual finest one
        const int most = fine ? options.selection.max_pixels * (l < options.finest ? 4 : 1) : options.selection.max_coarse_pixels;
        selector_(aligned, level.depth, level.gamma, background_, cam, l, gradient_noise(l, fine), most, options.selection,
                  level.pixels, executor);
      }
    }
    if (role == PyramidRole::Current) return;
    samples_.resize(levels_.size());
    executor(size(), [&](int i) {
      const auto k = static_cast<std::size_t>(finest_ + i);
      levels_[k].median_depth = median_depth(levels_[k].pixels, samples_[k]);
    });
  }

  /// Takes over what a reference needs: the selected pixels, the cameras, and of the images only the small ones in which
  /// corners are looked for.
  void assign_reference(const FramePyramid& o) {
    timestamp_ = o.timestamp_;
    finest_ = o.finest_;
    usual_finest_ = o.usual_finest_;
    masked_share_ = o.masked_share_;
    background_ = o.background_;
    levels_.resize(o.levels_.size());
    for (auto i = static_cast<std::size_t>(finest_); i < levels_.size(); ++i) {
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
  [[nodiscard]] int size() const { return static_cast<int>(levels_.size()) - finest_; }
  [[nodiscard]] const PyramidLevel& level(int i) const { return halved(finest_ + i); }
  /// The level after so many halvings of the full size, from finest() on.
  [[nodiscard]] const PyramidLevel& halved(int times) const { return levels_[static_cast<std::size_t>(times)]; }
  /// Halvings of the finest level kept: `PyramidOptions::finest`, or one less.
  [[nodiscard]] int finest() const { return finest_; }
  /// `PyramidOptions::finest`.
  [[nodiscard]] int usual_finest() const { return usual_finest_; }
  [[nodiscard]] double timestamp() const { return timestamp_; }
  /// Weight of a pixel that is not dynamic.
  [[nodiscard]] float background() const { return background_; }
  /// True when some pixel had a weight below that of the background, i.e. the mask said something.
  [[nodiscard]] bool masked() const { return masked_share_ > 0; }

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
  template <class Executor>
  void sanitise(const RgbdFrame& f, const ImageView<const float>& p, const PyramidOptions& o, PyramidLevel& out,
                const Executor& executor) {
    const int w = f.intensity.width;
    const int h = f.intensity.height;
    out.intensity.resize(w, h);
    out.depth.resize(w, h);
    const Bands bands(h, w);
    std::array<float, Bands::kMost> found{};  // by band: pixels that are not finite, or masked
    const auto all = [&] { return std::accumulate(found.begin(), found.end(), 0.0F); };
    bands.run(executor, [&](int band, int y0, int y1) { found[static_cast<std::size_t>(band)] = copy(f, o, out, y0, y1); });
    const bool broken = all() > 0;
    masked_share_ = 0;
    if (p.empty() && !broken) {
      out.gamma.clear();
      return;
    }
    out.gamma.resize(w, h);
    bands.run(executor, [&](int band, int y0, int y1) {
      found[static_cast<std::size_t>(band)] = weigh(f, p, o, broken, out, y0, y1);
    });
    masked_share_ = all() / static_cast<float>(w * h);
    if (!masked() && !broken) out.gamma.clear();
  }
  // Returns how many intensities are not finite.
  static float copy(const RgbdFrame& f, const PyramidOptions& o, PyramidLevel& out, int y0, int y1) {
    const int w = f.intensity.width;
    const Lanes lowest = std::max(o.depth.min, 1e-6F);
    const Lanes highest = o.depth.max;
    Lanes bad = 0.0F;
    for (int y = y0; y < y1; ++y) {
      float* i = out.intensity.row(y);
      float* z = out.depth.row(y);
      std::copy(f.intensity.row(y), f.intensity.row(y) + w, i);
      std::copy(f.depth.row(y), f.depth.row(y) + w, z);
      std::fill(i + w, i + w + Plane::kPad, 0.0F);
      for (int x = 0; x < w; x += kLanes) {
        const Lanes depth = Lanes::load(z + x);
        select((depth >= lowest) & (depth <= highest), depth, 0.0F).store(z + x);
        const Lanes grey = Lanes::load(i + x);
        const Mask ok = abs(grey) <= Lanes(1e6F);  // false for NaN and inf
        bad += select(ok, 0.0F, 1.0F);
        select(ok, grey, 0.0F).store(i + x);
      }
    }
    return bad.sum();
  }
  // Returns how many pixels weigh less than the background.
  static float weigh(const RgbdFrame& f, const ImageView<const float>& p, const PyramidOptions& o, bool broken, PyramidLevel& out,
                    int y0, int y1) {
    const int w = f.intensity.width;
    const Lanes background = o.gamma_background;
    Lanes less = 0.0F;
    for (int y = y0; y < y1; ++y) {
      float* g = out.gamma.row(y);
      float* z = out.depth.row(y);
      if (p.empty()) std::fill(g, g + w, -1.0F);
      else std::copy(p.row(y), p.row(y) + w, g);
      std::fill(g + w, g + w + Plane::kPad, -1.0F);  // as certainly static
      for (int x = 0; x < w; x += kLanes) {
        const Lanes v = Lanes::load(g + x);
        // NaN fails both comparisons and counts as dynamic
        const Lanes weight = select(v < Lanes(o.potential_probability), background,
                                    select(v < Lanes(o.confirmed_probability), Lanes(o.gamma_potential), Lanes(o.gamma_confirmed)));
        less += select(weight < background, 1.0F, 0.0F);
        weight.store(g + x);
        // nor does the depth of what is masked
        select(weight > Lanes(0.0F), Lanes::load(z + x), 0.0F).store(z + x);
      }
      const float* i = f.intensity.row(y);
      for (int x = 0; broken && x < w; ++x) {
        if (!(std::abs(i[x]) <= 1e6F)) g[x] = z[x] = 0.0F;
      }
    }
    return less.sum();
  }

  template <class Executor>
  void halve(const PyramidLevel& in, PyramidLevel& out, const Executor& executor) {
    const int w = in.intensity.width() / 2;
    const int h = in.intensity.height() / 2;
    if (in.gamma.empty()) out.gamma.clear();
    else out.gamma.resize(w, h);
    out.depth.resize(w, h);
    filter(halve_intensity, in, w, h, out.intensity, executor, [&](int y0, int y1) {
      halve_depth(in.depth, out.depth, y0, y1);
      if (!in.gamma.empty()) halve_mean(in.gamma, out.gamma, y0, y1);
    });
  }
  template <class Executor>
  void smooth(const PyramidLevel& level, const Executor& executor) {
    filter(smooth_intensity, level, level.intensity.width(), level.intensity.height(), smooth_, executor, [](int, int) {});
  }
  // out = f(intensity), in which each pixel counts by its weight, so that what is masked does not mix in; and what else is
  // to be done for a band of rows.
  template <class F, class Executor, class Also>
  void filter(const F& f, const PyramidLevel& in, int w, int h, Plane& out, const Executor& executor, const Also& also) {
    const bool weighted = !in.gamma.empty();
    if (weighted) gamma_.resize(w, h);
    if (weighted && weighted_of_ != &in) {  // a level may be smoothed, then halved
      weighted_of_ = &in;
      weighted_.resize(in.intensity.width(), in.intensity.height());
      Bands(in.intensity.height(), in.intensity.width()).run(executor, [&](int, int y0, int y1) {
        multiply(in.intensity, in.gamma, weighted_, y0, y1);
      });
    }
    out.resize(w, h);
    Bands(h, w).run(executor, [&](int band, int y0, int y1) {
      f(weighted ? weighted_ : in.intensity, out, line_.row(band), y0, y1);
      if (weighted) {
        f(in.gamma, gamma_, line_.row(band), y0, y1);
        divide(out, gamma_, 1e-3F, y0, y1);
      }
      also(y0, y1);
    });
  }

  template <class Executor>
  static void interleave(const Plane& intensity, const Plane& depth, std::vector<float>& texture, const Executor& executor) {
    const int w = intensity.width();
    const int h = intensity.height();
    texture.resize(2 * static_cast<std::size_t>(w) * static_cast<std::size_t>(h));
    Bands(h, w).run(executor, [&](int, int y0, int y1) {
      for (int y = y0; y < y1; ++y) {
        const float* i = intensity.row(y);
        const float* z = depth.row(y);
        float* t = texture.data() + 2 * static_cast<std::ptrdiff_t>(y) * w;
        int x = 0;
        for (; x + kLanes <= w; x += kLanes) store_pairs(Lanes::load(i + x), Lanes::load(z + x), t + 2 * x);
        for (; x < w; ++x) {  // rows follow each other without a gap
          t[2 * x] = i[x];
          t[2 * x + 1] = z[x];
        }
      }
    });
  }

  // Of about a thousand of the pixels.
  static float median_depth(const PixelList& pixels, std::vector<float>& sample) {
    sample.clear();
    const int step = std::max(1, pixels.blocks() * PixelList::kBlock / 1024);
    for (int k = 0; k < pixels.blocks() * PixelList::kBlock; k += step) {
      const float z = pixels.at(k / PixelList::kBlock, PixelList::kZ, k % PixelList::kBlock);
      if (z > 0) sample.push_back(z);
    }
    if (sample.empty()) return 0;
    const auto middle = sample.begin() + static_cast<std::ptrdiff_t>(sample.size() / 2);
    std::nth_element(sample.begin(), middle, sample.end());
    return *middle;
  }

  std::vector<PyramidLevel> levels_;  // by halvings; those above the finest are passed through, not prepared
  Plane smooth_, weighted_, gamma_;
  const PyramidLevel* weighted_of_ = nullptr;  // the level whose weighted image is there
  Plane line_;  // a row for each band
  PixelSelector selector_;
  std::vector<std::vector<float>> samples_;  // of depth, by level
  double timestamp_ = 0;
  float background_ = 1;
  float masked_share_ = 0;
  int finest_ = 0;
  int usual_finest_ = 0;
};

APSO_NAMESPACE_END
