// The filter of constant velocity against one of a single coordinate, and what it is for: a direction that the images leave open.
#include <cmath>
#include <limits>
#include <random>

#include <doctest/doctest.h>

#include <apso/refinement/constant_velocity.hpp>

#include "../foreign_types.hpp"

using namespace apso;

namespace {
constexpr double kFrame = 1 / 30.0;  // [s]

Pose placed(double x, double y = 0) { return make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(x, y, 0)); }
Matrix6 sure(double sigma) { return Matrix6::Identity() / (sigma * sigma); }

/// Has seen `frames` frames of a camera that is shaken by `acceleration` [m/s^2] to and fro along x; the last one has the time 0.
ConstantVelocity shaken(double acceleration, int frames = 12) {
  ConstantVelocity filter;
  double x = 0, v = 0;
  for (int i = 1 - frames; i <= 0; ++i) {
    filter.begin(i * kFrame);
    filter.measured(placed(x), sure(1e-5), true);
    v += (i % 2 == 0 ? acceleration : -acceleration) * kFrame;
    x += v * kFrame;
  }
  return filter;
}

/// The same of one coordinate, as in the textbooks.
struct Scalar {
  double x = 0, v = 0, xx = 0, xv = 0, vv = 1;
  void predict(double a, double dt) {
    const double q = a * a * dt;
    x += v * dt;
    xx += 2 * dt * xv + dt * dt * vv + q * dt * dt * dt / 3;
    xv += dt * vv + q * dt * dt / 2;
    vv += q * dt;
  }
  void measure(double z, double variance) {
    const double r = 1 / (1 / variance + 1 / (kBlendGateTranslation * kBlendGateTranslation));  // see measured()
    const double gx = xx / (xx + r), gv = xv / (xx + r), off = z - x;
    x += gx * off;
    v += gv * off;
    vv -= gv * xv;
    xv -= gx * xv;
    xx -= gx * xx;
  }
};
}  // namespace

TEST_CASE("the motion is not asked before it is known") {
  CHECK_FALSE(ConstantVelocity().ready());
  CHECK_FALSE(shaken(1, 5).ready());  // the first of the frames has none before it
  ConstantVelocity filter = shaken(1, 6);
  CHECK(filter.ready());
  SUBCASE("after a guess") { filter.lost(); }
  SUBCASE("after a gap") { filter.begin(ConstantVelocity::kLongestGap + 0.01); }
  SUBCASE("back in time") { filter.begin(-1); }
  SUBCASE("the same frame again") { filter.begin(0); }
  SUBCASE("without a stamp") { filter.begin(std::numeric_limits<double>::quiet_NaN()); }
  SUBCASE("of what is no pose") {
    filter.begin(kFrame);
    filter.measured(placed(std::numeric_limits<double>::quiet_NaN()), sure(1e-5));
  }
  SUBCASE("by what is no information") {
    filter.begin(kFrame);
    filter.measured(placed(0), sure(std::numeric_limits<double>::quiet_NaN()));
  }
  SUBCASE("once it is forgotten") {
    filter.reset();
    filter.begin(0);
    filter.measured(placed(0), sure(1e-5));
  }
  CHECK_FALSE(filter.ready());
}

TEST_CASE("it is the filter of one coordinate in each of three") {
  ConstantVelocity filter;
  Scalar x, y;
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 1);
  RunningMedian seen(300);  // accelerations
  double t = 0;
  for (int i = 0; i < 60; ++i) {
    CAPTURE(i);
    const double dt = i % 3 == 0 ? 2 * kFrame : kFrame;
    t += dt;
    const double sigma = 0.002 + 0.001 * (i % 5);
    const double zx = std::sin(2 * t), zy = 0.3 * t + sigma * noise(random);
    filter.begin(t);
    if (i > 0) {
      const double a = kAccelerationDoubt / 1.538 * std::max(0.0005 / (dt * dt), seen.median());
      x.predict(a, dt);
      y.predict(a, dt);
      CHECK(filter.position()(0) == doctest::Approx(x.x).epsilon(1e-6));
      CHECK(filter.position()(1) == doctest::Approx(y.x).epsilon(1e-6));
    }
    const bool trusted = i % 2 == 0;
    if (i == 0) {
      x.x = zx;
      y.x = zy;
      x.xx = y.xx = 1 / (1 / (sigma * sigma) + 1 / (kBlendGateTranslation * kBlendGateTranslation));
    } else {
      if (trusted) seen.add(std::hypot(zx - x.x, zy - y.x) / (dt * dt));
      x.measure(zx, sigma * sigma);
      y.measure(zy, sigma * sigma);
    }
    filter.measured(placed(zx, zy), sure(sigma), trusted);
  }
}

TEST_CASE("a direction that is open goes on as before, the others are as measured") {
  ConstantVelocity filter;
  for (int i = 0; i < 20; ++i) {
    filter.begin(i * kFrame);
    filter.measured(placed(0.01 * i, -0.005 * i), sure(1e-5), true);
  }
  Matrix6 known = sure(0.001);
  known(0, 0) = 0;
  for (int i = 20; i < 30; ++i) {
    CAPTURE(i);
    filter.begin(i * kFrame);
    REQUIRE(filter.ready());
    const Pose T = filter.join(placed(0.01 * i + 0.08, -0.005 * i), known);
    CHECK(T(0, 3) == doctest::Approx(0.01 * i).epsilon(0.02));
    CHECK(T(1, 3) == doctest::Approx(-0.005 * i).epsilon(0.001));
  }
}

TEST_CASE("the rotation goes along with the position, so that the images still fit") {
  ConstantVelocity filter = shaken(0.1);
  filter.begin(kFrame);
  // A wall 3 m away: to the right and a turn about y show the same, and what is seen is known well.
  const double depth = 3;
  Twist seen = Twist::Zero();
  seen(0) = 1;
  seen(4) = depth;  // x' = x + v_x + w_y z
  Matrix6 known = seen * seen.transpose() / (0.0005 * 0.0005);
  for (int i = 0; i < 6; ++i) known(i, i) += i == 0 || i == 4 ? 1 / (0.5 * 0.5) : 1 / (0.0005 * 0.0005);
  const Pose T_images = se3_exp((Twist() << 0.06, 0, 0, 0, -0.06 / depth, 0).finished());
  const Pose T = filter.join(T_images, known);
  CHECK(std::abs(T(0, 3)) < 0.005);
  const Twist moved = se3_log(compose(inverse(T), T_images));
  CHECK(moved(0) > 0.05);
  CHECK(moved(0) + depth * moved(4) == doctest::Approx(0).epsilon(0.001));
}

TEST_CASE("a camera is followed more closely than by measurements that err along one direction") {
  for (const unsigned seed : {1U, 2U, 3U}) {
    CAPTURE(seed);
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, 0.015);
    ConstantVelocity filter;
    double measured = 0, followed = 0;
    for (int i = 0; i < 300; ++i) {
      const double t = i * kFrame;
      const double x = 0.3 * std::sin(t);
      filter.begin(t);
      if (i % 60 < 30) {
        filter.measured(placed(x), sure(0.0005), true);
        continue;
      }
      Matrix6 known = sure(0.0005);
      known(0, 0) = 1 / (0.015 * 0.015);
      const double z = x + noise(random);
      REQUIRE(filter.ready());
      const double off = filter.join(placed(z), known)(0, 3) - x;
      measured += (z - x) * (z - x);
      followed += off * off;
    }
    CHECK(followed < 0.25 * measured);
  }
}

TEST_CASE("a prediction that takes the place of a pose tells nothing of the motion") {
  ConstantVelocity filter = shaken(0.1), without = filter;
  without.begin(kFrame);
  const double first = without.position()(0);
  without.begin(2 * kFrame);
  const double step = without.position()(0) - first;
  filter.begin(kFrame);
  filter.predicted(placed(0.02));
  filter.begin(2 * kFrame);
  CHECK(filter.ready());
  CHECK(filter.position()(0) == doctest::Approx(0.02 + step).epsilon(1e-6));  // on with the velocity before
}

TEST_CASE_TEMPLATE("a held pose comes back as the type it came in", PoseT, foreign::DualQuaternionPose, foreign::RowMajor3x4Pose) {
  ConstantVelocity own = shaken(1), theirs = own;
  own.begin(kFrame);
  theirs.begin(kFrame);
  const PoseT T = theirs.join(from_pose<PoseT>(placed(0.05)), sure(0.01));
  CHECK((to_pose(T).matrix() - own.join(placed(0.05), sure(0.01)).matrix()).norm() < 1e-6);
  theirs.begin(2 * kFrame);
  own.begin(2 * kFrame);
  theirs.measured(from_pose<PoseT>(placed(0.03)), sure(0.01));
  own.measured(placed(0.03), sure(0.01));
  theirs.begin(3 * kFrame);
  theirs.predicted(from_pose<PoseT>(placed(0.04)));
  own.begin(3 * kFrame);
  own.predicted(placed(0.04));
  CHECK((theirs.position() - own.position()).norm() < 1e-6);
}
