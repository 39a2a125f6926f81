/// \file
/// What BasicPipeline asks of its parts, with the sentence the compiler shows when something is missing.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/quality/assessor.hpp>
#include <apso/refinement/memory/frame_descriptor.hpp>
#include <apso/refinement/pyramid/pyramid_options.hpp>
#include <apso/traits/detail.hpp>
#include <apso/traits/pose.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN
namespace detail {

template <class T>
using options_call_t = decltype(std::declval<const T&>().options());
template <class T>
using assess_call_t = decltype(std::declval<T&>().assess(std::declval<const AssessmentInput&>()));
template <class T>
using reset_call_t = decltype(std::declval<T&>().reset());
template <class T>
using refine_call_t = decltype(std::declval<T&>().refine(std::declval<const typename T::Input&>()));
template <class T>
using remember_call_t = decltype(std::declval<T&>().remember(std::declval<const RgbdFrame&>(), std::declval<ImageView<const float>>(),
                                                             std::declval<const Pose&>(), SerialExecutor(), FlowGrid()));

/// What BasicPipeline::correct() asks of a remembered frame: its pose now.
using PoseNow = std::function<std::optional<Pose>(double timestamp, const Pose& T_world_camera)>;
template <class T>
using correct_call_t = decltype(std::declval<T&>().correct(std::declval<const PoseNow&>()));

template <class T, class = void>
struct options_of {
  struct type {  // keeps the rest of the class readable for the compiler once the check has spoken
    template <class Self, class V>
    static void fields(Self&, V&&) {}
  };
};
template <class T>
struct options_of<T, std::void_t<options_call_t<T>>> {
  using type = std::decay_t<options_call_t<T>>;
};
template <class T>
using options_of_t = typename options_of<T>::type;

template <class T>
inline constexpr bool is_refiner_v =
    detected_v<refine_call_t, T>&& detected_v<remember_call_t, T>&& detected_v<options_call_t, T>&& detected_v<reset_call_t, T>;

template <class T, bool = detected_v<assess_call_t, T>>
struct assessment_of {
  using type = std::decay_t<assess_call_t<T>>;
};
template <class T>
struct assessment_of<T, false> {
  using type = Assessment;
};
template <class T>
using assessment_of_t = typename assessment_of<T>::type;

template <class T>
inline constexpr bool is_assessor_v = detected_v<assess_call_t, T>&& detected_v<options_call_t, T>&& detected_v<reset_call_t, T>&&
    std::is_base_of_v<AssessmentSummary, assessment_of_t<T>>;

template <class T, bool = detected_v<refine_call_t, T>>
struct refinement_of {
  using type = std::decay_t<refine_call_t<T>>;
};
template <class T>
struct refinement_of<T, false> {
  using type = int;
};
template <class T>
using refinement_of_t = typename refinement_of<T>::type;

/// Whether a refinement tells what its alignment knows of each direction; a refiner of one's own need not.
template <class T>
using alignment_information_t =
    decltype(std::declval<const T&>().alignment.information, std::declval<const T&>().alignment.degenerate_count);

/// Base of BasicPipeline, so that these checks come first in the compiler's output.
template <class PoseT, class MotionT, class AssessorT, class RefinerT>
struct RequirePipeline : private require_pose<PoseT>, private require_motion_policy<MotionT> {
  static_assert(is_assessor_v<AssessorT>,
                "apso: an assessor needs assess(const AssessmentInput&), which gives an AssessmentSummary or what is derived from it, "
                "options() and reset(), and is made from (camera, options); see apso/quality/assessor.hpp");
  static_assert(is_refiner_v<RefinerT>,
                "apso: a refiner needs a type Input, refine(const Input&), remember(frame, dynamic_probability, "
                "T_world_camera, executor, flow), options() and reset(), and is made from (camera, options); see "
                "apso/refinement/refiner.hpp");
};

template <class T>
using pyramid_options_t = decltype(std::declval<const T&>().pyramid.finest);

/// Refuses at the start the camera that a later step would refuse: one that is none, or too small an image to align.
/// \param aligned some frames will be refined
template <class RefinerOptionsT>
const Pinhole& checked_camera(const Pinhole& camera, const RefinerOptionsT& refiner, bool aligned) {
  camera.validate();
  if constexpr (detected_v<pyramid_options_t, RefinerOptionsT>) {
    const int finest = refiner.pyramid.finest;
    if (aligned && ((camera.width >> finest) < kMinAlignedSize || (camera.height >> finest) < kMinAlignedSize)) {
      const std::string least = std::to_string(kMinAlignedSize << finest);
      contract_violation("Pipeline: the camera has " + std::to_string(camera.width) + " x " + std::to_string(camera.height) +
                         " pixels; to be refined at pyramid level " + std::to_string(finest) + " a frame needs at least " + least + " x " +
                         least);
    }
  }
  return camera;
}

/// A motion policy in its default setting.
template <class MotionT>
[[nodiscard]] MotionT make_motion(const Pinhole& camera) {
  constexpr bool from_camera = std::is_constructible_v<MotionT, const Pinhole&>;
  static_assert(from_camera || std::is_default_constructible_v<MotionT>,
                "apso: this motion policy is not made from a camera alone; hand it over: BasicPipeline(camera, policy, options)");
  if constexpr (from_camera) {
    return MotionT(camera);
  } else {
    return MotionT();
  }
}

}  // namespace detail
APSO_NAMESPACE_END
