/// \file
/// Settings of direct alignment, and presets of them.
#pragma once

#include <apso/config.hpp>
#include <apso/math/kernels.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/options.hpp>
#include <apso/refinement/cost/noise_model.hpp>
#include <apso/refinement/cost/region_labels.hpp>
#include <apso/refinement/cost/residuals.hpp>

APSO_NAMESPACE_BEGIN

/// One number per pyramid level, finest first; the last one holds for all coarser levels.
struct LevelSchedule {
  double finest = 0;
  double second = 0;
  double third = 0;
  double coarser = 0;
  [[nodiscard]] double at(int level) const {
    return level <= 0 ? finest : (level == 1 ? second : (level == 2 ? third : coarser));
  }
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("finest", s.finest, 0.0, 1e4);
    v("second", s.second, 0.0, 1e4);
    v("third", s.third, 0.0, 1e4);
    v("coarser", s.coarser, 0.0, 1e4);
  }
};

struct AlignmentOptions {
  RobustKernel kernel;                     ///< C of the cost
  bool graduated = false;                  ///< Tukey at the finest level, `kernel` before
  ScaleKind scale = ScaleKind::Mad;        ///< how the spread of the residuals is measured
  LevelSchedule scale_floor{0.25, 0.25, 0.25, 0.25};  ///< smallest scale, in units of the noise model
  int scale_samples = 1024;                ///< pixels looked at for the scale; twice as many for the final one
  double scale_change = 0.2;               ///< relative change of a scale from which the sums are made again with the new
  LevelSchedule alpha{2, 1, 1, 1};         ///< photometric against depth term at 320x240 and coarser: depth gives basin,
                                           ///< intensity precision; with noisy, badly registered depth rather {4, 2, 1, 1}
  double alpha_finer = 0.85;               ///< the same at the level more of frames that are mostly masked
  LevelSchedule iterations{8, 10, 15, 20}; ///< most outer iterations
  LevelSchedule stop_pixels{0.01, 0.03, 0.05, 0.05};  ///< a step that moves the image by less is the last one [px]
  double stop_relative_cost = 1e-4;        ///< a relative decrease below stops
  double damping = 1e-4;                   ///< start of the Levenberg-Marquardt factor; x10 on reject, /10 on accept
  int max_rejects = 5;                     ///< rejected steps in a row
  bool illumination = true;                ///< gain and offset of the brightness are estimated per reference
  double degenerate_ratio = 1e-3;          ///< eigenvalue below this share of the largest is degenerate
  double degenerate_floor = 50;            ///< eigenvalue below is degenerate
  int min_pixels = 300;                    ///< fewer valid pixels at the finest level fail
  double min_valid_share = 0.2;            ///< a smaller share of valid ones of the pixels not masked is NoOverlap
  double min_valid_share_alike = 0.1;      ///< the same where the intensities of both images correlate by `alike`
  double alike = 0.9;                      ///< correlation of the intensities of right poses, [-1,1]
  double min_correlation = 0.3;            ///< intensities of both images that agree less are NoOverlap
  bool depth_alone = false;                ///< a current image that is all white or black is no failure: depth decides
  bool prealign_rotation = true;           ///< photometric rotation-only search at the coarsest level
  int prealign_iterations = 15;
  double search_contradicted = 0.12;       ///< when images of about 80x60 contradict the pose in a larger share of what both show,
                                           ///< poses guessed from corners and surfaces are tried as well; 1 = never
  double search_masked = 0;                ///< the same for frames that are mostly masked; 0 = always
  bool check_against_guess = true;         ///< Diverged if the result is pixels away from the guess and explains the images worse
  bool per_reference_mean = false;         ///< divide each reference's term by its number of pixels
  double information_deflation = 0.01;     ///< neighbouring residuals are correlated: factor on the information
  double prior_sigma_translation = 0;      ///< motion prior towards the first candidate [m]; 0 = none
  double prior_sigma_rotation = 0;         ///< [rad]; 0 = none
  RegionOptions regions;                   ///< what moves on its own counts less
  WarpOptions warp;
  NoiseOptions noise;

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("kernel", s.kernel);
    v("graduated", s.graduated);
    v("scale", s.scale);
    v("scale_floor", s.scale_floor);
    v("scale_samples", s.scale_samples, 64, 100000000);
    v("scale_change", s.scale_change, 0.0, 100.0);
    v("alpha", s.alpha);
    v("alpha_finer", s.alpha_finer, 0.0, 1e4);
    v("iterations", s.iterations);
    v("stop_pixels", s.stop_pixels);
    v("stop_relative_cost", s.stop_relative_cost, 0.0, 1.0);
    v("damping", s.damping, 0.0, 1e3);
    v("max_rejects", s.max_rejects, 0, 20);
    v("illumination", s.illumination);
    v("degenerate_ratio", s.degenerate_ratio, 0.0, 1.0);
    v("degenerate_floor", s.degenerate_floor, 0.0, 1e12);
    v("min_pixels", s.min_pixels, 6, 100000000);
    v("min_valid_share", s.min_valid_share, 0.0, 1.0);
    v("min_valid_share_alike", s.min_valid_share_alike, 0.0, 1.0);
    v("alike", s.alike, -1.0, 1.0);
    v("min_correlation", s.min_correlation, -1.0, 1.0);
    v("depth_alone", s.depth_alone);
    v("prealign_rotation", s.prealign_rotation);
    v("prealign_iterations", s.prealign_iterations, 1, 1000);
    v("search_contradicted", s.search_contradicted, 0.0, 1.0);
    v("search_masked", s.search_masked, 0.0, 1.0);
    v("check_against_guess", s.check_against_guess);
    v("per_reference_mean", s.per_reference_mean);
    v("information_deflation", s.information_deflation, 1e-9, 1.0);
    v("prior_sigma_translation", s.prior_sigma_translation, 0.0, 1e6);
    v("prior_sigma_rotation", s.prior_sigma_rotation, 0.0, 1e6);
    v("regions", s.regions);
    v("warp", s.warp);
    v("noise", s.noise);
  }
};

/// For every pixel at full size (PyramidOptions: finest = 0, selection.max_pixels = 0), where the depth of so many pixels is
/// the more exact of the two: it weighs a little more, and scales as small as the images allow.
[[nodiscard]] inline AlignmentOptions dense_alignment() {
  AlignmentOptions o;
  o.alpha.finest = 0.85;
  o.scale_floor.finest = 0.03;
  return o;
}

/// The settings of StaticFusion (Scona et al., ICRA 2018) without its cluster weights, for comparison.
[[nodiscard]] inline AlignmentOptions static_fusion_alignment() {
  AlignmentOptions o;
  o.kernel.kind = KernelKind::Cauchy;
  o.kernel.k = 0.5;
  o.scale = ScaleKind::MeanAbs;
  o.scale_floor = {1e-6, 1e-6, 1e-6, 1e-6};
  o.alpha = {0.15, 0.15, 0.15, 0.15};
  o.noise.form = NoiseForm::StaticFusion;
  o.illumination = false;
  o.regions.on = false;
  return o;
}

APSO_NAMESPACE_END
