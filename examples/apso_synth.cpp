// apso_synth: writes a synthetic recording as a folder in TUM format, with true masks and ground truth, for programs
// that read files.

#include <cstdio>
#include <filesystem>
#include <string>

#include <CLI/CLI.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/evaluation/trajectory.hpp>
#include <apso/testing/synthetic.hpp>

#include "track/command_line.hpp"
#include "track/progress.hpp"
#include "track/recording_writer.hpp"
#include "track/sensor_option.hpp"

namespace {

namespace fs = std::filesystem;

constexpr double depth_scale = 5000;  // units per metre, as in the TUM recordings

int run(const std::string& name, const std::string& output, const apso::testing::SyntheticOptions& options, bool quiet) {
  const apso::testing::SyntheticSequence sequence(name, options);
  track::RecordingWriter out(output, depth_scale);
  apso::Trajectory truth;
  apso::testing::SyntheticFrame frame;
  cv::Mat bgr;
  track::ProgressLine progress(!quiet);
  for (int i = 0; i < sequence.size(); ++i) {
    sequence.render(i, frame);
    const int w = frame.depth.width();
    const int h = frame.depth.height();
    cv::cvtColor(cv::Mat(h, w, CV_8UC3, frame.rgb.data()), bgr, cv::COLOR_RGB2BGR);
    out.add(frame.timestamp, bgr, frame.depth);
    out.add_mask(cv::Mat(h, w, CV_8UC1, frame.instance.data()) != 0);
    truth.push_back({frame.timestamp, frame.T_world_camera});
    progress.show(i + 1, sequence.size(), "frames");
  }
  progress.end();
  out.finish(name, sequence.camera(), 0, truth);
  std::printf(
      "%d frames in %s: rgb/, depth/ (16 bit, %.0f units per metre), masks/ (255 = a person), groundtruth.txt\n"
      "track them: apso_track %s --camera %s --output DIR\n",
      sequence.size(), output.c_str(), depth_scale, output.c_str(), (fs::path(output) / "camera.yaml").string().c_str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  apso::testing::SyntheticOptions options;
  std::string name;
  std::string output;
  bool quiet = false;
  CLI::App app{
      "Writes a synthetic RGB-D recording as a folder in TUM format, with true masks and ground truth.\n"
      "Exit code: 0 done, 1 bad input, 2 wrong usage."};
  app.add_option("NAME", name, "what to record")->required()->check(CLI::IsMember(apso::testing::SyntheticSequence::names()));
  app.add_option("--output", output, "folder for the recording; one that apso_synth made before is replaced")
      ->required()
      ->check(track::not_empty());
  app.add_option("--frames", options.frames, "length at 30 Hz")->check(CLI::Range(1, 1000000))->capture_default_str();
  app.add_option("--seed", options.seed, "room, people, path and noise depend on it")->capture_default_str();
  app.add_option("--people", options.people, "walking people, in recordings named walking_* and rising_*")
      ->check(CLI::Range(0, 3))
      ->capture_default_str();
  track::add_sensor(app, options.sensor, "noise of the depth");
  app.add_flag("--quiet", quiet, "no progress");
  return track::run_main("apso_synth", app, argc, argv, [&] { return run(name, output, options, quiet); });
}
