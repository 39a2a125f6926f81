// apso_rectify: writes a recording as a pinhole with a global shutter would have made it, for programs that know neither distortion
// nor rolling shutters.

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "track/command_line.hpp"
#include "track/open_recording.hpp"
#include "track/progress.hpp"
#include "track/recording_writer.hpp"

namespace {

int run(const std::string& recording, const std::string& camera_name, const std::string& output, bool quiet) {
  const apso::opencv::CameraModel camera = track::open_camera(camera_name);
  const std::unique_ptr<track::FrameSource> source = track::open_recording(recording, camera, true);
  std::vector<track::Input> inputs{{"the recording", recording},
                                   {"--camera", std::filesystem::is_regular_file(camera_name) ? camera_name : ""}};
  for (const std::string& folder : source->folders()) inputs.push_back({"images of the recording", folder});
  track::keep_apart(output, inputs);
  for (const std::string& warning : source->warnings()) std::fprintf(stderr, "warning: %s\n", warning.c_str());
  track::RecordingWriter out(output, camera.depth_scale);
  track::LoadedFrame frame;
  track::TimeGoesOn time;
  int moved = 0;
  track::ProgressLine progress(!quiet);
  for (int i = 0; i < source->size(); ++i) {
    source->load(i, frame);
    time.check(frame);
    if (frame.ok()) {
      out.add(frame.timestamp - source->stamp_delay(), frame.colour, frame.depth);
      moved += frame.from_x.empty() ? 0 : 1;
    } else {
      progress.end();
      std::fprintf(stderr, "frame %d is left out: %s\n", i, frame.error.c_str());
    }
    progress.show(i + 1, source->size(), "frames");
  }
  progress.end();
  if (out.frames() == 0) throw apso::io_error(recording + ": none of its frames can be read");
  out.finish(camera.name, source->camera(), camera.inverse_depth_sigma, source->groundtruth());
  std::printf("%d of %d frames in %s: rgb/, depth/ (16 bit, %g units per metre), camera.yaml\n", out.frames(), source->size(),
              output.c_str(), camera.depth_scale);
  std::printf("lens: %s\n", camera.distorted() ? "distortion removed" : "had no distortion");
  if (camera.readout == 0) {
    std::printf("shutter: %s has no readout, rows and depth are taken to be of the time of the colour image\n", camera_name.c_str());
  } else {
    std::printf("shutter: rows read within %g ms; %d frames brought to one time, %d without a sure velocity left as they were\n",
                1e3 * camera.readout, moved, out.frames() - moved);
  }
  if (camera.stamp_delay != 0) std::printf("stamps: less %g ms, so that they are those of the middle rows\n", 1e3 * camera.stamp_delay);
  std::printf("track them: apso_track %s --camera %s --output DIR\n", output.c_str(),
              (std::filesystem::path(output) / "camera.yaml").string().c_str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::string recording;
  std::string camera;
  std::string output;
  bool quiet = false;
  CLI::App app{
      "Writes an RGB-D recording in TUM format as a pinhole with a global shutter would have made it: without distortion of the\n"
      "lens, and with all rows, and the depth, of the time of the colour image. For programs that know neither.\n"
      "Exit code: 0 done, 1 bad input, 2 wrong usage."};
  app.add_option("RECORDING", recording, "folder in TUM format (rgb.txt and depth.txt, or associations.txt; groundtruth.txt is optional)")
      ->required();
  app.add_option("--camera", camera,
                 "tum-fr1, tum-fr2, tum-fr3, bonn, icl-nuim, or a YAML file with fx, fy, cx, cy, ... (wrong intrinsics or a wrong\n"
                 "readout spoil the images silently, so there is no default)")
      ->required()
      ->check(track::not_empty());
  app.add_option("--output", output, "folder for the recording; one that apso_rectify made before is replaced")
      ->required()
      ->check(track::not_empty());
  app.add_flag("--quiet", quiet, "no progress");
  return track::run_main("apso_rectify", app, argc, argv, [&] { return run(recording, camera, output, quiet); });
}
