// Trajectories of types that no code of apso has seen give the numbers of native ones.
#include <cmath>
#include <cstdint>
#include <list>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <apso/evaluate.hpp>

#include "../foreign_types.hpp"

namespace {

// A keyframe as a map keeps it: time in nanoseconds, and a pose of its own.
struct Keyframe {
  std::int64_t nanoseconds = 0;
  foreign::RowMajor3x4Pose T_world_camera;
};

apso::Trajectory circle(double phase, double error) {
  apso::Trajectory t;
  for (int i = 0; i < 100; ++i) {
    const double s = 0.25 * i + phase;
    apso::Twist xi;
    xi << std::cos(s) + error * std::sin(5 * s), std::sin(s), 0.1 * s, 0.1 * s, 0.05, -0.2 * std::sin(s);
    t.push_back({0.25 * i, apso::se3_exp(xi)});
  }
  return t;
}
template <class PoseT>
std::list<std::pair<double, PoseT>> pairs(const apso::Trajectory& t) {
  std::list<std::pair<double, PoseT>> list;
  for (const apso::StampedPose& p : t) list.emplace_back(p.timestamp, apso::from_pose<PoseT>(p.T_world_body));
  return list;
}

}  // namespace

template <>
struct apso::stamped_pose_traits<Keyframe> {
  static double timestamp(const Keyframe& k) { return 1e-9 * static_cast<double>(k.nanoseconds); }
  static foreign::RowMajor3x4Pose pose(const Keyframe& k) { return k.T_world_camera; }
};

TEST_CASE("ATE and RPE of dual quaternions are those of native poses, and the alignment is a dual quaternion") {
  const apso::Trajectory truth = circle(0, 0);
  const apso::Trajectory estimate = circle(0.1, 0.02);
  const auto foreign_truth = pairs<foreign::DualQuaternionPose>(truth);
  const auto foreign_estimate = pairs<foreign::DualQuaternionPose>(estimate);

  const apso::AteResult native = apso::ate(truth, estimate);
  const apso::BasicAteResult<foreign::DualQuaternionPose> ate = apso::ate(foreign_truth, foreign_estimate);
  REQUIRE(apso::succeeded(native.status));
  CHECK(ate.status == native.status);
  CHECK(ate.pairs.size() == native.pairs.size());
  CHECK(ate.errors.size() == native.errors.size());
  CHECK(ate.statistics.rmse == doctest::Approx(native.statistics.rmse).epsilon(1e-9));
  CHECK(native.statistics.rmse > 1e-3);
  CHECK((apso::to_pose(ate.T_groundtruth_estimate).matrix() - native.T_groundtruth_estimate.matrix()).norm() < 1e-9);
  CHECK((native.T_groundtruth_estimate.matrix() - Eigen::Matrix4d::Identity()).norm() > 0.01);

  const apso::RpeResult rpe = apso::rpe(foreign_truth, foreign_estimate);
  const apso::RpeResult native_rpe = apso::rpe(truth, estimate);
  CHECK(rpe.pairs.size() == native_rpe.pairs.size());
  CHECK(rpe.translation.rmse == doctest::Approx(native_rpe.translation.rmse).epsilon(1e-9));
  CHECK(rpe.rotation_deg.rmse == doctest::Approx(native_rpe.rotation_deg.rmse).epsilon(1e-9));
}

TEST_CASE("keyframes of a map, and stamps and poses in two lists") {
  const apso::Trajectory truth = circle(0, 0);
  const apso::Trajectory estimate = circle(0, 0.02);
  std::vector<Keyframe> keyframes;
  std::vector<float> stamps;
  std::vector<foreign::DualQuaternionPose> poses;
  for (const apso::StampedPose& p : estimate) {
    keyframes.push_back({std::llround(1e9 * p.timestamp), apso::from_pose<foreign::RowMajor3x4Pose>(p.T_world_body)});
    stamps.push_back(static_cast<float>(p.timestamp));
    poses.push_back(apso::from_pose<foreign::DualQuaternionPose>(p.T_world_body));
  }
  const double expected = apso::ate(truth, estimate).statistics.rmse;
  CHECK(apso::ate(truth, keyframes).statistics.rmse == doctest::Approx(expected).epsilon(1e-4));  // floats
  CHECK(apso::ate(truth, apso::trajectory(stamps, poses)).statistics.rmse == doctest::Approx(expected).epsilon(1e-9));
  CHECK(apso::associate(truth, keyframes, apso::AssociationRule::Evo).size() == truth.size());
  CHECK(apso::associate(stamps, keyframes, apso::AssociationRule::Tum).size() == truth.size());
  stamps.pop_back();
  CHECK_THROWS_AS((void)apso::trajectory(stamps, poses), apso::contract_error);
  poses.resize(10);
  CHECK_THROWS_AS((void)apso::trajectory(stamps, poses), apso::contract_error);
}

TEST_CASE("scores and outcomes of the caller's types") {
  const std::vector<float> scores{0.9F, 0.8F, 0.3F, 0.1F};
  const std::list<bool> outcomes{true, false, true, false};
  std::vector<std::pair<double, int>> pairs{{0.9, 1}, {0.8, 0}, {0.3, 1}, {0.1, 0}};
  CHECK(apso::area_under_roc(apso::scored_events(scores, outcomes)) == doctest::Approx(0.75));
  CHECK(apso::area_under_roc(pairs) == doctest::Approx(0.75));
  CHECK(apso::reliability(pairs, 2).size() == 2);
  CHECK_THROWS_AS((void)apso::scored_events(scores, std::vector<bool>{true}), apso::contract_error);
}
