#include <doctest/doctest.h>

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
