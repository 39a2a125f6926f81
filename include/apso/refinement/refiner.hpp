/// \file
/// Repairs the pose of a bad frame: chooses references among good frames, aligns directly, judges the result, blends.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/statistics.hpp>
#include <apso/options.hpp>
#include <apso/refinement/aligner.hpp>
#include <apso/refinement/blend.hpp>
#include <apso/refinement/confidence.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/refinement/reference_memory.hpp>
#include <apso/status.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

struct RefinerOptions {
  PyramidOptions pyramid;
  AlignmentOptions alignment;
  MemoryOptions memory;
  BlendOptions blend;
  DirectConfidenceOptions confidence;
  double min_confidence = 0.5;          ///< a direct pose of less confidence is not used at all: far off, it drags all the same
  bool require_mask = true;             ///< no refinement of a dynamic frame when nobody knows what moves
  double dynamic_ratio_for_mask = 0.35; ///< dynamic ratio from which a mask is required
  double usual_scale_intensity = 0.65;  ///< start value of the running median on good frames
  double usual_scale_depth = 1.1;       ///< start value of the running median on good frames
  int scale_every = 5;                  ///< good frames between two measurements of the usual scales; 0 = never
  int median_window = 60;               ///< samples of the running medians
  double velocity_factor = 3.0;         ///< a direct pose that moves from the last trusted one faster than this many
                                        ///< times the median speed
  double velocity_translation = 1.5;    ///< plus this [m/s]
  double velocity_rotation = 600 * kDegree;  ///< or this [rad/s] is not believed
  int velocity_samples = 5;             ///< speeds needed before the gate is used
  RefinerOptions() { alignment.depth_alone = true; }  // frames of a flash or in the dark are what is repaired here
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("pyramid", s.pyramid);
    v("alignment", s.alignment);
    v("memory", s.memory);
    v("blend", s.blend);
    v("confidence", s.confidence);
    v("min_confidence", s.min_confidence, 0.0, 1.0);
    v("require_mask", s.require_mask);
    v("dynamic_ratio_for_mask", s.dynamic_ratio_for_mask, 0.0, 1.0);
    v("usual_scale_intensity", s.usual_scale_intensity, 1e-6, 1e6);
    v("usual_scale_depth", s.usual_scale_depth, 1e-6, 1e6);
    v("scale_every", s.scale_every, 0, 1000000);
    v("median_window", s.median_window, 1, 100000);
    v("velocity_factor", s.velocity_factor, 0.0, 1e6);
    v("velocity_translation", s.velocity_translation, 0.0, 1e6);
    v("velocity_rotation", s.velocity_rotation, 0.0, 1e6);
    v("velocity_samples", s.velocity_samples, 1, 100000);
  }
};

/// Outcome for one bad frame.
struct Refinement {
  Status status = Status::NotRun;             ///< a failure leaves T_world_camera at the feature pose (or prediction)
  Pose T_world_camera = Pose::Identity();     ///< the blend
  Pose T_world_direct = Pose::Identity();     ///< of direct alignment alone
  double c_dir = 0;                           ///< confidence in the direct pose, [0,1]
  double w_diff = 1;                          ///< weight of the feature pose by the change score
  double w_eff = 1;                           ///< weight used
  int references = 0;
  double reference_distance = 0;              ///< of the nearest; 0 without references
  bool far_reference = false;                 ///< the nearest reference is beyond the usual distance
  bool gated = false;                         ///< the two poses were too far apart to be blended
  bool too_fast = false;                      ///< the velocity gate fired
  AlignmentResult alignment;
};

class Refiner {
 public:
  struct Input {
    RgbdFrame frame;
    ImageView<const float> dynamic_probability;   ///< may be empty
    bool mask_informative = false;                ///< the mask of this frame says what moves
    double dynamic_ratio = 0;                     ///< [0,1]
    Pose T_world_feature = Pose::Identity();
    bool feature_ok = true;                       ///< false: the feature tracker is lost, its pose is not used
    Pose T_world_predicted = Pose::Identity();    ///< by constant velocity
    Pose T_world_previous = Pose::Identity();     ///< emitted for the previous frame
    double S_change = 0;                          ///< change score (a deviation), [0,1]
    double S_feature = 1;                         ///< quality of the features, [0,1]
  };

  explicit Refiner(const Pinhole& camera, const RefinerOptions& options = {})
      : camera_(camera), options_(options), memory_(options.memory), aligner_(options.alignment),
        speed_(options.median_window), turn_(options.median_window), scale_intensity_(options.median_window),
        scale_depth_(options.median_window) {
    camera_.validate();
    validate(options_, "refiner");
  }

  /// Refines the pose of a bad frame. The result is valid until the next call.
  /// \param executor for the images and the alignment; the result does not depend on its threads
  template <class Executor = SerialExecutor>
  const Refinement& refine(const Input& in, const Executor& executor = {}) {
    result_ = Refinement{};
    Refinement& r = result_;
    const bool feature_ok = in.feature_ok && is_finite(in.T_world_feature);
    const Pose T_guess = feature_ok ? in.T_world_feature
                                    : (is_finite(in.T_world_predicted) ? in.T_world_predicted : in.T_world_previous);
    r.T_world_camera = r.T_world_direct = T_guess;
    r.w_diff = feature_ok ? difference_weight(in.S_change, options_.blend.mu) : 0.0;
    last_good_ = false;
    if (!is_finite(T_guess)) {
      r.T_world_camera = r.T_world_direct = Pose::Identity();
      r.status = Status::Diverged;
      return r;
    }
    memory_.select(in.frame.timestamp, T_guess,
                   depth_descriptor(in.frame.depth, in.dynamic_probability, options_.pyramid.depth), selection_);
    r.references = static_cast<int>(selection_.references.size());
    if (r.references == 0) {
      r.status = Status::NoReference;
      return r;
    }
    r.far_reference = selection_.far_reference;
    r.reference_distance = std::isfinite(selection_.distance) ? selection_.distance : 0.0;
    const bool dynamic = in.dynamic_ratio >= options_.dynamic_ratio_for_mask;
    if (options_.require_mask && dynamic && !in.mask_informative && !selection_.masked) {
      r.status = Status::NoMask;
      return r;
    }
    pyramid_.build(in.frame, camera_, in.dynamic_probability, options_.pyramid, PyramidRole::Current, executor);
    candidates_.clear();
    candidates_.push_back(T_guess);
    if (is_finite(in.T_world_predicted)) candidates_.push_back(in.T_world_predicted);
    if (is_finite(in.T_world_previous)) candidates_.push_back(in.T_world_previous);
    r.alignment = aligner_.align(selection_.references, pyramid_, candidates_, executor);
    r.status = r.alignment.status;
    if (!succeeded(r.status)) return r;
    r.T_world_direct = r.alignment.T_world_camera;
    r.too_fast = too_fast(r.T_world_direct, in.frame.timestamp);
    if (!r.too_fast) {
      r.c_dir = direct_confidence(r.alignment, usual_scale_intensity(), usual_scale_depth(), options_.confidence);
      if (r.c_dir < options_.min_confidence) r.c_dir = 0;
    }
    if (!feature_ok) {  // nothing to blend with: the direct pose, if it is believed at all
      if (r.c_dir > 0) {
        r.T_world_camera = r.T_world_direct;
        r.w_eff = 0;
      }
      trust_if_used(in.frame.timestamp);
      return r;
    }
    const Blend b = blend_poses(in.T_world_feature, r.T_world_direct,
                                is_finite(in.T_world_predicted) ? in.T_world_predicted : in.T_world_previous,
                                in.S_change, r.c_dir, options_.blend, r.alignment.information, in.S_feature);
    r.T_world_camera = b.T_world_camera;
    r.w_diff = b.w_diff;
    r.w_eff = b.w_eff;
    r.gated = b.gated;
    trust_if_used(in.frame.timestamp);
    return r;
  }

  /// Takes in a good frame with its final pose: memory, usual speed, usual residual scales.
  template <class Executor = SerialExecutor>
  void remember(const RgbdFrame& frame, ImageView<const float> dynamic_probability, const Pose& T_world_camera,
                const Executor& executor = {}) {
    if (!is_finite(T_world_camera)) return;
    const double dt = frame.timestamp - trusted_timestamp_;
    if (last_good_ && dt > 0) {
      const Pose motion = compose(inverse(T_world_trusted_), T_world_camera);
      speed_.add(norm(translation(motion)) / dt);
      turn_.add(rotation_angle(motion) / dt);
    }
    trust(T_world_camera, frame.timestamp);
    last_good_ = true;

    const bool store = memory_.wants(frame.timestamp, T_world_camera);
    const bool measure = options_.scale_every > 0 && memory_.size() > 0 && good_frames_ % options_.scale_every == 0;
    ++good_frames_;
    if (!store && !measure) return;
    pyramid_.build(frame, camera_, dynamic_probability, options_.pyramid,
                   store ? (measure ? PyramidRole::Both : PyramidRole::Reference) : PyramidRole::Current, executor);
    const DepthDescriptor descriptor = depth_descriptor(frame.depth, dynamic_probability, options_.pyramid.depth);
    if (measure) {
      memory_.select(frame.timestamp, T_world_camera, descriptor, selection_);
      if (!selection_.references.empty() && !selection_.far_reference) {
        selection_.references.resize(1);
        const AlignmentResult e = aligner_.evaluate(selection_.references, pyramid_, T_world_camera, executor);
        if (succeeded(e.status)) {
          scale_intensity_.add(e.scale_intensity);
          scale_depth_.add(e.scale_depth);
        }
      }
    }
    if (store) memory_.insert(pyramid_, descriptor, T_world_camera);
  }

  /// Forgets everything, as at construction.
  void reset() {
    memory_.clear();
    for (RunningMedian* m : {&speed_, &turn_, &scale_intensity_, &scale_depth_}) m->clear();
    good_frames_ = 0;
    last_good_ = false;
    trusted_ = false;
  }

  [[nodiscard]] const RefinerOptions& options() const { return options_; }
  [[nodiscard]] const ReferenceMemory& memory() const { return memory_; }
  [[nodiscard]] ReferenceMemory& memory() { return memory_; }
  /// Robust scales on good frames, in units of the noise model.
  [[nodiscard]] double usual_scale_intensity() { return usual(scale_intensity_, options_.usual_scale_intensity); }
  [[nodiscard]] double usual_scale_depth() { return usual(scale_depth_, options_.usual_scale_depth); }

 private:
  // The start value counts until there are enough measurements.
  static double usual(RunningMedian& m, double start) { return m.size() >= 3 ? m.median(start) : start; }

  void trust(const Pose& T_world_camera, double timestamp) {
    T_world_trusted_ = T_world_camera;
    trusted_timestamp_ = timestamp;
    trusted_ = true;
  }
  void trust_if_used(double timestamp) {
    if (result_.c_dir > 0) trust(result_.T_world_direct, timestamp);
  }
  // Speed is measured from the last pose that was trusted, over the time since then: the poses between may be the wrong
  // ones that are to be repaired, and against them the way back would look fast.
  [[nodiscard]] bool too_fast(const Pose& T_direct, double timestamp) {
    const double dt = timestamp - trusted_timestamp_;
    if (!trusted_ || speed_.size() < options_.velocity_samples || !(dt > 0)) return false;
    const Pose motion = compose(inverse(T_world_trusted_), T_direct);
    const double f = options_.velocity_factor;
    return norm(translation(motion)) > dt * (f * speed_.median(0) + options_.velocity_translation) ||
           rotation_angle(motion) > dt * (f * turn_.median(0) + options_.velocity_rotation);
  }

  Pinhole camera_;
  RefinerOptions options_;
  ReferenceMemory memory_;
  DirectAligner aligner_;
  FramePyramid pyramid_;
  ReferenceMemory::Selection selection_;
  std::vector<Pose> candidates_;
  RunningMedian speed_, turn_, scale_intensity_, scale_depth_;
  Refinement result_;
  Pose T_world_trusted_ = Pose::Identity();
  double trusted_timestamp_ = 0;
  bool trusted_ = false;
  bool last_good_ = false;
  int good_frames_ = 0;
};

APSO_NAMESPACE_END
