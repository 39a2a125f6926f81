/// \file
/// Warping the pixels of a reference into the current frame: residuals, occlusion gate and derivatives, the paper's
/// eqs. (Intensity residual) and (Depth residual):
///
///     X = Z_k(p) K^-1 (p,1),  Y = T_current_reference X,  u = pi(Y),  r_I = I_c(u) - (g I_k(p) + o),  r_D = Z_c(u) - Y_z
///
/// The derivative is taken for an increment d = (v, w) in the frame of the reference, T <- T Exp(d). There it is
/// (a, X x a) with a = J_pi(X)^T grad I for the intensity and a = J_pi(X)^T grad Z - e_z for the depth: both belong to the
/// reference alone, because aligned images have the same gradients, so they are computed once per frame. With `esm` the
/// gradient of the current image is computed as well and the mean of both is taken (Malis, ICRA 2004).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <apso/config.hpp>
#include <apso/math/lanes/lane_memory.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>
#include <apso/math/se3.hpp>
#include <apso/refinement/cost/illumination.hpp>
#include <apso/refinement/cost/noise_model.hpp>
#include <apso/refinement/pyramid/pixel_list.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

struct WarpOptions {
  float gate = 0.07F;  ///< depth difference from which a pixel is occluded, at the finest level [m]; 0 = none ever is. 7 cm is
                       ///< the value of ElasticFusion and Open3D
  bool esm = true;     ///< mean of the gradients of both images; at the finest level the aligner takes those of
                       ///< the reference alone, where noise common to residual and gradient would pull the pose
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("gate", s.gate, 0.0F, 100.0F);
    v("esm", s.esm);
  }
};
/// Factor of the gate per coarser level: a gate that does not grow discards the pixels that would pull a pose that is far off back.
inline constexpr float kGateGrowth = 5.0F;

/// What became of the warped pixels.
struct WarpCounts {
  int selected = 0;     ///< pixels of the reference
  int valid = 0;        ///< seen in the current image
  int valid_depth = 0;  ///< of these, gave a depth residual
  int out_of_view = 0;  ///< left the image or came too near
  int occluded = 0;     ///< something stands in front
  int disoccluded = 0;  ///< the surface is gone, something farther is seen
  int masked = 0;       ///< fell on a pixel of weight 0
  WarpCounts& operator+=(const WarpCounts& o) {
    selected += o.selected;
    valid += o.valid;
    valid_depth += o.valid_depth;
    out_of_view += o.out_of_view;
    occluded += o.occluded;
    disoccluded += o.disoccluded;
    masked += o.masked;
    return *this;
  }
};

/// What happened to n pixels.
template <int n>
struct BasicWarpedLanes {
  using Lanes = BasicLanes<n>;
  using Mask = BasicIntLanes<n>;
  Lanes residual_intensity;  ///< r_I [0,1]
  Lanes residual_depth;      ///< r_D [m]
  Lanes inverse_intensity;   ///< 1 / variance of r_I by the noise model
  Lanes inverse_depth;       ///< 1 / variance of r_D [1/m^2]
  Lanes weight_intensity;    ///< gamma of a pixel that is seen and stands behind nothing, else 0
  Lanes weight_depth;        ///< gamma of a valid residual, else 0
  Lanes lost;                ///< gamma of a pixel that is out of view or occluded, else 0
  Lanes I[3], D[3];          ///< the a of both rows of the Jacobian
  Lanes X[3];                ///< point in the reference
  Lanes current;             ///< I_c(u)
  Mask selected, valid, valid_depth, out_of_view, occluded, disoccluded, masked;
};

using WarpedLanes = BasicWarpedLanes<kLanes>;

/// Warps pixels of one reference level into one current level, n at a time.
template <int n>
class BasicWarper {
  using Lanes = BasicLanes<n>;
  using IntLanes = BasicIntLanes<n>;
  using Mask = BasicIntLanes<n>;
  using Quad = BasicQuad<n>;

 public:
  /// \param gate_factor factor of the occlusion gate at this level, kGateGrowth^(levels above the finest)
  /// \param background weight of the pixels of `current` when it has no plane of weights
  /// \param rows_of_current give the rows of the Jacobian by the gradients of the current image alone
  BasicWarper(const PyramidLevel& current, const Pose& T_current_reference, const Illumination& light, const WarpOptions& options,
              float gate_factor, float background, bool rows_of_current = false)
      : texture_(current.texture.data()),
        gamma_(current.gamma.view().data),
        gamma_row_(static_cast<float>(current.gamma.view().stride)),
        width_(current.intensity.width()),
        fx_(static_cast<float>(current.camera.fx)),
        fy_(static_cast<float>(current.camera.fy)),
        cx_(static_cast<float>(current.camera.cx)),
        cy_(static_cast<float>(current.camera.cy)),
        u_max_(static_cast<float>(current.intensity.width() - 2)),
        v_max_(static_cast<float>(current.intensity.height() - 2)),
        row_(static_cast<float>(2 * current.intensity.width())),
        z_near_(kNear),
        gate_(options.gate > 0 ? options.gate * gate_factor : 1e30F),
        gate_relative_(options.gate > 0 ? kGateRelative * gate_factor : 0.0F),
        spread_(kDepthSpread),
        background_(background),
        gain_(light.gain),
        offset_(light.offset),
        esm_(options.esm),
        rows_of_current_(rows_of_current) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R_[i][j] = static_cast<float>(T_current_reference(i, j));
      t_[i] = static_cast<float>(T_current_reference(i, 3));
    }
  }

  /// The same with other lanes.
  template <int m>
  APSO_INLINE explicit BasicWarper(const BasicWarper<m>& o)
      : texture_(o.texture_),
        gamma_(o.gamma_),
        gamma_row_(o.gamma_row_[0]),
        width_(o.width_),
        fx_(o.fx_[0]),
        fy_(o.fy_[0]),
        cx_(o.cx_[0]),
        cy_(o.cy_[0]),
        u_max_(o.u_max_[0]),
        v_max_(o.v_max_[0]),
        row_(o.row_[0]),
        z_near_(o.z_near_[0]),
        gate_(o.gate_[0]),
        gate_relative_(o.gate_relative_[0]),
        spread_(o.spread_[0]),
        background_(o.background_[0]),
        gain_(o.gain_[0]),
        offset_(o.offset_[0]),
        esm_(o.esm_),
        rows_of_current_(o.rows_of_current_) {
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R_[i][j] = o.R_[i][j][0];
      t_[i] = o.t_[i][0];
    }
  }

  /// \param noise weighs the residuals
  /// \param block of a PixelList; `at` < kBlock, a multiple of n
  template <class Noise>
  APSO_INLINE void warp(const Noise& noise, const float* block, int at, BasicWarpedLanes<n>& o) const {
    using P = PixelList;
    const auto field = [&](P::Field f) { return Lanes::load(block + f * P::kBlock + at); };
    const Lanes zero = 0.0F;
    o.X[0] = field(P::kX);
    o.X[1] = field(P::kY);
    o.X[2] = field(P::kZ);
    const Lanes gamma = field(P::kGamma);
    const Lanes Y0 = R_[0][0] * o.X[0] + R_[0][1] * o.X[1] + R_[0][2] * o.X[2] + t_[0];
    const Lanes Y1 = R_[1][0] * o.X[0] + R_[1][1] * o.X[1] + R_[1][2] * o.X[2] + t_[1];
    const Lanes Y2 = R_[2][0] * o.X[0] + R_[2][1] * o.X[1] + R_[2][2] * o.X[2] + t_[2];
    o.selected = gamma > zero;
    const Mask ahead = Y2 > z_near_;
    const Lanes iz = 1.0F / select(ahead, Y2, 1.0F);
    Lanes u = fx_ * (Y0 * iz) + cx_;
    Lanes v = fy_ * (Y1 * iz) + cy_;
    // written so that NaN is out of view
    const Mask inside = ahead & (u >= Lanes(1.0F)) & (v >= Lanes(1.0F)) & (u <= u_max_) & (v <= v_max_);
    u = select(inside, u, 1.0F);
    v = select(inside, v, 1.0F);
    const Lanes x = to_float(to_int(u));
    const Lanes y = to_float(to_int(v));
    const Lanes a = u - x;
    const Lanes b = v - y;
    const IntLanes offset = to_int(y * row_ + (x + x));        // exact: an image has less than 2^23 pixels
    const Quad p = load_quads(texture_, offset);               // I Z I Z of the upper two pixels
    const Quad q = load_quads(texture_ + 2 * width_, offset);  // and of the lower two
    const Lanes top = p.c[2] - p.c[0];
    const Lanes bottom = q.c[2] - q.c[0];
    const Lanes upper = p.c[0] + a * top;
    const Lanes lower = q.c[0] + a * bottom;
    o.current = upper + b * (lower - upper);
    const Lanes upper_z = p.c[1] + a * (p.c[3] - p.c[1]);
    const Lanes lower_z = q.c[1] + a * (q.c[3] - q.c[1]);
    const Lanes Z = upper_z + b * (lower_z - upper_z);
    const Lanes least = min(min(p.c[1], p.c[3]), min(q.c[1], q.c[3]));
    const Lanes most = max(max(p.c[1], p.c[3]), max(q.c[1], q.c[3]));
    const Mask left = a < Lanes(0.5F);
    const Lanes nearest = select(b < Lanes(0.5F), select(left, p.c[1], p.c[3]), select(left, q.c[1], q.c[3]));

    Lanes weight = gamma * background_;
    if (gamma_ != nullptr) {
      const Lanes nearest_x = to_float(to_int(u + 0.5F));
      const Lanes nearest_y = to_float(to_int(v + 0.5F));
      weight = gamma * gather(gamma_, to_int(nearest_y * gamma_row_ + nearest_x));  // exact as well
    }
    const Mask weighted = inside & (weight > zero);
    const Lanes gap = nearest - Y2;
    const Lanes gate = max(gate_, gate_relative_ * Y2);
    const Mask gated = weighted & (nearest > zero) & (abs(gap) > gate);
    o.out_of_view = o.selected & !inside;
    o.masked = o.selected & inside & !weighted;
    o.occluded = gated & (gap < zero);
    o.disoccluded = gated & !(gap < zero);
    o.valid = weighted & !gated;
    // behind an edge the pixel shows part of what is in front
    const Lanes gi2 = field(P::kGradient2);
    o.weight_intensity = select(o.valid & (gi2 >= zero), weight, 0.0F);
    const Lanes gz2 = field(P::kDepthGradient2);
    o.valid_depth = o.valid & (least > zero) & (most - least <= spread_ * least) & (gz2 >= zero);
    o.weight_depth = select(o.valid_depth, weight, 0.0F);
    o.lost = select(o.out_of_view, gamma, select(gated, weight, 0.0F));
    o.residual_intensity = select(o.valid, o.current - (gain_ * field(P::kIntensity) + offset_), 0.0F);
    o.residual_depth = select(o.valid_depth, Z - Y2, 0.0F);
    o.I[0] = field(P::kI0);
    o.I[1] = field(P::kI1);
    o.I[2] = field(P::kI2);
    o.D[0] = field(P::kD0);
    o.D[1] = field(P::kD1);
    o.D[2] = field(P::kD2);
    // the gradients once more from the rows of the Jacobian: a_0 = f_x/Z g_x, a_1 = f_y/Z g_y
    o.inverse_intensity =
        noise.squared_weight_intensity(NoiseInput<Lanes>{o.residual_intensity, gi2, Z, Y2, o.I[0], o.I[1], o.X[2], fx_, fy_});
    o.inverse_depth = noise.squared_weight_depth(NoiseInput<Lanes>{o.residual_depth, gz2, Z, Y2, o.D[0], o.D[1], o.X[2], fx_, fy_});
    if (!esm_ && !rows_of_current_) return;
    const auto row = [&](const Lanes& du, const Lanes& dv, Lanes(&to)[3], const Lanes& e_z) {  // R^T (J_pi^T grad - e_z)
      const Lanes c0 = du * (fx_ * iz);
      const Lanes c1 = dv * (fy_ * iz);
      const Lanes c2 = Lanes(0.0F) - (c0 * Y0 + c1 * Y1) * iz - e_z;
      for (int i = 0; i < 3; ++i) to[i] = R_[0][i] * c0 + R_[1][i] * c1 + R_[2][i] * c2;
    };
    Lanes current[3];
    row(top + b * (bottom - top), lower - upper, current, zero);
    for (int i = 0; i < 3; ++i) {
      const Lanes seen = select(o.valid, current[i], o.I[i]);
      o.I[i] = rows_of_current_ ? seen : 0.5F * (o.I[i] + seen);
    }
    if (!rows_of_current_) return;
    const Lanes top_z = p.c[3] - p.c[1];
    row(top_z + b * (q.c[3] - q.c[1] - top_z), lower_z - upper_z, current, Lanes(1.0F));
    for (int i = 0; i < 3; ++i) o.D[i] = select(o.valid_depth, current[i], zero);
  }
  [[nodiscard]] bool rows_of_current() const { return rows_of_current_; }

 private:
  template <int m>
  friend class BasicWarper;

  static constexpr float kNear = 0.1F;           // warped points nearer than this are out of view [m]
  static constexpr float kGateRelative = 0.03F;  // gate as a share of the depth, where that is the larger
  static constexpr float kDepthSpread = 0.05F;   // largest relative difference of four depths that are interpolated

  const float* texture_;
  const float* gamma_;
  Lanes gamma_row_;
  int width_;
  Lanes R_[3][3], t_[3];
  Lanes fx_, fy_, cx_, cy_, u_max_, v_max_, row_, z_near_, gate_, gate_relative_, spread_, background_, gain_, offset_;
  bool esm_, rows_of_current_;
};
using Warper = BasicWarper<kLanes>;

/// One warper for either number of lanes that the processor may have.
class Warpers {
 public:
  Warpers(const Warper& warper) : narrow_(warper), wide_(warper) {}  // NOLINT: all that takes these takes a Warper as well
  template <int n>
  [[nodiscard]] APSO_INLINE const BasicWarper<n>& with() const {
    if constexpr (n == kLanes) return narrow_;
    else return wide_;
  }

 private:
  Warper narrow_;
  BasicWarper<kWideLanes> wide_;
};

APSO_NAMESPACE_END
