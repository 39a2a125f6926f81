/// \file
/// The pixels of a reference that are aligned, and all about them that does not change while aligning.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// Pixels in blocks of kBlock, a block holding one array per quantity: everything about a pixel lies close together, and
/// equal quantities of neighbours lie side by side. Blocks belong to square tiles of the image; the last block of a tile
/// is filled up with pixels of weight 0.
struct PixelList {
  static constexpr int kBlock = 16;
  enum Field {
    kX,
    kY,
    kZ,               ///< point in the camera of the reference [m]
    kIntensity,       ///< [0,1]
    kGradient2,       ///< |grad I|^2 [1/px^2], < 0: behind an edge or beside a hole, the intensity is not compared
    kDepthGradient2,  ///< |grad Z|^2 [m^2/px^2], < 0: on an edge or beside a hole, the depth is not compared
    kGamma,           ///< weight [0,1]
    kI0,
    kI1,
    kI2,  ///< J_pi^T grad I [1/m]: the photometric row of the Jacobian is (a, X x a)
    kD0,
    kD1,
    kD2,  ///< J_pi^T grad Z - e_z: the same of the depth
    kFields
  };
  struct Tile {
    int begin = 0;     ///< first block
    int end = 0;       ///< one past the last block
    int count = 0;     ///< pixels
    float depth = 0;   ///< mean of the pixels [m]
    int compared = 0;  ///< pixels whose intensity is compared
  };
  std::vector<float> data;
  std::vector<Tile> tiles;  ///< row by row
  int columns = 0;          ///< tiles side by side
  int rows = 0;
  int tile_side = 0;  ///< [px]
  int count = 0;      ///< pixels in all tiles
  int compared = 0;   ///< those whose intensity is compared: not behind an edge or beside a hole

  [[nodiscard]] int blocks() const { return tiles.empty() ? 0 : tiles.back().end; }
  [[nodiscard]] float* block(int i) { return data.data() + static_cast<std::ptrdiff_t>(i) * kFields * kBlock; }
  [[nodiscard]] const float* block(int i) const { return data.data() + static_cast<std::ptrdiff_t>(i) * kFields * kBlock; }
  /// Has a block some blocks further on brought near: processors do that by themselves within a page of memory only.
  static void prefetch([[maybe_unused]] const float* block) {
#if defined(__GNUC__)
    constexpr std::uintptr_t kAhead = 5, kLine = 64, kBytes = kFields * kBlock * sizeof(float);
    const auto there = reinterpret_cast<std::uintptr_t>(block) + kAhead * kBytes;  // maybe beyond the end, which does no harm
    for (std::uintptr_t line = 0; line < kBytes; line += kLine) __builtin_prefetch(reinterpret_cast<const void*>(there + line));
#endif
  }
  /// One quantity of one pixel of a block.
  [[nodiscard]] float at(int block_index, Field f, int i) const { return block(block_index)[f * kBlock + i]; }
};
APSO_NAMESPACE_END
