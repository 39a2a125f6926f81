/// \file
/// What is computed once of each selected pixel: its point, its gradients, its rows of the Jacobian.
#pragma once

#include <algorithm>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/refinement/pyramid/pixel_list.hpp>
#include <apso/refinement/pyramid/plane.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

/// The images of a level and its camera, as a block of pixels is filled from them.
struct BlockSource {
  const Plane& intensity;
  const Plane& depth;
  const Plane& gamma;  ///< or empty: all weights are 1
  float fx, fy, cx, cy;
  float edge;  ///< depth gradient that is an edge, as a share of the depth [1/px]
};

/// What is read of kLanes pixels and their neighbours: left, right, up and down.
struct PixelSurroundings {
  Lanes x, y;               ///< [px]
  Lanes I, Il, Ir, Iu, Id;  ///< intensity
  Lanes Z, Zl, Zr, Zu, Zd;  ///< depth [m]
  Lanes two_away;           ///< least depth two pixels away [m]
  Lanes gamma;              ///< weight

  /// Of kLanes pixels side by side, the first of which is (x0, y0).
  void load(const BlockSource& in, int x0, int y0) {
    const float* i = in.intensity.row(y0) + x0;
    const float* z = in.depth.row(y0) + x0;
    x = Lanes::load(kSteps) + static_cast<float>(x0);
    y = static_cast<float>(y0);
    I = Lanes::load(i);
    Il = Lanes::load(i - 1);
    Ir = Lanes::load(i + 1);
    Iu = Lanes::load(in.intensity.row(y0 - 1) + x0);
    Id = Lanes::load(in.intensity.row(y0 + 1) + x0);
    Z = Lanes::load(z);
    Zl = Lanes::load(z - 1);
    Zr = Lanes::load(z + 1);
    Zu = Lanes::load(in.depth.row(y0 - 1) + x0);
    Zd = Lanes::load(in.depth.row(y0 + 1) + x0);
    two_away = min(min(Lanes::load(z - 2), Lanes::load(z + 2)),
                   min(Lanes::load(in.depth.row(y0 - 2) + x0), Lanes::load(in.depth.row(y0 + 2) + x0)));
    gamma = in.gamma.empty() ? Lanes(1.0F) : Lanes::load(in.gamma.row(y0) + x0);
  }
  /// Of n <= kLanes pixels anywhere; the other lanes become 0.
  void gather(const BlockSource& in, const int* found, int n) {
    float each[14][kLanes] = {};
    for (int k = 0; k < n; ++k) {
      const int u = found[k] & 0xFFFF;
      const int v = found[k] >> 16;
      const float* i = in.intensity.row(v) + u;
      const float* z = in.depth.row(v) + u;
      each[0][k] = static_cast<float>(u);
      each[1][k] = static_cast<float>(v);
      each[2][k] = *i;
      each[3][k] = i[-1];
      each[4][k] = i[1];
      each[5][k] = in.intensity.row(v - 1)[u];
      each[6][k] = in.intensity.row(v + 1)[u];
      each[7][k] = *z;
      each[8][k] = z[-1];
      each[9][k] = z[1];
      each[10][k] = in.depth.row(v - 1)[u];
      each[11][k] = in.depth.row(v + 1)[u];
      each[12][k] = std::min(std::min(z[-2], z[2]), std::min(in.depth.row(v - 2)[u], in.depth.row(v + 2)[u]));
      each[13][k] = in.gamma.empty() ? 1.0F : in.gamma.row(v)[u];
    }
    Lanes* const to[14] = {&x, &y, &I, &Il, &Ir, &Iu, &Id, &Z, &Zl, &Zr, &Zu, &Zd, &two_away, &gamma};
    for (int f = 0; f < 14; ++f) *to[f] = Lanes::load(each[f]);
  }

 private:
  static constexpr float kSteps[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
};

/// All quantities of the pixels found[0 .. n), y << 16 | x each, n <= kBlock; the rest of the block becomes 0.
inline void fill_block(float* block, const int* found, int n, const BlockSource& in) {
  using P = PixelList;
  const Lanes zero = 0.0F;
  for (int at = 0; at < P::kBlock; at += kLanes) {
    PixelSurroundings p;
    // where all pixels are taken most of them lie side by side
    if (at + kLanes <= n && found[at + kLanes - 1] - found[at] == kLanes - 1) p.load(in, found[at] & 0xFFFF, found[at] >> 16);
    else p.gather(in, found + at, std::clamp(n - at, 0, kLanes));
    const auto put = [&](P::Field f, const Lanes& v) { v.store(block + f * P::kBlock + at); };
    const Lanes z = p.Z;
    const Lanes iz = 1.0F / select(z > zero, z, 1.0F);
    const Lanes X = (p.x - in.cx) * (1.0F / in.fx) * z;
    const Lanes Y = (p.y - in.cy) * (1.0F / in.fy) * z;
    const Lanes gx = 0.5F * (p.Ir - p.Il);
    const Lanes gy = 0.5F * (p.Id - p.Iu);
    put(P::kX, X);
    put(P::kY, Y);
    put(P::kZ, z);
    put(P::kIntensity, p.I);
    put(P::kGamma, p.gamma);
    const Lanes l = p.Zl, r = p.Zr, u = p.Zu, d = p.Zd;
    const Lanes low = min(min(l, r), min(u, d));
    const Mask own = min(low, p.two_away) > z * (1.0F - in.edge);
    put(P::kGradient2, select(own, gx * gx + gy * gy, select(z > zero, -1.0F, zero)));
    const Lanes a0 = select(own, gx * in.fx * iz, zero);
    const Lanes a1 = select(own, gy * in.fy * iz, zero);
    put(P::kI0, a0);
    put(P::kI1, a1);
    put(P::kI2, zero - (a0 * X + a1 * Y) * iz);
    const Lanes zx = 0.5F * (r - l);
    const Lanes zy = 0.5F * (d - u);
    const Lanes g2 = zx * zx + zy * zy;
    const Mask smooth = (low > zero) & (g2 < in.edge * in.edge * z * z);
    const Lanes d0 = select(smooth, zx * in.fx * iz, zero);
    const Lanes d1 = select(smooth, zy * in.fy * iz, zero);
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
