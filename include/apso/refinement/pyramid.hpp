/// \file
/// One frame at several resolutions, prepared for direct alignment: as the image that is looked into (current) and as
/// the set of pixels that are looked for (reference).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/config.hpp>
#include <apso/options.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/rgbd_frame.hpp>

APSO_NAMESPACE_BEGIN

struct PyramidOptions {
  int levels = 4;                       ///< resolutions, counted from the full one (level 0)
  int finest = 1;                       ///< finest level used; 1 = half resolution
  int min_width = 40;                   ///< levels narrower than this are not built (the finest always is) [px]
  float min_intensity_gradient = 0.01F; ///< a pixel is used if its intensity changes by this much [1/px]
  float min_depth_gradient = 0.01F;     ///< or its depth by this much [m/px]
  int max_pixels = 20000;               ///< used pixels per level
  double flat_share = 0.1;              ///< part of max_pixels that is open to pixels without any gradient: a bare wall
                                        ///< still fixes three of the six directions
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
    v("min_intensity_gradient", s.min_intensity_gradient, 0.0F, 1.0F);
    v("min_depth_gradient", s.min_depth_gradient, 0.0F, 10.0F);
    v("max_pixels", s.max_pixels, 300, 10000000);
    v("flat_share", s.flat_share, 0.0, 1.0);
    v("gamma_background", s.gamma_background, 0.0F, 1.0F);
    v("gamma_potential", s.gamma_potential, 0.0F, 1.0F);
    v("gamma_confirmed", s.gamma_confirmed, 0.0F, 1.0F);
    v("potential_probability", s.potential_probability, 0.0F, 1.0F);
    v("confirmed_probability", s.confirmed_probability, 0.0F, 1.0F);
    v("depth", s.depth);
  }
};

/// Pixels are worked on in blocks of this many; lists are padded to a multiple of it with pixels of weight 0.
inline constexpr int kPixelBlock = 64;

/// The selected pixels of a reference level, one array per quantity.
struct PixelList {
  int count = 0;                 ///< without padding
  std::vector<float> x, y, z;    ///< point in the frame of the reference [m]
  std::vector<float> intensity;  ///< [0,1]
  std::vector<float> dx, dy;     ///< intensity gradient [1/px]
  std::vector<float> gamma;      ///< weight [0,1]

  [[nodiscard]] int padded() const { return static_cast<int>(x.size()); }
  void resize(int n) {
    count = n;
    const auto p = static_cast<std::size_t>((n + kPixelBlock - 1) / kPixelBlock * kPixelBlock);
    for (auto* a : {&x, &y, &z, &intensity, &dx, &dy, &gamma}) {
      a->resize(p);
      std::fill(a->begin() + n, a->end(), 0.0F);
    }
  }
};

/// One resolution of a frame.
struct PyramidLevel {
  /// Floats per pixel of `texture`: intensity, its x and y gradient, weight, depth, its x and y gradient, unused.
  /// Interleaved, because a warped pixel reads all of them at one place.
  static constexpr int kChannels = 8;

  Pinhole camera;
  Image<float> intensity;      ///< [0,1]
  Image<float> depth;          ///< [m], 0 = invalid
  Image<float> gamma;          ///< weight [0,1]
  std::vector<float> texture;  ///< see kChannels; empty unless prepared as current
  PixelList pixels;            ///< empty unless prepared as reference
  float median_depth = 0;      ///< of the selected pixels [m]
};

/// What a pyramid is prepared for.
enum class PyramidRole { Current, Reference, Both };

namespace detail {

// Taps 1 3 3 1 (/8) in both directions. A filter with an even number of taps is centred on the 2x2 block that the
// coarse pixel stands for, as c' = (c + 0.5)/2 - 0.5 and the depth require; an odd one would shift the image.
inline void halve_intensity(const ImageView<const float>& in, Image<float>& out, std::vector<float>& line) {
  const int w = in.width / 2;
  const int h = in.height / 2;
  out.resize(w, h);
  line.resize(static_cast<std::size_t>(in.width) + 2);
  float* l = line.data() + 1;
  for (int y = 0; y < h; ++y) {
    const float* a = in.row(std::max(2 * y - 1, 0));
    const float* b = in.row(2 * y);
    const float* c = in.row(2 * y + 1);
    const float* d = in.row(std::min(2 * y + 2, in.height - 1));
    for (int x = 0; x < in.width; ++x) l[x] = 0.125F * (a[x] + d[x]) + 0.375F * (b[x] + c[x]);
    l[-1] = l[0];
    l[in.width] = l[in.width - 1];
    float* o = out.row(y);
    for (int x = 0; x < w; ++x) {
      const float* s = l + 2 * x;
      o[x] = 0.125F * (s[-1] + s[2]) + 0.375F * (s[0] + s[1]);
    }
  }
}

// Mean of the valid ones of 2x2 pixels that lie within 10 cm of their second largest: never an average over an edge.
inline void halve_depth(const ImageView<const float>& in, Image<float>& out) {
  const int w = in.width / 2;
  const int h = in.height / 2;
  out.resize(w, h);
  for (int y = 0; y < h; ++y) {
    const float* p = in.row(2 * y);
    const float* q = in.row(2 * y + 1);
    float* o = out.row(y);
    for (int x = 0; x < w; ++x, p += 2, q += 2) {
      const float a = p[0];
      const float b = p[1];
      const float c = q[0];
      const float d = q[1];
      const float low = std::min(std::min(a, b), std::min(c, d));
      const float high = std::max(std::max(a, b), std::max(c, d));
      if (low > 0 && high - low <= 0.1F) {
        o[x] = 0.25F * (a + b + c + d);
        continue;
      }
      // second largest of the valid ones; the only one if there is one
      const float u = std::max(std::min(a, b), std::min(c, d));
      const float v = std::min(std::max(a, b), std::max(c, d));
      float second = std::max(u, v);
      if (!(second > 0)) second = high;
      float sum = 0;
      float n = 0;
      for (const float z : {a, b, c, d}) {
        if (z > 0 && std::abs(z - second) <= 0.1F) {
          sum += z;
          n += 1;
        }
      }
      o[x] = n > 0 ? sum / n : 0.0F;
    }
  }
}

inline void halve_min(const ImageView<const float>& in, Image<float>& out) {
  const int w = in.width / 2;
  const int h = in.height / 2;
  out.resize(w, h);
  for (int y = 0; y < h; ++y) {
    const float* p = in.row(2 * y);
    const float* q = in.row(2 * y + 1);
    float* o = out.row(y);
    for (int x = 0; x < w; ++x) o[x] = std::min(std::min(p[2 * x], p[2 * x + 1]), std::min(q[2 * x], q[2 * x + 1]));
  }
}

}  // namespace detail

/// A frame at the levels finest .. coarsest. Building again with the same sizes allocates nothing.
class FramePyramid {
 public:
  /// \param frame intensity in [0,1] and depth [m]; non-finite intensities get weight 0, invalid depth is dropped
  /// \param dynamic_probability [0,1], 1 = dynamic, of the size of the frame; empty = nothing is dynamic
  void build(const RgbdFrame& frame, const Pinhole& camera, ImageView<const float> dynamic_probability = {},
             const PyramidOptions& options = {}, PyramidRole role = PyramidRole::Both) {
    check(frame, camera, dynamic_probability, options);
    timestamp_ = frame.timestamp;
    sanitise(frame, dynamic_probability, options);
    int used = options.finest + 1;
    while (used < options.levels && (camera.width >> used) >= options.min_width && (camera.height >> used) >= 8) ++used;
    finest_ = options.finest;
    levels_.resize(static_cast<std::size_t>(used - finest_));
    Pinhole cam = camera;
    const Image<float>* i = &intensity_;
    const Image<float>* z = &depth_;
    const Image<float>* g = &gamma_;
    for (int l = 0; l < used; ++l) {
      PyramidLevel* level = nullptr;
      if (l < finest_) {  // passed through, not kept
        if (l > 0) {
          step(*i, *z, *g, skipped_[l & 1]);
          i = &skipped_[l & 1].intensity;
          z = &skipped_[l & 1].depth;
          g = &skipped_[l & 1].gamma;
          cam = cam.halved();
        }
        continue;
      }
      level = &levels_[static_cast<std::size_t>(l - finest_)];
      if (l == 0) {
        level->intensity = intensity_;
        level->depth = depth_;
        level->gamma = gamma_;
      } else {
        step(*i, *z, *g, *level);
        cam = cam.halved();
      }
      level->camera = cam;
      i = &level->intensity;
      z = &level->depth;
      g = &level->gamma;
      prepare(*level, options, role);
    }
  }

  /// Takes over what a reference needs (the selected pixels and the cameras) and none of the images.
  void assign_reference(const FramePyramid& o) {
    timestamp_ = o.timestamp_;
    finest_ = o.finest_;
    masked_ = o.masked_;
    levels_.resize(o.levels_.size());
    for (std::size_t i = 0; i < levels_.size(); ++i) {
      levels_[i].camera = o.levels_[i].camera;
      levels_[i].pixels = o.levels_[i].pixels;
      levels_[i].median_depth = o.levels_[i].median_depth;
    }
  }

  [[nodiscard]] bool empty() const { return levels_.empty(); }
  /// Number of levels kept; 0 is the finest of them.
  [[nodiscard]] int size() const { return static_cast<int>(levels_.size()); }
  [[nodiscard]] const PyramidLevel& level(int i) const { return levels_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] double timestamp() const { return timestamp_; }
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

  void sanitise(const RgbdFrame& f, const ImageView<const float>& p, const PyramidOptions& o) {
    const int w = f.intensity.width;
    const int h = f.intensity.height;
    intensity_.resize(w, h);
    depth_.resize(w, h);
    gamma_.resize(w, h);
    masked_ = false;
    for (int y = 0; y < h; ++y) {
      const float* fi = f.intensity.row(y);
      const float* fz = f.depth.row(y);
      float* i = intensity_.row(y);
      float* z = depth_.row(y);
      float* g = gamma_.row(y);
      for (int x = 0; x < w; ++x) z[x] = depth_valid(fz[x], o.depth) ? fz[x] : 0.0F;
      if (p.empty()) {
        std::fill(g, g + w, o.gamma_background);
      } else {
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
      for (int x = 0; x < w; ++x) {
        const bool ok = std::abs(fi[x]) <= 1e6F;  // false for NaN and inf
        i[x] = ok ? fi[x] : 0.0F;
        if (!ok) g[x] = 0.0F;
      }
    }
  }

  void step(const Image<float>& i, const Image<float>& z, const Image<float>& g, PyramidLevel& out) {
    detail::halve_intensity(i, out.intensity, line_);
    detail::halve_depth(z, out.depth);
    detail::halve_min(g, out.gamma);
  }

  void prepare(PyramidLevel& l, const PyramidOptions& o, PyramidRole role) {
    constexpr int C = PyramidLevel::kChannels;
    const int w = l.intensity.width();
    const int h = l.intensity.height();
    std::vector<float>& t = role == PyramidRole::Reference ? scratch_ : l.texture;
    t.resize(static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * C);
    for (int y = 0; y < h; ++y) {
      const float* i = l.intensity.row(y);
      const float* z = l.depth.row(y);
      const float* g = l.gamma.row(y);
      float* p = t.data() + static_cast<std::ptrdiff_t>(y) * w * C;
      const bool rim = y == 0 || y == h - 1;
      const float* ia = l.intensity.row(std::max(y - 1, 0));
      const float* ib = l.intensity.row(std::min(y + 1, h - 1));
      const float* za = l.depth.row(std::max(y - 1, 0));
      const float* zb = l.depth.row(std::min(y + 1, h - 1));
      for (int x = 0; x < w; ++x, p += C) {
        p[0] = i[x];
        p[3] = g[x];
        p[4] = z[x];
        p[7] = 0;
        if (rim || x == 0 || x == w - 1) {
          p[1] = p[2] = p[5] = p[6] = 0;
          continue;
        }
        p[1] = 0.5F * (i[x + 1] - i[x - 1]);
        p[2] = 0.5F * (ib[x] - ia[x]);
        p[5] = z[x] > 0 && z[x + 1] > 0 && z[x - 1] > 0 ? 0.5F * (z[x + 1] - z[x - 1]) : 0.0F;
        p[6] = z[x] > 0 && za[x] > 0 && zb[x] > 0 ? 0.5F * (zb[x] - za[x]) : 0.0F;
      }
    }
    if (role != PyramidRole::Current) select(l, o, t);
  }

  void select(PyramidLevel& l, const PyramidOptions& o, const std::vector<float>& t) {
    constexpr int C = PyramidLevel::kChannels;
    const int w = l.intensity.width();
    const int h = l.intensity.height();
    const float gi = o.min_intensity_gradient * o.min_intensity_gradient;
    const float gz = o.min_depth_gradient * o.min_depth_gradient;
    edge_.clear();
    flat_.clear();
    for (int y = 2; y < h - 2; ++y) {
      for (int x = 2; x < w - 2; ++x) {
        const int index = y * w + x;
        const float* p = t.data() + static_cast<std::ptrdiff_t>(index) * C;
        if (!(p[4] > 0) || !(p[3] > 0)) continue;
        const bool edge = p[1] * p[1] + p[2] * p[2] >= gi || p[5] * p[5] + p[6] * p[6] >= gz;
        (edge ? edge_ : flat_).push_back(index);
      }
    }
    const auto most = static_cast<std::size_t>(o.max_pixels);
    const auto flat_most = static_cast<std::size_t>(o.flat_share * o.max_pixels);
    const std::size_t n_flat = std::min(flat_.size(), flat_most);
    const std::size_t n_edge = std::min(edge_.size(), most - n_flat);
    // every n-th pixel in reading order: even over the image, and the same in every run
    chosen_.resize(n_flat + n_edge);
    for (std::size_t i = 0; i < n_edge; ++i) chosen_[i] = edge_[i * edge_.size() / n_edge];
    for (std::size_t i = 0; i < n_flat; ++i) chosen_[n_edge + i] = flat_[i * flat_.size() / n_flat];
    std::sort(chosen_.begin(), chosen_.end());
    PixelList& out = l.pixels;
    out.resize(static_cast<int>(chosen_.size()));
    const auto fx = static_cast<float>(1.0 / l.camera.fx);
    const auto fy = static_cast<float>(1.0 / l.camera.fy);
    const auto cx = static_cast<float>(l.camera.cx);
    const auto cy = static_cast<float>(l.camera.cy);
    for (std::size_t i = 0; i < chosen_.size(); ++i) {
      const int index = chosen_[i];
      const float* p = t.data() + static_cast<std::ptrdiff_t>(index) * C;
      const float z = p[4];
      out.x[i] = (static_cast<float>(index % w) - cx) * fx * z;
      out.y[i] = (static_cast<float>(index / w) - cy) * fy * z;
      out.z[i] = z;
      out.intensity[i] = p[0];
      out.dx[i] = p[1];
      out.dy[i] = p[2];
      out.gamma[i] = p[3];
    }
    l.median_depth = 0;
    if (!chosen_.empty()) {
      line_.assign(out.z.begin(), out.z.begin() + out.count);
      const auto middle = line_.begin() + out.count / 2;
      std::nth_element(line_.begin(), middle, line_.end());
      l.median_depth = *middle;
    }
  }

  std::vector<PyramidLevel> levels_;
  PyramidLevel skipped_[2];
  Image<float> intensity_, depth_, gamma_;
  std::vector<float> line_, scratch_;
  std::vector<int> edge_, flat_, chosen_;
  double timestamp_ = 0;
  int finest_ = 0;
  bool masked_ = false;
};

APSO_NAMESPACE_END
