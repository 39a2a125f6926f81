/// \file
/// Robust kernels of any type in a loop over many residuals: the kernel is compiled into a loop of its own, which is called for
/// some hundred residuals at a time, so that what is around it is compiled once for all kernels.
#pragma once

#include <type_traits>
#include <utility>

#include <apso/config.hpp>
#include <apso/math/kernels.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
template <class K, class T, class = void>
struct has_weight : std::false_type {};
template <class K, class T>
struct has_weight<K, T, std::enable_if_t<std::is_convertible_v<decltype(std::declval<const K&>().weight(std::declval<const T&>())), T>>>
    : std::true_type {};
template <class K, class T, class = void>
struct has_rho : std::false_type {};
template <class K, class T>
struct has_rho<K, T, std::enable_if_t<std::is_convertible_v<decltype(std::declval<const K&>().rho(std::declval<const T&>())), T>>>
    : std::true_type {};
}  // namespace detail

/// Says at compile time what a type lacks to be a kernel.
template <class K>
constexpr void check_kernel() {
  if constexpr (!std::is_same_v<K, RobustKernel>) {
    using Wide = BasicLanes<kWideLanes>;
    static_assert(detail::has_weight<K, Lanes>::value && detail::has_weight<K, Wide>::value && detail::has_weight<K, double>::value,
                  "apso: a kernel needs `template <class T> T weight(const T& s2) const`, w = rho'(s)/s of the squared residual s2, "
                  "for T = double and apso::BasicLanes<n>");
    static_assert(detail::has_rho<K, Lanes>::value && detail::has_rho<K, Wide>::value && detail::has_rho<K, double>::value,
                  "apso: a kernel needs `template <class T> T rho(const T& s2) const`, the cost of the squared residual s2, for "
                  "T = double and apso::BasicLanes<n>");
  }
}

/// A kernel of any type, by reference; must not outlive it.
class KernelRef {
 public:
  KernelRef() = default;  ///< of nothing yet
  template <class Kernel, class = std::enable_if_t<!std::is_same_v<Kernel, KernelRef>>>
  explicit KernelRef(const Kernel& kernel)
      : kernel_(&kernel),
        loop_([](const void* k, float* s2, float* rho, int n) { all(*static_cast<const Kernel*>(k), s2, rho, n); }),
        rho_([](const void* k, double s) { return one(*static_cast<const Kernel*>(k), s); }) {
    check_kernel<Kernel>();
  }

  /// n squared residuals become their weights; `rho` receives their costs.
  /// \param n a multiple of kWideLanes
  void operator()(float* s2, float* rho, int n) const { loop_(kernel_, s2, rho, n); }
  /// Cost of one residual s.
  [[nodiscard]] double rho(double s) const { return rho_(kernel_, s); }

 private:
  template <class Kernel>
  static void all(const Kernel& kernel, float* s2, float* rho, int n) {
    in_widest_lanes([=](auto lanes) {
      using L = BasicLanes<decltype(lanes)::value>;
      for (int i = 0; i < n; i += lanes) {
        const L s = L::load(s2 + i);
        kernel.weight(s).store(s2 + i);
        kernel.rho(s).store(rho + i);
      }
    });
  }
  static void all(const RobustKernel& kernel, float* s2, float* rho, int n) {
    kernel.visit([=](const auto& k) { all(k, s2, rho, n); });
  }
  template <class Kernel>
  static double one(const Kernel& kernel, double s) {
    return kernel.rho(s * s);
  }
  static double one(const RobustKernel& kernel, double s) { return kernel.rho(s); }

  const void* kernel_ = nullptr;
  void (*loop_)(const void*, float*, float*, int) = nullptr;
  double (*rho_)(const void*, double) = nullptr;
};

APSO_NAMESPACE_END
