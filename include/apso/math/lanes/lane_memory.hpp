/// \file
/// Lanes from memory that does not lie side by side, and back.
#pragma once

#include <cstdint>
#include <cstring>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>

APSO_NAMESPACE_BEGIN

/// base[offset] of each.
template <int n>
[[nodiscard]] APSO_INLINE BasicLanes<n> gather(const float* base, const BasicIntLanes<n>& offset) {
  std::int32_t at[n];
  std::memcpy(at, &offset.v, sizeof at);
  BasicLanes<n> r = 0.0F;
  for (int i = 0; i < n; ++i) r.v[i] = base[at[i]];
  return r;
}

#if defined(__GNUC__)
namespace detail {
/// The fours at base + at[0], at[4], at[8] ... one behind the other. Joined in registers: written to memory by fours, the
/// whole could not be read back until all of them had reached the cache.
template <int n>
APSO_INLINE BasicLanes<n> join(const float* base, const std::int32_t* at) {
  BasicLanes<n> r;
#if defined(APSO_HAS_SHUFFLEVECTOR)
  if constexpr (n == 4) {
    r = BasicLanes<4>::load(base + at[0]);
  } else if constexpr (n == 8) {
    r.v = __builtin_shufflevector(BasicLanes<4>::load(base + at[0]).v, BasicLanes<4>::load(base + at[4]).v, 0, 1, 2, 3, 4, 5, 6, 7);
  } else {
    r.v = __builtin_shufflevector(join<8>(base, at).v, join<8>(base, at + 8).v, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  }
#else
  float whole[n];
  for (int g = 0; g < n; g += 4) BasicLanes<4>::load(base + at[g]).store(whole + g);
  r = BasicLanes<n>::load(whole);
#endif
  return r;
}
/// Of each four lanes of a and b the first two (half = 0) or the last two (half = 1), in turn.
template <int half, int n>
APSO_INLINE BasicLanes<n> interleave(const BasicLanes<n>& a, const BasicLanes<n>& b) {
  BasicLanes<n> r;
#if defined(__clang__)
  for (int i = 0; i < n; ++i) r.v[i] = (i % 2 == 0 ? a : b).v[i / 4 * 4 + i % 4 / 2 + 2 * half];
#else
  typename BasicIntLanes<n>::Vector index;
  for (int i = 0; i < n; ++i) index[i] = i / 4 * 4 + i % 4 / 2 + 2 * half + i % 2 * n;
  r.v = __builtin_shuffle(a.v, b.v, index);
#endif
  return r;
}
}  // namespace detail
#endif

/// Four neighbouring floats p[0..3] at each of n places, as four times n lanes.
template <int n>
struct BasicQuad {
  BasicLanes<n> c[4];
};
using Quad = BasicQuad<kLanes>;
template <int n>
[[nodiscard]] APSO_INLINE BasicQuad<n> load_quads(const float* base, const BasicIntLanes<n>& offset) {
  BasicQuad<n> q;
#if defined(__GNUC__)
  std::int32_t at[n];
  std::memcpy(at, &offset.v, sizeof at);
  // r_i: of each four lanes the i-th one, all its four floats
  const BasicLanes<n> r0 = detail::join<n>(base, at);
  const BasicLanes<n> r1 = detail::join<n>(base, at + 1);
  const BasicLanes<n> r2 = detail::join<n>(base, at + 2);
  const BasicLanes<n> r3 = detail::join<n>(base, at + 3);
  const BasicLanes<n> a = detail::interleave<0>(r0, r2);
  const BasicLanes<n> b = detail::interleave<0>(r1, r3);
  const BasicLanes<n> c = detail::interleave<1>(r0, r2);
  const BasicLanes<n> d = detail::interleave<1>(r1, r3);
  q.c[0] = detail::interleave<0>(a, b);
  q.c[1] = detail::interleave<1>(a, b);
  q.c[2] = detail::interleave<0>(c, d);
  q.c[3] = detail::interleave<1>(c, d);
#else
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < 4; ++k) q.c[k].v[i] = base[offset.v[i] + k];
  }
#endif
  return q;
}

/// Stores a[0], b[0], a[1], b[1] ... as 2n floats.
template <int n>
APSO_INLINE void store_pairs(const BasicLanes<n>& a, const BasicLanes<n>& b, float* p) {
#if defined(__GNUC__) && !defined(__clang__)
  typename BasicIntLanes<n>::Vector low, high;
  for (int i = 0; i < n; ++i) {
    low[i] = i / 2 + (i % 2 == 0 ? 0 : n);
    high[i] = n / 2 + i / 2 + (i % 2 == 0 ? 0 : n);
  }
  BasicLanes<n>(__builtin_shuffle(a.v, b.v, low)).store(p);
  BasicLanes<n>(__builtin_shuffle(a.v, b.v, high)).store(p + n);
#else
  for (int i = 0; i < n; ++i) {
    p[2 * i] = a.v[i];
    p[2 * i + 1] = b.v[i];
  }
#endif
}

/// p[0], p[2], ... and p[1], p[3], ... of 2n floats.
template <int n>
APSO_INLINE void load_pairs(const float* p, BasicLanes<n>& even, BasicLanes<n>& odd) {
#if defined(__GNUC__) && !defined(__clang__)
  typename BasicIntLanes<n>::Vector e, o;
  for (int i = 0; i < n; ++i) {
    e[i] = 2 * i;
    o[i] = 2 * i + 1;
  }
  const BasicLanes<n> a = BasicLanes<n>::load(p);
  const BasicLanes<n> b = BasicLanes<n>::load(p + n);
  even = BasicLanes<n>(__builtin_shuffle(a.v, b.v, e));
  odd = BasicLanes<n>(__builtin_shuffle(a.v, b.v, o));
#else
  for (int i = 0; i < n; ++i) {
    even.v[i] = p[2 * i];
    odd.v[i] = p[2 * i + 1];
  }
#endif
}

APSO_NAMESPACE_END
