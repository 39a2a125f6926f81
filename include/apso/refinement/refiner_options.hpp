/// \file
/// Settings of the refiner, and the printed forms of the paper.
#pragma once

#include <apso/config.hpp>
#include <apso/refinement/alignment_options.hpp>
#include <apso/refinement/blend.hpp>
#include <apso/refinement/memory/reference_memory.hpp>
#include <apso/refinement/pyramid/pyramid_options.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

/// RefinerOptions::follow_features for a camera: 0 where the errors of its depths are independent, up to 0.4 where they are shared by
/// neighbours and stay from frame to frame, so that direct poses drift more than the map (docs/tracker.md).
/// \param inverse_depth_sigma of a depth, with what its neighbours share [1/m] (CameraModel::inverse_depth_sigma); 0: not known
[[nodiscard]] inline double follow_for_depth(double inverse_depth_sigma) {
  constexpr double kMost = 0.4;
  return inverse_depth_sigma > kInverseDepthSigma ? kMost * (1 - kInverseDepthSigma / inverse_depth_sigma) : 0.0;
}

/// MemoryOptions::references for a camera: kReferences where the errors of its depths are independent, so that each reference makes the
/// pose more exact; 1, besides the frame before, where references that lie side by side share their errors (docs/tracker.md).
/// \param inverse_depth_sigma as in follow_for_depth()
[[nodiscard]] inline int references_for_depth(double inverse_depth_sigma) {
  return inverse_depth_sigma > kInverseDepthSigma ? 1 : kReferences;
}

struct RefinerOptions {
  PyramidOptions pyramid;
  AlignmentOptions alignment;
  MemoryOptions memory;
  BlendOptions blend;
  double min_confidence = 0.5;  ///< a direct pose of less confidence is not used at all: far off, it drags all the same
  bool require_mask = true;     ///< no refinement of a highly dynamic frame when nobody knows what moves
  double velocity_gate = 1;     ///< multiple of the speed beyond which a direct pose is not believed (see SpeedGate);
                                ///< 0 = every speed is believed
  double follow_features = -1;  ///< share of the way from the joined pose of a GOOD frame to its feature pose by which all references
                                ///< move, [0,1]; -1: follow_for_depth() where a program knows its camera, else 0
  RefinerOptions() { alignment.depth_alone = true; }  // frames of a flash or in the dark are to be repaired here
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("pyramid", s.pyramid);
    v("alignment", s.alignment);
    v("memory", s.memory);
    v("blend", s.blend);
    v("min_confidence", s.min_confidence, 0.0, 1.0);
    v("require_mask", s.require_mask);
    v("velocity_gate", s.velocity_gate, 0.0, 1e6);
    v("follow_features", s.follow_features, -1.0, 1.0);
  }
};

/// Sets what the options leave to the camera: follow_features and memory.references.
/// \param inverse_depth_sigma as in follow_for_depth()
inline void take_depth_noise(double inverse_depth_sigma, RefinerOptions& options) {
  if (options.follow_features < 0) options.follow_features = follow_for_depth(inverse_depth_sigma);
  if (options.memory.references == 0) options.memory.references = references_for_depth(inverse_depth_sigma);
}

/// Equations (12) to (17) as printed, as far as they can be computed: those of one alignment by paper_alignment(); of (12), M is
/// the optical flow, which the paper calls the motion characteristic of a frame; (16) with its printed sign of the decay; (17)
/// with the weight w_diff alone, without confidence, gates or required masks. The sum of pose matrices in (17) is no pose: the
/// poses are joined along their screw.
[[nodiscard]] inline RefinerOptions paper_refiner_options() {
  RefinerOptions o;
  o.alignment = paper_alignment();
  o.memory.form = DistanceForm::Sum;
  o.memory.motion = MotionForm::FlowGrid;
  o.memory.decay_form = DecayForm::Printed;
  o.memory.references = kReferences;
  o.memory.previous = false;
  o.blend.form = BlendForm::ScrewLinear;
  o.blend.weight = BlendWeight::Printed;
  o.require_mask = false;
  o.velocity_gate = 0;
  o.follow_features = 0;
  return o;
}

APSO_NAMESPACE_END
