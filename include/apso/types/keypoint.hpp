/// \file
/// A corner found in one image.
#pragma once

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

struct Keypoint {
  float x = 0;         ///< [px]
  float y = 0;         ///< [px]
  float response = 0;  ///< detector response, >= 0 (FAST score unless said otherwise)
  float angle = 0;     ///< orientation [deg], [0, 360)
  int octave = 0;      ///< pyramid level it was found on
};

APSO_NAMESPACE_END
