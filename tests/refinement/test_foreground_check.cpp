// Somebody near the camera, before a wall: depth split, what the check makes of it, and features that hang on him.
#include <cmath>
#include <cstddef>
#include <vector>

#include <doctest/doctest.h>

#include <apso/align.hpp>
#include <apso/refinement/cost/depth_split.hpp>
#include <apso/refinement/refiner.hpp>
#include <apso/testing/synthetic.hpp>
#include <apso/traits/images/eigen_image.hpp>

#include "room.hpp"

using namespace apso;

namespace {
PixelList tiles_of(const std::vector<std::pair<float, int>>& depths_and_pixels) {
  PixelList list;
  for (const auto& [depth, count] : depths_and_pixels) {
    PixelList::Tile t;
    t.depth = depth;
    t.count = count;
    list.tiles.push_back(t);
  }
  return list;
}
DepthSplit::At split(const PixelList& list, float nearest = 0) {
  DepthSplit s;
  s.add(list);
  s.sort();
  return s.find(nearest);
}

// Somebody walks by near a camera that turns before a wall.
constexpr unsigned kSeed = 103;
constexpr int kFirst = 2;
struct PersonNear {
  testing::SyntheticSequence sequence{"walking_rpy", options()};
  testing::SyntheticFrame frames[8];
  PersonNear() {
    for (int i = 0; i < 8; ++i) sequence.render(kFirst + i, frames[i]);
  }
  static testing::SyntheticOptions options() {
    testing::SyntheticOptions o;
    o.seed = kSeed;
    return o;
  }
  [[nodiscard]] auto frame(int i) const {
    return apso::frame(frames[i].timestamp, frames[i].intensity, frames[i].depth, sequence.camera());
  }
  [[nodiscard]] RgbdFrame view(int i) const { return {frames[i].timestamp, frames[i].intensity, frames[i].depth}; }
  [[nodiscard]] Pose T_world_camera(int i) const { return frames[i].T_world_camera; }
};
struct EigenFrame {
  using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  explicit EigenFrame(const testing::SyntheticFrame& f)
      : intensity(Eigen::Map<const Matrix>(f.intensity.data(), f.intensity.height(), f.intensity.width())),
        depth(Eigen::Map<const Matrix>(f.depth.data(), f.depth.height(), f.depth.width())) {}
  Matrix intensity, depth;
};
const PersonNear& person_near() {
  static const PersonNear w;
  return w;
}
}  // namespace

TEST_CASE("a view is split where its inverse depths differ most, and what is near of the rest once more") {
  const PixelList list = tiles_of({{1.0F, 30}, {3.9F, 10}, {1.1F, 20}, {2.1F, 20}, {4.0F, 10}, {1.9F, 10}});
  const DepthSplit::At first = split(list);
  CHECK(first.distance > 1.1F);
  CHECK(first.distance < 1.9F);
  CHECK(first.beyond == doctest::Approx(.5));
  const DepthSplit::At second = split(list, first.distance);
  CHECK(second.distance > 2.1F);
  CHECK(second.distance < 3.9F);
  CHECK(second.beyond == doctest::Approx(.2));  // of all pixels
  CHECK(split(list, 3.95F).distance == 0);      // one tile is left
  CHECK(split(tiles_of({})).distance == 0);
  CHECK(split(tiles_of({{2.0F, 5}})).distance == 0);
  CHECK(split(tiles_of({{2.0F, 5}, {2.0F, 7}})).distance == 0);
  CHECK(split(tiles_of({{0.0F, 5}, {2.0F, 0}})).distance == 0);  // no depth, no pixel
}

TEST_CASE("the split has the largest variance between its classes of all splits") {
  std::vector<std::pair<float, int>> tiles;
  for (int i = 0; i < 60; ++i) {
    const double u = room::lattice(i, 3, 1);
    tiles.emplace_back(static_cast<float>(.5 + 4 * u * u), 1 + static_cast<int>(20 * room::lattice(i, 5, 2)));
  }
  const auto between = [&](double distance) {
    double n[2] = {0, 0}, sum[2] = {0, 0};
    for (const auto& [depth, count] : tiles) {
      const int k = static_cast<double>(depth) > distance ? 1 : 0;
      n[k] += count;
      sum[k] += count / static_cast<double>(depth);
    }
    const double apart = n[0] > 0 && n[1] > 0 ? sum[0] / n[0] - sum[1] / n[1] : 0.0;
    return n[0] * n[1] * apart * apart;
  };
  const DepthSplit::At at = split(tiles_of(tiles));
  REQUIRE(at.distance > 0);
  for (const auto& [depth, count] : tiles) {
    CHECK(between(static_cast<double>(depth)) <= between(static_cast<double>(at.distance)) * (1 + 1e-12));
  }
}

TEST_CASE("somebody who walks by before a wall takes the pose along; without him it is right, and he is told") {
  const PersonNear& w = person_near();
  PairOptions no_check;
  no_check.alignment.regions = false;
  int found = 0;
  int led_astray = 0;
  for (int i = 0; i + 1 < 8; ++i) {
    CAPTURE(i);
    const Pose truth = inverse(w.T_world_camera(i + 1)) * w.T_world_camera(i);
    const PairAlignment<> all = align(w.frame(i), w.frame(i + 1), identity_pose(), no_check);
    led_astray += room::translation_error(all.T_current_reference, truth) > .008 ? 1 : 0;
    const PairAlignment<> a = align(w.frame(i), w.frame(i + 1));
    REQUIRE(succeeded(a.status));
    if (!(a.detail.foreground > 0)) continue;
    ++found;
    CHECK(room::translation_error(a.T_current_reference, truth) < .004);
    double beyond = 0;
    double seen = 0;
    for (std::size_t k = 0; k < w.frames[i].depth.size(); ++k) {
      const float z = w.frames[i].depth.data()[k];
      seen += z > 0 ? 1 : 0;
      beyond += static_cast<double>(z) > a.detail.foreground ? 1 : 0;
    }
    CHECK(beyond > .25 * seen);
    CHECK(beyond < .95 * seen);
    CHECK(a.detail.static_share < .9);
    if (found > 1) continue;
    const EigenFrame r(w.frames[i]), c(w.frames[i + 1]);  // images of another type: the same
    const PairAlignment<> b = align(r.intensity, r.depth, c.intensity, c.depth, w.sequence.camera());
    CHECK(b.detail.foreground == a.detail.foreground);
    CHECK((b.T_current_reference.matrix() - a.T_current_reference.matrix()).norm() == 0);
  }
  CHECK(led_astray >= 6);
  CHECK(found >= 6);
}

TEST_CASE("nothing is left out of a scene at rest, and near things that do not move are no foreground that does") {
  const testing::SyntheticSequence sequence("static_halfsphere");
  testing::SyntheticFrame a, b;
  for (int i = 0; i < 30; i += 10) {
    CAPTURE(i);
    sequence.render(i, a);
    sequence.render(i + 2, b);
    const PairAlignment<> r =
        align(apso::frame(0, a.intensity, a.depth, sequence.camera()), apso::frame(1, b.intensity, b.depth, sequence.camera()));
    CHECK(r.detail.foreground == 0);
  }
  const room::Slab slab{true, -.4, .8, 1.2};
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), slab, 1);
  const room::Frame c = room::render(room::kCamera, room::kTruth, slab, 2);
  CHECK(r.dynamic_share > .2);
  const PairAlignment<> still = align(r.intensity, r.depth, c.intensity, c.depth, room::kCamera);
  CHECK(still.detail.foreground == 0);
  CHECK(still.detail.static_share > .9);
}

TEST_CASE("features that hang on what moves in front are not joined") {
  const PersonNear& w = person_near();
  for (const bool moves : {true, false}) {
    CAPTURE(moves);
    const int current = moves ? 2 : 1;  // the same frame twice: nothing moves
    Refiner refiner(w.sequence.camera());
    refiner.remember(w.view(1), none, w.T_world_camera(1));
    Refiner::Input in;
    in.frame = w.view(current);
    in.frame.timestamp = w.frames[1].timestamp + 1 / 30.0;
    const Pose truth = w.T_world_camera(current);
    in.T_world_feature = truth * room::pose(-.009, 0, 0, 0, .15, 0);  // as the man moves
    in.T_world_predicted = in.T_world_previous = truth;
    in.feature_trusted = true;
    in.feature_information = 1e6 * Matrix6::Identity();
    const Refinement r = refiner.refine(in);
    REQUIRE(r.refined);
    CHECK((r.alignment.foreground > 0) == moves);
    CHECK((r.w_eff == 0) == moves);
    if (moves) CHECK(room::translation_error(r.T_world_camera, truth) < .004);
  }
}
