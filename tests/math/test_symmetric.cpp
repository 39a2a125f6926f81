#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include <apso/math/symmetric.hpp>

using namespace apso;

namespace {
constexpr double eps = std::numeric_limits<double>::epsilon();

template <int N>
Eigen::Matrix<double, N, N> random_matrix(std::mt19937& random) {
  std::normal_distribution<double> normal(0, 1);
  Eigen::Matrix<double, N, N> m;
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) m(i, j) = normal(random);
  }
  return m;
}

// Positive definite with a condition number of up to 10^decades.
template <int N>
Eigen::Matrix<double, N, N> positive(std::mt19937& random, double decades) {
  const Eigen::MatrixXd Q = Eigen::MatrixXd(random_matrix<N>(random)).householderQr().householderQ();
  Eigen::Matrix<double, N, 1> d;
  for (int i = 0; i < N; ++i) d(i) = std::pow(10.0, -decades * i / (N > 1 ? N - 1 : 1));
  const Eigen::Matrix<double, N, N> A = Q * d.asDiagonal() * Q.transpose();
  return 0.5 * (A + A.transpose());
}

template <int N>
void check_solve() {
  std::mt19937 random(7 + N);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Matrix<double, N, N> A = positive<N>(random, trial % 10);
    const Eigen::Matrix<double, N, N> B = random_matrix<N>(random);
    const Eigen::Matrix<double, N, N> X = solve_symmetric(A, B);
    // backward stable: the residual is a few roundings of |A| |X|, whatever the condition
    CHECK((A * X - B).norm() <= 100 * N * eps * (A.norm() * X.norm() + B.norm()));
    CHECK((A * Eigen::MatrixXd(A).ldlt().solve(Eigen::MatrixXd(B)) - B).norm() <= 100 * N * eps * (A.norm() * X.norm() + B.norm()));
    // only the lower triangle is read
    Eigen::Matrix<double, N, N> lower = A;
    for (int i = 0; i < N; ++i) {
      for (int j = i + 1; j < N; ++j) lower(i, j) = std::nan("");
    }
    CHECK(solve_symmetric(lower, B) == X);
  }
}

template <int N>
void check_eigen() {
  std::mt19937 random(70 + N);
  for (int trial = 0; trial < 200; ++trial) {
    Eigen::Matrix<double, N, N> A = random_matrix<N>(random);
    A = (A + A.transpose()).eval();
    if (trial % 3 == 1) A = positive<N>(random, trial % 14);
    if (trial % 3 == 2) A.diagonal() = std::pow(10.0, trial % 7) * A.diagonal().eval();
    const SymmetricEigen<N> e = eigen_symmetric(A);
    const Eigen::Matrix<double, N, N> V = e.vectors;
    CHECK((V.transpose() * V - Eigen::Matrix<double, N, N>::Identity()).norm() <= 50 * N * eps);
    CHECK((A * V - V * e.values.asDiagonal()).norm() <= 50 * N * eps * A.norm());
    for (int i = 1; i < N; ++i) CHECK(e.values(i - 1) <= e.values(i));
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> other(A);  // of any size: compiled once
    CHECK((other.eigenvalues() - e.values).norm() <= 50 * N * eps * A.norm());
  }
}
}  // namespace

TEST_CASE("symmetric systems are solved as well as their condition allows") {
  check_solve<1>();
  check_solve<2>();
  check_solve<3>();
  check_solve<6>();
}

TEST_CASE("a singular system gives a finite solution that still solves what can be solved") {
  std::mt19937 random(3);
  for (int rank = 0; rank < 6; ++rank) {
    const Eigen::Matrix<double, 6, 6> M = random_matrix<6>(random);
    Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
    for (int i = 0; i < rank; ++i) A(2 * i % 6 + (i > 2), 2 * i % 6 + (i > 2)) = 1.0 + i;  // exact zeros elsewhere
    const Eigen::Matrix<double, 6, 1> b = A * M.col(0);
    const Eigen::Matrix<double, 6, 1> x = solve_symmetric(A, b);
    CHECK(x.allFinite());
    CHECK((A * x - b).norm() <= 1e-14 * (1 + b.norm()));
  }
}

TEST_CASE("NaN in a system is seen in its solution") {
  Eigen::Matrix3d A = Eigen::Matrix3d::Identity();
  A(2, 1) = std::nan("");
  CHECK_FALSE(solve_symmetric(A, Eigen::Vector3d(1, 2, 3)).allFinite());
  CHECK_FALSE(solve_symmetric(Eigen::Matrix3d(Eigen::Matrix3d::Identity()), Eigen::Vector3d(1, std::nan(""), 3)).allFinite());
  CHECK_FALSE(eigen_symmetric(A).values.allFinite());
}

TEST_CASE("eigenvalues ascend, eigenvectors are orthonormal") {
  check_eigen<1>();
  check_eigen<2>();
  check_eigen<3>();
  check_eigen<4>();
  check_eigen<6>();
}

TEST_CASE("equal and zero eigenvalues are no trouble") {
  const SymmetricEigen<6> zero = eigen_symmetric(Eigen::Matrix<double, 6, 6>(Eigen::Matrix<double, 6, 6>::Zero()));
  CHECK(zero.values.norm() == 0);
  CHECK(zero.vectors == Eigen::Matrix<double, 6, 6>::Identity());
  const Eigen::Vector3d n = Eigen::Vector3d(1, 2, -2) / 3.0;
  const SymmetricEigen<3> plane = eigen_symmetric(Eigen::Matrix3d(Eigen::Matrix3d::Identity() - n * n.transpose()));
  CHECK(std::abs(plane.values(0)) < 1e-15);
  CHECK(plane.values(1) == doctest::Approx(1).epsilon(1e-14));
  CHECK(std::abs(plane.vectors.col(0).dot(n)) == doctest::Approx(1).epsilon(1e-14));
}

TEST_CASE("a bound on the eigenvalues holds just where the smallest says so") {
  std::mt19937 random(3);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Matrix<double, 6, 6> A = positive<6>(random, 0.05 * i);
    const double least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(A).eigenvalues()(0);
    const double rounding = 1e-12;  // the largest is 1
    CHECK(eigenvalues_exceed(least - 0.01 * least - rounding, A));
    CHECK_FALSE(eigenvalues_exceed(least + 0.01 * least + rounding, A));
  }
  Eigen::Matrix<double, 6, 6> broken = positive<6>(random, 1);
  broken(4, 2) = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(eigenvalues_exceed(0.0, broken));
}

TEST_CASE("definite systems of any size are solved as Eigen solves them, and others are refused") {
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0, 1);
  for (int n : {1, 2, 7, 36}) {
    CAPTURE(n);
    Eigen::MatrixXd M(n, n);
    Eigen::VectorXd b(n);
    for (int i = 0; i < n; ++i) {
      b(i) = normal(random);
      for (int j = 0; j < n; ++j) M(i, j) = normal(random);
    }
    const Eigen::MatrixXd A = M * M.transpose() + 0.1 * Eigen::MatrixXd::Identity(n, n);
    std::vector<double> rows;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) rows.push_back(j <= i ? A(i, j) : std::numeric_limits<double>::quiet_NaN());  // never read
    }
    std::vector<double> x(b.data(), b.data() + n);
    REQUIRE(solve_definite(rows, x));
    CHECK((A * Eigen::Map<Eigen::VectorXd>(x.data(), n) - b).norm() < 1e-10 * b.norm() * A.norm());
  }
  std::vector<double> indefinite{1, 2, 2, 1};
  std::vector<double> b{1, 1};
  CHECK_FALSE(solve_definite(indefinite, b));
  std::vector<double> undefined{std::numeric_limits<double>::quiet_NaN()};
  std::vector<double> c{1};
  CHECK_FALSE(solve_definite(undefined, c));
}
