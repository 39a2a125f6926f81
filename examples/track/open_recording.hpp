/// \file
/// A recording on disk.
#pragma once

#include <memory>
#include <string>

#include "frame_source.hpp"
#include "open_camera.hpp"

namespace track {

/// A recording on disk as images of a pinhole, each of one time: without distortion of the lens, and with a rolling shutter undone.
/// \param thread true: the next frame is read on a thread of its own
std::unique_ptr<FrameSource> open_recording(const std::string& folder, const apso::opencv::CameraModel& camera, bool thread);

}  // namespace track
