/// \file
/// From the command line to a recording, on disk or synthetic.
#pragma once

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include <apso/io/camera_yaml.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/testing/synthetic.hpp>

#include "arguments.hpp"
#include "frame_source.hpp"
#include "read_ahead.hpp"
#include "shutter_source.hpp"

namespace track {

/// The camera that a command line names: by its name, or by a YAML file.
inline apso::opencv::CameraModel open_camera(const std::string& camera) {
  if (camera.find('.') != std::string::npos && std::filesystem::is_directory(camera))
    throw apso::io_error(camera + ": is a folder, expected a YAML file");
  // a folder of results may well be called bonn
  const bool is_file = (std::filesystem::exists(camera) && !std::filesystem::is_directory(camera)) || camera.find('.') != std::string::npos;
  return is_file ? apso::camera_from_yaml(camera) : apso::camera_by_name(camera);
}

/// A recording on disk as images of a pinhole, each of one time: without distortion of the lens, and with a rolling shutter undone.
/// \param thread true: the next frame is read on a thread of its own
inline std::unique_ptr<FrameSource> open_recording(const std::string& folder, const apso::opencv::CameraModel& camera, bool thread) {
  std::unique_ptr<FrameSource> source = std::make_unique<RecordedSource>(folder, camera);
  if (thread) source = std::make_unique<ReadAhead>(std::move(source));
  if (camera.readout != 0) source = std::make_unique<ShutterSource>(std::move(source), camera.readout);
  return source;
}

/// The recording that the command line names.
inline std::unique_ptr<FrameSource> open_source(const Arguments& a) {
  if (a.synthetic()) {
    apso::testing::SyntheticOptions options;
    if (a.people >= 0) options.people = a.people;
    if (a.max_frames > 0) options.frames = std::max(options.frames, a.max_frames);
    options.seed = a.seed;
    options.sensor = a.sensor;
    return std::make_unique<SyntheticSource>(a.sequence.substr(std::string(Arguments::prefix).size()), options, a.keep_frames);
  }
  if (a.camera.empty()) {
    throw apso::io_error(
        "--camera is needed for a recording: tum-fr1, tum-fr2, tum-fr3, bonn, icl-nuim, or a YAML file (wrong "
        "intrinsics or a wrong depth scale give a wrong trajectory silently, so there is no default)");
  }
  return open_recording(a.sequence, open_camera(a.camera), a.threads > 1);
}

}  // namespace track
