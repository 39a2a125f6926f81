/// \file
/// Direct alignment of two frames in one call, for images, cameras and poses of any type with traits. No image is copied
/// to be read.
#pragma once

#include <limits>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/se3.hpp>
#include <apso/options.hpp>
#include <apso/refinement/aligner.hpp>
#include <apso/refinement/confidence.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/traits/any.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/images/rows.hpp>
#include <apso/traits/pose.hpp>

APSO_NAMESPACE_BEGIN

struct PairOptions {
  double depth_unit = 1;  ///< metres per unit of depth, where images are given one by one (TUM PNG files: 1/5000)
  bool backward = false;  ///< align the other way round as well; results that differ by more than 2 cm or 1 degree get the
                          ///< confidence 0
  PyramidOptions pyramid;
  AlignmentOptions alignment;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("depth_unit", s.depth_unit, 1e-12, 1e9);
    v("backward", s.backward);
    v("pyramid", s.pyramid);
    v("alignment", s.alignment);
  }
};

/// The motion between two frames, as a pose of your type.
template <class PoseT = Pose>
struct PairAlignment {
  Status status = Status::NotRun;
  PoseT T_current_reference = from_pose<PoseT>(identity_pose());  ///< the initial guess if the status is a failure
  double confidence = 0;                                          ///< c_dir by the typical residual scales of a structured-light camera
  double backward_translation = 0;  ///< difference to the alignment the other way round [m]; 0 = not asked for,
  double backward_rotation = 0;     ///< infinite when that one failed; [rad]
  AlignmentResult detail;           ///< with the reference as world
};

/// Largest differences between the two directions of PairOptions::backward: as far off as the confidence lets a pose be.
inline constexpr double kBackwardTranslation = 0.02;        ///< [m]
inline constexpr double kBackwardRotation = 1.0 * kDegree;  ///< [rad]

namespace detail {
// Compares with the alignment the other way round, of which the current frame is the world.
inline void check_backward(const AlignmentResult& back, PairAlignment<Pose>& out) {
  out.backward_translation = out.backward_rotation = std::numeric_limits<double>::infinity();
  if (succeeded(back.status) && succeeded(out.status)) {
    const Pose there_and_back = compose(back.T_world_camera, out.detail.T_world_camera);
    out.backward_translation = norm(translation(there_and_back));
    out.backward_rotation = rotation_angle(there_and_back);
  }
  const bool agree = out.backward_translation <= kBackwardTranslation && out.backward_rotation <= kBackwardRotation;
  if (!agree) out.confidence = 0;
}

template <class Executor>
PairAlignment<Pose> align_pair(const AnyFrame& reference_frame, const AnyFrame& current_frame, const Pinhole& camera, const Pose& T_guess,
                               const PairOptions& options, const Executor& executor) {
  validate(options, "align");
  FramePyramid reference;
  FramePyramid current;
  reference.build(reference_frame, camera, {}, options.pyramid, options.backward ? PyramidRole::Both : PyramidRole::Reference, executor);
  current.build(current_frame, camera, {}, options.pyramid, options.backward ? PyramidRole::Both : PyramidRole::Current, executor);
  DirectAligner aligner(options.alignment);
  PairAlignment<Pose> out;
  out.detail = aligner.align({{&reference, identity_pose(), 1.0}}, current, {inverse(T_guess)}, executor);
  out.status = out.detail.status;
  out.T_current_reference = succeeded(out.status) ? inverse(out.detail.T_world_camera) : T_guess;
  out.confidence = direct_confidence(out.detail).c_dir;
  if (options.backward) {
    check_backward(aligner.align({{&current, identity_pose(), 1.0}}, reference, {T_guess}, executor), out);
  }
  return out;
}
}  // namespace detail

/// Motion between two RGB-D frames of the same camera. For more than one pair keep a DirectAligner and FramePyramids: they
/// reuse their memory.
/// \param reference_frame,current_frame made by frame(); contract_error if they differ in camera or size
/// \param T_current_reference_guess a pose of any type with pose_traits; kept on failure. The result has its type
/// \param executor the result does not depend on its threads
template <class RI, class RD, class CI, class CD, class PoseT = Pose, class Executor = SerialExecutor>
[[nodiscard]] PairAlignment<PoseT> align(const Frame<RI, RD>& reference_frame, const Frame<CI, CD>& current_frame,
                                         const PoseT& T_current_reference_guess = identity_pose(), const PairOptions& options = {},
                                         const Executor& executor = {}) {
  check_pose<PoseT>();
  const PairAlignment<Pose> found = detail::align_pair(AnyFrame(reference_frame), AnyFrame(current_frame), reference_frame.camera,
                                                       to_pose(T_current_reference_guess), options, executor);
  return {found.status,
          succeeded(found.status) ? from_pose<PoseT>(found.T_current_reference) : T_current_reference_guess,
          found.confidence,
          found.backward_translation,
          found.backward_rotation,
          found.detail};
}

/// The same for images one by one.
/// \param reference_intensity,current_intensity 8 and 16 bit are brought to [0,1], float is in [0,1]
/// \param reference_depth,current_depth in PairOptions::depth_unit
/// \param camera a Pinhole or any type with camera_traits
template <class ReferenceIntensity, class ReferenceDepth, class CurrentIntensity, class CurrentDepth, class CameraT, class PoseT = Pose,
          class Executor = SerialExecutor>
[[nodiscard]] PairAlignment<PoseT> align(const ReferenceIntensity& reference_intensity, const ReferenceDepth& reference_depth,
                                         const CurrentIntensity& current_intensity, const CurrentDepth& current_depth,
                                         const CameraT& camera, const PoseT& T_current_reference_guess = identity_pose(),
                                         const PairOptions& options = {}, const Executor& executor = {}) {
  check_image<ReferenceIntensity>();
  check_image<ReferenceDepth>();
  check_image<CurrentIntensity>();
  check_image<CurrentDepth>();
  check_pose<PoseT>();
  const auto unit = static_cast<float>(options.depth_unit);
  const Pinhole pinhole = detail::pinhole_of(camera, image_traits<ReferenceIntensity>::width(reference_intensity),
                                             image_traits<ReferenceIntensity>::height(reference_intensity));
  return align(frame(0.0, reference_intensity, scaled(reference_depth, unit), pinhole),
               frame(0.0, current_intensity, scaled(current_depth, unit), pinhole), T_current_reference_guess, options, executor);
}

APSO_NAMESPACE_END
