// A room that is computed exactly: back wall, floor, a cupboard, and a slab that can be put anywhere.
#pragma once

#include <cmath>
#include <limits>
#include <optional>

#include <apso/math/se3.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/rgbd_frame.hpp>

namespace observation_test {
using namespace apso;

inline Pinhole camera() { return {260, 260, 159.5, 119.5, 320, 240}; }

struct Slab {
  double x = 0;  // centre [m]
  double z = 2;  // distance of its front [m]
  double width = 0.5;
  double top = -0.7;  // y points down
  double bottom = 0.9;
};

struct Scene {
  Image<float> depth;
  Image<float> intensity;
  Image<std::uint8_t> truth;  // 1 = slab
  unsigned state = 1;

  double gauss() {  // Irwin-Hall, good enough for noise
    double s = -6;
    for (int i = 0; i < 12; ++i) {
      state = state * 1664525U + 1013904223U;
      s += static_cast<double>(state >> 8) / 16777216.0;
    }
    return s;
  }

  void render(const Pose& T_world_camera, const std::optional<Slab>& slab, double noise = 1.0) {
    const Pinhole c = camera();
    depth.assign(c.width, c.height, 0.0F);
    intensity.assign(c.width, c.height, 0.5F);
    truth.assign(c.width, c.height, 0);
    const Eigen::Vector3d o = T_world_camera.translation();
    for (int v = 0; v < c.height; ++v) {
      for (int u = 0; u < c.width; ++u) {
        const Eigen::Vector3d d = T_world_camera.linear() * c.unproject(u, v, 1.0);
        double best = std::numeric_limits<double>::infinity();
        const auto plane_z = [&](double z, double x0, double x1, double y0, double y1, bool is_slab) {
          if (std::abs(d.z()) < 1e-9) return;
          const double s = (z - o.z()) / d.z();
          if (s <= 0.05 || s >= best) return;
          const Eigen::Vector3d p = o + s * d;
          if (p.x() < x0 || p.x() > x1 || p.y() < y0 || p.y() > y1) return;
          best = s;
          truth(u, v) = is_slab ? 1 : 0;
        };
        plane_z(3.5, -9, 9, -9, 9, false);
        plane_z(2.8, 0.7, 1.5, -0.2, 9, false);
        if (d.y() > 1e-9) {
          const double s = (1.0 - o.y()) / d.y();
          if (s > 0.05 && s < best) {
            best = s;
            truth(u, v) = 0;
          }
        }
        if (slab) {
          plane_z(slab->z, slab->x - slab->width / 2, slab->x + slab->width / 2, slab->top, slab->bottom, true);
        }
        if (std::isfinite(best)) {
          const auto z = static_cast<float>(best);
          depth(u, v) = z + static_cast<float>(noise * gauss()) * depth_sigma(z);
        }
      }
    }
  }

  [[nodiscard]] RgbdFrame frame(double t) const { return {t, intensity.view(), depth.view()}; }
};

/// A hand-held camera: a few centimetres and degrees to and fro.
inline Pose hand_held(double t) {
  Twist xi;
  xi << 0.1 * std::sin(1.1 * t), 0.05 * std::sin(0.7 * t + 1), 0.08 * std::sin(0.9 * t), 0.04 * std::sin(0.8 * t),
      0.08 * std::sin(0.6 * t), 0.02 * std::sin(1.3 * t);
  return se3_exp(xi);
}

}  // namespace observation_test
