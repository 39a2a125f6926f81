/// \file
/// Which pixels of a reference are aligned.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/lanes/lane_functions.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>
#include <apso/refinement/pyramid/pixel_block.hpp>
#include <apso/refinement/pyramid/pixel_list.hpp>
#include <apso/refinement/pyramid/plane.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Standard deviation of the gradient of white noise of deviation 1 [1/px], within 15 %, `level` halvings by 1 3 3 1 from the
/// full size, and smoothed by 1 2 1 or not.
[[nodiscard]] inline float gradient_noise(int level, bool smoothed) { return (smoothed ? 0.3F : 0.55F) / static_cast<float>(1 << level); }

/// The images of which pixels are chosen.
struct SelectionSource {
  const Plane& intensity;  ///< as it is aligned
  const Plane& depth;
  const Plane& gamma;  ///< or empty: all weights are 1
  const Pinhole& camera;
  int halvings;   ///< from the full size
  bool smoothed;  ///< the intensity, by 1 2 1
};

/// Chooses pixels of a level. The image is cut into cells of b x b pixels, b as small as max_pixels allows, and each cell
/// gives the pixel that tells most about the motion: the choice is spread evenly, the same in every run, and leaves
/// bare surfaces in, since their depth still fixes three directions. Keeps its buffers.
class PixelSelector {
 public:
  /// Standard deviation of the intensity at full size: what is texture, what noise. Kinect, xtion: 3 to 4 grey values.
  static constexpr float kImageNoise = 4.0F / 255.0F;
  /// Depth gradient, as a share of the depth per pixel at full size, that is an edge: a surface seen at 88 degrees.
  static constexpr float kEdgeGradient = 0.05F;

  /// \param max_pixels 0 = all
  /// \param sensor_noise as a multiple of kImageNoise and of depth_sigma; 0: every gradient is one
  template <class Executor = SerialExecutor>
  void operator()(const SelectionSource& in, int max_pixels, float sensor_noise, PixelList& out, const Executor& executor = {}) {
    const Plane& intensity = in.intensity;
    const Plane& depth = in.depth;
    const Plane& gamma = in.gamma;
    const auto scale = static_cast<float>(1 << in.halvings);
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
    found_.resize(out.tiles.size() * per_tile + PixelList::kBlock);  // whole blocks are read
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
          if (b == 1) {  // a pixel is the best of its cell
            take_row(depth, gamma, y0, out.tile_side, tiles, found);
            continue;
          }
          float* top = top_.row(band);
          best_of_columns(intensity, depth, gamma, y0, std::min(y0 + b, h), b, top);
          for (int tx = 0; tx < out.columns; ++tx) {
            int* to = found + tx * side * side;
            for (int i = tx * side; i < (tx + 1) * side && i * b < w; ++i) {
              const int place = best_of_cell(top, w, b, y0, i);
              if (place >= 0) to[tiles[tx].count++] = place;
            }
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
    const BlockSource source{intensity,
                             depth,
                             gamma,
                             static_cast<float>(in.camera.fx),
                             static_cast<float>(in.camera.fy),
                             static_cast<float>(in.camera.cx),
                             static_cast<float>(in.camera.cy),
                             kEdgeGradient * scale};
    const float image_noise = kImageNoise * sensor_noise * gradient_noise(in.halvings, in.smoothed);
    const float slope_noise = sensor_noise * source.fx / scale;
    bands.run(executor, [&](int, int row0, int row1) {
      for (int k = row0 * out.columns; k < row1 * out.columns; ++k) {
        PixelList::Tile& tile = out.tiles[static_cast<std::size_t>(k)];
        const int* found = found_.data() + static_cast<std::ptrdiff_t>(k) * side * side;
        Lanes sum = 0.0F;
        in_widest_lanes([&](auto lanes) {
          for (int n = tile.begin; n < tile.end; ++n, found += PixelList::kBlock) {
            float* to = out.block(n);
            fill_block<lanes>(to, found, std::min(PixelList::kBlock, tile.count - (n - tile.begin) * PixelList::kBlock), source);
            for (int i = 0; i < PixelList::kBlock; i += kLanes) sum += Lanes::load(to + PixelList::kZ * PixelList::kBlock + i);
          }
        });
        tile.depth = tile.count > 0 ? sum.sum() / static_cast<float>(tile.count) : 0.0F;
        remove_noise_gradients(out, tile, b, image_noise, slope_noise, source.fx);
      }
    });
    out.compared = 0;
    for (const PixelList::Tile& tile : out.tiles) out.compared += tile.compared;
  }

 private:
  static constexpr int kBorder = BlockSource::kReach;  // pixels at the border are not chosen

  // The place of a pixel in its cell is kept in the last bits of its score, so that the best of a cell is a maximum of
  // floats. `column_` holds what each column adds, `place_` the pixel for each number; the first of equal ones wins.
  void prepare_cells(int w, int b) {
    place_.resize(static_cast<std::size_t>(b * b));
    for (int i = 0; i < b * b; ++i) place_[static_cast<std::size_t>(i)] = ((b - 1 - i / b) << 16) | (b - 1 - i % b);
    bits_ = 1;
    while (bits_ < b * b) bits_ *= 2;
    column_.resize(static_cast<std::size_t>(w + kWideLanes));
    for (int x = 0; x < w + kWideLanes; ++x) column_[static_cast<std::size_t>(x)] = b - 1 - x % b;
  }

  // All pixels of row y with depth and weight, but those at the border.
  static void take_row(const Plane& depth, const Plane& gamma, int y, int side, PixelList::Tile* tiles, int* found) {
    const int w = depth.width();
    if (y < kBorder || y >= depth.height() - kBorder) return;
    const float* Z = depth.row(y);
    const float* G = gamma.empty() ? Z : gamma.row(y);
    for (int x = kBorder; x < w - kBorder;) {
      const int tx = x / side;
      int* to = found + tx * side * side;
      int n = tiles[tx].count;
      for (const int end = std::min((tx + 1) * side, w - kBorder); x < end; ++x) {
        to[n] = (y << 16) | x;
        n += (Z[x] > 0 && G[x] > 0) ? 1 : 0;
      }
      tiles[tx].count = n;
    }
  }

  // The best score of each column of the rows [y0, y1), 0 where there is none.
  void best_of_columns(const Plane& intensity, const Plane& depth, const Plane& gamma, int y0, int y1, int b, float* top) const {
    in_widest_lanes([&](auto lanes) {
      using L = BasicLanes<lanes>;
      const int w = intensity.width();
      const int h = intensity.height();
      std::fill(top, top + w, 0.0F);
      const auto keep = all_lanes<lanes>(-bits_);  // bits_ is a power of 2: all but the last bits
      for (int y = std::max(y0, kBorder); y < std::min(y1, h - kBorder); ++y) {
        const float* I = intensity.row(y);
        const float* Ia = intensity.row(y - 1);
        const float* Ib = intensity.row(y + 1);
        const float* Z = depth.row(y);
        const float* Za = depth.row(y - 1);
        const float* Zb = depth.row(y + 1);
        const float* G = gamma.empty() ? nullptr : gamma.row(y);
        const auto row = all_lanes<lanes>((b - 1 - (y - y0)) * b);
        for (int x = 0; x < w; x += lanes) {
          const L gx = L::load(I + x + 1) - L::load(I + x - 1);
          const L gy = L::load(Ib + x) - L::load(Ia + x);
          const L z = L::load(Z + x);
          const L l = L::load(Z + x - 1);
          const L r = L::load(Z + x + 1);
          const L u = L::load(Za + x);
          const L d = L::load(Zb + x);
          const L low = min(min(l, r), min(u, d));
          const L spread = max(max(l, r), max(u, d)) - low;
          // a little above 0 for any pixel with depth, ten times that where the surface goes on to all sides
          const L score = gx * gx + gy * gy + select((low > L(0.0F)) & (spread < 0.05F * z), L(1e-3F), L(1e-4F));
          BasicIntLanes<lanes> column;
          std::memcpy(&column.v, column_.data() + x, sizeof column.v);
          auto ok = z > L(0.0F);
          if (G != nullptr) ok = ok & (L::load(G + x) > L(0.0F));
          const L key = select(ok, from_bits((bits(score) & keep) | (row + column)), 0.0F);
          max(key, L::load(top + x)).store(top + x);
        }
      }
      for (int x = 0; x < kBorder; ++x) top[x] = top[w - 1 - x] = 0.0F;
    });
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
