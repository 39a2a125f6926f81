/// \file
/// A point followed from image to image.
#pragma once

#include <cstdint>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// A point tracked from the previous to the current frame (forward-backward checked by whoever tracks it).
struct PointTrack {
  std::int64_t id = 0;   ///< the same for the life of the track; never used twice
  float x = 0;           ///< position in the current frame [px]
  float y = 0;           ///< position in the current frame [px]
  float previous_x = 0;  ///< position in the previous frame [px]; equals x for a track that begins here
  float previous_y = 0;  ///< position in the previous frame [px]
  int age = 0;           ///< frames since it began; 0 = it begins here and has no previous position
};

APSO_NAMESPACE_END
