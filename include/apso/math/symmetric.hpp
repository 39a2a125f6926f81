/// \file
/// Small symmetric systems and eigenvalues, as plain loops over fixed sizes.
///
/// Eigen's LDLT and SelfAdjointEigenSolver do the same, but each size of theirs costs a compiler up to two and a half seconds in
/// every file that includes the library (docs/compile_cost.md); for sizes up to 6 loops are as fast and cost nothing.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// Adds a residual r with the row J of its Jacobian to normal equations.
/// \param H lower triangle of sum weight J^T J; \param g sum weight r J
template <class S, int N>
void add_row(const S (&J)[N], S weight, S r, S (&H)[N][N], S (&g)[N]) {
  for (int i = 0; i < N; ++i) {
    const S wj = weight * J[i];
    for (int j = 0; j <= i; ++j) H[i][j] += wj * J[j];
    g[i] += wj * r;
  }
}

/// Whether all eigenvalues of a symmetric A are larger than `bound`, by whether A - bound I has a Cholesky decomposition.
/// Only the lower triangle of A is read; false for NaN.
template <int N, int Options>
[[nodiscard]] bool eigenvalues_exceed(double bound, const Eigen::Matrix<double, N, N, Options>& A) {
  double L[N][N];
  for (int j = 0; j < N; ++j) {
    double d = A(j, j) - bound;
    for (int k = 0; k < j; ++k) d -= L[j][k] * L[j][k];
    if (!(d > 0)) return false;
    L[j][j] = std::sqrt(d);
    for (int i = j + 1; i < N; ++i) {
      double v = A(i, j);
      for (int k = 0; k < j; ++k) v -= L[i][k] * L[j][k];
      L[i][j] = v / L[j][j];
    }
  }
  return true;
}

/// Solves A X = B for a symmetric positive semidefinite A by A = P^T L D L^T P with the largest pivot first
/// (Golub & Van Loan, Matrix Computations, 4.2.8). Only the lower triangle of A is read. Directions without any pivot
/// get the solution 0, so a singular A gives a finite X; a NaN in A or B gives NaN.
/// \param A N x N
/// \param B N x columns
template <int N, int Options, int Columns, int OptionsB>
[[nodiscard]] Eigen::Matrix<double, N, Columns, OptionsB> solve_symmetric(const Eigen::Matrix<double, N, N, Options>& A,
                                                                          const Eigen::Matrix<double, N, Columns, OptionsB>& B) {
  static_assert(N > 0 && Columns > 0, "apso: solve_symmetric needs matrices of fixed size");
  double L[N][N];  // strictly lower: L; diagonal: D
  int order[N];
  for (int i = 0; i < N; ++i) {
    order[i] = i;
    for (int j = 0; j <= i; ++j) L[i][j] = L[j][i] = A(i, j);
  }
  for (int k = 0; k < N; ++k) {
    int pivot = k;
    for (int i = k + 1; i < N; ++i) {
      if (std::abs(L[i][i]) > std::abs(L[pivot][pivot])) pivot = i;
    }
    if (pivot != k) {  // symmetric swap; the finished columns of L go along
      std::swap(order[k], order[pivot]);
      for (int j = 0; j < N; ++j) std::swap(L[k][j], L[pivot][j]);
      for (int i = k; i < N; ++i) std::swap(L[i][k], L[i][pivot]);
    }
    const double d = L[k][k];
    if (std::abs(d) < std::numeric_limits<double>::min()) {  // the rest of a semidefinite matrix is zero as well
      for (int i = k + 1; i < N; ++i) L[i][k] = 0;
      continue;
    }
    double column[N] = {};
    for (int i = k + 1; i < N; ++i) {
      column[i] = L[i][k];
      L[i][k] /= d;
    }
    for (int i = k + 1; i < N; ++i) {
      for (int j = k + 1; j <= i; ++j) {
        L[i][j] -= L[i][k] * column[j];
        L[j][i] = L[i][j];
      }
    }
  }
  Eigen::Matrix<double, N, Columns, OptionsB> X;
  for (int c = 0; c < Columns; ++c) {
    double x[N];
    for (int i = 0; i < N; ++i) {
      x[i] = B(order[i], c);
      for (int j = 0; j < i; ++j) x[i] -= L[i][j] * x[j];
    }
    for (int i = 0; i < N; ++i) {
      if (std::abs(L[i][i]) < std::numeric_limits<double>::min()) {
        x[i] = 0;
      } else {
        x[i] /= L[i][i];
      }
    }
    for (int i = N - 1; i >= 0; --i) {
      for (int j = i + 1; j < N; ++j) x[i] -= L[j][i] * x[j];
    }
    for (int i = 0; i < N; ++i) X(order[i], c) = x[i];
  }
  return X;
}

/// Solves A x = b for a symmetric positive definite A of the first n rows and columns by A = L L^T (Golub & Van Loan
/// 4.2.5). Only the lower triangle is read. A matrix that is not positive definite gives NaN.
/// \param[in,out] A becomes L; \param[in,out] b becomes x
template <class S, int N>
void solve_definite(S (&A)[N][N], int n, S (&b)[N]) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) {
      S sum = A[i][j];
      for (int k = 0; k < j; ++k) sum -= A[i][k] * A[j][k];
      A[i][j] = i == j ? std::sqrt(sum) : sum / A[j][j];
    }
    for (int k = 0; k < i; ++k) b[i] -= A[i][k] * b[k];
    b[i] /= A[i][i];
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int k = i + 1; k < n; ++k) b[i] -= A[k][i] * b[k];
    b[i] /= A[i][i];
  }
}

/// The same for a matrix whose size is known at run time.
/// \param[in,out] A n x n, row by row, only the lower triangle is read; becomes L; \param[in,out] b becomes x
/// \return false when A is not positive definite; b has no meaning then
inline bool solve_definite(std::vector<double>& A, std::vector<double>& b) {
  const std::size_t n = b.size();
  for (std::size_t i = 0; i < n; ++i) {
    double* Li = A.data() + i * n;
    for (std::size_t j = 0; j <= i; ++j) {
      const double* Lj = A.data() + j * n;
      double sum = Li[j];
      for (std::size_t k = 0; k < j; ++k) sum -= Li[k] * Lj[k];
      if (i == j && !(sum > 0)) return false;
      Li[j] = i == j ? std::sqrt(sum) : sum / Lj[j];
    }
    for (std::size_t k = 0; k < i; ++k) b[i] -= Li[k] * b[k];
    b[i] /= Li[i];
  }
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t k = i + 1; k < n; ++k) b[i] -= A[k * n + i] * b[k];
    b[i] /= A[i * n + i];
  }
  return true;
}

/// Eigenvalues and orthonormal eigenvectors of a symmetric matrix by cyclic Jacobi rotations (Golub & Van Loan 8.5).
/// Accurate to a few roundings of the largest eigenvalue; NaN in gives NaN out.
/// \param[in,out] a only the lower triangle is read; overwritten
/// \param[out] values in ascending order; \param[out] vectors as columns in the same order
template <int N>
void eigen_symmetric(double (&a)[N][N], double (&values)[N], double (&vectors)[N][N]) {
  double v[N][N];
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) {
      if (j > i) a[i][j] = a[j][i];
      v[i][j] = i == j ? 1.0 : 0.0;
    }
  }
  for (int sweep = 0; sweep < 30; ++sweep) {  // converges quadratically, 5 to 8 sweeps
    bool rotated = false;
    for (int p = 0; p < N; ++p) {
      for (int q = p + 1; q < N; ++q) {
        const double scale = std::abs(a[p][p]) + std::abs(a[q][q]);
        if (std::abs(a[p][q]) <= 1e-3 * std::numeric_limits<double>::epsilon() * scale) continue;
        const double theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
        const double t = (theta >= 0 ? 1.0 : -1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1.0));
        const double c = 1.0 / std::sqrt(t * t + 1.0);
        const double s = t * c;
        rotated = true;
        for (int k = 0; k < N; ++k) {
          const double x = a[k][p];
          const double y = a[k][q];
          a[k][p] = c * x - s * y;
          a[k][q] = s * x + c * y;
        }
        for (int k = 0; k < N; ++k) {
          const double x = a[p][k];
          const double y = a[q][k];
          a[p][k] = c * x - s * y;
          a[q][k] = s * x + c * y;
          const double vx = v[k][p];
          const double vy = v[k][q];
          v[k][p] = c * vx - s * vy;
          v[k][q] = s * vx + c * vy;
        }
        a[p][q] = a[q][p] = 0;
      }
    }
    if (!rotated) break;
  }
  int order[N];
  for (int i = 0; i < N; ++i) order[i] = i;
  for (int i = 1; i < N; ++i) {
    for (int j = i; j > 0 && a[order[j]][order[j]] < a[order[j - 1]][order[j - 1]]; --j) std::swap(order[j], order[j - 1]);
  }
  for (int i = 0; i < N; ++i) {
    values[i] = a[order[i]][order[i]];
    for (int k = 0; k < N; ++k) vectors[k][i] = v[k][order[i]];
  }
}

/// Eigenvalues in ascending order, and the eigenvectors as columns in the same order.
template <int N>
struct SymmetricEigen {
  Eigen::Matrix<double, N, 1, Eigen::DontAlign> values;
  Eigen::Matrix<double, N, N, Eigen::DontAlign> vectors;
};

/// The same for a matrix of Eigen.
template <int N, int Options>
[[nodiscard]] SymmetricEigen<N> eigen_symmetric(const Eigen::Matrix<double, N, N, Options>& A) {
  static_assert(N > 0, "apso: eigen_symmetric needs a matrix of fixed size");
  double a[N][N];
  double values[N];
  double vectors[N][N];
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j <= i; ++j) a[i][j] = A(i, j);
  }
  eigen_symmetric(a, values, vectors);
  SymmetricEigen<N> result;
  for (int i = 0; i < N; ++i) {
    result.values(i) = values[i];
    for (int k = 0; k < N; ++k) result.vectors(k, i) = vectors[k][i];
  }
  return result;
}

APSO_NAMESPACE_END
