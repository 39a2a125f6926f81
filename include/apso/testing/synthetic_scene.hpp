/// \file
/// The static part of the synthetic room. World: x to the right, y down, z into the room [m]; the floor is at
/// y = kFloor, cameras start near the origin and look along +z.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/testing/synthetic_texture.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

inline constexpr float kFloor = 1.15F;     ///< y of the floor [m]
inline constexpr float kCeiling = -1.45F;  ///< y of the ceiling [m]

/// An axis-parallel textured rectangle, seen from one side.
struct Face {
  int axis = 0;                 ///< 0, 1, 2: the rectangle is the plane x, y or z = offset
  float offset = 0;             ///< [m]
  int side = 1;                 ///< +1: visible from larger coordinates, -1: from smaller ones
  std::array<float, 3> low{};   ///< smallest corner [m]
  std::array<float, 3> high{};  ///< largest corner [m]
  int s_axis = 0;               ///< world axis of the texture's columns
  int t_axis = 1;               ///< world axis of the texture's rows
  int texture = 0;              ///< index in Scene::textures
  float density = 200;          ///< texels per metre
  float s0 = 0;                 ///< texture column at `low`
  float t0 = 0;                 ///< texture row at `low`
  float shade = 1;              ///< brightness of this side
};

/// Textures and rectangles of a room.
struct Scene {
  std::vector<Texture> textures;
  std::vector<Face> faces;
  int first_cloth = 0;  ///< textures of person k: first_cloth + 4 k + {shirt, trousers, head, hands}
};

namespace detail_scene {

inline Face make_face(int axis, int side, const std::array<float, 3>& low, const std::array<float, 3>& high) {
  Face f;
  f.axis = axis;
  f.side = side;
  f.low = low;
  f.high = high;
  const auto a = static_cast<std::size_t>(axis);
  f.offset = side > 0 ? high[a] : low[a];
  f.low[a] = f.high[a] = f.offset;
  f.s_axis = axis == 0 ? 2 : 0;
  f.t_axis = axis == 1 ? 2 : 1;
  f.shade = axis == 1 ? (side < 0 ? 1.0F : 0.6F) : (axis == 0 ? 0.82F : 0.93F);
  return f;
}

/// A closed box; `density` texels per metre from random places of the texture.
inline void add_box(Scene& scene, std::array<float, 3> low, std::array<float, 3> high, int texture, float density, Random& rng) {
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = -1; side <= 1; side += 2) {
      Face f = make_face(axis, side, low, high);
      f.texture = texture;
      f.density = density;
      f.s0 = static_cast<float>(rng.below(512));
      f.t0 = static_cast<float>(rng.below(512));
      scene.faces.push_back(f);
    }
  }
}

/// A plate on four legs, its top at y = top.
inline void add_table(Scene& scene, float x0, float x1, float z0, float z1, float top, int texture, int plain, Random& rng) {
  add_box(scene, {x0, top, z0}, {x1, top + 0.04F, z1}, texture, 300, rng);
  for (const float x : {x0 + 0.03F, x1 - 0.08F})
    for (const float z : {z0 + 0.03F, z1 - 0.08F}) add_box(scene, {x, top + 0.04F, z}, {x + 0.05F, kFloor, z + 0.05F}, plain, 300, rng);
}

inline Canvas wall(Random& rng) {
  Canvas c(1024, 512, random_colour(rng, 150, 215));
  c.noise(128, 14, rng);
  c.noise(16, 6, rng);
  c.noise(4, 5, rng);
  for (int i = 0; i < 22; ++i) {  // pictures; rows of the texture: 0 ceiling .. 512 floor at 200 texels per metre
    const int w = rng.between(40, 150);
    const int h = rng.between(40, 130);
    const int x = rng.below(1024 - w);
    const int y = 20 + rng.below(440 - h);
    c.poster(x, y, x + w, y + h, rng);
  }
  for (int i = 0; i < 60; ++i) {  // labels, switches, hooks
    const int w = rng.between(4, 18);
    const int h = rng.between(4, 18);
    const int x = rng.below(1024 - w);
    const int y = rng.below(512 - h);
    c.rectangle(x, y, x + w, y + h, random_colour(rng));
    if (w > 9 && h > 9) c.rectangle(x + w / 3, y + h / 3, x + 2 * w / 3, y + 2 * h / 3, random_colour(rng));
  }
  c.rectangle(0, 500, 1024, 512, {70, 60, 52});  // skirting board
  return c;
}

inline Canvas floor(Random& rng) {
  Canvas c(512, 512, random_colour(rng, 80, 135));
  c.noise(64, 10, rng);
  c.noise(8, 10, rng);
  c.noise(2, 12, rng);
  for (int i = 0; i < 512; i += 64) {
    c.rectangle(i, 0, i + 2, 512, {62, 60, 60});
    c.rectangle(0, i, 512, i + 2, {62, 60, 60});
  }
  for (int i = 0; i < 70; ++i) {
    const int x = rng.below(500);
    const int y = rng.below(500);
    c.ellipse(x, y, x + rng.between(3, 12), y + rng.between(3, 12), random_colour(rng, 30, 190));
  }
  return c;
}

inline Canvas ceiling(Random& rng) {
  Canvas c(64, 64, {214, 213, 208});
  c.noise(32, 2.5F, rng);
  return c;
}

/// Packing material, book backs, control panels: patches within patches, with print.
inline Canvas clutter(Random& rng) {
  Canvas c(512, 512, random_colour(rng, 90, 190));
  c.noise(32, 12, rng);
  for (int i = 0; i < 90; ++i) {
    const int w = rng.between(12, 120);
    const int h = rng.between(12, 100);
    const int x = rng.below(512);
    const int y = rng.below(512);
    if (i % 3 == 0) {
      c.poster(x, y, x + w, y + h, rng);
    } else {
      c.rectangle(x, y, x + w, y + h, random_colour(rng));
      c.print(x + 3, y + 3, x + w - 2, y + h - 2, rng.between(1, 3), random_colour(rng, 5, 250), rng);
    }
  }
  c.noise(2, 5, rng);
  return c;
}

/// Wood or painted metal: few corners.
inline Canvas plain(Random& rng) {
  Canvas c(256, 256, random_colour(rng, 95, 190));
  c.noise(64, 12, rng);
  c.noise(4, 5, rng);
  for (int y = 0; y < 256; y += rng.between(6, 22)) {
    const int x = rng.below(256);
    c.rectangle(x, y, x + rng.between(20, 160), y + 1, random_colour(rng, 70, 130));
  }
  return c;
}

/// A checked shirt with pockets and a print.
inline Canvas shirt(Random& rng) {
  const Rgb ground = random_colour(rng, 60, 230);
  const Rgb a = random_colour(rng, 10, 250);
  const Rgb b = random_colour(rng, 10, 250);
  Canvas c(256, 256, ground);
  const int pitch = 16 << rng.below(2);
  const int width = pitch / 2;
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 256; ++x) {
      const bool column = x % pitch < width;
      const bool row = y % pitch < width;
      Rgb& p = c.at(x, y);
      if (column && row) p = a;
      else if (column || row) p = 0.5F * p + 0.5F * a;
      if (x % (2 * pitch) == width / 2 || y % (2 * pitch) == width / 2) p = b;
    }
  }
  for (int x = 20; x < 256; x += 64) {
    c.rectangle(x, 120, x + 24, 150, random_colour(rng));
    c.print(x + 2, 122, x + 23, 149, 2, random_colour(rng, 5, 80), rng);
  }
  c.noise(32, 14, rng);
  c.noise(2, 5, rng);
  return c;
}

inline Canvas trousers(Random& rng) {
  Canvas c(256, 256, random_colour(rng, 35, 120));
  c.noise(32, 12, rng);
  c.noise(4, 7, rng);
  c.rectangle(0, 0, 3, 256, {180, 160, 110});
  c.rectangle(128, 0, 130, 256, {35, 35, 45});
  return c;
}

/// Rows of the texture run from the crown of the head to the chin; the face looks along column 0.
inline Canvas head(Random& rng) {
  const auto tone = static_cast<float>(rng.uniform(0.6, 1.0));
  const Rgb skin = tone * Rgb{232, 190, 165};
  const auto h = static_cast<float>(rng.uniform(20, 110));
  const Rgb hair{h, 0.8F * h, 0.6F * h};
  Canvas c(256, 256, skin);
  c.noise(32, 5, rng);
  c.rectangle(0, 0, 256, 96, hair);
  c.rectangle(44, 0, 212, 175, hair);
  for (const int x : {14, 234}) c.rectangle(x, 112, x + 10, 119, {30, 25, 25});
  c.rectangle(0, 156, 14, 162, {150, 70, 70});
  c.rectangle(242, 156, 256, 162, {150, 70, 70});
  c.noise(4, 6, rng);
  return c;
}

inline Canvas skin_of_hands(Random& rng) {
  Canvas c(64, 64, Rgb{205, 160, 135});
  c.noise(16, 6, rng);
  return c;
}

}  // namespace detail_scene

/// A furnished room of 5.5 x 2.6 x 7 m with `people` wardrobes, the same for the same seed.
[[nodiscard]] inline Scene make_room(std::uint64_t seed, int people) {
  using namespace detail_scene;
  Random rng(seed ^ 0x526F6F6DULL);
  Scene scene;
  for (int i = 0; i < 4; ++i) scene.textures.emplace_back(wall(rng));
  scene.textures.emplace_back(floor(rng));
  scene.textures.emplace_back(ceiling(rng));
  scene.textures.emplace_back(clutter(rng));
  scene.textures.emplace_back(clutter(rng));
  scene.textures.emplace_back(plain(rng));
  const int things = 6;
  const int books = 7;
  const int wood = 8;
  scene.first_cloth = static_cast<int>(scene.textures.size());
  for (int i = 0; i < people; ++i) {
    scene.textures.emplace_back(shirt(rng));
    scene.textures.emplace_back(trousers(rng));
    scene.textures.emplace_back(head(rng));
    scene.textures.emplace_back(skin_of_hands(rng));
  }

  const auto room_face = [&scene](int axis, int side, int texture, float density) {
    // seen from inside: the largest plane is visible from smaller coordinates
    std::array<float, 3> low{-2.7F, kCeiling, -2.6F};
    std::array<float, 3> high{2.8F, kFloor, 4.4F};
    Face f = make_face(axis, -side, low, high);
    const auto a = static_cast<std::size_t>(axis);
    f.offset = side > 0 ? high[a] : low[a];
    f.low[a] = f.high[a] = f.offset;
    f.texture = texture;
    f.density = density;
    if (axis == 1) f.shade = side > 0 ? 0.9F : 1.0F;
    scene.faces.push_back(f);
  };
  room_face(2, 1, 0, 196);
  room_face(0, -1, 1, 196);
  room_face(0, 1, 2, 196);
  room_face(2, -1, 3, 196);
  room_face(1, 1, 4, 128);
  room_face(1, -1, 5, 12);

  // far side: a desk with screens, a partition, a cupboard
  add_table(scene, -1.45F, 1.1F, 3.15F, 3.85F, 0.42F, books, wood, rng);
  add_box(scene, {-1.1F, -0.12F, 3.45F}, {-0.5F, 0.3F, 3.5F}, things, 330, rng);
  add_box(scene, {-0.9F, 0.3F, 3.42F}, {-0.7F, 0.42F, 3.52F}, wood, 300, rng);
  add_box(scene, {0.05F, -0.1F, 3.5F}, {0.6F, 0.32F, 3.55F}, books, 330, rng);
  add_box(scene, {0.2F, 0.32F, 3.48F}, {0.45F, 0.42F, 3.56F}, wood, 300, rng);
  add_box(scene, {-0.35F, 0.1F, 3.3F}, {-0.1F, 0.42F, 3.6F}, things, 330, rng);
  add_box(scene, {0.72F, 0.22F, 3.25F}, {1.02F, 0.42F, 3.5F}, books, 360, rng);
  add_box(scene, {1.25F, -0.55F, 3.6F}, {2.3F, kFloor, 3.68F}, books, 220, rng);
  add_box(scene, {-2.3F, -0.75F, 3.75F}, {-1.55F, kFloor, 4.35F}, things, 220, rng);
  // sides, between 1.5 and 3.3 m
  add_box(scene, {-2.68F, -0.35F, 1.5F}, {-1.95F, kFloor, 2.5F}, books, 240, rng);
  add_box(scene, {-2.5F, -0.68F, 1.7F}, {-2.1F, -0.35F, 2.1F}, things, 300, rng);
  add_box(scene, {2.0F, 0.1F, 1.7F}, {2.78F, kFloor, 2.8F}, things, 240, rng);
  add_box(scene, {2.1F, -0.3F, 1.9F}, {2.5F, 0.1F, 2.3F}, books, 300, rng);
  add_box(scene, {-1.9F, 0.55F, 2.85F}, {-1.5F, kFloor, 3.25F}, things, 300, rng);
  add_box(scene, {1.35F, 0.5F, 2.9F}, {1.8F, kFloor, 3.3F}, books, 300, rng);
  // near side: a table with boxes on it, its far edge in front of where people walk
  add_table(scene, 0.3F, 1.5F, 0.7F, 0.97F, 0.45F, things, wood, rng);
  add_box(scene, {0.55F, 0.28F, 0.78F}, {0.78F, 0.45F, 0.92F}, books, 420, rng);
  add_box(scene, {1.0F, 0.2F, 0.75F}, {1.25F, 0.45F, 0.93F}, things, 420, rng);
  add_box(scene, {-1.2F, 0.5F, 0.68F}, {-0.55F, kFloor, 0.95F}, books, 380, rng);
  // behind the camera
  add_box(scene, {-2.6F, -0.9F, -2.5F}, {-1.2F, kFloor, -1.9F}, books, 220, rng);
  add_box(scene, {0.6F, 0.2F, -2.5F}, {2.2F, kFloor, -1.7F}, things, 240, rng);
  return scene;
}

}  // namespace testing
APSO_NAMESPACE_END
