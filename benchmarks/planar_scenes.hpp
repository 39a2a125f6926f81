// Scenes of a few textured rectangles in which a motion cannot be known: one direction open, nothing to see, or several
// answers that look the same. Rendered by ray casting, and seen by a sensor whose noise is not the one that the alignment expects.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "alignment_pairs.hpp"

namespace pairs {

/// Brightness in [0,1] at a place of a rectangle [m].
using Texture = std::function<double(double u, double v)>;

struct Rectangle {
  Eigen::Vector3d corner, u, v;  ///< u and v of unit length
  double width, height;          ///< [m]
  Texture texture;
};

/// A camera whose depth is that of DisparitySensor, and whose grey values have Gaussian noise.
struct ForeignSensor {
  double grey_sigma = 3;  ///< [grey values of 255]
  double gain = 0.02;     ///< largest change of brightness
  double missing = 0;     ///< share of the pixels that have no depth, each by itself
  apso::testing::DisparitySensor depth_sensor;

  template <class Depth>  // depth(x, y) without noise, 0 = none, at any place [px]
  void operator()(const apso::Pinhole& camera, const Depth& depth, std::uint64_t seed, double brightness, Image8& out) const {
    apso::testing::Random rng(seed);
    static const apso::testing::NormalTable table;
    const auto normal = [&] { return static_cast<double>(table(rng.next())); };
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const double grey = 255 * brightness * static_cast<double>(out.intensity(x, y)) + grey_sigma * normal();
        out.grey(x, y) = static_cast<std::uint8_t>(std::lround(std::clamp(grey, 0.0, 255.0)));
        out.intensity(x, y) = static_cast<float>(out.grey(x, y)) / 255.0F;
        const double z = depth_sensor(camera, depth, x, y, normal);
        const bool seen = !(missing > 0) || rng.uniform() >= missing;
        out.depth(x, y) = seen ? static_cast<float>(std::round(5000 * z) / 5000) : 0.0F;
      }
    }
  }
};

inline Image8 look_at(const std::vector<Rectangle>& scene, const apso::Pinhole& camera, const Pose& T_world_camera,
                      const ForeignSensor& sensor, std::uint64_t seed, double brightness) {
  struct Hit {
    double z = 0, grey = 0;
  };
  const auto cast = [&](double x, double y) {
    Hit nearest;
    const Eigen::Vector3d ray = T_world_camera.linear() * Eigen::Vector3d((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1);
    for (const Rectangle& r : scene) {
      const Eigen::Vector3d n = r.u.cross(r.v);
      const double along = n.dot(ray);
      if (std::abs(along) < 0.03 * ray.norm()) continue;  // grazing
      const double z = n.dot(r.corner - T_world_camera.translation()) / along;
      if (!(z > 0.1) || (nearest.z > 0 && z >= nearest.z)) continue;
      const Eigen::Vector3d p = T_world_camera.translation() + z * ray - r.corner;
      const double u = r.u.dot(p);
      const double v = r.v.dot(p);
      if (u < 0 || v < 0 || u > r.width || v > r.height) continue;
      nearest = {z, r.texture(u, v)};
    }
    return nearest;
  };
  Image8 out;
  out.grey.resize(camera.width, camera.height);
  out.intensity.resize(camera.width, camera.height);
  out.depth.resize(camera.width, camera.height);
  out.probability.assign(camera.width, camera.height, 0.0F);
  constexpr int kRays = 3;  // per pixel and side
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      double sum = 0;
      for (int j = 0; j < kRays; ++j) {
        for (int i = 0; i < kRays; ++i) sum += cast(x + (i + 0.5) / kRays - 0.5, y + (j + 0.5) / kRays - 0.5).grey;
      }
      out.intensity(x, y) = static_cast<float>(sum / (kRays * kRays));
    }
  }
  sensor(
      camera, [&](double x, double y) { return cast(x, y).z; }, seed, brightness, out);
  return out;
}

enum class Scenery { Stripes, Corridor, Checkerboard, Facade, Wall, Poster, Notice, Curtains };

/// Scenes in front of a camera at the origin that looks along z, y down.
/// - Stripes: a wall with vertical stripes of any width; up and down is open.
/// - Corridor: four bare surfaces of different brightness; along the corridor is open.
/// - Checkerboard: a wall of squares of 10 cm, larger than the view: a motion by two squares looks like none.
/// - Facade: a wall of equal windows.
/// - Wall: bare; three directions are open.
/// - Poster: a wall with a texture that fixes everything.
/// - Notice: the checkerboard with a sheet of paper on it, which tells one square from another.
/// - Curtains: the facade with curtains in a third of its windows, which tell them apart.
inline std::vector<Rectangle> make_scenery(Scenery kind, std::uint64_t seed) {
  using Eigen::Vector3d;
  apso::testing::Random rng(apso::testing::hash64(seed));
  const double distance = kind == Scenery::Facade ? rng.uniform(2.2, 3.5) : rng.uniform(1.1, 2.2);
  const Eigen::Matrix3d turn =
      (apso::so3_exp({0, rng.uniform(-18, 18) * kDegree, 0}) * apso::so3_exp({rng.uniform(-12, 12) * kDegree, 0, 0})).toRotationMatrix();
  const double base = rng.uniform(0.3, 0.6);
  const auto wall = [&](Texture t) {
    const Vector3d u = turn * Vector3d::UnitX();
    const Vector3d v = turn * Vector3d::UnitY();
    return std::vector<Rectangle>{{Vector3d(0, 0, distance) - 10 * u - 10 * v, u, v, 20, 20, std::move(t)}};
  };
  switch (kind) {
    case Scenery::Stripes: {
      std::vector<double> edges, greys;
      for (double u = 0; u < 20; u += rng.uniform(0.02, 0.12)) {
        edges.push_back(u);
        greys.push_back(rng.uniform(0.1, 0.9));
      }
      return wall([edges, greys](double u, double) {
        return greys[static_cast<std::size_t>(std::upper_bound(edges.begin(), edges.end(), u) - edges.begin() - 1)];
      });
    }
    case Scenery::Corridor: {
      const double half = rng.uniform(0.8, 1.2);
      const double height = rng.uniform(2.2, 2.8);
      const double eye = rng.uniform(1.2, 1.6);
      const auto bare = [&] {
        const double grey = rng.uniform(0.2, 0.8);
        return [grey](double, double) { return grey; };
      };
      const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
      return {{Vector3d(-half, eye - height, -20), z, y, 60, height, bare()},
              {Vector3d(half, eye - height, -20), z, y, 60, height, bare()},
              {Vector3d(-half, eye, -20), z, x, 60, 2 * half, bare()},
              {Vector3d(-half, eye - height, -20), z, x, 60, 2 * half, bare()}};
    }
    case Scenery::Notice: {
      std::vector<Rectangle> both = make_scenery(Scenery::Checkerboard, seed);
      const double left = rng.uniform(-0.5, 0.2), top = rng.uniform(-0.4, 0.1);
      const Texture squares = both[0].texture;
      both[0].texture = [squares, left, top, seed](double u, double v) {
        const double a = u - 10 - left, b = v - 10 - top;
        if (a < 0 || a > 0.3 || b < 0 || b > 0.21) return squares(u, v);
        const auto cell = static_cast<std::uint64_t>(a / 0.02) * 64 + static_cast<std::uint64_t>(b / 0.02);
        return 0.3 + 0.6 * static_cast<double>(apso::testing::hash64(seed * 4096 + cell) % 1000) / 1000;
      };
      return both;
    }
    case Scenery::Curtains: {
      std::vector<Rectangle> facade = make_scenery(Scenery::Facade, seed);
      apso::testing::Random same(apso::testing::hash64(seed));
      for (int i = 0; i < 4; ++i) (void)same.uniform(0, 1);
      const double across = same.uniform(0.3, 0.6), up = same.uniform(0.35, 0.7);
      const Texture windows = facade[0].texture;
      facade[0].texture = [=](double u, double v) {
        const double a = u / across - std::floor(u / across), b = v / up - std::floor(v / up);
        const double grey = windows(u, v);
        const auto cell = static_cast<std::uint64_t>(u / across) * 256 + static_cast<std::uint64_t>(v / up);
        const std::uint64_t h = apso::testing::hash64(seed * 65536 + cell);
        if (h % 3 != 0 || a < 0.25 || a > 0.75 || b < 0.25 || b > 0.7) return grey;
        return b < 0.25 + 0.45 * static_cast<double>(h / 3 % 1000) / 1000 ? 0.5 : grey;  // drawn to some height
      };
      return facade;
    }
    case Scenery::Checkerboard: {
      const double dark = rng.uniform(0.1, 0.3), light = rng.uniform(0.6, 0.9);
      return wall([dark, light](double u, double v) {
        return (static_cast<int>(std::floor(u / 0.1)) + static_cast<int>(std::floor(v / 0.1))) % 2 == 0 ? dark : light;
      });
    }
    case Scenery::Facade: {
      const double across = rng.uniform(0.3, 0.6), up = rng.uniform(0.35, 0.7);
      const double pane = rng.uniform(0.1, 0.3), frame = rng.uniform(0.7, 0.95);
      return wall([=](double u, double v) {
        const double a = u / across - std::floor(u / across), b = v / up - std::floor(v / up);
        if (a < 0.2 || a > 0.8 || b < 0.2 || b > 0.75) return base;
        const bool bar = a < 0.25 || a > 0.75 || b < 0.25 || b > 0.70 || std::abs(a - 0.5) < 0.03;
        return bar ? frame : pane;
      });
    }
    case Scenery::Wall:
      return wall([base](double, double) { return base; });
    case Scenery::Poster: {
      std::vector<double> greys(400 * 400);
      for (double& g : greys) g = rng.uniform(0.1, 0.9);
      return wall([greys](double u, double v) {
        const auto i = static_cast<std::size_t>(u / 0.05), j = static_cast<std::size_t>(v / 0.05);
        return greys[std::min<std::size_t>(j, 399) * 400 + std::min<std::size_t>(i, 399)];
      });
    }
  }
  return {};
}

/// A pair of views of a scene with a motion of `step` metres and half a degree per centimetre.
inline Pair make_planar_pair(Scenery kind, std::uint64_t seed, double step, const apso::Pinhole& camera, const ForeignSensor& sensor) {
  apso::testing::Random rng(apso::testing::hash64(seed ^ static_cast<std::uint64_t>(1e6 * step) ^ 0xA11A5ULL));
  const std::vector<Rectangle> scene = make_scenery(kind, seed);
  Pose T_world_reference = Pose::Identity();
  T_world_reference.linear() = (apso::so3_exp({0, rng.uniform(-8, 8) * kDegree, 0}) * apso::so3_exp({rng.uniform(-6, 6) * kDegree, 0, 0}) *
                                apso::so3_exp({0, 0, rng.uniform(-8, 8) * kDegree}))
                                   .toRotationMatrix();
  apso::Twist xi;
  xi << step * random_direction(rng), step * 50 * kDegree * random_direction(rng);
  const Pose T_current_world = apso::se3_exp(xi) * apso::inverse(T_world_reference);
  Pair pair;
  pair.step = step;
  pair.T_current_reference = T_current_world * T_world_reference;
  pair.reference = look_at(scene, camera, T_world_reference, sensor, seed * 2 + 1, 1.0);
  pair.current = look_at(scene, camera, apso::inverse(T_current_world), sensor, seed * 2 + 2, 1.0 + sensor.gain * rng.uniform(-1, 1));
  return pair;
}

/// A room of `maker`, with or without bodies, seen by the other sensor.
inline Pair make_room_pair(const PairMaker& maker, int view, double step, double moving_share, const ForeignSensor& sensor) {
  Conditions exact;
  exact.noise = false;
  exact.moving_share = moving_share;
  Pair pair = maker.make(view, step, exact);
  apso::testing::Random rng(apso::testing::hash64(static_cast<std::uint64_t>(view) * 977U + static_cast<std::uint64_t>(1e6 * step)));
  const auto reseen = [&](Image8& f, double brightness) {
    const apso::Image<float> depth = f.depth;
    sensor(
        maker.camera(),
        [&](double x, double y) {
          const int i = std::clamp(static_cast<int>(std::lround(x)), 0, depth.width() - 1);
          const int j = std::clamp(static_cast<int>(std::lround(y)), 0, depth.height() - 1);
          return static_cast<double>(depth(i, j));
        },
        rng.next(), brightness, f);
  };
  reseen(pair.reference, 1.0);
  reseen(pair.current, 1.0 + sensor.gain * rng.uniform(-1, 1));
  return pair;
}

}  // namespace pairs
