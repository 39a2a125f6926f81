/// \file
/// Warping the pixels of a reference into the current frame: residuals, occlusion gate and derivatives, the paper's
/// eqs. (Intensity residual) and (Depth residual):
///
///     X = Z_k(p) K^-1 (p,1),  Y = T_current_reference X,  u = pi(Y),  r_I = I_c(u) - I_k(p),  r_D = Z_c(u) - Y_z
///
/// With an increment d = (v, w) multiplied from the left, dr/dd = (a, Y x a) where a = J_pi^T grad I for the
/// intensity and a = J_pi^T grad Z - e_z for the depth, so a residual needs only Y and a.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/sampling.hpp>
#include <apso/math/se3.hpp>
#include <apso/refinement/noise_model.hpp>
#include <apso/refinement/pyramid.hpp>

APSO_NAMESPACE_BEGIN

struct WarpOptions {
  float z_near = 0.1F;           ///< warped points nearer than this are out of view [m]
  float gate = 0.07F;            ///< depth difference from which a pixel is occluded, at the finest level [m]
  float gate_relative = 0.03F;   ///< the same as a share of the depth; the larger of the two counts
  float gate_growth = 5.0F;      ///< factor of the gate per coarser level
  bool gate_on = true;           ///< the gate drops what moved into or out of the way
  float depth_spread = 0.05F;    ///< largest relative difference of four depths that are interpolated
  bool esm = false;              ///< average the gradients of both images (larger basin, Malis 2004)
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("z_near", s.z_near, 0.0F, 100.0F);
    v("gate", s.gate, 0.0F, 100.0F);
    v("gate_relative", s.gate_relative, 0.0F, 1.0F);
    v("gate_growth", s.gate_growth, 1.0F, 100.0F);
    v("gate_on", s.gate_on);
    v("depth_spread", s.depth_spread, 0.0F, 1.0F);
    v("esm", s.esm);
  }
};

/// What became of the warped pixels.
struct WarpCounts {
  int selected = 0;      ///< pixels of the reference
  int valid = 0;         ///< gave a residual with a weight above 0
  int out_of_view = 0;   ///< left the image or came too near
  int occluded = 0;      ///< something stands in front
  int disoccluded = 0;   ///< the surface is gone, something farther is seen
  int masked = 0;        ///< fell on a pixel of weight 0
  WarpCounts& operator+=(const WarpCounts& o) {
    selected += o.selected;
    valid += o.valid;
    out_of_view += o.out_of_view;
    occluded += o.occluded;
    disoccluded += o.disoccluded;
    masked += o.masked;
    return *this;
  }
};

/// Warped pixels, one array per quantity, of the padded length of the pixel list.
struct WarpedPixels {
  std::vector<float> y0, y1, y2;     ///< warped point Y in the current camera [m]
  std::vector<float> ai0, ai1, ai2;  ///< a of the intensity, in standard deviations per metre
  std::vector<float> ad0, ad1, ad2;  ///< a of the depth, in standard deviations per metre
  std::vector<float> si, sd;         ///< residuals in standard deviations of the noise model
  std::vector<float> wi, wd;         ///< gamma of a valid residual, else 0
  std::vector<float> lost;           ///< gamma of a pixel that gave no residual, else 0

  void resize(std::size_t n) {
    for (auto* v : {&y0, &y1, &y2, &ai0, &ai1, &ai2, &ad0, &ad1, &ad2, &si, &sd, &wi, &wd, &lost}) v->resize(n);
  }
};

namespace detail {
using Block = Eigen::Array<float, kPixelBlock, 1>;
using BlockIn = Eigen::Map<const Block>;
using BlockOut = Eigen::Map<Block>;
inline BlockIn block(const std::vector<float>& v, int at) { return BlockIn(v.data() + at); }
inline BlockOut block(std::vector<float>& v, int at) { return BlockOut(v.data() + at); }
}  // namespace detail

/// Warps the pixels [begin, end) of a reference (multiples of kPixelBlock) into `current`.
/// \param gate_factor factor of the occlusion gate at this level, gate_growth^(levels above the finest)
/// \param out of the length of the padded list; only [begin, end) is written
inline WarpCounts warp_pixels(const PixelList& reference, const PyramidLevel& current, const Pose& T_current_reference,
                              const WarpOptions& options, const NoiseOptions& noise, float gate_factor, int begin,
                              int end, WarpedPixels& out) {
  using detail::block;
  using detail::Block;
  using Four = Eigen::Array<float, 4, 1>;
  constexpr int C = PyramidLevel::kChannels;
  const Eigen::Matrix3f R = T_current_reference.linear().cast<float>();
  const Eigen::Vector3f t = T_current_reference.translation().cast<float>();
  const Pinhole& cam = current.camera;
  const auto fx = static_cast<float>(cam.fx);
  const auto fy = static_cast<float>(cam.fy);
  const auto cx = static_cast<float>(cam.cx);
  const auto cy = static_cast<float>(cam.cy);
  const int w = current.intensity.width();
  const int h = current.intensity.height();
  const auto u_max = static_cast<float>(w - 2);
  const auto v_max = static_cast<float>(h - 2);
  const float* texture = current.texture.data();
  const float gate = options.gate * gate_factor;
  const float gate_relative = options.gate_relative * gate_factor;
  const bool sensor = noise.form == NoiseForm::Sensor;
  const float s2_intensity = 2 * noise.sigma_intensity * noise.sigma_intensity;
  const float s2_pixel = noise.sigma_pixel * noise.sigma_pixel;
  WarpCounts counts;

  for (int at = begin; at < end; at += kPixelBlock) {
    const auto X0 = block(reference.x, at);
    const auto X1 = block(reference.y, at);
    const auto X2 = block(reference.z, at);
    const Block Y0 = R(0, 0) * X0 + R(0, 1) * X1 + R(0, 2) * X2 + t.x();
    const Block Y1 = R(1, 0) * X0 + R(1, 1) * X1 + R(1, 2) * X2 + t.y();
    const Block Y2 = R(2, 0) * X0 + R(2, 1) * X1 + R(2, 2) * X2 + t.z();
    const Block iz = (Y2 > options.z_near).select(Y2, 1.0F).inverse();
    const Block u = fx * Y0 * iz + cx;
    const Block v = fy * Y1 * iz + cy;
    Block I, gx, gy, Z, zx, zy, wi, wd, lost;
    for (int j = 0; j < kPixelBlock; ++j) {
      I[j] = gx[j] = gy[j] = zx[j] = zy[j] = wi[j] = wd[j] = lost[j] = 0;
      Z[j] = Y2[j];
      const float gamma = reference.gamma[static_cast<std::size_t>(at + j)];
      if (!(gamma > 0)) continue;  // padding
      ++counts.selected;
      // written so that NaN is out of view
      if (!(Y2[j] > options.z_near && u[j] >= 1.0F && v[j] >= 1.0F && u[j] <= u_max && v[j] <= v_max)) {
        ++counts.out_of_view;
        lost[j] = gamma;
        continue;
      }
      const int x = std::min(static_cast<int>(u[j]), w - 2);
      const int y = std::min(static_cast<int>(v[j]), h - 2);
      const float a = u[j] - static_cast<float>(x);
      const float b = v[j] - static_cast<float>(y);
      const float* p = texture + (static_cast<std::ptrdiff_t>(y) * w + x) * C;
      const float* q = p + static_cast<std::ptrdiff_t>(w) * C;
      const Eigen::Map<const Four> p0(p), p1(p + C), q0(q), q1(q + C);
      const Four upper = p0 + a * (p1 - p0);
      const Four lower = q0 + a * (q1 - q0);
      const Four s = upper + b * (lower - upper);
      const float weight = gamma * s[3];
      if (!(weight > 0)) {
        ++counts.masked;
        continue;
      }
      const float near_z = (b < 0.5F ? p : q)[(a < 0.5F ? 0 : C) + 4];
      if (options.gate_on && near_z > 0) {
        const float r = near_z - Y2[j];
        const float tau = std::max(gate, gate_relative * Y2[j]);
        if (std::abs(r) > tau) {
          ++(r < 0 ? counts.occluded : counts.disoccluded);
          lost[j] = weight;
          continue;
        }
      }
      ++counts.valid;
      I[j] = s[0];
      gx[j] = s[1];
      gy[j] = s[2];
      wi[j] = weight;
      if (one_surface(p[4], p[C + 4], q[4], q[C + 4], options.depth_spread)) {
        const Eigen::Map<const Four> p2(p + 4), p3(p + C + 4), q2(q + 4), q3(q + C + 4);
        const Four above = p2 + a * (p3 - p2);
        const Four below = q2 + a * (q3 - q2);
        const Four d = above + b * (below - above);
        Z[j] = d[0];
        zx[j] = d[1];
        zy[j] = d[2];
        wd[j] = weight;
      }
    }
    const Block rI = (wi > 0.0F).select(I - block(reference.intensity, at), 0.0F);
    const Block rD = Z - Y2;
    Block iI, iD;  // one over the standard deviation
    if (sensor) {
      iI = (s2_intensity + s2_pixel * (gx * gx + gy * gy)).sqrt().inverse();
      const Block sz = (1.425e-3F * Z * Z).max(1e-3F);
      const Block sy = (1.425e-3F * Y2 * Y2).max(1e-3F);
      iD = (sz * sz + sy * sy + s2_pixel * (zx * zx + zy * zy)).sqrt().inverse();
    } else {
      for (int j = 0; j < kPixelBlock; ++j) {
        iI[j] = static_fusion_weight_intensity(rI[j], gx[j], gy[j]);
        iD[j] = static_fusion_weight_depth(rD[j], zx[j], zy[j]);
      }
    }
    if (options.esm) {
      gx = (wi > 0.0F).select(0.5F * (gx + block(reference.dx, at)), 0.0F);
      gy = (wi > 0.0F).select(0.5F * (gy + block(reference.dy, at)), 0.0F);
    }
    const Block a0 = gx * iI * (fx * iz);
    const Block a1 = gy * iI * (fy * iz);
    block(out.ai0, at) = a0;
    block(out.ai1, at) = a1;
    block(out.ai2, at) = -(a0 * Y0 + a1 * Y1) * iz;
    const Block d0 = zx * iD * (fx * iz);
    const Block d1 = zy * iD * (fy * iz);
    block(out.ad0, at) = d0;
    block(out.ad1, at) = d1;
    block(out.ad2, at) = -(d0 * Y0 + d1 * Y1) * iz - iD;
    block(out.si, at) = rI * iI;
    block(out.sd, at) = (wd > 0.0F).select(rD * iD, 0.0F);
    block(out.y0, at) = Y0;
    block(out.y1, at) = Y1;
    block(out.y2, at) = Y2;
    block(out.wi, at) = wi;
    block(out.wd, at) = wd;
    block(out.lost, at) = lost;
  }
  return counts;
}

APSO_NAMESPACE_END
