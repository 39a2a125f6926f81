/// \file
/// One resolution of a frame, and how its parts are made.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/lanes/lane_memory.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>
#include <apso/refinement/pyramid/pixel_list.hpp>
#include <apso/refinement/pyramid/plane.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// One resolution of a frame.
struct PyramidLevel {
  Pinhole camera;
  Plane intensity;             ///< [0,1]
  Plane depth;                 ///< [m], 0 = invalid
  Plane gamma;                 ///< weight [0,1]; empty when all pixels are static
  std::vector<float> texture;  ///< intensity and depth of each pixel side by side, as they are looked up together;
                               ///< intensity smoothed at the finest levels; empty unless prepared as current
  PixelList pixels;            ///< of the same images; empty unless prepared as reference
  float median_depth = 0;      ///< of the selected pixels [m]
};

/// Rows [y0, y1) of intensity and depth side by side.
inline void interleave(const Plane& intensity, const Plane& depth, std::vector<float>& texture, int y0, int y1) {
  in_widest_lanes([&](auto lanes) {
    using L = BasicLanes<lanes>;
    const int w = intensity.width();
    for (int y = y0; y < y1; ++y) {
      const float* i = intensity.row(y);
      const float* z = depth.row(y);
      float* t = texture.data() + 2 * static_cast<std::ptrdiff_t>(y) * w;
      int x = 0;
      for (; x + lanes <= w; x += lanes) store_pairs(L::load(i + x), L::load(z + x), t + 2 * x);
      for (; x < w; ++x) {  // rows follow each other without a gap
        t[2 * x] = i[x];
        t[2 * x + 1] = z[x];
      }
    }
  });
}

/// Median of about a thousand of the depths [m]; 0 if there are none.
/// \param sample scratch
[[nodiscard]] inline float median_depth(const PixelList& pixels, std::vector<float>& sample) {
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

APSO_NAMESPACE_END
