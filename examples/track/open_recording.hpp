/// \file
/// A recording on disk.
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "frame_source.hpp"
#include "open_camera.hpp"
#include "read_ahead.hpp"
#include "shutter_source.hpp"

namespace track {

/// A recording on disk as images of a pinhole, each of one time: without distortion of the lens, and with a rolling shutter undone.
/// \param thread true: the next frame is read on a thread of its own
inline std::unique_ptr<FrameSource> open_recording(const std::string& folder, const apso::opencv::CameraModel& camera, bool thread) {
  std::unique_ptr<FrameSource> source = std::make_unique<RecordedSource>(folder, camera);
  if (thread) source = std::make_unique<ReadAhead>(std::move(source));
  if (camera.readout != 0) source = std::make_unique<ShutterSource>(std::move(source), camera.readout);
  return source;
}

}  // namespace track
