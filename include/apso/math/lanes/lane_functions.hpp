/// \file
/// Elementary functions of Lanes, by the names of the standard library: a formula written with `using std::sqrt;` works for one
/// number and for several.
#pragma once

#include <cstdint>
#include <cstring>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>

APSO_NAMESPACE_BEGIN

/// The number in all lanes.
template <int n = kLanes>
[[nodiscard]] APSO_INLINE BasicIntLanes<n> all_lanes(std::int32_t v) {
  std::int32_t each[n];
  for (std::int32_t& e : each) e = v;
  BasicIntLanes<n> r;
  std::memcpy(&r.v, each, sizeof r.v);
  return r;
}

/// The upper 16 bits of each.
template <int n>
[[nodiscard]] APSO_INLINE BasicIntLanes<n> upper_halves(const BasicIntLanes<n>& a) {
  BasicIntLanes<n> r;
#if defined(__GNUC__)
  r.v = a.v >> 16;
#else
  for (int i = 0; i < n; ++i) r.v[i] = a.v[i] >> 16;
#endif
  return r;
}

/// Square root of 0 and of normal numbers, within 3e-7 relative: 1/sqrt from the halved exponent, and Newton's steps
/// (std::sqrt sets errno, which keeps compilers from using the vector instruction).
template <int n>
[[nodiscard]] APSO_INLINE BasicLanes<n> sqrt(const BasicLanes<n>& x) {
  BasicIntLanes<n> half;
  const BasicIntLanes<n> b = bits(x);
#if defined(__GNUC__)
  half.v = 0x5F375A86 - (b.v >> 1);
#else
  for (int i = 0; i < n; ++i) half.v[i] = 0x5F375A86 - (b.v[i] >> 1);
#endif
  BasicLanes<n> y = from_bits(half);
  for (int i = 0; i < 3; ++i) y = y * (1.5F - 0.5F * x * y * y);
  return x * y;
}

/// Natural logarithm of normal numbers > 0, within 2e-7 relative (series of log(1+f) on [sqrt(1/2), sqrt(2)]).
template <int n>
[[nodiscard]] APSO_INLINE BasicLanes<n> log(const BasicLanes<n>& x) {
  // mantissa in [sqrt(1/2), sqrt(2)): 0x3F3504F3 are the bits of sqrt(1/2)
  BasicIntLanes<n> e, m;
  const BasicIntLanes<n> b = bits(x);
#if defined(__GNUC__)
  e.v = (b.v - 0x3F3504F3) >> 23;
  m.v = b.v - e.v * (1 << 23);
#else
  for (int i = 0; i < n; ++i) {
    e.v[i] = (b.v[i] - 0x3F3504F3) >> 23;
    m.v[i] = b.v[i] - e.v[i] * (1 << 23);
  }
#endif
  const BasicLanes<n> f = from_bits(m) - 1.0F;
  // atanh series: log((1+s)/(1-s)) with s = f/(2+f), |s| < 0.172
  const BasicLanes<n> s = f / (f + 2.0F);
  const BasicLanes<n> s2 = s * s;
  const BasicLanes<n> series = 2.0F + s2 * (0.666666667F + s2 * (0.4F + s2 * (0.285714286F + s2 * 0.222222222F)));
  return to_float(e) * 0.693147181F + s * series;
}

/// log(1 + x) for x > -1 within 3e-7 relative: what 1 + x rounds off is added again.
template <int n>
[[nodiscard]] APSO_INLINE BasicLanes<n> log1p(const BasicLanes<n>& x) {
  const BasicLanes<n> u = 1.0F + x;
  return log(u) + (x - (u - 1.0F)) / u;
}

namespace detail {
/// exp(x) = scale (1 + q): scale = 2^n, and q = exp(r) - 1 by its series, r = x - n log 2, |r| < 0.35. x is held to [-87, 88].
template <int n>
struct ExponentParts {
  BasicLanes<n> scale, q;
};
template <int n>
[[nodiscard]] APSO_INLINE ExponentParts<n> exponent_parts(const BasicLanes<n>& x) {
  const BasicLanes<n> y = max(min(x, 88.0F), -87.0F);
  const BasicLanes<n> z = y * 1.44269504F;
  const BasicIntLanes<n> powers = to_int(select(z < BasicLanes<n>(0.0F), z - 0.5F, z + 0.5F));
  const BasicLanes<n> whole = to_float(powers);
  const BasicLanes<n> r = (y - whole * 0.693359375F) + whole * 2.12194440e-4F;  // log 2 in two parts, the first one exact
  const BasicLanes<n> series =
      0.5F + r * (0.166666667F + r * (4.16666667e-2F + r * (8.33333333e-3F + r * (1.38888889e-3F + r * 1.98412698e-4F))));
  BasicIntLanes<n> power;
#if defined(__GNUC__)
  power.v = (powers.v + 127) << 23;
#else
  for (int i = 0; i < n; ++i) power.v[i] = (powers.v[i] + 127) << 23;
#endif
  return {from_bits(power), r + r * r * series};
}
}  // namespace detail

/// exp(x) within 3e-7 relative for x from -87 to 88; 0 below.
template <int n>
[[nodiscard]] APSO_INLINE BasicLanes<n> exp(const BasicLanes<n>& x) {
  const detail::ExponentParts<n> e = detail::exponent_parts(x);
  return select(x < BasicLanes<n>(-87.0F), 0.0F, e.scale + e.scale * e.q);
}

/// exp(x) - 1 within 3e-7 relative for x up to 88.
template <int n>
[[nodiscard]] APSO_INLINE BasicLanes<n> expm1(const BasicLanes<n>& x) {
  const detail::ExponentParts<n> e = detail::exponent_parts(x);
  return e.scale * e.q + (e.scale - 1.0F);
}

APSO_NAMESPACE_END
