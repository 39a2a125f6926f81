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

// What is compared is computed with matrices of any size: those of Eigen are compiled once then, and not for each N.
using Eigen::MatrixXd;

MatrixXd random_matrix(std::mt19937& random, int n) {
  std::normal_distribution<double> normal(0, 1);
  MatrixXd m(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) m(i, j) = normal(random);
  }
  return m;
}

// Positive definite with a condition number of up to 10^decades.
MatrixXd positive(std::mt19937& random, int n, double decades) {
  const MatrixXd Q = random_matrix(random, n).householderQr().householderQ();
  Eigen::VectorXd d(n);
  for (int i = 0; i < n; ++i) d(i) = std::pow(10.0, -decades * i / (n > 1 ? n - 1 : 1));
  const MatrixXd A = Q * d.asDiagonal() * Q.transpose();
  return 0.5 * (A + A.transpose());
}

template <int N>
void check_solve() {
  using Fixed = Eigen::Matrix<double, N, N>;
  std::mt19937 random(7 + N);
  for (int trial = 0; trial < 200; ++trial) {
    const MatrixXd A = positive(random, N, trial % 10);
    const MatrixXd B = random_matrix(random, N);
    const MatrixXd X = solve_symmetric(Fixed(A), Fixed(B));
    // backward stable: the residual is a few roundings of |A| |X|, whatever the condition
    CHECK((A * X - B).norm() <= 100 * N * eps * (A.norm() * X.norm() + B.norm()));
    CHECK((A * A.ldlt().solve(B) - B).norm() <= 100 * N * eps * (A.norm() * X.norm() + B.norm()));
    // only the lower triangle is read
    MatrixXd lower = A;
    for (int i = 0; i < N; ++i) {
      for (int j = i + 1; j < N; ++j) lower(i, j) = std::nan("");
    }
    CHECK(MatrixXd(solve_symmetric(Fixed(lower), Fixed(B))) == X);
  }
}

template <int N>
void check_eigen() {
  std::mt19937 random(70 + N);
  for (int trial = 0; trial < 200; ++trial) {
    MatrixXd A = random_matrix(random, N);
    A = (A + A.transpose()).eval();
    if (trial % 3 == 1) A = positive(random, N, trial % 14);
    if (trial % 3 == 2) A.diagonal() = std::pow(10.0, trial % 7) * A.diagonal().eval();
    const SymmetricEigen<N> e = eigen_symmetric(Eigen::Matrix<double, N, N>(A));
    const MatrixXd V = e.vectors;
    const Eigen::VectorXd values = e.values;
    CHECK((V.transpose() * V - MatrixXd::Identity(N, N)).norm() <= 50 * N * eps);
    CHECK((A * V - V * values.asDiagonal()).norm() <= 50 * N * eps * A.norm());
    for (int i = 1; i < N; ++i) CHECK(values(i - 1) <= values(i));
    const Eigen::SelfAdjointEigenSolver<MatrixXd> other(A);
    CHECK((other.eigenvalues() - values).norm() <= 50 * N * eps * A.norm());
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
    MatrixXd A = MatrixXd::Zero(6, 6);
    for (int i = 0; i < rank; ++i) A(2 * i % 6 + (i > 2), 2 * i % 6 + (i > 2)) = 1.0 + i;  // exact zeros elsewhere
    const Eigen::VectorXd b = A * random_matrix(random, 6).col(0);
    const Eigen::VectorXd x = solve_symmetric(Eigen::Matrix<double, 6, 6>(A), Eigen::Matrix<double, 6, 1>(b));
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
    const MatrixXd wide = positive(random, 6, 0.05 * i);
    const Eigen::Matrix<double, 6, 6> A = wide;
    const double least = Eigen::SelfAdjointEigenSolver<MatrixXd>(wide).eigenvalues()(0);
    const double rounding = 1e-12;  // the largest is 1
    CHECK(eigenvalues_exceed(least - 0.01 * least - rounding, A));
    CHECK_FALSE(eigenvalues_exceed(least + 0.01 * least + rounding, A));
  }
  Eigen::Matrix<double, 6, 6> broken = positive(random, 6, 1);
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
