/// \file
/// Settings of direct alignment, and presets of them.
#pragma once

#include <apso/config.hpp>
#include <apso/math/kernels.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/options.hpp>
#include <apso/refinement/cost/noise_model.hpp>
#include <apso/refinement/cost/residuals.hpp>
#include <apso/refinement/cost/scale/term_scales.hpp>

APSO_NAMESPACE_BEGIN

struct AlignmentOptions {
  RobustKernel kernel;                               ///< C of the cost
  bool graduated = false;                            ///< Tukey at the finest level, `kernel` before
  ScaleKind scale = ScaleKind::Mad;                  ///< how the spread of the residuals is measured
  ScaleCoupling coupling = ScaleCoupling::Separate;  ///< of which residuals
  double scale_floor = 0.25;  ///< smallest scale at the finest level, in units of the noise model: below it, the model is
                              ///< too pessimistic; 0.25 at coarser levels; 0 = none at any level
  double alpha = 2;           ///< photometric against depth term at the finest level: depth gives basin, intensity
                              ///< precision; with noisy, badly registered depth rather 4
  double alpha_coarse = 1;    ///< the same at coarser levels
  AlphaPlace alpha_place = AlphaPlace::Outside;
  bool illumination = true;             ///< gain and offset of the brightness are estimated per reference; false: eq. (13) as printed
  double min_valid_share = 0.2;         ///< a smaller share of valid ones of the pixels not masked is NoOverlap; half of it will do
                                        ///< where the intensities correlate by 0.9
  bool depth_alone = false;             ///< a current image that is all white or black is no failure: depth decides
  bool prealign_rotation = true;        ///< photometric rotation-only search at the coarsest level
  double multi_start_threshold = 0.12;  ///< share of what both images show, at about 80x60, from which on what contradicts the pose
                                        ///< makes alignment restart from other poses; 0 = always, 1 = never. Frames that are mostly
                                        ///< masked restart unless it is 1
  bool regions = true;                  ///< tiles that move on their own count less (region_labels.hpp)
  WarpOptions warp;
  NoiseOptions noise;

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("kernel", s.kernel);
    v("graduated", s.graduated);
    v("scale", s.scale);
    v("coupling", s.coupling);
    v("scale_floor", s.scale_floor, 0.0, 1e4);
    v("alpha", s.alpha, 0.0, 1e4);
    v("alpha_coarse", s.alpha_coarse, 0.0, 1e4);
    v("alpha_place", s.alpha_place);
    v("illumination", s.illumination);
    v("min_valid_share", s.min_valid_share, 0.0, 1.0);
    v("depth_alone", s.depth_alone);
    v("prealign_rotation", s.prealign_rotation);
    v("multi_start_threshold", s.multi_start_threshold, 0.0, 1.0);
    v("regions", s.regions);
    v("warp", s.warp);
    v("noise", s.noise);
  }
};

/// For every pixel at full size (PyramidOptions: finest = 0, max_pixels = 0), where the depth of so many pixels is
/// the more exact of the two: it weighs a little more, and scales as small as the images allow.
[[nodiscard]] inline AlignmentOptions dense_alignment() {
  AlignmentOptions o;
  o.alpha = 0.85;
  o.scale_floor = 0.03;
  return o;
}

/// The cost of StaticFusion (Scona et al., ICRA 2018) without its cluster weights: its pixel weights, alpha_I = 0.15, and Cauchy with
/// half of the mean residual. With one mean for each kind of residual, which converges from farther away than with one for both.
[[nodiscard]] inline AlignmentOptions static_fusion_alignment() {
  AlignmentOptions o;
  o.kernel.kind = KernelKind::Cauchy;
  o.kernel.k = 0.5;
  o.scale = ScaleKind::MeanAbs;
  o.scale_floor = 0;
  o.alpha = o.alpha_coarse = 0.15;
  o.noise.form = NoiseForm::StaticFusion;
  o.illumination = false;
  o.regions = false;
  return o;
}

/// Equations (13) to (16) as they are printed, as far as they concern one alignment: no brightness in (13), no gate in (14), alpha_I
/// inside C in (15), and no label of a region beside the gamma of (16). What the paper leaves open, w_I, w_D, alpha_I and C, it says to
/// take from StaticFusion: its weights, and one mean residual for both kinds. One start, no other: the paper has no search.
[[nodiscard]] inline AlignmentOptions paper_alignment() {
  AlignmentOptions o = static_fusion_alignment();
  o.coupling = ScaleCoupling::Joint;
  o.alpha_place = AlphaPlace::Inside;
  o.warp.gate = 0;
  o.prealign_rotation = false;
  o.multi_start_threshold = 1;
  return o;
}

APSO_NAMESPACE_END
