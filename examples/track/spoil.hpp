/// \file
/// What `apso_track --spoil` does to a recording.
#pragma once

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "degraded_source.hpp"
#include "faulty_source.hpp"
#include "frame_source.hpp"

namespace track {

inline std::vector<std::string> spoil_kinds() {
  std::vector<std::string> all = DegradedSource::kinds();
  for (std::string& kind : FaultySource::kinds()) all.push_back(std::move(kind));
  return all;
}

/// \param frames that are going to be asked for; too few of them are warned about
inline std::unique_ptr<FrameSource> spoiled(std::unique_ptr<FrameSource> source, const std::string& kind, int frames) {
  static_assert(DegradedSource::first == FaultySource::first);
  if (std::min(frames > 0 ? frames : source->size(), source->size()) <= DegradedSource::first) {
    std::fprintf(stderr, "warning: --spoil: no frame is degraded, the first would be frame %d\n", DegradedSource::first);
  }
  const std::vector<std::string> degradations = DegradedSource::kinds();
  if (std::find(degradations.begin(), degradations.end(), kind) != degradations.end())
    return std::make_unique<DegradedSource>(std::move(source), kind);
  return std::make_unique<FaultySource>(std::move(source), kind);
}

}  // namespace track
