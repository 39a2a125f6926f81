/// \file
/// The camera of a recording.
#pragma once

#include <filesystem>
#include <string>

#include <apso/io/camera_yaml.hpp>

namespace track {

/// The camera that a command line names: by its name, or by a YAML file.
inline apso::opencv::CameraModel open_camera(const std::string& camera) {
  if (camera.find('.') != std::string::npos && std::filesystem::is_directory(camera))
    throw apso::io_error(camera + ": is a folder, expected a YAML file");
  // a folder of results may well be called bonn
  const bool is_file = (std::filesystem::exists(camera) && !std::filesystem::is_directory(camera)) || camera.find('.') != std::string::npos;
  if (is_file) return apso::camera_from_yaml(camera);
  try {
    return apso::camera_by_name(camera);
  } catch (const apso::contract_error& e) {
    throw apso::contract_error(std::string(e.what()) + ", or a YAML file; there is no file of this name");
  }
}

}  // namespace track
