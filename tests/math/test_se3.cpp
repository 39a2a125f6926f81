#include <doctest/doctest.h>

#include <limits>
#include <random>

#include <apso/math/se3.hpp>

using namespace apso;

namespace {
Twist random_twist(std::mt19937& rng, double angle) {
  std::normal_distribution<double> n;
  Eigen::Vector3d axis(n(rng), n(rng), n(rng));
  axis.normalize();
  Twist xi;
  xi.head<3>() = Eigen::Vector3d(n(rng), n(rng), n(rng));
  xi.tail<3>() = angle * axis;
  return xi;
}
}  // namespace

TEST_CASE("log inverts exp from 0 to nearly pi") {
  std::mt19937 rng(7);
  for (double angle : {0.0, 1e-9, 1e-6, 1e-4, 0.9e-3, 1.1e-3, 0.1, 1.0, 3.0, M_PI - 1e-6}) {
    CAPTURE(angle);
    for (int i = 0; i < 50; ++i) {
      const Twist xi = random_twist(rng, angle);
      const Pose T = se3_exp(xi);
      CHECK((T.linear() * T.linear().transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-12);
      CHECK((se3_log(T) - xi).norm() < 1e-8);
      CHECK(rotation_angle(T) == doctest::Approx(angle).epsilon(1e-9));
    }
  }
}

TEST_CASE("exp of small turns, by its series, is the half of it twice") {
  std::mt19937 rng(5);
  for (double angle : {1e-7, 1e-4, 0.9e-3, 1.9e-3}) {  // the half of the last is summed as a series, the whole is not
    CAPTURE(angle);
    for (int i = 0; i < 20; ++i) {
      Twist xi = random_twist(rng, angle);
      xi.head<3>() *= 100;
      const Pose half = se3_exp(0.5 * xi);
      CHECK(((half * half).matrix() - se3_exp(xi).matrix()).norm() < 5e-13);
      CHECK((se3_log(se3_exp(xi)) - xi).norm() < 5e-12);
    }
  }
}

TEST_CASE("the parts of a twist have the lengths of vectors") {
  Twist xi;
  xi << 2, 3, 6, 4, 4, 7;
  CHECK(translation_norm(xi) == 7);
  CHECK(rotation_norm(xi) == 9);
}

TEST_CASE("exp agrees with the matrix power series") {
  std::mt19937 rng(3);
  for (double angle : {1e-5, 0.3, 2.0}) {
    const Twist xi = random_twist(rng, angle);
    Eigen::Matrix4d a = Eigen::Matrix4d::Zero();
    a.topLeftCorner<3, 3>() = skew(xi.tail<3>());
    a.topRightCorner<3, 1>() = xi.head<3>();
    Eigen::Matrix4d sum = Eigen::Matrix4d::Identity();
    Eigen::Matrix4d term = Eigen::Matrix4d::Identity();
    for (int k = 1; k < 40; ++k) {
      term = term * a / k;
      sum += term;
    }
    CHECK((se3_exp(xi).matrix() - sum).norm() < 1e-12);
  }
}

TEST_CASE("sclerp meets the published values and is bi-invariant") {
  Pose T_f = Pose::Identity();
  T_f.linear() = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T_f.translation() << 1, 0, 0;
  const Pose T_d = Pose::Identity();
  const Pose half = sclerp(T_d, T_f, 0.5);
  CHECK(half.translation().x() == doctest::Approx(0.5));
  CHECK(half.translation().y() == doctest::Approx(-0.2071068).epsilon(1e-6));
  CHECK(rotation_angle(half) == doctest::Approx(M_PI / 4));
  const Pose quarter = sclerp(T_d, T_f, 0.25);
  CHECK(quarter.translation().x() == doctest::Approx(0.2294019).epsilon(1e-6));
  CHECK(quarter.translation().y() == doctest::Approx(-0.1532815).epsilon(1e-6));
  const Twist xi = se3_log(T_f);
  CHECK(xi[0] == doctest::Approx(0.7853982).epsilon(1e-6));
  CHECK(xi[1] == doctest::Approx(-0.7853982).epsilon(1e-6));

  std::mt19937 rng(5);
  const Pose A = se3_exp(random_twist(rng, 1.0));
  const Pose X = se3_exp(random_twist(rng, 0.5));
  const Pose Y = se3_exp(random_twist(rng, 0.8));
  const Pose b = sclerp(X, Y, 0.3);
  CHECK((sclerp(A * X, A * Y, 0.3).matrix() - (A * b).matrix()).norm() < 1e-12);
  CHECK((sclerp(X * A, Y * A, 0.3).matrix() - (b * A).matrix()).norm() < 1e-12);
  CHECK((sclerp(inverse(X), inverse(Y), 0.3).matrix() - inverse(b).matrix()).norm() < 1e-12);
  CHECK(sclerp(X, Y, 0.0).matrix() == X.matrix());
  CHECK(sclerp(X, Y, 1.0).matrix() == Y.matrix());
}

TEST_CASE("what is not finite stays not finite through exp, log and products") {
  const double inf = std::numeric_limits<double>::infinity();
  std::mt19937 rng(11);
  for (const double angle : {0.0, 0.5, 3.1}) {
    const Twist xi = random_twist(rng, angle);
    const Pose T = se3_exp(xi);
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(), inf, -inf}) {
      for (int i = 0; i < 6; ++i) {
        Twist broken = xi;
        broken(i) = bad;
        CAPTURE(i);
        CHECK_FALSE(is_finite(se3_exp(broken)));
      }
      for (int k = 0; k < 12; ++k) {
        Pose broken = T;
        broken(k % 3, k / 3) = bad;
        CAPTURE(k);
        CHECK_FALSE(all_finite(se3_log(broken)));
        CHECK_FALSE(is_finite(inverse(broken)));
        CHECK_FALSE(is_finite(compose(T, broken)));
        CHECK_FALSE(is_finite(compose(broken, T)));
        CHECK_FALSE(is_finite(normalized(broken)));
        CHECK_FALSE(is_rigid(broken));
      }
    }
    CHECK_FALSE(is_finite(sclerp(Pose::Identity(), T, std::numeric_limits<double>::quiet_NaN())));
  }
}

TEST_CASE("a rigid motion is told from a finite matrix that is none") {
  std::mt19937 rng(13);
  for (int i = 0; i < 50; ++i) {
    Pose T = se3_exp(random_twist(rng, 0.06 * i));
    CHECK(is_rigid(T));
    const Eigen::Transform<float, 3, Eigen::Isometry> rounded = T.cast<float>();
    CHECK(is_rigid(rounded.cast<double>()));
    Pose scaled = T;
    scaled.linear() *= 1.004;  // squares to 1.008
    CHECK(is_rigid(scaled));
    scaled.linear() = 1.006 * T.linear();
    CHECK_FALSE(is_rigid(scaled));
    Pose mirrored = T;
    mirrored.linear().col(i % 3) *= -1;
    CHECK_FALSE(is_rigid(mirrored));
    Pose sheared = T;
    sheared.linear().col(0) += 0.02 * T.linear().col(1);
    CHECK_FALSE(is_rigid(sheared));
    Pose far = T;
    far.translation() = Eigen::Vector3d(0, -1e9, 0);
    CHECK(is_rigid(far));
    far.translation().y() *= 1.001;
    CHECK_FALSE(is_rigid(far));
  }
  Pose overflows = Pose::Identity();
  overflows.linear() *= 1e308;  // every element is finite, no product of two of them is
  CHECK(is_finite(overflows));
  CHECK_FALSE(is_rigid(overflows));
  Pose zero = Pose::Identity();
  zero.linear().setZero();
  CHECK_FALSE(is_rigid(zero));
  Pose last_row = Pose::Identity();
  last_row(3, 0) = std::nan("");
  CHECK_FALSE(is_rigid(last_row));
}
