/// \file
/// The first level of a pyramid: the only place where the pixels of a user's images are read.
#pragma once

#include <algorithm>
#include <cmath>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>
#include <apso/refinement/pyramid/plane.hpp>
#include <apso/refinement/pyramid/pyramid_options.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

/// Reads rows [y0, y1) into planes that have their size already, or into windows. Depth out of range and intensities that are not finite
/// become 0. Bands can be read side by side.
/// \return how many intensities are not finite
template <class Rows>
float read_first_level(const AnyFrame& frame, const DepthRange& range, Rows& intensity, Rows& depth, int y0, int y1) {
  return in_widest_lanes([&](auto lanes) {
    using L = BasicLanes<lanes>;
    const int w = frame.intensity().width();
    const L lowest = std::max(range.min, 1e-6F);
    const L highest = range.max;
    // The row where it lies, if whole lanes can be read there; else its copy in `room`.
    const auto read = [w, lanes](const AnyImage& image, int y, float* room) -> const float* {
      const float* row = image.row_in_place(y);
      if (row != nullptr && w % lanes == 0) return row;
      if (row != nullptr) std::copy(row, row + w, room);
      else image.read_row(y, room, 1);
      return room;
    };
    L bad = 0.0F;
    for (int y = y0; y < y1; ++y) {
      float* i = intensity.row(y);
      float* z = depth.row(y);
      const float* from_i = read(frame.intensity(), y, i);
      const float* from_z = read(frame.depth(), y, z);
      std::fill(i + w, i + w + Plane::kPad, 0.0F);
      for (int x = 0; x < w; x += lanes) {
        const L metres = L::load(from_z + x);
        select((metres >= lowest) & (metres <= highest), metres, 0.0F).store(z + x);
        const L grey = L::load(from_i + x);
        const auto ok = abs(grey) <= L(1e6F);  // false for NaN and inf
        bad += select(ok, 0.0F, 1.0F);
        select(ok, grey, 0.0F).store(i + x);
      }
    }
    return bad.sum();
  });
}

/// Rows [y0, y1) of the second level straight from the images: each row is read while it is in the cache, and the first level, three
/// quarters of all pixels, is never written. The same as read_first_level, halve_intensity and halve_depth one after the other.
/// \param intensity,depth windows of the first level
/// \param scratch a row
/// \return how many intensities are not finite, some of them counted twice
inline float read_second_level(const AnyFrame& frame, const DepthRange& range, RowWindow intensity, RowWindow depth, Plane& half_intensity,
                               Plane& half_depth, float* scratch, int y0, int y1) {
  float bad = 0;
  for (int y = y0; y < y1; ++y) {
    const int next = y == y0 ? std::max(2 * y - 1, 0) : 2 * y + 1;  // not read yet
    bad += read_first_level(frame, range, intensity, depth, next, std::min(2 * y + 3, intensity.height()));
    halve_intensity(intensity, half_intensity, scratch, y, y + 1);
    halve_depth(depth, half_depth, y, y + 1);
  }
  return bad;
}

/// Weights of rows [y0, y1), after read_first_level; depth of weight 0 becomes 0.
/// \param probability     [0,1], 1 = dynamic; empty = nothing is dynamic
/// \param broken          some intensities are not finite: they get weight 0
/// \param scratch         a row
/// \return how many pixels weigh less than static ones
inline float weigh_first_level(const AnyFrame& frame, const AnyImage& probability, float gamma_potential, bool broken, Plane& gamma,
                               Plane& depth, float* scratch, int y0, int y1) {
  return in_widest_lanes([&](auto lanes) {
    using L = BasicLanes<lanes>;
    const int w = frame.intensity().width();
    const L background = kGammaStatic;
    L less = 0.0F;
    for (int y = y0; y < y1; ++y) {
      float* g = gamma.row(y);
      float* z = depth.row(y);
      if (probability.empty()) {
        std::fill(g, g + w, -1.0F);
      } else {
        probability.read_row(y, g, 1);
      }
      std::fill(g + w, g + w + Plane::kPad, -1.0F);  // as certainly static
      for (int x = 0; x < w; x += lanes) {
        const L v = L::load(g + x);
        // NaN fails both comparisons and counts as dynamic
        const L weight =
            select(v < L(kPotentialProbability), background, select(v < L(kConfirmedProbability), L(gamma_potential), L(kGammaDynamic)));
        less += select(weight < background, 1.0F, 0.0F);
        weight.store(g + x);
        // nor does the depth of what is masked
        select(weight > L(0.0F), L::load(z + x), 0.0F).store(z + x);
      }
      if (!broken) continue;
      frame.intensity().read_row(y, scratch, 1);
      for (int x = 0; x < w; ++x) {
        if (!(std::abs(scratch[x]) <= 1e6F)) g[x] = z[x] = 0.0F;
      }
    }
    return less.sum();
  });
}

APSO_NAMESPACE_END
