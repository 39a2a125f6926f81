/// \file
/// How noisy a photometric and a depth residual are: the pixel-specific weights w_I^p and w_D^p of the paper's eq. (15), which
/// leaves them open.
///
/// A noise model is a struct with two functions, written once for a number and for several, BasicLanes<n>:
///
/// \code
/// struct ConstantNoise {
///   template <class T> T squared_weight_intensity(const apso::NoiseInput<T>&) const { return T(1 / (.02 * .02)); }
///   template <class T> T squared_weight_depth(const apso::NoiseInput<T>& p) const { return T(1 / (.01 * .01)) / (p.z_current *
///   p.z_current); }
/// };
/// \endcode
///
/// BasicDirectAligner takes such a struct. A residual times its weight is of the size of 1: a number of standard deviations.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>
#include <utility>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>
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
  float sigma_intensity = 4.0F / 255.0F;  ///< noise of one intensity, [0,1] scale; 4 grey levels of 255 are those of a Kinect
  float sigma_pixel = 0.3F;               ///< uncertainty of the position looked at [px]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("form", s.form);
    v("sigma_intensity", s.sigma_intensity, 1e-6F, 1.0F);
    v("sigma_pixel", s.sigma_pixel, 0.0F, 10.0F);
  }
};

/// What is known about a warped pixel when its residual is weighed. The gradient is that of the reference.
template <class T>
struct NoiseInput {
  T residual;             ///< r_I [0,1] or r_D [m]
  T gradient2;            ///< |grad I|^2 [1/px^2] or |grad Z|^2 [m^2/px^2]; < 0 where there is none to go by
  T z_current;            ///< depth that was looked up, Z_c(u) [m]
  T z_warped;             ///< depth of the warped point, Y_z [m]
  T row_x, row_y;         ///< first two elements of the row of the Jacobian, f/Z times the gradient
  T z_reference, fx, fy;  ///< depth of the point in its own frame [m]; focal lengths [px]
  [[nodiscard]] T gradient_x() const { return row_x * (z_reference / fx); }  ///< [1/px] or [m/px]
  [[nodiscard]] T gradient_y() const { return row_y * (z_reference / fy); }
};

/// The noise models of NoiseOptions.
struct NoiseModel {
  NoiseModel() : NoiseModel(NoiseOptions{}) {}
  explicit NoiseModel(const NoiseOptions& o)
      : form(o.form), intensity_variance(2 * o.sigma_intensity * o.sigma_intensity), pixel_variance(o.sigma_pixel * o.sigma_pixel) {}

  NoiseForm form;
  float intensity_variance;  ///< of the difference of two intensities
  float pixel_variance;      ///< [px^2]

  /// (w_I)^2. Sensor: 1 / (2 sigma_I^2 + (|grad I| sigma_px)^2). StaticFusion: 1 / (1 + 10 (|r_I| + |dI/du| + |dI/dv|)).
  template <class T>
  [[nodiscard]] T squared_weight_intensity(const NoiseInput<T>& p) const {
    using std::abs;
    using std::max;
    if (form == NoiseForm::Sensor) return T(1) / (T(intensity_variance) + T(pixel_variance) * max(p.gradient2, T(0)));
    return T(1) / (T(1) + T(10) * (abs(p.residual) + abs(p.gradient_x()) + abs(p.gradient_y())));
  }
  /// (w_D)^2. Sensor: 1 / (sigma_Z(Z_c)^2 + sigma_Z(Y_z)^2 + (|grad Z| sigma_px)^2) [1/m^2]. StaticFusion, divided by its largest
  /// value: 0.01 / (0.01 + 200 (|r_D| + |dZ/du| + |dZ/dv|)).
  template <class T>
  [[nodiscard]] T squared_weight_depth(const NoiseInput<T>& p) const {
    using std::abs;
    using std::max;
    if (form == NoiseForm::Sensor) {
      const T a = max(T(kDepthNoise) * p.z_current * p.z_current, T(kDepthNoiseFloor));
      const T b = max(T(kDepthNoise) * p.z_warped * p.z_warped, T(kDepthNoiseFloor));
      return T(1) / (a * a + b * b + T(pixel_variance) * max(p.gradient2, T(0)));
    }
    return T(0.01F) / (T(0.01F) + T(200) * (abs(p.residual) + abs(p.gradient_x()) + abs(p.gradient_y())));
  }
};

namespace detail {
template <class N, class T, class = void>
struct has_squared_weight_intensity : std::false_type {};
template <class N, class T>
struct has_squared_weight_intensity<
    N, T,
    std::enable_if_t<
        std::is_convertible_v<decltype(std::declval<const N&>().squared_weight_intensity(std::declval<const NoiseInput<T>&>())), T>>>
    : std::true_type {};
template <class N, class T, class = void>
struct has_squared_weight_depth : std::false_type {};
template <class N, class T>
struct has_squared_weight_depth<N, T,
                                std::enable_if_t<std::is_convertible_v<
                                    decltype(std::declval<const N&>().squared_weight_depth(std::declval<const NoiseInput<T>&>())), T>>>
    : std::true_type {};
}  // namespace detail

/// Says at compile time what a type lacks to be a noise model.
template <class N>
constexpr void check_noise_model() {
  using Wide = BasicLanes<kWideLanes>;
  static_assert(detail::has_squared_weight_intensity<N, Lanes>::value && detail::has_squared_weight_intensity<N, Wide>::value,
                "apso: a noise model needs `template <class T> T squared_weight_intensity(const apso::NoiseInput<T>&) const`, 1 / variance "
                "of the photometric residual, for T = apso::BasicLanes<n>");
  static_assert(detail::has_squared_weight_depth<N, Lanes>::value && detail::has_squared_weight_depth<N, Wide>::value,
                "apso: a noise model needs `template <class T> T squared_weight_depth(const apso::NoiseInput<T>&) const`, 1 / variance "
                "of the depth residual [1/m^2], for T = apso::BasicLanes<n>");
}

APSO_NAMESPACE_END
