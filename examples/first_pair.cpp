// The shortest way to a result: how did the camera move between two RGB-D frames? Eigen is all this file needs.
// The frames are made here; yours come from a sensor, as pointers to 8-bit grey values and to depth in millimetres.
#include <cstdint>
#include <cstdio>
#include <vector>

#include <apso/align.hpp>
#include <apso/testing/synthetic.hpp>

struct SensorFrame {
  std::vector<std::uint8_t> grey;
  std::vector<std::uint16_t> millimetres;
};
static SensorFrame grab(const apso::testing::SyntheticSequence& camera, int i, apso::Pose& truth);

int main() {
  const apso::testing::SyntheticSequence camera("static_xyz");
  apso::Pose T_world_first, T_world_second;
  const SensorFrame first = grab(camera, 20, T_world_first);
  const SensorFrame second = grab(camera, 25, T_world_second);

  // [align]
  using Grey = apso::ImageView<const std::uint8_t>;  // pointer, width, height, stride; copies nothing
  using Depth = apso::ImageView<const std::uint16_t>;
  apso::Pinhole pinhole;
  pinhole.fx = 535.4;
  pinhole.fy = 539.2;
  pinhole.cx = 320.1;
  pinhole.cy = 247.6;
  pinhole.width = 640;
  pinhole.height = 480;
  const auto frame = [&](double seconds, const SensorFrame& f) {
    return apso::frame(seconds, Grey(f.grey.data(), 640, 480), apso::scaled(Depth(f.millimetres.data(), 640, 480), 0.001F), pinhole);
  };
  const auto result = apso::align(frame(0.0, first), frame(0.17, second));
  const Eigen::Vector3d t = result.T_current_reference.translation();
  std::printf("%s: moved by %.3f %.3f %.3f m, confidence %.2f\n", apso::to_string(result.status), t.x(), t.y(), t.z(), result.confidence);
  // [/align]

  const apso::Pose truth = apso::inverse(T_world_second) * T_world_first;
  const double error = (t - truth.translation()).norm();
  std::printf("error %.4f m\n", error);
  return apso::succeeded(result.status) && error < 0.02 ? 0 : 1;
}

static SensorFrame grab(const apso::testing::SyntheticSequence& camera, int i, apso::Pose& truth) {
  apso::testing::SyntheticFrame frame;
  camera.render(i, frame);
  truth = frame.T_world_camera;
  SensorFrame out;
  for (std::size_t k = 0; k < frame.depth.size(); ++k) {
    out.grey.push_back(static_cast<std::uint8_t>(255 * frame.intensity.data()[k] + 0.5F));
    out.millimetres.push_back(static_cast<std::uint16_t>(1000 * frame.depth.data()[k] + 0.5F));
  }
  return out;
}
