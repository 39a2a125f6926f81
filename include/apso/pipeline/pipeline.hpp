/// \file
/// The order of the method for one frame: observe what moves, assess the frame, refine its pose.
///
/// The feature tracker stays the host's own. A frame goes like this (T_prior: any guess of the pose):
/// \code
///   const auto now = apso::frame(timestamp, grey, apso::scaled(depth, 1 / 5000.F), camera);
///   const auto& seen = pipeline.observe(now, T_prior, tracks);                         // what moves?
///   // ... the host tracks its features outside of seen.mask ...
///   pipeline.assess(keypoints, tracks, {T_world_feature, T_world_predicted, ok});      // can it be trusted?
///   const auto& report = pipeline.conclude();                                          // refine, remember what is right
///   // ... the host takes report.T_world_camera, and makes keyframes only if report.keyframe_allowed ...
/// \endcode
/// Images, keypoints, tracks, detections and poses are of any type with traits (docs/concepts). `apso::none` stands for a
/// list or a mask that the host does not have. Nothing of the host's is referred to after a call has returned.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/observation/objects/object_tracker.hpp>
#include <apso/observation/policies/geometric_motion.hpp>
#include <apso/options.hpp>
#include <apso/pipeline/report.hpp>
#include <apso/pipeline/requirements.hpp>
#include <apso/pipeline/working_copy.hpp>
#include <apso/quality/assessor.hpp>
#include <apso/refinement/constant_velocity.hpp>
#include <apso/refinement/motion_prior.hpp>
#include <apso/refinement/refiner.hpp>
#include <apso/traits/pose.hpp>
#include <apso/traits/ranges.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// Which frames direct alignment refines.
enum class RefinedFrames {
  Every,    ///< all: of a GOOD frame both poses are right, and joined they are more exact than each
  BadOnly,  ///< as in the paper: a GOOD frame keeps its feature pose
  None,
};
constexpr std::array<const char*, 3> enum_names(RefinedFrames) { return {"every", "bad_only", "none"}; }

template <class AssessorOptionsT = AssessorOptions, class RefinerOptionsT = RefinerOptions>
struct BasicPipelineOptions {
  bool motion = true;  ///< ask the motion policy; false: a movable detection counts as moving (as in the paper)
  RefinedFrames refine = RefinedFrames::Every;
  ObjectTrackerOptions objects;
  AssessorOptionsT assessor;
  RefinerOptionsT refiner;

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("motion", s.motion);
    v("refine", s.refine);
    v("objects", s.objects);
    v("assessor", s.assessor);
    v("refiner", s.refiner);
  }
};
using PipelineOptions = BasicPipelineOptions<>;

/// Confidence of a direct pose from which a map may grow where the features have failed. A pose with an open direction has less
/// (see direct_confidence()).
inline constexpr double kSureConfidence = 0.75;

/// A feature pose of a BAD frame that is so far from the prediction, in units of motion_distance(), and that neither a direct pose nor
/// the feature pose before it confirms, is not believed: 7.5 cm or 5 degrees.
inline constexpr double kUnbelievable = 0.5;

/// What the first module found.
struct Observation {
  DynamicMask mask;
  std::vector<Detection> objects;  ///< with identity and motion probability; their masks live until the next observe()
  double dynamic_ratio = 0;        ///< [0,1]
  bool informative = false;        ///< some policy, mask or detection said something about the frame
};

/// What the host's feature tracker says about the pose of a frame.
template <class PoseT = Pose>
struct FeaturePose {
  PoseT T_world_feature = from_pose<PoseT>(identity_pose());    ///< pose from features; one that is not rigid (is_rigid(), e.g. NaN)
                                                                ///< counts as failed feature tracking
  PoseT T_world_predicted = from_pose<PoseT>(identity_pose());  ///< pose from the motion model alone, without the map; S_inn is measured
                                                                ///< against it. Without a motion model give T_world_feature, which leaves
                                                                ///< S_inn at 1
  bool ok = false;                                              ///< feature tracking succeeded
  Matrix6 information = zeros<Matrix6>();  ///< of T_world_feature, for the increment d of T_camera_world <- Exp(d) T_camera_world,
                                           ///< translation first [1/m^2, 1/rad^2]: the normal matrix of the pose optimisation,
                                           ///< or pose_information() of the matches; zero = not known, and so is one that is not finite
  int matches = -1;  ///< points of the map, or of an earlier frame, that agree with T_world_feature; -1 = not known. A pose of fewer
                     ///< than kEnoughMatches lowers S_feature, so that a frame without any is not GOOD
};

/// Owns the state of the three modules. Not thread-safe; use one per camera.
/// \tparam PoseT     any type with pose_traits: poses go in and come out as this
/// \tparam MotionT   motion policy (observation/motion_policy.hpp)
/// \tparam AssessorT made from (camera, options); like SceneAssessor
/// \tparam RefinerT  made from (camera, options); like Refiner
template <class PoseT = Pose, class MotionT = GeometricMotion, class AssessorT = SceneAssessor, class RefinerT = Refiner>
class BasicPipeline : private detail::RequirePipeline<PoseT, MotionT, AssessorT, RefinerT> {
 public:
  using Options = BasicPipelineOptions<detail::options_of_t<AssessorT>, detail::options_of_t<RefinerT>>;
  using Assessment = detail::assessment_of_t<AssessorT>;
  using Report = BasicFrameReport<PoseT, Assessment, detail::refinement_of_t<RefinerT>>;

  /// With a motion policy that is made from the camera, in its default setting. Throws contract_error for an option out of range and
  /// a camera that is none or too small to be refined (16 x 16 pixels with the default pyramid).
  explicit BasicPipeline(const Pinhole& camera, const Options& options = {})
      : camera_(checked(camera, options)),
        options_(options),
        motion_(detail::make_motion<MotionT>(camera)),  // in its place: no code to move it
        objects_(options.objects),
        assessor_(camera, options.assessor),
        refiner_(camera, options.refiner) {}
  /// With a motion policy of the caller's.
  BasicPipeline(const Pinhole& camera, MotionT motion, const Options& options = {})
      : camera_(checked(camera, options)),
        options_(options),
        motion_(std::move(motion)),
        objects_(options.objects),
        assessor_(camera, options.assessor),
        refiner_(camera, options.refiner) {}

  /// Module 1: what moves? Throws contract_error if images and camera differ in size, the timestamp is not finite
  /// or the prior is no rigid motion (is_rigid()).
  /// \param frame      made by frame(), or an RgbdFrame; of the pipeline's camera
  /// \param T_world_camera_prior best guess of the pose before this frame is tracked
  /// \param tracks     sharpens the motion policy; any range
  /// \param detections from any detector; any range, of which the kMaxObjects with the highest scores count. If the motion policy
  ///                   finds objects, those count instead
  /// \param mask       from any segmentation: an image of integers (nonzero = dynamic) or of probabilities in [0,1]
  ///                   (NaN = unknown), or a DynamicMask. Joins what the motion policy says.
  ///                   Each of the three may be `none`, or a pointer to what is said above, which may be null
  /// \returns valid until the next call
  template <class FrameT = RgbdFrame, class Tracks = None, class Detections = None, class Mask = None>
  const Observation& observe(const FrameT& frame, const PoseT& T_world_camera_prior, const Tracks& tracks = none,
                             const Detections& detections = none, const Mask& mask = none);

  /// Module 2: can the frame be trusted? Once after each observe().
  /// \param keypoints any range, or `none`: S_feature is then missing
  /// \param tracks    any range, or `none`: S_mc is then missing
  /// \param pose      throws contract_error if T_world_predicted is no rigid motion (is_rigid()); a feature pose that is none
  ///                  makes the frame BAD
  /// \returns valid until the next call
  template <class Keypoints, class Tracks>
  const Assessment& assess(const Keypoints& keypoints, const Tracks& tracks, const FeaturePose<PoseT>& pose);

  /// Module 3, and the memory of all modules. Once after each assess().
  /// \param executor for the refinement; the report does not depend on its threads
  /// \returns valid until the next call
  template <class Executor = SerialExecutor>
  const Report& conclude(const Executor& executor = {});

  /// Takes over what the back end of the host has changed since: a loop that was closed, maps that were joined, a large step of a bundle
  /// adjustment. Memory goes on in the map as it is now. Its small steps are better not followed: the poses that are remembered are the
  /// more exact ones, and the features join them in every frame (docs/tracker.md, docs/integrate/orb_slam3.md have figures).
  /// Before observe(): a frame that is not concluded by then is abandoned.
  /// \param pose_of of a timestamp and the pose of that frame so far (PoseT): its pose now, as std::optional<PoseT>. It is asked for the
  ///                latest frame, and for those that the refiner remembers if it has `correct` (see Refiner::correct()). A frame for
  ///                which it returns nullopt moves along with the latest one, and so does all that is not asked for.
  ///                Throws contract_error for a pose that is no rigid motion, with nothing changed
  template <class PoseOf>
  void correct(PoseOf&& pose_of);

  /// Forgets everything.
  void reset();

  [[nodiscard]] const Observation& observation() const { return observation_; }
  [[nodiscard]] const Report& report() const { return report_; }
  [[nodiscard]] const Pinhole& camera() const { return camera_; }
  [[nodiscard]] const Options& options() const { return options_; }
  [[nodiscard]] const MotionT& motion() const { return motion_; }
  [[nodiscard]] const AssessorT& assessor() const { return assessor_; }
  [[nodiscard]] const RefinerT& refiner() const { return refiner_; }

 private:
  enum class Step { Observe, Assess, Conclude };  // what comes next

  static const Pinhole& checked(const Pinhole& camera, const Options& options) {
    apso::validate(options, "pipeline");
    return detail::checked_camera(camera, options.refiner, options.refine != RefinedFrames::None);
  }
  // A pose of the host's type may have been rounded or may have drifted; apso's own is used unchanged.
  [[nodiscard]] static Pose rigid(const PoseT& T) {
    if constexpr (std::is_same_v<PoseT, Pose>) {
      return T;
    } else {
      const Pose given = to_pose(T);
      return is_rigid(given) ? normalized(given) : given;  // to be refused, not turned into some rotation
    }
  }
  // All that is remembered lies in a world that stays where it is; that of the host moves when correct() says so.
  [[nodiscard]] Pose taken(const PoseT& T) const { return moved_ ? compose(T_own_world_, rigid(T)) : rigid(T); }
  [[nodiscard]] Pose told(const Pose& T_own_camera) const { return moved_ ? compose(inverse(T_own_world_), T_own_camera) : T_own_camera; }
  template <class FrameT>
  void check_frame_size(const FrameT& frame) const;
  template <class Mask>
  void join_mask(const Mask& mask);
  [[nodiscard]] bool near_feature(const Pose& T_world_camera) const;
  [[nodiscard]] bool unexpected() const;
  [[nodiscard]] Pose held_where_open(const Pose& T_world_refined);
  template <class Tracks>
  const std::vector<PointTrack>& listed(const Tracks* tracks) {
    if (tracks != nullptr) return as_tracks(*tracks, tracks_);
    tracks_.clear();
    return tracks_;
  }

  Pinhole camera_;
  Options options_;
  MotionT motion_;
  ObjectTracker objects_;
  AssessorT assessor_;
  RefinerT refiner_;
  MotionPrior prior_;
  ConstantVelocity velocity_;
  Step next_ = Step::Observe;
  detail::WorkingCopy work_;
  DynamicMask external_;
  Observation observation_;
  Pose T_world_feature_ = identity_pose();
  Pose T_world_predicted_ = identity_pose();
  bool feature_ok_ = false;
  Matrix6 feature_information_ = zeros<Matrix6>();
  FlowGrid flow_;
  Report report_;
  Pose T_world_previous_ = identity_pose();
  double previous_timestamp_ = 0;
  bool has_previous_ = false;
  Pose T_own_world_ = identity_pose();
  bool moved_ = false;  // T_own_world_ is not the identity
  std::vector<std::optional<Pose>> corrected_;
  bool previous_measured_ = false;                   // not lost, and not itself a prediction
  Pose T_world_feature_previous_ = identity_pose();  // whether it was believed or not
  bool had_feature_ = false;
  std::vector<PointTrack> tracks_;
  std::vector<Keypoint> keypoints_;
};

/// The pipeline with apso's own poses, motion policy, assessor and refiner.
using Pipeline = BasicPipeline<>;

APSO_NAMESPACE_END

#include <apso/pipeline/pipeline_impl.hpp>
