#include <doctest/doctest.h>

#include <cmath>

#include <apso/math/se3.hpp>
#include <apso/testing/numeric_jacobian.hpp>
#include <apso/types/pinhole.hpp>

using namespace apso;
using apso::testing::numeric_jacobian;

TEST_CASE("numeric Jacobian of functions with known derivatives") {
  const Eigen::Vector3d x(0.7, -1.3, 2.5);
  SUBCASE("polynomial and sine") {
    const auto f = [](const Eigen::VectorXd& v) { return Eigen::Vector2d(v[0] * v[0] * v[1] + std::sin(v[2]), std::exp(v[0]) * v[2]); };
    Eigen::MatrixXd expected(2, 3);
    expected << 2 * x[0] * x[1], x[0] * x[0], std::cos(x[2]), std::exp(x[0]) * x[2], 0, std::exp(x[0]);
    CHECK((numeric_jacobian(f, x) - expected).cwiseAbs().maxCoeff() < 1e-8);
  }
  SUBCASE("a linear function is exact up to rounding") {
    Eigen::Matrix<double, 4, 3> a;
    a << 1, 2, 3, -4, 5, 6, 7, 8, -9, 0, 1, 0;
    const auto f = [&a](const Eigen::VectorXd& v) { return Eigen::VectorXd(a * v); };
    CHECK((numeric_jacobian(f, x) - a).cwiseAbs().maxCoeff() < 1e-9);
  }
  SUBCASE("a scalar function gives one row") {
    const auto f = [](const Eigen::VectorXd& v) { return v.squaredNorm(); };
    const Eigen::MatrixXd j = numeric_jacobian(f, x);
    REQUIRE(j.rows() == 1);
    CHECK((j.transpose() - 2 * x).norm() < 1e-8);
  }
}

TEST_CASE("the derivative of a projection agrees") {
  const Pinhole camera{535.4, 539.2, 320.1, 247.6, 640, 480};
  const Eigen::Vector3d p(0.4, -0.3, 2.1);
  const auto f = [&camera](const Eigen::VectorXd& v) { return camera.project(Eigen::Vector3d(v)); };
  CHECK((numeric_jacobian(f, p) - camera.project_jacobian(p)).cwiseAbs().maxCoeff() < 1e-5);
}

TEST_CASE("a step that is not positive is a contract error") {
  const auto f = [](const Eigen::VectorXd& v) { return v.sum(); };
  CHECK_THROWS_AS((void)numeric_jacobian(f, Eigen::Vector2d(1, 2), 0.0), contract_error);
}
