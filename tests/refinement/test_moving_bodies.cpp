#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <apso/refinement/aligner.hpp>

#include "../../benchmarks/alignment_pairs.hpp"
#include "room.hpp"

using namespace apso;

namespace {

struct Aligned {
  AlignmentResult result;
  double error = 0;  // [m]
};

Aligned run(const room::Frame& r, const room::Frame& c, const Pose& T_world_current, bool mask, const AlignmentOptions& options = {}) {
  PyramidOptions o;
  o.finest = 0;
  FramePyramid reference, current;
  reference.build(r.view(), room::kCamera, mask ? r.probability.view() : ImageView<const float>{}, o, PyramidRole::Reference);
  current.build(c.view(), room::kCamera, mask ? c.probability.view() : ImageView<const float>{}, o, PyramidRole::Current);
  DirectAligner aligner(options);
  Aligned a;
  a.result = aligner.align({{&reference, Pose::Identity(), 1.0}}, current, {Pose::Identity()});
  a.error = room::translation_error(a.result.T_world_camera, T_world_current);
  return a;
}

double median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}
}  // namespace

TEST_CASE("a body that covers 10 to 60 % of the view: true mask, half wrong mask, no mask") {
  for (const double share : {.1, .3, .45, .6}) {
    CAPTURE(share);
    std::vector<double> without_body, true_mask, half_mask, no_mask;
    for (unsigned seed = 1; seed <= 5; ++seed) {
      const double sign = seed % 2 == 0 ? 1 : -1;
      const Pose T = room::pose(.02 * sign, -.01, .01 * seed, .5, -.4 * sign * seed, .3);
      room::Slab before{true, -.3 - .5 * share, 1.5 * 320 / 262.5 * share, 1.5};
      room::Slab after = before;
      after.x += .05;
      room::Frame r = room::render(room::kCamera, Pose::Identity(), before, 2 * seed);
      room::Frame c = room::render(room::kCamera, T, after, 2 * seed + 1);
      const room::Frame r0 = room::render(room::kCamera, Pose::Identity(), {}, 2 * seed);
      const room::Frame c0 = room::render(room::kCamera, T, {}, 2 * seed + 1);
      without_body.push_back(run(r0, c0, T, false).error);
      no_mask.push_back(run(r, c, T, false).error);
      const Aligned a = run(r, c, T, true);
      CHECK(succeeded(a.result.status));
      true_mask.push_back(a.error);
      pairs::spoil_mask(r.probability);
      pairs::spoil_mask(c.probability);
      half_mask.push_back(run(r, c, T, true).error);
    }
    CHECK(median(true_mask) < 1.5 * median(without_body));
    // of 60 % such a mask leaves a tenth of the image that does not move, and three tenths that do
    if (share < .6) CHECK(median(half_mask) < 2 * median(without_body));
    CHECK(median(no_mask) < 3 * median(without_body));
  }
}

TEST_CASE("what moves does not set the scale of the residuals, even where it fills most of the image") {
  const Pose T = room::pose(.02, -.01, .02, .5, -.4, .3);
  const auto scales = [&](const room::Slab& before) {
    room::Slab after = before;
    after.x += .05;
    FramePyramid reference, current;
    const room::Frame r = room::render(room::kCamera, Pose::Identity(), before, 2);
    const room::Frame c = room::render(room::kCamera, T, after, 3);
    reference.build(r.view(), room::kCamera, {}, {}, PyramidRole::Reference);
    current.build(c.view(), room::kCamera, {}, {}, PyramidRole::Current);
    if (before.on) CHECK(r.dynamic_share > .55);
    DirectAligner aligner;
    return aligner.evaluate({{&reference, Pose::Identity(), 1.0}}, current, T);
  };
  const AlignmentResult without = scales({});
  const AlignmentResult with = scales({true, -.6, 1.1, 1.5});
  REQUIRE(succeeded(without.status));
  REQUIRE(succeeded(with.status));
  CHECK(with.scale_intensity < 2 * without.scale_intensity);
  CHECK(with.scale_depth < 2 * without.scale_depth);
}

TEST_CASE("two bodies that fill 60 % of the view, without a mask: most pairs are right") {
  const pairs::PairMaker maker(77);
  pairs::Conditions conditions;
  conditions.moving_share = .6;
  DirectAligner aligner;
  FramePyramid reference, current;
  int right = 0;
  constexpr int kViews = 8;
  for (int view = 0; view < kViews; ++view) {
    const pairs::Pair p = maker.make(view, .04, conditions);
    reference.build({0.0, p.reference.intensity, p.reference.depth}, maker.camera(), {}, {}, PyramidRole::Reference);
    current.build({0.0, p.current.intensity, p.current.depth}, maker.camera(), {}, {}, PyramidRole::Current);
    const AlignmentResult r = aligner.align({{&reference, Pose::Identity(), 1.0}}, current, {Pose::Identity()});
    right += room::translation_error(r.T_world_camera, inverse(p.T_current_reference)) < .01 ? 1 : 0;
  }
  CHECK(right > kViews / 2);
}

TEST_CASE("frames that are mostly masked are aligned one level finer, where all of them are") {
  const Pinhole camera = room::camera(640);
  PyramidOptions usual;
  usual.finer_level_mask_share = 1;
  const auto align = [&](const room::Frame& r, const room::Frame& c, const PyramidOptions& o) {
    FramePyramid reference, current;
    reference.build(r.view(), camera, r.probability.view(), o, PyramidRole::Reference);
    current.build(c.view(), camera, c.probability.view(), o, PyramidRole::Current);
    DirectAligner aligner;
    return aligner.align({{&reference, Pose::Identity(), 1.0}}, current, {Pose::Identity()});
  };
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const double sign = seed % 2 == 0 ? 1 : -1;
    const Pose T = room::pose(.02 * sign, -.01, .01, .5, -.4 * sign, .3);
    const room::Slab half{true, -.4, 1.1, 1.5};
    const room::Frame r = room::render(camera, Pose::Identity(), half, 2 * seed);
    const room::Frame c = room::render(camera, T, half, 2 * seed + 1);
    CHECK(r.dynamic_share > .5);
    CHECK(c.dynamic_share > .5);
    const AlignmentResult fine = align(r, c, {});
    const AlignmentResult coarse = align(r, c, usual);
    REQUIRE(succeeded(fine.status));
    REQUIRE(succeeded(coarse.status));
    CHECK(room::translation_error(fine.T_world_camera, T) < .003);
    CHECK(fine.counts.selected > 3 * coarse.counts.selected);
    if (seed > 1) continue;
    // one of the two has no such level: the same as ever
    const room::Frame little = room::render(camera, T, {true, -.4, .2, 1.5}, 3);
    CHECK(little.dynamic_share < .4);
    const AlignmentResult a = align(r, little, {});
    const AlignmentResult b = align(r, little, usual);
    REQUIRE(succeeded(a.status));
    CHECK((a.T_world_camera.matrix().array() == b.T_world_camera.matrix().array()).all());
  }
}

TEST_CASE("a motion far beyond the reach of one descent is found from other starts") {
  AlignmentOptions one;
  one.multi_start_threshold = 1;
  int right = 0;
  int right_one = 0;
  for (unsigned seed = 1; seed <= 12; ++seed) {
    const double a = 0.9 * seed;
    const Pose T =
        room::pose(.2 * std::cos(a), .05 * std::sin(2 * a), .2 * std::sin(a), 8 * std::sin(3 * a), 14 * std::cos(2 * a), 6 * std::cos(a));
    const room::Frame r = room::render(room::kCamera, Pose::Identity(), {}, 2 * seed);
    const room::Frame c = room::render(room::kCamera, T, {}, 2 * seed + 1);
    right += run(r, c, T, false).error < .005 ? 1 : 0;
    right_one += run(r, c, T, false, one).error < .005 ? 1 : 0;
  }
  CHECK(right >= 11);
  CHECK(right >= right_one + 3);
}
