/// \file
/// Elementary functions of Lanes, by the names of the standard library: a formula written with `using std::sqrt;` works for one
/// number and for several.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>

APSO_NAMESPACE_BEGIN

/// The number in all lanes.
[[nodiscard]] APSO_INLINE IntLanes all_lanes(std::int32_t v) {
  std::int32_t each[kLanes];
  std::fill(each, each + kLanes, v);
  IntLanes n;
  std::memcpy(&n.v, each, sizeof n.v);
  return n;
}

/// base[offset] of each.
[[nodiscard]] APSO_INLINE Lanes gather(const float* base, const IntLanes& offset) {
  std::int32_t at[kLanes];
  std::memcpy(at, &offset.v, sizeof at);
  Lanes r = 0.0F;
  for (int i = 0; i < kLanes; ++i) r.v[i] = base[at[i]];
  return r;
}

/// The upper 16 bits of each.
[[nodiscard]] APSO_INLINE IntLanes upper_halves(const IntLanes& n) {
  IntLanes r;
#if defined(__GNUC__)
  r.v = n.v >> 16;
#else
  for (int i = 0; i < kLanes; ++i) r.v[i] = n.v[i] >> 16;
#endif
  return r;
}

/// Square root of 0 and of normal numbers, within 3e-7 relative: 1/sqrt from the halved exponent, and Newton's steps
/// (std::sqrt sets errno, which keeps compilers from using the vector instruction).
[[nodiscard]] APSO_INLINE Lanes sqrt(const Lanes& x) {
  IntLanes half;
  const IntLanes b = bits(x);
#if defined(__GNUC__)
  half.v = 0x5F375A86 - (b.v >> 1);
#else
  for (int i = 0; i < kLanes; ++i) half.v[i] = 0x5F375A86 - (b.v[i] >> 1);
#endif
  Lanes y = from_bits(half);
  for (int i = 0; i < 3; ++i) y = y * (1.5F - 0.5F * x * y * y);
  return x * y;
}

/// Natural logarithm of normal numbers > 0, within 2e-7 relative (series of log(1+f) on [sqrt(1/2), sqrt(2)]).
[[nodiscard]] APSO_INLINE Lanes log(const Lanes& x) {
  // mantissa in [sqrt(1/2), sqrt(2)): 0x3F3504F3 are the bits of sqrt(1/2)
  IntLanes e, m;
  const IntLanes b = bits(x);
#if defined(__GNUC__)
  e.v = (b.v - 0x3F3504F3) >> 23;
  m.v = b.v - e.v * (1 << 23);
#else
  for (int i = 0; i < kLanes; ++i) {
    e.v[i] = (b.v[i] - 0x3F3504F3) >> 23;
    m.v[i] = b.v[i] - e.v[i] * (1 << 23);
  }
#endif
  const Lanes f = from_bits(m) - 1.0F;
  // atanh series: log((1+s)/(1-s)) with s = f/(2+f), |s| < 0.172
  const Lanes s = f / (f + 2.0F);
  const Lanes s2 = s * s;
  const Lanes series = 2.0F + s2 * (0.666666667F + s2 * (0.4F + s2 * (0.285714286F + s2 * 0.222222222F)));
  return to_float(e) * 0.693147181F + s * series;
}

/// log(1 + x) for x > -1 within 3e-7 relative: what 1 + x rounds off is added again.
[[nodiscard]] APSO_INLINE Lanes log1p(const Lanes& x) {
  const Lanes u = 1.0F + x;
  return log(u) + (x - (u - 1.0F)) / u;
}

namespace detail {
/// exp(x) = scale (1 + q): scale = 2^n, and q = exp(r) - 1 by its series, r = x - n log 2, |r| < 0.35. x is held to [-87, 88].
struct ExponentParts {
  Lanes scale, q;
};
[[nodiscard]] APSO_INLINE ExponentParts exponent_parts(const Lanes& x) {
  const Lanes y = max(min(x, 88.0F), -87.0F);
  const Lanes z = y * 1.44269504F;
  const IntLanes n = to_int(select(z < Lanes(0.0F), z - 0.5F, z + 0.5F));
  const Lanes whole = to_float(n);
  const Lanes r = (y - whole * 0.693359375F) + whole * 2.12194440e-4F;  // log 2 in two parts, the first one exact
  const Lanes series = 0.5F + r * (0.166666667F + r * (4.16666667e-2F + r * (8.33333333e-3F + r * (1.38888889e-3F + r * 1.98412698e-4F))));
  IntLanes power;
#if defined(__GNUC__)
  power.v = (n.v + 127) << 23;
#else
  for (int i = 0; i < kLanes; ++i) power.v[i] = (n.v[i] + 127) << 23;
#endif
  return {from_bits(power), r + r * r * series};
}
}  // namespace detail

/// exp(x) within 3e-7 relative for x from -87 to 88; 0 below.
[[nodiscard]] APSO_INLINE Lanes exp(const Lanes& x) {
  const detail::ExponentParts e = detail::exponent_parts(x);
  return select(x < Lanes(-87.0F), 0.0F, e.scale + e.scale * e.q);
}

/// exp(x) - 1 within 3e-7 relative for x up to 88.
[[nodiscard]] APSO_INLINE Lanes expm1(const Lanes& x) {
  const detail::ExponentParts e = detail::exponent_parts(x);
  return e.scale * e.q + (e.scale - 1.0F);
}

APSO_NAMESPACE_END
