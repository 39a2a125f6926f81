#include "open_recording.hpp"

#include <utility>

#include "read_ahead.hpp"
#include "shutter_source.hpp"

namespace track {

std::unique_ptr<FrameSource> open_recording(const std::string& folder, const apso::opencv::CameraModel& camera, bool thread) {
  std::unique_ptr<FrameSource> source = std::make_unique<RecordedSource>(folder, camera);
  if (thread) source = std::make_unique<ReadAhead>(std::move(source));
  if (camera.readout != 0) source = std::make_unique<ShutterSource>(std::move(source), camera.readout);
  return source;
}

}  // namespace track
