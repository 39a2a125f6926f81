/// \file
/// Barron's alpha from the residuals themselves.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/kernels.hpp>
#include <apso/refinement/cost/kernel_loop.hpp>

APSO_NAMESPACE_BEGIN

/// Finds the alpha of Barron's family that explains residuals best: minimises sum rho + n log Z(alpha) over alpha = -10, -9.9 ... 2,
/// with the partition function Z truncated at |s| <= 10 c (Chebrolu et al., RA-L 2021). Keeps its buffers.
class AdaptiveAlpha {
 public:
  /// \param s residuals in standard deviations
  /// \param c scale of the kernel
  /// \return alpha in [-10,2]; 0 without residuals
  [[nodiscard]] double operator()(const std::vector<float>& s, double c) {
    if (s.empty()) return 0;
    const std::size_t groups = (s.size() + kLanes - 1) / kLanes;
    const auto largest = static_cast<float>(100 * c * c);
    squares_.assign(groups * kLanes, 0.0F);
    for (std::size_t i = 0; i < s.size(); ++i) squares_[i] = std::min(s[i] * s[i], largest);
    for (int i = 0; i <= 500; ++i) densities_[i] = static_cast<float>(c * c * i * i / 2500);  // s from 0 to 10 c
    double best = 0;
    double best_cost = std::numeric_limits<double>::infinity();
    for (int step = 0; step <= 120; ++step) {
      RobustKernel kernel{KernelKind::Barron, c, 0.1 * (step - 100)};
      double z = 0;
      each_rho(kernel, densities_, 501, [&](int i, double rho) { z += std::exp(-rho) * (i == 0 ? 1 : 2) * c / 50; });
      double cost = static_cast<double>(s.size()) * std::log(z);
      each_rho(kernel, squares_.data(), static_cast<int>(s.size()), [&](int, double rho) { cost += rho; });
      if (cost < best_cost) {
        best_cost = cost;
        best = kernel.alpha;
      }
    }
    return std::abs(best) < 1e-9 ? 0.0 : best;
  }

 private:
  // f(i, rho of s2[i]); s2 has room for whole lanes.
  template <class F>
  static void each_rho(const RobustKernel& kernel, const float* s2, int n, F&& f) {
    constexpr int kAtOnce = 16;
    const KernelRef loop(kernel);
    Lanes square[kAtOnce], rho[kAtOnce];
    for (int i = 0; i < n; i += kAtOnce * kLanes) {
      const int lanes = std::min(kAtOnce, (n - i + kLanes - 1) / kLanes);
      for (int k = 0; k < lanes; ++k) square[k] = Lanes::load(s2 + i + k * kLanes);
      loop(square, rho, lanes);
      for (int k = i; k < std::min(n, i + lanes * kLanes); ++k) f(k, static_cast<double>(rho[(k - i) / kLanes][(k - i) % kLanes]));
    }
  }

  std::vector<float> squares_;
  float densities_[512] = {};
};

APSO_NAMESPACE_END
