/// \file
/// Robust kernels: rho(s) for the cost and w(s) = rho'(s)/s for iteratively reweighted least squares, where s is a
/// residual divided by its standard deviation. The paper's eq. (direct optimization approach) calls the kernel C and
/// leaves it open; Cauchy is the default.
///
/// The default constants give 95 % efficiency for Gaussian residuals. Sources: Holland & Welsch 1977 (constants),
/// Barron, "A General and Adaptive Robust Loss Function", CVPR 2019; Chebrolu et al., RA-L 2021 (choice of alpha).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

enum class KernelKind { L2, Huber, PseudoHuber, Fair, Cauchy, GemanMcClure, Welsch, Tukey, StudentT, TruncatedL2, Barron };
constexpr std::array<const char*, 11> enum_names(KernelKind) {
  return {"l2",     "huber", "pseudo_huber", "fair",         "cauchy", "geman_mcclure",
          "welsch", "tukey", "student_t",    "truncated_l2", "barron"};
}

/// Constant of a kernel: 95 % efficiency for Gaussian residuals (Student-t: nu = 5, 94.2 %; truncated L2: the 99.5 %
/// point of chi-square; Barron: scale c of alpha = 0).
[[nodiscard]] constexpr double default_constant(KernelKind kind) {
  switch (kind) {
    case KernelKind::L2: return 1.0;
    case KernelKind::Huber: return 1.345;
    case KernelKind::PseudoHuber: return 1.2871;
    case KernelKind::Fair: return 1.3998;
    case KernelKind::Cauchy: return 2.3849;
    case KernelKind::GemanMcClure: return 3.7874;
    case KernelKind::Welsch: return 2.9846;
    case KernelKind::Tukey: return 4.6851;
    case KernelKind::StudentT: return 5.0;
    case KernelKind::TruncatedL2: return 2.795;
    case KernelKind::Barron: return 1.686;
  }
  return 1.0;
}

/// One struct per kernel; all take the squared residual s2 = s*s, so that a loop needs no square root it can avoid.
namespace kernels {
template <class T>
struct L2 {
  [[nodiscard]] T weight(T) const { return T(1); }
  [[nodiscard]] T rho(T s2) const { return s2 / 2; }
};
template <class T>
struct Huber {
  T k;
  [[nodiscard]] T weight(T s2) const { return s2 <= k * k ? T(1) : k / std::sqrt(s2); }
  [[nodiscard]] T rho(T s2) const { return s2 <= k * k ? s2 / 2 : k * std::sqrt(s2) - k * k / 2; }
};
template <class T>
struct PseudoHuber {
  T k;
  [[nodiscard]] T weight(T s2) const { return 1 / std::sqrt(1 + s2 / (k * k)); }
  [[nodiscard]] T rho(T s2) const { return s2 / (1 + std::sqrt(1 + s2 / (k * k))); }  // k^2 (sqrt(1+x)-1), stable
};
template <class T>
struct Fair {
  T k;
  [[nodiscard]] T weight(T s2) const { return 1 / (1 + std::sqrt(s2) / k); }
  [[nodiscard]] T rho(T s2) const {
    const T a = std::sqrt(s2) / k;
    return k * k * (a - std::log1p(a));
  }
};
template <class T>
struct Cauchy {
  T k;
  [[nodiscard]] T weight(T s2) const { return 1 / (1 + s2 / (k * k)); }
  [[nodiscard]] T rho(T s2) const { return k * k / 2 * std::log1p(s2 / (k * k)); }
};
template <class T>
struct GemanMcClure {
  T k;
  [[nodiscard]] T weight(T s2) const {
    const T q = 1 / (1 + s2 / (k * k));
    return q * q;
  }
  [[nodiscard]] T rho(T s2) const { return s2 / 2 / (1 + s2 / (k * k)); }
};
template <class T>
struct Welsch {
  T k;
  [[nodiscard]] T weight(T s2) const { return std::exp(-s2 / (k * k)); }
  [[nodiscard]] T rho(T s2) const { return -k * k / 2 * std::expm1(-s2 / (k * k)); }
};
template <class T>
struct Tukey {
  T k;
  [[nodiscard]] T weight(T s2) const {
    const T q = 1 - s2 / (k * k);
    return q > 0 ? q * q : T(0);
  }
  [[nodiscard]] T rho(T s2) const {
    const T x = s2 / (k * k);
    return x < 1 ? s2 / 2 * (1 - x + x * x / 3) : k * k / 6;  // k^2/6 (1-(1-x)^3), stable near 0
  }
};
template <class T>
struct StudentT {
  T nu;
  [[nodiscard]] T weight(T s2) const { return (nu + 1) / (nu + s2); }
  [[nodiscard]] T rho(T s2) const { return (nu + 1) / 2 * std::log1p(s2 / nu); }
};
template <class T>
struct TruncatedL2 {
  T k;
  [[nodiscard]] T weight(T s2) const { return s2 <= k * k ? T(1) : T(0); }
  [[nodiscard]] T rho(T s2) const { return s2 <= k * k ? s2 / 2 : k * k / 2; }
};
/// Barron's family, scaled by c^2 so that rho ~ s^2/2 near 0. The limits alpha = 2, 0, -inf are branches of their own.
template <class T>
struct Barron {
  T alpha;
  T c;
  [[nodiscard]] T weight(T s2) const {
    const T x = s2 / (c * c);
    if (std::abs(alpha - 2) < T(1e-5)) return T(1);
    if (alpha == -std::numeric_limits<T>::infinity()) return std::exp(-x / 2);
    if (std::abs(alpha) < T(1e-5)) return 1 / (1 + x / 2);
    return std::pow(x / std::abs(alpha - 2) + 1, alpha / 2 - 1);
  }
  [[nodiscard]] T rho(T s2) const {
    const T x = s2 / (c * c);
    if (std::abs(alpha - 2) < T(1e-5)) return s2 / 2;
    if (alpha == -std::numeric_limits<T>::infinity()) return -c * c * std::expm1(-x / 2);
    if (std::abs(alpha) < T(1e-5)) return c * c * std::log1p(x / 2);
    const T b = std::abs(alpha - 2);
    return c * c * b / alpha * std::expm1(alpha / 2 * std::log1p(x / b));
  }
};
}  // namespace kernels

/// A kernel chosen at run time.
struct RobustKernel {
  KernelKind kind = KernelKind::Cauchy;
  double k = 0;      ///< constant (Student-t: nu, Barron: c); 0 takes default_constant(kind)
  double alpha = 0;  ///< shape of Barron's family, in (-inf, 2]; -100 and below count as -inf

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("kind", s.kind);
    v("k", s.k, 0.0, 1e6);
    v("alpha", s.alpha, -1e6, 2.0);
  }

  [[nodiscard]] double constant() const { return k > 0 ? k : default_constant(kind); }

  /// Calls f(kernel struct with scalar T): the choice is made once, outside of the loop over residuals.
  template <class T, class F>
  decltype(auto) visit(F&& f) const {
    const T c = static_cast<T>(constant());
    switch (kind) {
      case KernelKind::L2: return f(kernels::L2<T>{});
      case KernelKind::Huber: return f(kernels::Huber<T>{c});
      case KernelKind::PseudoHuber: return f(kernels::PseudoHuber<T>{c});
      case KernelKind::Fair: return f(kernels::Fair<T>{c});
      case KernelKind::GemanMcClure: return f(kernels::GemanMcClure<T>{c});
      case KernelKind::Welsch: return f(kernels::Welsch<T>{c});
      case KernelKind::Tukey: return f(kernels::Tukey<T>{c});
      case KernelKind::StudentT: return f(kernels::StudentT<T>{c});
      case KernelKind::TruncatedL2: return f(kernels::TruncatedL2<T>{c});
      case KernelKind::Barron: {
        const T a = alpha <= -100 ? -std::numeric_limits<T>::infinity() : static_cast<T>(alpha);
        return f(kernels::Barron<T>{a, c});
      }
      case KernelKind::Cauchy: break;
    }
    return f(kernels::Cauchy<T>{c});
  }

  /// Weight w(s) = rho'(s)/s.
  [[nodiscard]] double weight(double s) const {
    return visit<double>([s](const auto& kernel) { return kernel.weight(s * s); });
  }
  /// Cost rho(s), ~ s^2/2 near 0 (Student-t: (nu+1)/nu s^2/2).
  [[nodiscard]] double rho(double s) const {
    return visit<double>([s](const auto& kernel) { return kernel.rho(s * s); });
  }
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

/// Barron's alpha that explains the residuals best: minimises sum rho + n log Z(alpha) over alpha = -10, -9.9 ... 2,
/// with the partition function Z truncated at |s| <= 10 c (Chebrolu et al. 2021).
/// \param s residuals in standard deviations, `n` of them; `c` scale of the kernel
[[nodiscard]] inline double best_barron_alpha(const float* s, std::size_t n, double c) {
  double best = 0;
  double best_cost = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= 120; ++i) {
    const double alpha = -10.0 + 0.1 * i;
    const kernels::Barron<double> kernel{alpha, c};
    double z = 0;
    const double h = c / 50;
    for (int j = -500; j <= 500; ++j) z += std::exp(-kernel.rho(h * h * j * j)) * h;
    double cost = static_cast<double>(n) * std::log(z);
    for (std::size_t j = 0; j < n; ++j) {
      const double x = s[j];
      if (std::abs(x) <= 10 * c) cost += kernel.rho(x * x);
      else cost += kernel.rho(100 * c * c);
    }
    if (cost < best_cost) {
      best_cost = cost;
      best = alpha;
    }
  }
  return std::abs(best) < 1e-9 ? 0.0 : best;
}

APSO_NAMESPACE_END
