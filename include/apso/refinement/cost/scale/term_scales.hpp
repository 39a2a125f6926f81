/// \file
/// How the two residuals of a pixel are brought to one measure: robust scales, and the paper's alpha_I.
#pragma once

#include <array>
#include <cmath>

#include <apso/config.hpp>
#include <apso/refinement/cost/kernel_loop.hpp>

APSO_NAMESPACE_BEGIN

/// Where alpha_I stands in the cost of a pixel.
enum class AlphaPlace {
  Outside,  ///< alpha^2 C(s_I) + C(s_D): alpha weighs the two terms and leaves the corner of the kernel where it is
  Inside,   ///< C(alpha s_I) + C(s_D), as eq. (15) is printed
};
constexpr std::array<const char*, 2> enum_names(AlphaPlace) { return {"outside", "inside"}; }

/// What the spread of the residuals is measured for.
enum class ScaleCoupling {
  Separate,    ///< one robust scale for each kind of residual
  Joint,       ///< one for both kinds together (StaticFusion)
  BivariateT,  ///< the covariance of both under a bivariate t distribution, which is the kernel then (DVO, Kerl et al. 2013)
};
constexpr std::array<const char*, 3> enum_names(ScaleCoupling) { return {"separate", "joint", "bivariate_t"}; }

/// Factors that are the same for all pixels of one reference at one level.
struct TermScales {
  double scale_intensity = 1;  ///< robust scale of the photometric residuals, in units of the noise model
  double scale_depth = 1;      ///< robust scale of the depth residuals, in units of the noise model
  double alpha = 1;            ///< photometric term against depth term
  AlphaPlace place = AlphaPlace::Outside;
  ScaleCoupling coupling = ScaleCoupling::Separate;
  double slope = 0;  ///< BivariateT: photometric residual that goes with a depth residual of 1, both in units of the noise
                     ///< model; scale_intensity is the spread about it

  /// Factor on C of the photometric residual.
  [[nodiscard]] double term_weight() const { return place == AlphaPlace::Inside ? 1.0 : alpha * alpha; }
  /// Factor on the square of the photometric residual inside C.
  [[nodiscard]] double inner_weight() const { return place == AlphaPlace::Inside ? alpha * alpha : 1.0; }
  /// What both terms of a pixel of weight 1 add to the divisor of the mean cost.
  [[nodiscard]] double both() const { return 1.0 + term_weight(); }
  /// Cost of a pixel without residuals: as if both were 3 standard deviations.
  [[nodiscard]] double charge(const KernelRef& kernel) const {
    if (place == AlphaPlace::Inside) return kernel.rho(3.0) + kernel.rho(3.0 * alpha);
    return both() * kernel.rho(3.0);
  }
};

APSO_NAMESPACE_END
