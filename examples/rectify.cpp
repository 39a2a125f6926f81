// Images of a camera with lens distortion, made into those of a pinhole. Eigen is all this file needs.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include <apso/io/camera_model.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/images/rectifier.hpp>

int main() {
  const std::vector<std::uint8_t> grey(640 * 480, 100);
  const std::vector<std::uint16_t> millimetres(640 * 480, 2000);
  const apso::ImageView<const std::uint8_t> my_grey(grey.data(), 640, 480);
  const apso::ImageView<const std::uint16_t> my_depth(millimetres.data(), 640, 480);
  const double timestamp = 0;

  // [rectify]
  const apso::Rectifier rectifier(apso::camera_by_name("tum-fr1"), 640, 480);  // or your type with camera_traits
  apso::Image<float> intensity, depth;
  rectifier.intensity(my_grey, intensity);                 // for each frame
  rectifier.depth(apso::scaled(my_depth, 0.001F), depth);  // millimetres
  const auto frame = apso::frame(timestamp, intensity, depth, rectifier.pinhole());
  // [/rectify]

  std::printf("fx %.1f, depth in the middle %.3f m\n", frame.camera.fx, static_cast<double>(frame.depth()(320, 240)));
  return std::abs(frame.camera.fx - 517.3) < 0.01 && frame.depth()(320, 240) == 2.0F ? 0 : 1;
}
