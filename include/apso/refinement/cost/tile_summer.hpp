/// \file
/// One pass over a tile: the robust cost of its pixels, and the sums that the normal equations are made of.
///
/// In three stages over some hundred pixels at a time: they are warped and weighed by the noise model (warped_pixels.hpp), the
/// kernel turns squared residuals into weights and costs (kernel_loop.hpp), and both are summed here. Both rows of the Jacobian
/// are (a, X x a), so with M = sum of q a a^T the blocks of H are sum M, sum [X]x M and sum [X]x M [X]x^T.
///
/// Sums run over a tile in a fixed order, in float; tiles are added in order, in double. The result does not depend on the
/// number of threads.
#pragma once

#include <algorithm>

#include <apso/config.hpp>
#include <apso/math/lanes/lane_functions.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/refinement/cost/kernel_loop.hpp>
#include <apso/refinement/cost/normal_equations.hpp>
#include <apso/refinement/cost/residuals.hpp>
#include <apso/refinement/cost/scale/term_scales.hpp>
#include <apso/refinement/cost/warped_pixels.hpp>

APSO_NAMESPACE_BEGIN

/// One pass over tiles of a list. Each thread has its own.
class TileSummer {
 public:
  /// \param kernel,noise must outlive the pass
  TileSummer(const Warper& warper, const NoiseRef& noise, const KernelRef& kernel, const TermScales& scales)
      : warper_(warper),
        noise_(noise),
        kernel_(kernel),
        squares_(scales),
        factor_intensity_(scales.alpha * scales.alpha / (scales.scale_intensity * scales.scale_intensity)),
        factor_depth_(1.0 / (scales.scale_depth * scales.scale_depth)),
        term_weight_(scales.term_weight()),
        charge_(scales.charge(kernel)),
        slope_(scales.slope),
        joint_(scales.coupling == ScaleCoupling::BivariateT) {}

  /// A pixel without residual is charged rho(3) for both kinds, so that the cost cannot be lowered by pushing pixels out
  /// of the image; a missing depth residual is neither charged nor counted.
  void operator()(const PixelList& list, const PixelList::Tile& tile, TileSums& out) {
    Sums s;
    for (int b = tile.begin; b < tile.end; b += WarpedPixels::kBlocks) {
      const int blocks = std::min(tile.end - b, WarpedPixels::kBlocks);
      noise_(warper_, squares_, list.block(b), blocks, pixels_, tally_);
      weigh(list.block(b), blocks);
      sum_costs(groups(blocks), s);
      if (warper_.rows_of_current()) multiply_rows_of_both(list.block(b), blocks);
      else multiply(list.block(b), blocks);
      sum_rows<0>(list.block(b), blocks, s);
      sum_rows<1>(list.block(b), blocks, s);
      sum_rows<2>(list.block(b), blocks, s);
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
    for (int b = tile.begin; b < tile.end; b += WarpedPixels::kBlocks) {
      const int blocks = std::min(tile.end - b, WarpedPixels::kBlocks);
      if (joint_) noise_(warper_, squares_, list.block(b), blocks, pixels_, tally_);
      else noise_.cost(warper_, squares_, list.block(b), blocks, pixels_, tally_);
      weigh(list.block(b), blocks);
      sum_costs(groups(blocks), s);
    }
    take_cost(s, tile, out);
  }

  /// What became of the pixels of all tiles so far.
  [[nodiscard]] WarpCounts counts() const {
    WarpCounts c = tally_.counts();
    c.selected = selected_;
    return c;
  }

 private:
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

  [[nodiscard]] static int groups(int blocks) { return blocks * PixelList::kBlock / kLanes; }

  void take_cost(const Sums& s, const PixelList::Tile& tile, TileSums& out) {
    out.cost = s.cost.sum();
    out.weight = s.weight.sum();
    out.lost = s.lost.sum();
    selected_ += tile.count;
  }

  void weigh(const float* block, int blocks) {
    if (joint_) decorrelate(block, blocks);
    kernel_(pixels_.s2, pixels_.rho, 2 * groups(blocks));
  }

  // r_I - slope r_D, in units of the noise, does not correlate with r_D: both are summed as if they were independent, but weighed
  // by the square of both together. Pixels without a residual of both kinds are left out.
  void decorrelate(const float* block, int blocks) {
    for (int g = 0; g < groups(blocks); ++g) {
      WarpedPixels::Group& p = pixels_.groups[g];
      const float* D = block + g * kLanes / PixelList::kBlock * PixelList::kFields * PixelList::kBlock + g * kLanes % PixelList::kBlock;
      p.weight_intensity = select(p.weight_depth > Lanes(0.0F), p.weight_intensity, 0.0F);
      p.weight_depth = select(p.weight_intensity > Lanes(0.0F), p.weight_depth, 0.0F);
      const Lanes k = select(p.weight_depth > Lanes(0.0F), slope_ * sqrt(p.inverse_depth / p.inverse_intensity), 0.0F);
      p.residual_intensity = p.residual_intensity - k * p.residual_depth;
      for (int i = 0; i < 3; ++i) p.I[i] = p.I[i] - k * Lanes::load(D + (PixelList::kD0 + i) * PixelList::kBlock);
      const Lanes both = p.residual_intensity * p.residual_intensity * p.inverse_intensity * squares_.intensity +
                         p.residual_depth * p.residual_depth * p.inverse_depth * squares_.depth;
      pixels_.s2[2 * g] = pixels_.s2[2 * g + 1] = both;
    }
  }

  void sum_costs(int n, Sums& s) const {
    Lanes cost = s.cost, weight = s.weight, lost = s.lost;
    for (int g = 0; g < n; ++g) {
      const WarpedPixels::Group& p = pixels_.groups[g];
      const Lanes photometric = term_weight_ * p.weight_intensity;
      cost += photometric * pixels_.rho[2 * g] + p.weight_depth * pixels_.rho[2 * g + 1] + p.lost * charge_;
      lost += p.lost;
      weight += photometric + p.weight_depth + (p.lost + term_weight_ * p.lost);
    }
    s.cost = cost;
    s.weight = weight;
    s.lost = lost;
  }

  // M and f of each pixel: they are read three times, as all sums do not fit into the registers at once.
  void multiply(const float* block, int blocks) {
    const WarpedPixels::Group* p = pixels_.groups;
    const Lanes* kernel = pixels_.s2;
    Lanes* m = m_;
    for (int b = 0; b < blocks; ++b, block += PixelList::kFields * PixelList::kBlock) {
      for (int at = 0; at < PixelList::kBlock; at += kLanes, ++p, kernel += 2, m += 9) {
        const Lanes D0 = Lanes::load(block + PixelList::kD0 * PixelList::kBlock + at);
        const Lanes D1 = Lanes::load(block + PixelList::kD1 * PixelList::kBlock + at);
        const Lanes D2 = Lanes::load(block + PixelList::kD2 * PixelList::kBlock + at);
        const Lanes qi = p->weight_intensity * kernel[0] * p->inverse_intensity * factor_intensity_;
        const Lanes qd = p->weight_depth * kernel[1] * p->inverse_depth * factor_depth_;
        const Lanes pi0 = qi * p->I[0], pi1 = qi * p->I[1], pi2 = qi * p->I[2];
        const Lanes pd0 = qd * D0, pd1 = qd * D1, pd2 = qd * D2;
        m[0] = pi0 * p->I[0] + pd0 * D0;
        m[1] = pi0 * p->I[1] + pd0 * D1;
        m[2] = pi0 * p->I[2] + pd0 * D2;
        m[3] = pi1 * p->I[1] + pd1 * D1;
        m[4] = pi1 * p->I[2] + pd1 * D2;
        m[5] = pi2 * p->I[2] + pd2 * D2;
        m[6] = pi0 * p->residual_intensity + pd0 * p->residual_depth;
        m[7] = pi1 * p->residual_intensity + pd1 * p->residual_depth;
        m[8] = pi2 * p->residual_intensity + pd2 * p->residual_depth;
      }
    }
  }

  // The symmetric part of q a_reference a_current^T in place of q a a^T; no f.
  void multiply_rows_of_both(const float* block, int blocks) {
    using P = PixelList;
    const WarpedPixels::Group* p = pixels_.groups;
    const Lanes* kernel = pixels_.s2;
    Lanes* m = m_;
    for (int b = 0; b < blocks; ++b, block += P::kFields * P::kBlock) {
      for (int at = 0; at < P::kBlock; at += kLanes, ++p, kernel += 2, m += 9) {
        const auto field = [&](P::Field f) { return Lanes::load(block + f * P::kBlock + at); };
        const Lanes I[3] = {field(P::kI0), field(P::kI1), field(P::kI2)};
        const Lanes D[3] = {field(P::kD0), field(P::kD1), field(P::kD2)};
        const Lanes qi = 0.5F * p->weight_intensity * kernel[0] * p->inverse_intensity * factor_intensity_;
        const Lanes qd = 0.5F * p->weight_depth * kernel[1] * p->inverse_depth * factor_depth_;
        for (int i = 0, n = 0; i < 3; ++i) {
          for (int j = i; j < 3; ++j, ++n) {
            m[n] = qi * (I[i] * p->I[j] + I[j] * p->I[i]) + qd * (D[i] * p->D[j] + D[j] * p->D[i]);
          }
        }
        m[6] = m[7] = m[8] = 0.0F;
      }
    }
  }

  // Sums of M, f, X x M, X x M x X and X x f.
  // Row i of [X]x M is r_j = X_a M_bj - X_b M_aj with (a, b) the two axes after i; row i of [X]x M [X]x^T is X x r.
  template <int i>
  void sum_rows(const float* block, int blocks, Sums& s) const {
    constexpr int a = (i + 1) % 3;
    constexpr int b = (i + 2) % 3;
    constexpr int index[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    Lanes wv0 = s.wv[3 * i], wv1 = s.wv[3 * i + 1], wv2 = s.wv[3 * i + 2], v = s.v[i], w = s.w[i];
    Lanes M0 = s.vv[index[i][0]], M1 = s.vv[index[i][1]], M2 = s.vv[index[i][2]];  // the first i are sums of row < i
    Lanes W0 = s.ww[index[i][0]], W1 = s.ww[index[i][1]], W2 = s.ww[index[i][2]];
    const Lanes* m = m_;
    for (int k = 0; k < blocks; ++k, block += PixelList::kFields * PixelList::kBlock) {
      for (int at = 0; at < PixelList::kBlock; at += kLanes, m += 9) {
        const auto in = [&](int n) -> const Lanes& { return m[n]; };
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

  Warper warper_;
  NoiseRef noise_;
  KernelRef kernel_;
  SquareFactors squares_;
  Lanes factor_intensity_, factor_depth_, term_weight_, charge_, slope_;
  bool joint_;
  int selected_ = 0;
  WarpTally tally_;
  WarpedPixels pixels_;
  Lanes m_[9 * WarpedPixels::kGroups];
};

APSO_NAMESPACE_END
