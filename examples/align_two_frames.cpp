// How did the camera move between two frames? Eigen is all this file needs.
#include <cstdio>

#include <Eigen/Geometry>

#include <apso/align.hpp>
#include <apso/testing/synthetic.hpp>

int main() {
  const apso::testing::SyntheticSequence sensor("static_xyz");  // in place of yours
  apso::testing::SyntheticFrame first, second;
  sensor.render(20, first);
  sensor.render(25, second);
  // [align]
  // Any image types; depth that is not in metres says its unit: apso::scaled(depth, 0.001F)
  const auto reference = apso::frame(0.00, first.intensity, first.depth, sensor.camera());
  const auto current = apso::frame(0.17, second.intensity, second.depth, sensor.camera());
  const Eigen::Isometry3f guess = Eigen::Isometry3f::Identity();
  const auto found = apso::align(reference, current, guess);
  const Eigen::Isometry3f T = found.T_current_reference;  // of the type of the guess
  std::printf("%s: %.3f %.3f %.3f m, confidence %.2f\n", apso::to_string(found.status), static_cast<double>(T(0, 3)),
              static_cast<double>(T(1, 3)), static_cast<double>(T(2, 3)), found.confidence);
  // [/align]
  const apso::Pose truth = apso::inverse(second.T_world_camera) * first.T_world_camera;
  return (T.translation().cast<double>() - truth.translation()).norm() < 0.01 && found.confidence > 0.5 ? 0 : 1;
}
