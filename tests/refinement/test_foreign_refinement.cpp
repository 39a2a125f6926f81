// The doors of refinement with types that the library has not seen: images, tracks and poses go in as they are, poses come
// out as the type they came in, and the answer is that for the library's own types.
#include <cmath>
#include <cstddef>
#include <list>
#include <type_traits>
#include <vector>

#include <doctest/doctest.h>

#include <apso/align.hpp>
#include <apso/blend.hpp>
#include <apso/refinement/camera_velocity.hpp>
#include <apso/refinement/refiner.hpp>
#include <apso/traits/images/rolling_shutter.hpp>

#include "../foreign_types.hpp"
#include "room.hpp"

using namespace apso;
using foreign::DualQuaternionPose;
using foreign::RowMajor3x4Pose;

namespace {
constexpr float kTum = 1 / 5000.F;

template <class PoseT>
double distance(const PoseT& a, const Pose& b) {
  return (to_pose(a).matrix() - b.matrix()).norm();
}
// What is lost on the way into a type and back: nothing but rounding.
template <class PoseT>
constexpr double kRounding = std::is_same_v<typename pose_traits<PoseT>::scalar, float> ? 1e-6 : 1e-14;

// The same frame in the library's own images and in others: 16 bit with padding, and grey that is read pixel by pixel.
struct TwoFrames {
  room::Frame rendered;
  foreign::AtOnly grey = foreign::at_only(rendered.intensity);
  foreign::PaddedU16 depth = foreign::padded_u16(rendered.depth, kTum);
  Image<float> own_grey = foreign::native(grey);
  Image<float> own_depth = foreign::native(depth, kTum);
  explicit TwoFrames(const Pose& T, unsigned noise) : rendered(room::render(room::kCamera, T, {true, -.3, .4, 1.5}, noise)) {}
  [[nodiscard]] auto theirs(double t) const { return frame(t, grey, scaled(depth, kTum), room::kCamera); }
  [[nodiscard]] RgbdFrame own(double t) const { return {t, own_grey, own_depth}; }
};
}  // namespace

TEST_CASE_TEMPLATE("align takes any images, and gives the motion as the type of the guess", PoseT, DualQuaternionPose, RowMajor3x4Pose,
                   Pose) {
  const TwoFrames r(Pose::Identity(), 1), c(room::kTruth, 2);
  const PairAlignment<> own = align(r.own_grey, r.own_depth, c.own_grey, c.own_depth, room::kCamera);
  REQUIRE(succeeded(own.status));
  const PoseT guess = from_pose<PoseT>(Pose::Identity());
  const auto theirs = align(r.theirs(0), c.theirs(0.1), guess);
  static_assert(std::is_same_v<decltype(theirs), const PairAlignment<PoseT>>);
  CHECK(theirs.status == own.status);
  CHECK(distance(theirs.T_current_reference, own.T_current_reference) <= kRounding<PoseT>);
  CHECK(theirs.detail.information == own.detail.information);
  PairOptions tum;
  tum.depth_unit = 1 / 5000.;
  const auto by_images = align(r.grey, r.depth, c.grey, c.depth, room::kCamera, guess, tum);
  CHECK(distance(by_images.T_current_reference, own.T_current_reference) <= kRounding<PoseT>);
}

TEST_CASE("depth as a cloud, as float millimetres with an invalid of -1, as 16 bit: the same motion") {
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), {}, 1);
  const room::Frame c = room::render(room::kCamera, room::kTruth, {}, 2);
  room::Frame holes = r;
  for (int y = 40; y < 60; ++y) {
    for (int x = 100; x < 160; ++x) holes.depth(x, y) = 0;
  }
  const auto motion = [&](const auto& reference_depth, const auto& current_depth) {
    const auto a = frame(0, r.intensity, reference_depth, room::kCamera);
    const auto b = frame(1, c.intensity, current_depth, room::kCamera);
    const PairAlignment<> found = align(a, b);
    REQUIRE(succeeded(found.status));
    return found.T_current_reference;
  };
  const Pose own = motion(holes.depth, c.depth);
  const auto cloud_r = foreign::xyz_cloud(holes.depth, 262.5F, 160, 120), cloud_c = foreign::xyz_cloud(c.depth, 262.5F, 160, 120);
  CHECK(motion(cloud_r, cloud_c).matrix() == own.matrix());
  const auto mm_r = foreign::float_millimetres(holes.depth), mm_c = foreign::float_millimetres(c.depth);
  CHECK(motion(scaled(mm_r, .001F), scaled(mm_c, .001F)).matrix() == motion(foreign::native(mm_r), foreign::native(mm_c)).matrix());
  CHECK(distance(motion(scaled(mm_r, .001F), scaled(mm_c, .001F)), own) < 1e-4);
}

TEST_CASE("another camera, another size and a failure: the guess comes back as it was") {
  const TwoFrames r(Pose::Identity(), 1), c(room::kTruth, 2);
  Pinhole other = room::kCamera;
  other.fx += 1;
  const auto wrong = frame(0, c.grey, scaled(c.depth, kTum), other);
  CHECK_THROWS_AS((void)align(r.theirs(0), wrong), contract_error);
  foreign::PaddedU16 blind = c.depth;
  for (std::uint16_t& z : blind.buffer) z = 0;
  const RowMajor3x4Pose guess = from_pose<RowMajor3x4Pose>(room::pose(.3, 0, 0, 0, 5, 0));
  const auto failed = align(r.theirs(0), frame(0, c.grey, scaled(blind, kTum), room::kCamera), guess);
  CHECK_FALSE(succeeded(failed.status));
  CHECK(failed.T_current_reference.m == guess.m);
}

TEST_CASE_TEMPLATE("blend gives back the type it gets, and the ends bit by bit", PoseT, DualQuaternionPose, RowMajor3x4Pose) {
  const Pose Tf = room::pose(.1, .02, .05, 3, 1, -2);
  const Pose Td = room::pose(.05, .01, .02, 1, 2, -1);
  const auto f = from_pose<PoseT>(Tf);
  const auto d = from_pose<PoseT>(Td);
  static_assert(std::is_same_v<decltype(blend(f, d, .5)), PoseT>);
  for (const BlendForm form : {BlendForm::ScrewLinear, BlendForm::Decoupled}) {
    CHECK(distance(blend(f, d, .3, form), blend(Tf, Td, .3, form)) <= 4 * kRounding<PoseT>);
  }
  const Matrix6 F = Matrix6::Identity() * 2e4;
  const Matrix6 D = Matrix6::Identity() * 1e4;
  CHECK(distance(blend(f, d, .3, F, D), blend(Tf, Td, .3, F, D)) <= 4 * kRounding<PoseT>);
  const BlendEvidence evidence{.4, .9, .5, D, F};
  const Blended<PoseT> b = blend(f, d, f, evidence);
  CHECK(distance(b.T_world_camera, blend(Tf, Td, Tf, evidence).T_world_camera) <= 4 * kRounding<PoseT>);
  CHECK(distance(blend(f, d, 1.0), to_pose(f)) == 0);
  CHECK(distance(blend(f, d, 0.0), to_pose(d)) == 0);
  CHECK(distance(blend(f, d, f, BlendEvidence{1, 0}).T_world_camera, to_pose(f)) == 0);
}

TEST_CASE("the grids of a frame are those of any image and of any list of tracks") {
  const TwoFrames c(room::kTruth, 2);
  const auto probability = foreign::padded_u16(c.rendered.probability, 1 / 1000.F);
  const DepthGrid own = depth_grid(c.own_depth, foreign::native(probability, 1 / 1000.F));
  CHECK(depth_grid(scaled(c.depth, kTum), scaled(probability, 1 / 1000.F)).inverse_depth == own.inverse_depth);
  CHECK(depth_grid(c.own_depth).inverse_depth != own.inverse_depth);

  std::vector<PointTrack> tracks;
  for (int i = 0; i < 48; ++i) {
    for (int k = 0; k < 3; ++k) {
      PointTrack t;
      t.id = 3 * i + k;
      t.x = 40.F * static_cast<float>(i % 8) + 10;  // cells of 40 x 40 pixels
      t.y = 40.F * static_cast<float>(i / 8) + 20;
      t.previous_x = t.x - static_cast<float>(k);  // mean 1
      t.previous_y = t.y + static_cast<float>(i);
      t.age = 4;
      tracks.push_back(t);
    }
  }
  tracks.push_back(tracks.front());
  tracks.back().age = 0;  // begins here: says nothing
  tracks.back().previous_x = -500;
  const FlowGrid grid = flow_grid(foreign::features(tracks), 320, 240);
  for (int i = 0; i < 48; ++i) {
    const FlowGrid::Cell& cell = grid.cells[static_cast<std::size_t>(i)];
    CHECK(cell.tracks == 3);
    CHECK(cell.u == doctest::Approx(1));
    CHECK(cell.v == doctest::Approx(-i));
  }
  FlowGrid faster = grid;
  for (FlowGrid::Cell& cell : faster.cells) {
    cell.u += 3;
    cell.v -= 4;
  }
  CHECK(*grid_distance(grid, faster) == doctest::Approx(5));
  for (std::size_t i = 0; i < 34; ++i) faster.cells[i].tracks = 0;  // 14 of 48 are left: too few
  CHECK_FALSE(grid_distance(grid, faster).has_value());
  CHECK(flow_grid(none, 320, 240).cells[0].tracks == 0);
}

TEST_CASE_TEMPLATE("memory and refiner take any images and poses, and give the pose back as its type", PoseT, DualQuaternionPose,
                   RowMajor3x4Pose) {
  Refiner own(room::kCamera), theirs(room::kCamera);
  // poses that both types hold: as read back from the foreign one
  const auto as_held = [](const Pose& T) { return to_pose(from_pose<PoseT>(T)); };
  for (int i = 0; i < 6; ++i) {
    const Pose T = as_held(room::pose(.03 * i, 0, .01 * i, 0, .8 * i, 0));
    const TwoFrames f(T, static_cast<unsigned>(i + 1));
    const auto probability = foreign::padded_u16(f.rendered.probability, 1 / 1000.F);
    const auto mask = scaled(probability, 1 / 1000.F);
    const auto their_frame = f.theirs(.1 * i);
    own.remember(f.own(.1 * i), foreign::native(probability, 1 / 1000.F), T);
    theirs.remember(their_frame, mask, from_pose<PoseT>(T));
  }
  REQUIRE(own.memory().size() == theirs.memory().size());
  REQUIRE(own.memory().size() > 2);
  const Pose truth = room::pose(.19, 0, .06, 0, 5, 0);
  const TwoFrames f(truth, 99);
  Refiner::Input in;
  in.frame = f.own(.7);
  in.T_world_feature = as_held(truth * room::pose(.04, .02, 0, 1, 0, 0));
  in.T_world_predicted = in.T_world_previous = as_held(truth);
  in.S_change = 1;
  const auto their_frame = f.theirs(.7);
  RefinementInput<PoseT> other;
  other.frame = their_frame;
  other.T_world_feature = from_pose<PoseT>(in.T_world_feature);
  other.T_world_predicted = other.T_world_previous = from_pose<PoseT>(in.T_world_predicted);
  other.S_change = 1;
  for (const bool trusted : {false, true}) {
    in.feature_trusted = other.feature_trusted = trusted;
    if (trusted) {  // what the tracker and the assessor say of the pose
      in.S_final = other.S_final = .6;
      in.feature_information.diagonal() << 1e4, 2e4, 3e4, 4e4, 5e4, 6e4;
      other.feature_information = in.feature_information;
    }
    const Refinement a = own.refine(in);
    const BasicRefinement<PoseT> b = theirs.refine(other);
    REQUIRE(succeeded(a.status));
    CHECK(a.refined);
    CHECK(b.status == a.status);
    CHECK(b.references == a.references);
    CHECK(b.alignment.start_candidate == a.alignment.start_candidate);
    CHECK(b.c_dir == doctest::Approx(a.c_dir).epsilon(1e-6));
    CHECK(b.w_eff == doctest::Approx(a.w_eff).epsilon(1e-3));
    CHECK(distance(b.T_world_camera, a.T_world_camera) < 10 * kRounding<PoseT>);
    CHECK(room::translation_error(to_pose(b.T_world_camera), truth) < .01);
  }
  // without a confident direct pose the feature pose comes back untouched
  other.highly_dynamic = true;
  Refiner fresh(room::kCamera);
  const BasicRefinement<PoseT> nothing = fresh.refine(other);
  CHECK(nothing.status == Status::NoReference);
  CHECK(distance(nothing.T_world_camera, to_pose(other.T_world_feature)) == 0);

  ReferenceMemory& memory = theirs.memory();
  const std::int64_t id = memory.entry(0).id;
  CHECK(memory.correct(id, from_pose<PoseT>(truth)));
  CHECK(distance(from_pose<PoseT>(memory.entry(0).T_world_reference), truth) < 10 * kRounding<PoseT>);
}

TEST_CASE("the velocity of a camera, and frames that its rolling shutter bent, from any images") {
  const TwoFrames a(Pose::Identity(), 1), b(room::kTruth, 2);
  CameraVelocity own_velocity(room::kCamera);
  CameraVelocity velocity(room::kCamera);
  own_velocity.push(a.own(0));
  velocity.push(a.theirs(0));
  own_velocity.push(b.own(0.05));
  velocity.push(b.theirs(0.05));
  REQUIRE(velocity.of_frame_before());
  CHECK(*velocity.of_frame_before() == *own_velocity.of_frame_before());
  RollingShutter own_shutter(room::kCamera, 0.03);
  RollingShutter shutter(room::kCamera, 0.03);
  own_shutter.follow(a.own(0), *velocity.of_frame_before(), 0.01);
  shutter.follow(a.theirs(0), *velocity.of_frame_before(), 0.01);
  Image<float> own_intensity;
  Image<float> intensity;
  own_shutter.intensity(a.own(0), own_intensity);
  shutter.intensity(a.theirs(0), intensity);
  bool equal = true;
  bool changed = false;
  for (std::size_t i = 0; i < intensity.size(); ++i) {
    equal = equal && intensity.data()[i] == own_intensity.data()[i] && shutter.depth().data()[i] == own_shutter.depth().data()[i];
    changed = changed || intensity.data()[i] != a.own_grey.data()[i];
  }
  CHECK(equal);
  CHECK(changed);
}
