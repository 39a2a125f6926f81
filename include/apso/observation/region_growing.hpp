/// \file
/// From scattered evidence to regions: growing over connected depth, small regions removed, holes of the depth
/// sensor filled.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/config.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// True when two neighbouring pixels lie on one surface: the step between them is small against their depth.
[[nodiscard]] inline bool depth_connected(float a, float b) {
  const float z = std::min(a, b);
  return z > 0 && std::abs(a - b) <= std::max(0.03F, 0.02F * z) + 2.0F * depth_sigma(z);
}

/// Buffers of the region functions, to keep warm calls free of allocations.
struct RegionScratch {
  std::vector<int> queue;
  Image<int> label;
  Image<float> origin;
  Image<std::uint8_t> distance;
};

/// Spreads from the pixels in `scratch.queue` to 4-neighbours that are connected to them in depth: breadth first, so that a
/// pixel goes with the seed that is nearest along its surface. The seeds have their depth in `origin` and 0 in `distance`.
/// \param reach      largest number of steps [px], < 255
/// \param depth_span largest difference to the depth of the seed [m]
/// \param open       open(j): pixel j may still be taken
/// \param take       take(j, i): pixel j is taken, coming from pixel i
template <class Open, class Take>
void spread_along_surfaces(const Image<float>& depth, int reach, float depth_span, RegionScratch& scratch, Open&& open, Take&& take) {
  const int w = depth.width();
  const int h = depth.height();
  auto& queue = scratch.queue;
  for (std::size_t k = 0; k < queue.size(); ++k) {
    const int i = queue[k];
    const int x = i % w;
    const int y = i / w;
    const int step = scratch.distance.data()[i] + 1;
    if (step > reach || step >= 255) continue;
    const float z = depth.data()[i];
    const float z0 = scratch.origin.data()[i];
    const auto visit = [&](int j) {
      const float zj = depth.data()[j];
      if (!open(j) || !depth_connected(z, zj) || std::abs(zj - z0) > depth_span) return;
      take(j, i);
      scratch.origin.data()[j] = z0;
      scratch.distance.data()[j] = static_cast<std::uint8_t>(step);
      queue.push_back(j);
    };
    if (x > 0) visit(i - 1);
    if (x + 1 < w) visit(i + 1);
    if (y > 0) visit(i - w);
    if (y + 1 < h) visit(i + w);
  }
}

/// Spreads `mask` over pixels that `may_join` and are connected to it in depth.
/// \param reach largest number of steps [px], < 255
/// \param depth_span largest difference to the depth of the pixel the growth started from [m]
inline void grow_region(const Image<float>& depth, const Image<std::uint8_t>& may_join, int reach, float depth_span,
                        Image<std::uint8_t>& mask, RegionScratch& scratch) {
  const int w = depth.width();
  const int h = depth.height();
  auto& queue = scratch.queue;
  queue.clear();
  scratch.origin.resize(w, h);
  scratch.distance.resize(w, h);
  for (int i = 0; i < static_cast<int>(mask.size()); ++i) {
    if (mask.data()[i] == 0) continue;
    queue.push_back(i);
    scratch.origin.data()[i] = depth.data()[i];
    scratch.distance.data()[i] = 0;
  }
  spread_along_surfaces(
      depth, reach, depth_span, scratch, [&](int j) { return mask.data()[j] == 0 && may_join.data()[j] != 0; },
      [&](int j, int) { mask.data()[j] = 1; });
}

/// Calls `visit(first, last)` with the pixel indices of every connected component (4-neighbours that satisfy
/// `joined(i, j)`) of the pixels where `member(i)` holds, in the order of their first pixel.
template <class Member, class Joined, class Visit>
void for_each_component(int w, int h, RegionScratch& scratch, Member&& member, Joined&& joined, Visit&& visit) {
  scratch.label.assign(w, h, 0);
  auto& queue = scratch.queue;
  for (int start = 0; start < w * h; ++start) {
    if (scratch.label.data()[start] != 0 || !member(start)) continue;
    queue.clear();
    queue.push_back(start);
    scratch.label.data()[start] = 1;
    for (std::size_t k = 0; k < queue.size(); ++k) {
      const int i = queue[k];
      const int x = i % w;
      const int y = i / w;
      const auto next = [&](int j) {
        if (scratch.label.data()[j] != 0 || !member(j) || !joined(i, j)) return;
        scratch.label.data()[j] = 1;
        queue.push_back(j);
      };
      if (x > 0) next(i - 1);
      if (x + 1 < w) next(i + 1);
      if (y > 0) next(i - w);
      if (y + 1 < h) next(i + w);
    }
    const int* data = queue.data();
    visit(data, data + queue.size());
  }
}

/// Opening with a 2x2 square: removes lines that are one pixel wide, which edges with a small pose error leave.
inline void open_2x2(Image<std::uint8_t>& mask, Image<std::uint8_t>& scratch) {
  const int w = mask.width();
  const int h = mask.height();
  scratch.assign(w, h, 0);
  for (int y = 0; y + 1 < h; ++y) {
    for (int x = 0; x + 1 < w; ++x) {
      if (mask(x, y) != 0 && mask(x + 1, y) != 0 && mask(x, y + 1) != 0 && mask(x + 1, y + 1) != 0) {
        scratch(x, y) = scratch(x + 1, y) = scratch(x, y + 1) = scratch(x + 1, y + 1) = 1;
      }
    }
  }
  std::swap(mask, scratch);
}

/// Removes components of the mask that are smaller than `min_pixels` or than `min_area` in the world.
/// \param area_of_pixel world area of a pixel at 1 m depth [m^2], 1/(fx fy)
/// \param min_area [m^2]
inline void remove_small(const Image<float>& depth, float area_of_pixel, int min_pixels, float min_area, Image<std::uint8_t>& mask,
                         RegionScratch& scratch) {
  for_each_component(
      mask.width(), mask.height(), scratch, [&](int i) { return mask.data()[i] != 0; }, [](int, int) { return true; },
      [&](const int* first, const int* last) {
        float area = 0;
        for (const int* i = first; i != last; ++i) area += depth.data()[*i] * depth.data()[*i];
        if (last - first >= min_pixels && area * area_of_pixel >= min_area) return;
        for (const int* i = first; i != last; ++i) mask.data()[*i] = 0;
      });
}

/// Fills holes of the depth image that lie in the mask: a hole whose rim is mostly dynamic becomes dynamic as a whole.
/// The shadow of the sensor beside a body does not: it shows background.
inline void fill_depth_holes(const Image<float>& depth, Image<std::uint8_t>& mask, RegionScratch& scratch) {
  const int w = depth.width();
  const int h = depth.height();
  for_each_component(
      w, h, scratch, [&](int i) { return !(depth.data()[i] > 0); }, [](int, int) { return true; },
      [&](const int* first, const int* last) {
        int rim = 0;
        int dynamic = 0;
        for (const int* k = first; k != last; ++k) {
          const int x = *k % w;
          const int y = *k / w;
          const auto look = [&](int j) {
            if (!(depth.data()[j] > 0)) return;
            ++rim;
            dynamic += mask.data()[j] != 0 ? 1 : 0;
          };
          if (x > 0) look(*k - 1);
          if (x + 1 < w) look(*k + 1);
          if (y > 0) look(*k - w);
          if (y + 1 < h) look(*k + w);
        }
        if (rim > 0 && 5 * dynamic > 3 * rim) {
          for (const int* k = first; k != last; ++k) mask.data()[*k] = 1;
        }
      });
}

APSO_NAMESPACE_END
