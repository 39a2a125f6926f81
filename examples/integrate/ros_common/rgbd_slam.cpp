#include "rgbd_slam.hpp"

#include <opencv2/imgproc.hpp>

#include <apso/opencv/adapters.hpp>
#include <apso/opencv/drawing.hpp>
#include <apso/opencv/feature_tracker.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/traits/frame.hpp>

namespace apso_ros {

struct RgbdSlam::State {
  State(const apso::Pinhole& camera, const SlamSettings& s) : settings(s), pipeline(camera, options(s)), tracker(camera) {}
  static apso::PipelineOptions options(const SlamSettings& s) {
    apso::PipelineOptions o;
    o.motion = s.motion;
    if (!s.refinement) o.refine = apso::RefinedFrames::None;
    return o;
  }
  SlamSettings settings;
  apso::Pipeline pipeline;
  apso::opencv::FeatureTracker tracker;
};

RgbdSlam::RgbdSlam(const apso::Pinhole& camera, const SlamSettings& settings) : state_(std::make_unique<State>(camera, settings)) {}
RgbdSlam::~RgbdSlam() = default;

SlamFrame RgbdSlam::process(double timestamp, const apso::Image<std::uint8_t>& grey, const apso::Image<float>& depth) {
  State& s = *state_;
  const auto frame = apso::frame(timestamp, grey, depth, s.pipeline.camera());
  const cv::Mat grey_mat = apso::opencv::as_mat(grey.view());

  // [frame]
  s.tracker.begin(grey_mat, frame);
  const auto prior = s.tracker.estimate(s.pipeline.observation().mask.probability);
  const apso::Observation& seen = s.pipeline.observe(frame, prior.T_world_camera, s.tracker.tracks());
  const auto features = seen.informative ? s.tracker.estimate(seen.mask.probability) : prior;
  s.pipeline.assess(s.tracker.keypoints(), s.tracker.tracks(),
                    {features.T_world_camera, features.T_world_predicted, features.ok, features.information, features.confirmed_matches()});
  const apso::FrameReport& report = s.pipeline.conclude();
  s.tracker.commit(report.T_world_camera, seen.mask.probability, report.keyframe_allowed);
  // [/frame]

  SlamFrame out;
  out.has_pose = report.state != apso::SceneState::Lost;
  out.T_world_camera = report.T_world_camera;
  out.state = apso::to_string(report.state);
  out.trustworthy = report.state == apso::SceneState::Good || report.refined;
  const apso::Assessment& a = report.assessment;
  const auto score = [&out](const char* name, const auto& q) {
    if (q) out.values.emplace_back(name, q->value());
  };
  out.values.emplace_back("S_total", a.S_total.value());
  apso::for_each_score(a, [&out](const char* name, const auto& value, double, apso::Better) {
    if (value) out.values.emplace_back(name, *value);
  });
  score("S_change", a.S_change);
  out.values.emplace_back("dynamic_ratio", a.dynamic_ratio);
  out.values.emplace_back("refined", report.refined ? 1.0 : 0.0);
  if (s.settings.overlay) {
    cv::Mat bgr;
    cv::cvtColor(grey_mat, bgr, cv::COLOR_GRAY2BGR);
    const cv::Mat drawn = apso::opencv::draw_overlay(bgr, seen, s.tracker.keypoints(), report);
    out.overlay_width = drawn.cols;
    out.overlay_height = drawn.rows;
    for (int y = 0; y < drawn.rows; ++y) out.overlay_bgr.insert(out.overlay_bgr.end(), drawn.ptr(y), drawn.ptr(y) + 3 * drawn.cols);
  }
  return out;
}

}  // namespace apso_ros
