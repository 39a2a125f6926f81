// apso_track: the whole method on one sequence. Writes the trajectory, the scores of every frame, pictures, and the error if
// there is ground truth.

#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <apso/io/camera_yaml.hpp>
#include <apso/io/detection_text.hpp>
#include <apso/io/parameters.hpp>
#include <apso/observation/soft_weights.hpp>
#include <apso/opencv/drawing.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/version.hpp>

#include "track/config.hpp"
#include "track/degraded_source.hpp"
#include "track/frame_source.hpp"
#include "track/output.hpp"
#include "track/pictures.hpp"
#include "track/plots.hpp"
#include "track/progress.hpp"
#include "track/results.hpp"
#include "track/summary.hpp"

namespace {

namespace fs = std::filesystem;
using json = nlohmann::json;

constexpr int exit_bad_input = 1;
constexpr int exit_usage = 2;
constexpr int exit_no_pose = 3;
constexpr int exit_interrupted = 130;  // as shells report SIGINT

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

/// The policy that --motion names. Files that it reads are removed from the arguments, so that they are not used twice.
apso::AnyMotionPolicy open_motion(Arguments& a, const apso::Pinhole& camera, const apso::opencv::MotionOptions& options) {
  apso::opencv::MotionFiles files;
  files.masks = a.masks;
  files.detections = a.detections;
  files.model = a.model;
  files.classes = class_list(a);
  apso::AnyMotionPolicy policy = apso::opencv::motion_by_name(a.motion, camera, options, files);
  for (const std::string& name : apso::policy_names(a.motion)) {
    if (name == "precomputed" || name == "semantic") a.masks = a.detections = "";
  }
  return policy;
}

/// One run of the program: what it reads, what it computes with, what it writes.
class Run {
 public:
  explicit Run(const Arguments& a);
  /// \return the exit code
  int execute();

 private:
  void process(int i);
  void write();

  Arguments a_;
  track::Config options_;
  std::unique_ptr<track::FrameSource> source_;
  track::SyntheticSource* synthetic_ = nullptr;  ///< the source, if it is one
  std::unique_ptr<track::MaskFolder> masks_;
  std::unique_ptr<apso::DetectionLog> detections_;
  fs::path out_;
  bool holds_masks_ = false;
  int total_ = 0;  ///< frames to process
  std::optional<Pipeline> pipeline_;
  std::optional<apso::opencv::FeatureTracker> tracker_;
  std::optional<track::FrameTable> table_;
  std::optional<track::OverlayChooser> overlays_;
  track::ProgressLine progress_;
  track::Record record_;

  track::LoadedFrame frame_;
  cv::Mat mask_;
  cv::Mat mask_out_;
  apso::Image<float> soft_;   ///< the mask, softened
};

Run::Run(const Arguments& a) : a_(a), progress_(!a.quiet) {
  if (!a_.config.empty()) apso::read_parameters(a_.config, options_);
  if (a_.motion == "none") options_.pipeline.motion = false;
  if (a_.no_refinement) options_.pipeline.refine = apso::RefinedFrames::None;

  const std::string masks_read = a_.masks;
  source_ = open_source(a_);
  synthetic_ = dynamic_cast<track::SyntheticSource*>(source_.get());
  if (!a_.spoil.empty()) source_ = std::make_unique<track::DegradedSource>(std::move(source_), a_.spoil);
  apso::AnyMotionPolicy motion = open_motion(a_, source_->camera(), options_.motion);
  if (!a_.masks.empty()) masks_ = std::make_unique<track::MaskFolder>(a_.masks);
  if (!a_.detections.empty()) {
    detections_ = std::make_unique<apso::DetectionLog>(a_.detections, source_->camera().width, source_->camera().height, class_list(a_));
  }
  if (a_.true_masks && synthetic_ == nullptr) throw apso::io_error("--true-masks: only synthetic sequences have true masks");
  for (const std::string& w : source_->warnings()) std::fprintf(stderr, "warning: %s\n", w.c_str());
  total_ = a_.max_frames > 0 ? std::min(a_.max_frames, source_->size()) : source_->size();

  cv::setNumThreads(a_.threads);
  pipeline_.emplace(source_->camera(), std::move(motion), options_.pipeline);
  tracker_.emplace(source_->camera(), options_.tracker);
  const track::ResultFolder results = track::prepare_results(a_.output, a_.write_masks, masks_read, a_.sequence);
  out_ = results.path;
  holds_masks_ = results.holds_masks;
  table_.emplace((out_ / "frames.csv").string());
  overlays_.emplace(out_ / "overlays");
}

void Run::process(int i) {
  Pipeline& pipeline = *pipeline_;
  apso::opencv::FeatureTracker& tracker = *tracker_;
  track::LoadedFrame& frame = frame_;
  Stopwatch watch;
  track::Timing ms;
  if (const auto problem = source_->load(i, frame)) {
    record_.skipped.push_back({{"frame", i}, {"timestamp", source_->timestamp(i)}, {"reason", *problem}});
    return;
  }
  mask_.release();
  if (masks_) {
    if (const auto problem = masks_->load(frame.name, frame.gray.size(), mask_)) record_.mask_problems.push_back(*problem);
  }
  if (a_.true_masks) mask_ = cv::Mat(frame.gray.size(), CV_8UC1, const_cast<std::uint8_t*>(synthetic_->truth().instance.data())).clone();
  ms.load = watch.lap();

  tracker.begin(frame.gray, frame.rgbd);
  // The last mask is close enough for a first pose; the motion policy starts from that.
  const auto prior = tracker.estimate(pipeline.observation().mask.probability);
  ms.features = watch.lap();

  const auto* objects = detections_ ? &detections_->at(frame.timestamp) : nullptr;
  apso::ImageView<const std::uint8_t> labels;
  if (!mask_.empty()) labels = apso::opencv::as_image<std::uint8_t>(mask_);
  const apso::Observation& observation = pipeline.observe(frame.rgbd, prior.T_world_camera, tracker.tracks(), objects,
                                                          labels.empty() ? nullptr : &labels);
  ms.observe = watch.lap();

  const apso::StaticSupport support = apso::static_support(observation.mask.probability, tracker.keypoints());
  const bool soften = !support.enough();
  if (soften) {  // too little is left: what is dynamic counts a little
    soft_ = observation.mask.probability;
    record_.softened += apso::soften(tracker.keypoints(), options_.soft_weights, soft_) ? 1 : 0;
  }
  const auto features = observation.informative ? tracker.estimate(soften ? soft_ : observation.mask.probability) : prior;
  ms.features += watch.lap();

  pipeline.assess(tracker.keypoints(), tracker.tracks(),
                  {features.T_world_camera, features.T_world_predicted, features.ok, features.information});
  ms.assess = watch.lap();
  const apso::FrameReport& report = pipeline.conclude();
  ms.refine = watch.lap();
  tracker.commit(report.T_world_camera, observation.mask.probability, report.keyframe_allowed);
  ms.map = watch.lap();

  if (report.state != apso::SceneState::Lost) record_.final_poses.push_back({frame.timestamp, report.T_world_camera});
  if (features.ok) record_.feature_poses.push_back({frame.timestamp, report.T_world_feature});
  table_->write(i, source_->label(i), report, observation, features, tracker.keyframes(), tracker.landmarks(), ms);
  record_.reports.push_back(report);
  record_.timings.push_back(ms);
  overlays_->offer(i, total_, report, [&] {
    return apso::opencv::draw_overlay(frame.bgr, observation, tracker.keypoints(), report);
  });
  if (a_.write_masks) {
    apso::opencv::mask_to_8bit(observation.mask, mask_out_);
    const std::string file = (out_ / "masks" / (frame.name + ".png")).string();
    if (!cv::imwrite(file, mask_out_)) throw apso::io_error(file + ": cannot write");
  }
  char state[64];
  std::snprintf(state, sizeof state, "%-12s %5.1f ms/frame", to_string(report.state), ms.total());
  progress_.show(i + 1, total_, state);
}

/// Writes what is not written frame by frame, and prints the result.
void Run::write() {
  const apso::Trajectory& truth = source_->groundtruth();
  apso::write_trajectory((out_ / "trajectory.txt").string(), record_.final_poses);
  apso::write_trajectory((out_ / "trajectory_features.txt").string(), record_.feature_poses);
  if (!truth.empty()) apso::write_trajectory((out_ / "groundtruth.txt").string(), truth);
  overlays_->finish();

  json summary = track::summarise(record_, total_, truth);
  summary["sequence"] = a_.sequence;
  summary["motion"] = a_.motion;
  summary["holds_masks"] = holds_masks_;
  summary["options"] = track::yaml_to_json(apso::write_parameters(options_));
  summary["refine"] = summary["options"]["pipeline"]["refine"];
  const bool evaluated = summary.contains("final") && summary["final"].is_object();

  track::plot_trajectory((out_ / "trajectory.png").string(), evaluated ? track::aligned_truth(truth, record_.final_poses) : apso::Trajectory{},
                         record_.feature_poses, record_.final_poses, a_.sequence);
  track::plot_scores((out_ / "scores.png").string(), record_.reports, a_.sequence);
  track::write_overview(out_);
  std::ofstream((out_ / "summary.json").string()) << summary.dump(2) << '\n';

  std::printf("%s: %zu of %d frames with a pose, %d refined, %d BAD (%d repaired), %d lost, %zu skipped\n", a_.sequence.c_str(),
              record_.final_poses.size(), total_, record_.refined(), record_.in_state(apso::SceneState::Bad), record_.repaired(),
              record_.in_state(apso::SceneState::Lost), record_.skipped.size());
  for (const json& s : record_.skipped) {
    std::printf("  skipped frame %d: %s\n", s["frame"].get<int>(), s["reason"].get<std::string>().c_str());
  }
  if (evaluated) {
    std::printf("ATE rmse %.4f m over %zu pairs", summary["final"]["ate"]["rmse"].get<double>(), summary["final"]["pairs"].get<std::size_t>());
    const json& features = summary["features"];
    if (features.is_object()) std::printf("; feature poses alone %.4f m", features["ate"]["rmse"].get<double>());
    std::printf("\n");
  }
  std::printf("results in %s: trajectory.txt, frames.csv, summary.json, overview.png, overlays/\n", a_.output.c_str());
}

int Run::execute() {
  for (int i = 0; i < total_ && interrupted == 0; ++i) {
    try {
      process(i);
    } catch (const std::exception& e) {
      // Stop here, but write what was computed so far.
      record_.failure = "frame " + std::to_string(i) + ": " + e.what();
      break;
    }
  }
  const bool failed = !record_.failure.empty();
  if (interrupted != 0 && !failed) record_.failure = "interrupted";
  progress_.end();
  write();
  if (failed) {
    std::fprintf(stderr, "apso_track: %s; the results so far are kept\n", record_.failure.c_str());
    return exit_bad_input;
  }
  if (interrupted != 0) return exit_interrupted;
  return record_.final_poses.empty() ? exit_no_pose : 0;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app{
      "Tracks an RGB-D sequence in which people and things move: finds what moves, rates how far each frame can be\n"
      "trusted, and writes the refined trajectory. Exit code: 0 done, 1 bad input, 2 wrong usage, 3 no frame got a pose, 130 interrupted."};
  app.set_version_flag("--version", APSO_VERSION);
  std::string names;
  for (const std::string& n : apso::testing::SyntheticSequence::names()) names += (names.empty() ? "" : ", ") + n;
  app.add_option("SEQUENCE", a.sequence, "folder in TUM format (rgb.txt and depth.txt, or associations.txt; groundtruth.txt is\n"
                                         "optional), or synthetic:NAME with NAME one of " + names)->required();
  app.add_option("--output", a.output, "folder for the results; those of an earlier run are replaced")->required();
  app.add_option("--camera", a.camera, "tum-fr1, tum-fr2, tum-fr3, bonn, icl-nuim, or a YAML file with fx, fy, cx, cy, ...");
  app.add_option("--config", a.config, "YAML file with options, see --list-options");
  app.add_option("--masks", a.masks, "folder of mask images, named by the colour image's timestamp (nonzero = dynamic)");
  app.add_option("--detections", a.detections, "text file, lines: timestamp left top width height score class_id; or folder with one\n"
                                               "text file per image, named by its timestamp, lines: class cx cy width height [score]\n"
                                               "relative to the image size, or left:.. top:.. right:.. bottom:.. class:NAME [score]");
  std::string policies;
  const apso::opencv::MotionOptions motion_options;
  const apso::opencv::MotionFiles motion_files;
  const apso::Pinhole any_camera;
  for (const apso::NamedPolicy& p : apso::opencv::motion_table(any_camera, motion_options, motion_files)) {
    policies += "\n  " + p.name + (p.takes_policy() ? "(P): " : ": ") + p.summary;
  }
  app.add_option("--motion", a.motion, "motion policy, or a combination: P+Q either, P*Q both, P&Q objects of P that Q finds moving;\n"
                                       "brackets group. P and Q are:" + policies)->capture_default_str();
  app.add_option("--model", a.model, "ONNX file of a detection or segmentation network, for the policy dnn; its input size, thresholds\n"
                                     "and output format are options (--config, motion.dnn)");
  app.add_option("--classes", a.classes, "text file with the class names of the network, one per line (default: the 80 of COCO)");
  app.add_option("--movable", a.movable, "names or numbers of the classes that can move (default: person, cat, dog)")->delimiter(',')->allow_extra_args(false);
  app.add_flag("--no-refinement", a.no_refinement, "keep the poses of the feature tracker: pipeline.refine none");
  app.add_flag("--write-masks", a.write_masks, "write masks/ (8-bit PNG, 255 = dynamic, named by the colour image's timestamp)");
  app.add_option("--threads", a.threads, "threads of the image operations")->check(CLI::Range(1, 256))->capture_default_str();
  app.add_option("--max-frames", a.max_frames, "stop after this many frames (0 = all)")->check(CLI::NonNegativeNumber);
  app.add_option("--spoil", a.spoil, "degrade two of every twenty frames, to test whether they are detected")
      ->check(CLI::IsMember(track::DegradedSource::kinds()));
  app.add_option("--people", a.people, "synthetic sequences: number of walking people")->check(CLI::Range(0, 3));
  app.add_option("--seed", a.seed, "synthetic sequences: random seed of scene and noise")->capture_default_str();
  app.add_flag("--true-masks", a.true_masks, "synthetic sequences: use the true masks");
  app.add_flag_callback("--list-options", [] {
    track::print_settings(track::Config{});
    throw CLI::Success();
  }, "print all settings of --config with their defaults and ranges");
  app.add_flag("--quiet", a.quiet, "no progress bar");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : exit_usage;
  }
  std::signal(SIGINT, [](int) { interrupted = 1; });
  try {
    return Run(a).execute();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "apso_track: %s\n", e.what());
    return exit_bad_input;
  }
}
