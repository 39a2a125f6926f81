/// \file
/// A limb of a person of the synthetic room, prepared for drawing: a cylinder with round ends, and the pixels it may cover.
#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/se3.hpp>
#include <apso/testing/synthetic_walker.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

inline constexpr float kNear = 0.05F;  ///< nothing nearer than this is drawn [m]

/// A limb in coordinates in which it is a cylinder of radius 1 with round ends.
struct LimbBody {
  Eigen::Matrix3f to_local;         ///< world directions -> local
  Eigen::Matrix3f to_world_normal;  ///< local normals -> world (not of unit length)
  Eigen::Vector3f centre;
  float half_length;  ///< in local units
  float row_scale;    ///< texture rows per local unit of y
  float texels;       ///< texels per metre, for the level of detail
  int texture;
  int u0, u1, v0, v1;  ///< pixels it may cover, inclusive
};

/// \param T_camera_world of the camera that draws
[[nodiscard]] inline LimbBody limb_body(const Limb& limb, const Pinhole& camera, const Pose& T_camera_world) {
  LimbBody b;
  const Eigen::Vector3d inverse_size(1 / limb.across, 1 / limb.end, 1 / limb.front);
  const Eigen::Matrix3d local = inverse_size.asDiagonal() * limb.axes.transpose();
  b.to_local = local.cast<float>();
  b.to_world_normal = local.transpose().cast<float>();
  b.centre = limb.centre.cast<float>();
  b.half_length = static_cast<float>(limb.half_length / limb.end);
  b.texture = limb.texture;
  const double round = limb.across + limb.front;
  b.texels = static_cast<float>(256.0 / (kPi * round));
  // head: the texture's height is the head; else square texels on the cylinder
  b.row_scale = static_cast<float>(256.0 / (kPi * round) * limb.end);
  if (limb.half_length < 0.4 * limb.end) b.row_scale = 128.0F / (1.0F + b.half_length);
  // box around the two spheres at the ends
  const double r = std::max({limb.across, limb.front, limb.end});
  double u0 = 1e9, u1 = -1e9, v0 = 1e9, v1 = -1e9;
  for (const double s : {-limb.half_length, limb.half_length}) {
    const Eigen::Vector3d end_in_world = limb.centre + s * limb.axes.col(1);
    const Eigen::Vector3d p = T_camera_world * end_in_world;
    if (p.z() + r < kNear) continue;
    const double near = std::max(p.z() - r, static_cast<double>(kNear));
    const double far = p.z() + r;
    u0 = std::min(u0, camera.cx + camera.fx * (p.x() - r) / (p.x() - r < 0 ? near : far));
    u1 = std::max(u1, camera.cx + camera.fx * (p.x() + r) / (p.x() + r > 0 ? near : far));
    v0 = std::min(v0, camera.cy + camera.fy * (p.y() - r) / (p.y() - r < 0 ? near : far));
    v1 = std::max(v1, camera.cy + camera.fy * (p.y() + r) / (p.y() + r > 0 ? near : far));
  }
  const auto inside = [](double v, int last) { return static_cast<int>(std::min<double>(last, std::max(0.0, v))); };
  b.u0 = u0 > camera.width - 1 ? 1 : inside(std::floor(u0), camera.width - 1);
  b.u1 = u1 < 0 || u0 > camera.width - 1 ? 0 : inside(std::ceil(u1), camera.width - 1);
  b.v0 = v0 > camera.height - 1 ? 1 : inside(std::floor(v0), camera.height - 1);
  b.v1 = v1 < 0 || v0 > camera.height - 1 ? 0 : inside(std::ceil(v1), camera.height - 1);
  if (u1 < 0) b.u0 = 1;
  if (v1 < 0) b.v0 = 1;
  return b;
}

/// Normal in local coordinates, not of unit length, of the surface at the local point q.
inline Eigen::Vector3f body_normal(const LimbBody& b, const Eigen::Vector3f& q) {
  const float rest = q.y() > b.half_length ? q.y() - b.half_length : (q.y() < -b.half_length ? q.y() + b.half_length : 0);
  return {q.x(), rest, q.z()};
}

}  // namespace testing
APSO_NAMESPACE_END
