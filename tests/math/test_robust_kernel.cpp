#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include <apso/math/kernels.hpp>
#include <apso/refinement/cost/kernel_loop.hpp>
#include <apso/refinement/cost/scale/residual_samples.hpp>

using namespace apso;

namespace {
const KernelKind kAll[] = {KernelKind::L2,       KernelKind::Huber,        KernelKind::PseudoHuber, KernelKind::Fair,
                           KernelKind::Cauchy,   KernelKind::GemanMcClure, KernelKind::Welsch,      KernelKind::Tukey,
                           KernelKind::StudentT, KernelKind::TruncatedL2,  KernelKind::Barron,      KernelKind::AdaptiveBarron};

// A kernel as a user writes it.
struct Lorentz {
  double k = 2;
  template <class T>
  T weight(const T& s2) const {
    return T(1) / (T(1) + s2 / T(k * k));
  }
  template <class T>
  T rho(const T& s2) const {
    using std::log1p;
    return T(k * k / 2) * log1p(s2 / T(k * k));
  }
};

// The same, compiled apart from the loop that calls it: for the instruction set of the program, whatever that of the loop is.
struct Apart : Lorentz {
  template <class T>
  APSO_NOINLINE T weight(const T& s2) const {
    return Lorentz::weight(s2);
  }
  template <class T>
  APSO_NOINLINE T rho(const T& s2) const {
    return Lorentz::rho(s2);
  }
};

// Several residuals in one call give what a number alone gives, and the slope of their cost is s w(s).
template <class Kernel, class Scalar>
void check_lanes(const Kernel& kernel, const Scalar& scalar) {
  const KernelRef loop(kernel);
  for (double s = 1e-3; s < 60; s *= 1.07) {
    CAPTURE(s);
    const auto step = static_cast<float>(.02 * s);
    const auto middle = static_cast<float>(s);
    const float places[] = {middle, middle + step, middle - step};
    constexpr int n = kWideLanes;
    float s2[3][n], rho[3][n];
    for (int i = 0; i < 3; ++i) std::fill_n(s2[i], n, places[i] * places[i]);
    loop(s2[0], rho[0], 3 * n);
    for (int i = 0; i < 3; ++i) {
      const double x = std::sqrt(static_cast<double>(places[i] * places[i]));
      CHECK(s2[i][0] == s2[i][n - 1]);
      // near its end a weight is a small difference of large numbers
      CHECK(std::abs(static_cast<double>(s2[i][0]) - scalar.weight(x)) < 3e-6 * (scalar.weight(x) + 1e-1));
      CHECK(std::abs(static_cast<double>(rho[i][0]) - scalar.rho(x)) < 3e-6 * scalar.rho(x) + 3e-7);
    }
    CHECK(loop.rho(s) == doctest::Approx(scalar.rho(s)).epsilon(1e-12));
    if (s < .05) continue;  // there a difference of two costs is rounding
    const double slope = static_cast<double>(rho[1][0] - rho[2][0]) / static_cast<double>(places[1] - places[2]);
    const double exact = (scalar.rho(static_cast<double>(places[1])) - scalar.rho(static_cast<double>(places[2]))) /
                         static_cast<double>(places[1] - places[2]);
    CHECK(std::abs(slope - exact) < 1e-3 * s + 1e-4);
  }
}
}  // namespace

TEST_CASE("rho is the integral of s w(s), and its derivative is s w(s)") {
  for (const KernelKind kind : kAll) {
    for (const double alpha : {2.0, 1.0, 0.0, -2.0, -1000.0}) {
      if (kind != KernelKind::Barron && alpha != 0.0) continue;
      const RobustKernel k{kind, 0, alpha};
      check_lanes(k, k);
      double integral = 0;
      const double h = 1e-4;
      for (int i = 0; i < 60000; ++i) integral += h * (i + .5) * h * k.weight((i + .5) * h);
      CAPTURE(enum_names(kind)[static_cast<std::size_t>(kind)]);
      CHECK(k.rho(6.0) == doctest::Approx(integral).epsilon(1e-4));
      for (const double s : {.05, .5, 1.1, 2.2, 4.0}) {
        const double d = (k.rho(s + 1e-5) - k.rho(s - 1e-5)) / 2e-5;
        CHECK(d == doctest::Approx(s * k.weight(s)).epsilon(1e-6));
        CHECK(k.rho(-s) == k.rho(s));
      }
      CHECK(k.rho(0.0) == 0.0);
    }
  }
}

TEST_CASE("weights match hand-computed values") {
  struct Row {
    KernelKind kind;
    double w[4];
  };
  const Row rows[] = {{KernelKind::Huber, {1, 1, .448333, .1345}},
                      {KernelKind::PseudoHuber, {.932136, .789673, .394278, .127657}},
                      {KernelKind::Fair, {.736814, .583299, .318151, .122792}},
                      {KernelKind::Cauchy, {.957896, .850473, .387244, .053817}},
                      {KernelKind::GemanMcClure, {.966034, .873906, .377572, .015737}},
                      {KernelKind::Welsch, {.972325, .893811, .364093, .000013}},
                      {KernelKind::Tukey, {.977351, .910960, .348077, 0}},
                      {KernelKind::StudentT, {1.142857, 1, .428571, .057143}}};
  const double s[] = {.5, 1, 3, 10};
  for (const Row& row : rows) {
    for (int i = 0; i < 4; ++i) CHECK(std::abs(RobustKernel{row.kind}.weight(s[i]) - row.w[i]) < 1e-6);
  }
}

TEST_CASE("a kernel of the user's runs in the same loop") {
  const RobustKernel cauchy{KernelKind::Cauchy, 2.0};
  check_lanes(Lorentz{}, cauchy);
  check_lanes(Apart{}, cauchy);
  const RobustKernel t{KernelKind::StudentT};
  check_lanes(t, t);
  const kernels::BivariateT pair;
  struct Wrapped {
    kernels::BivariateT k;
    double weight(double s) const { return k.weight(s * s); }
    double rho(double s) const { return k.rho(s * s); }
  };
  check_lanes(pair, Wrapped{pair});
  CHECK(pair.weight(0.0) == doctest::Approx(1.4));  // 7/5
}

TEST_CASE("constants give the stated efficiency") {
  for (const KernelKind kind : {KernelKind::PseudoHuber, KernelKind::Fair, KernelKind::Cauchy, KernelKind::GemanMcClure, KernelKind::Welsch,
                                KernelKind::Tukey, KernelKind::Huber}) {
    CHECK(gaussian_efficiency(RobustKernel{kind}) == doctest::Approx(.95).epsilon(1e-3));
  }
  const double k[] = {.2, .4, .8, 1.6};
  const double ek[] = {.268, .457, .690, .885};
  for (int i = 0; i < 4; ++i) CHECK(std::abs(gaussian_efficiency({KernelKind::Cauchy, k[i]}) - ek[i]) < 6e-4);
  const double nu[] = {2, 3, 4, 5, 6, 8};
  const double en[] = {.857, .901, .926, .942, .953, .967};
  for (int i = 0; i < 6; ++i) CHECK(std::abs(gaussian_efficiency({KernelKind::StudentT, nu[i]}) - en[i]) < 6e-4);
  const double alpha[] = {1, .5, 0, -1, -2, -4};
  const double c[] = {1.287, 1.552, 1.686, 1.824, 1.894, 1.965};
  for (int i = 0; i < 6; ++i) {
    CHECK(std::abs(gaussian_efficiency({KernelKind::Barron, c[i], alpha[i]}) - .95) < 1e-3);
  }
}

TEST_CASE("limits of Barron's family are the kernels they should be") {
  for (const double s : {.3, 1.0, 5.0}) {
    CHECK(RobustKernel{KernelKind::Barron, 1.5, 2}.rho(s) == doctest::Approx(s * s / 2));
    CHECK(RobustKernel{KernelKind::Barron, 1.5, 0}.rho(s) ==
          doctest::Approx(RobustKernel{KernelKind::Cauchy, 1.5 * std::sqrt(2.0)}.rho(s)));
    CHECK(RobustKernel{KernelKind::Barron, 1.5, -1e5}.rho(s) ==
          doctest::Approx(RobustKernel{KernelKind::Welsch, 1.5 * std::sqrt(2.0)}.rho(s)));
    CHECK(RobustKernel{KernelKind::Barron, 1.5, 1e-3}.rho(s) ==
          doctest::Approx(RobustKernel{KernelKind::Barron, 1.5, 0}.rho(s)).epsilon(1e-2));
  }
}

TEST_CASE("alpha follows the tails of the residuals") {
  std::mt19937 rng(1);
  std::normal_distribution<float> gauss;
  std::vector<float> clean(500);
  for (float& s : clean) s = gauss(rng);
  std::vector<float> dirty = clean;
  for (std::size_t i = 0; i < dirty.size(); i += 3) dirty[i] *= 8;
  AdaptiveAlpha best;
  CHECK(best(clean, 1.0) > best(dirty, 1.0));
  CHECK(best({}, 1.0) == 0);
  // the negative logarithm of the likelihood, in double: none of its neighbours explains the residuals better
  const auto cost = [](const std::vector<float>& s, double c, double alpha) {
    const RobustKernel kernel{KernelKind::Barron, c, alpha};
    double z = 0;
    for (int i = -500; i <= 500; ++i) z += std::exp(-kernel.rho(c * i / 50)) * c / 50;
    double sum = static_cast<double>(s.size()) * std::log(z);
    for (const float x : s) sum += kernel.rho(std::min(std::abs(static_cast<double>(x)), 10 * c));
    return sum;
  };
  for (const std::vector<float>* s : {&clean, &dirty}) {
    for (const double c : {.7, 1.0, 1.686}) {
      const double alpha = best(*s, c);
      CAPTURE(alpha);
      const double at = cost(*s, c, alpha);
      if (alpha < 1.95) CHECK(at <= cost(*s, c, alpha + .1) + 1e-3);
      if (alpha > -9.95) CHECK(at <= cost(*s, c, alpha - .1) + 1e-3);
    }
  }
}
