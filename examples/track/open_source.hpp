/// \file
/// From the command line to a recording, on disk or synthetic.
#pragma once

#include <algorithm>
#include <memory>
#include <string>

#include <apso/io/tum_text.hpp>
#include <apso/testing/synthetic.hpp>

#include "arguments.hpp"
#include "frame_source.hpp"
#include "open_recording.hpp"

namespace track {

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
