/// \file
/// The pixels of a reference that are aligned: which are taken, and all about them that does not change while aligning.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/lanes.hpp>
#include <apso/refinement/plane.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/rgbd_frame.hpp>

APSO_NAMESPACE_BEGIN

/// Pixels in blocks of kBlock, a block holding one array per quantity: everything about a pixel lies close together, and
/// equal quantities of neighbours lie side by side. Blocks belong to square tiles of the image; the last block of a tile
/// is filled up with pixels of weight 0.
struct PixelList {
  static constexpr int kBlock = 16;
  enum Field {
    kX, kY, kZ,        ///< point in the camera of the reference [m]
    kIntensity,        ///< [0,1]
    kGradient2,        ///< |grad I|^2 [1/px^2]
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
  int max_pixels = 20000;        ///< at the finest level; 0 = all
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

/// Chooses pixels of a level. The image is cut into cells of b x b pixels, b as small as max_pixels allows, and each cell
/// gives the pixel that tells most about the motion: the choice is spread evenly, the same in every run, and leaves
/// bare surfaces in, since their depth still fixes three directions.
class PixelSelector {
 public:
  /// \param gamma weights, or empty: all `background`
  /// \param level halvings from the full size
  void operator()(const Plane& intensity, const Plane& depth, const Plane& gamma, float background, const Pinhole& camera,
                  int level, int max_pixels, const SelectionOptions& options, PixelList& out) {
    const int w = intensity.width();
    const int h = intensity.height();
    int b = 1;
    while (max_pixels > 0 && (w / b) * (h / b) > max_pixels) ++b;
    out.tile_side = (std::max(4, (w + 19) / 20) + b - 1) / b * b;
    out.columns = (w + out.tile_side - 1) / out.tile_side;
    out.rows = (h + out.tile_side - 1) / out.tile_side;
    best_.resize(static_cast<std::size_t>(out.columns) * static_cast<std::size_t>(out.tile_side / b));
    out.tiles.clear();
    out.count = 0;
    // at most this many blocks; resized once, so that later calls of the same size allocate nothing
    const int side = out.tile_side / b;
    const int per_tile = (side * side + PixelList::kBlock - 1) / PixelList::kBlock;
    out.data.resize(static_cast<std::size_t>(out.columns * out.rows * per_tile) * PixelList::kFields * PixelList::kBlock);
    const float edge = options.edge_gradient * static_cast<float>(1 << level);
    const auto fx = static_cast<float>(camera.fx);
    const auto fy = static_cast<float>(camera.fy);
    const float ifx = 1.0F / fx;
    const float ify = 1.0F / fy;
    const auto cx = static_cast<float>(camera.cx);
    const auto cy = static_cast<float>(camera.cy);
    found_.resize(static_cast<std::size_t>(out.columns) * static_cast<std::size_t>(side * side));
    counts_.resize(static_cast<std::size_t>(out.columns));
    int block = 0;
    for (int ty = 0; ty < out.rows; ++ty) {
      std::fill(counts_.begin(), counts_.end(), 0);
      const int y_end = std::min(h, (ty + 1) * out.tile_side);
      for (int y0 = ty * out.tile_side; y0 < y_end; y0 += b) {
        choose(intensity, depth, gamma, y0, std::min(y0 + b, h), b);
        for (int i = 0; i * b < w; ++i) {
          const int index = best_[static_cast<std::size_t>(i)];
          if (index < 0) continue;
          const auto tx = static_cast<std::size_t>(i / side);
          found_[tx * static_cast<std::size_t>(side * side) + static_cast<std::size_t>(counts_[tx]++)] = index;
        }
      }
      for (int tx = 0; tx < out.columns; ++tx) {
        const int* found = found_.data() + static_cast<std::ptrdiff_t>(tx) * side * side;
        PixelList::Tile tile;
        tile.count = counts_[static_cast<std::size_t>(tx)];
        tile.begin = block;
        for (int at = 0; at < tile.count; at += PixelList::kBlock, ++block) {
          float* p = out.block(block);
          const int n = std::min(PixelList::kBlock, tile.count - at);
          for (int i = 0; i < n; ++i) {
            const int x = found[at + i] & 0xFFFF;
            const int y = found[at + i] >> 16;
            const float* I = intensity.row(y) + x;
            const float* Z = depth.row(y) + x;
            const float* above = depth.row(y - 1) + x;
            const float* below = depth.row(y + 1) + x;
            const float gx = 0.5F * (I[1] - I[-1]);
            const float gy = 0.5F * (intensity.row(y + 1)[x] - intensity.row(y - 1)[x]);
            const float z = *Z;
            const auto set = [&](PixelList::Field f, float v) { p[f * PixelList::kBlock + i] = v; };
            const float X = (static_cast<float>(x) - cx) * ifx * z;
            const float Y = (static_cast<float>(y) - cy) * ify * z;
            const float iz = 1.0F / z;
            set(PixelList::kX, X);
            set(PixelList::kY, Y);
            set(PixelList::kZ, z);
            set(PixelList::kIntensity, *I);
            set(PixelList::kGradient2, gx * gx + gy * gy);
            set(PixelList::kGamma, gamma.empty() ? background : gamma.row(y)[x]);
            const float a0 = gx * fx * iz;
            const float a1 = gy * fy * iz;
            set(PixelList::kI0, a0);
            set(PixelList::kI1, a1);
            set(PixelList::kI2, -(a0 * X + a1 * Y) * iz);
            const bool whole = Z[1] > 0 && Z[-1] > 0 && *above > 0 && *below > 0;
            const float zx = whole ? 0.5F * (Z[1] - Z[-1]) : 0.0F;
            const float zy = whole ? 0.5F * (*below - *above) : 0.0F;
            const bool smooth = whole && zx * zx + zy * zy < edge * edge * z * z;
            const float d0 = zx * fx * iz;
            const float d1 = zy * fy * iz;
            set(PixelList::kDepthGradient2, smooth ? zx * zx + zy * zy : -1.0F);
            set(PixelList::kD0, smooth ? d0 : 0.0F);
            set(PixelList::kD1, smooth ? d1 : 0.0F);
            set(PixelList::kD2, smooth ? -(d0 * X + d1 * Y) * iz - 1.0F : 0.0F);
          }
          for (int f = 0; f < PixelList::kFields; ++f) {
            std::fill(p + f * PixelList::kBlock + n, p + (f + 1) * PixelList::kBlock, 0.0F);
          }
        }
        tile.end = block;
        float sum = 0;
        for (int k = tile.begin; k < tile.end; ++k) {
          for (int i = 0; i < PixelList::kBlock; ++i) sum += out.at(k, PixelList::kZ, i);
        }
        tile.depth = tile.count > 0 ? sum / static_cast<float>(tile.count) : 0.0F;
        drop_noise(out, tile, b, level, fx, options);
        out.tiles.push_back(tile);
        out.count += tile.count;
      }
    }
  }

 private:
  // Gradients of mere noise would make a bare wall look as if it fixed the motion along it. A tile without texture gets no
  // photometric rows; a tile that is plane within the noise gets the slope of the plane.
  static void drop_noise(PixelList& list, const PixelList::Tile& tile, int b, int level, float fx,
                         const SelectionOptions& options) {
    using P = PixelList;
    // 1 3 3 1 leaves 0.3125 of the noise at each halving; the largest of b^2 exponentials is 1 + 1/2 + ... 1/b^2
    const float noise = options.image_noise * std::pow(0.3125F, static_cast<float>(level));
    float largest = 0;
    for (int i = 1; i <= b * b; ++i) largest += 1.0F / static_cast<float>(i);
    float gradient2 = 0;
    float n = 0, s0 = 0, s1 = 0, s2 = 0, expected = 0;
    for (int k = tile.begin; k < tile.end; ++k) {
      const float* p = list.block(k);
      for (int i = 0; i < P::kBlock; ++i) {
        gradient2 += p[P::kGradient2 * P::kBlock + i];
        if (!(p[P::kGamma * P::kBlock + i] > 0) || p[P::kDepthGradient2 * P::kBlock + i] < 0) continue;
        const float d0 = p[P::kD0 * P::kBlock + i];
        const float d1 = p[P::kD1 * P::kBlock + i];
        const float z = p[P::kZ * P::kBlock + i];
        const float slope_noise = options.depth_noise * depth_sigma(z) * fx / (z * static_cast<float>(1 << level));
        n += 1;
        s0 += d0;
        s1 += d1;
        s2 += d0 * d0 + d1 * d1;
        expected += slope_noise * slope_noise;
      }
    }
    const bool bare = gradient2 < 1.5F * largest * noise * noise * static_cast<float>(tile.count);
    const float m0 = n > 0 ? s0 / n : 0.0F;
    const float m1 = n > 0 ? s1 / n : 0.0F;
    const bool plane = n >= 8 && s2 - n * (m0 * m0 + m1 * m1) < 3 * expected;
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

  // Best pixel of each cell of the rows [y0, y1), -1 where there is none.
  void choose(const Plane& intensity, const Plane& depth, const Plane& gamma, int y0, int y1, int b) {
    const int w = intensity.width();
    const int h = intensity.height();
    const int cells = (w + b - 1) / b;
    score_.resize(w, 1);
    top_.assign(static_cast<std::size_t>(cells), 0.0F);
    std::fill(best_.begin(), best_.end(), -1);
    for (int y = std::max(y0, 2); y < std::min(y1, h - 2); ++y) {
      const float* I = intensity.row(y);
      const float* Ia = intensity.row(y - 1);
      const float* Ib = intensity.row(y + 1);
      const float* Z = depth.row(y);
      const float* Za = depth.row(y - 1);
      const float* Zb = depth.row(y + 1);
      float* s = score_.row(0);
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
        Lanes score = gx * gx + gy * gy + select((low > Lanes(0.0F)) & (spread < 0.05F * z), Lanes(1e-3F), Lanes(1e-4F));
        score = select(z > Lanes(0.0F), score, 0.0F);
        if (!gamma.empty()) score = select(Lanes::load(gamma.row(y) + x) > Lanes(0.0F), score, 0.0F);
        score.store(s + x);
      }
      for (int i = 0, x = 0; i < cells; ++i) {
        for (const int end = std::min(x + b, w); x < end; ++x) {
          if (s[x] > top_[static_cast<std::size_t>(i)] && x >= 2 && x < w - 2) {
            top_[static_cast<std::size_t>(i)] = s[x];
            best_[static_cast<std::size_t>(i)] = (y << 16) | x;
          }
        }
      }
    }
  }

  Plane score_;
  std::vector<float> top_;
  std::vector<int> best_, found_, counts_;
};

APSO_NAMESPACE_END
