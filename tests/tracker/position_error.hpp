// How far apart two positions are.
#pragma once

#include <apso/math/se3.hpp>

[[nodiscard]] inline double position_error(const apso::Pose& a, const apso::Pose& b) {
  return (a.translation() - b.translation()).norm();
}  // [m]
