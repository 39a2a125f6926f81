#include <cmath>

#include <doctest/doctest.h>

#include <apso/refinement/blend.hpp>
#include <apso/refinement/reference_memory.hpp>

#include "room.hpp"

using namespace apso;

TEST_CASE("weights of the blend match hand-computed values") {
  const double w[] = {1, .60653, .36788, .22313, .13534};
  for (int i = 0; i < 5; ++i) CHECK(difference_weight(.25 * i, 2.0) == doctest::Approx(w[i]).epsilon(1e-4));
  CHECK(effective_weight(difference_weight(.5, 2.0), .5) == doctest::Approx(.68394).epsilon(1e-5));
  CHECK(effective_weight(.2, 0.0) == 1.0);
}

TEST_CASE("blend ends, invariance and the quarter turn") {
  const Pose Td = room::pose(.3, -.2, .5, 20, 30, -10);
  const Pose Tf = room::pose(.5, -.1, .6, 25, 10, -30);
  CHECK((blend(Tf, Td, 0.0).matrix().array() == Td.matrix().array()).all());
  CHECK((blend(Tf, Td, 1.0).matrix().array() == Tf.matrix().array()).all());
  const Pose A = room::pose(1, 2, -3, 40, -50, 60);
  for (double w : {.1, .5, .8}) {
    const Pose m = blend(Tf, Td, w);
    CHECK((blend(A * Tf, A * Td, w).matrix() - (A * m).matrix()).norm() < 1e-12);
    CHECK((blend(Tf * A, Td * A, w).matrix() - (m * A).matrix()).norm() < 1e-12);
    CHECK((blend(inverse(Tf), inverse(Td), w).matrix() - inverse(m).matrix()).norm() < 1e-12);
  }
  Pose quarter = room::pose(0, 0, 0, 0, 0, 90);
  quarter.translation() = Eigen::Vector3d(1, 0, 0);
  const Pose half = blend(quarter, Pose::Identity(), .5);
  CHECK(half.translation().x() == doctest::Approx(.5));
  CHECK(half.translation().y() == doctest::Approx(-.2071068).epsilon(1e-6));
  CHECK(rotation_angle(half) * 180 / 3.14159265358979 == doctest::Approx(45));
}

TEST_CASE("without confidence the feature pose stays; two modes are not averaged") {
  const Pose Tf = room::pose(1, 0, 0, 0, 0, 0);
  const Pose Td = room::pose(0, 0, 0, 0, 0, 0);
  CHECK((blend(Tf, Td, Td, BlendEvidence{1.0, 0.0}).T_world_camera.matrix() - Tf.matrix()).norm() == 0);
  const Blended<> b = blend(Tf, Td, room::pose(.1, 0, 0, 0, 0, 0), BlendEvidence{1.0, 1.0});
  CHECK(b.gated);
  CHECK((b.T_world_camera.matrix() - Td.matrix()).norm() == 0);
  const Blended<> doubtful = blend(Tf, Td, room::pose(.1, 0, 0, 0, 0, 0), BlendEvidence{1.0, 0.4});
  CHECK(doubtful.gated);
  CHECK((doubtful.T_world_camera.matrix() - Tf.matrix()).norm() == 0);
}

TEST_CASE("the feature pose fills what the images leave open") {
  Matrix6 information = Matrix6::Zero();
  information.diagonal() << 1e9, 1e9, 0, 1e9, 1e9, 1e9;
  const Pose Tf = room::pose(.1, .1, .1, 0, 0, 0);
  const Pose T = blend(Tf, Pose::Identity(), .3, detail::feature_information(1, 1), information);
  CHECK(T.translation().z() == doctest::Approx(.1).epsilon(1e-3));
  CHECK(std::abs(T.translation().x()) < 1e-4);
}

TEST_CASE("the worse the features, the less their pose counts") {
  Matrix6 information = Matrix6::Zero();
  information.diagonal() << 1e4, 1e4, 1e4, 1e4, 1e4, 1e4;  // 1 cm
  const Pose Tf = room::pose(.1, 0, 0, 0, 0, 0);
  double last = .1;
  for (const double S_feature : {1.0, .5, .2, .1, .02, 0.0, -1.0}) {
    const BlendEvidence e{.4, 1, S_feature, information};  // w_diff = 0.45
    const double x = blend(Tf, Pose(Pose::Identity()), Tf, e).T_world_camera.translation().x();
    CHECK(x <= last);
    CHECK(x >= 0);
    last = x;
  }
  CHECK(last < 1e-3);
}

TEST_CASE("distance of a reference and its time decay") {
  Twist m = Twist::Zero();
  m(0) = .15;
  CHECK(reference_distance(.05, motion_distance(m)) == doctest::Approx(1.11803).epsilon(1e-5));
  CHECK(reference_distance(.05, motion_distance(m), DistanceForm::Sum) == doctest::Approx(1.5));
  CHECK(time_decay(5, 5, .5) == 1.0);
  CHECK(time_decay(5, 4, .5) == doctest::Approx(.60653).epsilon(1e-5));
  CHECK(time_decay(5, 2, .5) == doctest::Approx(.22313).epsilon(1e-4));
}

TEST_CASE("memory keeps the recent frames and selects the nearest") {
  const Pinhole cam = room::camera(160);
  const room::Frame f = room::render(cam, Pose::Identity());
  const FrameDescriptor d{depth_grid(f.depth), {}};
  MemoryOptions o;
  o.capacity = 3;
  ReferenceMemory memory(o);
  FramePyramid p;
  for (int i = 0; i < 5; ++i) {
    CHECK(memory.wants(i, Pose::Identity()));
    p.build(f.view(i), cam, {}, {}, PyramidRole::Reference);
    memory.insert(p, d, room::pose(.1 * i, 0, 0, 0, 0, 0));
  }
  CHECK(memory.size() == 3);
  CHECK_FALSE(memory.wants(4.1, room::pose(.41, 0, 0, 0, 0, 0)));
  CHECK(memory.wants(4.1, room::pose(.46, 0, 0, 0, 0, 0)));
  ReferenceMemory::Selection s;
  memory.select(5, room::pose(.31, 0, 0, 0, 0, 0), d, s);
  REQUIRE(s.ids.size() == 3);
  CHECK(s.ids[0] == 3);
  CHECK(s.references[0].weight == doctest::Approx(std::exp(-1.0)));
  memory.select(5, room::pose(.70, 0, 0, 0, 0, 0), d, s);  // .3 m = 2 units: only the far limit lets it in
  CHECK(s.far_reference);
  CHECK(s.ids.size() == 1);
  memory.select(5, room::pose(50, 0, 0, 0, 0, 0), d, s);  // the latest in time
  CHECK(s.far_reference);
  memory.select(50, room::pose(50, 0, 0, 0, 0, 0), d, s);
  CHECK(s.references.empty());
  CHECK_FALSE(memory.correct(0, Pose::Identity()));
  CHECK(memory.correct(4, Pose::Identity()));
}
