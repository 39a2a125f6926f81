/// \file
/// Robust kernels: rho(s) for the cost and w(s) = rho'(s)/s for iteratively reweighted least squares, where s is a
/// residual divided by its standard deviation. The paper's eq. (15) calls the kernel C and leaves it open; Cauchy is the default.
///
/// A kernel is one small struct with two functions of the squared residual s^2, written once for a number and for several, BasicLanes<n>:
///
/// \code
/// struct Lorentz {
///   double k = 2;
///   template <class T> T weight(const T& s2) const { return T(1) / (T(1) + s2 / T(k * k)); }
///   template <class T> T rho(const T& s2) const { using std::log; return T(k * k / 2) * log(T(1) + s2 / T(k * k)); }
/// };
/// \endcode
///
/// `min`, `max`, `abs`, `sqrt`, `exp`, `expm1`, `log`, `log1p` exist for these by the same names (math/lanes/lanes.hpp,
/// lane_functions.hpp); where a formula branches, `select(condition, a, b)` takes the place of `?:`. BasicDirectAligner takes such a
/// struct.
///
/// The default constants give 95 % efficiency for Gaussian residuals. Sources: Holland & Welsch 1977 (constants),
/// Barron, "A General and Adaptive Robust Loss Function", CVPR 2019; Chebrolu et al., RA-L 2021 (choice of alpha).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>

#include <apso/config.hpp>
#include <apso/math/lanes/lane_functions.hpp>
#include <apso/math/lanes/lanes.hpp>

APSO_NAMESPACE_BEGIN

enum class KernelKind {
  L2,
  Huber,
  PseudoHuber,
  Fair,
  Cauchy,
  GemanMcClure,
  Welsch,
  Tukey,
  StudentT,
  TruncatedL2,
  Barron,          ///< with the alpha that is given
  AdaptiveBarron,  ///< with the alpha that explains the residuals best, at each level
};
constexpr std::array<const char*, 12> enum_names(KernelKind) {
  return {"l2",     "huber", "pseudo_huber", "fair",         "cauchy", "geman_mcclure",
          "welsch", "tukey", "student_t",    "truncated_l2", "barron", "adaptive_barron"};
}

/// Constant of a kernel: 95 % efficiency for Gaussian residuals (Student-t: nu = 5, 94.2 %; truncated L2: the 99.5 %
/// point of chi-square; Barron: scale c of alpha = 0).
[[nodiscard]] constexpr double default_constant(KernelKind kind) {
  constexpr double constants[] = {1.0, 1.345, 1.2871, 1.3998, 2.3849, 3.7874, 2.9846, 4.6851, 5.0, 2.795, 1.686, 1.686};
  return constants[static_cast<int>(kind)];
}

/// One struct per kernel. They take the squared residual s2 = s*s, so that a loop needs no square root it can avoid.
namespace kernels {
struct L2 {
  template <class T>
  [[nodiscard]] T weight(const T&) const {
    return T(1);
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    return T(0.5) * s2;
  }
};
struct Huber {
  double k;
  template <class T>
  [[nodiscard]] T weight(const T& s2) const {
    using std::sqrt;
    return select(s2 <= T(k * k), T(1), T(k) / sqrt(s2));
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    using std::sqrt;
    return select(s2 <= T(k * k), T(0.5) * s2, T(k) * sqrt(s2) - T(k * k / 2));
  }
};
struct PseudoHuber {
  double k;
  template <class T>
  [[nodiscard]] T weight(const T& s2) const {
    using std::sqrt;
    return T(1) / sqrt(T(1) + s2 * T(1 / (k * k)));
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    using std::sqrt;
    return s2 / (T(1) + sqrt(T(1) + s2 * T(1 / (k * k))));  // k^2 (sqrt(1+x) - 1) without a difference
  }
};
struct Fair {
  double k;
  template <class T>
  [[nodiscard]] T weight(const T& s2) const {
    using std::sqrt;
    return T(1) / (T(1) + sqrt(s2) * T(1 / k));
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    using std::log1p;
    using std::sqrt;
    const T a = sqrt(s2) * T(1 / k);
    return T(k * k) * (a - log1p(a));
  }
};
struct Cauchy {
  double k;
  template <class T>
  [[nodiscard]] T weight(const T& s2) const {
    return T(1) / (T(1) + s2 * T(1 / (k * k)));
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    using std::log;  // costs are sums: what 1 + x rounds off does not count, and the sum 1 + x is there for the weight
    return T(0.5 * k * k) * log(T(1) + s2 * T(1 / (k * k)));
  }
};
struct GemanMcClure {
  double k;
  template <class T>
  [[nodiscard]] T weight(const T& s2) const {
    const T q = T(1) / (T(1) + s2 * T(1 / (k * k)));
    return q * q;
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    return T(0.5) * s2 / (T(1) + s2 * T(1 / (k * k)));
  }
};
struct Welsch {
  double k;
  template <class T>
  [[nodiscard]] T weight(const T& s2) const {
    using std::exp;
    return exp(s2 * T(-1 / (k * k)));
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    using std::expm1;
    return T(-0.5 * k * k) * expm1(s2 * T(-1 / (k * k)));
  }
};
struct Tukey {
  double k;
  template <class T>
  [[nodiscard]] T weight(const T& s2) const {
    using std::max;
    const T q = max(T(1) - s2 * T(1 / (k * k)), T(0));
    return q * q;
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    using std::min;
    const T x = min(s2 * T(1 / (k * k)), T(1));
    return T(0.5 * k * k) * x * (T(1) - x + x * x * T(1.0 / 3));  // k^2/6 (1 - (1-x)^3) without a difference
  }
};
struct StudentT {
  double nu;
  template <class T>
  [[nodiscard]] T weight(const T& s2) const {
    return T(nu + 1) / (T(nu) + s2);
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    using std::log1p;
    return T(0.5 * (nu + 1)) * log1p(s2 * T(1 / nu));
  }
};
/// Of a pair of residuals, s2 = r^T Sigma^-1 r (the joint model of DVO, Kerl et al. 2013).
struct BivariateT {
  double nu = 5;
  template <class T>
  [[nodiscard]] T weight(const T& s2) const {
    return T(nu + 2) / (T(nu) + s2);
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    using std::log1p;
    return T(0.5 * (nu + 2)) * log1p(s2 * T(1 / nu));
  }
};
struct TruncatedL2 {
  double k;
  template <class T>
  [[nodiscard]] T weight(const T& s2) const {
    return select(s2 <= T(k * k), T(1), T(0));
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    using std::min;
    return T(0.5) * min(s2, T(k * k));
  }
};
/// Barron's family, scaled by c^2 so that rho ~ s^2/2 near 0, for alpha in (-inf, 2) other than 0. The limits alpha = 2, 0 and -inf
/// are L2, Cauchy and Welsch with k = c sqrt(2); RobustKernel takes these.
struct Barron {
  double alpha;
  double c;
  template <class T>
  [[nodiscard]] T weight(const T& s2) const {
    using std::exp;
    using std::log1p;
    return exp(T(0.5 * alpha - 1) * log1p(s2 * T(1 / (c * c * (2 - alpha)))));
  }
  template <class T>
  [[nodiscard]] T rho(const T& s2) const {
    using std::expm1;
    using std::log1p;
    return T(c * c * (2 - alpha) / alpha) * expm1(T(0.5 * alpha) * log1p(s2 * T(1 / (c * c * (2 - alpha)))));
  }
};
}  // namespace kernels

/// A kernel chosen at run time.
struct RobustKernel {
  KernelKind kind = KernelKind::Cauchy;
  double k = 0;      ///< constant [standard deviations] (Student-t: nu, Barron: c); 0 takes default_constant(kind)
  double alpha = 0;  ///< shape of Barron's family, in (-inf, 2]; -100 and below count as -inf

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("kind", s.kind);
    v("k", s.k, 0.0, 1e6);
    v("alpha", s.alpha, -1e6, 2.0);
  }

  [[nodiscard]] double constant() const { return k > 0 ? k : default_constant(kind); }

  /// Calls f(kernel): the choice is made once, outside of the loop over residuals.
  template <class F>
  decltype(auto) visit(F&& f) const {
    const double c = constant();
    switch (kind) {
      case KernelKind::L2:
        return f(kernels::L2{});
      case KernelKind::Huber:
        return f(kernels::Huber{c});
      case KernelKind::PseudoHuber:
        return f(kernels::PseudoHuber{c});
      case KernelKind::Fair:
        return f(kernels::Fair{c});
      case KernelKind::GemanMcClure:
        return f(kernels::GemanMcClure{c});
      case KernelKind::Welsch:
        return f(kernels::Welsch{c});
      case KernelKind::Tukey:
        return f(kernels::Tukey{c});
      case KernelKind::StudentT:
        return f(kernels::StudentT{c});
      case KernelKind::TruncatedL2:
        return f(kernels::TruncatedL2{c});
      case KernelKind::Barron:
      case KernelKind::AdaptiveBarron:
        if (alpha > 2 - 1e-5) return f(kernels::L2{});
        if (std::abs(alpha) < 1e-5) return f(kernels::Cauchy{c * kSqrt2});
        if (alpha <= -100) return f(kernels::Welsch{c * kSqrt2});
        return f(kernels::Barron{alpha, c});
      case KernelKind::Cauchy:
        break;
    }
    return f(kernels::Cauchy{c});
  }

  /// Weight w(s) = rho'(s)/s.
  [[nodiscard]] double weight(double s) const {
    return visit([s](const auto& kernel) { return kernel.weight(s * s); });
  }
  /// Cost rho(s), ~ s^2/2 near 0 (Student-t: (nu+1)/nu s^2/2).
  [[nodiscard]] double rho(double s) const {
    return visit([s](const auto& kernel) { return kernel.rho(s * s); });
  }

 private:
  static constexpr double kSqrt2 = 1.4142135623730951;
};

/// Share of the information of Gaussian residuals that a kernel keeps (asymptotic efficiency E[psi']^2/E[psi^2], with
/// psi = s w(s)), by quadrature. For choosing a constant, not for loops.
[[nodiscard]] inline double gaussian_efficiency(const RobustKernel& kernel) {
  // E[psi'] = E[s psi] for a standard normal (Stein), which needs no derivative of the weight.
  double s_psi = 0;
  double psi2 = 0;
  double mass = 0;
  const double h = 1e-3;
  for (int i = -10000; i <= 10000; ++i) {
    const double s = h * i;
    const double p = std::exp(-0.5 * s * s);
    const double psi = s * kernel.weight(s);
    mass += p;
    s_psi += p * s * psi;
    psi2 += p * psi * psi;
  }
  return psi2 > 0 ? s_psi * s_psi / (psi2 * mass) : 0.0;
}

APSO_NAMESPACE_END
