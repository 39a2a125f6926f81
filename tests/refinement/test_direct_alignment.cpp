#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include <apso/refinement/align.hpp>
#include <apso/refinement/refiner.hpp>

#include "room.hpp"

using namespace apso;

namespace {
struct Pair {
  Pinhole camera = room::camera();
  FramePyramid reference, current;
  PyramidOptions options;
  Pair() { options.finest = 0, options.levels = 3; }
  void set(const room::Frame& r, const room::Frame& c, bool masks = false) {
    reference.build(r.view(), camera, masks ? r.probability.view() : ImageView<float>{}, options);
    current.build(c.view(), camera, masks ? c.probability.view() : ImageView<float>{}, options);
  }
};
}  // namespace

TEST_CASE("identical frames do not move") {
  Pair p;
  const room::Frame f = room::render(p.camera, Pose::Identity(), {}, 1);
  p.set(f, f);
  DirectAligner aligner;
  const AlignmentResult r = aligner.align({{&p.reference, Pose::Identity(), 1}}, p.current, {Pose::Identity()});
  REQUIRE(succeeded(r.status));
  CHECK(se3_log(r.T_world_camera).norm() < 1e-6);
  CHECK(direct_confidence(r).c_dir > .9);
}

TEST_CASE("from a pose that is near, nothing else need be tried; from one that is not, only the search comes back") {
  const Pose truth = room::pose(.25, .02, .05, 0, 14, 0);
  Pair p;
  p.options.finest = 0;
  p.options.levels = 4;
  p.set(room::render(p.camera, Pose::Identity(), {}, 1), room::render(p.camera, truth, {}, 2));
  AlignmentOptions options;
  options.multi_start_threshold = 0;  // searches always
  DirectAligner aligner(options);
  const std::vector<AlignmentReference> references{{&p.reference, Pose::Identity(), 1}};
  const auto error = [&](const AlignmentResult& r) { return succeeded(r.status) ? room::translation_error(r.T_world_camera, truth) : 1.0; };
  const Pose near = compose(truth, room::pose(.01, -.005, .005, .3, -.4, .2));
  CHECK(error(aligner.align_near(references, p.current, near)) < .003);
  CHECK(error(aligner.align(references, p.current, {near})) < .003);
  const Pose far = Pose::Identity();
  CHECK(error(aligner.align_near(references, p.current, far)) > .05);
  CHECK(error(aligner.align(references, p.current, {far})) < .003);
}

TEST_CASE("where the depth has many holes, a coarser level decides") {
  const Pose truth = room::pose(.03, -.02, .02, 1, -1.5, .8);
  Pair p;
  p.options.levels = 4;
  p.options.max_pixels = 0;
  room::Frame a = room::render(p.camera, Pose::Identity(), {}, 1), b = room::render(p.camera, truth, {}, 2);
  std::mt19937 rng(7);
  for (room::Frame* f : {&a, &b}) {
    for (int y = 0; y < f->depth.height(); ++y) {
      for (int x = 0; x < f->depth.width(); ++x) {
        if (rng() % 10 < 6) f->depth(x, y) = 0;
      }
    }
  }
  p.set(a, b);
  CHECK(p.reference.level(0).pixels.compared < p.reference.level(1).pixels.compared);
  for (const AlignmentOptions& options : {AlignmentOptions{}, dense_alignment()}) {
    const AlignmentResult r = DirectAligner(options).align({{&p.reference, Pose::Identity(), 1}}, p.current, {Pose::Identity()});
    REQUIRE(succeeded(r.status));
    CHECK(r.degenerate_count == 0);
    CHECK(room::translation_error(r.T_world_camera, truth) < .005);
  }
}

TEST_CASE("frames of different places are refused") {
  Pair p;
  p.set(room::render(p.camera, Pose::Identity()), room::render(p.camera, room::pose(0, 0, 0, 0, 180, 0)));
  const Pose guess = room::pose(0, 0, 0, 0, 180, 0);
  DirectAligner aligner;
  const AlignmentResult r = aligner.align({{&p.reference, Pose::Identity(), 1}}, p.current, {guess});
  CHECK_FALSE(succeeded(r.status));
  CHECK((r.T_world_camera.matrix() - guess.matrix()).norm() == 0);
  CHECK(direct_confidence(r).c_dir == 0);
}

TEST_CASE("frames that share little are aligned if what they share agrees, and refused otherwise") {
  // turned by most of the angle of view
  const Pose T = room::pose(.02, 0, .01, 0, 52, 0);
  Pair p;
  p.set(room::render(p.camera, Pose::Identity(), {}, 1), room::render(p.camera, T, {}, 2));
  const Pose guess = compose(T, room::pose(.01, -.01, 0, .2, 0, -.2));
  const auto align = [&](const AlignmentOptions& o) {
    DirectAligner aligner(o);
    return aligner.align({{&p.reference, Pose::Identity(), 1}}, p.current, {guess});
  };
  const AlignmentResult found = align({});
  REQUIRE(succeeded(found.status));
  CHECK(found.valid_share > .1);
  CHECK(found.valid_share < .2);
  CHECK(found.correlation > .9);
  CHECK(room::translation_error(found.T_world_camera, T) < .01);
  AlignmentOptions strict;
  strict.min_valid_share = .4;
  CHECK(align(strict).status == Status::NoOverlap);
  // depth alone does not say that it is the same place
  room::Frame dark[2];
  for (int i : {0, 1}) {
    dark[i] = room::render(p.camera, i == 0 ? Pose::Identity() : T, {}, static_cast<unsigned>(i + 1));
    std::fill_n(dark[i].intensity.data(), dark[i].intensity.size(), .1F);
  }
  p.set(dark[0], dark[1]);
  AlignmentOptions depth_alone;
  depth_alone.depth_alone = true;
  const AlignmentResult blind = align(depth_alone);
  CHECK(blind.correlation == 1);
  CHECK(blind.valid_share > .1);
  CHECK(blind.status == Status::NoOverlap);
}

TEST_CASE("a bare wall leaves at least three directions at the guess") {
  Pair p;
  room::Frame a, b;
  for (room::Frame* f : {&a, &b}) {
    f->intensity.assign(p.camera.width, p.camera.height, .5F);
    f->depth.assign(p.camera.width, p.camera.height, f == &a ? 2.0F : 1.97F);
  }
  p.set(a, b);
  const Pose guess = room::pose(.02, -.03, 0, 0, 0, 1);
  DirectAligner aligner;
  const AlignmentResult r = aligner.align({{&p.reference, Pose::Identity(), 1}}, p.current, {guess});
  CHECK(r.status == Status::Degenerate);
  CHECK(r.degenerate_count >= 3);
  // directions are those of the twist: a turned camera that moves along its axis leaves a share of 1 % in x
  CHECK(r.T_world_camera.translation().x() == doctest::Approx(.02).epsilon(.02).scale(0));
  CHECK(r.T_world_camera.translation().y() == doctest::Approx(-.03).epsilon(.01).scale(0));
  CHECK(std::abs(r.T_world_camera.translation().z() - .03) < 1e-3);
  CHECK(rotation_angle(r.T_world_camera) * 180 / 3.14159265 == doctest::Approx(1).epsilon(.01));
}

TEST_CASE("two copies of a reference tell no more than one, and every run is the same") {
  Pair p;
  const Pose truth = room::pose(.02, .01, -.02, .5, -1, .3);
  p.set(room::render(p.camera, Pose::Identity(), {}, 1), room::render(p.camera, truth, {}, 2));
  DirectAligner aligner;
  const AlignmentReference one{&p.reference, Pose::Identity(), 1};
  const AlignmentResult a = aligner.align({one}, p.current, {Pose::Identity()});
  const AlignmentResult b = aligner.align({one, one}, p.current, {Pose::Identity()});
  DirectAligner fresh;
  const auto backwards = [](int n, auto&& f) {
    for (int i = n - 1; i >= 0; --i) f(i);
  };
  const AlignmentResult c = fresh.align({one}, p.current, {Pose::Identity()}, backwards);
  REQUIRE(succeeded(a.status));
  CHECK(room::translation_error(a.T_world_camera, truth) < 2e-3);
  CHECK((a.T_world_camera.matrix() - b.T_world_camera.matrix()).norm() < 1e-6);
  CHECK((a.covariance - b.covariance).norm() < 1e-4 * a.covariance.norm());
  CHECK((a.T_world_camera.matrix().array() == c.T_world_camera.matrix().array()).all());
  CHECK((a.information.array() == c.information.array()).all());
}

TEST_CASE("recovers from 5 cm and 2 degrees with a masked moving slab over 40 % of the image") {
  Pair p;
  std::vector<double> errors;
  for (int k = 0; k < 5; ++k) {
    const double a = 1.3 * k;
    const Pose truth = room::pose(.05 * std::cos(a), .03 * std::sin(a), .04 * std::sin(a), std::cos(a), 1.7 * std::sin(a), .3);
    const room::Slab before{true, -.60, .75, 1.5};
    const room::Slab after{true, -.48, .75, 1.5};
    const room::Frame r = room::render(p.camera, Pose::Identity(), before, 1);
    const room::Frame c = room::render(p.camera, truth, after, 2);
    CHECK(c.dynamic_share > .35);
    p.set(r, c, true);
    DirectAligner aligner;
    const AlignmentResult result = aligner.align({{&p.reference, Pose::Identity(), 1}}, p.current, {Pose::Identity()});
    CHECK(succeeded(result.status));
    errors.push_back(room::translation_error(result.T_world_camera, truth));
  }
  std::sort(errors.begin(), errors.end());
  CHECK(errors[2] < .003);
  CHECK(errors[4] < .03);
}

TEST_CASE("broken input never becomes NaN") {
  Pair p;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  const room::Frame good = room::render(p.camera, Pose::Identity(), {}, 1);
  for (const float bad : {nan, inf, -inf, 0.0F, -1.0F}) {
    for (const int every : {1, 7}) {
      room::Frame f = good;
      for (std::size_t i = 0; i < f.depth.size(); i += static_cast<std::size_t>(every)) {
        f.depth.data()[i] = bad;
        f.intensity.data()[i] = bad;
        f.probability.data()[i] = bad;
      }
      p.set(good, f, true);
      DirectAligner aligner;
      const AlignmentResult r = aligner.align({{&p.reference, Pose::Identity(), 1}}, p.current, {Pose::Identity()});
      CHECK(is_finite(r.T_world_camera));
      CHECK(r.covariance.allFinite());
      CHECK(r.information.allFinite());
      CHECK(std::isfinite(r.cost));
      CHECK(std::isfinite(direct_confidence(r).c_dir));
      if (every == 1) CHECK_FALSE(succeeded(r.status));
    }
  }
}

TEST_CASE("one call aligns images of any type") {
  const Pinhole cam = room::camera(320);
  const Pose truth = room::pose(.02, -.01, .02, .5, -.7, .3);
  const room::Frame r = room::render(cam, Pose::Identity());
  const room::Frame c = room::render(cam, truth);
  Image<std::uint8_t> i8(cam.width, cam.height);
  for (std::size_t i = 0; i < i8.size(); ++i) {
    i8.data()[i] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(r.intensity.data()[i], 0.0F, 1.0F)));
  }
  const PairAlignment a = align(i8, r.depth, c.intensity.view(), c.depth.view(), cam);
  REQUIRE(succeeded(a.status));
  CHECK(room::translation_error(inverse(a.T_current_reference), truth) < 2e-3);
  CHECK(a.confidence > .5);
}

TEST_CASE("the refiner pulls a wrong feature pose to the truth, and keeps its hands off without a mask") {
  const Pinhole cam = room::camera(320);
  RefinerOptions o;
  o.pyramid.finest = 0;
  Refiner refiner(cam, o);
  Refiner::Input in;
  const room::Frame empty = room::render(cam, Pose::Identity());
  in.frame = empty.view(0);
  CHECK(refiner.refine(in).status == Status::NoReference);
  refiner.reset();
  Pose last = Pose::Identity();
  for (int i = 0; i < 8; ++i) {
    last = room::pose(.01 * i, 0, .005 * i, 0, .3 * i, 0);
    const room::Frame f = room::render(cam, last, {}, static_cast<unsigned>(i + 1));
    refiner.remember(f.view(i / 30.0), f.probability, last);
  }
  CHECK(refiner.memory().size() >= 2);
  const Pose truth = room::pose(.08, 0, .04, 0, 2.4, 0);
  const room::Frame f = room::render(cam, truth, {}, 99);
  in.frame = f.view(8 / 30.0);
  in.T_world_feature = truth * room::pose(.04, .02, 0, 1, 0, 0);
  in.T_world_predicted = truth * room::pose(.01, 0, 0, 0, 0, 0);
  in.T_world_previous = last;
  in.S_change = 1;
  const Refinement r = refiner.refine(in);
  CHECK(succeeded(r.status));
  CHECK(r.references >= 2);
  CHECK(r.c_dir > .5);
  CHECK(room::translation_error(r.T_world_direct, truth) < .003);
  CHECK(room::translation_error(r.T_world_camera, truth) < .5 * room::translation_error(in.T_world_feature, truth));
  in.highly_dynamic = true;
  CHECK(refiner.refine(in).status == Status::NoMask);
  CHECK((refiner.refine(in).T_world_camera.matrix() - in.T_world_feature.matrix()).norm() == 0);
  in.highly_dynamic = false;
  in.feature_ok = false;
  CHECK(refiner.refine(in).w_eff == 0);
}
