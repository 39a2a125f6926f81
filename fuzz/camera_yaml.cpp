// Cameras as YAML: one that is read is valid, and its rays come back to their pixels or are said to be none.
#include <apso/io/camera_yaml.hpp>

#include "input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static fuzz::MemoryFile file;
  const std::string& path = file.write(data, size);
  try {
    const apso::CameraModel camera = apso::camera_from_yaml(path);
    camera.validate();
    using Traits = apso::camera_traits<apso::CameraModel>;
    const Eigen::Vector2d pixel(camera.pinhole.width / 3.0, camera.pinhole.height / 4.0);
    const Eigen::Vector3d ray = Traits::unproject(camera, pixel);
    Eigen::Vector2d again;
    if (apso::all_finite(ray) && Traits::project(camera, ray, again)) {
      fuzz::require((again - pixel).norm() < 1e-2 * (1 + pixel.norm()), "a ray comes back to its pixel");
    }
  } catch (const apso::io_error& e) {
    fuzz::require_names_file(e.what(), path);
  }
  return 0;
}
