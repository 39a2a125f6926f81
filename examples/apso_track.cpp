// apso_track: the whole method on one sequence. Writes the trajectory, the scores of every frame, an honest error
// against ground truth where there is one, and pictures.

#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/io/camera_yaml.hpp>
#include <apso/io/detection_text.hpp>
#include <apso/io/parameters.hpp>
#include <apso/observation/soft_weights.hpp>
#include <apso/opencv/drawing.hpp>
#include <apso/opencv/feature_tracker.hpp>
#include <apso/opencv/detectors/motion_by_name.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/quality/explain.hpp>
#include <apso/version.hpp>

#include "track/degraded_source.hpp"
#include "track/frame_source.hpp"
#include "track/output.hpp"
#include "track/plots.hpp"
#include "track/pictures.hpp"

namespace {

namespace fs = std::filesystem;
using json = nlohmann::json;

constexpr int exit_bad_input = 1;
constexpr int exit_usage = 2;
constexpr int exit_no_pose = 3;

volatile std::sig_atomic_t interrupted = 0;

struct Arguments {
  std::string sequence;
  std::string output;
  std::string camera;
  std::string config;
  std::string masks;
  std::string detections;
  std::string motion = "geometric";
  std::string spoil;
  std::string model;
  std::string classes;
  std::vector<std::string> movable;
  bool no_refinement = false;
  bool write_masks = false;
  bool true_masks = false;
  bool quiet = false;
  int threads = 1;
  int max_frames = 0;
  int people = -1;
  unsigned seed = 1;
};

struct TrackOptions {
  apso::PipelineOptions pipeline;
  apso::opencv::FeatureTrackerOptions tracker;
  apso::opencv::MotionOptions motion;  ///< of every policy that --motion can name
  apso::SoftWeightOptions soft_weights;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("pipeline", s.pipeline);
    v("tracker", s.tracker);
    v("motion", s.motion);
    v("soft_weights", s.soft_weights);
  }
};

/// Milliseconds since the last call.
class Stopwatch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
    return ms;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

std::unique_ptr<track::FrameSource> open_source(const Arguments& a) {
  const std::string prefix = "synthetic:";
  if (a.sequence.rfind(prefix, 0) == 0) {
    if (!a.camera.empty()) throw apso::io_error("--camera: a synthetic sequence brings its own camera");
    apso::testing::SyntheticOptions options;
    if (a.people >= 0) options.people = a.people;
    if (a.max_frames > 0) options.frames = std::max(options.frames, a.max_frames);
    options.seed = a.seed;
    return std::make_unique<track::SyntheticSource>(a.sequence.substr(prefix.size()), options);
  }
  if (a.camera.empty()) {
    throw apso::io_error(
        "--camera is needed for a recording: tum-fr1, tum-fr2, tum-fr3, bonn, icl-nuim, or a YAML file (wrong "
        "intrinsics or a wrong depth scale give a wrong trajectory silently, so there is no default)");
  }
  // a folder of results may well be called bonn
  const bool is_file = (fs::exists(a.camera) && !fs::is_directory(a.camera)) || a.camera.find('.') != std::string::npos;
  const apso::opencv::CameraModel camera =
      is_file ? apso::camera_from_yaml(a.camera) : apso::camera_by_name(a.camera);
  return std::make_unique<track::RecordedSource>(a.sequence, camera);
}

apso::ClassList class_list(const Arguments& a) {
  apso::ClassList list;
  if (!a.classes.empty()) list.names = apso::read_class_names(a.classes);
  if (!a.movable.empty()) list.movable.clear();
  for (const std::string& name : a.movable) {
    const int id = list.id_of(name);
    if (id < 0) throw apso::io_error("--movable: there is no class '" + name + "'");
    list.movable.push_back(id);
  }
  return list;
}

/// The pipeline with a motion policy that is chosen at run time.
using Pipeline = apso::BasicPipeline<apso::Pose, apso::AnyMotionPolicy>;

/// The policy that --motion names. What it reads itself is taken out of the arguments, so that it is not used twice.
apso::AnyMotionPolicy open_motion(Arguments& a, const apso::Pinhole& camera, const TrackOptions& options) {
  apso::opencv::MotionFiles files;
  files.masks = a.masks;
  files.detections = a.detections;
  files.model = a.model;
  files.classes = class_list(a);
  apso::AnyMotionPolicy policy = apso::opencv::motion_by_name(a.motion, camera, options.motion, files);
  for (const std::string& name : apso::policy_names(a.motion)) {
    if (name == "precomputed" || name == "semantic") a.masks = a.detections = "";
  }
  return policy;
}

void show_progress(int done, int total, const char* state, double ms, bool last) {
  constexpr int width = 32;
  const int filled = total > 0 ? width * done / total : width;
  std::fprintf(stderr, "\r[%s%s] %d/%d  %-12s %5.1f ms/frame ", std::string(static_cast<std::size_t>(filled), '#').c_str(),
               std::string(static_cast<std::size_t>(width - filled), '.').c_str(), done, total, state, ms);
  if (last) std::fputc('\n', stderr);
}

json evaluate(const apso::Trajectory& truth, const apso::Trajectory& estimate) {
  apso::AteOptions ate_options;
  ate_options.association = apso::AssociationRule::Evo;
  const apso::AteResult ate = apso::ate(truth, estimate, ate_options);
  if (!succeeded(ate.status)) return nullptr;
  json result{{"pairs", ate.pairs.size()}, {"ate", track::to_json(ate.statistics)}};
  const auto add_rpe = [&](const char* name, double delta, apso::DeltaUnit unit) {
    apso::RpeOptions options;
    options.delta = delta;
    options.unit = unit;
    const apso::RpeResult rpe = apso::rpe(truth, estimate, options);
    if (!succeeded(rpe.status)) return;
    result[name] = {{"pairs", rpe.translation.count},
                    {"translation", track::to_json(rpe.translation)},
                    {"rotation_deg", track::to_json(rpe.rotation_deg)}};
  };
  add_rpe("rpe_1s", 1.0, apso::DeltaUnit::Seconds);
  add_rpe("rpe_1f", 1.0, apso::DeltaUnit::Frames);
  return result;
}

int run(Arguments a) {
  TrackOptions options;
  if (!a.config.empty()) apso::read_parameters(a.config, options);
  if (a.motion == "none") options.pipeline.motion = false;
  if (a.no_refinement) options.pipeline.refinement = false;

  std::unique_ptr<track::FrameSource> source = open_source(a);
  auto* const synthetic = dynamic_cast<track::SyntheticSource*>(source.get());
  if (!a.spoil.empty()) source = std::make_unique<track::DegradedSource>(std::move(source), a.spoil);
  apso::AnyMotionPolicy motion = open_motion(a, source->camera(), options);
  std::unique_ptr<track::MaskFolder> masks;
  if (!a.masks.empty()) masks = std::make_unique<track::MaskFolder>(a.masks);
  std::unique_ptr<apso::DetectionLog> detections;
  if (!a.detections.empty()) {
    detections = std::make_unique<apso::DetectionLog>(a.detections, source->camera().width, source->camera().height, class_list(a));
  }
  if (a.true_masks && synthetic == nullptr) throw apso::io_error("--true-masks: only synthetic sequences have true masks");

  const fs::path out(a.output);
  fs::create_directories(out / "overlays");
  if (a.write_masks) fs::create_directories(out / "masks");
  cv::setNumThreads(a.threads);
  for (const std::string& w : source->warnings()) std::fprintf(stderr, "warning: %s\n", w.c_str());

  Pipeline pipeline(source->camera(), std::move(motion), options.pipeline);
  apso::opencv::FeatureTracker tracker(source->camera(), options.tracker);
  track::FrameTable table((out / "frames.csv").string());
  track::OverlayChooser overlays(out / "overlays");

  apso::Trajectory final_poses;
  apso::Trajectory feature_poses;
  std::vector<apso::FrameReport> reports;
  std::vector<track::Timing> timings;
  json skipped = json::array();
  json mask_problems = json::array();
  std::string failure;
  const int total = a.max_frames > 0 ? std::min(a.max_frames, source->size()) : source->size();

  track::LoadedFrame frame;
  cv::Mat mask;
  cv::Mat mask_out;
  apso::Image<float> soft;        // the mask, softened
  int softened = 0;
  for (int i = 0; i < total && interrupted == 0; ++i) {
    try {
      Stopwatch watch;
      track::Timing ms;
      if (const auto problem = source->load(i, frame)) {
        skipped.push_back({{"frame", i}, {"timestamp", source->timestamp(i)}, {"reason", *problem}});
        continue;
      }
      mask.release();
      if (masks) {
        if (const auto problem = masks->load(frame.name, frame.gray.size(), mask)) mask_problems.push_back(*problem);
      }
      if (a.true_masks) mask = cv::Mat(frame.gray.size(), CV_8UC1, const_cast<std::uint8_t*>(synthetic->truth().instance.data())).clone();
      ms.load = watch.lap();

      tracker.begin(frame.gray, frame.rgbd);
      // The last mask is close enough for a first pose; the motion policy starts from that.
      const auto prior = tracker.estimate(pipeline.observation().mask.probability);
      ms.features = watch.lap();

      const auto* objects = detections ? &detections->at(frame.timestamp) : nullptr;
      apso::ImageView<const std::uint8_t> labels;
      if (!mask.empty()) labels = apso::opencv::as_image<std::uint8_t>(mask);
      const apso::Observation& observation = pipeline.observe(frame.rgbd, prior.T_world_camera, tracker.tracks(), objects,
                                                              labels.empty() ? nullptr : &labels);
      ms.observe = watch.lap();

      const apso::StaticSupport support = apso::static_support(observation.mask.probability, tracker.keypoints());
      const bool soften = !support.enough(options.soft_weights);
      if (soften) {  // too little is left: what is dynamic counts a little
        soft = observation.mask.probability;
        softened += apso::soften(tracker.keypoints(), options.soft_weights, soft) ? 1 : 0;
      }
      const auto features = observation.informative ? tracker.estimate(soften ? soft : observation.mask.probability) : prior;
      ms.features += watch.lap();

      pipeline.assess(tracker.keypoints(), tracker.tracks(), {features.T_world_camera, features.T_world_predicted, features.ok});
      ms.assess = watch.lap();
      const apso::FrameReport& report = pipeline.conclude();
      ms.refine = watch.lap();
      tracker.commit(report.T_world_camera, observation.mask.probability, report.keyframe_allowed);
      ms.map = watch.lap();

      if (report.state != apso::SceneState::Lost) final_poses.push_back({frame.timestamp, report.T_world_camera});
      if (features.ok) feature_poses.push_back({frame.timestamp, report.T_world_feature});
      table.write(i, source->label(i), report, observation, features, tracker.keyframes(), tracker.landmarks(), ms);
      reports.push_back(report);
      timings.push_back(ms);
      overlays.offer(i, total, report, [&] {
        return apso::opencv::draw_overlay(frame.bgr, observation, tracker.keypoints(), report);
      });
      if (a.write_masks) {
        apso::opencv::mask_to_8bit(observation.mask, mask_out);
        const std::string file = (out / "masks" / (frame.name + ".png")).string();
        if (!cv::imwrite(file, mask_out)) throw apso::io_error(file + ": cannot write");
      }
      if (!a.quiet) show_progress(i + 1, total, to_string(report.state), ms.total(), i + 1 == total);
    } catch (const std::exception& e) {
      // Nothing that is computed is lost: stop here, write what there is, and say what happened.
      failure = "frame " + std::to_string(i) + ": " + e.what();
      break;
    }
  }

  apso::write_trajectory((out / "trajectory.txt").string(), final_poses);
  apso::write_trajectory((out / "trajectory_features.txt").string(), feature_poses);
  if (!source->groundtruth().empty()) apso::write_trajectory((out / "groundtruth.txt").string(), source->groundtruth());
  overlays.finish();

  int bad = 0, lost = 0, initialising = 0, refined = 0;
  for (const apso::FrameReport& r : reports) {
    bad += r.state == apso::SceneState::Bad;
    lost += r.state == apso::SceneState::Lost;
    initialising += r.state == apso::SceneState::Initialising;
    refined += r.refined;
  }
  json summary;
  summary["version"] = APSO_VERSION;
  summary["sequence"] = a.sequence;
  summary["motion"] = a.motion;
  summary["refinement"] = options.pipeline.refinement;
  summary["frames"] = {{"in_sequence", total}, {"processed", reports.size()}, {"skipped", skipped.size()},
                       {"with_pose", final_poses.size()}, {"good", static_cast<int>(reports.size()) - bad - lost - initialising},
                       {"bad", bad}, {"lost", lost}, {"initialising", initialising}, {"refined", refined},
                       {"soft_weights", softened}};
  summary["skipped"] = skipped;
  summary["mask_problems"] = mask_problems;
  const auto column = [&](auto&& f) {
    std::vector<double> v;
    for (const auto& t : timings) v.push_back(f(t));
    return track::distribution(v);
  };
  summary["ms"] = {{"load", column([](const auto& t) { return t.load; })},
                   {"features", column([](const auto& t) { return t.features; })},
                   {"observe", column([](const auto& t) { return t.observe; })},
                   {"assess", column([](const auto& t) { return t.assess; })},
                   {"refine", column([](const auto& t) { return t.refine; })},
                   {"map", column([](const auto& t) { return t.map; })},
                   {"total", column([](const auto& t) { return t.total(); })}};
  apso::Trajectory aligned_truth;
  if (!source->groundtruth().empty()) {
    try {
      summary["final"] = evaluate(source->groundtruth(), final_poses);
      summary["features"] = evaluate(source->groundtruth(), feature_poses);
      aligned_truth = track::aligned_truth(source->groundtruth(), final_poses);
    } catch (const std::exception& e) {
      summary["evaluation_problem"] = e.what();
    }
  }
  summary["options"] = track::yaml_to_json(apso::write_parameters(options));
  if (!failure.empty()) summary["failure"] = failure;
  if (interrupted != 0) summary["failure"] = "interrupted";
  std::ofstream((out / "summary.json").string()) << summary.dump(2) << '\n';

  track::plot_trajectory((out / "trajectory.png").string(), aligned_truth, feature_poses, final_poses, a.sequence);
  track::plot_scores((out / "scores.png").string(), reports, a.sequence);
  track::write_overview(out);

  std::printf("%s: %zu of %d frames with a pose, %d BAD (%d refined), %d lost, %zu skipped\n", a.sequence.c_str(),
              final_poses.size(), total, bad, refined, lost, skipped.size());
  for (const auto& s : skipped) std::printf("  skipped frame %d: %s\n", s["frame"].get<int>(), s["reason"].get<std::string>().c_str());
  if (summary.contains("final") && summary["final"].is_object()) {
    std::printf("ATE rmse %.4f m over %zu pairs; feature poses alone %s\n", summary["final"]["ate"]["rmse"].get<double>(),
                summary["final"]["pairs"].get<std::size_t>(),
                summary["features"].is_object() ? (std::to_string(summary["features"]["ate"]["rmse"].get<double>()) + " m").c_str() : "too few");
  }
  std::printf("results in %s: trajectory.txt, frames.csv, summary.json, overview.png, overlays/\n", a.output.c_str());
  if (!failure.empty()) {
    std::fprintf(stderr, "apso_track: %s; the results so far are kept\n", failure.c_str());
    return exit_bad_input;
  }
  if (interrupted != 0) return 130;
  return final_poses.empty() ? exit_no_pose : 0;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app{
      "Tracks an RGB-D sequence where people and things move: what moves, how far each frame can be trusted, and the\n"
      "repaired trajectory. Exit code: 0 done, 1 bad input, 2 wrong usage, 3 no frame got a pose, 130 interrupted."};
  app.set_version_flag("--version", APSO_VERSION);
  std::string names;
  for (const std::string& n : apso::testing::SyntheticSequence::names()) names += (names.empty() ? "" : ", ") + n;
  app.add_option("SEQUENCE", a.sequence, "folder in TUM format (rgb.txt and depth.txt, or associations.txt; groundtruth.txt is\n"
                                         "optional), or synthetic:NAME with NAME one of " + names)->required();
  app.add_option("--output", a.output, "folder for the results")->required();
  app.add_option("--camera", a.camera, "tum-fr1, tum-fr2, tum-fr3, bonn, icl-nuim, or a YAML file with fx, fy, cx, cy, ...");
  app.add_option("--config", a.config, "YAML file with options; summary.json lists all of them with their values");
  app.add_option("--masks", a.masks, "folder of mask images named by the colour stamp (nonzero = dynamic)");
  app.add_option("--detections", a.detections, "text file, lines: timestamp left top width height score class_id; or folder with a\n"
                                               "text file per image, named by its stamp, lines: class cx cy width height [score] in\n"
                                               "shares of the image, or left:.. top:.. right:.. bottom:.. class:NAME [score]");
  std::string policies;
  const apso::opencv::MotionOptions motion_options;
  const apso::opencv::MotionFiles motion_files;
  const apso::Pinhole any_camera;
  for (const apso::NamedPolicy& p : apso::opencv::motion_table(any_camera, motion_options, motion_files)) {
    policies += "\n  " + p.name + (p.takes_policy() ? "(P): " : ": ") + p.summary;
  }
  app.add_option("--motion", a.motion, "motion policy, or several: P+Q either, P*Q both, P&Q objects of P that Q sees move; brackets\n"
                                       "group. P and Q are:" + policies)->capture_default_str();
  app.add_option("--model", a.model, "ONNX file of a detection or segmentation network, for the policy dnn; its input size, thresholds\n"
                                     "and form of output are options (--config, motion.dnn)");
  app.add_option("--classes", a.classes, "text file with the class names of the network, one per line (default: the 80 of COCO)");
  app.add_option("--movable", a.movable, "names or numbers of the classes that can move (default: person, cat, dog)")->delimiter(',')->allow_extra_args(false);
  app.add_flag("--no-refinement", a.no_refinement, "do not repair the pose of BAD frames");
  app.add_flag("--write-masks", a.write_masks, "write masks/ (8-bit PNG, 255 = dynamic, named by the colour stamp)");
  app.add_option("--threads", a.threads, "threads of the image operations")->check(CLI::Range(1, 256))->capture_default_str();
  app.add_option("--max-frames", a.max_frames, "stop after this many frames (0 = all)")->check(CLI::NonNegativeNumber);
  app.add_option("--spoil", a.spoil, "spoil two frames of every twenty, to see whether they are noticed")
      ->check(CLI::IsMember(track::DegradedSource::kinds()));
  app.add_option("--people", a.people, "synthetic sequences: number of walking people")->check(CLI::Range(0, 3));
  app.add_option("--seed", a.seed, "synthetic sequences: seed of the world and its noise")->capture_default_str();
  app.add_flag("--true-masks", a.true_masks, "synthetic sequences: use the true masks");
  app.add_flag("--quiet", a.quiet, "no progress bar");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : exit_usage;
  }
  std::signal(SIGINT, [](int) { interrupted = 1; });
  try {
    return run(a);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "apso_track: %s\n", e.what());
    return exit_bad_input;
  }
}
