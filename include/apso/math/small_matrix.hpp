/// \file
/// Arithmetic of small vectors and matrices of fixed size as plain loops.
///
/// Eigen's operators do the same, but each of their results is a type of its own, which every file that includes the library pays for with
/// up to a quarter of a second of the compiler's time (docs/compile_cost.md). The operators here match plain matrices better than Eigen's
/// templates of expressions, so inside namespace apso `R * x + t` is arithmetic of values: it costs a compiler next to nothing, and
/// `auto` holds no reference. Code outside the namespace keeps Eigen's.
#pragma once

#include <cmath>
#include <type_traits>

#include <Eigen/Core>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// A matrix of zeros.
template <class M>
[[nodiscard]] M zeros() {
  M m;
  for (int j = 0; j < M::ColsAtCompileTime; ++j) {
    for (int i = 0; i < M::RowsAtCompileTime; ++i) m(i, j) = 0;
  }
  return m;
}

/// The identity.
template <class M>
[[nodiscard]] M identity() {
  M m = zeros<M>();
  for (int i = 0; i < M::RowsAtCompileTime; ++i) m(i, i) = 1;
  return m;
}

namespace detail {
// Column-major matrices of fixed size; all others are Eigen's business.
template <int R, int C, int Options>
using IfFixed = std::enable_if_t<(R > 0 && C > 0 && (Options & Eigen::RowMajor) == 0), int>;
}  // namespace detail

/// A + B.
template <class S, int R, int C, int A_, int B_, detail::IfFixed<R, C, A_> = 0>
[[nodiscard]] Eigen::Matrix<S, R, C, A_> operator+(const Eigen::Matrix<S, R, C, A_>& A, const Eigen::Matrix<S, R, C, B_>& B) {
  Eigen::Matrix<S, R, C, A_> M;
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) M(i, j) = A(i, j) + B(i, j);
  }
  return M;
}

/// A - B.
template <class S, int R, int C, int A_, int B_, detail::IfFixed<R, C, A_> = 0>
[[nodiscard]] Eigen::Matrix<S, R, C, A_> operator-(const Eigen::Matrix<S, R, C, A_>& A, const Eigen::Matrix<S, R, C, B_>& B) {
  Eigen::Matrix<S, R, C, A_> M;
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) M(i, j) = A(i, j) - B(i, j);
  }
  return M;
}

/// A += B.
template <class S, int R, int C, int A_, int B_, detail::IfFixed<R, C, A_> = 0>
Eigen::Matrix<S, R, C, A_>& operator+=(Eigen::Matrix<S, R, C, A_>& A, const Eigen::Matrix<S, R, C, B_>& B) {
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) A(i, j) += B(i, j);
  }
  return A;
}

/// -A.
template <class S, int R, int C, int A_, detail::IfFixed<R, C, A_> = 0>
[[nodiscard]] Eigen::Matrix<S, R, C, A_> operator-(const Eigen::Matrix<S, R, C, A_>& A) {
  Eigen::Matrix<S, R, C, A_> M;
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) M(i, j) = -A(i, j);
  }
  return M;
}

/// s A.
template <class S, int R, int C, int A_, detail::IfFixed<R, C, A_> = 0>
[[nodiscard]] Eigen::Matrix<S, R, C, A_> operator*(S s, const Eigen::Matrix<S, R, C, A_>& A) {
  Eigen::Matrix<S, R, C, A_> M;
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) M(i, j) = s * A(i, j);
  }
  return M;
}

/// A *= s.
template <class S, int R, int C, int A_, detail::IfFixed<R, C, A_> = 0>
Eigen::Matrix<S, R, C, A_>& operator*=(Eigen::Matrix<S, R, C, A_>& A, S s) {
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) A(i, j) *= s;
  }
  return A;
}

/// A B.
template <class S, int R, int K, int C, int A_, int B_, detail::IfFixed<R, C, A_> = 0>
[[nodiscard]] Eigen::Matrix<S, R, C, A_> operator*(const Eigen::Matrix<S, R, K, A_>& A, const Eigen::Matrix<S, K, C, B_>& B) {
  Eigen::Matrix<S, R, C, A_> M;
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) {
      S sum = 0;
      for (int k = 0; k < K; ++k) sum += A(i, k) * B(k, j);
      M(i, j) = sum;
    }
  }
  return M;
}

/// A^T B.
template <class S, int R, int K, int C, int A_, int B_>
[[nodiscard]] Eigen::Matrix<S, R, C, A_> transposed_times(const Eigen::Matrix<S, K, R, A_>& A, const Eigen::Matrix<S, K, C, B_>& B) {
  Eigen::Matrix<S, R, C, A_> M;
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) {
      S sum = 0;
      for (int k = 0; k < K; ++k) sum += A(k, i) * B(k, j);
      M(i, j) = sum;
    }
  }
  return M;
}

/// (A + A^T) / 2.
template <class S, int N, int A_>
[[nodiscard]] Eigen::Matrix<S, N, N, A_> symmetric_part(const Eigen::Matrix<S, N, N, A_>& A) {
  Eigen::Matrix<S, N, N, A_> M;
  for (int j = 0; j < N; ++j) {
    for (int i = 0; i < N; ++i) M(i, j) = (A(i, j) + A(j, i)) / 2;
  }
  return M;
}

/// diag(d) A diag(d).
template <class S, int N, int D_, int A_>
[[nodiscard]] Eigen::Matrix<S, N, N, A_> scaled_both(const Eigen::Matrix<S, N, 1, D_>& d, const Eigen::Matrix<S, N, N, A_>& A) {
  Eigen::Matrix<S, N, N, A_> M;
  for (int j = 0; j < N; ++j) {
    for (int i = 0; i < N; ++i) M(i, j) = d(i) * A(i, j) * d(j);
  }
  return M;
}

/// a . b.
template <class S, int N, int A_, int B_>
[[nodiscard]] S dot(const Eigen::Matrix<S, N, 1, A_>& a, const Eigen::Matrix<S, N, 1, B_>& b) {
  S sum = a(0) * b(0);
  for (int i = 1; i < N; ++i) sum += a(i) * b(i);
  return sum;
}

/// |a|^2.
template <class S, int N, int A_>
[[nodiscard]] S squared_norm(const Eigen::Matrix<S, N, 1, A_>& a) {
  return dot(a, a);
}

/// |a|.
template <class S, int N, int A_>
[[nodiscard]] S norm(const Eigen::Matrix<S, N, 1, A_>& a) {
  return std::sqrt(dot(a, a));
}

/// a x b.
template <class S, int A_, int B_>
[[nodiscard]] Eigen::Matrix<S, 3, 1, A_> cross(const Eigen::Matrix<S, 3, 1, A_>& a, const Eigen::Matrix<S, 3, 1, B_>& b) {
  return {a(1) * b(2) - a(2) * b(1), a(2) * b(0) - a(0) * b(2), a(0) * b(1) - a(1) * b(0)};
}

/// True when every element is finite.
template <class S, int R, int C, int A_>
[[nodiscard]] bool all_finite(const Eigen::Matrix<S, R, C, A_>& A) {
  for (int j = 0; j < C; ++j) {
    for (int i = 0; i < R; ++i) {
      if (!std::isfinite(A(i, j))) return false;
    }
  }
  return true;
}

APSO_NAMESPACE_END
