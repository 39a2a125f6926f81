/// \file
/// Bodies of pipeline.hpp, apart so that the order of the method reads in one piece there.
#pragma once

#include <cmath>
#include <cstddef>
#include <optional>
#include <type_traits>

#include <apso/pipeline/pipeline.hpp>

APSO_NAMESPACE_BEGIN

template <class P, class M, class A, class R>
template <class FrameT>
void BasicPipeline<P, M, A, R>::check_frame_size(const FrameT& frame) const {
  using IntensityTraits = image_traits<std::decay_t<decltype(intensity_of(frame))>>;
  using DepthTraits = image_traits<std::decay_t<decltype(depth_of(frame))>>;
  const auto fits = [this](int w, int h) { return w == camera_.width && h == camera_.height; };
  expects(fits(IntensityTraits::width(intensity_of(frame)), IntensityTraits::height(intensity_of(frame))),
          "Pipeline::observe: the intensity image has another size than the camera");
  expects(fits(DepthTraits::width(depth_of(frame)), DepthTraits::height(depth_of(frame))),
          "Pipeline::observe: the depth image has another size than the camera");
  expects(std::isfinite(frame.timestamp), "Pipeline::observe: the timestamp is not finite");
  if constexpr (!std::is_same_v<FrameT, RgbdFrame>) {
    constexpr double tolerance = 1e-3;  // [px]; the same camera may have been computed twice
    const Pinhole& c = frame.camera;
    expects(std::abs(c.fx - camera_.fx) <= tolerance && std::abs(c.fy - camera_.fy) <= tolerance &&
                std::abs(c.cx - camera_.cx) <= tolerance && std::abs(c.cy - camera_.cy) <= tolerance,
            "Pipeline::observe: the camera of the frame is not the pipeline's");
  }
}

template <class P, class M, class A, class R>
template <class FrameT, class Tracks, class Detections, class Mask>
const Observation& BasicPipeline<P, M, A, R>::observe(const FrameT& frame, const P& T_world_camera_prior, const Tracks& tracks,
                                                      const Detections& detections, const Mask& mask) {
  check_frame<FrameT>();
  next_ = Step::Observe;
  check_frame_size(frame);
  const Pose T_prior = taken(T_world_camera_prior);
  expects(is_rigid(T_prior), "Pipeline::observe: the prior pose is not finite or no rigid motion");

  work_.take(frame, camera_.width, camera_.height);
  const auto* const given_mask = detail::given(mask);
  const auto* const given_detections = detail::given(detections);
  const std::vector<Detection>* found = &work_.take_detections(given_detections);
  const std::vector<PointTrack>& listed_tracks = listed(detail::given(tracks));
  if (options_.motion) {
    motion_.observe(work_.frame(), T_prior, listed_tracks, observation_.mask);
    if (!detections_of(motion_).empty()) found = &detections_of(motion_);
  } else {
    set_unknown(camera_.width, camera_.height, observation_.mask);
  }
  if (given_mask != nullptr) {
    join_mask(*given_mask);
  } else if (!options_.motion && given_detections != nullptr) {
    // Without any motion cue a movable detection counts as moving (semantic prior, as in the paper).
    mask_from_detections(*found, camera_.width, camera_.height, false, external_);
    combine(external_, MaskCombination::Union, observation_.mask);
  }
  observation_.informative = given_mask != nullptr || given_detections != nullptr || known_ratio(observation_.mask) > 0;
  observation_.objects = objects_.update(observation_.mask, work_.frame().depth, *found, listed_tracks);
  observation_.dynamic_ratio = dynamic_ratio(observation_.mask);
  work_.forget_colour();
  next_ = Step::Assess;
  return observation_;
}

template <class P, class M, class A, class R>
template <class Mask>
void BasicPipeline<P, M, A, R>::join_mask(const Mask& mask) {
  const auto check = [this](int w, int h) {
    expects(w == camera_.width && h == camera_.height, "Pipeline::observe: the mask has another size than the camera");
  };
  if constexpr (std::is_same_v<Mask, DynamicMask>) {
    check(mask.probability.width(), mask.probability.height());
    combine(mask, MaskCombination::Union, observation_.mask);
  } else if constexpr (!is_none_v<Mask>) {
    check_image<Mask>();
    check(image_traits<Mask>::width(mask), image_traits<Mask>::height(mask));
    mask_from_image(mask, external_);
    combine(external_, MaskCombination::Union, observation_.mask);
  }
}

template <class P, class M, class A, class R>
template <class Keypoints, class Tracks>
auto BasicPipeline<P, M, A, R>::assess(const Keypoints& keypoints, const Tracks& tracks, const FeaturePose<P>& pose) -> const Assessment& {
  expects(next_ == Step::Assess, "Pipeline::assess: call observe() for the frame first, and assess() once");
  feature_information_ = pose.information;
  T_world_feature_ = taken(pose.T_world_feature);
  T_world_predicted_ = taken(pose.T_world_predicted);
  expects(is_rigid(T_world_predicted_), "Pipeline::assess: T_world_predicted is not finite or no rigid motion");
  const bool feature_pose = is_rigid(T_world_feature_);
  feature_ok_ = pose.ok && feature_pose;

  AssessmentInput input;
  input.frame = work_.frame();
  input.dynamic_probability = observation_.mask.probability;
  if (const auto* given = detail::given(keypoints)) input.keypoints = &as_keypoints(*given, keypoints_);
  if (const auto* given = detail::given(tracks)) input.tracks = &as_tracks(*given, tracks_);
  flow_ = input.tracks != nullptr ? flow_grid(*input.tracks, camera_.width, camera_.height) : FlowGrid{};
  input.objects = &observation_.objects;
  input.dynamic_ratio = observation_.dynamic_ratio;
  input.feature_tracking_ok = feature_ok_;
  input.T_world_camera = pose.ok ? &T_world_feature_ : nullptr;                  // also one that is refused, so that the assessment says so
  input.T_world_predicted = previous_measured_ ? &T_world_predicted_ : nullptr;  // what goes on from a guess says nothing
  input.matches = pose.matches;
  report_ = Report{};
  report_.timestamp = work_.frame().timestamp;
  report_.T_world_feature = feature_pose ? pose.T_world_feature : pose.T_world_predicted;
  report_.assessment = assessor_.assess(input);
  report_.state = report_.assessment.state;
  next_ = Step::Conclude;
  return report_.assessment;
}

template <class P, class M, class A, class R>
template <class Executor>
auto BasicPipeline<P, M, A, R>::conclude(const Executor& executor) -> const Report& {
  expects(next_ == Step::Conclude, "Pipeline::conclude: call assess() for the frame first, and conclude() once");
  next_ = Step::Observe;
  Pose T_world_camera = feature_ok_ ? T_world_feature_ : T_world_predicted_;
  const bool initialising = report_.state == SceneState::Initialising;
  const bool bad = report_.state == SceneState::Bad;
  bool confirmed = false;  // by a direct pose, even one that is not believed
  velocity_.begin(report_.timestamp);
  if (bad ? options_.refine != RefinedFrames::None : options_.refine == RefinedFrames::Every) {
    typename R::Input input;
    input.frame = work_.frame();
    input.dynamic_probability = observation_.mask.probability;
    input.mask_informative = observation_.informative;
    input.highly_dynamic = report_.assessment.scenario_dynamic;
    input.flow = flow_;
    input.T_world_feature = T_world_feature_;
    input.feature_ok = feature_ok_;
    input.feature_trusted = !bad;
    input.T_world_predicted = T_world_predicted_;
    input.T_world_previous = has_previous_ ? T_world_previous_ : T_world_predicted_;
    const MaybeDeviation& change = report_.assessment.S_change;
    input.S_change = change ? change->value() : 1.0;
    const MaybeQuality& final_score = report_.assessment.S_final;
    if (final_score) {
      input.S_final = final_score->value();
      input.below_threshold = report_.assessment.th_differ - final_score->value();
    }
    input.feature_information = feature_information_;
    report_.refinement = refiner_.refine(input, executor);
    // An open direction keeps the pose that the alignment began at, so that it confirms nothing.
    const Status status = report_.refinement.status;
    confirmed = feature_ok_ && succeeded(status) && status != Status::Degenerate && near_feature(report_.refinement.T_world_direct);
    // Where nothing was measured before, an open direction has kept a guess: such a pose is not taken alone (by the paper it is).
    const bool alone = !feature_ok_ || !(report_.refinement.w_eff > 0);
    const bool guessed = options_.refine == RefinedFrames::Every && !previous_measured_ && status == Status::Degenerate;
    report_.refined = report_.refinement.refined && !(alone && guessed);
    if (report_.refined) {
      T_world_camera = report_.refinement.T_world_camera;
      report_.source = alone ? PoseSource::Direct : PoseSource::Joined;
    }
    report_.refinement.T_world_camera = told(report_.refinement.T_world_camera);
    report_.refinement.T_world_direct = told(report_.refinement.T_world_direct);
    if (report_.refined) report_.T_world_direct = from_pose<P>(report_.refinement.T_world_direct);
  }
  // Without features and without a trusted direct pose nothing was measured: the pose is a guess. So it is where features contradict
  // what was expected and nothing confirms them. A guess after a guess is none.
  if (!report_.refined && (!feature_ok_ || (bad && !confirmed && unexpected()))) {
    T_world_camera = T_world_predicted_;
    report_.source = PoseSource::Prediction;
    if (!feature_ok_ || !previous_measured_) {
      report_.state = SceneState::Lost;
      prior_.lost();
      velocity_.lost();
    } else {
      prior_.predicted();
      velocity_.predicted(T_world_camera);
    }
  } else if (report_.refined) {
    prior_.refined();
    T_world_camera = held_where_open(T_world_camera);
  } else if (bad && options_.refine == RefinedFrames::Every && prior_.ready() && near_feature(T_world_predicted_)) {
    // A BAD frame without a direct pose: the camera has mass, so that the prediction tells something beside few or wrong features.
    T_world_camera = prior_.join(T_world_feature_, T_world_predicted_, feature_information_);
    report_.source = PoseSource::Filtered;
    velocity_.measured(T_world_camera, detail::feature_information(feature_information_));
  } else {
    prior_.measured(feature_information_);
    velocity_.measured(T_world_camera, detail::feature_information(feature_information_));
  }
  T_world_camera = normalized(T_world_camera);
  if (report_.state == SceneState::Good && previous_measured_) prior_.learn(T_world_predicted_, T_world_camera);
  previous_measured_ = report_.source != PoseSource::Prediction;

  report_.T_world_camera = from_pose<P>(told(T_world_camera));
  // Where the features have failed, a sure direct pose may be built upon, or a tracker that has lost its map never finds a new
  // one. The paper's switch builds on GOOD frames only.
  const bool repaired =
      !feature_ok_ && report_.refined && report_.refinement.c_dir >= kSureConfidence && options_.refine == RefinedFrames::Every;
  // A frame that is BAD for the jump of its pose alone has good images: without such frames the map runs out where the camera turns.
  const bool built_upon = report_.source != PoseSource::Prediction && (report_.assessment.good_scene || initialising);
  report_.keyframe_allowed = repaired || (feature_ok_ && built_upon);
  if (options_.motion && report_.state != SceneState::Lost) {
    motion_.remember(work_.frame(), T_world_camera, observation_.mask);
  }
  if (report_.keyframe_allowed && options_.refine != RefinedFrames::None) {
    refiner_.remember(work_.frame(), observation_.mask.probability, T_world_camera, executor, flow_);
  }
  T_world_previous_ = T_world_camera;
  previous_timestamp_ = report_.timestamp;
  has_previous_ = true;
  T_world_feature_previous_ = T_world_feature_;
  had_feature_ = feature_ok_;
  return report_;
}

template <class P, class M, class A, class R>
template <class PoseOf>
void BasicPipeline<P, M, A, R>::correct(PoseOf&& pose_of) {
  next_ = Step::Observe;
  if (!has_previous_) return;
  const auto pose_now = [&](double timestamp, const Pose& T_own_camera) -> std::optional<Pose> {
    const std::optional<P> now = pose_of(timestamp, from_pose<P>(told(T_own_camera)));
    if (!now) return std::nullopt;
    const Pose T = rigid(*now);
    expects(is_rigid(T), "Pipeline::correct: a pose is not finite or no rigid motion");
    return T;
  };
  const std::optional<Pose> latest = pose_now(previous_timestamp_, T_world_previous_);
  const Pose T_own_world = latest ? compose(T_world_previous_, inverse(*latest)) : T_own_world_;
  corrected_.clear();
  if constexpr (detail::detected_v<detail::correct_call_t, R>) {
    // all answers before the first change: one that is refused leaves everything as it was
    refiner_.correct([&](double timestamp, const Pose& T) -> std::optional<Pose> {
      corrected_.push_back(pose_now(timestamp, T));
      return std::nullopt;
    });
    std::size_t next = 0;
    refiner_.correct([&](double, const Pose&) -> std::optional<Pose> {
      const std::optional<Pose>& now = corrected_[next++];
      return now ? std::optional<Pose>(compose(T_own_world, *now)) : std::nullopt;
    });
  }
  T_own_world_ = T_own_world;
  moved_ = true;
}

template <class P, class M, class A, class R>
void BasicPipeline<P, M, A, R>::reset() {
  motion_.reset();
  objects_.reset();
  assessor_.reset();
  refiner_.reset();
  prior_.reset();
  velocity_.reset();
  observation_ = {};
  report_ = Report{};
  next_ = Step::Observe;
  has_previous_ = false;
  T_own_world_ = identity_pose();
  moved_ = false;
  previous_measured_ = had_feature_ = false;
}

// What fills a direction that the alignment leaves open are features alone, and often those on somebody who moves: there the motion of the
// camera so far counts as well.
template <class P, class M, class A, class R>
Pose BasicPipeline<P, M, A, R>::held_where_open(const Pose& T_world_refined) {
  const auto& r = report_.refinement;
  if constexpr (detail::detected_v<detail::alignment_information_t, std::decay_t<decltype(r)>>) {
    const MaybeQuality& final_score = report_.assessment.S_final;
    Matrix6 information = zeros<Matrix6>();  // as blend() weighs both poses
    if (r.w_eff > 0) {
      const double trust = final_score ? final_score->value() : 1.0;
      information += detail::scaled_information(trust, detail::feature_information(feature_information_));
    }
    if (r.w_eff < 1) information += detail::scaled_information(r.c_dir, r.alignment.information);
    const bool open = r.alignment.degenerate_count > 0;
    const bool joined = report_.source == PoseSource::Joined && options_.refine == RefinedFrames::Every;
    if (open && joined && velocity_.ready()) return velocity_.join(T_world_refined, information);
    velocity_.measured(T_world_refined, information, report_.state != SceneState::Bad && !open);
  }
  return T_world_refined;
}

template <class P, class M, class A, class R>
bool BasicPipeline<P, M, A, R>::near_feature(const Pose& T_world_camera) const {
  return motion_distance(T_world_feature_, T_world_camera) < kUnbelievable;
}

// A feature pose far from the prediction that does not go on as expected from the feature pose before either: a camera that is found again
// is far from where it was lost.
template <class P, class M, class A, class R>
bool BasicPipeline<P, M, A, R>::unexpected() const {
  if (options_.refine != RefinedFrames::Every || !has_previous_) return false;
  const Pose motion = compose(inverse(T_world_previous_), T_world_predicted_);
  return !near_feature(T_world_predicted_) && !(had_feature_ && near_feature(compose(T_world_feature_previous_, motion)));
}

APSO_NAMESPACE_END
