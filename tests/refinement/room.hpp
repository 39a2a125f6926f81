// A small textured box room with an optional moving slab, ray cast exactly: what the alignment tests look at.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <apso/math/se3.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

namespace room {

using apso::Pose;

inline apso::Pinhole camera(int width = 320) {
  const double s = width / 640.0;
  return {525 * s, 525 * s, (319.5 + 0.5) * s - 0.5, (239.5 + 0.5) * s - 0.5, width, width * 3 / 4};
}

// What most tests look through.
inline const apso::Pinhole kCamera = camera(320);
inline const apso::Pinhole kSmallCamera = camera(160);

inline double lattice(int i, int j, int face) {
  // unsigned, whose products wrap
  std::uint32_t h =
      static_cast<std::uint32_t>(i) * 73856093U ^ static_cast<std::uint32_t>(j) * 19349663U ^ static_cast<std::uint32_t>(face) * 83492791U;
  h = (h ^ (h >> 16)) * 0x7feb352dU;
  h = (h ^ (h >> 15)) * 0x846ca68bU;
  return static_cast<double>((h ^ (h >> 16)) & 0xffffU) / 65535.0;
}

// Value noise of several octaves: smooth, and unlike any periodic pattern without false matches.
inline double texture(double a, double b, int face) {
  double sum = 0;
  double scale = 2.3;
  double weight = 0.36;
  for (int o = 0; o < 4; ++o, scale *= 2.1, weight *= 0.75) {
    const double x = a * scale;
    const double y = b * scale;
    const double fx = std::floor(x);
    const double fy = std::floor(y);
    const int i = static_cast<int>(fx);
    const int j = static_cast<int>(fy);
    const double u = (x - fx) * (x - fx) * (3 - 2 * (x - fx));
    const double v = (y - fy) * (y - fy) * (3 - 2 * (y - fy));
    const int f = face * 8 + o;
    sum += weight * ((1 - v) * ((1 - u) * lattice(i, j, f) + u * lattice(i + 1, j, f)) +
                     v * ((1 - u) * lattice(i, j + 1, f) + u * lattice(i + 1, j + 1, f)));
  }
  return sum;
}

struct Slab {
  bool on = false;
  double x = 0;        // left edge [m]
  double width = 1.0;  // [m]
  double z = 1.5;      // [m]
};

struct Frame {
  apso::Image<float> intensity, depth, probability;
  double dynamic_share = 0;
  apso::RgbdFrame view(double t = 0) const { return {t, intensity, depth}; }
};

// What a camera sees that reads row after row, each from its own pose.
template <class PoseOfRow>
Frame render_rows(const apso::Pinhole& cam, PoseOfRow&& T_world_camera_of, const Slab& slab = {}, unsigned noise = 0) {
  Frame f;
  f.intensity.resize(cam.width, cam.height);
  f.depth.resize(cam.width, cam.height);
  f.probability.assign(cam.width, cam.height, 0.0F);
  std::mt19937 rng(noise);
  std::normal_distribution<double> gauss;
  const double low[3] = {-2.2, -1.4, -2.0};
  const double high[3] = {2.2, 1.3, 3.2};
  int dynamic = 0;
  for (int y = 0; y < cam.height; ++y) {
    const Pose T_world_camera = T_world_camera_of(y);
    const Eigen::Matrix3d R = T_world_camera.linear();
    const Eigen::Vector3d o = T_world_camera.translation();
    for (int x = 0; x < cam.width; ++x) {
      const Eigen::Vector3d d = R * cam.unproject(x, y, 1.0);
      double best = 1e9;
      int face = 0;
      for (int a = 0; a < 3; ++a) {
        for (int side = 0; side < 2; ++side) {
          const double t = ((side ? high[a] : low[a]) - o[a]) / d[a];
          if (t > 0 && t < best) best = t, face = 2 * a + side;
        }
      }
      // a static block on the floor, seen from its front
      const double tb = (2.2 - o.z()) / d.z();
      const Eigen::Vector3d pb = o + tb * d;
      if (tb > 0 && tb < best && pb.x() > 0.2 && pb.x() < 0.9 && pb.y() > 0.2) best = tb, face = 7;
      bool moving = false;
      if (slab.on) {
        const double ts = (slab.z - o.z()) / d.z();
        const Eigen::Vector3d ps = o + ts * d;
        if (ts > 0 && ts < best && ps.x() > slab.x && ps.x() < slab.x + slab.width) {
          best = ts;
          face = 8;
          moving = true;
        }
      }
      const Eigen::Vector3d p = o + best * d;
      const int axis = face < 6 ? face / 2 : 2;
      double a = p[(axis + 1) % 3];
      double b = p[(axis + 2) % 3];
      if (axis == 2) a = p.x(), b = p.y();
      if (moving) a -= slab.x;
      double value = texture(a, b, face);
      double z = best;
      if (noise != 0) {
        value += gauss(rng) * 2.0 / 255;
        z += gauss(rng) * 1.425e-3 * z * z;
      }
      f.intensity(x, y) = static_cast<float>(value);
      f.depth(x, y) = static_cast<float>(z);
      if (moving) {
        f.probability(x, y) = 1.0F;
        ++dynamic;
      }
    }
  }
  f.dynamic_share = static_cast<double>(dynamic) / (cam.width * cam.height);
  return f;
}

inline Frame render(const apso::Pinhole& cam, const Pose& T_world_camera, const Slab& slab = {}, unsigned noise = 0) {
  return render_rows(
      cam, [&](int) { return T_world_camera; }, slab, noise);
}

inline Pose pose(double x, double y, double z, double rx, double ry, double rz) {
  const double d = 3.14159265358979323846 / 180;
  apso::Twist xi;
  xi << x, y, z, rx * d, ry * d, rz * d;
  return apso::se3_exp(xi);
}

// The motion that most tests look for.
inline const Pose kTruth = pose(.02, -.01, .02, .5, -.7, .3);

inline double translation_error(const Pose& a, const Pose& b) { return (apso::inverse(a) * b).translation().norm(); }

}  // namespace room
