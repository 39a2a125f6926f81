#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <apso/refinement/blend.hpp>
#include <apso/refinement/confidence.hpp>
#include <apso/refinement/memory/reference_memory.hpp>
#include <apso/refinement/refiner.hpp>

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
  const Pose T = blend(Tf, Pose::Identity(), .3, detail::feature_information(Matrix6::Zero()), information);
  CHECK(T.translation().z() == doctest::Approx(.1).epsilon(1e-3));
  CHECK(std::abs(T.translation().x()) < 1e-4);
}

TEST_CASE("the less a frame is trusted, the less its feature pose counts") {
  Matrix6 information = Matrix6::Zero();
  information.diagonal() << 1e4, 1e4, 1e4, 1e4, 1e4, 1e4;  // 1 cm
  const Pose Tf = room::pose(.1, 0, 0, 0, 0, 0);
  double last = .1;
  for (const double S_final : {1.0, .5, .2, .1, .02, 0.0, -1.0}) {
    const BlendEvidence e{.4, 1, S_final, information};
    const double x = blend(Tf, Pose(Pose::Identity()), Tf, e).T_world_camera.translation().x();
    CHECK(x <= last);
    CHECK(x >= 0);
    last = x;
  }
  CHECK(last < 1e-3);
}

TEST_CASE("the joined pose is the most probable one of both") {
  const Pose Td = room::pose(.3, -.2, .5, 20, 30, -10);
  const Pose Tf = Td * room::pose(.02, -.01, .03, .5, -.8, .3);
  Matrix6 root = Matrix6::Zero();  // information of both with all their cross terms
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k <= i; ++k) root(i, k) = 40 * std::sin(3.0 * i + 7.0 * k + 1) + (i == k ? 120 : 0);
  BlendEvidence e;
  e.S_final = .6;
  e.c_dir = .8;
  e.direct_information = root * root.transpose();
  e.feature_information = 3 * root.transpose() * root;
  const Matrix6 F = e.S_final * kFeatureInformationShare * e.feature_information;
  const Matrix6 D = e.c_dir * e.direct_information;
  const auto cost = [&](const Pose& T) {
    const Twist f = se3_log(inverse(T) * Tf), d = se3_log(inverse(T) * Td);
    return f.dot(F * f) + d.dot(D * d);
  };
  const Blended<> b = blend(Tf, Td, Tf, e);
  REQUIRE_FALSE(b.gated);
  CHECK(b.w_eff > 0);
  CHECK(b.w_eff < 1);
  const Twist xi = se3_log(inverse(Td) * Tf);
  const Twist step = (F + D).ldlt().solve(F * xi);
  CHECK((se3_log(inverse(Td) * b.T_world_camera) - step).norm() < 1e-12);
  CHECK(b.w_eff == doctest::Approx(step.head<3>().norm() / xi.head<3>().norm()));
  const double least = cost(b.T_world_camera);
  CHECK(least < cost(Tf));
  CHECK(least < cost(Td));
  for (int i = 0; i < 6; ++i) {
    for (const double h : {-3e-3, 3e-3}) {
      Twist off = Twist::Zero();
      off(i) = h;
      CHECK(least < cost(b.T_world_camera * se3_exp(off)));
    }
  }
}

TEST_CASE("a joined pose of a BAD frame that lies outside of both poses gives way to the nearer one") {
  // One pose knows the sum of height and pitch alone, the other the height: where the heights contradict each other by 5 cm, both are
  // satisfied by a pitch that neither of them has.
  Twist sum = Twist::Zero();
  sum[1] = 1;
  sum[3] = .3;
  const Matrix6 little = Matrix6::Identity() * 10;
  const Matrix6 one_direction = 1e8 * sum * sum.transpose() + little;
  Matrix6 height = little;
  height(1, 1) = 1e6;
  const Pose Tf = room::pose(0, .05, 0, 0, 0, 0);
  const Pose Td = Pose::Identity();
  for (const bool direct_knows_height : {true, false}) {
    CAPTURE(direct_knows_height);
    BlendEvidence e{1, .9, .9};
    e.feature_information = (direct_knows_height ? one_direction : height) / kFeatureInformationShare;
    e.direct_information = direct_knows_height ? height : one_direction;
    e.below_threshold = -.1;  // GOOD: the most probable pose, whatever it is
    const Blended<Pose> good = blend(Tf, Td, Tf, e);
    CHECK(rotation_angle(good.T_world_camera) > 6 * kDegree);
    CHECK(motion_distance(good.T_world_camera, direct_knows_height ? Tf : Td) > kBlendOutside * motion_distance(Tf, Td));
    e.below_threshold = .1;
    const Blended<Pose> bad = blend(Tf, Td, Tf, e);
    CHECK_FALSE(bad.gated);
    CHECK(bad.w_eff == (direct_knows_height ? 0 : 1));
    CHECK(bad.T_world_camera.matrix() == (direct_knows_height ? Td : Tf).matrix());
    e.below_threshold = std::numeric_limits<double>::infinity();  // nobody says how far below
    CHECK(blend(Tf, Td, Tf, e).w_eff == bad.w_eff);
  }
}

TEST_CASE("a feature tracker that does not tell its information, or tells nonsense, counts with a fixed one") {
  const Matrix6 fixed = detail::feature_information(Matrix6::Zero());
  CHECK(fixed(0, 0) == doctest::Approx(1 / (kFeatureSigmaTranslation * kFeatureSigmaTranslation)));
  CHECK(fixed(5, 5) == doctest::Approx(1 / (kFeatureSigmaRotation * kFeatureSigmaRotation)));
  Matrix6 nan = Matrix6::Identity();
  nan(2, 4) = std::nan("");
  CHECK(detail::feature_information(nan) == fixed);
  Matrix6 open = Matrix6::Identity();
  open(3, 3) = 0;
  CHECK(detail::feature_information(open) == fixed);
  CHECK(detail::feature_information(Matrix6::Identity() * 5)(1, 1) == doctest::Approx(5 * kFeatureInformationShare));
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
  Pose none = Pose::Identity();
  none.translation().x() = std::nan("");
  memory.select(5, none, d, s);  // near to nothing: again the latest
  CHECK(s.far_reference);
  REQUIRE(s.ids.size() == 1);
  CHECK(s.ids[0] == 4);
  memory.select(50, room::pose(50, 0, 0, 0, 0, 0), d, s);
  CHECK(s.references.empty());
  CHECK_FALSE(memory.correct(0, Pose::Identity()));
  CHECK(memory.correct(4, Pose::Identity()));
}

TEST_CASE("the frame before is one more reference while it is recent, and follows the corrections of the others") {
  const Pinhole cam = room::camera(160);
  const room::Frame f = room::render(cam, Pose::Identity());
  const FrameDescriptor d{depth_grid(f.depth), {}};
  ReferenceMemory memory;
  FramePyramid p;
  ReferenceMemory::Selection s;
  memory.add_previous(1, s);
  CHECK(s.references.empty());  // there is none yet
  p.build(f.view(1), cam, {}, {}, PyramidRole::Reference);
  const std::int64_t stored = memory.insert(p, d, Pose::Identity());
  memory.keep_previous(p, Pose::Identity());
  memory.select(1.1, Pose::Identity(), d, s);
  memory.add_previous(1.1, s);
  CHECK(s.references.size() == 1);  // it is the one that is stored
  p.build(f.view(1.1), cam, {}, {}, PyramidRole::Reference);
  memory.keep_previous(p, room::pose(.02, 0, 0, 0, 0, 0));
  const auto previous = [&](double t) {
    memory.select(t, Pose::Identity(), d, s);
    memory.add_previous(t, s);
    return s.references.size() == 2;
  };
  REQUIRE(previous(1.2));
  CHECK(s.references[1].T_world_reference.translation().x() == .02);
  CHECK(s.references[1].weight == doctest::Approx(kPreviousWeight * std::exp(-.05)));
  CHECK(s.references[1].pyramid->timestamp() == 1.1);
  CHECK(s.ids[0] == stored);
  CHECK(s.ids[1] == -1);  // it is not stored: no pose of it can be corrected
  CHECK_FALSE(memory.correct(s.ids[1], Pose::Identity()));
  CHECK_FALSE(previous(1.7));  // too long ago
  CHECK_FALSE(previous(1.1));  // the frame itself
  Pose turned = room::pose(0, 0, 0, 0, 0, 90);
  turned.translation() = Eigen::Vector3d(1, 0, 0);
  REQUIRE(memory.correct(stored, turned));
  REQUIRE(previous(1.2));
  CHECK((s.references[1].T_world_reference.translation() - Eigen::Vector3d(1, .02, 0)).norm() < 1e-12);
  memory.clear();
  CHECK_FALSE(previous(1.2));
}

TEST_CASE("a prediction that errs with the feature pose does not vote for it against the pose before") {
  const Pinhole cam = room::camera(320);
  Refiner refiner(cam);
  for (int i = 0; i < 6; ++i) {
    const Pose T = room::pose(.02 * i, 0, 0, 0, .5 * i, 0);
    const room::Frame f = room::render(cam, T, {}, static_cast<unsigned>(i + 1));
    refiner.remember(f.view(.1 * i), {}, T);
  }
  const Pose truth = room::pose(.11, 0, 0, 0, 2.7, 0);
  const room::Frame f = room::render(cam, truth, {}, 9);
  Refiner::Input in;
  in.frame = f.view(.6);
  in.T_world_feature = truth * room::pose(1, .2, 0, 0, 0, 0);
  in.T_world_predicted = truth * room::pose(.9, .2, 0, 0, 0, 0);
  in.T_world_previous = room::pose(.10, 0, 0, 0, 2.5, 0);
  const Refinement r = refiner.refine(in);
  REQUIRE(r.refined);
  REQUIRE(r.gated);
  CHECK(room::translation_error(r.T_world_camera, truth) < .01);
}

TEST_CASE("a frame just refined is remembered without reading it again, and bad ones teach no speed") {
  const Pinhole cam = room::camera(320);
  const auto at = [](int i) { return room::pose(.004 * i, 0, 0, 0, .1 * i, 0); };
  Refiner twice(cam), once(cam);  // one is given the frames again, the other an empty image in their place
  for (int i = 0; i < 12; ++i) {
    const room::Frame f = room::render(cam, at(i), {}, static_cast<unsigned>(i + 1));
    const RgbdFrame now = f.view(.033 * i);
    Refiner::Input in;
    in.frame = now;
    in.T_world_feature = in.T_world_predicted = in.T_world_previous = at(i);
    const Refinement a = twice.refine(in);
    const Refinement b = once.refine(in);
    CHECK(a.T_world_camera.matrix() == b.T_world_camera.matrix());
    CHECK(a.refined == (i > 0));
    RgbdFrame unread = now;
    if (i > 0) unread.depth = unread.intensity = {};
    twice.remember(now, {}, a.T_world_camera);
    once.remember(unread, {}, b.T_world_camera);
  }
  CHECK(twice.memory().size() == once.memory().size());
  CHECK(once.memory().size() > 1);
}

TEST_CASE("as printed: the weight of (17) asks nobody, and averages what is far apart") {
  BlendOptions o;
  o.weight = BlendWeight::Printed;
  o.form = BlendForm::ScrewLinear;
  const Pose Td = Pose::Identity();
  const Pose Tf = room::pose(1, 0, 0, 0, 0, 0);
  const Blended<> b = blend(Tf, Td, Tf, BlendEvidence{.5, 0}, o);  // without confidence
  CHECK(b.w_eff == b.w_diff);
  CHECK(b.w_diff == doctest::Approx(.36788).epsilon(1e-4));
  CHECK_FALSE(b.gated);
  CHECK(b.T_world_camera.translation().x() == doctest::Approx(b.w_diff));
  CHECK(blend(Tf, Td, Tf, BlendEvidence{.5, 0}).w_eff == 1);
  o.form = BlendForm::InformationWeighted;  // each pose is 1 cm: w_diff of the way
  const Matrix6 equal = Matrix6::Identity() * 1e4;
  const Pose T = blend(Tf, Td, Tf, BlendEvidence{.5, 0, 1, equal, equal / kFeatureInformationShare}, o).T_world_camera;
  CHECK(T.translation().x() == doctest::Approx(b.w_diff));
}

TEST_CASE("with a transition the direct pose gains its weight as S_final falls below the threshold") {
  BlendOptions o;
  o.form = BlendForm::ScrewLinear;
  const Pose Td = Pose::Identity();
  const Pose Tf = room::pose(.1, 0, 0, 0, 0, 0);
  BlendEvidence e{1, 1};
  const double full = blend(Tf, Td, Tf, e, o).w_eff;
  CHECK(full == doctest::Approx(std::exp(-2.0)));
  o.transition = .05;
  CHECK(blend(Tf, Td, Tf, e, o).w_eff == full);  // nobody says how far below
  double last = 1;
  for (const double below : {-.01, 0.0, .01, .025, .04, .05, .2}) {
    e.below_threshold = below;
    const double w = blend(Tf, Td, Tf, e, o).w_eff;
    CHECK(w <= last);
    if (below <= 0) CHECK(w == 1);
    if (below == .025) CHECK(w == doctest::Approx(1 - .5 * (1 - full)));
    if (below >= .05) CHECK(w == doctest::Approx(full));
    last = w;
  }
}

TEST_CASE("the printed sign of the decay favours the older reference") {
  CHECK(time_decay(5, 2, .5, DecayForm::Printed) == doctest::Approx(4.48169).epsilon(1e-5));
  CHECK(time_decay(5, 4, .5, DecayForm::Printed) < time_decay(5, 2, .5, DecayForm::Printed));
  CHECK(time_decay(5, 5, .5, DecayForm::Printed) == 1);
}

TEST_CASE("references can be chosen by optical flow in place of the predicted pose") {
  const Pinhole cam = room::camera(160);
  const room::Frame f = room::render(cam, Pose::Identity());
  const auto flow = [](float u) {
    FlowGrid grid;
    for (FlowGrid::Cell& cell : grid.cells) cell = {u, 0, 2};
    return grid;
  };
  MemoryOptions o;
  o.motion = MotionForm::FlowGrid;
  ReferenceMemory memory(o);
  FramePyramid p;
  for (int i = 0; i < 3; ++i) {
    p.build(f.view(i), cam, {}, {}, PyramidRole::Reference);
    memory.insert(p, {depth_grid(f.depth), flow(15.F * static_cast<float>(i))}, room::pose(i, 0, 0, 0, 0, 0));
  }
  ReferenceMemory::Selection s;
  memory.select(3, room::pose(90, 0, 0, 0, 0, 0), {depth_grid(f.depth), flow(28)}, s);  // the pose says nothing
  REQUIRE(s.ids.size() == 2);
  CHECK(s.ids[0] == 2);
  CHECK(s.ids[1] == 1);
  CHECK(s.distance == doctest::Approx(2.0 / kFlowSigma));
  CHECK_FALSE(s.far_reference);
  memory.select(3, room::pose(90, 0, 0, 0, 0, 0), {depth_grid(f.depth), {}}, s);  // no tracks: the latest in time
  CHECK(s.far_reference);
  REQUIRE(s.ids.size() == 1);
  CHECK(s.ids[0] == 2);
}

TEST_CASE("factors of the confidence are steps where their limits are equal") {
  CHECK(detail::rising(.69, .7, .7) == 0);
  CHECK(detail::rising(.7, .7, .7) == 1);
  CHECK(detail::rising(.9, .7, .7) == 1);
  CHECK(detail::rising(.75, .7, .9) == doctest::Approx(.25));
  CHECK(detail::rising(std::nan(""), .7, .9) == 0);
}

namespace {
// What a refiner that has seen a few good frames makes of a bad one.
Refinement refine_bad_frame(const RefinerOptions& options) {
  const Pinhole cam = room::camera(320);
  Refiner refiner(cam, options);
  for (int i = 0; i < 8; ++i) {
    const Pose T = room::pose(.01 * i, 0, .005 * i, 0, .3 * i, 0);
    const room::Frame f = room::render(cam, T, {}, static_cast<unsigned>(i + 1));
    refiner.remember(f.view(i / 30.0), none, T);
  }
  const Pose truth = room::pose(.08, 0, .04, 0, 2.4, 0);
  const room::Frame f = room::render(cam, truth, {}, 99);
  Refiner::Input in;
  in.frame = f.view(8 / 30.0);
  in.T_world_feature = truth * room::pose(.04, .02, 0, 1, 0, 0);
  in.T_world_predicted = in.T_world_previous = truth;
  in.S_change = .5;
  return refiner.refine(in);
}
}  // namespace

TEST_CASE("references follow the feature poses of GOOD frames by the share that is asked for, others do not move") {
  CHECK(follow_for_depth(0) == 0);
  CHECK(follow_for_depth(.003) == 0);
  CHECK(follow_for_depth(.012) == doctest::Approx(.3));
  CHECK(follow_for_depth(1) < .4);
  const Pinhole cam = room::camera(320);
  const Pose first = room::pose(0, 0, 0, 0, 0, 0);
  const Pose second = room::pose(.02, 0, .01, 0, .6, 0);
  const room::Frame a = room::render(cam, first, {}, 1);
  const room::Frame b = room::render(cam, second, {}, 2);
  for (const double share : {0.0, .5}) {
    for (const bool trusted : {true, false}) {
      CAPTURE(share);
      CAPTURE(trusted);
      RefinerOptions o;
      o.follow_features = share;
      Refiner refiner(cam, o);
      refiner.remember(a.view(0), none, first);
      Refiner::Input in;
      in.frame = b.view(1);  // a second later: it is stored as well
      in.T_world_feature = second * room::pose(.004, -.002, 0, .1, 0, 0);
      in.T_world_predicted = in.T_world_previous = second;
      in.feature_trusted = trusted;
      in.feature_information = 1e4 * Matrix6::Identity();
      const Refinement r = refiner.refine(in);
      REQUIRE(r.refined);
      const Pose apart = in.T_world_feature * r.T_world_camera.inverse();
      CHECK(apart.translation().norm() > 1e-4);
      refiner.remember(in.frame, none, r.T_world_camera);
      REQUIRE(refiner.memory().size() == 2);
      const Pose moved = trusted ? se3_exp(share * se3_log(apart)) : Pose::Identity();
      CHECK((refiner.memory().entry(0).T_world_reference.matrix() - (moved * first).matrix()).norm() < 1e-12);
      CHECK((refiner.memory().entry(1).T_world_reference.matrix() - (moved * r.T_world_camera).matrix()).norm() < 1e-12);
      // what a frame tells counts once
      refiner.remember(room::render(cam, second, {}, 3).view(2), none, second);
      CHECK((refiner.memory().entry(0).T_world_reference.matrix() - (moved * first).matrix()).norm() < 1e-12);
    }
  }
}

TEST_CASE("the depth noise of a camera decides what the options leave open") {
  RefinerOptions unknown, exact, shared, asked;
  take_depth_noise(0, unknown);
  take_depth_noise(kInverseDepthSigma, exact);
  take_depth_noise(.012, shared);
  asked.follow_features = 0;
  asked.memory.references = 2;
  take_depth_noise(.012, asked);
  CHECK(unknown.follow_features == 0);
  CHECK(exact.follow_features == 0);
  CHECK(shared.follow_features == follow_for_depth(.012));
  CHECK(asked.follow_features == 0);

  const Pinhole cam = room::camera(160);
  const room::Frame f = room::render(cam, Pose::Identity());
  const FrameDescriptor d{depth_grid(f.depth), {}};
  const auto chosen = [&](const MemoryOptions& o) {
    ReferenceMemory memory(o);
    FramePyramid p;
    ReferenceMemory::Selection s;
    for (int i = 0; i < 5; ++i) {  // all of them near
      p.build(f.view(i), cam, {}, {}, PyramidRole::Reference);
      memory.insert(p, d, room::pose(.01 * i, 0, 0, 0, 0, 0));
    }
    memory.select(5, room::pose(.031, 0, 0, 0, 0, 0), d, s);
    CHECK(s.references.front().T_world_reference.translation().x() == .03);
    return s.references.size();
  };
  CHECK(chosen({}) == kReferences);
  CHECK(chosen(unknown.memory) == kReferences);
  CHECK(chosen(exact.memory) == kReferences);
  CHECK(chosen(shared.memory) == 1);
  CHECK(chosen(asked.memory) == 2);
}

TEST_CASE("the printed forms together refine a frame by w_diff alone") {
  RefinerOptions o = paper_refiner_options();
  const Refinement r = refine_bad_frame(o);  // no tracks: the reference is the latest
  REQUIRE(succeeded(r.status));
  CHECK(r.far_reference);
  CHECK(r.refined);
  CHECK(r.w_eff == r.w_diff);
  CHECK(r.w_eff == doctest::Approx(std::exp(-1.0)));
  o.min_confidence = 1;  // asks nobody
  CHECK(refine_bad_frame(o).w_eff == r.w_eff);
}
