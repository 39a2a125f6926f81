/// \file
/// The order of the method for one frame: observe what moves, assess the frame, repair its pose if it is BAD.
///
/// The feature tracker stays the host's own. A frame goes like this (T_prior: any guess of the pose):
/// \code
///   const auto& seen = pipeline.observe({frame, T_prior, &tracks});        // what moves?
///   // ... the host tracks its features outside of seen.mask ...
///   pipeline.assess({&keypoints, &tracks, T_world_feature, T_world_predicted, ok});  // can it be trusted?
///   const auto& report = pipeline.conclude();                              // repair if BAD, remember if GOOD
///   // ... the host takes report.T_world_camera, and makes keyframes only if report.keyframe_allowed ...
/// \endcode
#pragma once

#include <cstdint>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/policies/geometric_motion.hpp>
#include <apso/observation/objects/object_tracker.hpp>
#include <apso/options.hpp>
#include <apso/pipeline/report.hpp>
#include <apso/quality/assessor.hpp>
#include <apso/refinement/refiner.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

struct PipelineOptions {
  bool motion = true;      ///< find moving regions from geometry
  bool refinement = true;  ///< repair the pose of BAD frames
  GeometricMotionOptions geometric_motion;
  ObjectTrackerOptions objects;
  AssessorOptions assessor;
  RefinerOptions refiner;

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("motion", s.motion);
    v("refinement", s.refinement);
    v("geometric_motion", s.geometric_motion);
    v("objects", s.objects);
    v("assessor", s.assessor);
    v("refiner", s.refiner);
  }
};

/// What the first module sees. The images must stay alive until conclude().
struct ObservationInput {
  RgbdFrame frame;
  Pose T_world_camera_prior = Pose::Identity();      ///< best guess of the pose before this frame is tracked
  const std::vector<PointTrack>* tracks = nullptr;   ///< optional; sharpens the motion policy
  const std::vector<Detection>* detections = nullptr;///< optional; from any detector
  ImageView<const std::uint8_t> mask;                ///< optional; nonzero = dynamic, from any segmentation
  const DynamicMask* moving = nullptr;               ///< optional; from a motion policy of the host's own, which then also
                                                     ///< remembers the frame itself; joins the pipeline's own policy
};

/// What the first module found.
struct Observation {
  DynamicMask mask;
  std::vector<Detection> objects;  ///< with identity and motion probability
  double dynamic_ratio = 0;        ///< [0,1]
  bool informative = false;        ///< some policy, mask or detection looked at the frame
};

/// What the host's feature tracker found.
struct FeatureObservation {
  const std::vector<Keypoint>* keypoints = nullptr;
  const std::vector<PointTrack>* tracks = nullptr;
  Pose T_world_feature = Pose::Identity();    ///< pose from features
  Pose T_world_predicted = Pose::Identity();  ///< pose from the motion model alone
  bool ok = false;                            ///< feature tracking succeeded
};

/// Owns the state of the three modules. Not thread-safe; use one per camera.
class Pipeline {
 public:
  explicit Pipeline(const Pinhole& camera, const PipelineOptions& options = {})
      : camera_(camera),
        options_(options),
        motion_(camera, options.geometric_motion),
        objects_(options.objects),
        assessor_(camera, options.assessor),
        refiner_(camera, options.refiner) {
    camera_.validate();
    apso::validate(options_, "pipeline");
  }

  /// Module 1. Throws contract_error if the images and the camera differ in size.
  const Observation& observe(const ObservationInput& input);
  /// Module 2, after observe() of the same frame.
  const Assessment& assess(const FeatureObservation& features);
  /// Module 3 on BAD frames, and the memory of all modules.
  /// \param executor for the refinement; the report does not depend on its threads
  template <class Executor = SerialExecutor>
  const FrameReport& conclude(const Executor& executor = {});
  /// Forgets everything.
  void reset();

  [[nodiscard]] const Observation& observation() const { return observation_; }
  [[nodiscard]] const FrameReport& report() const { return report_; }

 private:
  void check_images(const ObservationInput& input) const;

  Pinhole camera_;
  PipelineOptions options_;
  GeometricMotion motion_;
  ObjectTracker objects_;
  SceneAssessor assessor_;
  Refiner refiner_;
  RgbdFrame frame_;
  FeatureObservation features_;
  Observation observation_;
  DynamicMask external_;
  FrameReport report_;
  Pose T_world_previous_ = Pose::Identity();
  bool has_previous_ = false;
  std::vector<PointTrack> no_tracks_;
  std::vector<Detection> no_detections_;
};

APSO_NAMESPACE_END

#include <apso/pipeline/pipeline_impl.hpp>
