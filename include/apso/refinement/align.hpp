/// \file
/// Direct alignment of two frames in one call, for images, cameras and poses of any type with traits.
#pragma once

#include <cstdint>
#include <limits>
#include <type_traits>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/se3.hpp>
#include <apso/options.hpp>
#include <apso/refinement/aligner.hpp>
#include <apso/refinement/confidence.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/traits/camera.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/pose.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

struct PairOptions {
  double intensity_unit = 0;  ///< factor that brings intensities to [0,1]; 0 = 1/255 for 8 bit, 1/65535 for 16 bit, else 1
  double depth_unit = 1;      ///< metres per unit of depth (TUM PNG files: 1/5000)
  bool backward = false;      ///< align the other way round as well; results that differ get the confidence 0
  double backward_translation = 0.02;  ///< largest difference of the two results [m]
  double backward_rotation = 1.0 * kDegree;  ///< and [rad]
  PyramidOptions pyramid;
  AlignmentOptions alignment;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("intensity_unit", s.intensity_unit, 0.0, 1e9);
    v("depth_unit", s.depth_unit, 1e-12, 1e9);
    v("backward", s.backward);
    v("backward_translation", s.backward_translation, 0.0, 1e6);
    v("backward_rotation", s.backward_rotation, 0.0, 4.0);
    v("pyramid", s.pyramid);
    v("alignment", s.alignment);
  }
};

struct PairAlignment {
  Status status = Status::NotRun;
  Pose T_current_reference = Pose::Identity();  ///< the initial guess if the status is a failure
  double confidence = 0;                        ///< c_dir by the usual residual scales of a structured-light camera
  double backward_translation = 0;              ///< difference to the alignment the other way round [m]; 0 = not asked for,
  double backward_rotation = 0;                 ///< infinite when that one failed; [rad]
  AlignmentResult detail;                       ///< with the reference as world
};

/// Motion between two RGB-D frames.
/// \param camera a Pinhole or any type with camera_traits
/// \param T_current_reference_guess a Pose or any type with pose_traits; kept on failure
/// \param executor the result does not depend on its threads
template <class ReferenceIntensity, class ReferenceDepth, class CurrentIntensity, class CurrentDepth, class CameraT,
          class PoseT = Pose, class Executor = SerialExecutor>
[[nodiscard]] PairAlignment align(const ReferenceIntensity& reference_intensity, const ReferenceDepth& reference_depth,
                                  const CurrentIntensity& current_intensity, const CurrentDepth& current_depth,
                                  const CameraT& camera, const PoseT& T_current_reference_guess = Pose::Identity(),
                                  const PairOptions& options = {}, const Executor& executor = {}) {
  check_image<ReferenceIntensity>();
  check_image<ReferenceDepth>();
  check_image<CurrentIntensity>();
  check_image<CurrentDepth>();
  validate(options, "align");
  const auto unit = [&](auto zero) {
    if (options.intensity_unit > 0) return options.intensity_unit;
    if (std::is_same_v<decltype(zero), std::uint8_t>) return 1.0 / 255;
    return std::is_same_v<decltype(zero), std::uint16_t> ? 1.0 / 65535 : 1.0;
  };
  Image<float> images[4];
  copy_to_float(reference_intensity, unit(typename image_traits<ReferenceIntensity>::value_type{}), images[0]);
  copy_to_float(reference_depth, options.depth_unit, images[1]);
  copy_to_float(current_intensity, unit(typename image_traits<CurrentIntensity>::value_type{}), images[2]);
  copy_to_float(current_depth, options.depth_unit, images[3]);
  const auto pinhole = [&] {
    if constexpr (std::is_same_v<CameraT, Pinhole>) return camera;
    else return to_pinhole(camera, images[0].width(), images[0].height());
  }();
  const Pose T_guess = to_pose(T_current_reference_guess);
  FramePyramid reference;
  FramePyramid current;
  reference.build({0.0, images[0], images[1]}, pinhole, {}, options.pyramid,
                  options.backward ? PyramidRole::Both : PyramidRole::Reference, executor);
  current.build({0.0, images[2], images[3]}, pinhole, {}, options.pyramid,
                options.backward ? PyramidRole::Both : PyramidRole::Current, executor);
  DirectAligner aligner(options.alignment);
  PairAlignment out;
  out.detail = aligner.align({{&reference, Pose::Identity(), 1.0}}, current, {inverse(T_guess)}, executor);
  out.status = out.detail.status;
  out.T_current_reference = succeeded(out.status) ? inverse(out.detail.T_world_camera) : T_guess;
  out.confidence = direct_confidence(out.detail, 0.65, 1.1);
  if (options.backward) {
    const AlignmentResult back = aligner.align({{&current, Pose::Identity(), 1.0}}, reference, {T_guess}, executor);
    out.backward_translation = out.backward_rotation = std::numeric_limits<double>::infinity();
    if (succeeded(back.status) && succeeded(out.status)) {
      const Pose difference = compose(back.T_world_camera, out.detail.T_world_camera);  // there and back
      out.backward_translation = norm(translation(difference));
      out.backward_rotation = rotation_angle(difference);
    }
    if (!(out.backward_translation <= options.backward_translation) || !(out.backward_rotation <= options.backward_rotation)) {
      out.confidence = 0;
    }
  }
  return out;
}

APSO_NAMESPACE_END
