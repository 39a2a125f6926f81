/// \file
/// Refines the pose of a frame: chooses references among good frames, aligns directly, judges the result, joins it with the
/// feature pose. Images, tracks and poses are of any type; the pose comes back as the type it came in.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/se3.hpp>
#include <apso/refinement/aligner.hpp>
#include <apso/refinement/blend.hpp>
#include <apso/refinement/confidence.hpp>
#include <apso/refinement/memory/frame_descriptor.hpp>
#include <apso/refinement/memory/motion_distance.hpp>
#include <apso/refinement/memory/reference_memory.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/refinement/refiner_options.hpp>
#include <apso/refinement/speed_gate.hpp>
#include <apso/status.hpp>
#include <apso/traits/any.hpp>
#include <apso/traits/pose.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// A frame and what is known of its pose. Refers to the images until refine() returns.
/// \tparam PoseT any type with pose_traits
template <class PoseT = Pose>
struct RefinementInput {
  AnyFrame frame;                 ///< a Frame of your images, or an RgbdFrame
  AnyImage dynamic_probability;   ///< any image of the size of the frame, [0,1], 1 = dynamic; may be empty
  FlowGrid flow;                  ///< flow_grid(tracks, width, height); for MotionForm::FlowGrid only
  bool mask_informative = false;  ///< the mask of this frame says what moves
  bool highly_dynamic = false;    ///< so much moves that no pose can be trusted without a mask
  PoseT T_world_feature = from_pose<PoseT>(identity_pose());
  bool feature_ok = true;        ///< false: the feature tracker is lost, its pose is not used
  bool feature_trusted = false;  ///< the frame is GOOD: its feature pose is near the truth, and no other start is tried
  PoseT T_world_predicted = from_pose<PoseT>(identity_pose());       ///< by constant velocity
  PoseT T_world_previous = from_pose<PoseT>(identity_pose());        ///< emitted for the previous frame
  double S_change = 0;                                               ///< change score (a deviation), [0,1]
  double S_final = 1;                                                ///< trust in the frame, [0,1]
  Matrix6 feature_information = zeros<Matrix6>();                    ///< of the increment (v, w) in the camera frame [1/m^2, 1/rad^2];
                                                                     ///< zero = the feature tracker does not tell
  double below_threshold = std::numeric_limits<double>::infinity();  ///< th_differ - S_final; for BlendOptions::transition
};

/// Outcome for one frame.
template <class PoseT = Pose>
struct BasicRefinement {
  Status status = Status::NotRun;                            ///< a failure leaves T_world_camera at the feature pose (or prediction)
  PoseT T_world_camera = from_pose<PoseT>(identity_pose());  ///< of both poses joined
  PoseT T_world_direct = from_pose<PoseT>(identity_pose());  ///< of direct alignment alone
  bool refined = false;                                      ///< the direct pose was believed
  double c_dir = 0;                                          ///< confidence in the direct pose, [0,1]
  double w_diff = 1;                                         ///< weight of the feature pose by the change score
  double w_eff = 1;                                          ///< weight used (see Blended)
  int references = 0;
  double reference_distance = 0;  ///< of the nearest; 0 without references
  bool far_reference = false;     ///< the nearest reference is beyond th_keyframes
  bool gated = false;             ///< the two poses were too far apart to be blended
  bool too_fast = false;          ///< the speed gate fired
  AlignmentResult alignment;      ///< its poses are apso's
};
using Refinement = BasicRefinement<>;

/// Refines poses, and learns from the frames that it is told to remember. Keeps its buffers: once the memory is full, no frame
/// allocates anything.
/// \tparam AlignerT a BasicDirectAligner, of a kernel and a noise model of your own if you like
template <class AlignerT = DirectAligner>
class BasicRefiner {
 public:
  using Input = RefinementInput<>;

  explicit BasicRefiner(const Pinhole& camera, const RefinerOptions& options = {})
      : camera_(camera), options_(options), memory_(options.memory), aligner_(options.alignment) {  // in its place: no code to move it
    check();
  }
  BasicRefiner(const Pinhole& camera, const RefinerOptions& options, AlignerT aligner)
      : camera_(camera), options_(options), memory_(options.memory), aligner_(std::move(aligner)) {
    check();
  }

  /// Refines the pose of a frame.
  /// \param executor for the images and the alignment; the result does not depend on its threads
  template <class PoseT, class Executor = SerialExecutor>
  [[nodiscard]] BasicRefinement<PoseT> refine(const RefinementInput<PoseT>& in, const Executor& executor = {}) {
    check_pose<PoseT>();
    if constexpr (std::is_same_v<PoseT, Pose>) {
      return refine_pose(in, executor);
    } else {
      const Refinement r = refine_pose({in.frame, in.dynamic_probability, in.flow, in.mask_informative, in.highly_dynamic,
                                        to_pose(in.T_world_feature), in.feature_ok, in.feature_trusted, to_pose(in.T_world_predicted),
                                        to_pose(in.T_world_previous), in.S_change, in.S_final, in.feature_information, in.below_threshold},
                                       executor);
      const bool unchanged = in.feature_ok && !(r.w_eff < 1);
      return {r.status,
              unchanged ? in.T_world_feature : from_pose<PoseT>(r.T_world_camera),
              from_pose<PoseT>(r.T_world_direct),
              r.refined,
              r.c_dir,
              r.w_diff,
              r.w_eff,
              r.references,
              r.reference_distance,
              r.far_reference,
              r.gated,
              r.too_fast,
              r.alignment};
    }
  }

  /// Takes in a good frame with its final pose: memory, typical speed, typical residual scales. Of the frame that was refined
  /// last the images are not read again.
  /// \param frame a Frame of your images, or an RgbdFrame
  /// \param dynamic_probability as in RefinementInput
  /// \param T_world_camera a pose of any type
  /// \param flow as in RefinementInput
  template <class Executor = SerialExecutor>
  void remember(const AnyFrame& frame, const AnyImage& dynamic_probability, const AnyPose& T_world_camera, const Executor& executor = {},
                const FlowGrid& flow = {}) {
    const Pose& T = T_world_camera;
    if (!is_finite(T)) return;
    const bool refined_now = last_.pending && !(last_.timestamp < frame.timestamp) && !(frame.timestamp < last_.timestamp);
    if (refined_now) {
      last_.pending = false;
    } else {
      settle();
      last_ = {};
    }
    gate_.learn(frame.timestamp, T);
    Pose T_kept = T;
    if (refined_now && options_.follow_features > 0) {
      memory_.correct([&](double, const Pose& T_reference) { return std::optional<Pose>(compose(last_.T_followed_world, T_reference)); });
      T_kept = compose(last_.T_followed_world, T);
    }
    const bool store = memory_.wants(frame.timestamp, T_kept);
    if (!store && !options_.memory.previous) return;
    if (!last_.seen || !options_.memory.previous) {
      pyramid_.build(frame, camera_, dynamic_probability, options_.pyramid, PyramidRole::Reference, executor);
      descriptor_ = {describe_(frame.depth(), dynamic_probability, options_.pyramid.depth), flow};
    }
    if (store) memory_.insert(pyramid_, descriptor_, T_kept);
    if (options_.memory.previous) memory_.keep_previous(pyramid_, T_kept);
  }

  /// Takes over poses of remembered frames that a back end has corrected; as ReferenceMemory::correct().
  template <class PoseOf>
  void correct(PoseOf&& pose_of) {
    memory_.correct(pose_of);
  }

  /// Forgets everything, as at construction.
  void reset() {
    memory_.clear();
    gate_.reset();
    last_ = {};
  }

  [[nodiscard]] const RefinerOptions& options() const { return options_; }
  [[nodiscard]] const ReferenceMemory& memory() const { return memory_; }
  [[nodiscard]] ReferenceMemory& memory() { return memory_; }

 private:
  // The frame that was refined last.
  struct LastRefined {
    bool pending = false;  // whether it is a good one is not known yet
    bool seen = false;     // pyramid_ and descriptor_ are of it
    bool trusted = false;
    double timestamp = 0;
    Pose T_world_direct = identity_pose();
    Pose T_followed_world = identity_pose();  // by which all references are to move
  };

  void check() const {
    camera_.validate();
    validate(options_, "refiner");
  }

  // The frame refined last was no good one: nothing is learnt from it, but a direct pose that was believed is a place where
  // the camera has been.
  void settle() {
    if (!last_.pending) return;
    gate_.interrupt();
    if (last_.trusted) gate_.trust(last_.timestamp, last_.T_world_direct);
    last_.pending = false;
  }

  template <class Executor>
  Refinement refine_pose(const Input& in, const Executor& executor) {
    Refinement r;
    settle();
    last_ = {};
    last_.pending = true;
    last_.timestamp = in.frame.timestamp;
    const bool feature_ok = in.feature_ok && is_finite(in.T_world_feature);
    const Pose T_predicted = is_finite(in.T_world_predicted) ? in.T_world_predicted : in.T_world_previous;
    const Pose T_guess = feature_ok ? in.T_world_feature : T_predicted;
    r.T_world_camera = r.T_world_direct = T_guess;
    r.w_diff = feature_ok ? difference_weight(in.S_change, options_.blend.mu) : 0.0;
    if (!is_finite(T_guess)) {
      r.T_world_camera = r.T_world_direct = identity_pose();
      r.status = Status::Diverged;
      return r;
    }
    if (!find_references(in, T_guess, r)) return r;
    pyramid_.build(in.frame, camera_, in.dynamic_probability, options_.pyramid,
                   options_.memory.previous ? PyramidRole::Both : PyramidRole::Current, executor);
    last_.seen = true;
    r.alignment = align(in, T_guess, feature_ok && in.feature_trusted, executor);
    r.status = r.alignment.status;
    if (!succeeded(r.status)) return r;
    r.T_world_direct = r.alignment.T_world_camera;
    // Where what is near moves, features hang on it as well: the direct pose is taken alone, if it is believed alone.
    const bool foreground = feature_ok && r.alignment.foreground > 0;
    judge(in.frame.timestamp, feature_ok && !foreground, r);
    const bool joined = feature_ok && !(foreground && r.refined);
    if (joined && foreground) judge(in.frame.timestamp, true, r);
    if (joined) {
      const Blended<Pose> b =
          blend(in.T_world_feature, r.T_world_direct, expected(in, T_predicted, r.T_world_direct),
                {in.S_change, r.c_dir, in.S_final, r.alignment.information, in.feature_information, in.below_threshold}, options_.blend);
      r.T_world_camera = b.T_world_camera;
      r.w_diff = b.w_diff;
      r.w_eff = b.w_eff;
      r.gated = b.gated;
      follow(in, r);
    } else if (r.refined) {  // nothing to blend with: the direct pose, if it is believed at all
      r.T_world_camera = r.T_world_direct;
      r.w_eff = 0;
    }
    last_.trusted = r.refined;
    last_.T_world_direct = r.T_world_direct;
    return r;
  }

  // A direct pose hangs on poses like itself, and drifts: a part of what the map says against it counts for all references.
  void follow(const Input& in, const Refinement& r) {
    if (!(options_.follow_features > 0) || !in.feature_trusted || !r.refined || r.gated) return;
    const Twist apart = se3_log(compose(in.T_world_feature, inverse(r.T_world_camera)));
    last_.T_followed_world = se3_exp(options_.follow_features * apart);
  }

  // Prediction or previous pose, whichever is nearer to one of both poses: a prediction from wrong tracks may be far off.
  static Pose expected(const Input& in, const Pose& T_predicted, const Pose& T_direct) {
    if (!is_finite(in.T_world_previous)) return T_predicted;
    const auto nearer = [&](const Pose& T) { return std::min(motion_distance(T, in.T_world_feature), motion_distance(T, T_direct)); };
    return nearer(in.T_world_previous) < nearer(T_predicted) ? in.T_world_previous : T_predicted;
  }

  template <class Executor>
  AlignmentResult align(const Input& in, const Pose& T_guess, bool trusted, const Executor& executor) {
    if (trusted) return aligner_.align_near(selection_.references, pyramid_, T_guess, executor);
    candidates_.clear();
    candidates_.push_back(T_guess);
    if (is_finite(in.T_world_predicted)) candidates_.push_back(in.T_world_predicted);
    if (is_finite(in.T_world_previous)) candidates_.push_back(in.T_world_previous);
    return aligner_.align(selection_.references, pyramid_, candidates_, executor);
  }

  // References, and whether they may be used without knowing what moves.
  bool find_references(const Input& in, const Pose& T_guess, Refinement& r) {
    descriptor_ = {describe_(in.frame.depth(), in.dynamic_probability, options_.pyramid.depth), in.flow};
    memory_.select(in.frame.timestamp, T_guess, descriptor_, selection_);
    if (options_.memory.previous) memory_.add_previous(in.frame.timestamp, selection_);
    r.references = static_cast<int>(selection_.references.size());
    if (r.references == 0) {
      r.status = Status::NoReference;
      return false;
    }
    r.far_reference = selection_.far_reference;
    r.reference_distance = std::isfinite(selection_.distance) ? selection_.distance : 0.0;
    const bool blind = options_.require_mask && in.highly_dynamic && !in.mask_informative && !selection_.masked;
    if (blind) r.status = Status::NoMask;
    return !blind;
  }

  // Whether the direct pose is believed, and how much. Beside a feature pose it is asked for the directions that it knows only; alone,
  // all have to be known.
  void judge(double timestamp, bool feature_ok, Refinement& r) {
    r.too_fast = gate_.too_fast(timestamp, r.T_world_direct, options_.velocity_gate);
    if (!r.too_fast) {
      const DirectConfidence c = direct_confidence(r.alignment);
      r.c_dir = feature_ok && options_.blend.form == BlendForm::InformationWeighted ? c.determined : c.c_dir;
      if (r.c_dir < options_.min_confidence) r.c_dir = 0;
    }
    r.refined = r.c_dir > 0 || (options_.blend.weight == BlendWeight::Printed && !r.too_fast);
  }

  Pinhole camera_;
  RefinerOptions options_;
  ReferenceMemory memory_;
  AlignerT aligner_;
  FramePyramid pyramid_;
  DepthDescriber describe_;
  FrameDescriptor descriptor_;
  ReferenceMemory::Selection selection_;
  std::vector<Pose> candidates_;
  SpeedGate gate_;
  LastRefined last_;
};
using Refiner = BasicRefiner<>;

APSO_NAMESPACE_END
