/// \file
/// Several floats worked on at once, by the vector types of GCC and Clang. `Lanes` are as many as the instruction set that is compiled
/// for has in a register (4 on any x86-64 or ARM, 8 with AVX, 16 with AVX-512). Other compilers get plain loops over four floats.
/// wide_lanes.hpp finds at run time whether the processor has more.
///
/// Comparisons give masks, lanes of all ones or zeros; `select(mask, a, b)` takes a where the mask is set. All
/// comparisons with NaN are false.
#pragma once

#include <cstdint>
#include <cstring>
#include <type_traits>

#include <apso/config.hpp>

#if defined(__GNUC__)
#define APSO_INLINE inline __attribute__((always_inline))
#define APSO_FLATTEN __attribute__((flatten))
#else
#define APSO_INLINE inline
#define APSO_FLATTEN
#endif
#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define APSO_HAS_SHUFFLEVECTOR 1
#endif
#endif

APSO_NAMESPACE_BEGIN

#if defined(__GNUC__) && defined(__AVX512F__)
inline constexpr int kLanes = 16;
#elif defined(__GNUC__) && defined(__AVX__)
inline constexpr int kLanes = 8;
#else
inline constexpr int kLanes = 4;
#endif

namespace detail {
#if defined(__GNUC__)
template <int n>
struct Vectors;
template <>
struct Vectors<4> {
  using Float = float __attribute__((vector_size(16)));
  using Int = std::int32_t __attribute__((vector_size(16)));
};
template <>
struct Vectors<8> {
  using Float = float __attribute__((vector_size(32)));
  using Int = std::int32_t __attribute__((vector_size(32)));
};
template <>
struct Vectors<16> {
  using Float = float __attribute__((vector_size(64)));
  using Int = std::int32_t __attribute__((vector_size(64)));
};
#else
template <class T, int n>
struct LoopVector {
  T v[n];
  T& operator[](int i) { return v[i]; }
  const T& operator[](int i) const { return v[i]; }
  template <class F>
  static LoopVector zip(const LoopVector& a, const LoopVector& b, F f) {
    LoopVector r{};
    for (int i = 0; i < n; ++i) r.v[i] = f(a.v[i], b.v[i]);
    return r;
  }
  friend LoopVector operator+(const LoopVector& a, const LoopVector& b) {
    return zip(a, b, [](T x, T y) { return T(x + y); });
  }
  friend LoopVector operator-(const LoopVector& a, const LoopVector& b) {
    return zip(a, b, [](T x, T y) { return T(x - y); });
  }
  friend LoopVector operator*(const LoopVector& a, const LoopVector& b) {
    return zip(a, b, [](T x, T y) { return T(x * y); });
  }
  friend LoopVector operator/(const LoopVector& a, const LoopVector& b) {
    return zip(a, b, [](T x, T y) { return T(x / y); });
  }
  friend LoopVector operator&(const LoopVector& a, const LoopVector& b) {
    return zip(a, b, [](T x, T y) { return T(x & y); });
  }
  friend LoopVector operator|(const LoopVector& a, const LoopVector& b) {
    return zip(a, b, [](T x, T y) { return T(x | y); });
  }
  friend LoopVector operator~(const LoopVector& a) {
    return zip(a, a, [](T x, T) { return T(~x); });
  }
  friend LoopVector<std::int32_t, n> operator<(const LoopVector& a, const LoopVector& b) {
    return compare(a, b, [](T x, T y) { return x < y; });
  }
  friend LoopVector<std::int32_t, n> operator<=(const LoopVector& a, const LoopVector& b) {
    return compare(a, b, [](T x, T y) { return x <= y; });
  }

 private:
  template <class F>
  static LoopVector<std::int32_t, n> compare(const LoopVector& a, const LoopVector& b, F f) {
    LoopVector<std::int32_t, n> r{};
    for (int i = 0; i < n; ++i) r.v[i] = f(a.v[i], b.v[i]) ? -1 : 0;
    return r;
  }
};
template <int n>
struct Vectors {
  using Float = LoopVector<float, n>;
  using Int = LoopVector<std::int32_t, n>;
};
#endif
}  // namespace detail

/// Integers beside the floats: pixel positions, and masks.
template <int n>
struct BasicIntLanes {
  using Vector = typename detail::Vectors<n>::Int;
  Vector v;
  BasicIntLanes() = default;                                     // cppcheck-suppress uninitMemberVar; filled by whoever makes it
  APSO_INLINE BasicIntLanes(const Vector& x) : v(x) {}           // NOLINT: the vector is all that they are
  APSO_INLINE BasicIntLanes(const BasicIntLanes& o) : v(o.v) {}  // NOLINT: as that of BasicLanes
  BasicIntLanes& operator=(const BasicIntLanes&) = default;
  [[nodiscard]] std::int32_t operator[](int i) const { return v[i]; }

  [[nodiscard]] friend APSO_INLINE BasicIntLanes operator+(const BasicIntLanes& a, const BasicIntLanes& b) { return {a.v + b.v}; }
  [[nodiscard]] friend APSO_INLINE BasicIntLanes operator-(const BasicIntLanes& a, const BasicIntLanes& b) { return {a.v - b.v}; }
  [[nodiscard]] friend APSO_INLINE BasicIntLanes operator*(const BasicIntLanes& a, const BasicIntLanes& b) { return {a.v * b.v}; }
  [[nodiscard]] friend APSO_INLINE BasicIntLanes operator&(const BasicIntLanes& a, const BasicIntLanes& b) { return {a.v & b.v}; }
  [[nodiscard]] friend APSO_INLINE BasicIntLanes operator|(const BasicIntLanes& a, const BasicIntLanes& b) { return {a.v | b.v}; }
  [[nodiscard]] friend APSO_INLINE BasicIntLanes operator!(const BasicIntLanes& a) { return {~a.v}; }
};

template <int n>
struct BasicLanes;
/// a where the mask is set, else b: lanes or numbers.
template <int n, class A, class B>
[[nodiscard]] APSO_INLINE BasicLanes<n> select(const BasicIntLanes<n>& m, const A& a, const B& b) {
  const BasicLanes<n> x = a;
  const BasicLanes<n> y = b;
#if defined(__GNUC__)
  return BasicLanes<n>(m.v ? x.v : y.v);
#else
  BasicLanes<n> r;
  for (int i = 0; i < n; ++i) r.v[i] = m.v[i] != 0 ? x.v[i] : y.v[i];
  return r;
#endif
}

template <int n>
struct BasicLanes {
  using Vector = typename detail::Vectors<n>::Float;
  using Mask = BasicIntLanes<n>;
  Vector v;
  BasicLanes() = default;  // cppcheck-suppress uninitMemberVar; filled by whoever makes it
  APSO_INLINE explicit BasicLanes(const Vector& x) : v(x) {}
  /// Written out, which makes calls pass them in memory: the registers for it depend on the instruction set that is compiled for, which may
  /// be another one on the other side.
  APSO_INLINE BasicLanes(const BasicLanes& o) : v(o.v) {}  // NOLINT
  BasicLanes& operator=(const BasicLanes&) = default;
  template <class S, class = std::enable_if_t<std::is_arithmetic_v<S>>>
  APSO_INLINE BasicLanes(S number) {  // NOLINT: a number stands for lanes that all hold it
    const auto x = static_cast<float>(number);
#if defined(APSO_HAS_SHUFFLEVECTOR)
    // GCC takes a vector that is wider than those it compiles for apart, number by number, before it becomes part of a wide loop.
    if constexpr (n == 8 && kLanes == 4) {
      const BasicLanes<4> half = x;
      v = __builtin_shufflevector(half.v, half.v, 0, 1, 2, 3, 4, 5, 6, 7);
      return;
    }
#endif
#if defined(__GNUC__)
    v = x - Vector{};
#else
    for (int i = 0; i < n; ++i) v[i] = x;
#endif
  }
  [[nodiscard]] float operator[](int i) const { return v[i]; }
  /// n floats from any address.
  [[nodiscard]] static APSO_INLINE BasicLanes load(const float* p) {
    BasicLanes r;
    std::memcpy(&r.v, p, sizeof r.v);
    return r;
  }
  APSO_INLINE void store(float* p) const { std::memcpy(p, &v, sizeof v); }
  APSO_INLINE BasicLanes& operator+=(const BasicLanes& o) {
    v = v + o.v;
    return *this;
  }
  /// Sum of the lanes, always in the same order.
  [[nodiscard]] APSO_INLINE float sum() const { return fold<n / 2>(*this)[0]; }
  /// The k-th m of the n lanes.
  template <int m, int k>
  [[nodiscard]] APSO_INLINE BasicLanes<m> part() const {
    static_assert(m * (k + 1) <= n, "apso: so many lanes there are not");
    BasicLanes<m> r;
    std::memcpy(&r.v, reinterpret_cast<const char*>(&v) + sizeof r.v * k, sizeof r.v);
    return r;
  }

  [[nodiscard]] friend APSO_INLINE BasicLanes operator+(const BasicLanes& a, const BasicLanes& b) { return BasicLanes(a.v + b.v); }
  [[nodiscard]] friend APSO_INLINE BasicLanes operator-(const BasicLanes& a, const BasicLanes& b) { return BasicLanes(a.v - b.v); }
  [[nodiscard]] friend APSO_INLINE BasicLanes operator*(const BasicLanes& a, const BasicLanes& b) { return BasicLanes(a.v * b.v); }
  [[nodiscard]] friend APSO_INLINE BasicLanes operator/(const BasicLanes& a, const BasicLanes& b) { return BasicLanes(a.v / b.v); }
  [[nodiscard]] friend APSO_INLINE BasicLanes operator-(const BasicLanes& a) { return BasicLanes(0.0F) - a; }
  [[nodiscard]] friend APSO_INLINE Mask operator<(const BasicLanes& a, const BasicLanes& b) { return {a.v < b.v}; }
  [[nodiscard]] friend APSO_INLINE Mask operator<=(const BasicLanes& a, const BasicLanes& b) { return {a.v <= b.v}; }
  [[nodiscard]] friend APSO_INLINE Mask operator>(const BasicLanes& a, const BasicLanes& b) { return b < a; }
  [[nodiscard]] friend APSO_INLINE Mask operator>=(const BasicLanes& a, const BasicLanes& b) { return b <= a; }
  /// The smaller of two; b when one is NaN.
  [[nodiscard]] friend APSO_INLINE BasicLanes min(const BasicLanes& a, const BasicLanes& b) { return select(a < b, a, b); }
  /// The larger of two; b when one is NaN.
  [[nodiscard]] friend APSO_INLINE BasicLanes max(const BasicLanes& a, const BasicLanes& b) { return select(a > b, a, b); }
  [[nodiscard]] friend APSO_INLINE BasicLanes abs(const BasicLanes& a) { return max(a, BasicLanes(0.0F) - a); }

 private:
  // Adds to each lane the one d, d/2 ... 1 lanes away: all lanes become the sum of all.
  template <int d>
  static APSO_INLINE BasicLanes fold(const BasicLanes& a) {
    if constexpr (d == 0) {
      return a;
    } else {
      BasicLanes other;
#if defined(__GNUC__) && !defined(__clang__)
      typename Mask::Vector index;
      for (int i = 0; i < n; ++i) index[i] = i ^ d;
      other.v = __builtin_shuffle(a.v, index);
#else
      for (int i = 0; i < n; ++i) other.v[i] = a.v[i ^ d];
#endif
      return fold<d / 2>(a + other);
    }
  }
};

using Lanes = BasicLanes<kLanes>;
using IntLanes = BasicIntLanes<kLanes>;
using Mask = IntLanes;

/// `select` for one number, so that a formula can be written once for both.
template <class T>
[[nodiscard]] constexpr T select(bool m, const T& a, const T& b) {
  return m ? a : b;
}

/// Towards zero. Undefined beyond the range of int32.
template <int n>
[[nodiscard]] APSO_INLINE BasicIntLanes<n> to_int(const BasicLanes<n>& a) {
  BasicIntLanes<n> r;
#if defined(__GNUC__)
  r.v = __builtin_convertvector(a.v, typename BasicIntLanes<n>::Vector);
#else
  for (int i = 0; i < n; ++i) r.v[i] = static_cast<std::int32_t>(a.v[i]);
#endif
  return r;
}
template <int n>
[[nodiscard]] APSO_INLINE BasicLanes<n> to_float(const BasicIntLanes<n>& a) {
  BasicLanes<n> r;
#if defined(__GNUC__)
  r.v = __builtin_convertvector(a.v, typename BasicLanes<n>::Vector);
#else
  for (int i = 0; i < n; ++i) r.v[i] = static_cast<float>(a.v[i]);
#endif
  return r;
}

/// The bits of floats as integers and back.
template <int n>
[[nodiscard]] APSO_INLINE BasicIntLanes<n> bits(const BasicLanes<n>& a) {
  BasicIntLanes<n> r;
  std::memcpy(&r.v, &a.v, sizeof r.v);
  return r;
}
template <int n>
[[nodiscard]] APSO_INLINE BasicLanes<n> from_bits(const BasicIntLanes<n>& a) {
  BasicLanes<n> r;
  std::memcpy(&r.v, &a.v, sizeof r.v);
  return r;
}

APSO_NAMESPACE_END
