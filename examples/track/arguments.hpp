/// \file
/// The command line of apso_track.
#pragma once

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include <apso/io/detection_text.hpp>
#include <apso/observation/policy_expression.hpp>
#include <apso/opencv/detectors/motion_by_name.hpp>
#include <apso/testing/synthetic.hpp>

#include "command_line.hpp"
#include "config.hpp"
#include "results.hpp"
#include "sensor_option.hpp"
#include "spoil.hpp"
#include "video.hpp"

namespace track {

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
  std::string video;
  std::string keep_frames;
  std::vector<std::string> movable;
  bool no_refinement = false;
  bool write_masks = false;
  bool report = false;
  bool no_pictures = false;
  bool live = false;
  bool true_masks = false;
  bool quiet = false;
  int threads = 2;
  int max_frames = 0;
  int people = -1;
  unsigned seed = 1;
  apso::testing::DepthSensor sensor = apso::testing::DepthSensor::StructuredLight;

  static constexpr const char* prefix = "synthetic:";
  [[nodiscard]] bool synthetic() const { return sequence.rfind(prefix, 0) == 0; }
  [[nodiscard]] bool policy_is(const char* name) const {
    const std::vector<std::string> names = apso::policy_names(motion);
    return std::find(names.begin(), names.end(), name) != names.end();
  }
  /// The motion policy reads the masks and detections itself.
  [[nodiscard]] bool policy_reads_files() const { return policy_is("precomputed") || (policy_is("semantic") && model.empty()); }
  /// All that is only read.
  [[nodiscard]] std::vector<Input> inputs() const {
    return {{"the recording", synthetic() ? "" : sequence},
            {"--masks", masks},
            {"--detections", detections},
            {"--config", config},
            {"--camera", camera.find('.') == std::string::npos ? "" : camera},
            {"--model", model},
            {"--classes", classes}};
  }
};

/// The classes of detections, and which of them can move.
inline apso::ClassList class_list(const Arguments& a) {
  apso::ClassList list;
  if (!a.classes.empty()) list.names = apso::read_class_names(a.classes);
  if (!a.movable.empty()) list.movable.clear();
  for (const std::string& name : a.movable) {
    const int id = list.id_of(name);
    if (id < 0) {
      std::string known;
      for (const std::string& n : list.names) known += (known.empty() ? "" : ", ") + n;
      throw CLI::ValidationError("--movable", "there is no class '" + name + "', expected a number or one of: " + known);
    }
    list.movable.push_back(id);
  }
  return list;
}

/// Classes that do not exist and options that would not be used in a run are wrong usage.
inline void check(const CLI::App& app, const Arguments& a) {
  (void)class_list(a);
  const auto refuse = [&](const char* option, bool used, const char* why) {
    if (app.get_option(option)->count() > 0 && !used) throw CLI::ValidationError(option, why);
  };
  for (const char* option : {"--people", "--seed", "--sensor", "--true-masks", "--keep-frames"})
    refuse(option, a.synthetic(), "only synthetic sequences have that");
  refuse("--camera", !a.synthetic(), "a synthetic sequence brings its own camera");
  refuse("--model", a.policy_is("dnn") || a.policy_is("semantic"), "no policy of --motion uses a network; take dnn or semantic");
  const std::filesystem::path video(a.video);
  refuse("--video", video_codec(video) != 0 && video == video.filename(),
         "expected NAME.avi or NAME.mp4, without a folder: it is written into that of --output");
  const bool classified = !a.detections.empty() || !a.model.empty();
  for (const char* option : {"--classes", "--movable"}) refuse(option, classified, "nothing has classes without --detections or --model");
}

inline void declare_options(CLI::App& app, Arguments& a) {
  std::string names;
  for (const std::string& n : apso::testing::SyntheticSequence::names()) names += (names.empty() ? "" : ", ") + n;
  app.add_option("SEQUENCE", a.sequence,
                 "folder in TUM format (rgb.txt and depth.txt, or associations.txt; groundtruth.txt is\n"
                 "optional), or synthetic:NAME with NAME one of " +
                     names)
      ->required();
  app.add_option("--output", a.output, "folder for the results; those of an earlier run are replaced, nothing else is")
      ->required()
      ->check(not_empty());
  app.add_option("--camera", a.camera, "tum-fr1, tum-fr2, tum-fr3, bonn, icl-nuim, or a YAML file with fx, fy, cx, cy, ...");
  app.add_option("--config", a.config, "YAML file with options, see --list-options")->check(not_empty());
  app.add_option("--masks", a.masks, "folder of mask images, named by the colour image's timestamp (nonzero = dynamic)")
      ->check(not_empty());
  app.add_option("--detections", a.detections,
                 "text file, lines: timestamp left top width height score class_id; or folder with one\n"
                 "text file per image, named by its timestamp, lines: class cx cy width height [score]\n"
                 "relative to the image size, or left:.. top:.. right:.. bottom:.. class:NAME [score]")
      ->check(not_empty());
  std::string policies = "Policies of --motion:\n";
  const apso::opencv::MotionOptions motion_options;
  const apso::opencv::MotionFiles motion_files;
  const apso::Pinhole any_camera;
  for (const apso::NamedPolicy& p : apso::opencv::motion_table(any_camera, motion_options, motion_files)) {
    std::string name = p.name + (p.takes_policy() ? "(P)" : "");
    name.resize(std::max<std::size_t>(name.size() + 2, 26), ' ');
    policies += "  " + name + p.summary + '\n';
  }
  app.add_option("--motion", a.motion,
                 "motion policy, or a combination: P+Q either, P*Q both, P&Q objects of P that Q finds moving;\n"
                 "brackets group; the policies are listed below")
      ->capture_default_str();
  app.add_option("--model", a.model,
                 "ONNX file of a detection or segmentation network, for the policy dnn; its input size, thresholds\n"
                 "and output format are options (--config, motion.dnn)");
  app.add_option("--classes", a.classes, "text file with the class names of the network, one per line (default: the 80 of COCO)");
  app.add_option("--movable", a.movable, "names or numbers of the classes that can move (default: person, cat, dog)")
      ->delimiter(',')
      ->allow_extra_args(false);
  app.add_flag("--no-refinement", a.no_refinement, "keep the poses of the feature tracker: pipeline.refine none");
  app.add_flag("--write-masks", a.write_masks, "write masks/ (8-bit PNG, 255 = dynamic, named by the colour image's timestamp)");
  app.add_flag("--no-pictures", a.no_pictures, "write no overlays, plots or overview: only trajectories and tables");
  app.add_flag("--report", a.report, "write report.html, the run as one page with every frame, and thumbnails/, the pictures in it");
  app.add_option("--video", a.video,
                 "write a video of this name into the folder of the results, NAME.avi (Motion JPEG) or\n"
                 "NAME.mp4 (MPEG-4): every frame with its mask and scores, beside the path from above");
  app.add_flag("--live", a.live, "show the same picture in a window: space holds, n or right is one frame, q or Esc stops");
  app.add_option("--threads", a.threads,
                 "threads: from 2 on, one loads the next frame and finds its features, and one writes\npictures; the others share the "
                 "image operations. The results do not depend on it")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_option("--max-frames", a.max_frames, "stop after this many frames (0 = all)")->check(count());
  app.add_option("--spoil", a.spoil,
                 "degrade two of every twenty frames, to test whether they are detected (the first six),\n"
                 "or let something happen once, at frame 40")
      ->check(CLI::IsMember(spoil_kinds()));
  app.add_option("--people", a.people, "synthetic sequences: number of walking people")->check(CLI::Range(0, 3));
  app.add_option("--seed", a.seed, "synthetic sequences: random seed of scene and noise")->capture_default_str();
  add_sensor(app, a.sensor, "synthetic sequences: noise of the depth");
  app.add_flag("--true-masks", a.true_masks, "synthetic sequences: use the true masks")->excludes("--masks");
  app.add_option("--keep-frames", a.keep_frames,
                 "synthetic sequences: keep the rendered frames in this file and their features in FILE.features, and take\n"
                 "from them what another run on the same sequence has kept. A frame of 640x480 has 2.5 MB, 300 frames have\n"
                 "760 MB; 1 GB of the disk stays free. The results do not depend on it; features that were kept count with\n"
                 "the time of the run that found them")
      ->check(not_empty());
  app.add_flag_callback(
      "--list-options",
      [] {
        print_settings(Config{});
        throw CLI::Success();
      },
      "print all settings of --config with their defaults and ranges");
  app.add_flag("--quiet", a.quiet, "no progress bar");
  app.footer(policies);
  app.callback([&] { check(app, a); });
}

}  // namespace track
