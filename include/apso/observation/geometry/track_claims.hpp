/// \file
/// From sparse tracks to surfaces: each pixel goes with the track that is nearest to it along its surface.
///
/// Depth alone cannot see a body that slides along itself, such as the trunk of a person who walks across the view: its old
/// and its new place overlap, and every recent view saw "the same surface" there. The tracks on it show the motion.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/geometry/flow_residual.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// What the tracks say about a pixel: 0 nothing, kClaimedStatic, or the number of moving tracks that agree on it
/// (at least 2, at most 255).
inline constexpr std::uint8_t kClaimedStatic = 1;

/// Spreads tracks over connected depth, all at the same speed, so that a pixel goes with the track it is nearest to
/// along the surface. Connected areas are dropped where fewer than `least` moving tracks lie, or where these do not
/// move the same way: a track may cling to an edge where two surfaces cross, or wander over a dark surface.
/// \param depth low-resolution depth [m], its pixels cover factor x factor pixels
/// \param reach how far a track speaks for its surface [small px]
/// \param depth_span ... and over which difference in depth [m]
/// \param least at least 2
/// \param claims of the size of depth, see kClaimedStatic
/// Linear in the number of pixels.
inline void claim_surfaces(const std::vector<FlowPoint>& points, const Image<float>& depth, int factor, int reach, float depth_span,
                           int least, Image<std::uint8_t>& claims, RegionScratch& scratch) {
  constexpr std::uint8_t kMoving = 2;
  constexpr float coherent = 0.7F;  // length of the mean residual over the mean length: 1 = all the same way
  const int w = depth.width();
  const int h = depth.height();
  const auto pixel = [&](const FlowPoint& p) {
    const int i = small_pixel(p.x, p.y, factor, w, h);
    return i >= 0 && depth.data()[i] > 0 ? i : -1;
  };
  claims.assign(w, h, 0);
  scratch.origin.resize(w, h);
  scratch.distance.resize(w, h);
  auto& queue = scratch.queue;
  queue.clear();
  for (const FlowPoint& p : points) {
    const int i = pixel(p);
    if (i < 0 || claims.data()[i] != 0) continue;  // of tracks on one small pixel the first decides
    // a moving point on an edge may belong to the other surface
    if (p.moving && !(p.inside && depth_span_3x3(depth, i % w, i / w).inside_surface)) continue;
    claims.data()[i] = p.moving ? kMoving : kClaimedStatic;
    scratch.origin.data()[i] = depth.data()[i];
    scratch.distance.data()[i] = 0;
    queue.push_back(i);
  }
  spread_along_surfaces(
      depth, reach, depth_span, scratch, [&](int j) { return claims.data()[j] == 0; },
      [&](int j, int i) { claims.data()[j] = claims.data()[i]; });
  // The moving tracks of each area, by the mark it leaves in `distance`.
  scratch.distance.assign(w, h, 0);
  int areas = 0;
  for_each_component(
      w, h, scratch, [&](int i) { return claims.data()[i] == kMoving; },
      [&](int i, int j) { return depth_connected(depth.data()[i], depth.data()[j]); },
      [&](const int* first, const int* last) {
        areas = areas < 254 ? areas + 1 : 255;  // what is beyond 254 areas is given up
        for (const int* i = first; i != last; ++i) scratch.distance.data()[*i] = static_cast<std::uint8_t>(areas);
      });
  struct Sum {
    int count = 0;
    float dx = 0, dy = 0, length = 0;
  };
  std::array<Sum, 256> sums{};
  for (const FlowPoint& p : points) {
    const int i = pixel(p);
    if (i < 0 || !p.moving || claims.data()[i] != kMoving) continue;
    Sum& s = sums[scratch.distance.data()[i]];
    ++s.count;
    s.dx += p.dx;
    s.dy += p.dy;
    s.length += p.residual;
  }
  for (std::size_t i = 0; i < claims.size(); ++i) {
    if (claims.data()[i] != kMoving) continue;
    const std::uint8_t area = scratch.distance.data()[i];
    const Sum& s = sums[area];
    const bool agree = area != 255 && s.count >= least && std::hypot(s.dx, s.dy) >= coherent * s.length;
    claims.data()[i] = agree ? static_cast<std::uint8_t>(std::clamp(s.count, 2, 255)) : std::uint8_t{0};
  }
}

APSO_NAMESPACE_END
