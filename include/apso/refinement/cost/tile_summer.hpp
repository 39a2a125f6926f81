/// \file
/// One pass over a tile: the robust cost of its pixels, and the sums that the normal equations are made of.
///
/// In three stages over some hundred pixels at a time: they are warped and weighed by the noise model (warped_pixels.hpp), the
/// kernel turns squared residuals into weights and costs (kernel_loop.hpp), and both are summed here. Both rows of the Jacobian
/// are (a, X x a), so with M = sum of q a a^T the blocks of H are sum M, sum [X]x M and sum [X]x M [X]x^T.
///
/// Sums run over a tile in a fixed order, in float; tiles are added in order, in double. The result does not depend on the
/// number of threads, nor on whether the processor has wide lanes: what is summed is computed in these, but added kLanes at a time.
#pragma once

#include <algorithm>

#include <apso/config.hpp>
#include <apso/math/lanes/lane_functions.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>
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
      : warpers_(warper),
        noise_(noise),
        kernel_(kernel),
        squares_(scales),
        factor_intensity_(static_cast<float>(scales.alpha * scales.alpha / (scales.scale_intensity * scales.scale_intensity))),
        factor_depth_(static_cast<float>(1.0 / (scales.scale_depth * scales.scale_depth))),
        term_weight_(static_cast<float>(scales.term_weight())),
        charge_(static_cast<float>(scales.charge(kernel))),
        slope_(static_cast<float>(scales.slope)),
        joint_(scales.coupling == ScaleCoupling::BivariateT) {}

  /// A pixel without residual is charged rho(3) for both kinds, so that the cost cannot be lowered by pushing pixels out
  /// of the image; a missing depth residual is neither charged nor counted.
  void operator()(const PixelList& list, const PixelList::Tile& tile, TileSums& out) {
    Sums s;
    for (int b = tile.begin; b < tile.end; b += WarpedPixels::kBlocks) {
      const int blocks = std::min(tile.end - b, WarpedPixels::kBlocks);
      const float* block = list.block(b);
      noise_(warpers_, squares_, block, blocks, pixels_, counts_);
      weigh(block, blocks);
      in_widest_lanes([this, block, blocks, &s](auto lanes) {
        sum_costs<lanes>(blocks, s);
        if (warpers_.with<kLanes>().rows_of_current()) multiply_rows_of_both<lanes>(block, blocks);
        else multiply<lanes>(block, blocks);
        sum_rows<lanes, 0>(block, blocks, s);
        sum_rows<lanes, 1>(block, blocks, s);
        sum_rows<lanes, 2>(block, blocks, s);
      });
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
      if (joint_) noise_(warpers_, squares_, list.block(b), blocks, pixels_, counts_);
      else noise_.cost(warpers_, squares_, list.block(b), blocks, pixels_, counts_);
      weigh(list.block(b), blocks);
      in_widest_lanes([this, blocks, &s](auto lanes) { sum_costs<lanes>(blocks, s); });
    }
    take_cost(s, tile, out);
  }

  /// What became of the pixels of all tiles so far.
  [[nodiscard]] const WarpCounts& counts() const { return counts_; }

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

  void take_cost(const Sums& s, const PixelList::Tile& tile, TileSums& out) {
    out.cost = s.cost.sum();
    out.weight = s.weight.sum();
    out.lost = s.lost.sum();
    counts_.selected += tile.count;
  }

  void weigh(const float* block, int blocks) {
    if (joint_) decorrelate(block, blocks);
    kernel_(pixels_.s2->intensity, pixels_.rho->intensity, 2 * blocks * PixelList::kBlock);
  }

  // r_I - slope r_D, in units of the noise, does not correlate with r_D: both are summed as if they were independent, but weighed
  // by the square of both together. Pixels without a residual of both kinds are left out.
  void decorrelate(const float* block, int blocks) {
    for (int b = 0; b < blocks; ++b, block += PixelList::kFields * PixelList::kBlock) {
      WarpedPixels::Block& p = pixels_.blocks[b];
      for (int at = 0; at < PixelList::kBlock; at += kLanes) {
        const auto get = [at](const float(&of)[PixelList::kBlock]) { return Lanes::load(of + at); };
        const Lanes of_depth = get(p.weight_depth);
        const Lanes weight_intensity = select(of_depth > Lanes(0.0F), get(p.weight_intensity), 0.0F);
        const Lanes weight_depth = select(weight_intensity > Lanes(0.0F), of_depth, 0.0F);
        weight_intensity.store(p.weight_intensity + at);
        weight_depth.store(p.weight_depth + at);
        const Lanes inverse_intensity = get(p.inverse_intensity);
        const Lanes inverse_depth = get(p.inverse_depth);
        const Lanes residual_depth = get(p.residual_depth);
        const Lanes k = select(weight_depth > Lanes(0.0F), slope_ * sqrt(inverse_depth / inverse_intensity), 0.0F);
        const Lanes residual_intensity = get(p.residual_intensity) - k * residual_depth;
        residual_intensity.store(p.residual_intensity + at);
        for (int i = 0; i < 3; ++i) {
          (get(p.I[i]) - k * Lanes::load(block + (PixelList::kD0 + i) * PixelList::kBlock + at)).store(p.I[i] + at);
        }
        const Lanes both = residual_intensity * residual_intensity * inverse_intensity * squares_.intensity +
                           residual_depth * residual_depth * inverse_depth * squares_.depth;
        both.store(pixels_.s2[b].intensity + at);
        both.store(pixels_.s2[b].depth + at);
      }
    }
  }

  template <int n>
  APSO_INLINE void sum_costs(int blocks, Sums& s) const {
    using L = BasicLanes<n>;
    const L term_weight = term_weight_;
    const L charge = charge_;
    Lanes cost = s.cost, weight = s.weight, lost = s.lost;
    for (int b = 0; b < blocks; ++b) {
      const WarpedPixels::Block& p = pixels_.blocks[b];
      const WarpedPixels::Pair& rho = pixels_.rho[b];
      for (int at = 0; at < PixelList::kBlock; at += n) {
        const auto get = [at](const float(&of)[PixelList::kBlock]) { return L::load(of + at); };
        const L photometric = term_weight * get(p.weight_intensity);
        const L weight_depth = get(p.weight_depth);
        const L l = get(p.lost);
        add(cost, photometric * get(rho.intensity) + weight_depth * get(rho.depth) + l * charge);
        add(lost, l);
        add(weight, photometric + weight_depth + (l + term_weight * l));
      }
    }
    s.cost = cost;
    s.weight = weight;
    s.lost = lost;
  }

  // M and f of each pixel: they are read three times, as all sums do not fit into the registers at once.
  template <int n>
  APSO_INLINE void multiply(const float* block, int blocks) {
    using L = BasicLanes<n>;
    using P = PixelList;
    const L factor_intensity = factor_intensity_;
    const L factor_depth = factor_depth_;
    for (int b = 0; b < blocks; ++b, block += P::kFields * P::kBlock) {
      const WarpedPixels::Block& p = pixels_.blocks[b];
      const WarpedPixels::Pair& kernel = pixels_.s2[b];
      for (int at = 0; at < P::kBlock; at += n) {
        const auto get = [at](const float(&of)[P::kBlock]) { return L::load(of + at); };
        const auto put = [&, at](int i, const L& v) { v.store(m_[b][i] + at); };
        const L D0 = L::load(block + P::kD0 * P::kBlock + at);
        const L D1 = L::load(block + P::kD1 * P::kBlock + at);
        const L D2 = L::load(block + P::kD2 * P::kBlock + at);
        const L I0 = get(p.I[0]), I1 = get(p.I[1]), I2 = get(p.I[2]);
        const L r_intensity = get(p.residual_intensity), r_depth = get(p.residual_depth);
        const L qi = get(p.weight_intensity) * get(kernel.intensity) * get(p.inverse_intensity) * factor_intensity;
        const L qd = get(p.weight_depth) * get(kernel.depth) * get(p.inverse_depth) * factor_depth;
        const L pi0 = qi * I0, pi1 = qi * I1, pi2 = qi * I2;
        const L pd0 = qd * D0, pd1 = qd * D1, pd2 = qd * D2;
        put(0, pi0 * I0 + pd0 * D0);
        put(1, pi0 * I1 + pd0 * D1);
        put(2, pi0 * I2 + pd0 * D2);
        put(3, pi1 * I1 + pd1 * D1);
        put(4, pi1 * I2 + pd1 * D2);
        put(5, pi2 * I2 + pd2 * D2);
        put(6, pi0 * r_intensity + pd0 * r_depth);
        put(7, pi1 * r_intensity + pd1 * r_depth);
        put(8, pi2 * r_intensity + pd2 * r_depth);
      }
    }
  }

  // The symmetric part of q a_reference a_current^T in place of q a a^T; no f.
  template <int n>
  APSO_INLINE void multiply_rows_of_both(const float* block, int blocks) {
    using L = BasicLanes<n>;
    using P = PixelList;
    const L factor_intensity = factor_intensity_;
    const L factor_depth = factor_depth_;
    for (int b = 0; b < blocks; ++b, block += P::kFields * P::kBlock) {
      const WarpedPixels::Block& p = pixels_.blocks[b];
      const WarpedPixels::Pair& kernel = pixels_.s2[b];
      for (int at = 0; at < P::kBlock; at += n) {
        const auto get = [at](const float(&of)[P::kBlock]) { return L::load(of + at); };
        const auto field = [&](P::Field f) { return L::load(block + f * P::kBlock + at); };
        const L I[3] = {field(P::kI0), field(P::kI1), field(P::kI2)};
        const L D[3] = {field(P::kD0), field(P::kD1), field(P::kD2)};
        const L I_current[3] = {get(p.I[0]), get(p.I[1]), get(p.I[2])};
        const L D_current[3] = {get(p.D[0]), get(p.D[1]), get(p.D[2])};
        const L qi = 0.5F * get(p.weight_intensity) * get(kernel.intensity) * get(p.inverse_intensity) * factor_intensity;
        const L qd = 0.5F * get(p.weight_depth) * get(kernel.depth) * get(p.inverse_depth) * factor_depth;
        for (int i = 0, k = 0; i < 3; ++i) {
          for (int j = i; j < 3; ++j, ++k) {
            const L both = qi * (I[i] * I_current[j] + I[j] * I_current[i]) + qd * (D[i] * D_current[j] + D[j] * D_current[i]);
            both.store(m_[b][k] + at);
          }
        }
        for (int k = 6; k < 9; ++k) L(0.0F).store(m_[b][k] + at);
      }
    }
  }

  // Sums of M, f, X x M, X x M x X and X x f.
  // Row i of [X]x M is r_j = X_a M_bj - X_b M_aj with (a, b) the two axes after i; row i of [X]x M [X]x^T is X x r.
  template <int n, int i>
  APSO_INLINE void sum_rows(const float* block, int blocks, Sums& s) const {
    using L = BasicLanes<n>;
    using P = PixelList;
    constexpr int a = (i + 1) % 3;
    constexpr int b = (i + 2) % 3;
    constexpr int index[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    Lanes wv0 = s.wv[3 * i], wv1 = s.wv[3 * i + 1], wv2 = s.wv[3 * i + 2], v = s.v[i], w = s.w[i];
    Lanes M0 = s.vv[index[i][0]], M1 = s.vv[index[i][1]], M2 = s.vv[index[i][2]];  // the first i are sums of row < i
    Lanes W0 = s.ww[index[i][0]], W1 = s.ww[index[i][1]], W2 = s.ww[index[i][2]];
    for (int k = 0; k < blocks; ++k, block += P::kFields * P::kBlock) {
      for (int at = 0; at < P::kBlock; at += n) {
        const auto in = [&](int of) { return L::load(m_[k][of] + at); };
        const L X0 = L::load(block + P::kX * P::kBlock + at);
        const L X1 = L::load(block + P::kY * P::kBlock + at);
        const L X2 = L::load(block + P::kZ * P::kBlock + at);
        const L& Xa = a == 0 ? X0 : (a == 1 ? X1 : X2);
        const L& Xb = b == 0 ? X0 : (b == 1 ? X1 : X2);
        const L r0 = Xa * in(index[b][0]) - Xb * in(index[a][0]);
        const L r1 = Xa * in(index[b][1]) - Xb * in(index[a][1]);
        const L r2 = Xa * in(index[b][2]) - Xb * in(index[a][2]);
        add(wv0, r0);
        add(wv1, r1);
        add(wv2, r2);
        if constexpr (i <= 0) {
          add(M0, in(0));
          add(W0, X1 * r2 - X2 * r1);
        }
        if constexpr (i <= 1) {
          add(M1, in(index[i][1]));
          add(W1, X2 * r0 - X0 * r2);
        }
        add(M2, in(index[i][2]));
        add(W2, X0 * r1 - X1 * r0);
        add(v, in(6 + i));
        add(w, Xa * in(6 + b) - Xb * in(6 + a));
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

  Warpers warpers_;
  NoiseRef noise_;
  KernelRef kernel_;
  SquareFactors squares_;
  float factor_intensity_, factor_depth_, term_weight_, charge_, slope_;
  bool joint_;
  WarpCounts counts_;
  WarpedPixels pixels_;
  alignas(WarpedPixels::kLine) float m_[WarpedPixels::kBlocks][9][PixelList::kBlock];  // M and f of each pixel
};

APSO_NAMESPACE_END
