// A room that is computed exactly: back wall, floor, a cupboard, and a slab that can be put anywhere.
#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <apso/math/se3.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

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
  bool textured = false;      // else everything is grey
  unsigned state = 1;

  /// Grey value of a surface point: waves of 6 to 30 cm, different in every direction.
  static double texture(double x, double y, double z) {
    return 0.5 + 0.12 * std::sin(21 * x + 9 * y + 5 * z) + 0.12 * std::sin(-17 * x + 31 * y + 11 * z + 1) +
           0.08 * std::sin(63 * x + 41 * y - 29 * z + 2) + 0.08 * std::sin(47 * x - 73 * y + 37 * z + 3);
  }
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
          if (textured) {
            const Eigen::Vector3d p = o + best * d;
            const double shift = truth(u, v) != 0 && slab ? slab->x : 0.0;  // the slab carries its texture along
            intensity(u, v) = static_cast<float>(texture(p.x() - shift, p.y(), p.z()) + noise * 0.008 * gauss());
          }
          depth(u, v) = z + static_cast<float>(noise * gauss()) * depth_sigma(z);
        }
      }
    }
  }

  [[nodiscard]] RgbdFrame frame(double t) const { return {t, intensity.view(), depth.view()}; }
};

/// Follows points on the walls and on the slab exactly, as a perfect tracker would.
class ExactTracks {
 public:
  ExactTracks() {
    for (int i = 0; i < 22; ++i) {
      for (int j = 0; j < 15; ++j) {
        wall_.emplace_back(-3.2 + 0.3 * i + 0.02 * j, -2.2 + 0.3 * j + 0.03 * (i % 3), 3.5);
        if (j < 9 && i < 5) on_slab_.emplace_back(-0.2 + 0.1 * i, -0.65 + 0.17 * j + 0.02 * (i % 2), 0.0);
      }
    }
    for (int i = 0; i < 12; ++i)
      for (int j = 0; j < 8; ++j) wall_.emplace_back(-1.5 + 0.27 * i, 1.0, 1.7 + 0.22 * j);
    previous_.resize(wall_.size() + on_slab_.size());
    age_.assign(previous_.size(), -1);
  }
  const std::vector<PointTrack>& follow(const Scene& scene, const Pose& T_world_camera, const std::optional<Slab>& slab) {
    const Pinhole c = camera();
    const Pose T = inverse(T_world_camera);
    tracks_.clear();
    for (std::size_t i = 0; i < previous_.size(); ++i) {
      const bool moving = i >= wall_.size();
      Eigen::Vector3d p = moving ? on_slab_[i - wall_.size()] : wall_[i];
      if (moving && slab) p += Eigen::Vector3d(slab->x, 0, slab->z);
      const Eigen::Vector3d q = T * p;
      const Eigen::Vector2d u = q.z() > 0.1 ? c.project(q) : Eigen::Vector2d(-1, -1);
      bool seen = (!moving || slab) && q.z() > 0.1 && c.contains(u.x(), u.y(), 1);
      if (seen) {
        const int x = static_cast<int>(std::lround(u.x()));
        const int y = static_cast<int>(std::lround(u.y()));
        seen = std::abs(static_cast<double>(scene.depth(x, y)) - q.z()) < 0.12;
      }
      age_[i] = seen ? age_[i] + 1 : -1;
      if (!seen) continue;
      const Eigen::Vector2f now = u.cast<float>();
      const Eigen::Vector2f before = age_[i] > 0 ? previous_[i] : now;
      tracks_.push_back({static_cast<std::int64_t>(i), now.x(), now.y(), before.x(), before.y(), age_[i]});
      previous_[i] = now;
    }
    return tracks_;
  }

 private:
  std::vector<Eigen::Vector3d> wall_;
  std::vector<Eigen::Vector3d> on_slab_;
  std::vector<Eigen::Vector2f> previous_;
  std::vector<int> age_;
  std::vector<PointTrack> tracks_;
};

/// A hand-held camera: a few centimetres and degrees to and fro.
inline Pose hand_held(double t) {
  Twist xi;
  xi << 0.1 * std::sin(1.1 * t), 0.05 * std::sin(0.7 * t + 1), 0.08 * std::sin(0.9 * t), 0.04 * std::sin(0.8 * t), 0.08 * std::sin(0.6 * t),
      0.02 * std::sin(1.3 * t);
  return se3_exp(xi);
}

}  // namespace observation_test
