/// \file
/// From sparse tracks to surfaces: each pixel goes with the track that is nearest to it along its surface.
///
/// Depth alone cannot see a body that slides along itself, as the trunk of a person who walks across the view: its old
/// and its new place overlap, and every recent view saw "the same surface" there. The tracks on it know better.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/flow_residual.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

enum class TrackClaim : std::uint8_t { None = 0, Static = 1, Moving = 2 };

/// Spreads tracks over connected depth, all at the same speed, so that a pixel goes with the track it is nearest to
/// along the surface. Connected areas that fewer than `least` moving tracks agree on are given up: a single track may
/// cling to an edge where two surfaces cross.
/// \param depth low-resolution depth [m], its pixels cover factor x factor pixels
/// \param reach how far a track speaks for its surface [small px]
/// \param depth_span ... and over which difference in depth [m]
/// \param claims size of depth
/// Linear in the number of pixels.
inline void claim_surfaces(const std::vector<FlowPoint>& points, const Image<float>& depth, int factor, int reach,
                           float depth_span, int least, Image<std::uint8_t>& claims, RegionScratch& scratch) {
  constexpr auto kStatic = static_cast<std::uint8_t>(TrackClaim::Static);
  constexpr auto kMoving = static_cast<std::uint8_t>(TrackClaim::Moving);
  const int w = depth.width();
  const int h = depth.height();
  claims.assign(w, h, 0);
  scratch.origin.resize(w, h);
  scratch.distance.resize(w, h);
  scratch.count.assign(w, h, 0);
  auto& queue = scratch.queue;
  queue.clear();
  for (const FlowPoint& p : points) {
    const int x = static_cast<int>((p.x + 0.5F) / static_cast<float>(factor));
    const int y = static_cast<int>((p.y + 0.5F) / static_cast<float>(factor));
    if (!(p.x >= 0 && p.y >= 0) || x >= w || y >= h || !(depth(x, y) > 0)) continue;
    const int i = y * w + x;
    if (p.moving && scratch.count.data()[i] < 255) ++scratch.count.data()[i];
    if (claims.data()[i] != 0) continue;  // tracks on one small pixel: the first decides
    claims.data()[i] = p.moving ? kMoving : kStatic;
    scratch.origin.data()[i] = depth.data()[i];
    scratch.distance.data()[i] = 0;
    queue.push_back(i);
  }
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
      if (claims.data()[j] != 0 || !depth_connected(z, zj) || std::abs(zj - z0) > depth_span) return;
      claims.data()[j] = claims.data()[i];
      scratch.origin.data()[j] = z0;
      scratch.distance.data()[j] = static_cast<std::uint8_t>(step);
      queue.push_back(j);
    };
    if (x > 0) visit(i - 1);
    if (x + 1 < w) visit(i + 1);
    if (y > 0) visit(i - w);
    if (y + 1 < h) visit(i + w);
  }
  for_each_component(
      w, h, scratch, [&](int i) { return claims.data()[i] == kMoving; },
      [&](int i, int j) { return depth_connected(depth.data()[i], depth.data()[j]); },
      [&](const int* first, const int* last) {
        int agree = 0;
        for (const int* i = first; i != last; ++i) agree += scratch.count.data()[*i];
        if (agree >= least) return;
        for (const int* i = first; i != last; ++i) claims.data()[*i] = 0;
      });
}

APSO_NAMESPACE_END
