#include <cmath>
#include <limits>
#include <random>
#include <type_traits>

#include <doctest/doctest.h>

#include <Eigen/Dense>

#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>

namespace {
// Eigen's own operators: written before the names of apso are visible.
struct ByEigen {
  template <class A, class B>
  static auto sum(const A& a, const B& b) {
    return (a + b).eval();
  }
  template <class A, class B>
  static auto difference(const A& a, const B& b) {
    return (a - b).eval();
  }
  template <class A, class B>
  static auto product(const A& a, const B& b) {
    return (a * b).eval();
  }
};
}  // namespace

using namespace apso;

namespace {
template <class M>
M random_like(std::mt19937& random) {
  std::normal_distribution<double> normal(0, 1);
  M m;
  for (int i = 0; i < m.rows(); ++i) {
    for (int j = 0; j < m.cols(); ++j) m(i, j) = static_cast<typename M::Scalar>(normal(random));
  }
  return m;
}

template <class S, int R, int K, int C, int Options>
void check_against_eigen(double tolerance) {
  // of any size: compiled once, and not for each that is checked
  using Any = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>;
  std::mt19937 random(R + 10 * K + 100 * C);
  const auto same = [&](const Any& a, const Any& b) { return static_cast<double>(ByEigen::difference(a, b).norm()) < tolerance; };
  for (int trial = 0; trial < 20; ++trial) {
    const auto A = random_like<Eigen::Matrix<S, R, K, Options>>(random);
    const auto B = random_like<Eigen::Matrix<S, K, C>>(random);
    const auto A2 = random_like<Eigen::Matrix<S, R, K>>(random);
    const auto D = random_like<Eigen::Matrix<S, R, C>>(random);
    static_assert(std::is_same_v<decltype(A + A2), Eigen::Matrix<S, R, K, Options>>, "values, no expressions");
    static_assert(std::is_same_v<decltype(A * B), Eigen::Matrix<S, R, C, Options>>, "values, no expressions");
    const Any a = A, b = B, a2 = A2, d = D;
    CHECK(same(A + A2, ByEigen::sum(a, a2)));
    CHECK(same(A - A2, ByEigen::difference(a, a2)));
    CHECK(same(-A, ByEigen::product(static_cast<S>(-1), a)));
    CHECK(same(static_cast<S>(-2.5) * A, ByEigen::product(static_cast<S>(-2.5), a)));
    CHECK(same(A * B, ByEigen::product(a, b)));
    auto sum = A;
    CHECK(&(sum += A2) == &sum);
    CHECK(same(sum, ByEigen::sum(a, a2)));
    auto scaled = A;
    CHECK(&(scaled *= static_cast<S>(3)) == &scaled);
    CHECK(same(scaled, ByEigen::product(static_cast<S>(3), a)));
    CHECK(same(transposed_times(A, D), ByEigen::product(a.transpose(), d)));
    CHECK(all_finite(A));
    auto broken = A;
    broken(R - 1, K - 1) = std::numeric_limits<S>::quiet_NaN();
    CHECK_FALSE(all_finite(broken));
    broken(R - 1, K - 1) = -std::numeric_limits<S>::infinity();
    CHECK_FALSE(all_finite(broken));
  }
}

Pose random_pose(std::mt19937& random) {
  Pose T = Pose::Identity();
  const Eigen::Vector4d q = random_like<Eigen::Vector4d>(random).normalized();
  T.linear() = Eigen::Quaterniond(q(0), q(1), q(2), q(3)).toRotationMatrix();
  T.translation() = random_like<Eigen::Vector3d>(random);
  return T;
}
}  // namespace

TEST_CASE("sums and products of small matrices are those of Eigen") {
  check_against_eigen<double, 3, 3, 1, 0>(1e-13);
  check_against_eigen<double, 6, 6, 6, Eigen::DontAlign>(1e-12);
  check_against_eigen<double, 2, 3, 4, 0>(1e-13);
  check_against_eigen<float, 3, 3, 3, 0>(1e-5);
}

TEST_CASE("products of small vectors are those of Eigen") {
  std::mt19937 random(5);
  for (int trial = 0; trial < 50; ++trial) {
    const auto a = random_like<Eigen::Vector3d>(random);
    const auto b = random_like<Eigen::Vector3d>(random);
    CHECK(dot(a, b) == doctest::Approx(a.dot(b)).epsilon(1e-12));
    CHECK(squared_norm(a) == doctest::Approx(a.squaredNorm()));
    CHECK(norm(a) == doctest::Approx(a.norm()));
    CHECK((cross(a, b) - a.cross(b)).norm() < 1e-14);
    const auto d = random_like<Eigen::Matrix<double, 4, 1>>(random);
    const auto A = random_like<Eigen::Matrix4d>(random);
    CHECK((scaled_both(d, A) - d.asDiagonal() * A * d.asDiagonal()).norm() < 1e-13);
  }
}

TEST_CASE("poses are composed, applied and taken apart as by Eigen") {
  std::mt19937 random(11);
  for (int trial = 0; trial < 200; ++trial) {
    const Pose A = random_pose(random);
    const Pose B = random_pose(random);
    const auto p = random_like<Eigen::Vector3d>(random);
    CHECK((compose(A, B).matrix() - (A * B).matrix()).norm() < 1e-13);
    CHECK((transform(A, p) - A * p).norm() < 1e-14);
    CHECK(rotation(A) == A.linear());
    CHECK(translation(A) == A.translation());
    CHECK(make_pose(A.linear(), A.translation()).matrix() == A.matrix());
    const Eigen::Quaterniond q(Eigen::Matrix3d(A.linear()));
    CHECK((quaternion(A).coeffs() - q.coeffs()).norm() < 1e-13);
    CHECK((rotation(q) - q.toRotationMatrix()).norm() < 1e-14);
    CHECK((normalized(A).matrix() - A.matrix()).norm() < 1e-13);
    const FloatPose f(A);
    const auto x = static_cast<float>(p.x()), y = static_cast<float>(p.y()), z = static_cast<float>(p.z());
    CHECK((f(x, y, z).cast<double>() - A * p).norm() < 1e-5);
    CHECK((f.rotate(x, y, z).cast<double>() - A.linear() * p).norm() < 1e-5);
  }
}

TEST_CASE("slerp is that of Eigen, takes the short way and meets its ends") {
  std::mt19937 random(13);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Quaterniond a(Eigen::Matrix3d(random_pose(random).linear()));
    const Eigen::Quaterniond b(Eigen::Matrix3d(random_pose(random).linear()));
    for (const double s : {0.0, 0.25, 0.9, 1.0}) {
      CHECK((slerp(a, b, s).toRotationMatrix() - a.slerp(s, b).toRotationMatrix()).norm() < 1e-12);
    }
    const Eigen::Quaterniond near = a * so3_exp({1e-9, 0, 0});
    CHECK(so3_log(a.inverse() * slerp(a, near, 0.5)).norm() == doctest::Approx(5e-10).epsilon(1e-5));
    CHECK((slerp(a, a, 0.3).coeffs() - a.coeffs()).norm() < 1e-14);
  }
}

TEST_CASE("a definite system of any size up to the room is solved; one that is not gives NaN") {
  std::mt19937 random(17);
  for (int n = 1; n <= 8; ++n) {
    const Eigen::MatrixXd R = random_like<Eigen::Matrix<double, 8, 8>>(random).topLeftCorner(n, n);
    const Eigen::MatrixXd A = R * R.transpose() + 0.1 * Eigen::MatrixXd::Identity(n, n);
    const Eigen::VectorXd b = random_like<Eigen::Matrix<double, 8, 1>>(random).head(n);
    double a[8][8] = {};
    double x[8] = {};
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j <= i; ++j) a[i][j] = A(i, j);
      x[i] = b(i);
    }
    solve_definite(a, n, x);
    const Eigen::VectorXd expected = A.llt().solve(b);
    for (int i = 0; i < n; ++i) CHECK(x[i] == doctest::Approx(expected(i)).epsilon(1e-9));
  }
  double a[2][2] = {{1, 0}, {2, 1}};
  double x[2] = {1, 1};
  solve_definite(a, 2, x);
  CHECK(std::isnan(x[1]));
}

TEST_CASE("rows added to normal equations make J^T W J and J^T W r") {
  std::mt19937 random(19);
  const auto J = random_like<Eigen::Matrix<double, 20, 4>>(random);
  const auto r = random_like<Eigen::Matrix<double, 20, 1>>(random);
  double H[4][4] = {};
  double g[4] = {};
  for (int i = 0; i < 20; ++i) {
    const double row[4] = {J(i, 0), J(i, 1), J(i, 2), J(i, 3)};
    add_row(row, 1.0 + i, r(i), H, g);
  }
  const Eigen::VectorXd W = Eigen::VectorXd::LinSpaced(20, 1, 20);
  const Eigen::Matrix4d expected = J.transpose() * W.asDiagonal() * J;
  const Eigen::Vector4d right = J.transpose() * W.asDiagonal() * r;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j <= i; ++j) CHECK(H[i][j] == doctest::Approx(expected(i, j)));
    CHECK(g[i] == doctest::Approx(right(i)));
  }
}
