/// \file
/// What is computed once of each selected pixel: its point, its gradients, its rows of the Jacobian.
#pragma once

#include <algorithm>
#include <cstring>

#include <apso/config.hpp>
#include <apso/math/lanes/lane_functions.hpp>
#include <apso/math/lanes/lane_memory.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/refinement/pyramid/pixel_list.hpp>
#include <apso/refinement/pyramid/plane.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

/// The images of a level and its camera, as a block of pixels is filled from them.
struct BlockSource {
  static constexpr int kReach = 2;  ///< neighbours of a pixel are looked at that far away [px]
  const Plane& intensity;
  const Plane& depth;
  const Plane& gamma;  ///< or empty: all weights are 1
  float fx, fy, cx, cy;
  float edge;  ///< depth gradient that is an edge, as a share of the depth [1/px]
};

/// What is read of n pixels and of their neighbours to the left, right, up and down.
template <int n>
struct PixelSurroundings {
  using Lanes = BasicLanes<n>;
  using IntLanes = BasicIntLanes<n>;
  enum Quantity { kU, kV, kI, kIl, kIr, kIu, kId, kZ, kZl, kZr, kZu, kZd, kTwoAway, kGamma, kQuantities };
  Lanes of[kQuantities];  ///< kTwoAway: the least depth two pixels away
  const Lanes& operator[](Quantity q) const { return of[q]; }

  /// Of pixels side by side, the first of which is (x, y).
  APSO_INLINE void load(const BlockSource& in, int x, int y) {
    const auto intensity = [&](int dx, int dy) { return Lanes::load(in.intensity.row(y + dy) + x + dx); };
    const auto depth = [&](int dx, int dy) { return Lanes::load(in.depth.row(y + dy) + x + dx); };
    of[kU] = Lanes::load(kSteps) + static_cast<float>(x);
    of[kV] = static_cast<float>(y);
    of[kI] = intensity(0, 0);
    of[kIl] = intensity(-1, 0);
    of[kIr] = intensity(1, 0);
    of[kIu] = intensity(0, -1);
    of[kId] = intensity(0, 1);
    of[kZ] = depth(0, 0);
    of[kZl] = depth(-1, 0);
    of[kZr] = depth(1, 0);
    of[kZu] = depth(0, -1);
    of[kZd] = depth(0, 1);
    of[kTwoAway] = min(min(depth(-2, 0), depth(2, 0)), min(depth(0, -2), depth(0, 2)));
    of[kGamma] = in.gamma.empty() ? Lanes(1.0F) : Lanes::load(in.gamma.row(y) + x);
  }
  /// Of `count` <= n pixels anywhere, y << 16 | x each; the other lanes become 0. Reads n of them.
  APSO_INLINE void gather(const BlockSource& in, const int* found, int count) {
    const IntLanes used = Lanes::load(kSteps) < Lanes(static_cast<float>(count));
    IntLanes at;
    std::memcpy(&at.v, found, sizeof at.v);
    at = (at & used) | (all_lanes<n>(BlockSource::kReach << 16 | BlockSource::kReach) & !used);  // any pixel that has all neighbours
    of[kU] = to_float(at & all_lanes<n>(0xFFFF));
    of[kV] = to_float(upper_halves(at));
    const auto stride = static_cast<int>(in.depth.row(1) - in.depth.row(0));  // all planes are of one size
    constexpr int kReach = BlockSource::kReach;
    // of the pixel two to the left of and two above each
    const IntLanes corner =
        to_int(of[kV] * Lanes(static_cast<float>(stride)) + of[kU] - Lanes(static_cast<float>(kReach * stride + kReach)));
    const float* I = in.intensity.row(kReach) + kReach;
    const float* Z = in.depth.row(kReach) + kReach;
    const BasicQuad<n> i = load_quads(I - 1, corner);
    of[kIl] = i.c[0];
    of[kI] = i.c[1];
    of[kIr] = i.c[2];
    of[kIu] = load_quads(I - stride, corner).c[0];
    of[kId] = load_quads(I + stride, corner).c[0];
    const BasicQuad<n> z = load_quads(Z - 1, corner);
    of[kZl] = z.c[0];
    of[kZ] = z.c[1];
    of[kZr] = z.c[2];
    of[kZu] = load_quads(Z - stride, corner).c[0];
    of[kZd] = load_quads(Z + stride, corner).c[0];
    of[kTwoAway] = min(min(load_quads(Z - 2, corner).c[0], z.c[3]),
                       min(load_quads(Z - 2 * stride, corner).c[0], load_quads(Z + 2 * stride, corner).c[0]));
    of[kGamma] = in.gamma.empty() ? Lanes(1.0F) : load_quads(in.gamma.row(kReach) + kReach, corner).c[0];
    for (Lanes& q : of) q = select(used, q, 0.0F);
  }

 private:
  static constexpr float kSteps[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
};

/// All quantities of the pixels found[0 .. count), y << 16 | x each, in a block, whose rest becomes 0.
/// \tparam n how many are worked on at once
/// \param count at most kBlock; kBlock places are read
template <int n>
APSO_INLINE void fill_block(float* block, const int* found, int count, const BlockSource& in) {
  using P = PixelList;
  using L = BasicLanes<n>;
  using S = PixelSurroundings<n>;
  const L zero = 0.0F;
  for (int at = 0; at < P::kBlock; at += n) {
    S p;
    // where all pixels are taken most of them lie side by side
    if (at + n <= count && found[at + n - 1] - found[at] == n - 1) p.load(in, found[at] & 0xFFFF, found[at] >> 16);
    else p.gather(in, found + at, std::clamp(count - at, 0, n));
    const auto put = [&](P::Field f, const L& v) { v.store(block + f * P::kBlock + at); };
    const L& z = p[S::kZ];
    const L iz = 1.0F / select(z > zero, z, 1.0F);
    const L X = (p[S::kU] - in.cx) * (1.0F / in.fx) * z;
    const L Y = (p[S::kV] - in.cy) * (1.0F / in.fy) * z;
    const L gx = 0.5F * (p[S::kIr] - p[S::kIl]);
    const L gy = 0.5F * (p[S::kId] - p[S::kIu]);
    put(P::kX, X);
    put(P::kY, Y);
    put(P::kZ, z);
    put(P::kIntensity, p[S::kI]);
    put(P::kGamma, p[S::kGamma]);
    const L &l = p[S::kZl], &r = p[S::kZr], &u = p[S::kZu], &d = p[S::kZd];
    const L low = min(min(l, r), min(u, d));
    const auto own = min(low, p[S::kTwoAway]) > z * (1.0F - in.edge);
    put(P::kGradient2, select(own, gx * gx + gy * gy, select(z > zero, -1.0F, zero)));
    const L a0 = select(own, gx * in.fx * iz, zero);
    const L a1 = select(own, gy * in.fy * iz, zero);
    put(P::kI0, a0);
    put(P::kI1, a1);
    put(P::kI2, zero - (a0 * X + a1 * Y) * iz);
    const L zx = 0.5F * (r - l);
    const L zy = 0.5F * (d - u);
    const L g2 = zx * zx + zy * zy;
    const auto smooth = (low > zero) & (g2 < in.edge * in.edge * z * z);
    const L d0 = select(smooth, zx * in.fx * iz, zero);
    const L d1 = select(smooth, zy * in.fy * iz, zero);
    put(P::kDepthGradient2, select(smooth, g2, select(z > zero, -1.0F, zero)));
    put(P::kD0, d0);
    put(P::kD1, d1);
    put(P::kD2, select(smooth, zero - (d0 * X + d1 * Y) * iz - 1.0F, zero));
  }
}

/// Gradients of mere noise would make a bare wall look as if it fixed the motion along it. A tile without texture gets no
/// photometric rows; a tile that is plane within the noise gets the slope of the plane. Counts the pixels that are compared.
/// \param b          side of the cells of which each gave its best pixel
/// \param noise      standard deviation of the intensity gradient where nothing is to be seen [1/px]
/// \param slope      focal length of the full size over that of the level, times the multiple of the depth noise [px]
/// \param fx         focal length [px]
inline void remove_noise_gradients(PixelList& list, PixelList::Tile& tile, int b, float noise, float slope, float fx) {
  using P = PixelList;
  float largest = 0;  // of b^2 exponentials: 1 + 1/2 + ... 1/b^2
  for (int i = 1; i <= b * b; ++i) largest += 1.0F / static_cast<float>(i);
  const Lanes zero = 0.0F;
  Lanes gradients = zero, compared = zero, count = zero, sum0 = zero, sum1 = zero, squares = zero, noises = zero;
  for (int k = tile.begin; k < tile.end; ++k) {
    const float* p = list.block(k);
    for (int i = 0; i < P::kBlock; i += kLanes) {
      const auto get = [&](P::Field f) { return Lanes::load(p + f * P::kBlock + i); };
      gradients += max(get(P::kGradient2), zero);
      const Mask ok = (get(P::kGamma) > zero) & (get(P::kDepthGradient2) >= zero);
      compared += select((get(P::kGamma) > zero) & (get(P::kGradient2) >= zero), 1.0F, zero);
      const Lanes d0 = get(P::kD0);  // 0 unless ok
      const Lanes d1 = get(P::kD1);
      const Lanes z = get(P::kZ);
      const Lanes slope_noise = select(ok, slope * max(kDepthNoise * z * z, kDepthNoiseFloor) / select(ok, z, 1.0F), zero);
      count += select(ok, 1.0F, zero);
      sum0 += select(ok, d0, zero);
      sum1 += select(ok, d1, zero);
      squares += select(ok, d0 * d0 + d1 * d1, zero);
      noises += slope_noise * slope_noise;
    }
  }
  tile.compared = static_cast<int>(compared.sum());
  const float gradient2 = gradients.sum(), n = count.sum(), s0 = sum0.sum(), s1 = sum1.sum(), s2 = squares.sum();
  const float expected = noises.sum();
  const bool bare = gradient2 < 1.5F * largest * noise * noise * static_cast<float>(tile.count);
  float m0 = n > 0 ? s0 / n : 0.0F;
  float m1 = n > 0 ? s1 / n : 0.0F;
  const bool plane = n >= 8 && s2 - n * (m0 * m0 + m1 * m1) < 3 * expected;
  // a slope within the noise of the mean is none: many tiles with such slopes would look like a surface
  const float squared = m0 * m0 + m1 * m1;
  const float shrink = squared > 0 && n > 0 ? std::max(0.0F, 1.0F - 4.0F * expected / (n * n * squared)) : 0.0F;
  m0 *= shrink;
  m1 *= shrink;
  if (!bare && !plane) return;
  for (int k = tile.begin; k < tile.end; ++k) {
    float* p = list.block(k);
    for (int i = 0; i < P::kBlock; ++i) {
      if (bare) p[P::kI0 * P::kBlock + i] = p[P::kI1 * P::kBlock + i] = p[P::kI2 * P::kBlock + i] = 0.0F;
      if (!plane || !(p[P::kGamma * P::kBlock + i] > 0) || p[P::kDepthGradient2 * P::kBlock + i] < 0) continue;
      const float z = p[P::kZ * P::kBlock + i];
      p[P::kD0 * P::kBlock + i] = m0;
      p[P::kD1 * P::kBlock + i] = m1;
      p[P::kD2 * P::kBlock + i] = -(m0 * p[P::kX * P::kBlock + i] + m1 * p[P::kY * P::kBlock + i]) / z - 1.0F;
      p[P::kDepthGradient2 * P::kBlock + i] = (m0 * m0 + m1 * m1) * z * z / (fx * fx);
    }
  }
}
APSO_NAMESPACE_END
