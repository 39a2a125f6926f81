/// \file
/// One frame at several resolutions, prepared for direct alignment: as the image that is looked into (current) and as
/// the set of pixels that are looked for (reference).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/options.hpp>
#include <apso/refinement/pyramid/first_level.hpp>
#include <apso/refinement/pyramid/pixel_list.hpp>
#include <apso/refinement/pyramid/pixel_selector.hpp>
#include <apso/refinement/pyramid/plane.hpp>
#include <apso/refinement/pyramid/pyramid_level.hpp>
#include <apso/refinement/pyramid/pyramid_options.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// What a pyramid is prepared for.
enum class PyramidRole { Current, Reference, Both };

/// A frame at the levels finest .. coarsest. What is aligned at the finest level is the image smoothed by 1 2 1: noise in a
/// gradient weights the pixel that has it, and reading between pixels errs by their curvature. Halving does as much for the
/// coarser levels, and corners are found in images as they are. A frame that is mostly masked has one finer level
/// (`finer_level_mask_share`); frames are aligned at the levels that all of them have. Building again with the same sizes allocates
/// nothing.
class FramePyramid {
 public:
  static constexpr int kCornerWidth = 400;  ///< images wider than this are not kept of a reference [px]

  /// \param frame a Frame of your images or an RgbdFrame; intensities that are not finite get weight 0, invalid depth is
  ///        dropped. Each row is read into the first level, or halved at once where that is not aligned; it is not referred to afterwards
  /// \param dynamic_probability any image of the size of the frame, [0,1], 1 = dynamic; none or empty = nothing is dynamic
  /// \param executor the result does not depend on its threads
  template <class Executor = SerialExecutor>
  void build(const AnyFrame& frame, const Pinhole& camera, const AnyImage& dynamic_probability = {}, const PyramidOptions& options = {},
             PyramidRole role = PyramidRole::Both, const Executor& executor = {}) {
    check(frame, camera, dynamic_probability, options);
    timestamp_ = frame.timestamp;
    nominal_finest_ = options.finest;
    int used = options.finest + 1;
    while (used < options.levels && (camera.width >> used) >= kMinWidth && (camera.height >> used) >= kMinAlignedSize) {
      ++used;
    }
    levels_.resize(static_cast<std::size_t>(used));
    line_.resize(camera.width + 2 * Plane::kPad, Bands::kMost);
    const bool passed_through = options.finest > 0 && dynamic_probability.empty() && read_halved(frame, options, executor);
    if (!passed_through) read(frame, dynamic_probability, options, executor);
    weighted_of_ = nullptr;
    finest_ = options.finest > 0 && masked_share_ > options.finer_level_mask_share ? options.finest - 1 : options.finest;
    Pinhole cam = camera;
    for (int l = 0; l < used; ++l) {
      PyramidLevel& level = levels_[static_cast<std::size_t>(l)];
      if (l > 0) cam = cam.halved();
      if (l > (passed_through ? 1 : 0)) halve(levels_[static_cast<std::size_t>(l - 1)], level, executor);
      level.camera = cam;
      if (l < finest_) continue;
      const bool fine = l <= options.finest;
      if (fine) smooth(level, executor);
      const Plane& aligned = fine ? smooth_ : level.intensity;
      if (role != PyramidRole::Reference) {
        level.texture.resize(2 * static_cast<std::size_t>(cam.width) * static_cast<std::size_t>(cam.height));
        Bands(cam.height, cam.width).run(executor, [&](int, int y0, int y1) { interleave(aligned, level.depth, level.texture, y0, y1); });
      } else {
        level.texture.clear();
      }
      if (role != PyramidRole::Current) {
        // the finer level of a masked frame is as densely filled as the nominal finest one
        const int most = fine ? options.max_pixels * (l < options.finest ? 4 : 1) : options.max_coarse_pixels;
        selector_({aligned, level.depth, level.gamma, cam, l, fine}, most, options.sensor_noise, level.pixels, executor);
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
    nominal_finest_ = o.nominal_finest_;
    masked_share_ = o.masked_share_;
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
  [[nodiscard]] int nominal_finest() const { return nominal_finest_; }
  [[nodiscard]] double timestamp() const { return timestamp_; }
  /// Weight of a static pixel.
  [[nodiscard]] static constexpr float background() { return kGammaStatic; }
  /// True when some pixel weighs less than a static one, i.e. the mask said something.
  [[nodiscard]] bool masked() const { return masked_share_ > 0; }

 private:
  static constexpr int kMinWidth = 20;  // coarser levels would be narrower [px]

  static void check(const AnyFrame& f, const Pinhole& camera, const AnyImage& p, const PyramidOptions& o) {
    camera.validate();
    validate(o, "pyramid");
    const auto fits = [&](const AnyImage& image) { return image.width() == camera.width && image.height() == camera.height; };
    expects(!f.intensity().empty() && !f.depth().empty(), "FramePyramid: intensity or depth is empty");
    expects(fits(f.intensity()), "FramePyramid: intensity and camera differ in size");
    expects(fits(f.depth()), "FramePyramid: depth and camera differ in size");
    expects(p.empty() || fits(p), "FramePyramid: dynamic probability and camera differ in size");
    const Pinhole& c = f.camera;
    expects(c.width == 0 || (c.fx == camera.fx && c.fy == camera.fy && c.cx == camera.cx && c.cy == camera.cy),
            "FramePyramid: the frame was taken with another camera");
    expects((camera.width >> o.finest) >= kMinAlignedSize && (camera.height >> o.finest) >= kMinAlignedSize,
            "FramePyramid: the finest level is smaller than 8 x 8 pixels");
  }

  // What cannot be used becomes 0. Weights are kept only if they say something.
  template <class Executor>
  void read(const AnyFrame& frame, const AnyImage& probability, const PyramidOptions& o, const Executor& executor) {
    PyramidLevel& out = levels_[0];
    const int w = frame.intensity().width();
    const int h = frame.intensity().height();
    out.intensity.resize(w, h);
    out.depth.resize(w, h);
    const Bands bands(h, w);
    std::array<float, Bands::kMost> found{};  // by band: pixels that are not finite, or masked
    const auto all = [&] { return std::accumulate(found.begin(), found.end(), 0.0F); };
    bands.run(executor, [&](int band, int y0, int y1) {
      found[static_cast<std::size_t>(band)] = read_first_level(frame, o.depth, out.intensity, out.depth, y0, y1);
    });
    const bool broken = all() > 0;
    masked_share_ = 0;
    if (probability.empty() && !broken) {
      out.gamma.clear();
      return;
    }
    out.gamma.resize(w, h);
    bands.run(executor, [&](int band, int y0, int y1) {
      found[static_cast<std::size_t>(band)] =
          weigh_first_level(frame, probability, o.gamma_potential, broken, out.gamma, out.depth, line_.row(band), y0, y1);
    });
    masked_share_ = all() / static_cast<float>(w * h);
    if (!masked() && !broken) out.gamma.clear();
  }

  // Without weights the first level is passed through while it is read.
  // \return false: some intensities are not finite, so that weights are needed
  template <class Executor>
  bool read_halved(const AnyFrame& frame, const PyramidOptions& o, const Executor& executor) {
    PyramidLevel& out = levels_[1];
    const int w = frame.intensity().width();
    const int h = frame.intensity().height();
    for (Plane* rows : {&intensity_rows_, &depth_rows_}) rows->resize(w, RowWindow::kRows * Bands::kMost);
    for (Plane* half : {&out.intensity, &out.depth}) half->resize(w / 2, h / 2);
    std::array<float, Bands::kMost> bad{};
    Bands(h / 2, w).run(executor, [&](int band, int y0, int y1) {
      bad[static_cast<std::size_t>(band)] =
          read_second_level(frame, o.depth, RowWindow(intensity_rows_, band, h), RowWindow(depth_rows_, band, h), out.intensity, out.depth,
                            line_.row(band), y0, y1);
    });
    levels_[0].gamma.clear();
    out.gamma.clear();
    masked_share_ = 0;
    return std::accumulate(bad.begin(), bad.end(), 0.0F) == 0;
  }

  template <class Executor>
  void halve(const PyramidLevel& in, PyramidLevel& out, const Executor& executor) {
    const int w = in.intensity.width() / 2;
    const int h = in.intensity.height() / 2;
    if (in.gamma.empty()) out.gamma.clear();
    else out.gamma.resize(w, h);
    out.depth.resize(w, h);
    filter(halve_intensity<Plane>, in, w, h, out.intensity, executor, [&](int y0, int y1) {
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

  std::vector<PyramidLevel> levels_;  // by halvings; those above the finest are passed through, not prepared
  Plane smooth_, weighted_, gamma_;
  const PyramidLevel* weighted_of_ = nullptr;  // the level whose weighted image is there
  Plane line_;                                 // a row for each band
  Plane intensity_rows_, depth_rows_;          // a window for each band
  PixelSelector selector_;
  std::vector<std::vector<float>> samples_;  // of depth, by level
  double timestamp_ = 0;
  float masked_share_ = 0;
  int finest_ = 0;
  int nominal_finest_ = 0;
};

APSO_NAMESPACE_END
