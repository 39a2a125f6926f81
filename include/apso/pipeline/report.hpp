/// \file
/// Everything the pipeline found out about one frame.
#pragma once

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/quality/assessor.hpp>
#include <apso/refinement/refiner.hpp>

APSO_NAMESPACE_BEGIN

struct FrameReport {
  double timestamp = 0;                      ///< [s]
  SceneState state = SceneState::Initialising;
  Assessment assessment;                     ///< scores, weights, thresholds and flags of the frame
  bool refined = false;                      ///< T_world_camera is the blend of feature and direct pose
  Refinement refinement;                     ///< of this frame when it was BAD; status NotRun otherwise
  Pose T_world_feature = Pose::Identity();   ///< pose of the feature tracker
  Pose T_world_camera = Pose::Identity();    ///< final pose; in state Lost only the prediction
  bool keyframe_allowed = false;             ///< the map may learn from this frame (never on BAD)
};

APSO_NAMESPACE_END
