// Nothing depends on how the work is shared out.
#include <atomic>
#include <cmath>
#include <cstring>
#include <thread>
#include <vector>

#include <doctest/doctest.h>

#include <apso/refinement/align.hpp>

#include "room.hpp"

using namespace apso;

namespace {
struct Backwards {
  template <class F>
  void operator()(int n, F&& f) const {
    for (int i = n - 1; i >= 0; --i) f(i);
  }
};
struct ThreeThreads {
  template <class F>
  void operator()(int n, F&& f) const {
    std::atomic<int> next{0};
    const auto work = [&] {
      for (int i = next++; i < n; i = next++) f(i);
    };
    std::vector<std::thread> others;
    for (int i = 0; i < 2; ++i) others.emplace_back(work);
    work();
    for (std::thread& t : others) t.join();
  }
};

bool same(const std::vector<float>& a, const std::vector<float>& b, std::size_t n) {
  return a.size() >= n && b.size() >= n && std::memcmp(a.data(), b.data(), n * sizeof(float)) == 0;
}
void check_same(const FramePyramid& a, const FramePyramid& b) {
  REQUIRE(a.size() == b.size());
  CHECK(a.masked() == b.masked());
  for (int l = 0; l < a.size(); ++l) {
    CAPTURE(l);
    const PyramidLevel& p = a.level(l);
    const PyramidLevel& q = b.level(l);
    CHECK(p.texture.size() == q.texture.size());
    CHECK(same(p.texture, q.texture, p.texture.size()));
    CHECK(p.pixels.count == q.pixels.count);
    REQUIRE(p.pixels.blocks() == q.pixels.blocks());
    CHECK(same(p.pixels.data, q.pixels.data, static_cast<std::size_t>(p.pixels.blocks() * PixelList::kFields * PixelList::kBlock)));
    CHECK(p.median_depth == q.median_depth);
    for (std::size_t i = 0; i < p.pixels.tiles.size(); ++i) {
      CHECK(p.pixels.tiles[i].begin == q.pixels.tiles[i].begin);
      CHECK(p.pixels.tiles[i].count == q.pixels.tiles[i].count);
      CHECK(p.pixels.tiles[i].depth == q.pixels.tiles[i].depth);
    }
  }
}
}  // namespace

TEST_CASE("a frame is prepared and aligned the same way by any executor") {
  for (const int width : {640, 330}) {  // 330 x 247: rows that do not end where vectors do
    for (const bool mask : {false, true}) {
      CAPTURE(width);
      CAPTURE(mask);
      const Pinhole camera = room::camera(width);
      const room::Slab before{true, -.3, .4, 1.5};
      const room::Slab after{true, -.25, .4, 1.5};
      const Pose T = room::pose(.02, -.01, .01, .5, -.4, .3);
      const room::Frame r = room::render(camera, Pose::Identity(), before, 1);
      room::Frame c = room::render(camera, T, after, 2);
      c.intensity(width / 2, 20) = NAN;
      const auto run = [&](const auto& executor, FramePyramid& reference, FramePyramid& current) {
        const ImageView<const float> none;
        reference.build(r.view(), camera, mask ? r.probability.view() : none, {}, PyramidRole::Both, executor);
        current.build(c.view(), camera, mask ? c.probability.view() : none, {}, PyramidRole::Both, executor);
        DirectAligner aligner;
        return aligner.align({{&reference, Pose::Identity(), 1}}, current, {Pose::Identity()}, executor);
      };
      FramePyramid reference, current, other_reference, other_current;
      const AlignmentResult one = run(SerialExecutor{}, reference, current);
      REQUIRE(succeeded(one.status));
      const auto compare = [&](const auto& executor) {
        const AlignmentResult other = run(executor, other_reference, other_current);
        check_same(reference, other_reference);
        check_same(current, other_current);
        CHECK((one.T_world_camera.matrix().array() == other.T_world_camera.matrix().array()).all());
        CHECK((one.information.array() == other.information.array()).all());
        CHECK(one.cost == other.cost);
      };
      compare(Backwards{});
      compare(ThreeThreads{});
    }
  }
}

TEST_CASE("the call for a pair takes an executor") {
  const Pinhole camera = room::camera(320);
  const Pose T = room::pose(.02, -.01, .01, .5, -.4, .3);
  const room::Frame r = room::render(camera, Pose::Identity(), {}, 1);
  const room::Frame c = room::render(camera, T, {}, 2);
  PairOptions o;
  o.backward = true;
  const PairAlignment one = align(r.intensity, r.depth, c.intensity, c.depth, camera, Pose::Identity(), o);
  const PairAlignment threads = align(r.intensity, r.depth, c.intensity, c.depth, camera, Pose::Identity(), o, ThreeThreads{});
  REQUIRE(succeeded(one.status));
  CHECK((one.T_current_reference.matrix().array() == threads.T_current_reference.matrix().array()).all());
  CHECK(one.backward_translation == threads.backward_translation);
}

TEST_CASE("the other place of a pattern that repeats is the same by any executor") {
  const Pinhole camera{262.5, 262.5, 159.5, 119.5, 320, 240};
  constexpr double wall = 2;     // [m] away
  constexpr double square = .1;  // [m]
  const auto look = [&](double x) {
    Image<float> intensity(camera.width, camera.height);
    for (int v = 0; v < camera.height; ++v) {
      for (int u = 0; u < camera.width; ++u) {
        const double across = (u - camera.cx) / camera.fx * wall + x;
        const double down = (v - camera.cy) / camera.fy * wall;
        const bool white = (static_cast<int>(std::floor(across / square)) + static_cast<int>(std::floor(down / square))) % 2 == 0;
        intensity(u, v) = white ? .8F : .2F;
      }
    }
    return intensity;
  };
  const Image<float> before = look(0), now = look(.02), depth(camera.width, camera.height, static_cast<float>(wall));
  const PairAlignment<> one = align(before, depth, now, depth, camera);
  REQUIRE(one.detail.ambiguous);
  const auto compare = [&](const auto& executor) {
    const PairAlignment<> other = align(before, depth, now, depth, camera, Pose::Identity(), {}, executor);
    CHECK(other.detail.ambiguous);
    CHECK((one.detail.T_world_camera_other.matrix().array() == other.detail.T_world_camera_other.matrix().array()).all());
  };
  compare(Backwards{});
  compare(ThreeThreads{});
}
