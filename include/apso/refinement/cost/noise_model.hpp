/// \file
/// How noisy a photometric and a depth residual are: the pixel-specific weights of the paper's eq. (direct
/// optimization approach), which leaves them open.
#pragma once

#include <array>
#include <cmath>

#include <apso/config.hpp>
#include <apso/options.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

enum class NoiseForm {
  Sensor,        ///< standard deviation from sensor noise and the image gradient
  StaticFusion,  ///< weights that fall with residual and gradient (Scona et al., ICRA 2018)
};
constexpr std::array<const char*, 2> enum_names(NoiseForm) { return {"sensor", "static_fusion"}; }

struct NoiseOptions {
  NoiseForm form = NoiseForm::Sensor;
  float sigma_intensity = 4.0F / 255.0F;  ///< noise of one intensity, [0,1] scale
  float sigma_pixel = 0.3F;               ///< uncertainty of the position looked at [px]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("form", s.form);
    v("sigma_intensity", s.sigma_intensity, 1e-6F, 1.0F);
    v("sigma_pixel", s.sigma_pixel, 0.0F, 10.0F);
  }
};

/// Standard deviation of a photometric residual: sqrt(2 sigma_I^2 + (|grad I| sigma_px)^2).
[[nodiscard]] inline float intensity_sigma(const NoiseOptions& o, float gx, float gy) {
  return std::sqrt(2 * o.sigma_intensity * o.sigma_intensity + (gx * gx + gy * gy) * o.sigma_pixel * o.sigma_pixel);
}
/// Standard deviation of a depth residual [m]: sensor noise of both depths and the gradient [m/px].
[[nodiscard]] inline float depth_residual_sigma(const NoiseOptions& o, float z_current, float z_warped, float gx, float gy) {
  const float a = depth_sigma(z_current);
  const float b = depth_sigma(z_warped);
  return std::sqrt(a * a + b * b + (gx * gx + gy * gy) * o.sigma_pixel * o.sigma_pixel);
}
/// Weight of a photometric residual in the form of StaticFusion, in (0,1].
[[nodiscard]] inline float static_fusion_weight_intensity(float r, float gx, float gy) {
  return std::sqrt(1.0F / (1.0F + 10.0F * (std::abs(r) + std::abs(gx) + std::abs(gy))));
}
/// Weight of a depth residual in the form of StaticFusion, divided by its largest value 10; in (0,1].
[[nodiscard]] inline float static_fusion_weight_depth(float r, float gx, float gy) {
  return 0.1F * std::sqrt(1.0F / (0.01F + 200.0F * (std::abs(r) + std::abs(gx) + std::abs(gy))));
}

APSO_NAMESPACE_END
