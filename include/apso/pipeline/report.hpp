/// \file
/// Everything the pipeline found out about one frame.
#pragma once

#include <array>
#include <cstddef>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/quality/assessor.hpp>
#include <apso/refinement/refiner.hpp>
#include <apso/traits/pose.hpp>

APSO_NAMESPACE_BEGIN

/// Where the final pose of a frame comes from.
enum class PoseSource {
  Features,    ///< as the feature tracker gave it
  Joined,      ///< of features and direct alignment, and in directions that this leaves open of the motion so far; see ConstantVelocity
  Direct,      ///< direct alignment alone
  Filtered,    ///< of features and prediction, in a BAD frame without a direct pose that is believed; see MotionPrior
  Prediction,  ///< nothing that could be believed: a guess
};
constexpr std::array<const char*, 5> enum_names(PoseSource) { return {"features", "joined", "direct", "filtered", "prediction"}; }
[[nodiscard]] constexpr const char* to_string(PoseSource s) { return enum_names(s)[static_cast<std::size_t>(s)]; }

/// \tparam PoseT your pose type; the poses inside `refinement` are apso's
template <class PoseT = Pose, class AssessmentT = Assessment, class RefinementT = Refinement>
struct BasicFrameReport {
  double timestamp = 0;  ///< [s]
  SceneState state = SceneState::Initialising;
  AssessmentT assessment;    ///< scores, weights, thresholds and flags of the frame
  bool refined = false;      ///< a direct pose was trusted: T_world_camera joins it with the feature pose
  RefinementT refinement{};  ///< of this frame; status NotRun if it was not refined at all. Its pose is without the motion so far
  PoseT T_world_feature = from_pose<PoseT>(identity_pose());  ///< pose of the feature tracker
  PoseT T_world_direct = from_pose<PoseT>(identity_pose());   ///< of direct alignment, if `refined`
  PoseT T_world_camera = from_pose<PoseT>(identity_pose());   ///< final pose; in state Lost only the prediction
  PoseSource source = PoseSource::Features;                   ///< what T_world_camera comes from
  bool keyframe_allowed = false;  ///< the map may learn from this frame: its images are good (AssessmentSummary::good_scene), or it has a
                                  ///< sure direct pose without features
};
using FrameReport = BasicFrameReport<>;

APSO_NAMESPACE_END
