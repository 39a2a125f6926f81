#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <apso/refinement/cost/alignment_cost.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/refinement/start/orientation_search.hpp>
#include <apso/refinement/start/start_search.hpp>

#include "room.hpp"

using namespace apso;

namespace {

void build(const room::Frame& f, FramePyramid& out) {
  PyramidOptions o;
  o.finest = 0;
  out.build(f.view(), room::kSmallCamera, f.probability.view(), o, PyramidRole::Both);
}
// Nothing is known of columns from .. to.
void mask(room::Frame& f, int from, int to) {
  for (int y = 0; y < room::kSmallCamera.height; ++y) {
    for (int x = from; x < to; ++x) f.probability(x, y) = 1.0F;
  }
}

std::vector<Eigen::Matrix3d> search(const room::Frame& reference, const room::Frame& current,
                                    const Eigen::Matrix3d& around = Eigen::Matrix3d::Identity()) {
  FramePyramid r, c;
  build(reference, r);
  build(current, c);
  OrientationSearch s;
  std::vector<Eigen::Matrix3d> out;
  s(r.halved(0), c.halved(0), around, out);
  return out;
}
double angle(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return rotation_angle(make_pose(a * b.transpose(), Eigen::Vector3d(0, 0, 0)));
}

Pose motion(unsigned seed, double metres, double degrees) {
  const double a = 0.8 * seed;
  return room::pose(metres * std::cos(a), .02, metres * std::sin(a), .4 * degrees * std::sin(2 * a), .85 * degrees * std::cos(3 * a),
                    .3 * degrees * std::sin(a));
}
}  // namespace

TEST_CASE("a turn of 12 degrees is seen from the directions of walls, however far the camera went") {
  const Pose T_corner = room::pose(0, 0, -.5, 15, 40, 0);  // two walls and the floor
  for (unsigned seed = 1; seed <= 8; ++seed) {
    CAPTURE(seed);
    const Pose T = motion(seed, .5, 12);
    const std::vector<Eigen::Matrix3d> found = search(room::render(room::kSmallCamera, T_corner, {}, 2 * seed),
                                                      room::render(room::kSmallCamera, compose(T_corner, T), {}, 2 * seed + 1));
    REQUIRE(!found.empty());
    CHECK(angle(found.front(), rotation(inverse(T))) < kDegree);
  }
}

TEST_CASE("walls tell the turn even if both frames share no pixel") {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    CAPTURE(seed);
    const Pose T = motion(seed, .1, 8);
    room::Frame r = room::render(room::kSmallCamera, Pose::Identity(), {}, 2 * seed);
    room::Frame c = room::render(room::kSmallCamera, T, {}, 2 * seed + 1);
    mask(r, 60, 160);  // eight degrees are 19 pixels
    mask(c, 0, 85);
    const std::vector<Eigen::Matrix3d> found = search(r, c);
    double nearest = 1;  // most of what is seen is the wall in front, about whose normal little tells the turn
    for (const Eigen::Matrix3d& R : found) nearest = std::min(nearest, angle(R, rotation(inverse(T))));
    CHECK(nearest < 2.5 * kDegree);
  }
}

TEST_CASE("a large turn is seen from near the guess, and not from elsewhere") {
  const Pose T = room::pose(.1, 0, .1, 3, 30, 2);
  const room::Frame r = room::render(room::kSmallCamera, Pose::Identity(), {}, 1);
  const room::Frame c = room::render(room::kSmallCamera, T, {}, 2);
  const Eigen::Matrix3d truth = rotation(inverse(T));
  const Eigen::Matrix3d guess = rotation(room::pose(0, 0, 0, 0, -22, 0));
  const std::vector<Eigen::Matrix3d> near = search(r, c, guess);
  REQUIRE(!near.empty());
  CHECK(angle(near.front(), truth) < kDegree);
  // the grid, half a step beside it, and what refinement adds
  for (const Eigen::Matrix3d& R : near) CHECK(angle(R, guess) < OrientationSearch::kMaxAngle + 5 * kDegree);
  for (const Eigen::Matrix3d& R : search(r, c)) CHECK(angle(R, truth) > 10 * kDegree);
}

TEST_CASE("guesses about a bare wall agree on the wall and differ in the turn about its normal") {
  room::Frame wall = room::render(room::kSmallCamera, Pose::Identity());
  room::Frame turned = wall;
  const Eigen::Matrix3d R = rotation(room::pose(0, 0, 0, 3, -6, 0));
  const Eigen::Vector3d n = R * Eigen::Vector3d(0, 0, -1);
  for (int y = 0; y < room::kSmallCamera.height; ++y) {
    for (int x = 0; x < room::kSmallCamera.width; ++x) {
      wall.depth(x, y) = 2;
      turned.depth(x, y) = static_cast<float>(2 * n.z() / n.dot(room::kSmallCamera.unproject(x, y, 1.0)));
    }
  }
  const std::vector<Eigen::Matrix3d> found = search(wall, turned);
  REQUIRE(found.size() > 1);
  for (std::size_t i = 0; i < found.size(); ++i) {
    CHECK(std::acos(std::min(1.0, n.dot(found[i] * Eigen::Vector3d(0, 0, -1)))) < .3 * kDegree);
    for (std::size_t j = 0; j < i; ++j) CHECK(angle(found[i], found[j]) > 2 * kDegree);
  }
}

TEST_CASE("a wall seen at a grazing angle tells its direction as well") {
  const Eigen::Vector3d before = rotation(room::pose(0, 0, 0, 0, -70, 0)) * Eigen::Vector3d(0, 0, -1);
  const Eigen::Vector3d after = rotation(room::pose(0, 0, 0, 3, 2, 0)) * before;
  const auto wall = [](const Eigen::Vector3d& n) {
    room::Frame f = room::render(room::kSmallCamera, Pose::Identity());
    for (int y = 0; y < room::kSmallCamera.height; ++y) {
      for (int x = 0; x < room::kSmallCamera.width; ++x) {
        const double z = -0.7 / n.dot(room::kSmallCamera.unproject(x, y, 1.0));
        f.depth(x, y) = x > 70 && z > 0 && z < 5 ? static_cast<float>(z) : 0.0F;  // where it is more than 2 % deeper with each pixel
      }
    }
    return f;
  };
  const std::vector<Eigen::Matrix3d> found = search(wall(before), wall(after));
  REQUIRE(!found.empty());
  for (const Eigen::Matrix3d& R : found) CHECK(std::acos(std::min(1.0, after.dot(R * before))) < .5 * kDegree);
}

TEST_CASE("without depth no turn is guessed") {
  const room::Frame good = room::render(room::kSmallCamera, Pose::Identity());
  room::Frame blind = good;
  blind.depth.assign(160, 120, 0.0F);
  CHECK(search(blind, good).empty());
  CHECK(search(good, blind).empty());
}

TEST_CASE("one right match of corners is enough where the turn is known") {
  const Pose T = motion(3, .2, 10);
  FramePyramid r, c;
  build(room::render(room::kSmallCamera, Pose::Identity(), {}, 1), r);
  build(room::render(room::kSmallCamera, T, {}, 2), c);
  CornerSearch corners;
  std::vector<Pose> motions;
  corners(r, c, 0, motions);
  const Pose T_current_reference = inverse(T);
  const Eigen::Vector3d around(.1, 0, 0);
  corners.with_rotations({rotation(T_current_reference)}, around, .4, .02, motions);
  REQUIRE(motions.size() > 1);
  double nearest = 1;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    CHECK((motions[i].translation() - around).norm() < .4);
    nearest = std::min(nearest, (motions[i].translation() - T_current_reference.translation()).norm());
    for (std::size_t j = 0; j < i; ++j) CHECK((motions[i].translation() - motions[j].translation()).norm() >= .02);
  }
  CHECK(nearest < .02);
  corners.with_rotations({}, around, .4, .02, motions);
  CHECK(motions.empty());
}

TEST_CASE("starts: what was found first, the rest by support, and one of them near the truth where corners alone find none") {
  int near = 0;
  int near_by_corners = 0;
  constexpr unsigned kPairs = 24;
  for (unsigned seed = 1; seed <= kPairs; ++seed) {
    CAPTURE(seed);
    const Pose T = motion(seed, .2, 10);
    room::Frame r = room::render(room::kSmallCamera, Pose::Identity(), {}, 2 * seed);
    room::Frame c = room::render(room::kSmallCamera, T, {}, 2 * seed + 1);
    mask(r, 80, 160);
    mask(c, 0, 70);
    FramePyramid reference, current;
    build(r, reference);
    build(c, current);
    AlignmentCost cost{AlignmentOptions{}};
    const RobustKernel kernel;
    const NoiseModel noise;
    REQUIRE(cost.begin({{&reference, Pose::Identity(), 1}}, current, KernelRef(kernel), NoiseRef(noise), false));
    const Pose T_found = room::pose(.05, 0, 0, 0, 2, 0);
    StartSearch search;
    const std::vector<Start>& starts = search(cost, 0, T_found, Pose::Identity(), SerialExecutor{});
    REQUIRE(starts.size() > 1);
    CHECK(starts.front().T_camera_world.matrix() == T_found.matrix());
    const auto is_near = [&](const Pose& T_camera_world) {
      const Pose e = compose(T_camera_world, T);
      return e.translation().norm() < .1 && rotation_angle(e) < 2 * kDegree;
    };
    const std::size_t solved = std::min<std::size_t>(6, starts.size());
    near += std::any_of(starts.begin(), starts.begin() + static_cast<std::ptrdiff_t>(solved),
                        [&](const Start& s) { return is_near(s.T_camera_world); });
    for (std::size_t i = 2; i < starts.size(); ++i) CHECK(starts[i - 1].support >= starts[i].support);
    CornerSearch corners;
    std::vector<Pose> guesses;
    corners(reference, current, 0, guesses);
    near_by_corners += std::any_of(guesses.begin(), guesses.end(), is_near);
    REQUIRE(cost.begin({{&reference, Pose::Identity(), 1}}, current, KernelRef(kernel), NoiseRef(noise), false));
    StartSearch again;
    const std::vector<Start>& same = again(cost, 0, T_found, Pose::Identity(), SerialExecutor{});
    REQUIRE(same.size() == starts.size());
    for (std::size_t i = 0; i < same.size(); ++i) CHECK(same[i].T_camera_world.matrix() == starts[i].T_camera_world.matrix());
  }
  CHECK(near >= near_by_corners + 3);
}
