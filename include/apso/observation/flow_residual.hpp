/// \file
/// Moving points from sparse tracks: where a track goes, against where a static point would have gone.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// A track against the motion of a static point.
struct FlowPoint {
  float x = 0;          ///< position in the current frame [px]
  float y = 0;          ///< [px]
  float residual = 0;   ///< distance to the position predicted from depth and ego-motion [px]
  bool moving = false;  ///< the residual is too large for a static point
};

/// Distance of each track to where a static point would have gone, for tracks whose previous position has depth.
/// \param T_current_previous motion of the camera
/// \param previous_depth low-resolution depth of the previous frame, its pixels cover factor x factor pixels
/// \param points in the order of the tracks
inline void flow_residuals(const std::vector<PointTrack>& tracks, const Pinhole& camera, const Pose& T_current_previous,
                           const Image<float>& previous_depth, int factor, std::vector<FlowPoint>& points) {
  points.clear();
  const auto f = static_cast<float>(factor);
  for (const PointTrack& t : tracks) {
    if (t.age < 1) continue;
    const float px = (t.previous_x + 0.5F) / f;
    const float py = (t.previous_y + 0.5F) / f;
    if (!(px >= 0 && py >= 0 && px < static_cast<float>(previous_depth.width()) &&
          py < static_cast<float>(previous_depth.height())))
      continue;
    const float z = previous_depth(static_cast<int>(px), static_cast<int>(py));
    if (!(z > 0)) continue;
    const Eigen::Vector3d p =
        T_current_previous * camera.unproject(static_cast<double>(t.previous_x), static_cast<double>(t.previous_y),
                                              static_cast<double>(z));
    if (!(p.z() > 0.05)) continue;
    const Eigen::Vector2d u = camera.project(p);
    const auto r = static_cast<float>(std::hypot(u.x() - static_cast<double>(t.x), u.y() - static_cast<double>(t.y)));
    if (std::isfinite(r)) points.push_back({t.x, t.y, r, false});
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

/// Marks the tracks that depart from the motion of a static point. The threshold is max(min_residual, 3 x the lower
/// quartile of all residuals): a pose error lifts all residuals, so it lifts the threshold as well, as long as a
/// quarter of the tracks is static.
/// \param scratch residuals
inline void mark_moving(double min_residual, std::vector<float>& scratch, std::vector<FlowPoint>& points) {
  if (points.empty()) return;
  scratch.clear();
  for (const FlowPoint& p : points) scratch.push_back(p.residual);
  const auto quartile = scratch.begin() + static_cast<std::ptrdiff_t>(scratch.size() / 4);
  std::nth_element(scratch.begin(), quartile, scratch.end());
  const float threshold = std::max(static_cast<float>(min_residual), 3.0F * *quartile);
  for (FlowPoint& p : points) p.moving = p.residual > threshold;
}

APSO_NAMESPACE_END
