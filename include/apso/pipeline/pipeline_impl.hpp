/// \file
/// Bodies of pipeline.hpp, apart so that the order of the method reads in one piece there.
#pragma once

#include <algorithm>

#include <apso/pipeline/pipeline.hpp>

APSO_NAMESPACE_BEGIN

inline void Pipeline::check_images(const ObservationInput& input) const {
  const auto fits = [this](int w, int h) { return w == camera_.width && h == camera_.height; };
  expects(fits(input.frame.intensity.width, input.frame.intensity.height),
          "Pipeline::observe: the intensity image has another size than the camera");
  expects(fits(input.frame.depth.width, input.frame.depth.height),
          "Pipeline::observe: the depth image has another size than the camera");
  expects(input.mask.empty() || fits(input.mask.width, input.mask.height),
          "Pipeline::observe: the mask has another size than the camera");
  expects(input.moving == nullptr || fits(input.moving->probability.width(), input.moving->probability.height()),
          "Pipeline::observe: the mask of the motion policy has another size than the camera");
  expects(is_finite(input.T_world_camera_prior), "Pipeline::observe: the prior pose is not finite");
}

inline const Observation& Pipeline::observe(const ObservationInput& input) {
  check_images(input);
  const std::vector<PointTrack>& tracks = input.tracks ? *input.tracks : no_tracks_;
  const std::vector<Detection>& detections = input.detections ? *input.detections : no_detections_;
  frame_ = input.frame;

  const bool moving = input.moving != nullptr && known_ratio(*input.moving) > 0;
  observation_.informative = options_.motion || moving || !input.mask.empty() || input.detections != nullptr;
  if (options_.motion) {
    motion_.observe(frame_, input.T_world_camera_prior, tracks, observation_.mask);
  } else {
    set_unknown(camera_.width, camera_.height, observation_.mask);
  }
  if (moving) combine(*input.moving, MaskCombination::Union, observation_.mask);
  if (!input.mask.empty()) {
    mask_from_labels(input.mask, external_);
    combine(external_, MaskCombination::Union, observation_.mask);
  } else if (!options_.motion && input.moving == nullptr && input.detections != nullptr) {
    // Without any motion cue a movable detection counts as moving (semantic prior, as in the paper).
    mask_from_detections(detections, camera_.width, camera_.height, false, external_);
    combine(external_, MaskCombination::Union, observation_.mask);
  }
  observation_.objects = objects_.update(observation_.mask, frame_.depth, detections, tracks);
  observation_.dynamic_ratio = dynamic_ratio(observation_.mask);
  return observation_;
}

inline const Assessment& Pipeline::assess(const FeatureObservation& features) {
  expects(features.keypoints != nullptr && features.tracks != nullptr, "Pipeline::assess: keypoints or tracks missing");
  expects(!frame_.intensity.empty(), "Pipeline::assess: call observe() for the frame first");
  features_ = features;
  AssessmentInput input;
  input.frame = frame_;
  input.dynamic_probability = observation_.mask.probability;
  input.keypoints = features.keypoints;
  input.tracks = features.tracks;
  input.objects = &observation_.objects;
  input.dynamic_ratio = observation_.dynamic_ratio;
  input.feature_tracking_ok = features.ok;
  return assessor_.assess(input);
}

template <class Executor>
const FrameReport& Pipeline::conclude(const Executor& executor) {
  report_ = FrameReport{};
  report_.timestamp = frame_.timestamp;
  report_.assessment = assessor_.assessment();
  report_.state = report_.assessment.state;
  report_.T_world_feature = features_.T_world_feature;
  report_.T_world_camera = features_.ok ? features_.T_world_feature : features_.T_world_predicted;

  const bool initialising = report_.state == SceneState::Initialising;
  if (report_.state == SceneState::Bad && options_.refinement) {
    Refiner::Input input;
    input.frame = frame_;
    input.dynamic_probability = observation_.mask.probability;
    input.mask_informative = observation_.informative;
    input.dynamic_ratio = observation_.dynamic_ratio;
    input.T_world_feature = features_.T_world_feature;
    input.feature_ok = features_.ok;
    input.T_world_predicted = features_.T_world_predicted;
    input.T_world_previous = has_previous_ ? T_world_previous_ : features_.T_world_predicted;
    const MaybeDeviation& change = report_.assessment.S_change;
    input.S_change = change ? change->value() : 1.0;
    const MaybeQuality& feature = report_.assessment.S_feature;
    input.S_feature = feature ? feature->value() : 1.0;
    report_.refinement = refiner_.refine(input, executor);
    report_.refined = succeeded(report_.refinement.status) && report_.refinement.c_dir > 0;
    if (report_.refined) report_.T_world_camera = report_.refinement.T_world_camera;
  }
  // Without features and without a trusted direct pose nothing was measured: the pose is a guess.
  if (!features_.ok && !report_.refined) report_.state = SceneState::Lost;

  report_.T_world_camera = normalized(report_.T_world_camera);
  report_.keyframe_allowed = features_.ok && (report_.state == SceneState::Good || initialising);
  if (options_.motion && report_.state != SceneState::Lost) {
    motion_.remember(frame_, report_.T_world_camera, observation_.mask);
  }
  if (report_.keyframe_allowed && options_.refinement) {
    refiner_.remember(frame_, observation_.mask.probability, report_.T_world_camera, executor);
  }
  T_world_previous_ = report_.T_world_camera;
  has_previous_ = true;
  return report_;
}

inline void Pipeline::reset() {
  motion_.reset();
  objects_.reset();
  assessor_.reset();
  refiner_.reset();
  observation_ = {};
  report_ = {};
  frame_ = {};
  has_previous_ = false;
}

APSO_NAMESPACE_END
