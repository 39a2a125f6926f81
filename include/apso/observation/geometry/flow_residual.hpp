/// \file
/// Moving points from sparse tracks: where a track goes, against where a static point would have gone.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/geometry/low_res_depth.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// A track against the motion of a static point.
struct FlowPoint {
  float x = 0;          ///< position in the current frame [px]
  float y = 0;          ///< [px]
  float dx = 0;         ///< position minus the one predicted from depth and ego-motion [px]
  float dy = 0;         ///< [px]
  float residual = 0;   ///< length of (dx, dy) [px]
  float expected = 0;   ///< how far a static point would have moved [px]
  bool inside = false;  ///< the point lay inside a surface, not on its edge
  bool moving = false;  ///< the residual is too large for a static point
};

/// Depths in the 3x3 neighbourhood of a valid pixel.
struct DepthSpan {
  float nearest = 0;            ///< [m]
  float farthest = 0;           ///< [m]
  bool inside_surface = false;  ///< all are valid and lie on one surface
};

[[nodiscard]] inline DepthSpan depth_span_3x3(const Image<float>& depth, int x, int y) {
  const float z = depth(x, y);
  DepthSpan s{z, z, x > 0 && y > 0 && x + 1 < depth.width() && y + 1 < depth.height()};
  for (int j = std::max(0, y - 1); j <= std::min(depth.height() - 1, y + 1); ++j) {
    for (int i = std::max(0, x - 1); i <= std::min(depth.width() - 1, x + 1); ++i) {
      const float q = depth(i, j);
      if (!(q > 0)) {
        s.inside_surface = false;
        continue;
      }
      s.nearest = std::min(s.nearest, q);
      s.farthest = std::max(s.farthest, q);
    }
  }
  s.inside_surface = s.inside_surface && s.farthest - s.nearest <= 3 * same_surface(z);
  return s;
}

/// Distance of each track to where a static point would have gone, for tracks whose previous position has depth.
/// \param T_current_previous motion of the camera
/// \param previous_depth low-resolution depth of the previous frame, its pixels cover factor x factor pixels
/// \param points in the order of the tracks
inline void flow_residuals(const std::vector<PointTrack>& tracks, const Pinhole& camera, const Pose& T_current_previous,
                           const Image<float>& previous_depth, int factor, std::vector<FlowPoint>& points) {
  points.clear();
  for (const PointTrack& t : tracks) {
    if (t.age < 1) continue;
    const int pixel = small_pixel(t.previous_x, t.previous_y, factor, previous_depth.width(), previous_depth.height());
    if (pixel < 0 || !(previous_depth.data()[pixel] > 0)) continue;
    const int ix = pixel % previous_depth.width();
    const int iy = pixel / previous_depth.width();
    // a feature on an edge may belong to either surface: it is as static as its better half
    const DepthSpan span = depth_span_3x3(previous_depth, ix, iy);
    FlowPoint point{t.x, t.y, 0, 0, std::numeric_limits<float>::infinity(), 0, span.inside_surface, false};
    for (const float z : {previous_depth(ix, iy), span.nearest, span.farthest}) {
      const Eigen::Vector3d p = transform(T_current_previous, camera.unproject(static_cast<double>(t.previous_x),
                                                                               static_cast<double>(t.previous_y), static_cast<double>(z)));
      if (!(p.z() > 0.05)) continue;
      const Eigen::Vector2d u = camera.project(p);
      const float dx = t.x - static_cast<float>(u.x());
      const float dy = t.y - static_cast<float>(u.y());
      const float residual = std::hypot(dx, dy);
      if (!(residual < point.residual)) continue;
      point.dx = dx;
      point.dy = dy;
      point.residual = residual;
      point.expected = std::hypot(static_cast<float>(u.x()) - t.previous_x, static_cast<float>(u.y()) - t.previous_y);
    }
    if (std::isfinite(point.residual)) points.push_back(point);
  }
}

/// How well tracks agree with a camera motion: the sum of 1 - (r / limit)^2 over those closer than the limit (MSAC).
[[nodiscard]] inline double track_support(const std::vector<FlowPoint>& points, double limit) {
  double sum = 0;
  for (const FlowPoint& p : points) {
    const double e = static_cast<double>(p.residual) / limit;
    sum += std::max(0.0, 1.0 - e * e);
  }
  return sum;
}

/// Marks the tracks that depart from the motion of a static point. The threshold of a track is the largest of
/// - min_residual,
/// - 3 x the lower quartile of all residuals: a pose error lifts all residuals, so it lifts the threshold as well, as
///   long as a quarter of the tracks is static,
/// - a share of its expected motion: errors of depth, of the time between colour and depth and of a rolling shutter
///   all grow with it.
/// \param scratch residuals
inline void mark_moving(double min_residual, double share, std::vector<float>& scratch, std::vector<FlowPoint>& points) {
  if (points.empty()) return;
  scratch.clear();
  for (const FlowPoint& p : points) scratch.push_back(p.residual);
  const auto quartile = scratch.begin() + static_cast<std::ptrdiff_t>(scratch.size() / 4);
  std::nth_element(scratch.begin(), quartile, scratch.end());
  const float threshold = std::max(static_cast<float>(min_residual), 3.0F * *quartile);
  for (FlowPoint& p : points) p.moving = p.residual > std::max(threshold, static_cast<float>(share) * p.expected);
}

APSO_NAMESPACE_END
