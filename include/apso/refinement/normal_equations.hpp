/// \file
/// Sums over warped pixels: the robust cost, and the 6x6 normal equations of its Gauss-Newton step.
///
///     H = sum B gamma (alpha^2 w(s_I) J_I^T J_I + w(s_D) J_D^T J_D),  b = -sum B gamma (alpha^2 w J_I^T s_I + w J_D^T s_D)
///
/// Every sum runs over a fixed part of the pixels in a fixed order, float within a block and double across blocks;
/// the parts are added in order by the caller. The result does not depend on the number of threads.
#pragma once

#include <cmath>
#include <type_traits>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/robust_kernel.hpp>
#include <apso/math/se3.hpp>
#include <apso/refinement/residuals.hpp>

APSO_NAMESPACE_BEGIN

/// Factors that are the same for all pixels of one reference at one level.
struct TermScales {
  double scale_intensity = 1;  ///< robust scale of the photometric residuals, in units of the noise model
  double scale_depth = 1;      ///< robust scale of the depth residuals, in units of the noise model
  double alpha = 1;            ///< photometric term against depth term
  double weight = 1;           ///< weight B_k of the reference
};

/// Robust cost and what it would be divided by.
struct CostSum {
  double cost = 0;
  double weight = 0;
  CostSum& operator+=(const CostSum& o) {
    cost += o.cost;
    weight += o.weight;
    return *this;
  }
  /// Mean cost; 0 when nothing was summed.
  [[nodiscard]] double mean() const { return weight > 0 ? cost / weight : 0.0; }
};

struct NormalEquations {
  Matrix6 H = Matrix6::Zero();
  Twist b = Twist::Zero();
  NormalEquations& operator+=(const NormalEquations& o) {
    H += o.H;
    b += o.b;
    return *this;
  }
};

namespace detail {
template <class Kernel>
inline void block_weights(const Kernel& kernel, const Block& s2, Block& w) {
  if constexpr (std::is_same_v<Kernel, kernels::Cauchy<float>>) {
    w = (1.0F + s2 * (1.0F / (kernel.k * kernel.k))).inverse();
  } else {
    for (int j = 0; j < kPixelBlock; ++j) w[j] = kernel.weight(s2[j]);
  }
}
template <class Kernel>
inline void block_rhos(const Kernel& kernel, const Block& s2, Block& r) {
  if constexpr (std::is_same_v<Kernel, kernels::Cauchy<float>>) {
    r = (0.5F * kernel.k * kernel.k) * (1.0F + s2 * (1.0F / (kernel.k * kernel.k))).log();
  } else {
    for (int j = 0; j < kPixelBlock; ++j) r[j] = kernel.rho(s2[j]);
  }
}
}  // namespace detail

/// Robust cost of the pixels [begin, end). A pixel without residual is charged rho(3) for both kinds, so that the
/// cost cannot be lowered by pushing pixels out of the image; a missing depth residual is neither charged nor counted.
template <class Kernel>
CostSum sum_cost(const WarpedPixels& p, const Kernel& kernel, const TermScales& t, int begin, int end) {
  using detail::block;
  using detail::Block;
  const auto ii = static_cast<float>(1.0 / t.scale_intensity);
  const auto id = static_cast<float>(1.0 / t.scale_depth);
  const auto a2 = static_cast<float>(t.alpha * t.alpha);
  const double rho_lost = static_cast<double>(kernel.rho(9.0F));
  CostSum sum;
  Block ri, rd;
  for (int at = begin; at < end; at += kPixelBlock) {
    const Block si = (block(p.si, at) * ii).square();
    const Block sd = (block(p.sd, at) * id).square();
    detail::block_rhos(kernel, si, ri);
    detail::block_rhos(kernel, sd, rd);
    const auto wi = block(p.wi, at);
    const auto wd = block(p.wd, at);
    const double lost = static_cast<double>(block(p.lost, at).sum()) * (1.0 + t.alpha * t.alpha);
    sum.cost += static_cast<double>((a2 * wi * ri + wd * rd).sum()) + lost * rho_lost;
    sum.weight += static_cast<double>((a2 * wi + wd).sum()) + lost;
  }
  sum.cost *= t.weight;
  sum.weight *= t.weight;
  return sum;
}

/// Normal equations of the pixels [begin, end).
template <class Kernel>
NormalEquations sum_normal_equations(const WarpedPixels& p, const Kernel& kernel, const TermScales& t, int begin, int end) {
  using detail::block;
  using detail::Block;
  const auto ii = static_cast<float>(1.0 / t.scale_intensity);
  const auto id = static_cast<float>(1.0 / t.scale_depth);
  const auto fi = static_cast<float>(t.alpha * t.alpha / (t.scale_intensity * t.scale_intensity));
  const auto fd = static_cast<float>(1.0 / (t.scale_depth * t.scale_depth));
  double h[21] = {};
  double g[6] = {};
  Block w, qi, qd;
  Block ji[6], jd[6];
  for (int at = begin; at < end; at += kPixelBlock) {
    const Block si = block(p.si, at);
    const Block sd = block(p.sd, at);
    detail::block_weights(kernel, Block((si * ii).square()), w);
    qi = w * block(p.wi, at) * fi;
    detail::block_weights(kernel, Block((sd * id).square()), w);
    qd = w * block(p.wd, at) * fd;
    const auto y0 = block(p.y0, at);
    const auto y1 = block(p.y1, at);
    const auto y2 = block(p.y2, at);
    ji[0] = block(p.ai0, at);
    ji[1] = block(p.ai1, at);
    ji[2] = block(p.ai2, at);
    ji[3] = y1 * ji[2] - y2 * ji[1];
    ji[4] = y2 * ji[0] - y0 * ji[2];
    ji[5] = y0 * ji[1] - y1 * ji[0];
    jd[0] = block(p.ad0, at);
    jd[1] = block(p.ad1, at);
    jd[2] = block(p.ad2, at);
    jd[3] = y1 * jd[2] - y2 * jd[1];
    jd[4] = y2 * jd[0] - y0 * jd[2];
    jd[5] = y0 * jd[1] - y1 * jd[0];
    int n = 0;
    for (int r = 0; r < 6; ++r) {
      const Block a = qi * ji[r];
      const Block d = qd * jd[r];
      for (int c = r; c < 6; ++c) h[n++] += static_cast<double>((a * ji[c] + d * jd[c]).sum());
      g[r] += static_cast<double>((a * si + d * sd).sum());
    }
  }
  NormalEquations out;
  int n = 0;
  for (int r = 0; r < 6; ++r) {
    for (int c = r; c < 6; ++c, ++n) out.H(r, c) = out.H(c, r) = t.weight * h[n];
    out.b(r) = -t.weight * g[r];
  }
  return out;
}

APSO_NAMESPACE_END
