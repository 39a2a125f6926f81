/// \file
/// Several floats worked on at once: as wide as the machine that is compiled for (4 on any x86-64 or ARM, 8 with AVX, 16
/// with AVX-512), by the vector types of GCC and Clang. Other compilers get plain loops over four floats.
///
/// Comparisons give masks, lanes of all ones or zeros; `select(mask, a, b)` takes a where the mask is set. All
/// comparisons with NaN are false.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

#if defined(__GNUC__)
#if defined(__AVX512F__)
inline constexpr int kLanes = 16;
#elif defined(__AVX__)
inline constexpr int kLanes = 8;
#else
inline constexpr int kLanes = 4;
#endif

namespace detail {
using FloatVector = float __attribute__((vector_size(4 * kLanes)));
using IntVector = std::int32_t __attribute__((vector_size(4 * kLanes)));
}  // namespace detail
#define APSO_INLINE inline __attribute__((always_inline))
#define APSO_FLATTEN __attribute__((flatten))

#else

inline constexpr int kLanes = 4;
#define APSO_INLINE inline
#define APSO_FLATTEN

namespace detail {
template <class T>
struct LoopVector {
  T v[kLanes];
  T& operator[](int i) { return v[i]; }
  const T& operator[](int i) const { return v[i]; }
  template <class U, class F>
  static LoopVector zip(const U& a, const U& b, F f) {
    LoopVector r{};
    for (int i = 0; i < kLanes; ++i) r.v[i] = f(a.v[i], b.v[i]);
    return r;
  }
  friend LoopVector operator+(LoopVector a, LoopVector b) {
    return zip(a, b, [](T x, T y) { return T(x + y); });
  }
  friend LoopVector operator-(LoopVector a, LoopVector b) {
    return zip(a, b, [](T x, T y) { return T(x - y); });
  }
  friend LoopVector operator*(LoopVector a, LoopVector b) {
    return zip(a, b, [](T x, T y) { return T(x * y); });
  }
  friend LoopVector operator/(LoopVector a, LoopVector b) {
    return zip(a, b, [](T x, T y) { return T(x / y); });
  }
};
using FloatVector = LoopVector<float>;
using IntVector = LoopVector<std::int32_t>;
}  // namespace detail
#endif

namespace detail {
/// Adds to each lane the one n, n/2 ... 1 lanes away: all lanes become the sum of all.
template <int n>
APSO_INLINE FloatVector fold(const FloatVector& a) {
  if constexpr (n == 0) {
    return a;
  } else {
    FloatVector other;
#if defined(__GNUC__) && !defined(__clang__)
    IntVector index;
    for (int i = 0; i < kLanes; ++i) index[i] = i ^ n;
    other = __builtin_shuffle(a, index);
#else
    for (int i = 0; i < kLanes; ++i) other[i] = a[i ^ n];
#endif
    return fold<n / 2>(a + other);
  }
}
}  // namespace detail

/// Integers beside the floats: pixel positions, and masks.
struct IntLanes {
  detail::IntVector v;
  [[nodiscard]] std::int32_t operator[](int i) const { return v[i]; }
};
using Mask = IntLanes;

struct Lanes {
  detail::FloatVector v;
  Lanes() = default;  // cppcheck-suppress uninitMemberVar; filled by whoever makes it
  APSO_INLINE explicit Lanes(const detail::FloatVector& x) : v(x) {}
  template <class S, class = std::enable_if_t<std::is_arithmetic_v<S>>>
  APSO_INLINE Lanes(S number) {  // NOLINT: a number stands for lanes that all hold it
    const auto x = static_cast<float>(number);
#if defined(__GNUC__)
    v = x - detail::FloatVector{};
#else
    for (int i = 0; i < kLanes; ++i) v[i] = x;
#endif
  }
  [[nodiscard]] float operator[](int i) const { return v[i]; }
  /// kLanes floats from any address.
  [[nodiscard]] static APSO_INLINE Lanes load(const float* p) {
    Lanes r;
    std::memcpy(&r.v, p, sizeof r.v);
    return r;
  }
  APSO_INLINE void store(float* p) const { std::memcpy(p, &v, sizeof v); }
  APSO_INLINE Lanes& operator+=(const Lanes& o) {
    v = v + o.v;
    return *this;
  }
  /// Sum of the lanes, always in the same order.
  [[nodiscard]] APSO_INLINE float sum() const {
    detail::FloatVector a = detail::fold<kLanes / 2>(v);
    return a[0];
  }
};

[[nodiscard]] APSO_INLINE Lanes operator+(const Lanes& a, const Lanes& b) { return Lanes(a.v + b.v); }
[[nodiscard]] APSO_INLINE Lanes operator-(const Lanes& a, const Lanes& b) { return Lanes(a.v - b.v); }
[[nodiscard]] APSO_INLINE Lanes operator*(const Lanes& a, const Lanes& b) { return Lanes(a.v * b.v); }
[[nodiscard]] APSO_INLINE Lanes operator/(const Lanes& a, const Lanes& b) { return Lanes(a.v / b.v); }
[[nodiscard]] APSO_INLINE Lanes operator-(const Lanes& a) { return Lanes(0.0F) - a; }
[[nodiscard]] APSO_INLINE IntLanes operator+(const IntLanes& a, const IntLanes& b) { return {a.v + b.v}; }
[[nodiscard]] APSO_INLINE IntLanes operator-(const IntLanes& a, const IntLanes& b) { return {a.v - b.v}; }

#if defined(__GNUC__)
[[nodiscard]] APSO_INLINE Mask operator<(const Lanes& a, const Lanes& b) { return {a.v < b.v}; }
[[nodiscard]] APSO_INLINE Mask operator<=(const Lanes& a, const Lanes& b) { return {a.v <= b.v}; }
[[nodiscard]] APSO_INLINE Mask operator&(const Mask& a, const Mask& b) { return {a.v & b.v}; }
[[nodiscard]] APSO_INLINE Mask operator|(const Mask& a, const Mask& b) { return {a.v | b.v}; }
[[nodiscard]] APSO_INLINE Mask operator!(const Mask& a) { return {~a.v}; }
[[nodiscard]] APSO_INLINE Lanes select(const Mask& m, const Lanes& a, const Lanes& b) { return Lanes(m.v ? a.v : b.v); }
/// Towards zero. Undefined beyond the range of int32.
[[nodiscard]] APSO_INLINE IntLanes to_int(const Lanes& a) { return {__builtin_convertvector(a.v, detail::IntVector)}; }
[[nodiscard]] APSO_INLINE Lanes to_float(const IntLanes& a) { return Lanes(__builtin_convertvector(a.v, detail::FloatVector)); }
#else
namespace detail {
template <class F>
IntVector compare(const FloatVector& a, const FloatVector& b, F f) {
  IntVector r{};
  for (int i = 0; i < kLanes; ++i) r[i] = f(a[i], b[i]) ? -1 : 0;
  return r;
}
}  // namespace detail
inline Mask operator<(const Lanes& a, const Lanes& b) {
  return {detail::compare(a.v, b.v, [](float x, float y) { return x < y; })};
}
inline Mask operator<=(const Lanes& a, const Lanes& b) {
  return {detail::compare(a.v, b.v, [](float x, float y) { return x <= y; })};
}
inline Mask operator&(const Mask& a, const Mask& b) {
  return {detail::IntVector::zip(a.v, b.v, [](int x, int y) { return x & y; })};
}
inline Mask operator|(const Mask& a, const Mask& b) {
  return {detail::IntVector::zip(a.v, b.v, [](int x, int y) { return x | y; })};
}
inline Mask operator!(const Mask& a) {
  return {detail::IntVector::zip(a.v, a.v, [](int x, int) { return ~x; })};
}
inline Lanes select(const Mask& m, const Lanes& a, const Lanes& b) {
  Lanes r;
  for (int i = 0; i < kLanes; ++i) r.v[i] = m.v[i] != 0 ? a.v[i] : b.v[i];
  return r;
}
inline IntLanes to_int(const Lanes& a) {
  IntLanes r{};
  for (int i = 0; i < kLanes; ++i) r.v[i] = static_cast<std::int32_t>(a.v[i]);
  return r;
}
inline Lanes to_float(const IntLanes& a) {
  Lanes r;
  for (int i = 0; i < kLanes; ++i) r.v[i] = static_cast<float>(a.v[i]);
  return r;
}
#endif

[[nodiscard]] APSO_INLINE Mask operator>(const Lanes& a, const Lanes& b) { return b < a; }
[[nodiscard]] APSO_INLINE Mask operator>=(const Lanes& a, const Lanes& b) { return b <= a; }
/// The smaller of two; b when one is NaN.
[[nodiscard]] APSO_INLINE Lanes min(const Lanes& a, const Lanes& b) { return select(a < b, a, b); }
/// The larger of two; b when one is NaN.
[[nodiscard]] APSO_INLINE Lanes max(const Lanes& a, const Lanes& b) { return select(a > b, a, b); }
[[nodiscard]] APSO_INLINE Lanes abs(const Lanes& a) { return max(a, Lanes(0.0F) - a); }
/// The same for one number, so that a formula can be written once for both.
template <class T>
[[nodiscard]] constexpr T select(bool m, const T& a, const T& b) {
  return m ? a : b;
}

/// The bits of floats as integers and back.
[[nodiscard]] APSO_INLINE IntLanes bits(const Lanes& a) {
  IntLanes r;
  std::memcpy(&r.v, &a.v, sizeof r.v);
  return r;
}
[[nodiscard]] APSO_INLINE Lanes from_bits(const IntLanes& a) {
  Lanes r;
  std::memcpy(&r.v, &a.v, sizeof r.v);
  return r;
}

#if defined(__GNUC__)
#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define APSO_HAS_SHUFFLEVECTOR 1
#endif
#endif
namespace detail {
using Four = float __attribute__((vector_size(16)));
APSO_INLINE Four four(const float* p) {
  Four f;
  std::memcpy(&f, p, sizeof f);
  return f;
}
/// The fours at base + at[0], at[4], at[8] ... one behind the other. Joined in registers: written to memory by fours, the
/// whole could not be read back until all of them had reached the cache.
APSO_INLINE FloatVector join(const float* base, const std::int32_t* at) {
#if defined(APSO_HAS_SHUFFLEVECTOR) && defined(__AVX512F__)
  const auto low = __builtin_shufflevector(four(base + at[0]), four(base + at[4]), 0, 1, 2, 3, 4, 5, 6, 7);
  const auto high = __builtin_shufflevector(four(base + at[8]), four(base + at[12]), 0, 1, 2, 3, 4, 5, 6, 7);
  return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
#elif defined(APSO_HAS_SHUFFLEVECTOR) && defined(__AVX__)
  return __builtin_shufflevector(four(base + at[0]), four(base + at[4]), 0, 1, 2, 3, 4, 5, 6, 7);
#else
  Four part[kLanes / 4];
  for (int g = 0; g < kLanes / 4; ++g) part[g] = four(base + at[4 * g]);
  FloatVector whole;
  std::memcpy(&whole, part, sizeof whole);
  return whole;
#endif
}
#undef APSO_HAS_SHUFFLEVECTOR
/// Of each four lanes of a and b the first two (half = 0) or the last two (half = 1), in turn.
template <int half>
APSO_INLINE FloatVector interleave(const FloatVector& a, const FloatVector& b) {
#if defined(__clang__)
  FloatVector r;
  for (int i = 0; i < kLanes; ++i) r[i] = (i % 2 == 0 ? a : b)[i / 4 * 4 + i % 4 / 2 + 2 * half];
  return r;
#else
  IntVector index;
  for (int i = 0; i < kLanes; ++i) index[i] = i / 4 * 4 + i % 4 / 2 + 2 * half + i % 2 * kLanes;
  return __builtin_shuffle(a, b, index);
#endif
}
}  // namespace detail
#endif

/// Four neighbouring floats p[0..3] at each of kLanes places, as four Lanes.
struct Quad {
  Lanes c[4];
};
[[nodiscard]] APSO_INLINE Quad load_quads(const float* base, const IntLanes& offset) {
  Quad q;
#if defined(__GNUC__)
  std::int32_t at[kLanes];
  std::memcpy(at, &offset.v, sizeof at);
  // r_i: of each four lanes the i-th one, all its four floats
  const detail::FloatVector r0 = detail::join(base, at);
  const detail::FloatVector r1 = detail::join(base, at + 1);
  const detail::FloatVector r2 = detail::join(base, at + 2);
  const detail::FloatVector r3 = detail::join(base, at + 3);
  const detail::FloatVector a = detail::interleave<0>(r0, r2);
  const detail::FloatVector b = detail::interleave<0>(r1, r3);
  const detail::FloatVector c = detail::interleave<1>(r0, r2);
  const detail::FloatVector d = detail::interleave<1>(r1, r3);
  q.c[0].v = detail::interleave<0>(a, b);
  q.c[1].v = detail::interleave<1>(a, b);
  q.c[2].v = detail::interleave<0>(c, d);
  q.c[3].v = detail::interleave<1>(c, d);
#else
  for (int i = 0; i < kLanes; ++i) {
    for (int k = 0; k < 4; ++k) q.c[k].v[i] = base[offset.v[i] + k];
  }
#endif
  return q;
}

/// Stores a[0], b[0], a[1], b[1] ... as 2 kLanes floats.
APSO_INLINE void store_pairs(const Lanes& a, const Lanes& b, float* p) {
#if defined(__GNUC__) && !defined(__clang__)
  detail::IntVector low, high;
  for (int i = 0; i < kLanes; ++i) {
    low[i] = i / 2 + (i % 2 == 0 ? 0 : kLanes);
    high[i] = kLanes / 2 + i / 2 + (i % 2 == 0 ? 0 : kLanes);
  }
  Lanes(__builtin_shuffle(a.v, b.v, low)).store(p);
  Lanes(__builtin_shuffle(a.v, b.v, high)).store(p + kLanes);
#else
  for (int i = 0; i < kLanes; ++i) {
    p[2 * i] = a.v[i];
    p[2 * i + 1] = b.v[i];
  }
#endif
}

/// p[0], p[2], ... and p[1], p[3], ... of 2 kLanes floats.
APSO_INLINE void load_pairs(const float* p, Lanes& even, Lanes& odd) {
#if defined(__GNUC__) && !defined(__clang__)
  detail::IntVector e, o;
  for (int i = 0; i < kLanes; ++i) {
    e[i] = 2 * i;
    o[i] = 2 * i + 1;
  }
  const Lanes a = Lanes::load(p);
  const Lanes b = Lanes::load(p + kLanes);
  even = Lanes(__builtin_shuffle(a.v, b.v, e));
  odd = Lanes(__builtin_shuffle(a.v, b.v, o));
#else
  for (int i = 0; i < kLanes; ++i) {
    even.v[i] = p[2 * i];
    odd.v[i] = p[2 * i + 1];
  }
#endif
}

APSO_NAMESPACE_END
