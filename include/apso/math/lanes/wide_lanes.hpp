/// \file
/// Loops in as many lanes as the processor has that the program runs on, not as the one that it is compiled for.
///
/// Distributions compile for any x86-64, with four lanes; processors with AVX2 have eight. GCC and Clang compile such a loop for both,
/// and which one runs is decided at run time. Both give the same bits: AVX2 does not come with fused
/// multiplication, and sums are added in the order of kLanes. APSO_NO_WIDE_LANES leaves the second one out.
#pragma once

#include <type_traits>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>

APSO_NAMESPACE_BEGIN

#if defined(__GNUC__) && defined(__x86_64__) && !defined(__AVX__)
inline constexpr int kWideLanes = 8;
// Without inlining (-O0), and where the code is to be small (-Os), operations of the wide lanes would be functions that are compiled for
// narrow ones.
#if !defined(__NO_INLINE__) && !defined(__OPTIMIZE_SIZE__) && !defined(APSO_NO_WIDE_LANES)
#define APSO_USE_WIDE_LANES 1
#endif
#else
inline constexpr int kWideLanes = kLanes;
#endif

namespace detail {
// By value: what f holds is their own, so that no store of the loop can change it.
template <class F>
APSO_FLATTEN auto in_lanes(F f) {
  return f(std::integral_constant<int, kLanes>{});
}
#if defined(APSO_USE_WIDE_LANES)
template <class F>
__attribute__((target("avx2"), flatten)) auto in_wide_lanes(F f) {
  return f(std::integral_constant<int, kWideLanes>{});
}
#endif
}  // namespace detail

/// Calls f(n), and returns what it returns, with the number of lanes as a compile-time constant: kWideLanes if the processor has them, else
/// kLanes. All that f calls becomes part of it; what cannot, like a function that is called by a pointer, is compiled for kLanes.
template <class F>
APSO_INLINE auto in_widest_lanes(const F& f) {
#if defined(APSO_USE_WIDE_LANES)
  if (__builtin_cpu_supports("avx2")) return detail::in_wide_lanes(f);
#endif
  return detail::in_lanes(f);
}
#undef APSO_USE_WIDE_LANES

/// sum += v, kLanes at a time: in the same order with wide lanes and without.
template <int n>
APSO_INLINE void add(Lanes& sum, const BasicLanes<n>& v) {
  static_assert(n <= 2 * kLanes);
  sum += v.template part<kLanes, 0>();
  if constexpr (n == 2 * kLanes) sum += v.template part<kLanes, 1>();
}

APSO_NAMESPACE_END
