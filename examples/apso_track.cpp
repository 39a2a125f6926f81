// apso_track: the whole method on one sequence. Writes the trajectory, the scores of every frame, pictures, the error if there
// is ground truth, and a report.

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include <apso/io/detection_text.hpp>
#include <apso/io/parameters.hpp>
#include <apso/observation/soft_weights.hpp>
#include <apso/pipeline/pipeline.hpp>

#include "report/page.hpp"
#include "report/run_data.hpp"
#include "track/arguments.hpp"
#include "track/command_line.hpp"
#include "track/config.hpp"
#include "track/frame_ahead.hpp"
#include "track/frame_pictures.hpp"
#include "track/open_source.hpp"
#include "track/output.hpp"
#include "track/pictures.hpp"
#include "track/plots.hpp"
#include "track/progress.hpp"
#include "track/results.hpp"
#include "track/signals.hpp"
#include "track/spoil.hpp"
#include "track/stamps.hpp"
#include "track/summary.hpp"

namespace {

namespace fs = std::filesystem;
using json = nlohmann::json;
using track::Arguments;

/// The pipeline with a motion policy that is chosen at run time.
using Pipeline = apso::BasicPipeline<apso::Pose, apso::AnyMotionPolicy>;

/// One run of the program: what it reads, what it computes with, what it writes.
class Run {
 public:
  Run(const Arguments& a, std::string command);
  /// \return the exit code
  int execute();

 private:
  void process(int i);
  [[nodiscard]] std::string unused() const;
  void write();
  void tell(const json& summary) const;

  Arguments a_;
  std::string command_;
  track::Config options_;
  std::unique_ptr<track::FrameSource> source_;
  std::optional<track::FrameAhead> frames_;
  std::unique_ptr<track::MaskFolder> masks_;
  std::unique_ptr<apso::DetectionLog> detections_;
  int total_ = 0;  ///< frames to process
  std::optional<Pipeline> pipeline_;
  std::optional<apso::opencv::FeatureTracker> tracker_;
  std::optional<track::ResultFolder> out_;
  std::optional<track::FrameTable> table_;
  track::ProgressLine progress_;
  track::Record record_;

  cv::Mat mask_;
  apso::Image<float> soft_;                       ///< the mask, softened
  std::optional<track::FramePictures> pictures_;  ///< last: its thread ends before what it uses
};

Run::Run(const Arguments& a, std::string command)
    : a_(a), command_(std::move(command)), options_(track::read_config(a.config)), progress_(!a.quiet) {
  if (a_.motion == "none") options_.pipeline.motion = false;
  if (a_.no_refinement) options_.pipeline.refine = apso::RefinedFrames::None;

  source_ = track::open_source(a_);
  track::take_depth_noise(source_->inverse_depth_sigma(), options_);
  if (!a_.spoil.empty()) source_ = track::spoiled(std::move(source_), a_.spoil, a_.max_frames);
  total_ = a_.max_frames > 0 ? std::min(a_.max_frames, source_->size()) : source_->size();

  apso::opencv::MotionFiles files{a_.masks, a_.detections, a_.model, track::class_list(a_), &record_.use};
  apso::AnyMotionPolicy motion = apso::opencv::motion_by_name(a_.motion, source_->camera(), options_.motion, files);
  if (!a_.policy_reads_files()) {
    if (!a_.masks.empty()) masks_ = std::make_unique<track::MaskFolder>(a_.masks);
    const apso::Pinhole& camera = source_->camera();
    if (!a_.detections.empty())
      detections_ = std::make_unique<apso::DetectionLog>(a_.detections, camera.width, camera.height, files.classes);
  }
  for (const std::string& w : source_->warnings()) std::fprintf(stderr, "warning: %s\n", w.c_str());
  if (const std::string w = track::stamp_problem(source_->timestamps()); !w.empty()) {
    std::fprintf(stderr, "warning: %s: %s\n", a_.sequence.c_str(), w.c_str());
  }

  cv::setNumThreads(std::max(1, a_.threads - 1));
  pipeline_.emplace(source_->camera(), std::move(motion), options_.pipeline);
  tracker_.emplace(source_->camera(), options_.tracker);
  const std::string kept = a_.keep_frames.empty() ? std::string() : a_.keep_frames + track::kept_features_suffix;
  frames_.emplace(*source_, options_.tracker, total_, a_.threads > 1, kept);
  std::vector<track::Input> inputs = a_.inputs();
  for (const std::string& folder : source_->folders()) inputs.push_back({"images of the recording", folder});
  track::keep_apart(a_.output, inputs);
  auto window = a_.live ? std::make_unique<track::Window>("apso_track " + a_.sequence) : nullptr;
  std::vector<std::string> names = track::result_files(a_.report);
  if (!a_.video.empty()) names.push_back(a_.video);
  out_.emplace(a_.output, names);
  table_.emplace(out_->file("frames.csv").string());
  pictures_.emplace(a_, *source_, *out_, std::move(window));
}

void Run::process(int i) {
  Pipeline& pipeline = *pipeline_;
  apso::opencv::FeatureTracker& tracker = *tracker_;
  track::Stopwatch whole;
  const track::ReadyFrame& ready = frames_->next();
  const track::LoadedFrame& frame = ready.images;
  if (!frame.ok()) {
    record_.skipped.push_back({{"frame", i}, {"timestamp", source_->timestamp(i)}, {"reason", frame.error}});
    return;
  }
  track::Stopwatch watch;
  track::Timing ms;
  mask_ = masks_ ? frame.moved(masks_->load(frame.name, frame.gray.size(), record_.use)) : cv::Mat();
  if (a_.true_masks) mask_ = cv::Mat(frame.gray.size(), CV_8UC1, const_cast<std::uint8_t*>(frame.instance.data()));
  ms.load = ready.load_ms + watch.lap();

  const apso::RgbdFrame rgbd = frame.rgbd();
  tracker.begin(ready.features, rgbd);
  // The last mask is close enough for a first pose; the motion policy starts from that.
  const auto prior = tracker.estimate(pipeline.observation().mask.probability);
  ms.features = ready.features_ms + watch.lap();

  if (detections_ && detections_->covers(frame.timestamp)) ++record_.use.detections;
  const auto* objects = detections_ ? &detections_->at(frame.timestamp) : nullptr;
  apso::ImageView<const std::uint8_t> labels;
  if (!mask_.empty()) labels = apso::opencv::as_image<std::uint8_t>(mask_);
  const apso::Observation& observation =
      pipeline.observe(rgbd, prior.T_world_camera, tracker.tracks(), objects, labels.empty() ? nullptr : &labels);
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
                  {features.T_world_camera, features.T_world_predicted, features.ok, features.information, features.confirmed_matches()});
  ms.assess = watch.lap();
  const apso::FrameReport& report = pipeline.conclude();
  ms.refine = watch.lap();
  tracker.commit(report.T_world_camera, observation.mask.probability, report.keyframe_allowed);
  const apso::PartChange change = tracker.reconnect();
  ms.map = watch.lap();

  record_.add(report, features.ok, change);
  table_->write(i, source_->label(i), report, observation, features, tracker.keyframes(), tracker.landmarks(), change.before, ms);
  pictures_->offer(i, total_, frame, observation, tracker.keypoints(), report);
  // Last: the observation drawn above is forgotten with all else that lies in the part that was left.
  if (change.event == apso::PartEvent::Left) pipeline.reset();
  if (change.moves_poses()) {
    pipeline.correct([&](double t, const apso::Pose& T) { return std::optional(change.moved(t, T)); });
  }
  ms.wall = whole.lap();
  record_.timings.push_back(ms);
  char state[64];
  std::snprintf(state, sizeof state, "%-12s %5.1f ms/frame", to_string(report.state), ms.wall);
  progress_.show(i + 1, total_, state);
}

/// An input of which nothing at all could be used; empty if there is none.
std::string Run::unused() const {
  if (record_.reports.empty()) return record_.skipped.empty() ? "" : "no frame can be read";
  if (!a_.masks.empty() && record_.use.masks == 0) return "--masks " + a_.masks + ": no frame has a mask that fits";
  if (!a_.detections.empty() && record_.use.detections == 0) return "--detections " + a_.detections + ": no stamp is that of a frame";
  return "";
}

/// Writes what is not written frame by frame, and prints the result.
void Run::write() {
  const apso::Trajectory& truth = source_->groundtruth();
  record_.choose_largest_part(source_->stamp_delay());
  apso::write_trajectory(out_->file("trajectory.txt").string(), record_.final_poses);
  apso::write_trajectory(out_->file("trajectory_features.txt").string(), record_.feature_poses);
  if (!truth.empty()) apso::write_trajectory(out_->file("groundtruth.txt").string(), truth);

  json summary = track::summarise(record_, total_, truth);
  summary["sequence"] = a_.sequence;
  summary["command"] = command_;
  summary["motion"] = a_.motion;
  summary["options"] = track::yaml_to_json(apso::write_parameters(options_));
  summary["refine"] = summary["options"]["pipeline"]["refine"];

  pictures_->finish();
  if (!a_.no_pictures) {
    const bool evaluated = summary.contains("final") && summary["final"].is_object();
    track::write_pictures(track::plotted_run(report::sequence_name(a_.sequence), record_.reports, evaluated ? truth : apso::Trajectory{},
                                             record_.feature_poses, record_.final_poses),
                          pictures_->overlays(), *out_);
  }
  const fs::path page = a_.report && !record_.reports.empty() ? out_->file("report.html") : fs::path();
  track::write_json(out_->file("summary.json"), summary);  // last: a folder with it is complete
  if (!page.empty())
    report::write(page, {out_->unfinished()}, report::default_megabytes, fs::path(a_.output).lexically_normal().filename());
  out_->finish();
  tell(summary);
}

void Run::tell(const json& summary) const {
  const std::size_t frames = record_.reports.size();
  std::printf("%s: %zu of %d frames with a pose, %d refined, %d BAD (%d repaired, %d predicted), %d lost, %zu skipped\n",
              a_.sequence.c_str(), record_.final_poses.size(), total_, record_.refined(), record_.in_state(apso::SceneState::Bad),
              record_.repaired(), record_.predicted(), record_.in_state(apso::SceneState::Lost), record_.skipped.size());
  for (const json& s : record_.skipped) {
    std::printf("  skipped frame %d: %s\n", s["frame"].get<int>(), s["reason"].get<std::string>().c_str());
  }
  if (const std::size_t parts = summary["parts"]["connected"].size(); parts > 1) {
    std::printf("the map has %zu parts that are not connected; trajectory.txt is of the largest\n", parts);
  }
  if (const int loops = record_.loops(); loops > 0) std::printf("loops closed: %d\n", loops);
  if (!a_.masks.empty()) {
    const std::vector<std::string>& problems = record_.use.problems;
    std::printf("masks: %d of %zu frames have one that fits, %zu do not fit%s\n", record_.use.masks, frames, problems.size(),
                problems.empty() ? "" : (", e.g. " + problems.front()).c_str());
  }
  if (!a_.detections.empty()) std::printf("detections: %d of %zu frames have some\n", record_.use.detections, frames);
  if (summary.contains("final") && summary["final"].is_object()) {
    std::printf("ATE rmse %.4f m over %zu pairs", summary["final"]["ate"]["rmse"].get<double>(),
                summary["final"]["pairs"].get<std::size_t>());
    const json& features = summary["features"];
    if (features.is_object()) std::printf("; feature poses alone %.4f m", features["ate"]["rmse"].get<double>());
    std::printf("\n");
  } else if (summary.contains("evaluation_problem")) {
    std::printf("the errors are not known: the ground truth cannot be compared: %s\n",
                summary["evaluation_problem"].get<std::string>().c_str());
  }
  const bool none_rated = frames > 0 && record_.in_state(apso::SceneState::Initialising) == static_cast<int>(frames);
  if (none_rated && track::stamp_problem(source_->timestamps()).empty()) {
    std::printf("no frame was rated: the recording ended within the initialisation (%zu frames)\n", frames);
  }
  std::printf("results in %s: trajectory.txt, frames.csv, summary.json%s%s%s%s\n", a_.output.c_str(),
              a_.no_pictures ? "" : ", overview.png, overlays/", a_.report ? ", report.html" : "", a_.video.empty() ? "" : ", ",
              a_.video.c_str());
}

int Run::execute() {
  for (int i = 0; i < total_ && track::stop_signal == 0; ++i) {
    try {
      process(i);
    } catch (const std::exception& e) {
      // Stop here, but write what was computed so far.
      record_.failure = "frame " + std::to_string(i) + ": " + e.what();
      break;
    }
  }
  try {
    pictures_->wait();
  } catch (const std::exception& e) {
    if (record_.failure.empty()) record_.failure = e.what();
  }
  const int stopped = track::stop_signal;
  if (record_.failure.empty()) record_.failure = stopped != 0 ? "interrupted" : unused();
  progress_.end();
  try {
    write();
  } catch (const std::exception& e) {
    const std::string before = record_.failure.empty() ? "" : record_.failure + "; ";
    throw apso::io_error(before + e.what() + "; the results so far are in " + out_->unfinished().string());
  }
  if (!record_.failure.empty()) {
    std::fprintf(stderr, "apso_track: %s; the results so far are kept\n", record_.failure.c_str());
    return stopped != 0 ? 128 + stopped : track::exit_bad_input;  // as shells report signals
  }
  return record_.final_poses.empty() ? track::exit_no_pose : 0;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app{
      "Tracks an RGB-D sequence in which people and things move: finds what moves, rates how far each frame can be\n"
      "trusted, and writes the refined trajectory. Exit code: 0 done, 1 bad input, 2 wrong usage, 3 no frame got a pose,\n"
      "128 + n stopped by signal n."};
  track::declare_options(app, a);
  track::note_stop_signals();
  return track::run_main("apso_track", app, argc, argv, [&] { return Run(a, track::shell_command(argc, argv)).execute(); });
}
