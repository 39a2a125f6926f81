/// \file
/// The quality module of the paper as one class: all scores of a frame, the thresholds, the benchmark, the decision.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/quality/assessment.hpp>
#include <apso/quality/assessment_input.hpp>
#include <apso/quality/assessor_options.hpp>
#include <apso/quality/benchmark.hpp>
#include <apso/quality/decision.hpp>
#include <apso/quality/frame_context.hpp>
#include <apso/quality/score_list.hpp>
#include <apso/quality/threshold.hpp>
#include <apso/quality/weighted_mean.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// Assesses frame after frame. Call assess() once per frame, in the order of time.
/// \tparam FrameScores       ScoreList of scores of a frame by itself
/// \tparam ChangeScores      ScoreList of scores of change
/// \tparam InitialThresholds the rule for th_f and th_s; see AdaptiveThresholds
/// \tparam Threshold         the rule for th_differ; see DecisionThreshold
template <class FrameScores = PaperFrameScores, class ChangeScores = PaperChangeScores, class InitialThresholds = AdaptiveThresholds,
          class Threshold = DecisionThreshold>
class BasicAssessor : private detail::RequireScores<FrameScores, ChangeScores> {
 public:
  using Options = BasicAssessorOptions<FrameScores, ChangeScores>;
  using Result = BasicAssessment<FrameScores, ChangeScores>;

  explicit BasicAssessor(const Pinhole& camera, const Options& options = {})
      : camera_(camera),
        o_(checked(options)),
        frame_scores_(options.frame_scores),
        change_scores_(options.change_scores),
        initialiser_(options.initialisation),
        decision_(options.decision),
        benchmark_(options.benchmark) {
    camera_.validate();
  }

  /// Scores, state and reasons of a frame. The result is valid until the next call; nothing of the input is kept. Throws
  /// contract_error if the timestamp is not finite or an image has not the size of the camera.
  const Result& assess(const AssessmentInput& in) {
    FrameContext c = context(in);
    c.keypoints = in.keypoints;
    c.tracks = in.tracks;
    c.objects = in.objects;
    c.dynamic_probability = in.dynamic_probability;
    return assess(c, in.dynamic_ratio, in.feature_tracking_ok, in.T_world_predicted);
  }
  /// The same of any types; see assessment_input().
  template <class F, class K, class T, class D, class M>
  const Result& assess(const ForeignAssessmentInput<F, K, T, D, M>& in) {
    FrameContext c = context(in);
    if constexpr (!is_none_v<typename K::type>) c.keypoints = &as_keypoints(in.keypoints.get(), keypoints_);
    if constexpr (!is_none_v<typename T::type>) c.tracks = &as_tracks(in.tracks.get(), tracks_);
    if constexpr (!is_none_v<typename D::type>) c.objects = &as_detections(in.objects.get(), objects_);
    c.dynamic_probability = in.dynamic_probability.get();
    return assess(c, in.dynamic_ratio ? *in.dynamic_ratio : mean_of(c.dynamic_probability, row_), in.feature_tracking_ok,
                  in.T_world_predicted);
  }
  /// The last result.
  [[nodiscard]] const Result& assessment() const { return a_; }

  /// Forgets everything.
  void reset() {
    a_ = Result{};
    frame_scores_.reset();
    change_scores_.reset();
    has_previous_ = false;
    steady_frames_ = 0;
    innovations_.reset();
    reset_benchmark();
  }
  /// Forgets the reference and searches a new one, e.g. in a new place; what the scores have learned stays.
  void reset_benchmark() {
    initialiser_.reset();
    decision_.reset();
    benchmark_.reset();
    degraded_ = false;
  }
  [[nodiscard]] const Options& options() const { return o_; }

 private:
  using Snapshot = FrameSnapshot<ChangeScores>;
  using Change = ScoreResults<ChangeScores>;
  static constexpr auto kFrameIndices = std::make_index_sequence<FrameScores::size>{};
  static constexpr auto kChangeIndices = std::make_index_sequence<ChangeScores::size>{};

  static const Options& checked(const Options& o) {
    validate_assessor(o);
    return o;
  }

  template <class Input>
  [[nodiscard]] FrameContext context(const Input& in) const {
    FrameContext c;
    c.timestamp = in.frame.timestamp;
    c.camera = camera_;
    c.intensity = intensity_of(in.frame);
    c.depth = depth_of(in.frame);
    c.depth_range = o_.depth_range;
    c.T_world_camera = in.T_world_camera;
    c.matches = in.matches;
    return c;
  }
  void check(const FrameContext& c) const {
    const auto fits = [&](const AnyImage& image) {
      return image.empty() || (image.width() == camera_.width && image.height() == camera_.height);
    };
    expects(std::isfinite(c.timestamp), "SceneAssessor: the timestamp is not finite");
    expects(fits(c.depth), "SceneAssessor: the depth image has not the size of the camera");
    expects(fits(c.intensity), "SceneAssessor: the intensity image has not the size of the camera");
    expects(fits(c.dynamic_probability), "SceneAssessor: the dynamic map has not the size of the camera");
  }

  const Result& assess(FrameContext& c, double dynamic_ratio, bool feature_tracking_ok, const Pose* T_world_predicted) {
    check(c);
    const int frame = a_.frame + 1;
    a_ = Result{};
    a_.frame = frame;
    a_.timestamp = c.timestamp;
    a_.feature_pose_refused = c.T_world_camera != nullptr && !is_rigid(*c.T_world_camera);
    a_.feature_tracking_ok = feature_tracking_ok && !a_.feature_pose_refused;
    if (a_.feature_pose_refused) c.T_world_camera = nullptr;
    c.initialising = !benchmark_.present();
    if (o_.decision.innovation) {
      a_.innovation = pose_innovation(c.T_world_camera, T_world_predicted);
      a_.S_inn = innovations_.score(a_.innovation);
    }

    score_frame(c, kFrameIndices);
    remember(c, kChangeIndices);
    if (const Snapshot* reference = choose_baseline()) {
      a_.benchmark_age = std::max(0.0, current_.timestamp - reference->timestamp);
      a_.S_reference = reference == &benchmark_.reference() ? benchmark_.S_reference().value() : reference->S_total.value();
      a_.S_change = compare(*reference, o_.change_baseline, a_.change_scores, kChangeIndices);
    }
    a_.dynamic_ratio = choose_dynamic_ratio(dynamic_ratio, c);
    follow_steps();

    if (benchmark_.present()) {
      decide();
    } else {
      initialise();
    }
    a_.degraded = degraded_;
    std::swap(previous_, current_);
    has_previous_ = true;
    return a_;
  }

  template <std::size_t... I>
  void score_frame(const FrameContext& c, std::index_sequence<I...>) {
    const auto one = [&](auto& score, auto& result, double weight) {
      result.value = score(c);
      result.weight = weight;
      result.measured = frame_scores_.measured(score);
    };
    (one(std::get<I>(frame_scores_.each), std::get<I>(a_.frame_scores.each), o_.frame_weights[I]), ...);
    const MaybeQuality total = mean_of_scores<Quality>(a_.frame_scores, o_.frame_weights);
    a_.S_total_missing = !total;
    a_.S_total = total.value_or(Quality(0.0));
  }

  template <std::size_t... I>
  void remember(const FrameContext& c, std::index_sequence<I...>) {
    current_.timestamp = c.timestamp;
    current_.S_total = a_.S_total;
    (std::get<I>(change_scores_.each).remember(c, std::get<I>(current_.memories)), ...);
  }

  [[nodiscard]] const Snapshot* choose_baseline() const {
    if (o_.change_baseline == ChangeBaseline::Previous) return has_previous_ ? &previous_ : nullptr;
    if (benchmark_.present()) return &benchmark_.reference();
    return initialiser_.has_best() ? &best_ : nullptr;
  }

  /// All scores of change of the current frame against another.
  template <std::size_t... I>
  APSO_NOINLINE MaybeDeviation compare(const Snapshot& other, ChangeBaseline baseline, Change& out, std::index_sequence<I...>) {
    const auto one = [&](auto& score, auto& result, const auto& before, const auto& now, double weight) {
      using Memory = std::decay_t<decltype(now)>;
      result.value = score(ChangeContext<Memory>{before, now, camera_, baseline});
      result.weight = weight;
      result.measured = change_scores_.measured(score);
    };
    (one(std::get<I>(change_scores_.each), std::get<I>(out.each), std::get<I>(other.memories), std::get<I>(current_.memories),
         o_.change_weights[I]),
     ...);
    return mean_of_scores<Deviation>(out, o_.change_weights);
  }

  /// rho_t, the share of the other frame that is still in sight, by the first score that measures it; else NaN.
  [[nodiscard]] static double visible_share(const Change& change) {
    double share = std::numeric_limits<double>::quiet_NaN();
    detail::for_each_result(change, [&](const auto& r) {
      using S = typename std::decay_t<decltype(r)>::Score;
      if constexpr (detail::detected_v<detail::score_share_t, S>) {
        if (r.value && share != share) share = S::visible_share(r.measured);
      }
    });
    return share;
  }

  /// Counts the frames that are good by themselves and continue the one before.
  void follow_steps() {
    if (has_previous_) a_.S_step = compare(previous_, ChangeBaseline::Previous, a_.step_scores, kChangeIndices);
    const bool steady = a_.S_step && a_.S_step->value() <= kSteadyStep && a_.feature_tracking_ok &&
                        a_.S_total.value() >= o_.decision.th_differ && a_.dynamic_ratio <= kSteadyDynamicRatio;
    steady_frames_ = steady ? steady_frames_ + 1 : 0;
    a_.steady_frames = steady_frames_;
  }

  [[nodiscard]] double choose_dynamic_ratio(double given, const FrameContext& c) const {
    const double area = Deviation(given).value();
    switch (o_.dynamic_ratio) {
      case DynamicRatio::MaskArea:
        return area;
      case DynamicRatio::Features:
        return dynamic_share_of_keypoints(c);
      case DynamicRatio::Max:
        return std::max(area, dynamic_share_of_keypoints(c));
      case DynamicRatio::Count:
        break;
    }
    const std::vector<Detection>& objects = c.object_list();
    if (objects.empty()) return 0;
    const auto moving =
        std::count_if(objects.begin(), objects.end(), [](const Detection& d) { return d.motion_probability >= kDynamicThreshold; });
    return static_cast<double>(moving) / static_cast<double>(objects.size());
  }
  [[nodiscard]] static double dynamic_share_of_keypoints(const FrameContext& c) {
    int all = 0;
    int still = 0;
    if (c.keypoints == nullptr) return 0;
    for (const Keypoint& k : *c.keypoints) {
      all += is_static_point({}, c.width(), c.height(), k.x, k.y);
      still += c.is_static(k.x, k.y);
    }
    return all > 0 ? 1.0 - static_cast<double>(still) / all : 0.0;
  }

  void initialise() {
    a_.state = SceneState::Initialising;
    const auto step = initialiser_.offer(a_.S_total, a_.feature_tracking_ok && !a_.S_total_missing);
    a_.W_base = o_.decision.w_base;
    a_.W_change = 1.0 - a_.W_base;
    a_.th_f = initialiser_.th_f();
    a_.th_s = initialiser_.th_s();
    a_.initialisation_failed = step.restarted;
    if (step.new_best) best_ = current_;
    if (!step.commit) return;
    benchmark_.set(best_);
    degraded_ = step.degraded;
    a_.benchmark_updated = true;
    update_benchmark(false);  // the best frame of the window may be long out of sight
  }

  void decide() {
    a_.th_f = initialiser_.th_f();
    a_.th_s = initialiser_.th_s();
    const Decision d = decision_.decide(a_.S_total, a_.of(ScoreRole::FeatureQuality), a_.of(ScoreRole::ObjectConfidence), a_.S_change,
                                        a_.dynamic_ratio, a_.S_inn);
    a_.W_base = d.W_base;
    a_.W_change = d.W_change;
    a_.S_final = d.S_final;
    a_.th_differ = d.th_differ;
    a_.good_scene = d.good_scene && a_.feature_tracking_ok;
    a_.scenario_static = d.scenario_static;
    a_.scenario_dynamic = d.scenario_dynamic;
    a_.scenario_objects = d.scenario_objects;
    const bool good = d.good && a_.feature_tracking_ok;
    a_.state = good ? SceneState::Good : SceneState::Bad;
    decision_.remember(d, good);
    if (good) frame_scores_.learn(), change_scores_.learn();

    a_.benchmark_updated = update_benchmark(good);
    if (a_.benchmark_updated && benchmark_.S_reference().value() >= o_.initialisation.quality_min) degraded_ = false;
  }

  APSO_NOINLINE bool update_benchmark(bool good) {
    if (o_.change_baseline == ChangeBaseline::Reference) {
      return benchmark_.update(current_, good, a_.S_change, visible_share(a_.change_scores), steady_frames_);
    }
    Change change;  // staleness is about the benchmark all the same
    compare(benchmark_.reference(), ChangeBaseline::Reference, change, kChangeIndices);
    return benchmark_.update(current_, good, {}, visible_share(change), steady_frames_);
  }

  Pinhole camera_;
  Options o_;
  detail::ScoreObjects<FrameScores> frame_scores_;
  detail::ScoreObjects<ChangeScores> change_scores_;
  BasicInitialiser<InitialThresholds> initialiser_;
  BasicSceneDecision<Threshold> decision_;
  Benchmark<Snapshot> benchmark_;
  InnovationMonitor innovations_;
  Result a_;
  Snapshot current_;
  Snapshot best_;
  Snapshot previous_;
  bool has_previous_ = false;
  int steady_frames_ = 0;
  bool degraded_ = false;
  // room for lists and rows of foreign types
  std::vector<Keypoint> keypoints_;
  std::vector<PointTrack> tracks_;
  std::vector<Detection> objects_;
  std::vector<float> row_;
};

/// The assessor with the scores of the paper.
using SceneAssessor = BasicAssessor<>;

APSO_NAMESPACE_END
