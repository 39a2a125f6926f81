// What is allocated: nothing once the buffers have their size, and never an image to read an image.
#include <cstddef>
#include <optional>
#include <vector>

#include <doctest/doctest.h>

#include <apso/refinement/align.hpp>
#include <apso/refinement/camera_velocity.hpp>
#include <apso/refinement/refiner.hpp>
#include <apso/refinement/start/corner_matching.hpp>
#include <apso/traits/images/rolling_shutter.hpp>

#include "../counting_allocator.hpp"
#include "../foreign_types.hpp"
#include "room.hpp"

using namespace apso;
using counting::Allocations;
using counting::count;

TEST_CASE("alignment that is warm allocates nothing") {
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), {}, 1);
  const room::Frame c = room::render(room::kCamera, room::kTruth, {true, -.3, .4, 1.5}, 2);  // something moves: all paths are taken
  for (const bool masked : {false, true}) {
    FramePyramid reference, current;
    AlignmentOptions searching;
    searching.multi_start_threshold = 0;
    DirectAligner aligner(searching);
    std::vector<AlignmentReference> references{{&reference, Pose::Identity(), 1}};
    std::vector<Pose> candidates{Pose::Identity()};
    AlignmentResult result;
    const auto once = [&] {
      reference.build(r.view(), room::kCamera, masked ? r.probability.view() : ImageView<const float>{}, {}, PyramidRole::Both);
      current.build(c.view(), room::kCamera, masked ? c.probability.view() : ImageView<const float>{}, {}, PyramidRole::Both);
      result = aligner.align(references, current, candidates);
    };
    once();
    once();
    const Allocations a = count(once);
    CHECK(succeeded(result.status));
    CHECK(a.number == 0);
  }
}

TEST_CASE("the velocity of a camera and its rolling shutter allocate nothing when they are warm") {
  const room::Frame a = room::render(room::kCamera, Pose::Identity(), {}, 1);
  const room::Frame b = room::render(room::kCamera, room::kTruth, {}, 2);
  CameraVelocity velocity(room::kCamera);
  RollingShutter shutter(room::kCamera, 0.03);
  Image<float> intensity;
  double t = 0;
  bool known = true;
  const auto twice = [&] {
    for (const room::Frame* f : {&a, &b}) {
      velocity.push(f->view(t += 0.03));
      const std::optional<Twist> v = velocity.of_latest_frame();
      known = known && (v || t < 0.04);
      if (!v) continue;
      shutter.follow(f->view(), *v, 0.01);
      shutter.intensity(f->view(), intensity);
    }
  };
  twice();
  twice();
  const Allocations counted = count(twice);
  CHECK(known);
  CHECK(counted.number == 0);
}

TEST_CASE("looking for other answers allocates nothing") {
  Image<float> intensity[2], depth(room::kCamera.width, room::kCamera.height);
  depth.assign(room::kCamera.width, room::kCamera.height, 2.0F);
  for (const int i : {0, 1}) {
    intensity[i].resize(room::kCamera.width, room::kCamera.height);
    for (int y = 0; y < room::kCamera.height; ++y) {
      for (int x = 0; x < room::kCamera.width; ++x) intensity[i](x, y) = ((x + i) / 12 + y / 12) % 2 == 0 ? 0.2F : 0.8F;
    }
  }
  FramePyramid reference, current;
  reference.build({0.0, intensity[0], depth}, room::kCamera);
  current.build({0.0, intensity[1], depth}, room::kCamera);
  DirectAligner aligner;
  std::vector<AlignmentReference> references{{&reference, Pose::Identity(), 1}};
  std::vector<Pose> candidates{Pose::Identity()};
  AlignmentResult result;
  const auto once = [&] { result = aligner.align(references, current, candidates); };
  once();
  const Allocations a = count(once);
  CHECK(result.ambiguous);
  CHECK(a.number == 0);
}

TEST_CASE("an image full of corners takes little memory to search them, so that a long run does not grow by its busiest frame") {
  Image<float> intensity(room::kCamera.width, room::kCamera.height), depth(room::kCamera.width, room::kCamera.height);
  depth.assign(room::kCamera.width, room::kCamera.height, 2.0F);
  for (int y = 0; y < room::kCamera.height; ++y) {
    for (int x = 0; x < room::kCamera.width; ++x) intensity(x, y) = (x / 4 + y / 4) % 2 == 0 ? 0.2F : 0.8F;
  }
  FramePyramid pyramid;
  PyramidOptions full;
  full.finest = 0;
  pyramid.build({0.0, intensity, depth}, room::kCamera, {}, full);
  std::vector<CornerMatch> matches;
  matches.reserve(10000);
  CornerMatcher fresh;
  const Allocations all = count([&] { (void)fresh(pyramid.halved(0), pyramid.halved(0), matches); });
  const std::size_t pixels = 300UL * 220UL;            // with all of a patch around them; each of these is near the corner of a square
  CHECK(5 * all.bytes < pixels * 64 * sizeof(float));  // patches of 8 x 8
}

TEST_CASE("reading the images of others allocates nothing: a warm pyramid, and one call of align") {
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), {}, 1);
  const room::Frame c = room::render(room::kCamera, room::kTruth, {true, -.3, .4, 1.5}, 2);
  const auto grey_r = foreign::at_only(r.intensity), grey_c = foreign::at_only(c.intensity);
  const auto depth_r = foreign::padded_u16(r.depth, 1 / 5000.F), depth_c = foreign::padded_u16(c.depth, 1 / 5000.F);
  const auto probability = foreign::padded_u16(c.probability, 1 / 1000.F);
  const auto reference = frame(0, grey_r, scaled(depth_r, 1 / 5000.F), room::kCamera);
  const auto current = frame(1, grey_c, scaled(depth_c, 1 / 5000.F), room::kCamera);
  const auto mask = scaled(probability, 1 / 1000.F);
  FramePyramid pyramid;
  const auto build = [&] { pyramid.build(current, room::kCamera, mask); };
  build();
  CHECK(pyramid.masked());
  CHECK(count(build).number == 0);

  // A single call has the two pyramids to make: as much as for images of the library's own.
  const Image<float> own[] = {foreign::native(grey_r), foreign::native(depth_r, 1 / 5000.F), foreign::native(grey_c),
                              foreign::native(depth_c, 1 / 5000.F)};
  PairAlignment<> by_frames, by_images, by_own;
  const Allocations frames = count([&] { by_frames = align(reference, current); });
  PairOptions tum;
  tum.depth_unit = 1 / 5000.;
  const Allocations images = count([&] { by_images = align(grey_r, depth_r, grey_c, depth_c, room::kCamera, Pose::Identity(), tum); });
  const Allocations native = count([&] { by_own = align(own[0], own[1], own[2], own[3], room::kCamera); });
  REQUIRE(succeeded(by_own.status));
  CHECK(by_frames.T_current_reference.matrix() == by_own.T_current_reference.matrix());
  CHECK(by_images.T_current_reference.matrix() == by_own.T_current_reference.matrix());
  CHECK(frames.bytes == native.bytes);
  CHECK(frames.number == native.number);
  CHECK(images.bytes == native.bytes);
}

TEST_CASE("a refiner with a full memory allocates nothing, on good frames and on bad ones") {
  RefinerOptions options;
  options.memory.capacity = 4;
  options.alignment.multi_start_threshold = 0;  // all paths are taken
  Refiner refiner(room::kCamera, options);
  std::vector<room::Frame> frames;
  std::vector<Pose> poses;
  for (int i = 0; i < 3; ++i) {
    poses.push_back(room::pose(.02 * i, 0, .01 * i, 0, .6 * i, 0));
    frames.push_back(room::render(room::kCamera, poses.back(), {true, -.3 + .05 * i, .4, 1.5}, static_cast<unsigned>(i + 1)));
  }
  Refinement result;
  int n = 0;
  const auto round = [&] {
    for (const bool masked : {true, false}) {
      for (std::size_t i = 0; i < frames.size(); ++i) {
        const AnyImage mask = masked ? AnyImage(frames[i].probability) : AnyImage();
        refiner.remember(frames[i].view(.25 * ++n), mask, poses[i]);
      }
      Refiner::Input in;
      in.frame = frames[1].view(.25 * ++n);
      if (masked) in.dynamic_probability = frames[1].probability;
      in.T_world_feature = in.T_world_predicted = in.T_world_previous = poses[2];
      in.S_change = 1;
      result = refiner.refine(in);
    }
  };
  for (int i = 0; i < 6; ++i) round();
  const Allocations a = count(round);
  CHECK(succeeded(result.status));
  CHECK(result.references > 0);
  CHECK(a.number == 0);
}
