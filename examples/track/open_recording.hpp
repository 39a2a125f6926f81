/// \file
/// A recording on disk, and the camera that made it.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include <apso/io/camera_yaml.hpp>
#include <apso/io/tum_text.hpp>

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

}  // namespace track
