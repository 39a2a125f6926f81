// Frames of a camera that reads its rows one after another, brought to one time each. Eigen is all this file needs.
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <vector>

#include <apso/refinement/camera_velocity.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/images/rolling_shutter.hpp>

namespace {

struct Seen {
  double timestamp;
  apso::Image<float> intensity, depth;
};

// A camera in a shaking hand, before a corner between two patterned walls.
apso::Pose T_world_camera(double t) {
  apso::Twist xi;
  xi << 0.04 * std::sin(9 * t), 0.03 * std::cos(9 * t), 0.02 * std::sin(9 * t), 0.05 * std::cos(9 * t), 0.06 * std::sin(9 * t), 0;
  return apso::se3_exp(xi);
}
// Row y is read `row_time` after the one above; the timestamp is that of the middle row.
Seen look(const apso::Pinhole& camera, double timestamp, double row_time) {
  Seen f{timestamp, apso::Image<float>(camera.width, camera.height), apso::Image<float>(camera.width, camera.height)};
  for (int y = 0; y < camera.height; ++y) {
    const apso::Pose T = T_world_camera(timestamp + row_time * (y + 0.5 - camera.height / 2.0));
    const Eigen::Vector3d o = apso::translation(T);
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = T.linear() * camera.unproject(x, y, 1.0);
      const double left = (2.2 - o.z() - 0.3 * o.x()) / (ray.z() + 0.3 * ray.x());  // z + 0.3 x = 2.2 m
      const double right = (2 - o.z() + 0.4 * o.x()) / (ray.z() - 0.4 * ray.x());   // z - 0.4 x = 2 m
      const double z = std::fmin(left, right);
      const Eigen::Vector3d p = o + z * ray;
      f.intensity(x, y) = static_cast<float>(0.5 + 0.2 * std::sin(11 * p.x() + 3 * std::sin(5 * p.y())) * std::cos(13 * p.y() + p.x()));
      f.depth(x, y) = static_cast<float>(z);
    }
  }
  return f;
}
double difference(const apso::Image<float>& a, const apso::Image<float>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += static_cast<double>(std::abs(a.data()[i] - b.data()[i]));
  return sum / static_cast<double>(a.size());
}

}  // namespace

int main() {
  const apso::Pinhole camera{270, 270, 159.5, 119.5, 320, 240};
  const double readout = 0.03;
  std::vector<Seen> recording;
  for (int i = 0; i < 12; ++i) recording.push_back(look(camera, i / 30.0, readout / camera.height));
  double before_sum = 0;
  double after_sum = 0;

  // [shutter]
  apso::CameraVelocity velocity(camera);
  apso::RollingShutter shutter(camera, readout);  // seconds from the first row to the last
  apso::Image<float> intensity;
  for (std::size_t i = 0; i < recording.size(); ++i) {
    const Seen& latest = recording[i];
    velocity.push(apso::frame(latest.timestamp, latest.intensity, latest.depth, camera));  // images of any type
    if (i == 0) continue;
    const Seen& seen = recording[i - 1];  // it can be mended now that the way on from it is known
    const auto as_read = apso::frame(seen.timestamp, seen.intensity, seen.depth, camera);
    const std::optional<apso::Twist> v = velocity.of_frame_before();
    if (!v) continue;              // the pipeline gets it as it was read
    const double depth_delay = 0;  // stamp of the depth image less that of the colour image [s]
    shutter.follow(as_read, *v, depth_delay);
    shutter.intensity(as_read, intensity);
    const auto mended = apso::frame(seen.timestamp, intensity, shutter.depth(), camera);  // for the pipeline
    // [/shutter]
    const Seen at_once = look(camera, mended.timestamp, 0);
    before_sum += difference(seen.intensity, at_once.intensity);
    after_sum += difference(intensity, at_once.intensity);
    // [shutter]
  }
  // [/shutter]
  std::printf("mean difference to a global shutter: %.4f as read, %.4f mended\n", before_sum / 11, after_sum / 11);
  return after_sum < 0.3 * before_sum ? 0 : 1;
}
