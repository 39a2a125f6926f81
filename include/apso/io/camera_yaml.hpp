/// \file
/// Cameras from YAML. Needs yaml-cpp.
///
/// \code{.yaml}
/// name: my camera        # optional
/// fx: 535.4              # [px]
/// fy: 539.2
/// cx: 320.1
/// cy: 247.6
/// width: 640             # [px]
/// height: 480
/// depth_scale: 5000      # units of the depth image per metre; must be given
/// k1: 0                  # optional distortion, as in OpenCV: k1 k2 p1 p2 k3
/// \endcode
#pragma once

#include <cmath>
#include <fstream>
#include <sstream>
#include <string>

#include <yaml-cpp/yaml.h>

#include <apso/config.hpp>
#include <apso/io/camera_model.hpp>
#include <apso/io/tum_text.hpp>

APSO_NAMESPACE_BEGIN

/// Reads a camera.
/// \throws io_error naming the file, the line where known, the field and what was expected
[[nodiscard]] inline CameraModel camera_from_yaml(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw io_error(path + ": cannot open, expected a YAML file that describes a camera");
  std::stringstream text;
  text << file.rdbuf();
  YAML::Node root;
  try {
    root = YAML::Load(text.str());
  } catch (const YAML::Exception& e) {
    throw io_error(path + ":" + std::to_string(e.mark.line + 1) + ": " + e.msg + ", expected YAML");
  }
  if (!root.IsMap()) throw io_error(path + ": expected fields fx, fy, cx, cy, width, height, depth_scale");
  CameraModel camera;
  camera.name = path;
  const auto number = [&](const char* name, double& value, bool needed) {
    const YAML::Node node = root[name];
    if (!node) {
      if (needed) throw io_error(path + ": field " + name + " is missing, expected a number");
      return;
    }
    const std::string where = path + ":" + std::to_string(node.Mark().line + 1) + ": field " + name;
    try {
      value = node.as<double>();
    } catch (const YAML::Exception&) {
      throw io_error(where + " is no number");
    }
    if (!std::isfinite(value)) throw io_error(where + " is not finite, expected a number");
  };
  const auto positive = [&](const char* name, double& value) {
    number(name, value, true);
    if (!(value > 0)) throw io_error(path + ": field " + name + " is not positive, expected a number > 0");
  };
  const auto pixels = [&](const char* name, int& value) {
    double v = 0;
    positive(name, v);
    if (v != std::floor(v) || v > 100000) throw io_error(path + ": field " + name + ", expected a whole number of pixels");
    value = static_cast<int>(v);
  };
  for (const auto& entry : root) {
    std::string name;
    if (entry.first.IsScalar()) name = entry.first.Scalar();
    static constexpr const char* known[] = {"name", "fx", "fy", "cx", "cy", "width", "height", "depth_scale",
                                            "k1",   "k2", "p1", "p2", "k3"};
    bool found = false;
    for (const char* k : known) found = found || name == k;
    if (!found)
      throw io_error(path + ":" + std::to_string(entry.first.Mark().line + 1) + ": field '" + name +
                     "' is not known, expected name fx fy cx cy width height depth_scale k1 k2 p1 p2 k3");
  }
  if (root["name"] && root["name"].IsScalar()) camera.name = root["name"].Scalar();
  positive("fx", camera.pinhole.fx);
  positive("fy", camera.pinhole.fy);
  number("cx", camera.pinhole.cx, true);
  number("cy", camera.pinhole.cy, true);
  pixels("width", camera.pinhole.width);
  pixels("height", camera.pinhole.height);
  positive("depth_scale", camera.depth_scale);
  number("k1", camera.k1, false);
  number("k2", camera.k2, false);
  number("p1", camera.p1, false);
  number("p2", camera.p2, false);
  number("k3", camera.k3, false);
  return camera;
}

APSO_NAMESPACE_END
