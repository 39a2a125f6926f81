/// \file
/// The pixels of a reference that are aligned: which are taken, and all about them that does not change while aligning.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/lanes.hpp>
#include <apso/refinement/pyramid/plane.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

/// Pixels in blocks of kBlock, a block holding one array per quantity: everything about a pixel lies close together, and
/// equal quantities of neighbours lie side by side. Blocks belong to square tiles of the image; the last block of a tile
/// is filled up with pixels of weight 0.
struct PixelList {
  static constexpr int kBlock = 16;
  enum Field {
    kX, kY, kZ,        ///< point in the camera of the reference [m]
    kIntensity,        ///< [0,1]
    kGradient2,        ///< |grad I|^2 [1/px^2], < 0: behind an edge or beside a hole, the intensity is not compared
    kDepthGradient2,   ///< |grad Z|^2 [m^2/px^2], < 0: on an edge or beside a hole, the depth is not compared
    kGamma,            ///< weight [0,1]
    kI0, kI1, kI2,     ///< J_pi^T grad I [1/m]: the photometric row of the Jacobian is (a, X x a)
    kD0, kD1, kD2,     ///< J_pi^T grad Z - e_z: the same of the depth
    kFields
  };
  struct Tile {
    int begin = 0;  ///< first block
    int end = 0;    ///< one past the last block
    int count = 0;  ///< pixels
    float depth = 0;  ///< mean of the pixels [m]
  };
  std::vector<float> data;
  std::vector<Tile> tiles;  ///< row by row
  int columns = 0;          ///< tiles side by side
  int rows = 0;
  int tile_side = 0;        ///< [px]
  int count = 0;            ///< pixels in all tiles

  [[nodiscard]] int blocks() const { return tiles.empty() ? 0 : tiles.back().end; }
  [[nodiscard]] float* block(int i) { return data.data() + static_cast<std::ptrdiff_t>(i) * kFields * kBlock; }
  [[nodiscard]] const float* block(int i) const { return data.data() + static_cast<std::ptrdiff_t>(i) * kFields * kBlock; }
  /// One quantity of one pixel of a block.
  [[nodiscard]] float at(int block_index, Field f, int i) const { return block(block_index)[f * kBlock + i]; }
};

struct SelectionOptions {
  int max_pixels = 20000;        ///< at the finest level; 0 = all. Four times as many at the level more of a masked frame
  int max_coarse_pixels = 5000;   ///< at each coarser level; 0 = all
  float edge_gradient = 0.05F;   ///< depth gradient, as a share of the depth per pixel at full size, that is an edge
  float image_noise = 4.0F / 255.0F;  ///< standard deviation of the intensity at full size: what is texture, what noise
  float depth_noise = 1;         ///< noise of the depth, as a multiple of depth_sigma: what is slope, what noise
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("max_pixels", s.max_pixels, 0, 100000000);
    v("max_coarse_pixels", s.max_coarse_pixels, 0, 100000000);
    v("edge_gradient", s.edge_gradient, 1e-4F, 100.0F);
    v("image_noise", s.image_noise, 0.0F, 1.0F);
    v("depth_noise", s.depth_noise, 0.0F, 1000.0F);
  }
};

/// Standard deviation of the gradient of white noise of deviation 1 [1/px], within 15 %, `level` halvings by 1 3 3 1 from the
/// full size, and smoothed by 1 2 1 or not.
[[nodiscard]] inline float gradient_noise(int level, bool smoothed) {
  return (smoothed ? 0.3F : 0.55F) / static_cast<float>(1 << level);
}

/// Chooses pixels of a level. The image is cut into cells of b x b pixels, b as small as max_pixels allows, and each cell
/// gives the pixel that tells most about the motion: the choice is spread evenly, the same in every run, and leaves
/// bare surfaces in, since their depth still fixes three directions.
class PixelSelector {
 public:
  /// \param gamma weights, or empty: all `background`
  /// \param level halvings from the full size
  /// \param noise standard deviation of the gradient where nothing is to be seen [1/px], as a multiple of image_noise
  template <class Executor = SerialExecutor>
  void operator()(const Plane& intensity, const Plane& depth, const Plane& gamma, float background, const Pinhole& camera,
                  int level, float noise, int max_pixels, const SelectionOptions& options, PixelList& out,
                  const Executor& executor = {}) {
    const int w = intensity.width();
    const int h = intensity.height();
    int b = 1;
    while (max_pixels > 0 && (w / b) * (h / b) > max_pixels) ++b;
    out.tile_side = (std::max(4, (w + 19) / 20) + b - 1) / b * b;
    out.columns = (w + out.tile_side - 1) / out.tile_side;
    out.rows = (h + out.tile_side - 1) / out.tile_side;
    const int side = out.tile_side / b;  // cells
    const auto per_tile = static_cast<std::size_t>(side * side);
    out.tiles.resize(static_cast<std::size_t>(out.columns) * static_cast<std::size_t>(out.rows));
    found_.resize(out.tiles.size() * per_tile);
    prepare_cells(w, b);
    const Bands bands(out.rows, out.tile_side * w, 512);
    top_.resize(w, bands.count());
    bands.run(executor, [&](int band, int row0, int row1) {
      for (int ty = row0; ty < row1; ++ty) {
        PixelList::Tile* tiles = out.tiles.data() + static_cast<std::ptrdiff_t>(ty) * out.columns;
        int* found = found_.data() + static_cast<std::ptrdiff_t>(ty) * out.columns * side * side;
        for (int tx = 0; tx < out.columns; ++tx) tiles[tx].count = 0;
        const int y_end = std::min(h, (ty + 1) * out.tile_side);
        for (int y0 = ty * out.tile_side; y0 < y_end; y0 += b) {
          float* top = top_.row(band);
          choose(intensity, depth, gamma, y0, std::min(y0 + b, h), b, top);
          for (int i = 0; i * b < w; ++i) {
            const int place = best_of_cell(top, w, b, y0, i);
            if (place >= 0) found[i / side * side * side + tiles[i / side].count++] = place;
          }
        }
      }
    });
    out.count = 0;
    int block = 0;
    for (PixelList::Tile& tile : out.tiles) {
      tile.begin = block;
      tile.end = block += (tile.count + PixelList::kBlock - 1) / PixelList::kBlock;
      out.count += tile.count;
    }
    // at most this many blocks; of one size, so that later calls allocate nothing
    const std::size_t blocks = out.tiles.size() * ((per_tile + PixelList::kBlock - 1) / PixelList::kBlock);
    out.data.resize(blocks * PixelList::kFields * PixelList::kBlock);
    const Images view{intensity,
                      depth,
                      gamma,
                      background,
                      static_cast<float>(camera.fx),
                      static_cast<float>(camera.fy),
                      static_cast<float>(camera.cx),
                      static_cast<float>(camera.cy),
                      options.edge_gradient * static_cast<float>(1 << level)};
    bands.run(executor, [&](int, int row0, int row1) {
      for (int k = row0 * out.columns; k < row1 * out.columns; ++k) {
        PixelList::Tile& tile = out.tiles[static_cast<std::size_t>(k)];
        const int* found = found_.data() + static_cast<std::ptrdiff_t>(k) * side * side;
        Lanes sum = 0.0F;
        for (int n = tile.begin; n < tile.end; ++n, found += PixelList::kBlock) {
          float* to = out.block(n);
          fill(to, found, std::min(PixelList::kBlock, tile.count - (n - tile.begin) * PixelList::kBlock), view);
          for (int i = 0; i < PixelList::kBlock; i += kLanes) sum += Lanes::load(to + PixelList::kZ * PixelList::kBlock + i);
        }
        tile.depth = tile.count > 0 ? sum.sum() / static_cast<float>(tile.count) : 0.0F;
        drop_noise(out, tile, b, options.image_noise * noise, options.depth_noise * view.fx / static_cast<float>(1 << level),
                   view.fx);
      }
    });
  }

 private:
  struct Images {
    const Plane& intensity;
    const Plane& depth;
    const Plane& gamma;  // or empty
    float background;
    float fx, fy, cx, cy;
    float edge;  // depth gradient that is an edge, as a share of the depth
  };

  // All quantities of the pixels found[0 .. n), n <= kBlock; the rest of the block becomes 0.
  static void fill(float* block, const int* found, int n, const Images& in) {
    using P = PixelList;
    enum { kPx, kPy, kI, kIl, kIr, kIu, kId, kDepth, kZl, kZr, kZu, kZd, kNear, kG, kRaw };
    float raw[kRaw * P::kBlock] = {};
    for (int i = 0; i < n; ++i) {
      const int x = found[i] & 0xFFFF;
      const int y = found[i] >> 16;
      const float* I = in.intensity.row(y) + x;
      const float* Z = in.depth.row(y) + x;
      const auto set = [&](int f, float v) { raw[f * P::kBlock + i] = v; };
      set(kPx, static_cast<float>(x));
      set(kPy, static_cast<float>(y));
      set(kI, *I);
      set(kIl, I[-1]);
      set(kIr, I[1]);
      set(kIu, in.intensity.row(y - 1)[x]);
      set(kId, in.intensity.row(y + 1)[x]);
      set(kDepth, *Z);
      set(kZl, Z[-1]);
      set(kZr, Z[1]);
      set(kZu, in.depth.row(y - 1)[x]);
      set(kZd, in.depth.row(y + 1)[x]);
      set(kNear, std::min(std::min(Z[-2], Z[2]), std::min(in.depth.row(y - 2)[x], in.depth.row(y + 2)[x])));
      set(kG, in.gamma.empty() ? in.background : in.gamma.row(y)[x]);
    }
    const Lanes zero = 0.0F;
    for (int at = 0; at < P::kBlock; at += kLanes) {
      const auto get = [&](int f) { return Lanes::load(raw + f * P::kBlock + at); };
      const auto put = [&](P::Field f, const Lanes& v) { v.store(block + f * P::kBlock + at); };
      const Lanes z = get(kDepth);
      const Lanes iz = 1.0F / select(z > zero, z, 1.0F);
      const Lanes X = (get(kPx) - in.cx) * (1.0F / in.fx) * z;
      const Lanes Y = (get(kPy) - in.cy) * (1.0F / in.fy) * z;
      const Lanes gx = 0.5F * (get(kIr) - get(kIl));
      const Lanes gy = 0.5F * (get(kId) - get(kIu));
      put(P::kX, X);
      put(P::kY, Y);
      put(P::kZ, z);
      put(P::kIntensity, get(kI));
      put(P::kGamma, get(kG));
      const Lanes l = get(kZl), r = get(kZr), u = get(kZu), d = get(kZd);
      const Lanes low = min(min(l, r), min(u, d));
      const Mask own = min(low, get(kNear)) > z * (1.0F - in.edge);
      put(P::kGradient2, select(own, gx * gx + gy * gy, select(z > zero, -1.0F, zero)));
      const Lanes a0 = select(own, gx * in.fx * iz, zero);
      const Lanes a1 = select(own, gy * in.fy * iz, zero);
      put(P::kI0, a0);
      put(P::kI1, a1);
      put(P::kI2, zero - (a0 * X + a1 * Y) * iz);
      const Lanes zx = 0.5F * (r - l);
      const Lanes zy = 0.5F * (d - u);
      const Lanes g2 = zx * zx + zy * zy;
      const Mask smooth = (low > zero) & (g2 < in.edge * in.edge * z * z);
      const Lanes d0 = select(smooth, zx * in.fx * iz, zero);
      const Lanes d1 = select(smooth, zy * in.fy * iz, zero);
      put(P::kDepthGradient2, select(smooth, g2, select(z > zero, -1.0F, zero)));
      put(P::kD0, d0);
      put(P::kD1, d1);
      put(P::kD2, select(smooth, zero - (d0 * X + d1 * Y) * iz - 1.0F, zero));
    }
  }

  // Gradients of mere noise would make a bare wall look as if it fixed the motion along it. A tile without texture gets no
  // photometric rows; a tile that is plane within the noise gets the slope of the plane.
  static void drop_noise(PixelList& list, const PixelList::Tile& tile, int b, float noise, float slope, float fx) {
    using P = PixelList;
    float largest = 0;  // of b^2 exponentials: 1 + 1/2 + ... 1/b^2
    for (int i = 1; i <= b * b; ++i) largest += 1.0F / static_cast<float>(i);
    const Lanes zero = 0.0F;
    Lanes gradients = zero, count = zero, sum0 = zero, sum1 = zero, squares = zero, noises = zero;
    for (int k = tile.begin; k < tile.end; ++k) {
      const float* p = list.block(k);
      for (int i = 0; i < P::kBlock; i += kLanes) {
        const auto get = [&](P::Field f) { return Lanes::load(p + f * P::kBlock + i); };
        gradients += max(get(P::kGradient2), zero);
        const Mask ok = (get(P::kGamma) > zero) & (get(P::kDepthGradient2) >= zero);
        const Lanes d0 = get(P::kD0);  // 0 unless ok
        const Lanes d1 = get(P::kD1);
        const Lanes z = get(P::kZ);
        const Lanes slope_noise = select(ok, slope * max(kDepthNoise * z * z, kDepthNoiseFloor) / select(ok, z, 1.0F), zero);
        count += select(ok, 1.0F, zero);
        sum0 += select(ok, d0, zero);
        sum1 += select(ok, d1, zero);
        squares += select(ok, d0 * d0 + d1 * d1, zero);
        noises += slope_noise * slope_noise;
      }
    }
    const float gradient2 = gradients.sum(), n = count.sum(), s0 = sum0.sum(), s1 = sum1.sum(), s2 = squares.sum();
    const float expected = noises.sum();
    const bool bare = gradient2 < 1.5F * largest * noise * noise * static_cast<float>(tile.count);
    float m0 = n > 0 ? s0 / n : 0.0F;
    float m1 = n > 0 ? s1 / n : 0.0F;
    const bool plane = n >= 8 && s2 - n * (m0 * m0 + m1 * m1) < 3 * expected;
    // a slope within the noise of the mean is none: many tiles with such slopes would look like a surface
    const float squared = m0 * m0 + m1 * m1;
    const float shrink = squared > 0 && n > 0 ? std::max(0.0F, 1.0F - 4.0F * expected / (n * n * squared)) : 0.0F;
    m0 *= shrink;
    m1 *= shrink;
    if (!bare && !plane) return;
    for (int k = tile.begin; k < tile.end; ++k) {
      float* p = list.block(k);
      for (int i = 0; i < P::kBlock; ++i) {
        if (bare) p[P::kI0 * P::kBlock + i] = p[P::kI1 * P::kBlock + i] = p[P::kI2 * P::kBlock + i] = 0.0F;
        if (!plane || !(p[P::kGamma * P::kBlock + i] > 0) || p[P::kDepthGradient2 * P::kBlock + i] < 0) continue;
        const float z = p[P::kZ * P::kBlock + i];
        p[P::kD0 * P::kBlock + i] = m0;
        p[P::kD1 * P::kBlock + i] = m1;
        p[P::kD2 * P::kBlock + i] = -(m0 * p[P::kX * P::kBlock + i] + m1 * p[P::kY * P::kBlock + i]) / z - 1.0F;
        p[P::kDepthGradient2 * P::kBlock + i] = (m0 * m0 + m1 * m1) * z * z / (fx * fx);
      }
    }
  }

  // The place of a pixel in its cell is kept in the last bits of its score, so that the best of a cell is a maximum of
  // floats. `column_` holds what each column adds, `place_` the pixel for each number; the first of equal ones wins.
  void prepare_cells(int w, int b) {
    place_.resize(static_cast<std::size_t>(b * b));
    for (int i = 0; i < b * b; ++i) place_[static_cast<std::size_t>(i)] = ((b - 1 - i / b) << 16) | (b - 1 - i % b);
    bits_ = 1;
    while (bits_ < b * b) bits_ *= 2;
    column_.resize(static_cast<std::size_t>(w + kLanes));
    for (int x = 0; x < w + kLanes; ++x) column_[static_cast<std::size_t>(x)] = b - 1 - x % b;
  }

  // The best score of each column of the rows [y0, y1), 0 where there is none.
  void choose(const Plane& intensity, const Plane& depth, const Plane& gamma, int y0, int y1, int b, float* top) const {
    const int w = intensity.width();
    const int h = intensity.height();
    std::fill(top, top + w, 0.0F);
    const auto all = [](std::int32_t v) {
      std::int32_t each[kLanes];
      std::fill(each, each + kLanes, v);
      IntLanes n;
      std::memcpy(&n.v, each, sizeof n.v);
      return n;
    };
    const IntLanes keep = all(-bits_);  // bits_ is a power of 2: all but the last bits
    for (int y = std::max(y0, 2); y < std::min(y1, h - 2); ++y) {
      const float* I = intensity.row(y);
      const float* Ia = intensity.row(y - 1);
      const float* Ib = intensity.row(y + 1);
      const float* Z = depth.row(y);
      const float* Za = depth.row(y - 1);
      const float* Zb = depth.row(y + 1);
      const float* G = gamma.empty() ? nullptr : gamma.row(y);
      const IntLanes row = all((b - 1 - (y - y0)) * b);
      for (int x = 0; x < w; x += kLanes) {
        const Lanes gx = Lanes::load(I + x + 1) - Lanes::load(I + x - 1);
        const Lanes gy = Lanes::load(Ib + x) - Lanes::load(Ia + x);
        const Lanes z = Lanes::load(Z + x);
        const Lanes l = Lanes::load(Z + x - 1);
        const Lanes r = Lanes::load(Z + x + 1);
        const Lanes u = Lanes::load(Za + x);
        const Lanes d = Lanes::load(Zb + x);
        const Lanes low = min(min(l, r), min(u, d));
        const Lanes spread = max(max(l, r), max(u, d)) - low;
        // a little above 0 for any pixel with depth, ten times that where the surface goes on to all sides
        const Lanes score =
            gx * gx + gy * gy + select((low > Lanes(0.0F)) & (spread < 0.05F * z), Lanes(1e-3F), Lanes(1e-4F));
        IntLanes column;
        std::memcpy(&column.v, column_.data() + x, sizeof column.v);
        Mask ok = z > Lanes(0.0F);
        if (G != nullptr) ok = ok & (Lanes::load(G + x) > Lanes(0.0F));
        const Lanes key = select(ok, from_bits((bits(score) & keep) | (row + column)), 0.0F);
        max(key, Lanes::load(top + x)).store(top + x);
      }
    }
    top[0] = top[1] = top[w - 2] = top[w - 1] = 0.0F;
  }
  // The pixel (y << 16 | x) with the best score in cell i, -1 if there is none.
  [[nodiscard]] int best_of_cell(const float* top, int w, int b, int y0, int i) const {
    float key = 0;
    for (int x = i * b; x < std::min((i + 1) * b, w); ++x) key = std::max(key, top[x]);
    if (!(key > 0)) return -1;
    std::int32_t number;
    std::memcpy(&number, &key, sizeof number);
    return ((y0 << 16) | (i * b)) + place_[static_cast<std::size_t>(number & (bits_ - 1))];
  }

  Plane top_;  // a row for each band
  std::vector<std::int32_t> place_, column_;
  int bits_ = 1;
  std::vector<int> found_;  // by tile
};

APSO_NAMESPACE_END
