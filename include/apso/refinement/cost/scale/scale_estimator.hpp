/// \file
/// Robust scales, brightness and correlation of one reference, from some of its pixels.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/refinement/alignment_options.hpp>
#include <apso/refinement/cost/cost_term.hpp>
#include <apso/refinement/cost/illumination.hpp>
#include <apso/refinement/cost/scale/residual_samples.hpp>
#include <apso/refinement/cost/warped_pixels.hpp>

APSO_NAMESPACE_BEGIN

/// Estimates what the residuals of a term are divided by. Keeps its buffers; the same for any executor.
class ScaleEstimator {
 public:
  /// Before the terms of a pass.
  void begin() { standardised_.clear(); }

  /// Scales and brightness of a term are kept unless one of them differs by more than `tolerated`.
  /// \param most pixels looked at
  /// \param floor smallest scale
  /// \return whether they were changed
  bool operator()(CostTerm& t, const Warper& warper, const NoiseRef& noise, const AlignmentOptions& options, int most, double floor,
                  double tolerated, const ExecutorRef& executor) {
    const auto sigma = static_cast<double>(options.noise.sigma_intensity);
    samples_.take(t.level->pixels, warper, noise, most, options.coupling == ScaleCoupling::BivariateT, executor);
    samples_.estimate(options.scale, executor);
    Illumination light = t.light;
    executor(2, [&](int task) {
      if (task == 0) {
        if (options.illumination && samples_.pairs.size() >= 32) {
          SampledResiduals& s = samples_.intensity;
          fit_illumination(samples_.pairs, floor, s.residuals, s.scratch(), light);
          s.scratch() = s.residuals;
          s.scale = robust_scale_in_place(options.scale, s.scratch());
        }
      } else {
        t.correlation = intensity_correlation(samples_.pairs, sigma, options.depth_alone);
      }
    });
    const TermScales found = samples_.scales(options.scale, floor, t.scales);
    const auto differs = [&](double a, double b) { return std::abs(a - b) > tolerated * std::min(a, b); };
    const double brighter =
        std::abs(0.5 * static_cast<double>(light.gain - t.light.gain) + static_cast<double>(light.offset - t.light.offset));
    const bool changed = differs(found.scale_intensity, t.scales.scale_intensity) || differs(found.scale_depth, t.scales.scale_depth) ||
                         brighter > tolerated * sigma * found.scale_intensity;
    if (changed) {
      t.scales = found;
      t.light = light;
    }
    return changed;
  }

  /// Keeps the residuals that were looked at last, in units of their scales, for adaptive_alpha.
  void keep_standardised(const TermScales& scales) {
    for (const float r : samples_.intensity.residuals) standardised_.push_back(r / static_cast<float>(scales.scale_intensity));
    for (const float r : samples_.depth.residuals) standardised_.push_back(r / static_cast<float>(scales.scale_depth));
  }
  /// The alpha of Barron's family for what was kept since begin().
  [[nodiscard]] double adaptive_alpha(double k) { return adaptive_alpha_(standardised_, k); }

 private:
  ResidualSamples samples_;
  AdaptiveAlpha adaptive_alpha_;
  std::vector<float> standardised_;  // residuals of all references
};

APSO_NAMESPACE_END
