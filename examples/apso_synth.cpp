// apso_synth: writes a synthetic recording as a folder in TUM format, with true masks and ground truth, for programs
// that read files.

#include <cstdio>
#include <filesystem>
#include <sstream>
#include <string>

#include <CLI/CLI.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/evaluation/trajectory.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/testing/synthetic.hpp>

#include "track/arguments.hpp"
#include "track/command_line.hpp"
#include "track/progress.hpp"
#include "track/results.hpp"

namespace {

namespace fs = std::filesystem;

constexpr double depth_scale = 5000;  // units per metre, as in the TUM recordings

void write_camera(const fs::path& file, const std::string& name, const apso::Pinhole& c) {
  std::ostringstream out;
  out.precision(10);
  out << "name: " << name << "\nfx: " << c.fx << "\nfy: " << c.fy << "\ncx: " << c.cx << "\ncy: " << c.cy << "\nwidth: " << c.width
      << "\nheight: " << c.height << "\ndepth_scale: " << depth_scale << '\n';
  track::write_file(file, out.str());
}

int run(const std::string& name, const std::string& output, const apso::testing::SyntheticOptions& options, bool quiet) {
  const apso::testing::SyntheticSequence sequence(name, options);
  track::ResultFolder out(output, {"rgb.txt", "depth.txt", "associations.txt", "groundtruth.txt", "camera.yaml"});
  std::ostringstream rgb;
  std::ostringstream depth;
  std::ostringstream associations;
  apso::Trajectory truth;
  apso::testing::SyntheticFrame frame;
  cv::Mat bgr;
  cv::Mat units;
  track::ProgressLine progress(!quiet);
  for (int i = 0; i < sequence.size(); ++i) {
    sequence.render(i, frame);
    const int w = frame.depth.width();
    const int h = frame.depth.height();
    char stamp[32];
    std::snprintf(stamp, sizeof stamp, "%.6f", frame.timestamp);
    const std::string file = std::string(stamp) + ".png";
    cv::cvtColor(cv::Mat(h, w, CV_8UC3, frame.rgb.data()), bgr, cv::COLOR_RGB2BGR);
    track::write_image(out.file("rgb/" + file), bgr);
    cv::Mat(h, w, CV_32FC1, frame.depth.data()).convertTo(units, CV_16UC1, depth_scale);
    track::write_image(out.file("depth/" + file), units);
    track::write_image(out.file("masks/" + file), cv::Mat(h, w, CV_8UC1, frame.instance.data()) != 0);
    rgb << stamp << " rgb/" << file << '\n';
    depth << stamp << " depth/" << file << '\n';
    associations << stamp << " rgb/" << file << ' ' << stamp << " depth/" << file << '\n';
    truth.push_back({frame.timestamp, frame.T_world_camera});
    progress.show(i + 1, sequence.size(), "frames");
  }
  progress.end();
  track::write_file(out.file("rgb.txt"), rgb.str());
  track::write_file(out.file("depth.txt"), depth.str());
  track::write_file(out.file("associations.txt"), associations.str());
  apso::write_trajectory(out.file("groundtruth.txt").string(), truth);
  write_camera(out.file("camera.yaml"), name, sequence.camera());
  out.finish();
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
