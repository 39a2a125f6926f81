#include <doctest/doctest.h>

#include <random>

#include <apso/tracker/map/keyframes.hpp>
#include <apso/tracker/map/local_map.hpp>
#include <apso/tracker/solvers/pose_optimisation.hpp>
#include <apso/tracker/solvers/ransac_pose.hpp>
#include <apso/tracker/solvers/windowed_adjustment.hpp>

#include "../counting_allocator.hpp"

using namespace apso;

namespace {
const Pinhole kUnequalCamera{525, 520, 319.5, 239.5, 640, 480};

Pose some_pose() {
  Twist xi;
  xi << 0.3, -0.2, 0.1, 0.1, -0.15, 0.05;
  return se3_exp(xi);
}

/// Points in front of the camera at `T`, seen with `noise` px; a share of them somewhere else.
std::vector<PointObservation> scene(const Pose& T_world_camera, int n, double noise, double outliers, bool depth) {
  std::mt19937 rng(11);
  std::uniform_real_distribution<double> u(20, 620);
  std::uniform_real_distribution<double> v(20, 460);
  std::uniform_real_distribution<double> z(0.8, 4);
  std::normal_distribution<double> g;
  std::vector<PointObservation> all;
  for (int i = 0; i < n; ++i) {
    PointObservation o;
    o.u = u(rng);
    o.v = v(rng);
    const double depth_i = z(rng);
    o.point = T_world_camera * kUnequalCamera.unproject(o.u, o.v, depth_i);
    o.u += noise * g(rng);
    o.v += noise * g(rng);
    o.inverse_depth_sigma = 0.005;
    if (depth) o.inverse_depth = 1 / depth_i + 0.003 * noise * g(rng);
    if (i < outliers * n) {
      o.u = u(rng);
      o.v = v(rng);
    }
    all.push_back(o);
  }
  return all;
}

double distance(const Pose& a, const Pose& b) { return se3_log(inverse(a) * b).norm(); }
}  // namespace

TEST_CASE("the residual's derivative agrees with differences") {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> u(-1, 1);
  for (int i = 0; i < 50; ++i) {
    PointObservation o;
    o.u = 320 + 100 * u(rng);
    o.v = 240 + 100 * u(rng);
    o.inverse_depth = i % 3 == 0 ? 0.0 : 0.5;
    o.inverse_depth_sigma = 0.01;
    o.sigma = 1.44;
    const Eigen::Vector3d p(u(rng), u(rng), 2 + u(rng));
    Eigen::Vector3d r;
    Eigen::Matrix3d J;
    REQUIRE(point_residual(kUnequalCamera, o, p, r, &J));
    double J_twist[3][6];
    twist_jacobian(J, p, J_twist);
    Eigen::Matrix<double, 3, 6> analytic;
    for (int k = 0; k < 18; ++k) analytic(k / 6, k % 6) = J_twist[k / 6][k % 6];
    for (int k = 0; k < 6; ++k) {
      Twist step = Twist::Zero();
      step(k) = 1e-6;
      Eigen::Vector3d forward = Eigen::Vector3d::Zero();
      Eigen::Vector3d backward = Eigen::Vector3d::Zero();
      point_residual(kUnequalCamera, o, se3_exp(step) * p, forward);
      point_residual(kUnequalCamera, o, se3_exp(-step) * p, backward);
      CHECK(((forward - backward) / 2e-6 - analytic.col(k)).norm() < 1e-4 * (1 + analytic.norm()));
    }
  }
}

TEST_CASE("the information of a pose that was found elsewhere says how large its error is, and does not ask the outliers") {
  const Pose truth = some_pose();
  std::vector<PointObservation> all = scene(truth, 200, 0.8, 0.2, true);
  const PoseOptimisation found = optimise_pose(kUnequalCamera, all, truth);
  REQUIRE(succeeded(found.status));
  const Matrix6 known = pose_information(kUnequalCamera, all, found.T_world_camera);
  std::vector<PointObservation> inliers;
  for (const PointObservation& o : all) {
    if (o.inlier) inliers.push_back(o);
  }
  REQUIRE(inliers.size() < 170);
  CHECK(pose_information(kUnequalCamera, inliers, found.T_world_camera) == known);
  // the kernel takes some of the weight that the last rounds give: the mean of (l / (l + s))^2 is 0.59 for s of a chi-square with three
  // degrees of freedom and l its 95 % point
  for (int i = 0; i < 6; ++i) {
    CHECK(known(i, i) > 0.4 * found.information(i, i));
    CHECK(known(i, i) < 1.0 * found.information(i, i));
  }
  const Twist error = se3_log(inverse(found.T_world_camera) * truth);
  CHECK(error.dot(known * error) < 16.8);  // 99 % of a chi-square with six degrees of freedom

  inliers.resize(kMinPoseInliers - 1);
  CHECK(pose_information(kUnequalCamera, inliers, truth) == Matrix6::Zero());
  Pose broken = truth;
  broken.matrix()(0, 3) = std::nan("");
  CHECK(pose_information(kUnequalCamera, all, broken) == Matrix6::Zero());
}

TEST_CASE("a point behind the camera has no residual") {
  Eigen::Vector3d r;
  CHECK_FALSE(point_residual(kUnequalCamera, PointObservation{}, Eigen::Vector3d(0, 0, -1), r));
  CHECK_FALSE(point_residual(kUnequalCamera, PointObservation{}, Eigen::Vector3d(0, 0, std::nan("")), r));
}

TEST_CASE("without noise the pose is exact, with and without depth") {
  for (bool depth : {false, true}) {
    const Pose truth = some_pose();
    std::vector<PointObservation> all = scene(truth, 200, 0, 0, depth);
    Twist off;
    off << 0.05, 0.03, -0.04, 0.02, 0.01, -0.03;
    const PoseOptimisation found = optimise_pose(kUnequalCamera, all, truth * se3_exp(off));
    CHECK(succeeded(found.status));
    CHECK(found.inliers == 200);
    CHECK(distance(found.T_world_camera, truth) < 1e-6);
  }
}

TEST_CASE("40 % outliers do not move the pose, and are told apart") {
  const Pose truth = some_pose();
  std::vector<PointObservation> all = scene(truth, 300, 0.5, 0.4, true);
  Twist off;
  off << 0.02, -0.01, 0.02, 0.01, -0.01, 0.01;
  const PoseOptimisation found = optimise_pose(kUnequalCamera, all, truth * se3_exp(off));
  CHECK(succeeded(found.status));
  CHECK(distance(found.T_world_camera, truth) < 0.005);
  int wrong = 0;
  for (std::size_t i = 0; i < 120; ++i) wrong += all[i].inlier ? 1 : 0;
  CHECK(wrong <= 3);
  CHECK(found.inliers >= 170);
}

TEST_CASE("a walking body in front of a distant wall does not drag the pose along") {
  // A turn about the vertical and a shift cancel at the distance of the wall, so that the body, which is closer, and
  // nearly all of the wall agree with a wrong pose to one or two pixels.
  std::mt19937 rng(3);
  std::normal_distribution<double> g;
  std::uniform_real_distribution<double> u(-1, 1);
  std::vector<PointObservation> all;
  const auto add = [&](const Eigen::Vector3d& before, const Eigen::Vector3d& now) {
    PointObservation o;
    o.point = before;
    const Eigen::Vector2d uv = kUnequalCamera.project(now);
    o.u = uv.x() + 0.4 * g(rng);
    o.v = uv.y() + 0.4 * g(rng);
    o.inverse_depth = 1 / now.z() + 0.003 * g(rng);
    o.inverse_depth_sigma = 0.003;
    all.push_back(o);
  };
  for (int i = 0; i < 360; ++i) {
    const Eigen::Vector3d wall(2.4 * u(rng), 1.7 * u(rng), 4.5 + 0.1 * u(rng));
    add(wall, wall);
  }
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d body(0.6 + 0.2 * u(rng), 0.6 * u(rng), 2.0 + 0.1 * u(rng));
    add(body, body + Eigen::Vector3d(0.05, 0, 0));
  }
  const PoseOptimisation found = optimise_pose(kUnequalCamera, all, Pose::Identity());
  CHECK(succeeded(found.status));
  CHECK(found.T_world_camera.translation().norm() < 0.004);
  int dragged = 0;
  for (std::size_t i = 360; i < all.size(); ++i) dragged += all[i].inlier ? 1 : 0;
  CHECK(dragged == 0);
}

TEST_CASE("RANSAC needs no guess, gives the same twice, and takes a good hypothesis as it is") {
  const Pose truth = some_pose();
  const std::vector<PointObservation> all = scene(truth, 300, 0.3, 0.5, true);
  const RansacPose a = ransac_pose(kUnequalCamera, all, {});
  const RansacPose b = ransac_pose(kUnequalCamera, all, {});
  REQUIRE(a.ok);
  CHECK(a.inliers > 120);
  CHECK(distance(a.T_world_camera, truth) < 0.05);
  CHECK(a.T_world_camera.matrix() == b.T_world_camera.matrix());
  const RansacPose c = ransac_pose(kUnequalCamera, scene(truth, 100, 0, 0, true), {truth});
  CHECK(c.inliers == 100);
  CHECK(distance(c.T_world_camera, truth) < 1e-9);
}

TEST_CASE("too few observations are a status, the pose stays") {
  std::vector<PointObservation> all = scene(some_pose(), 5, 0, 0, true);
  const Pose guess = some_pose();
  const PoseOptimisation found = optimise_pose(kUnequalCamera, all, guess);
  CHECK(found.status == Status::TooFewMatches);
  CHECK(found.T_world_camera.matrix() == guess.matrix());
  CHECK_FALSE(ransac_pose(kUnequalCamera, {}, {}).ok);
}

TEST_CASE("bundle adjustment brings disturbed poses and points back") {
  std::mt19937 rng(5);
  std::normal_distribution<double> g;
  std::uniform_real_distribution<double> u(-1, 1);
  AdjustmentProblem problem;
  std::vector<Pose> truth;
  for (int k = 0; k < 4; ++k) {
    Twist xi;
    xi << 0.1 * k, 0.02 * k, -0.03 * k, 0.01 * k, 0.02 * k, 0;
    truth.push_back(se3_exp(xi));
    Twist off;
    for (int i = 0; i < 6; ++i) off(i) = k == 0 ? 0 : 0.01 * g(rng);
    problem.T_camera_world.push_back(se3_exp(off) * truth.back());
    problem.fixed.push_back(k == 0 ? 1 : 0);
  }
  for (int i = 0; i < 120; ++i) {
    const Eigen::Vector3d p(u(rng), u(rng), 2.5 + u(rng));
    AdjustmentProblem::Point point;
    point.point = p + 0.02 * Eigen::Vector3d(g(rng), g(rng), g(rng));
    point.first = static_cast<int>(problem.views.size());
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector3d q = truth[static_cast<std::size_t>(k)] * p;
      AdjustmentProblem::View view;
      view.pose = k;
      view.observation.u = kUnequalCamera.project(q).x();
      view.observation.v = kUnequalCamera.project(q).y();
      view.observation.inverse_depth = 1 / q.z();
      view.observation.inverse_depth_sigma = 0.005;
      problem.views.push_back(view);
      ++point.count;
    }
    problem.points.push_back(point);
  }
  AdjustmentProblem few = problem, many = problem;
  few.points.resize(20);
  few.views.resize(80);
  AdjustmentBuffers buffers;
  const AdjustmentResult result = adjust_window(kUnequalCamera, problem, buffers, 20);
  CHECK(succeeded(result.status));
  CHECK(result.cost_after < 1e-3 * result.cost_before);
  for (std::size_t k = 0; k < 4; ++k) CHECK(distance(problem.T_camera_world[k], truth[k]) < 1e-3);

  // a window that is busier than any before it takes no more memory
  AdjustmentBuffers warm;
  CHECK(succeeded(adjust_window(kUnequalCamera, few, warm, 20).status));
  CHECK(counting::count([&] { (void)adjust_window(kUnequalCamera, many, warm, 20); }).number == 0);
  for (std::size_t k = 0; k < 4; ++k) CHECK((many.T_camera_world[k].matrix() - problem.T_camera_world[k].matrix()).norm() == 0);
}

TEST_CASE("keyframes take memory in a few sizes, so that what one leaves fits another") {
  LocalMap map;
  const auto add = [&](std::size_t n) {
    FeatureSet features;
    features.keypoints.resize(n);
    features.descriptors.resize(n);
    features.inverse_depth.resize(n, 0.5F);
    features.inverse_depth_sigma.resize(n, 0.01F);
    return map.add_keyframe(0, identity_pose(), features);
  };
  const MapKeyframe& a = map.keyframe(add(560));
  const MapKeyframe& b = map.keyframe(add(720));
  CHECK(a.features.keypoints.size() == 560);
  CHECK(a.features.inverse_depth.back() == 0.5F);
  CHECK(a.features.keypoints.capacity() == b.features.keypoints.capacity());
  CHECK(a.features.descriptors.capacity() == b.features.descriptors.capacity());
  CHECK(a.features.inverse_depth.capacity() == b.features.inverse_depth.capacity());
  CHECK(a.features.inverse_depth_sigma.capacity() == b.features.inverse_depth_sigma.capacity());
  CHECK(a.landmark.capacity() == b.landmark.capacity());
}

TEST_CASE("a keyframe that is forgotten takes its landmarks along and gives its memory back") {
  LocalMap map;
  FeatureSet features;
  for (int i = 0; i < 50; ++i) {
    features.keypoints.push_back({100.0F + static_cast<float>(i), 200, 1, 0, 0});
    features.descriptors.push_back(Descriptor{});
    features.inverse_depth.push_back(0.5F);
    features.inverse_depth_sigma.push_back(0.01F);
  }
  const int a = map.add_keyframe(0, identity_pose(), features);
  const int b = map.add_keyframe(1, some_pose(), features);
  const int only_a = map.add_landmark(kUnequalCamera, a, 0, 0);
  const int both = map.add_landmark(kUnequalCamera, a, 1, 0);
  map.add_view(both, b, 1);
  REQUIRE(map.living_landmarks() == 2);
  map.forget_keyframe(a);
  map.forget_keyframe(a);  // once is enough
  CHECK(map.living_keyframes() == 1);
  CHECK(map.living_landmarks() == 1);
  CHECK_FALSE(map.landmark(only_a).alive);
  REQUIRE(map.landmark(both).views.size() == 1);
  CHECK(map.landmark(both).views[0].keyframe == b);
  CHECK(map.keyframe(b).landmark[1] == both);
  CHECK(map.first_keyframe() == b);
  CHECK(map.kept_keyframes() == 1);
  map.forget_keyframe(b);
  CHECK(map.living_landmarks() == 0);
  CHECK(map.kept_keyframes() == 0);
  CHECK(map.last_keyframe() < map.first_keyframe());
  CHECK(map.add_keyframe(2, identity_pose(), features) == b + 1);  // numbers are not given again
}

TEST_CASE("a keyframe that is forgotten between others keeps its place until the older ones are gone") {
  LocalMap map;
  for (int i = 0; i < 4; ++i) map.add_keyframe(i, identity_pose(), FeatureSet{});
  map.forget_keyframe(1);
  CHECK(map.first_keyframe() == 0);
  CHECK(map.kept_keyframes() == 4);
  CHECK_FALSE(map.keyframe(1).alive);
  map.forget_keyframe(0);
  CHECK(map.first_keyframe() == 2);
  CHECK(map.last_keyframe() == 3);
  CHECK(map.keyframe(2).timestamp == 2);
  CHECK(map.living_keyframes() == 2);
}

TEST_CASE("an adjustment that takes the newest keyframe elsewhere is refused, and its matches go") {
  const auto seen_from = [](double x) {  // the same points, by a camera so far to the right
    FeatureSet features;
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> u(100, 540), v(100, 380), z(1.5, 3);
    for (int i = 0; i < 60; ++i) {
      const double depth = z(random);
      const auto left = static_cast<float>(u(random) - kUnequalCamera.fx * x / depth);
      features.keypoints.push_back({left, static_cast<float>(v(random)), 1, 0, 0});
      features.descriptors.push_back(Descriptor{});
      features.inverse_depth.push_back(static_cast<float>(1 / depth));
      features.inverse_depth_sigma.push_back(0.003F);
    }
    return features;
  };
  const auto x_after_adjustment = [&](double by_matches, double trusted, LocalMap& map) {
    const int a = map.add_keyframe(0, identity_pose(), seen_from(0));
    const int b = map.add_keyframe(1, make_pose(Eigen::Matrix3d::Identity(), {trusted, 0, 0}), seen_from(by_matches));
    for (int i = 0; i < 60; ++i) map.add_view(map.add_landmark(kUnequalCamera, a, i, 0), b, i);
    PassMarks marks;
    AdjustmentBuffers buffers;
    adjust_last_keyframes(kUnequalCamera, Octaves{}, 5, map, marks, buffers);
    return translation(map.keyframe(b).T_world_camera).x();
  };
  LocalMap agrees;
  CHECK(x_after_adjustment(0.05, 0.03, agrees) == doctest::Approx(0.05).epsilon(0.02));
  CHECK(agrees.landmark(0).views.size() == 2);
  LocalMap elsewhere;
  CHECK(x_after_adjustment(0.5, 0.03, elsewhere) == 0.03);
  CHECK(elsewhere.living_landmarks() == 60);
  for (const MapLandmark& l : elsewhere.landmarks()) {
    CHECK(l.views.size() == 1);
    CHECK(l.views[0].keyframe == 0);
  }
}
