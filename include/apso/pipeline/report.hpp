/// \file
/// Everything the pipeline found out about one frame.
#pragma once

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/quality/assessor.hpp>
#include <apso/refinement/refiner.hpp>
#include <apso/traits/pose.hpp>

APSO_NAMESPACE_BEGIN

/// \tparam PoseT your pose type; the poses inside `refinement` are apso's
template <class PoseT = Pose, class AssessmentT = Assessment, class RefinementT = Refinement>
struct BasicFrameReport {
  double timestamp = 0;  ///< [s]
  SceneState state = SceneState::Initialising;
  AssessmentT assessment;                                     ///< scores, weights, thresholds and flags of the frame
  bool refined = false;                                       ///< a direct pose was trusted: T_world_camera joins it with the feature pose
  RefinementT refinement{};                                   ///< of this frame; status NotRun if it was not refined at all
  PoseT T_world_feature = from_pose<PoseT>(identity_pose());  ///< pose of the feature tracker
  PoseT T_world_direct = from_pose<PoseT>(identity_pose());   ///< of direct alignment, if `refined`
  PoseT T_world_camera = from_pose<PoseT>(identity_pose());   ///< final pose; in state Lost only the prediction
  bool keyframe_allowed = false;  ///< the map may learn from this frame: GOOD, or without features but with a sure direct pose
};
using FrameReport = BasicFrameReport<>;

APSO_NAMESPACE_END
