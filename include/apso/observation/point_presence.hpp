/// \file
/// Whether a point of a host's map is still where it was mapped. Somebody who sits is mapped; when he rises, his points stay in the
/// map, and a tracker that goes on matching them follows him.
///
/// \code
///   // after the pose of a frame is known, for each point of the local map
///   const PointPresence seen = point_presence(p_world, T_world_camera, camera, depth, observation.mask.probability);
///   // a point that was Moving once, and was then seen Gone in some frames more than Present: take it out of the map. Without
///   // the first half an unsure pose takes out corners of furniture.
/// \endcode
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// What a frame says about a point of the map.
enum class PointPresence : std::uint8_t {
  Unknown,  ///< outside of the image, hidden by something nearer, or without depth
  Present,  ///< a surface that rests is there
  Gone,     ///< the camera looks through it at what is behind
  Moving,   ///< something that moves is there or close by: the point may be of it
};
constexpr std::array<const char*, 4> enum_names(PointPresence) { return {"unknown", "present", "gone", "moving"}; }

/// Looks for a point of the map in a frame.
/// \param p_world        the point, in the world of the pose [m]
/// \param T_world_camera pose of the frame, any type
/// \param depth          of the frame [m], any image of the size of the camera
/// \param dynamic_probability of the frame, [0,1]; may be empty
/// \param margin         radius of the neighbourhood that has to agree [px]: a pose is not exact, and an edge is a step in depth
[[nodiscard]] inline PointPresence point_presence(const Eigen::Vector3d& p_world, const AnyPose& T_world_camera, const Pinhole& camera,
                                                  const AnyImage& depth, const AnyImage& dynamic_probability, int margin = 3,
                                                  const DepthRange& range = {}) {
  constexpr float kTolerance = 0.05F;  // of a point whose depth and pose are those of a frame of long ago [m]
  constexpr float kSigmas = 4;         // and of the noise of both depths
  constexpr float kMoving = 0.5F;      // probability from which a pixel counts as moving
  constexpr float kBody = 0.3F;        // when a body is found to move, it has left its points by less than it is deep [m]
  constexpr int kBeside = 4;           // and by less than so many margins
  const Pose& T = T_world_camera;
  const Eigen::Vector3d p = transform(inverse(T), p_world);
  if (!(p.z() > 0.05)) return PointPresence::Unknown;
  const Eigen::Vector2d u = camera.project(p);
  const double reach = margin + 1.0;
  if (!(u.x() >= reach && u.y() >= reach && u.x() < camera.width - reach && u.y() < camera.height - reach)) return PointPresence::Unknown;
  const auto x = static_cast<int>(std::lround(u.x()));
  const auto y = static_cast<int>(std::lround(u.y()));
  const auto z = static_cast<float>(p.z());
  const auto moving = [&](int px, int py) { return !dynamic_probability.empty() && dynamic_probability.at(px, py) > kMoving; };
  const auto body_moves_at = [&](int px, int py) {
    return px >= 0 && py >= 0 && px < camera.width && py < camera.height && moving(px, py) && std::abs(depth.at(px, py) - z) < kBody;
  };
  const float tolerance = std::max(kTolerance, kSigmas * depth_sigma(z));
  bool there = false;    // a surface at its depth
  bool through = false;  // a surface behind it
  bool nearer = false;   // a surface before it
  bool blind = false;
  bool moves = false;  // close by
  for (int dy = -margin; dy <= margin; dy += std::max(1, margin)) {
    for (int dx = -margin; dx <= margin; dx += std::max(1, margin)) {
      const float d = depth.at(x + dx, y + dy);
      moves = moves || body_moves_at(x + kBeside * dx, y + kBeside * dy);
      if (!depth_valid(d, range)) {
        blind = true;
      } else if (d < z - tolerance) {
        nearer = true;
      } else if (d > z + tolerance) {
        through = true;
      } else {
        there = true;
      }
    }
  }
  // the mask is wider than what moves, so a point on it may as well belong to the wall behind
  if (there && !moving(x, y)) return PointPresence::Present;
  if (there || moves) return PointPresence::Moving;
  return through && !nearer && !blind ? PointPresence::Gone : PointPresence::Unknown;
}

APSO_NAMESPACE_END
