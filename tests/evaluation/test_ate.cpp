#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include <apso/evaluation/ate.hpp>

#include "moved.hpp"

namespace {
using Eigen::Vector3d;

apso::Trajectory from_points(const std::vector<Vector3d>& points) {
  apso::Trajectory t;
  for (std::size_t i = 0; i < points.size(); ++i) {
    apso::StampedPose p;
    p.timestamp = 100.0 + 0.1 * static_cast<double>(i);
    p.T_world_body.translation() = points[i];
    t.push_back(p);
  }
  return t;
}
apso::Pose motion(const Vector3d& v, const Vector3d& w) {
  apso::Twist xi;
  xi.head<3>() = v;
  xi.tail<3>() = w;
  return apso::se3_exp(xi);
}
std::vector<Vector3d> cloud(int n, unsigned seed, double sx = 1, double sy = 1, double sz = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Vector3d> points;
  for (int i = 0; i < n; ++i) {
    const double x = normal(random);
    const double y = normal(random);
    const double z = normal(random);
    points.emplace_back(sx * x, sy * y, sz * z);
  }
  return points;
}
constexpr double pi = 3.14159265358979323846;
}  // namespace

TEST_CASE("a rigidly moved copy has no error and the motion is found, half turns included") {
  const apso::Trajectory truth = from_points(cloud(40, 1));
  std::vector<apso::Pose> motions{motion({1, -2, 3}, {0.3, 0.2, -0.5}), motion({0, 0, 0}, {0, 0, 0})};
  for (int axis = 0; axis < 3; ++axis) {
    apso::Pose half = apso::Pose::Identity();
    half.linear() = -Eigen::Matrix3d::Identity();
    half.linear()(axis, axis) = 1;
    half.translation() = Vector3d(100, -50, 7);
    motions.push_back(half);
  }
  motions.push_back(motion({5, 5, 5}, Vector3d(1, 1, 1).normalized() * pi));
  for (const apso::Pose& T : motions) {
    const apso::AteResult r = apso::ate(moved(T, truth), truth);
    CHECK(r.status == apso::Status::Converged);
    CHECK(r.pairs.size() == 40);
    CHECK(r.statistics.max < 1e-11);
    CHECK((r.T_groundtruth_estimate.matrix() - T.matrix()).norm() < 1e-11);
  }
}

TEST_CASE("planar points have one alignment, a line and a point have many; the error is 0 in all") {
  const apso::Pose T = motion({1, 2, 3}, {0.4, -0.7, 2.0});
  const apso::Trajectory plane = from_points(cloud(30, 2, 1, 1, 0));
  const apso::AteResult p = apso::ate(moved(T, plane), plane);
  CHECK(p.status == apso::Status::Converged);
  CHECK(p.statistics.max < 1e-11);
  CHECK((p.T_groundtruth_estimate.matrix() - T.matrix()).norm() < 1e-11);

  const apso::Trajectory line = from_points(cloud(30, 3, 1, 0, 0));
  const apso::AteResult l = apso::ate(moved(T, line), line);
  CHECK(l.status == apso::Status::Degenerate);
  CHECK(apso::succeeded(l.status));
  CHECK(l.statistics.max < 1e-11);
  CHECK(l.T_groundtruth_estimate.linear().determinant() == doctest::Approx(1.0));

  const apso::Trajectory point = from_points(std::vector<Vector3d>(5, Vector3d(0.1, 0.2, 0.3)));
  const apso::AteResult o = apso::ate(moved(T, point), point);
  CHECK(o.status == apso::Status::Degenerate);
  CHECK(o.statistics.max < 1e-11);
}

TEST_CASE("a mirrored trajectory is not explained by a reflection") {
  std::vector<Vector3d> mirrored = cloud(50, 4);
  const apso::Trajectory truth = from_points(mirrored);
  for (Vector3d& q : mirrored) q.z() = -q.z();
  const apso::AteResult r = apso::ate(truth, from_points(mirrored));
  CHECK(r.T_groundtruth_estimate.linear().determinant() == doctest::Approx(1.0));
  CHECK(r.statistics.rmse > 0.1);
}

TEST_CASE("scale is never fitted: a cross of twice the size is off by its arm") {
  const std::vector<Vector3d> arms{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}};
  std::vector<Vector3d> twice;
  for (const Vector3d& a : arms) twice.push_back(2 * a);
  const apso::AteResult r = apso::ate(from_points(arms), from_points(twice));
  CHECK(r.statistics.rmse == doctest::Approx(1));
  CHECK(r.statistics.min == doctest::Approx(1));
  CHECK(r.statistics.std == doctest::Approx(0));
}

TEST_CASE("without alignment an offset of (3,4,0) is an error of 5, with alignment none") {
  const apso::Trajectory truth = from_points(cloud(10, 5));
  apso::Pose T = apso::Pose::Identity();
  T.translation() = Vector3d(3, 4, 0);
  apso::AteOptions options;
  options.alignment = apso::TrajectoryAlignment::None;
  const apso::AteResult r = apso::ate(truth, moved(T, truth), options);
  CHECK(r.statistics.rmse == doctest::Approx(5));
  CHECK(r.statistics.median == doctest::Approx(5));
  CHECK(r.T_groundtruth_estimate.matrix() == Eigen::Matrix4d::Identity());
  CHECK(apso::ate(truth, moved(T, truth)).statistics.max < 1e-12);
}

TEST_CASE("no motion close to the alignment has a smaller error") {
  std::vector<Vector3d> noisy = cloud(60, 6);
  const std::vector<Vector3d> truth = noisy;
  const std::vector<Vector3d> noise = cloud(60, 7, 0.2, 0.2, 0.2);
  const apso::Pose moved_by = motion({0.5, 0, 1}, {1, 0.5, 0.2});
  for (std::size_t i = 0; i < noisy.size(); ++i) noisy[i] = moved_by * (noisy[i] + noise[i]);
  const apso::HornAlignment h = apso::align_horn(truth, noisy);
  const auto cost = [&](const apso::Pose& T) {
    double c = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) c += (T * noisy[i] - truth[i]).squaredNorm();
    return c;
  };
  const double best = cost(h.T_target_source);
  for (int k = 0; k < 6; ++k) {
    for (const double step : {-1e-3, 1e-3}) {
      apso::Twist xi = apso::Twist::Zero();
      xi(k) = step;
      CHECK(cost(apso::se3_exp(xi) * h.T_target_source) > best);
    }
  }
  CHECK(h.rank == 3);
}

TEST_CASE("the error does not depend on either world frame") {
  const std::vector<Vector3d> points = cloud(80, 8);
  std::vector<Vector3d> noisy = points;
  const std::vector<Vector3d> noise = cloud(80, 9, 0.1, 0.1, 0.1);
  for (std::size_t i = 0; i < noisy.size(); ++i) noisy[i] += noise[i];
  const apso::Trajectory truth = from_points(points);
  const apso::Trajectory estimate = from_points(noisy);
  const double reference = apso::ate(truth, estimate).statistics.rmse;
  const apso::Pose T = motion({10, 20, -30}, {0.1, 2, 0.4});
  CHECK(apso::ate(moved(T, truth), estimate).statistics.rmse == doctest::Approx(reference).epsilon(1e-10));
  CHECK(apso::ate(truth, moved(T, estimate)).statistics.rmse == doctest::Approx(reference).epsilon(1e-10));
  // and exchanging the roles of the two changes nothing, because there is no scale
  CHECK(apso::ate(estimate, truth).statistics.rmse == doctest::Approx(reference).epsilon(1e-10));
}

TEST_CASE("independent noise of sigma per axis gives an rmse of sqrt(3) sigma") {
  const std::vector<Vector3d> points = cloud(4000, 10);
  std::vector<Vector3d> noisy = points;
  const std::vector<Vector3d> noise = cloud(4000, 11, 0.01, 0.01, 0.01);
  for (std::size_t i = 0; i < noisy.size(); ++i) noisy[i] += noise[i];
  // standard error of the rmse is about sigma sqrt(3) / sqrt(6 n), 0.65 %: three of them
  CHECK(apso::ate(from_points(points), from_points(noisy)).statistics.rmse ==
        doctest::Approx(0.01 * std::sqrt(3.0)).epsilon(0.02).scale(0));
}

TEST_CASE("too few pairs is a status, not a number") {
  const apso::Trajectory truth = from_points(cloud(10, 12));
  apso::Trajectory late = truth;
  for (auto& p : late) p.timestamp += 1000;
  const apso::AteResult none = apso::ate(truth, late);
  CHECK(none.status == apso::Status::TooFewMatches);
  CHECK(none.pairs.empty());
  CHECK(none.errors.empty());
  CHECK(none.statistics.count == 0);
  apso::AteOptions options;
  options.time_offset = -1000;
  CHECK(apso::ate(truth, late, options).statistics.rmse < 1e-12);

  const apso::Trajectory two(truth.begin(), truth.begin() + 2);
  CHECK(apso::ate(truth, two).status == apso::Status::TooFewMatches);  // two positions can always be aligned
  options = {};
  options.alignment = apso::TrajectoryAlignment::None;
  CHECK(apso::ate(truth, two, options).statistics.count == 2);
  CHECK(apso::ate({}, {}).status == apso::Status::TooFewMatches);
}

TEST_CASE("wrong calls are contract errors") {
  const apso::Trajectory good = from_points(cloud(5, 13));
  apso::Trajectory bad = good;
  bad[2].timestamp = bad[1].timestamp;
  CHECK_THROWS_AS((void)apso::ate(good, bad), apso::contract_error);
  bad = good;
  bad[3].T_world_body.translation().x() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS((void)apso::ate(bad, good), apso::contract_error);
  apso::AteOptions options;
  options.max_difference = -1;
  CHECK_THROWS_AS((void)apso::ate(good, good, options), apso::contract_error);
  CHECK_THROWS_AS((void)apso::align_horn({}, {}), apso::contract_error);
  CHECK_THROWS_AS((void)apso::align_horn({Vector3d::Zero()}, {}), apso::contract_error);
}

TEST_CASE("a similarity recovers scale and motion; a rigid motion cannot, and its error is never smaller") {
  const apso::Trajectory truth = from_points(cloud(40, 7));
  std::mt19937 random(8);
  std::uniform_real_distribution<double> u(-1, 1);
  apso::AteOptions options;
  for (int i = 0; i < 50; ++i) {
    const double scale = std::exp(3 * u(random));
    const apso::Pose T = motion({9 * u(random), 9 * u(random), 9 * u(random)}, {2 * u(random), 2 * u(random), 2 * u(random)});
    apso::Trajectory estimate = moved(T, truth);
    for (auto& p : estimate) p.T_world_body.translation() *= scale;
    options.alignment = apso::TrajectoryAlignment::Sim3;
    const apso::AteResult r = apso::ate(truth, estimate, options);
    CHECK(r.status == apso::Status::Converged);
    CHECK(r.scale == doctest::Approx(1 / scale).epsilon(1e-10));
    CHECK(r.statistics.max < 1e-9);
    const apso::Trajectory back = apso::aligned(estimate, r);
    for (std::size_t k = 0; k < truth.size(); ++k) {
      CHECK((back[k].T_world_body.matrix() - truth[k].T_world_body.matrix()).cwiseAbs().maxCoeff() < 1e-8);
    }
    options.alignment = apso::TrajectoryAlignment::Se3;
    const apso::AteResult rigid = apso::ate(truth, estimate, options);
    CHECK(rigid.scale == 1);
    CHECK(rigid.statistics.rmse > 1e-4);
  }
}

TEST_CASE("a similarity is the best of all: no other scale or motion nearby has a smaller error") {
  const std::vector<Vector3d> truth = cloud(30, 3);
  std::vector<Vector3d> noisy = cloud(30, 4);
  for (std::size_t i = 0; i < truth.size(); ++i) noisy[i] = 2.5 * truth[i] + 0.4 * noisy[i];
  const apso::SimilarityAlignment a = apso::align_umeyama(truth, noisy);
  const auto cost = [&](double s, const apso::Pose& T) {
    double sum = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) sum += (T * Vector3d(s * noisy[i]) - truth[i]).squaredNorm();
    return sum;
  };
  const double least = cost(a.scale, a.T_target_source);
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 300; ++i) {
    const double size = i < 150 ? 1e-2 : 1e-4;
    const apso::Pose d = motion({size * normal(random), size * normal(random), size * normal(random)},
                                {size * normal(random), size * normal(random), size * normal(random)});
    CHECK(cost(a.scale * (1 + size * normal(random)), d * a.T_target_source) > least);
  }
  // points in one place fix no scale, and nothing becomes NaN
  const apso::SimilarityAlignment o = apso::align_umeyama({{1, 2, 3}, {1, 2, 3}, {1, 2, 3}}, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
  CHECK(o.rank == 0);
  CHECK(o.scale == 1);
  CHECK(apso::is_finite(o.T_target_source));
}

TEST_CASE("yaw alignment keeps gravity: a turn about it is found, a tilt stays as error") {
  const apso::Trajectory truth = from_points(cloud(40, 9));
  std::mt19937 random(10);
  std::uniform_real_distribution<double> u(-1, 1);
  apso::AteOptions yaw;
  yaw.alignment = apso::TrajectoryAlignment::Yaw;
  apso::AteOptions rigid;
  for (int axis = 0; axis < 3; ++axis) {
    yaw.gravity_axis = static_cast<apso::Axis>(axis);
    const Vector3d up = Vector3d::Unit(axis);
    for (int i = 0; i < 20; ++i) {
      const apso::Pose T = motion({5 * u(random), 5 * u(random), 5 * u(random)}, pi * u(random) * up);
      const apso::AteResult r = apso::ate(moved(T, truth), truth, yaw);
      CHECK(r.status == apso::Status::Converged);
      CHECK(r.statistics.max < 1e-12);
      CHECK((r.T_groundtruth_estimate.matrix() - T.matrix()).cwiseAbs().maxCoeff() < 1e-11);
      // any motion: gravity stays, and the rigid alignment, which has more freedom, is at least as good
      const apso::Pose tilted = motion({u(random), u(random), u(random)}, {u(random), u(random), u(random)});
      const apso::AteResult t = apso::ate(moved(tilted, truth), truth, yaw);
      CHECK((t.T_groundtruth_estimate.linear() * up - up).norm() < 1e-15);
      CHECK(t.statistics.rmse > 1e-3);
      CHECK(apso::ate(moved(tilted, truth), truth, rigid).statistics.rmse < 1e-12);
      // the angle is the best one
      for (const double step : {-1e-3, 1e-3}) {
        double sum = 0;
        const apso::Pose other = motion({0, 0, 0}, step * up) * t.T_groundtruth_estimate;
        Vector3d mean = Vector3d::Zero();
        std::vector<Vector3d> left;
        for (const auto& p : truth) {
          left.push_back((tilted * p.T_world_body).translation() - other * p.T_world_body.translation());
          mean += left.back() / static_cast<double>(truth.size());
        }
        for (const Vector3d& e : left) sum += (e - mean).squaredNorm();
        CHECK(std::sqrt(sum / static_cast<double>(truth.size())) > t.statistics.rmse);
      }
    }
  }
  // straight up: no turn about gravity is better than another
  yaw.gravity_axis = apso::Axis::Z;
  const apso::Trajectory shaft = from_points({{1, 1, 0}, {1, 1, 1}, {1, 1, 2}});
  CHECK(apso::ate(shaft, shaft, yaw).status == apso::Status::Degenerate);
  CHECK(apso::ate(shaft, shaft, yaw).statistics.max < 1e-12);
  // a regular polygon and its mirror image: no turn is better than another, and what rounding leaves is none
  std::vector<Vector3d> polygon, mirrored;
  for (int i = 0; i < 7; ++i) {
    polygon.emplace_back(std::cos(2 * pi * i / 7), std::sin(2 * pi * i / 7), 0);
    mirrored.emplace_back(std::cos(2 * pi * i / 7), -std::sin(2 * pi * i / 7), 0);
  }
  CHECK(apso::ate(from_points(mirrored), from_points(polygon), yaw).status == apso::Status::Degenerate);
  // two positions are enough, one is not
  CHECK(apso::ate(truth, apso::Trajectory(truth.begin(), truth.begin() + 2), yaw).status == apso::Status::Converged);
  CHECK(apso::ate(truth, apso::Trajectory(truth.begin(), truth.begin() + 1), yaw).status == apso::Status::TooFewMatches);
  CHECK_THROWS_AS((void)apso::align_about_axis({}, {}, apso::Axis::X), apso::contract_error);
}
