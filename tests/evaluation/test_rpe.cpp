#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include <apso/evaluation/rpe.hpp>

#include "moved.hpp"

namespace {
using Eigen::Vector3d;

/// n poses at 8 Hz (stamps that are exact in binary), constant velocity [m/s] and turn [rad/s] in the body frame.
apso::Trajectory steady(int n, const Vector3d& velocity, const Vector3d& turn) {
  apso::Trajectory t;
  for (int i = 0; i < n; ++i) {
    const double s = 0.125 * i;
    apso::Twist xi;
    xi.head<3>() = velocity * s;
    xi.tail<3>() = turn * s;
    t.push_back({1000.0 + s, apso::se3_exp(xi)});
  }
  return t;
}
apso::RpeOptions frames(double n) {
  apso::RpeOptions o;
  o.delta = n;
  o.unit = apso::DeltaUnit::Frames;
  return o;
}
constexpr double degree = 3.14159265358979323846 / 180.0;
}  // namespace

TEST_CASE("10 % too fast on a straight line is 0.1 m per second") {
  const auto truth = steady(41, {1, 0, 0}, {0, 0, 0});
  const auto estimate = steady(41, {1.1, 0, 0}, {0, 0, 0});
  const apso::RpeResult r = apso::rpe(truth, estimate);
  CHECK(r.status == apso::Status::Converged);
  // 8 poses are one second: i + 8 <= 39 (pairs that end at the last pose, 40, are dropped) leaves i = 0 .. 31
  CHECK(r.pairs.size() == 32);
  CHECK(r.translation.min == doctest::Approx(0.1));
  CHECK(r.translation.max == doctest::Approx(0.1));
  CHECK(r.rotation_deg.max < 1e-6);
  const apso::RpeResult f = apso::rpe(truth, estimate, frames(1));
  CHECK(f.pairs.size() == 39);
  CHECK(f.translation.rmse == doctest::Approx(0.1 / 8));
}

TEST_CASE("turning 2 degrees per second too much") {
  const auto truth = steady(41, {0, 0, 0}, {0, 0, 10 * degree});
  const auto estimate = steady(41, {0, 0, 0}, {0, 0, 12 * degree});
  const apso::RpeResult r = apso::rpe(truth, estimate);
  CHECK(r.rotation_deg.rmse == doctest::Approx(2.0));
  CHECK(r.rotation_deg.std == doctest::Approx(0.0));
  CHECK(r.translation.max < 1e-12);
  apso::RpeOptions half;
  half.delta = 0.5;
  CHECK(apso::rpe(truth, estimate, half).rotation_deg.mean == doctest::Approx(1.0));
}

TEST_CASE("the two forms: equal angles, lengths as their formulas say") {
  // A: a quarter turn about z with t = (1,0,0); B: t = (1,0,0) without turn
  apso::Trajectory estimate = steady(3, {0, 0, 0}, {0, 0, 0});
  apso::Trajectory truth = estimate;
  estimate[1].T_world_body.linear() << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  estimate[1].T_world_body.translation() = Vector3d(1, 0, 0);
  truth[1].T_world_body.translation() = Vector3d(1, 0, 0);
  apso::RpeOptions options = frames(1);
  const apso::RpeResult script = apso::rpe(truth, estimate, options);
  options.form = apso::RpeForm::Paper;
  const apso::RpeResult paper = apso::rpe(truth, estimate, options);
  REQUIRE(script.pairs.size() == 1);
  REQUIRE(paper.pairs.size() == 2);
  CHECK(script.translation_errors[0] == doctest::Approx(std::sqrt(2.0)));  // (1,0,0) - R_A (1,0,0)
  CHECK(paper.translation_errors[0] < 1e-12);                              // (1,0,0) - (1,0,0)
  CHECK(script.rotation_errors_deg[0] == doctest::Approx(90.0));
  CHECK(paper.rotation_errors_deg[0] == doctest::Approx(90.0));
}

TEST_CASE("over frames the paper has all n - delta pairs, the script not the one that ends with the last pose") {
  const apso::Trajectory truth = steady(10, {0.1, 0, 0}, {0, 0, 0.1});
  apso::Trajectory estimate = truth;
  estimate.back().T_world_body.translation().y() += 0.5;  // only a pair with the last pose shows it
  for (const int delta : {1, 3}) {
    apso::RpeOptions options = frames(delta);
    const apso::RpeResult script = apso::rpe(truth, estimate, options);
    CHECK(script.pairs.size() == static_cast<std::size_t>(9 - delta));
    CHECK(script.translation.max < 1e-12);
    options.form = apso::RpeForm::Paper;
    const apso::RpeResult paper = apso::rpe(truth, estimate, options);
    CHECK(paper.pairs.size() == static_cast<std::size_t>(10 - delta));
    CHECK(paper.translation.max == doctest::Approx(0.5));
    CHECK(paper.pairs.back().estimate_j == 9);
    CHECK(paper.pairs.back().estimate_i == static_cast<std::size_t>(9 - delta));
  }
}

TEST_CASE("a half turn too much is 180 degrees") {
  apso::Trajectory estimate = steady(3, {0, 0, 0}, {0, 0, 0});
  const apso::Trajectory truth = estimate;
  estimate[1].T_world_body.linear() << -1, 0, 0, 0, -1, 0, 0, 0, 1;
  CHECK(apso::rpe(truth, estimate, frames(1)).rotation_deg.max == doctest::Approx(180.0));
}

TEST_CASE("a perfect estimate in another world has no error") {
  const auto truth = steady(60, {0.3, 0.1, -0.2}, {0.5, -0.4, 0.3});
  apso::Twist xi;
  xi << 4, 5, 6, 1, -2, 0.5;
  for (const auto form : {apso::RpeForm::TumScript, apso::RpeForm::Paper}) {
    apso::RpeOptions options;
    options.form = form;
    const apso::RpeResult r = apso::rpe(truth, moved(apso::se3_exp(xi), truth), options);
    CHECK(r.translation.max < 1e-12);
    CHECK(r.rotation_deg.max < 1e-9);
  }
}

TEST_CASE("errors do not depend on either world frame") {
  const auto truth = steady(60, {0.3, 0.1, -0.2}, {0.5, -0.4, 0.3});
  const auto estimate = steady(60, {0.31, 0.12, -0.2}, {0.5, -0.45, 0.31});
  apso::Twist xi;
  xi << -1, 2, 30, 0.2, 3, 0.1;
  const apso::RpeResult a = apso::rpe(truth, estimate);
  const apso::RpeResult b = apso::rpe(moved(apso::se3_exp(xi), truth), estimate);
  const apso::RpeResult c = apso::rpe(truth, moved(apso::se3_exp(xi), estimate));
  CHECK(b.translation.rmse == doctest::Approx(a.translation.rmse).epsilon(1e-9));
  CHECK(c.translation.rmse == doctest::Approx(a.translation.rmse).epsilon(1e-9));
  CHECK(c.rotation_deg.rmse == doctest::Approx(a.rotation_deg.rmse).epsilon(1e-9));
}

TEST_CASE("pairs inside a gap of the ground truth are dropped") {
  const auto estimate = steady(41, {1, 0, 0}, {0, 0, 0});
  auto truth = estimate;
  truth.erase(truth.begin() + 17, truth.begin() + 24);  // poses 16 and 24 are left at the edges
  // Farther than 2 x 1/8 s from both edges are 19, 20, 21; exactly 2 intervals (18, 22) is still accepted. Of the 39
  // pairs (i, i+1) four touch them: 18-19, 19-20, 20-21, 21-22.
  const apso::RpeResult r = apso::rpe(truth, estimate, frames(1));
  CHECK(r.pairs.size() == 35);
  for (const auto& p : r.pairs) {
    CHECK((p.estimate_i < 19 || p.estimate_i > 21));
    CHECK((p.estimate_j < 19 || p.estimate_j > 21));
  }
}

TEST_CASE("intervals in metres, degrees and radians are measured along the estimate") {
  const auto truth = steady(41, {4, 0, 0}, {0, 0, 0});  // half a metre per pose
  apso::RpeOptions options;
  options.unit = apso::DeltaUnit::Metres;
  options.delta = 2.0;
  const apso::RpeResult metres = apso::rpe(truth, truth, options);
  REQUIRE(metres.pairs.size() == 36);  // i + 4 <= 39
  for (const auto& p : metres.pairs) CHECK(p.estimate_j == p.estimate_i + 4);

  const auto turning = steady(41, {0, 0, 0}, {0, 0, 16 * degree});  // two degrees per pose
  options.unit = apso::DeltaUnit::Degrees;
  options.delta = 6.0;
  for (const auto& p : apso::rpe(turning, turning, options).pairs) CHECK(p.estimate_j == p.estimate_i + 3);
  options.unit = apso::DeltaUnit::Radians;
  options.delta = 6.0 * degree;
  for (const auto& p : apso::rpe(turning, turning, options).pairs) CHECK(p.estimate_j == p.estimate_i + 3);
}

TEST_CASE("more pairs than the limit are sampled: exactly so many, in order, the same every time") {
  const auto truth = steady(500, {1, 0, 0}, {0, 0, 0});
  apso::RpeOptions options = frames(1);
  options.max_pairs = 50;
  const apso::RpeResult a = apso::rpe(truth, truth, options);
  const apso::RpeResult b = apso::rpe(truth, truth, options);
  options.seed = 1;
  const apso::RpeResult c = apso::rpe(truth, truth, options);
  REQUIRE(a.pairs.size() == 50);
  REQUIRE(c.pairs.size() == 50);
  bool same = true;
  bool other = false;
  for (std::size_t i = 0; i < 50; ++i) {
    same = same && a.pairs[i].estimate_i == b.pairs[i].estimate_i;
    other = other || a.pairs[i].estimate_i != c.pairs[i].estimate_i;
    if (i > 0) CHECK(a.pairs[i - 1].estimate_i < a.pairs[i].estimate_i);
  }
  CHECK(same);
  CHECK(other);
  options.max_pairs = 0;
  CHECK(apso::rpe(truth, truth, options).pairs.size() == 498);
}

TEST_CASE("the sample favours no element") {
  std::vector<int> hits(20, 0);
  for (unsigned seed = 0; seed < 4000; ++seed) {
    std::vector<int> v(20);
    for (int i = 0; i < 20; ++i) v[static_cast<std::size_t>(i)] = i;
    apso::detail::keep_sample(v, 5, seed);
    for (const int k : v) ++hits[static_cast<std::size_t>(k)];
  }
  for (const int h : hits) CHECK(std::abs(h - 1000) < 5 * std::sqrt(4000 * 0.25 * 0.75));  // five sigma of a binomial
}

TEST_CASE("bisection finds a value as close as any") {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> value(0, 1);
  for (int round = 0; round < 200; ++round) {
    std::vector<double> v(1 + random() % 20);
    for (double& x : v) x = value(random);
    std::sort(v.begin(), v.end());
    const double t = 1.4 * value(random) - 0.2;
    double best = 1e9;
    for (const double x : v) best = std::min(best, std::abs(x - t));
    CHECK(std::abs(v[apso::detail::closest_by_bisection(v, t)] - t) == best);
  }
}

TEST_CASE("nothing to compare is a status") {
  const auto truth = steady(20, {1, 0, 0}, {0, 0, 0});
  CHECK(apso::rpe(truth, {}).status == apso::Status::TooFewMatches);
  CHECK(apso::rpe({}, truth).status == apso::Status::TooFewMatches);
  apso::RpeOptions longer;
  longer.delta = 100;
  const apso::RpeResult r = apso::rpe(truth, truth, longer);  // every interval ends at the last pose
  CHECK(r.status == apso::Status::TooFewMatches);
  CHECK(r.translation.count == 0);
  auto late = truth;
  for (auto& p : late) p.timestamp += 500;
  CHECK(apso::rpe(truth, late).status == apso::Status::TooFewMatches);
  apso::RpeOptions offset;
  offset.time_offset = -500;
  CHECK(apso::succeeded(apso::rpe(truth, late, offset).status));
}

TEST_CASE("a delta that is not positive is a contract error") {
  const auto truth = steady(20, {1, 0, 0}, {0, 0, 0});
  apso::RpeOptions options;
  options.delta = 0;
  CHECK_THROWS_AS((void)apso::rpe(truth, truth, options), apso::contract_error);
}
