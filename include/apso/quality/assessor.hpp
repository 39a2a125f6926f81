/// \file
/// The quality module of the paper as one class: all scores of a frame, the thresholds, the benchmark, the decision.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/statistics.hpp>
#include <apso/options.hpp>
#include <apso/quality/threshold.hpp>
#include <apso/quality/benchmark.hpp>
#include <apso/quality/change_score.hpp>
#include <apso/quality/scores/confidence.hpp>
#include <apso/quality/scores/depth.hpp>
#include <apso/quality/scores/depth_change.hpp>
#include <apso/quality/scores/detection_change.hpp>
#include <apso/quality/scores/feature.hpp>
#include <apso/quality/frame_score.hpp>
#include <apso/quality/scores/motion_change.hpp>
#include <apso/quality/decision.hpp>
#include <apso/quality/scores/sharpness.hpp>
#include <apso/quality/scores/spatial.hpp>
#include <apso/quality/static_pixel.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/score.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// Which dynamic ratio enters the weights.
enum class DynamicRatio {
  MaskArea,  ///< the ratio given with the frame: mean dynamic probability of the pixels
  Count,     ///< moving objects / objects; 0 without objects
  Features,  ///< dynamic keypoints / keypoints; 0 without keypoints
  Max        ///< the larger of MaskArea and Features
};
constexpr std::array<const char*, 4> enum_names(DynamicRatio) { return {"mask_area", "count", "features", "max"}; }

struct AssessorOptions {
  ConfidenceOptions confidence;
  SpatialOptions spatial;
  FeatureOptions feature;
  SharpnessOptions sharpness;
  DepthQualityOptions depth;
  FrameWeights frame_weights;
  MotionChangeOptions motion_change;
  DepthChangeOptions depth_change;
  DetectionChangeOptions detection_change;
  ChangeWeights change_weights;
  ChangeBaseline change_baseline = ChangeBaseline::Reference;
  DynamicRatio dynamic_ratio = DynamicRatio::MaskArea;
  InitialisationOptions initialisation;
  DecisionOptions decision;
  BenchmarkOptions benchmark;
  int response_window = 300;  ///< GOOD frames that s_ref and the usual sharpness are the medians of
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("confidence", s.confidence);
    v("spatial", s.spatial);
    v("feature", s.feature);
    v("sharpness", s.sharpness);
    v("depth", s.depth);
    v("frame_weights", s.frame_weights);
    v("motion_change", s.motion_change);
    v("depth_change", s.depth_change);
    v("detection_change", s.detection_change);
    v("change_weights", s.change_weights);
    v("change_baseline", s.change_baseline);
    v("dynamic_ratio", s.dynamic_ratio);
    v("initialisation", s.initialisation);
    v("decision", s.decision);
    v("benchmark", s.benchmark);
    v("response_window", s.response_window, 1, 100000);
  }
};

/// What is known about a frame when it is assessed. Nothing is kept beyond the call.
struct AssessmentInput {
  RgbdFrame frame;                               ///< without intensity blur is not seen, without depth S_depth and
                                                 ///< S_dc are missing
  ImageView<const float> dynamic_probability;    ///< [0,1], of the frame's size; empty = everything static
  const std::vector<Keypoint>* keypoints = nullptr;   ///< null: S_feature is missing
  const std::vector<PointTrack>* tracks = nullptr;    ///< null: S_mc is missing
  const std::vector<Detection>* objects = nullptr;    ///< null: S_dec is missing; else as an empty list
  double dynamic_ratio = 0;                      ///< [0,1]; NaN counts as 1
  bool feature_tracking_ok = true;               ///< did the feature tracker find a pose?
};

enum class SceneState { Initialising, Good, Bad, Lost };
constexpr std::array<const char*, 4> enum_names(SceneState) { return {"INITIALISING", "GOOD", "BAD", "LOST"}; }
/// Name of a state, for reports.
[[nodiscard]] constexpr const char* to_string(SceneState s) {
  return enum_names(SceneState{})[static_cast<std::size_t>(s)];
}

/// Everything that was computed about a frame.
struct Assessment {
  double timestamp = 0;  ///< [s]
  int frame = 0;         ///< frames assessed since the start or reset(), 1 for the first

  MaybeQuality S_conf;
  MaybeQuality S_spatial;
  MaybeQuality S_feature;
  MaybeQuality S_depth;
  Quality S_total;               ///< 0 when every component is missing
  bool S_total_missing = false;  ///< every component is missing
  MaybeDeviation S_mc;
  MaybeDeviation S_dc;
  MaybeDeviation S_dec;
  MaybeDeviation S_change;       ///< missing as long as there is nothing to compare with
  MaybeDeviation S_step;         ///< the same score against the frame before; decides about hand-over only
  int steady_frames = 0;         ///< frames in a row that are good by themselves and continue the one before

  double dynamic_ratio = 0;  ///< [0,1], the one that entered the weights
  double W_base = 0;
  double W_change = 0;
  MaybeQuality S_final;      ///< missing while initialising
  double th_f = 0;           ///< [frames]
  double th_s = 0;           ///< [0,1]
  double th_differ = 0;      ///< [0,1]; 0 while initialising
  bool scenario_static = false;   ///< static, rich in features: S_final boosted
  bool scenario_dynamic = false;  ///< dynamic: the change counts most
  bool scenario_objects = false;  ///< confident detections: S_final boosted

  SceneState state = SceneState::Initialising;  ///< never Lost: that is for whoever owns the pose to say
  bool feature_tracking_ok = true;
  bool degraded = false;               ///< the reference was committed by timeout with too low a score
  bool initialisation_failed = false;  ///< the search for a reference began anew with this frame
  bool benchmark_updated = false;      ///< the reference was set or replaced after this frame
  double benchmark_age = 0;            ///< age of the frame compared with [s]; 0 without one
  double S_reference = 0;              ///< S_total of the frame compared with

  FeatureMeasure features;      ///< counts behind S_feature
  FeatureScore feature_parts;   ///< S_cnt, S_resp, S_unif
  SharpnessMeasure sharpness;   ///< contrast ratios behind S_sharp
  MaybeQuality S_sharp;         ///< factor of S_feature; missing without an intensity image
  DepthScore depth_parts;       ///< S_cov, S_cons, S_smo
  double step_flow = 0;         ///< flow against the frame before, mean of point and grid [image diagonals]
  MotionChange motion_parts;    ///< flow and overlap behind S_mc
  DepthChange depth_change_parts;
  DetectionChange detection_parts;
  double response_reference = 0;  ///< s_ref, with its floor
  int static_keypoints = 0;
  int static_tracks = 0;          ///< tracks on static pixels
  int reference_tracks = 0;       ///< static tracks the reference had
  int tracks_from_reference = 0;  ///< ... of which so many are still followed
  int objects = 0;                ///< objects in the frame
};

/// Assesses frame after frame. Call assess() once per frame, in the order of time.
class SceneAssessor {
 public:
  explicit SceneAssessor(const Pinhole& camera, const AssessorOptions& options = {})
      : camera_(camera),
        o_(checked(options)),
        initialiser_(options.initialisation),
        decision_(options.decision),
        benchmark_(options.benchmark),
        responses_(options.response_window),
        sharpness_x_(options.response_window),
        sharpness_y_(options.response_window) {
    camera_.validate();
  }

  /// Scores, state and reasons of a frame. The result is valid until the next call.
  const Assessment& assess(const AssessmentInput& input) {
    check(input);
    const int frame = a_.frame + 1;
    a_ = Assessment{};
    a_.frame = frame;
    a_.timestamp = input.frame.timestamp;
    a_.feature_tracking_ok = input.feature_tracking_ok;
    const std::vector<Detection>& objects = input.objects ? *input.objects : no_objects_;
    a_.objects = static_cast<int>(objects.size());

    score_frame(input, objects);
    take_snapshot(input);
    const FrameSnapshot* baseline = choose_baseline();
    if (baseline) score_change(*baseline);
    a_.dynamic_ratio = choose_dynamic_ratio(input.dynamic_ratio, objects);
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
  /// The last result.
  [[nodiscard]] const Assessment& assessment() const { return a_; }

  /// Forgets everything.
  void reset() {
    a_ = Assessment{};
    responses_.clear();
    sharpness_x_.clear();
    sharpness_y_.clear();
    has_previous_ = false;
    steady_frames_ = 0;
    reset_benchmark();
  }
  /// Forgets the reference and searches a new one, e.g. in a new place; the calibration of the responses stays.
  void reset_benchmark() {
    initialiser_.reset();
    decision_.reset();
    benchmark_.reset();
    degraded_ = false;
  }
  [[nodiscard]] const AssessorOptions& options() const { return o_; }

 private:
  static const AssessorOptions& checked(const AssessorOptions& o) {
    apso::validate(o, "assessor");
    validate_weights(std::array<double, 4>{o.frame_weights.conf, o.frame_weights.spatial, o.frame_weights.feature,
                                           o.frame_weights.depth},
                     "assessor.frame_weights");
    validate_weights(std::array<double, 3>{o.change_weights.motion, o.change_weights.depth, o.change_weights.detection},
                     "assessor.change_weights");
    validate_weights(std::array<double, 3>{o.depth.w_coverage, o.depth.w_consistency, o.depth.w_smoothness},
                     "assessor.depth.w_*");
    return o;
  }
  void check(const AssessmentInput& in) const {
    const auto fits = [&](int w, int h) { return w == camera_.width && h == camera_.height; };
    expects(std::isfinite(in.frame.timestamp), "SceneAssessor: the timestamp is not finite");
    expects(in.frame.depth.empty() || fits(in.frame.depth.width, in.frame.depth.height),
            "SceneAssessor: the depth image has not the size of the camera");
    expects(in.frame.intensity.empty() || fits(in.frame.intensity.width, in.frame.intensity.height),
            "SceneAssessor: the intensity image has not the size of the camera");
    expects(in.dynamic_probability.empty() || fits(in.dynamic_probability.width, in.dynamic_probability.height),
            "SceneAssessor: the dynamic map has not the size of the camera");
  }

  void score_frame(const AssessmentInput& in, const std::vector<Detection>& objects) {
    const int w = camera_.width;
    const int h = camera_.height;
    a_.S_conf = confidence_score(objects, w, h, o_.confidence);
    a_.S_spatial = spatial_score(objects, w, h, o_.spatial, spatial_scratch_);
    if (in.keypoints) {
      a_.features = measure_features(*in.keypoints, in.dynamic_probability, w, h, o_.feature, feature_scratch_);
      a_.static_keypoints = a_.features.static_keypoints;
      if (o_.sharpness.enabled) a_.sharpness = measure_sharpness(in.frame.intensity, o_.sharpness);
      if (!benchmark_.present()) learn_usual();
      a_.response_reference = std::max(o_.feature.response_floor, responses_.median());
      a_.feature_parts = feature_score(a_.features, a_.response_reference, o_.feature);
      a_.S_feature = a_.feature_parts.score;
      if (a_.sharpness.valid) {
        a_.S_sharp = sharpness_score(a_.sharpness, sharpness_x_.median(), sharpness_y_.median(), o_.sharpness);
        a_.S_feature = Quality(a_.S_feature->value() * a_.S_sharp->value());
      }
    }
    if (!in.frame.depth.empty()) {
      a_.depth_parts = depth_score(in.frame.depth, o_.depth);
      a_.S_depth = a_.depth_parts.score;
    }
    const MaybeQuality total = frame_score(a_.S_conf, a_.S_spatial, a_.S_feature, a_.S_depth, o_.frame_weights);
    a_.S_total_missing = !total;
    a_.S_total = total.value_or(Quality(0.0));
  }

  /// The response and the sharpness that are usual here.
  void learn_usual() {
    if (a_.static_keypoints > 0) responses_.add(a_.features.median_response);
    if (a_.sharpness.valid) {
      sharpness_x_.add(a_.sharpness.ratio_x);
      sharpness_y_.add(a_.sharpness.ratio_y);
    }
  }

  void take_snapshot(const AssessmentInput& in) {
    current_.timestamp = in.frame.timestamp;
    current_.S_total = a_.S_total;
    current_.has_tracks = in.tracks != nullptr;
    current_.points.clear();
    if (in.tracks) {
      for (const PointTrack& t : *in.tracks) {
        if (is_static_point(in.dynamic_probability, camera_.width, camera_.height, t.x, t.y)) {
          current_.points.push_back({t.id, t.x, t.y});
        }
      }
      const auto by_id = [](const FrameSnapshot::Point& l, const FrameSnapshot::Point& r) { return l.id < r.id; };
      if (!std::is_sorted(current_.points.begin(), current_.points.end(), by_id)) {
        std::sort(current_.points.begin(), current_.points.end(), by_id);
      }
    }
    a_.static_tracks = static_cast<int>(current_.points.size());
    sample_depth(in.frame.depth, in.dynamic_probability, o_.depth_change, current_.depth);
    current_.has_objects = in.objects != nullptr;
    current_.objects.clear();
    if (in.objects) {
      for (const Detection& d : *in.objects) {
        current_.objects.push_back(d);
        current_.objects.back().mask = {};  // the pixels belong to the caller
      }
    }
  }

  [[nodiscard]] const FrameSnapshot* choose_baseline() const {
    if (o_.change_baseline == ChangeBaseline::Previous) return has_previous_ ? &previous_ : nullptr;
    if (benchmark_.present()) return &benchmark_.reference();
    return initialiser_.has_best() ? &best_ : nullptr;
  }

  void score_change(const FrameSnapshot& r) {
    a_.benchmark_age = std::max(0.0, current_.timestamp - r.timestamp);
    a_.S_reference = r.S_total.value();
    const Change c = compare(r, o_.change_baseline);
    a_.S_mc = c.S_mc;
    a_.S_dc = c.S_dc;
    a_.S_dec = c.S_dec;
    a_.S_change = c.S_change;
    a_.motion_parts = c.motion;
    a_.depth_change_parts = c.depth;
    a_.detection_parts = c.detection;
    if (c.S_mc) {
      a_.reference_tracks = static_cast<int>(r.points.size());
      a_.tracks_from_reference = c.motion.tracks;
    }
  }

  /// All change scores of the current frame against another.
  struct Change {
    MaybeDeviation S_mc, S_dc, S_dec, S_change;
    MotionChange motion;
    DepthChange depth;
    DetectionChange detection;
  };
  Change compare(const FrameSnapshot& r, ChangeBaseline scale_of) {
    Change c;
    if (r.has_tracks && current_.has_tracks) {
      match_points(r, current_, matches_);
      const double scale =
          scale_of == ChangeBaseline::Reference ? o_.motion_change.scale : o_.motion_change.scale_previous;
      c.motion = motion_change(matches_, static_cast<int>(r.points.size()), camera_.width, camera_.height,
                               o_.motion_change, scale, motion_scratch_);
      c.S_mc = c.motion.score;
    }
    if (r.depth.present && current_.depth.present) {
      c.depth = depth_change(r.depth, current_.depth, o_.depth_change);
      c.S_dc = c.depth.score;
    }
    if (r.has_objects && current_.has_objects) {
      c.detection = detection_change(r.objects, current_.objects, o_.detection_change, detection_scratch_);
      c.S_dec = c.detection.score;
    }
    c.S_change = change_score(c.S_mc, c.S_dc, c.S_dec, o_.change_weights);
    return c;
  }

  /// Counts the frames that are good by themselves and continue the one before.
  void follow_steps() {
    if (has_previous_) {
      const Change step = compare(previous_, ChangeBaseline::Previous);
      a_.S_step = step.S_change;
      a_.step_flow = 0.5 * (step.motion.m_point + step.motion.m_grid);
    }
    const bool steady = a_.S_step && a_.S_step->value() <= o_.benchmark.max_step && a_.feature_tracking_ok &&
                        a_.S_total.value() >= o_.decision.th_differ && a_.dynamic_ratio <= o_.benchmark.max_dynamic;
    steady_frames_ = steady ? steady_frames_ + 1 : 0;
    a_.steady_frames = steady_frames_;
  }

  [[nodiscard]] double choose_dynamic_ratio(double given, const std::vector<Detection>& objects) const {
    const double area = Deviation(given).value();
    const double features =
        a_.features.keypoints > 0 ? 1.0 - static_cast<double>(a_.static_keypoints) / a_.features.keypoints : 0.0;
    switch (o_.dynamic_ratio) {
      case DynamicRatio::MaskArea: return area;
      case DynamicRatio::Features: return features;
      case DynamicRatio::Max: return std::max(area, features);
      case DynamicRatio::Count: break;
    }
    if (objects.empty()) return 0;
    const auto moving = std::count_if(objects.begin(), objects.end(),
                                      [](const Detection& d) { return d.motion_probability >= 0.5F; });
    return static_cast<double>(moving) / static_cast<double>(objects.size());
  }

  void initialise() {
    a_.state = SceneState::Initialising;
    const Initialiser::Step step = initialiser_.offer(a_.S_total, a_.feature_tracking_ok && !a_.S_total_missing);
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
    const Decision d = decision_.decide(a_.S_total, a_.S_feature, a_.S_conf, a_.S_change, a_.dynamic_ratio);
    a_.W_base = d.W_base;
    a_.W_change = d.W_change;
    a_.S_final = d.S_final;
    a_.th_differ = d.th_differ;
    a_.scenario_static = d.scenario_static;
    a_.scenario_dynamic = d.scenario_dynamic;
    a_.scenario_objects = d.scenario_objects;
    const bool good = d.good && a_.feature_tracking_ok;
    a_.state = good ? SceneState::Good : SceneState::Bad;
    decision_.remember(d, good);
    if (good) learn_usual();

    a_.benchmark_updated = update_benchmark(good);
    if (a_.benchmark_updated && benchmark_.reference().S_total.value() >= o_.initialisation.quality_min) {
      degraded_ = false;
    }
  }

  bool update_benchmark(bool good) {
    double overlap = std::numeric_limits<double>::quiet_NaN();
    MaybeDeviation change = a_.S_change;
    if (a_.S_mc) {
      overlap = a_.motion_parts.overlap;
      if (o_.change_baseline == ChangeBaseline::Previous) {  // staleness is about the benchmark all the same
        match_points(benchmark_.reference(), current_, matches_);
        overlap = benchmark_.reference().points.empty()
                      ? 0.0
                      : static_cast<double>(matches_.size()) /
                            (o_.motion_change.full_overlap * static_cast<double>(benchmark_.reference().points.size()));
        change = {};
      }
    }
    return benchmark_.update(current_, good, change, overlap, steady_frames_);
  }

  Pinhole camera_;
  AssessorOptions o_;
  Initialiser initialiser_;
  SceneDecision decision_;
  Benchmark benchmark_;
  RunningMedian responses_;
  RunningMedian sharpness_x_;
  RunningMedian sharpness_y_;
  Assessment a_;
  FrameSnapshot current_;
  FrameSnapshot best_;
  FrameSnapshot previous_;
  bool has_previous_ = false;
  int steady_frames_ = 0;
  bool degraded_ = false;
  std::vector<Detection> no_objects_;
  std::vector<Correspondence> matches_;
  std::vector<float> spatial_scratch_;
  FeatureScratch feature_scratch_;
  MotionScratch motion_scratch_;
  DetectionScratch detection_scratch_;
};

APSO_NAMESPACE_END
