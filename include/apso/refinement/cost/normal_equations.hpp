/// \file
/// Sums over the warped pixels of a tile: the robust cost, and the 6x6 normal equations of its Gauss-Newton step.
///
///     H = sum gamma (alpha^2 w(s_I)/sigma_I^2 J_I^T J_I + w(s_D)/sigma_D^2 J_D^T J_D)
///     b = -sum gamma (alpha^2 w(s_I)/sigma_I^2 J_I^T r_I + w(s_D)/sigma_D^2 J_D^T r_D)
///
/// One pass over a tile warps, looks up, weighs and sums. Both rows of the Jacobian are (a, X x a), so with
/// M = sum of q a a^T the blocks of H are sum M, sum [X]x M and sum [X]x M [X]x^T.
///
/// Sums run over a tile in a fixed order, in float; tiles are added in order, in double. The result does not depend on the
/// number of threads.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/lanes.hpp>
#include <apso/math/kernels.hpp>
#include <apso/math/se3.hpp>
#include <apso/refinement/cost/residuals.hpp>

APSO_NAMESPACE_BEGIN

/// Factors that are the same for all pixels of one reference at one level.
struct TermScales {
  double scale_intensity = 1;  ///< robust scale of the photometric residuals, in units of the noise model
  double scale_depth = 1;      ///< robust scale of the depth residuals, in units of the noise model
  double alpha = 1;            ///< photometric term against depth term
};

struct NormalEquations {
  Matrix6 H = zeros<Matrix6>();
  Twist b = zeros<Twist>();
  NormalEquations& operator+=(const NormalEquations& o) {
    H = plus(H, o.H);
    b = plus(b, o.b);
    return *this;
  }
};

/// The sums of one tile, or of several with T = double. The increment is (v, w) in the frame of the reference,
/// T <- T Exp(d).
template <class T>
struct PixelSums {
  T vv[6];   ///< H of v and v: 00 01 02 11 12 22
  T wv[9];   ///< H of w and v, row by row
  T ww[6];   ///< H of w and w
  T v[3];    ///< minus b of v
  T w[3];    ///< minus b of w
  T cost;    ///< robust cost, lost pixels charged
  T weight;  ///< what the cost is divided by
  T lost;    ///< gamma of the pixels without a residual
  static constexpr int kSize = 30;

  [[nodiscard]] NormalEquations equations() const {
    NormalEquations n;
    int k = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j, ++k) {
        n.H(i, j) = n.H(j, i) = static_cast<double>(vv[k]);
        n.H(3 + i, 3 + j) = n.H(3 + j, 3 + i) = static_cast<double>(ww[k]);
      }
      for (int j = 0; j < 3; ++j) n.H(3 + i, j) = n.H(j, 3 + i) = static_cast<double>(wv[3 * i + j]);
      n.b(i) = -static_cast<double>(v[i]);
      n.b(3 + i) = -static_cast<double>(w[i]);
    }
    return n;
  }
};
using TileSums = PixelSums<float>;
static_assert(sizeof(TileSums) == TileSums::kSize * sizeof(float), "TileSums is read as an array");

/// sum += factor * tile.
inline void add(PixelSums<double>& sum, const TileSums& tile, float factor) {
  float from[TileSums::kSize];
  double to[TileSums::kSize];
  std::memcpy(from, &tile, sizeof from);
  std::memcpy(to, &sum, sizeof to);
  for (int i = 0; i < TileSums::kSize; ++i) to[i] += static_cast<double>(factor * from[i]);
  std::memcpy(&sum, to, sizeof to);
}

/// The same equations for an increment from the left, in the frame T maps into: T <- Exp(e) T with e = Ad(T) d.
[[nodiscard]] inline NormalEquations moved_to_left(const NormalEquations& n, const Pose& T) {
  // Ad(T)^-1 = [R^T, -R^T [t]x; 0, R^T]
  const Eigen::Matrix3d R = rotation(T);
  const Eigen::Matrix3d B = transposed_times(R, skew(translation(T)));
  Matrix6 A = zeros<Matrix6>();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      A(i, j) = A(3 + i, 3 + j) = R(j, i);
      A(i, 3 + j) = -B(i, j);
    }
  }
  NormalEquations out;
  out.H = times(transposed_times(A, n.H), A);
  out.b = transposed_times(A, n.b);
  return out;
}

/// One pass over tiles of a list. Each thread has its own.
class TileSummer {
 public:
  TileSummer(const Warper& warper, const RobustKernel& kernel, const TermScales& scales)
      : warper_(warper),
        kernel_(kernel),
        cauchy_(kernel.kind == KernelKind::Cauchy),
        factor_intensity_(static_cast<float>(scales.alpha * scales.alpha / (scales.scale_intensity * scales.scale_intensity))),
        factor_depth_(static_cast<float>(1.0 / (scales.scale_depth * scales.scale_depth))),
        alpha2_(static_cast<float>(scales.alpha * scales.alpha)),
        charge_(static_cast<float>((1.0 + scales.alpha * scales.alpha) * kernel.rho(3.0))),
        scale_intensity_(static_cast<float>(1.0 / (scales.scale_intensity * scales.scale_intensity))),
        half_k2_(static_cast<float>(0.5 * kernel.constant() * kernel.constant())),
        inverse_k2_(static_cast<float>(1.0 / (kernel.constant() * kernel.constant()))) {}

  /// A pixel without residual is charged rho(3) for both kinds, so that the cost cannot be lowered by pushing pixels out
  /// of the image; a missing depth residual is neither charged nor counted.
  void operator()(const PixelList& list, const PixelList::Tile& tile, TileSums& out) {
    Sums s;
    for (int b = tile.begin; b < tile.end;) {
      const int end = std::min(tile.end, b + kChunk);
      first<true>(list, b, end, s);
      second(list, b, end, s);
      b = end;
    }
    for (int i = 0; i < 6; ++i) out.vv[i] = s.vv[i].sum();
    for (int i = 0; i < 9; ++i) out.wv[i] = s.wv[i].sum();
    for (int i = 0; i < 6; ++i) out.ww[i] = s.ww[i].sum();
    for (int i = 0; i < 3; ++i) out.v[i] = s.v[i].sum();
    for (int i = 0; i < 3; ++i) out.w[i] = s.w[i].sum();
    take_cost(s, tile, out);
  }
  /// The cost alone, faster; the equations are left as they are.
  void cost(const PixelList& list, const PixelList::Tile& tile, TileSums& out) {
    Sums s;
    first<false>(list, tile.begin, tile.end, s);
    take_cost(s, tile, out);
  }

  /// What became of the pixels of all tiles so far.
  [[nodiscard]] WarpCounts counts() const {
    const auto total = [](const IntLanes& n) {
      int sum = 0;
      for (int i = 0; i < kLanes; ++i) sum -= n[i];  // masks are -1
      return sum;
    };
    WarpCounts c = counted_;
    c.valid = total(valid_);
    c.valid_depth = total(valid_depth_);
    c.out_of_view = total(out_of_view_);
    c.occluded = total(occluded_);
    c.disoccluded = total(disoccluded_);
    c.masked = total(masked_);
    return c;
  }

 private:
  static constexpr int kChunk = 8;  // blocks whose M and f are kept between the two halves of the work
  struct Sums {
    Lanes vv[6], wv[9], ww[6], v[3], w[3], cost, weight, lost;
    Sums() {
      for (Lanes& l : vv) l = 0.0F;
      for (Lanes& l : wv) l = 0.0F;
      for (Lanes& l : ww) l = 0.0F;
      for (Lanes& l : v) l = 0.0F;
      for (Lanes& l : w) l = 0.0F;
      cost = weight = lost = 0.0F;
    }
  };

  void take_cost(const Sums& s, const PixelList::Tile& tile, TileSums& out) {
    out.cost = s.cost.sum();
    out.weight = s.weight.sum();
    out.lost = s.lost.sum();
    counted_.selected += tile.count;
  }

  // Warp, weights, cost, M and f. The work is in two loops because all its sums do not fit into the registers.
  template <bool kEquations>
  APSO_INLINE void first(const PixelList& list, int begin, int end, Sums& s) {
    float* m = buffer_;
    for (int b = begin; b < end; ++b) {
      const float* block = list.block(b);
      for (int at = 0; at < PixelList::kBlock; at += kLanes) {
        WarpedLanes o;
        warper_.warp(block, at, o);
        const Lanes i2 = o.residual_intensity * o.residual_intensity * o.inverse_intensity * scale_intensity_;
        const Lanes d2 = o.residual_depth * o.residual_depth * o.inverse_depth * factor_depth_;
        Lanes wi, wd, ri, rd;
        if (cauchy_) {
          const Lanes ti = 1.0F + i2 * inverse_k2_;
          const Lanes td = 1.0F + d2 * inverse_k2_;
          wi = 1.0F / ti;
          wd = 1.0F / td;
          ri = half_k2_ * log(ti);
          rd = half_k2_ * log(td);
        } else {
          any_kernel(i2, wi, ri);
          any_kernel(d2, wd, rd);
        }
        const Lanes photometric = alpha2_ * o.weight_intensity;
        s.cost += photometric * ri + o.weight_depth * rd + o.lost * charge_;
        s.lost += o.lost;
        s.weight += photometric + o.weight_depth + (o.lost + alpha2_ * o.lost);
        valid_ = valid_ + o.valid;
        valid_depth_ = valid_depth_ + o.valid_depth;
        out_of_view_ = out_of_view_ + o.out_of_view;
        occluded_ = occluded_ + o.occluded;
        disoccluded_ = disoccluded_ + o.disoccluded;
        masked_ = masked_ + o.masked;
        if constexpr (!kEquations) continue;
        const Lanes qi = o.weight_intensity * wi * o.inverse_intensity * factor_intensity_;
        const Lanes qd = o.weight_depth * wd * o.inverse_depth * factor_depth_;
        const Lanes pi0 = qi * o.I[0], pi1 = qi * o.I[1], pi2 = qi * o.I[2];
        const Lanes pd0 = qd * o.D[0], pd1 = qd * o.D[1], pd2 = qd * o.D[2];
        (pi0 * o.I[0] + pd0 * o.D[0]).store(m);
        (pi0 * o.I[1] + pd0 * o.D[1]).store(m + kLanes);
        (pi0 * o.I[2] + pd0 * o.D[2]).store(m + 2 * kLanes);
        (pi1 * o.I[1] + pd1 * o.D[1]).store(m + 3 * kLanes);
        (pi1 * o.I[2] + pd1 * o.D[2]).store(m + 4 * kLanes);
        (pi2 * o.I[2] + pd2 * o.D[2]).store(m + 5 * kLanes);
        (pi0 * o.residual_intensity + pd0 * o.residual_depth).store(m + 6 * kLanes);
        (pi1 * o.residual_intensity + pd1 * o.residual_depth).store(m + 7 * kLanes);
        (pi2 * o.residual_intensity + pd2 * o.residual_depth).store(m + 8 * kLanes);
        m += 9 * kLanes;
      }
    }
  }

  // sum M, sum f, sum X x M, sum X x M x X, sum X x f.
  APSO_INLINE void second(const PixelList& list, int begin, int end, Sums& s) {
    rows<0>(list, begin, end, s);
    rows<1>(list, begin, end, s);
    rows<2>(list, begin, end, s);
  }

  // Row i of [X]x M is r_j = X_a M_bj - X_b M_aj with (a, b) the two axes after i; row i of [X]x M [X]x^T is X x r.
  template <int i>
  APSO_INLINE void rows(const PixelList& list, int begin, int end, Sums& s) const {
    constexpr int a = (i + 1) % 3;
    constexpr int b = (i + 2) % 3;
    constexpr int index[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    Lanes wv0 = s.wv[3 * i], wv1 = s.wv[3 * i + 1], wv2 = s.wv[3 * i + 2], v = s.v[i], w = s.w[i];
    Lanes M0 = s.vv[index[i][0]], M1 = s.vv[index[i][1]], M2 = s.vv[index[i][2]];  // the first i are sums of row < i
    Lanes W0 = s.ww[index[i][0]], W1 = s.ww[index[i][1]], W2 = s.ww[index[i][2]];
    const float* m = buffer_;
    for (int k = begin; k < end; ++k) {
      const float* block = list.block(k);
      for (int at = 0; at < PixelList::kBlock; at += kLanes, m += 9 * kLanes) {
        const auto in = [&](int n) { return Lanes::load(m + n * kLanes); };
        const Lanes X0 = Lanes::load(block + PixelList::kX * PixelList::kBlock + at);
        const Lanes X1 = Lanes::load(block + PixelList::kY * PixelList::kBlock + at);
        const Lanes X2 = Lanes::load(block + PixelList::kZ * PixelList::kBlock + at);
        const Lanes& Xa = a == 0 ? X0 : (a == 1 ? X1 : X2);
        const Lanes& Xb = b == 0 ? X0 : (b == 1 ? X1 : X2);
        const Lanes r0 = Xa * in(index[b][0]) - Xb * in(index[a][0]);
        const Lanes r1 = Xa * in(index[b][1]) - Xb * in(index[a][1]);
        const Lanes r2 = Xa * in(index[b][2]) - Xb * in(index[a][2]);
        wv0 += r0;
        wv1 += r1;
        wv2 += r2;
        if constexpr (i <= 0) {
          M0 += in(0);
          W0 += X1 * r2 - X2 * r1;
        }
        if constexpr (i <= 1) {
          M1 += in(index[i][1]);
          W1 += X2 * r0 - X0 * r2;
        }
        M2 += in(index[i][2]);
        W2 += X0 * r1 - X1 * r0;
        v += in(6 + i);
        w += Xa * in(6 + b) - Xb * in(6 + a);
      }
    }
    if constexpr (i <= 0) {
      s.vv[0] = M0;
      s.ww[0] = W0;
    }
    if constexpr (i <= 1) {
      s.vv[index[i][1]] = M1;
      s.ww[index[i][1]] = W1;
    }
    s.vv[index[i][2]] = M2;
    s.ww[index[i][2]] = W2;
    s.wv[3 * i] = wv0;
    s.wv[3 * i + 1] = wv1;
    s.wv[3 * i + 2] = wv2;
    s.v[i] = v;
    s.w[i] = w;
  }

  // Weight and cost of the other kernels, one by one.
  void any_kernel(const Lanes& s2, Lanes& w, Lanes& rho) const {
    kernel_.template visit<float>([&](const auto& k) {
      for (int i = 0; i < kLanes; ++i) {
        w.v[i] = k.weight(s2[i]);
        rho.v[i] = k.rho(s2[i]);
      }
    });
  }

  Warper warper_;
  RobustKernel kernel_;
  bool cauchy_;
  Lanes factor_intensity_, factor_depth_, alpha2_, charge_, scale_intensity_, half_k2_, inverse_k2_;
  WarpCounts counted_;
  IntLanes valid_{}, valid_depth_{}, out_of_view_{}, occluded_{}, disoccluded_{}, masked_{};  // minus the numbers
  float buffer_[9 * PixelList::kBlock * kChunk];
};

APSO_NAMESPACE_END
