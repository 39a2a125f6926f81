/// \file
/// Dense alignment of two small RGB-D frames, and what it leaves unexplained per pixel.
///
/// Pixels p of the current frame are warped into a past one:
///     X = Z(p) K^-1 (p,1),  Y = T_past_current X,  u = pi(Y),  r_I = I_past(u) - I(p),  r_D = Z_past(u) - Y_z
/// so residuals belong to pixels of the current frame, where the mask is wanted. A left increment d = (v, w) changes a
/// residual by dr/dd = (a, Y x a), with a = J_pi^T grad I_past for r_I and a = J_pi^T grad Z_past - e_z for r_D.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/status.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// One pixel warped into the past frame.
struct WarpedPixel {
  Eigen::Vector3f Y;            ///< point in the past camera [m]
  float r_intensity = 0;        ///< I_past(u) - I(p)
  float r_depth = 0;            ///< Z_past(u) - Y_z [m]; positive: the point is in front of what was seen then
  Eigen::Vector3f a_intensity;  ///< derivative of r_intensity by Y [1/m]
  Eigen::Vector3f a_depth;      ///< derivative of r_depth by Y
  float sigma_intensity = 1;    ///< expected spread of r_intensity
  float sigma_depth = 1;        ///< expected spread of r_depth [m]
};

/// Warps pixel (x,y). False where it has no depth, leaves the view, or falls on an edge or hole of the past depth.
[[nodiscard]] inline bool warp_pixel(const SmallFrame& current, int x, int y, const SmallFrame& past, const Pinhole& camera,
                                     const FloatPose& T_past_current, WarpedPixel& out) {
  constexpr float kSigmaIntensity = 0.03F;  // noise of the difference of two intensities, with what interpolation adds
  constexpr float kSigmaPixel = 0.3F;       // error of the position, which counts by the gradient [small px]
  const float z = current.depth(x, y);
  if (!(z > 0)) return false;
  const auto fx = static_cast<float>(camera.fx);
  const auto fy = static_cast<float>(camera.fy);
  const auto cx = static_cast<float>(camera.cx);
  const auto cy = static_cast<float>(camera.cy);
  out.Y = T_past_current((static_cast<float>(x) - cx) / fx * z, (static_cast<float>(y) - cy) / fy * z, z);
  if (!(out.Y.z() > 0.05F)) return false;
  const float iz = 1.0F / out.Y.z();
  const float u = fx * out.Y.x() * iz + cx;
  const float v = fy * out.Y.y() * iz + cy;
  const int w = past.depth.width();
  const int h = past.depth.height();
  if (!(u >= 0 && v >= 0 && u < static_cast<float>(w - 1) && v < static_cast<float>(h - 1))) return false;
  const int i = static_cast<int>(u);
  const int j = static_cast<int>(v);
  const float a = u - static_cast<float>(i);
  const float b = v - static_cast<float>(j);
  const auto sample = [&](const Image<float>& image, float& value, float& gx, float& gy) {
    const float* r0 = image.row(j) + i;
    const float* r1 = image.row(j + 1) + i;
    const float top = r0[0] + a * (r0[1] - r0[0]);
    const float bottom = r1[0] + a * (r1[1] - r1[0]);
    value = top + b * (bottom - top);
    gx = (1 - b) * (r0[1] - r0[0]) + b * (r1[1] - r1[0]);
    gy = bottom - top;
  };
  const float* d0 = past.depth.row(j) + i;
  const float* d1 = past.depth.row(j + 1) + i;
  const float lo = std::min(std::min(d0[0], d0[1]), std::min(d1[0], d1[1]));
  const float hi = std::max(std::max(d0[0], d0[1]), std::max(d1[0], d1[1]));
  if (!(lo > 0) || hi - lo > 0.1F * lo) return false;
  float Z = 0, zx = 0, zy = 0, I = 0, gx = 0, gy = 0;
  sample(past.depth, Z, zx, zy);
  sample(past.intensity, I, gx, gy);
  out.r_intensity = I - current.intensity(x, y);
  out.r_depth = Z - out.Y.z();
  const auto chain = [&](float du, float dv) {
    return Eigen::Vector3f(du * fx * iz, dv * fy * iz, -(du * fx * out.Y.x() + dv * fy * out.Y.y()) * iz * iz);
  };
  out.a_intensity = chain(gx, gy);
  out.a_depth = chain(zx, zy);
  out.a_depth.z() -= 1.0F;
  const float s = 1.41421356F * depth_sigma(std::max(Z, out.Y.z())) + 0.005F;
  out.sigma_intensity = std::sqrt(kSigmaIntensity * kSigmaIntensity + kSigmaPixel * kSigmaPixel * (gx * gx + gy * gy));
  out.sigma_depth = std::sqrt(s * s + kSigmaPixel * kSigmaPixel * (zx * zx + zy * zy));
  return true;
}

struct LowResAlignment {
  Status status = Status::NotRun;
  Pose T_past_current = identity_pose();  ///< the prior unless succeeded(status)
  int points = 0;                         ///< that took part in the last step
};

/// Gauss-Newton on both residuals with Cauchy weights, the prior as a Gaussian, so that directions without structure
/// stay at the prior.
/// \param weight per pixel of the current frame, [0,1]; null = all 1
/// \param iterations Gauss-Newton steps
/// \param scratch residuals, to keep warm calls free of allocations
inline LowResAlignment align_low_res(const SmallFrame& current, const SmallFrame& past, const Pinhole& camera,
                                     const Pose& T_past_current_prior, const Image<float>* weight, int iterations,
                                     std::vector<float>& scratch) {
  constexpr int kStride = 2;                  // every second row and column takes part
  constexpr float kDepthGate = 0.3F;          // larger differences of depth take no part [m]
  constexpr double kSigmaTranslation = 0.03;  // standard deviation of the prior [m]
  constexpr double kSigmaRotation = 0.015;    // standard deviation of the prior [rad]
  constexpr int kIndependent = 300;           // the residuals count as this many independent ones (they are correlated)
  constexpr int kMinPoints = 100;             // fewer than this leave the prior as it is
  LowResAlignment result;
  result.T_past_current = T_past_current_prior;
  Matrix6 prior = zeros<Matrix6>();
  for (int k = 0; k < 3; ++k) {
    prior(k, k) = 1.0 / (kSigmaTranslation * kSigmaTranslation);
    prior(k + 3, k + 3) = 1.0 / (kSigmaRotation * kSigmaRotation);
  }
  const int w = current.depth.width();
  const int h = current.depth.height();
  Pose T = T_past_current_prior;
  float scale = 3.0F;  // of the residuals in standard deviations; wide at first, since the prior may be off
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const FloatPose warp(T);
    float H[6][6] = {};  // lower triangle
    float g[6] = {};
    int n = 0;
    scratch.clear();
    WarpedPixel p;
    for (int y = kStride / 2; y < h; y += kStride) {
      for (int x = kStride / 2; x < w; x += kStride) {
        const float given = weight != nullptr ? (*weight)(x, y) : 1.0F;
        if (!(given > 0)) continue;
        if (!warp_pixel(current, x, y, past, camera, warp, p) || std::abs(p.r_depth) > kDepthGate) continue;
        ++n;
        const auto add = [&](float r, const Eigen::Vector3f& a, float sigma) {
          const float s = r / sigma;
          scratch.push_back(std::abs(s));
          const float c = s / (2.3849F * scale);  // Cauchy constant of 95 % efficiency
          const float omega = given / ((1.0F + c * c) * sigma * sigma);
          const Eigen::Vector3f m = cross(p.Y, a);
          add_row({a.x(), a.y(), a.z(), m.x(), m.y(), m.z()}, omega, r, H, g);
        };
        add(p.r_intensity, p.a_intensity, p.sigma_intensity);
        add(p.r_depth, p.a_depth, p.sigma_depth);
      }
    }
    result.points = n;
    if (n < kMinPoints) {
      result.status = Status::TooFewPixels;
      result.T_past_current = T_past_current_prior;
      return result;
    }
    scale = std::clamp(1.4826F * upper_median(scratch), 1.0F, 6.0F);
    const double count = static_cast<double>(kIndependent) / (2.0 * n);
    Matrix6 A = prior;
    Twist b = prior * se3_log(compose(T, inverse(T_past_current_prior)));
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j <= i; ++j) A(i, j) += count * static_cast<double>(H[i][j]);
      b(i) += count * static_cast<double>(g[i]);
    }
    const Twist step = -solve_symmetric(A, b);
    if (!all_finite(step) || norm(step) > 0.5) {
      result.status = Status::Diverged;
      result.T_past_current = T_past_current_prior;
      return result;
    }
    T = normalized(compose(se3_exp(step), T));
    result.status = Status::MaxIterations;
    if (norm(step) < 1e-5) {
      result.status = Status::Converged;
      break;
    }
  }
  result.T_past_current = T;
  return result;
}

APSO_NAMESPACE_END
