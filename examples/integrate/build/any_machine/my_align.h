// All that the program sees of the part that is compiled for several machines: plain numbers, nothing of apso or Eigen.
#pragma once

#include <cstdint>

struct SensorFrame {  // 640 x 480, registered
  const std::uint8_t* grey;
  const std::uint16_t* millimetres;
};
struct Motion {
  double x, y, z;      // of points of the first camera in the second [m]
  double confidence;   // [0,1]
  int floats_at_once;  // that this machine works on
};

[[gnu::visibility("default")]] Motion my_align(const SensorFrame& first, const SensorFrame& second);
