#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <apso/refinement/aligner.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/refinement/start/corner_search.hpp>

#include "room.hpp"

using namespace apso;

namespace {

void build(const room::Frame& f, bool mask, FramePyramid& out) {
  PyramidOptions o;
  o.finest = 0;
  out.build(f.view(), room::kSmallCamera, mask ? f.probability.view() : ImageView<const float>{}, o, PyramidRole::Both);
}

std::vector<Pose> search_corners(const room::Frame& reference, const room::Frame& current, bool mask = false) {
  FramePyramid r, c;
  build(reference, mask, r);
  build(current, mask, c);
  CornerSearch s;
  std::vector<Pose> out;
  s(r, c, 0, out);
  return out;
}

// Nearest guess: [m] and [rad], the larger with 2 m to a radian.
double nearest(const std::vector<Pose>& guesses, const Pose& T_world_current) {
  double best = 1e9;
  for (const Pose& T_current_reference : guesses) {
    const Pose e = compose(T_current_reference, T_world_current);
    best = std::min(best, std::max(translation_norm(se3_log(e)), 2 * rotation_angle(e)));
  }
  return best;
}
}  // namespace

TEST_CASE("where a corner went is found to a fraction of a pixel") {
  const Pose T = room::pose(.03, .02, -.04, .7, -.6, 1);
  FramePyramid r, c;
  build(room::render(room::kSmallCamera, Pose::Identity(), {}, 1), false, r);
  build(room::render(room::kSmallCamera, T, {}, 2), false, c);
  CornerMatcher matcher;
  std::vector<CornerMatch> matches;
  CHECK(matcher(r.halved(0), c.halved(0), matches) > 100);
  const Pose T_current_reference = inverse(T);
  std::vector<double> off;  // [px]
  for (const CornerMatch& m : matches) {
    CHECK(m.pixel == doctest::Approx(1 / room::kSmallCamera.fx));
    const Eigen::Vector3d y = transform(T_current_reference, m.p.cast<double>());
    const Eigen::Vector2d should = y.head<2>() / y.z();
    const Eigen::Vector2d is = m.q.head<2>().cast<double>() / static_cast<double>(m.q.z());
    const double distance = (should - is).norm() * room::kSmallCamera.fx;
    if (distance < 2) off.push_back(distance);
  }
  CHECK(off.size() > matches.size() / 2);
  std::nth_element(off.begin(), off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2), off.end());
  CHECK(off[off.size() / 2] < .25);  // whole pixels would be off by 0.40 in the median: pi r^2 = 1/2
}

TEST_CASE("a motion of 30 cm and 20 degrees is guessed from corners") {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    CAPTURE(seed);
    const double a = 0.8 * seed;
    const Pose T = room::pose(.3 * std::cos(a), .05, .3 * std::sin(a), 5 * std::sin(2 * a), 18 * std::cos(a), 8 * std::sin(a));
    const std::vector<Pose> found = search_corners(room::render(room::kSmallCamera, Pose::Identity(), {}, 2 * seed),
                                                   room::render(room::kSmallCamera, T, {}, 2 * seed + 1));
    REQUIRE(!found.empty());
    CHECK(nearest({found.front()}, T) < .04);  // two pixels
  }
}

TEST_CASE("a body that moves and the room behind it give guesses of their own, and a mask leaves one") {
  const Pose T = room::pose(.1, .02, .05, 1, 4, -2);
  room::Slab before{true, -.6, 1.2, 1.5};
  room::Slab after = before;
  after.x += .25;
  const room::Frame r = room::render(room::kSmallCamera, Pose::Identity(), before, 1);
  const room::Frame c = room::render(room::kSmallCamera, T, after, 2);
  // where the camera would stand if the body had not moved
  const Pose T_by_the_body = compose(make_pose(identity<Eigen::Matrix3d>(), Eigen::Vector3d(-.25, 0, 0)), T);
  const std::vector<Pose> both = search_corners(r, c);
  CHECK(nearest(both, T) < .08);  // a third of the 25 cm between the two
  CHECK(nearest(both, T_by_the_body) < .08);
  const std::vector<Pose> masked = search_corners(r, c, true);
  REQUIRE(!masked.empty());
  CHECK(nearest({masked.front()}, T) < .08);
}

TEST_CASE("a motion of 20 cm and 10 degrees is guessed beside a mask that covers 60 % of both images") {
  const Pinhole camera = room::camera(320);
  for (unsigned seed = 1; seed <= 12; ++seed) {
    CAPTURE(seed);
    const double a = 0.5 * seed;
    const Pose T = room::pose(.2 * std::cos(a), .02, .2 * std::sin(a), 3 * std::sin(2 * a), 9 * std::cos(3 * a), 4 * std::sin(a));
    // in the middle of where the camera looks halfway
    const double middle = .5 * (.2 * std::cos(a)) + 1.5 * std::tan(.5 * 9 * std::cos(3 * a) * .01745);
    const room::Slab before{true, middle - .55, 1.1, 1.5};
    room::Slab after = before;
    after.x += .05;
    const room::Frame r = room::render(camera, Pose::Identity(), before, 2 * seed);
    const room::Frame c = room::render(camera, T, after, 2 * seed + 1);
    PyramidOptions o;
    o.finest = 0;
    FramePyramid reference, current;
    reference.build(r.view(), camera, r.probability.view(), o, PyramidRole::Both);
    current.build(c.view(), camera, c.probability.view(), o, PyramidRole::Both);
    CornerSearch s;
    std::vector<Pose> found;
    s(reference, current, 1, found);
    CHECK(r.dynamic_share > .5);
    CHECK(c.dynamic_share > .5);
    REQUIRE(!found.empty());
    CHECK(nearest({found.front()}, T) < .023);  // a pixel of 160x120 at 3 m
  }
}

TEST_CASE("frames that are mostly masked are given other starts") {
  const Pinhole camera = room::camera(320);
  int right = 0;
  int right_without = 0;
  constexpr unsigned kPairs = 12;
  for (unsigned seed = 1; seed <= kPairs; ++seed) {
    const double a = 0.5 * seed;
    const Pose T = room::pose(.2 * std::cos(a), .02, .2 * std::sin(a), 3 * std::sin(2 * a), 9 * std::cos(3 * a), 4 * std::sin(a));
    const double middle = .5 * (.2 * std::cos(a)) + 1.5 * std::tan(.5 * 9 * std::cos(3 * a) * .01745);
    const room::Slab body{true, middle - .55, 1.1, 1.5};
    const room::Frame r = room::render(camera, Pose::Identity(), body, 2 * seed);
    const room::Frame c = room::render(camera, T, body, 2 * seed + 1);
    FramePyramid reference, current;
    reference.build(r.view(), camera, r.probability.view(), {}, PyramidRole::Reference);
    current.build(c.view(), camera, c.probability.view(), {}, PyramidRole::Current);
    CHECK(reference.finest() == 0);
    const auto solve = [&](double multi_start_threshold) {
      AlignmentOptions o;
      o.multi_start_threshold = multi_start_threshold;
      DirectAligner aligner(o);
      const AlignmentResult found = aligner.align({{&reference, Pose::Identity(), 1}}, current, {Pose::Identity()});
      return succeeded(found.status) && room::translation_error(found.T_world_camera, T) < .01 ? 1 : 0;
    };
    right += solve(AlignmentOptions{}.multi_start_threshold);
    right_without += solve(1);
  }
  CHECK(right >= 11);
  CHECK(right >= right_without + 3);
}

TEST_CASE("nothing is guessed where there is nothing to go by") {
  room::Frame blank = room::render(room::kSmallCamera, Pose::Identity());
  const room::Frame good = blank;
  blank.intensity.assign(160, 120, .5F);
  CHECK(search_corners(blank, good).empty());
  CHECK(search_corners(good, blank).empty());
  room::Frame no_depth = good;
  no_depth.depth.assign(160, 120, 0.0F);
  CHECK(search_corners(no_depth, good).empty());
}

TEST_CASE("a reference in memory keeps what corners are looked for in") {
  const Pose T = room::pose(.2, 0, .1, 3, 9, 2);
  FramePyramid r, c, kept;
  build(room::render(room::kSmallCamera, Pose::Identity(), {}, 1), false, r);
  build(room::render(room::kSmallCamera, T, {}, 2), false, c);
  kept.assign_reference(r);
  CornerSearch s;
  std::vector<Pose> from_all, from_kept;
  s(r, c, 0, from_all);
  s(kept, c, 0, from_kept);
  REQUIRE(!from_all.empty());
  REQUIRE(from_all.size() == from_kept.size());
  CHECK(from_all.front().matrix() == from_kept.front().matrix());
}

TEST_CASE("the same frames give the same guesses, whatever came before") {
  const Pose T = room::pose(.2, 0, .1, 3, 9, 2);
  const room::Frame a = room::render(room::kSmallCamera, Pose::Identity(), {}, 1);
  const room::Frame b = room::render(room::kSmallCamera, T, {}, 2);
  FramePyramid pa, pb;
  build(a, false, pa);
  build(b, false, pb);
  CornerSearch s;
  std::vector<Pose> first, other, second;
  s(pa, pb, 0, first);
  s(pb, pa, 0, other);
  s(pa, pb, 0, second);
  REQUIRE(first.size() == second.size());
  for (std::size_t i = 0; i < first.size(); ++i) CHECK(first[i].matrix() == second[i].matrix());
}
