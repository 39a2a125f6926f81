#include "my_align.h"

#include <apso/align.hpp>

Motion my_align(const SensorFrame& first, const SensorFrame& second) {
  const apso::Pinhole camera{535.4, 539.2, 320.1, 247.6, 640, 480};
  const auto frame = [&](double seconds, const SensorFrame& f) {
    const apso::ImageView<const std::uint8_t> grey(f.grey, 640, 480);
    const apso::ImageView<const std::uint16_t> depth(f.millimetres, 640, 480);
    return apso::frame(seconds, grey, apso::scaled(depth, 0.001F), camera);
  };
  const auto result = apso::align(frame(0, first), frame(0.03, second));
  const Eigen::Vector3d t = result.T_current_reference.translation();
  return {t.x(), t.y(), t.z(), result.confidence, apso::kLanes};
}
