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
/// readout: 0.03          # optional: time from the first row to the last [s], of a rolling shutter
/// stamp_delay: 0.015     # optional: stamp of an image less the time at which its middle row was read [s]
/// k1: 0                  # optional distortion, as in OpenCV: k1 k2 p1 p2 k3
/// \endcode
#pragma once

#include <cmath>
#include <sstream>
#include <string>

#include <yaml-cpp/yaml.h>

#include <apso/config.hpp>
#include <apso/io/camera_model.hpp>
#include <apso/io/field_reader.hpp>
#include <apso/io/yaml_file.hpp>
#include <apso/printable.hpp>

APSO_NAMESPACE_BEGIN

/// Reads a camera.
/// \throws io_error naming the file, the line where known, the field and what was expected: a number in its range (those of Pinhole
///         and CameraModel), no name twice, one document
[[nodiscard]] inline CameraModel camera_from_yaml(const std::string& path) {
  const YAML::Node root = detail::load_yaml(path, "a YAML file that describes a camera");
  if (!root.IsMap()) throw io_error(path + ": expected fields fx, fy, cx, cy, width, height, depth_scale");
  CameraModel camera;
  camera.name = path;
  const auto number = [&](const char* name, double& value, bool needed, double lowest, double highest) {
    const YAML::Node node = root[name];
    if (!node) {
      if (needed) throw io_error(path + ": field " + name + " is missing, expected a number");
      return;
    }
    std::ostringstream text;
    text << path << ':' << node.Mark().line + 1 << ": field " << name;
    try {
      value = node.as<double>();
    } catch (const YAML::Exception&) {
      throw io_error(text.str() + " is no number");
    }
    if (value >= lowest && value <= highest) return;  // false for NaN
    text << " is " << printable(node.Scalar()) << ", expected a number in [" << lowest << ", " << highest << "]";
    throw io_error(text.str());
  };
  const auto pixels = [&](const char* name, int& value) {
    double v = 0;
    number(name, v, true, 1, Pinhole::kMaxSide);
    if (v != std::floor(v)) throw io_error(path + ": field " + name + ", expected a whole number of pixels");
    value = static_cast<int>(v);
  };
  for (const auto& entry : root) {
    std::string name;
    if (entry.first.IsScalar()) name = entry.first.Scalar();
    static constexpr const char* known[] = {
        "name", "fx", "fy", "cx", "cy", "width", "height", "depth_scale", "readout", "stamp_delay", "inverse_depth_sigma",
        "k1",   "k2", "p1", "p2", "k3"};
    bool found = false;
    for (const char* k : known) found = found || name == k;
    if (!found)
      throw io_error(
          path + ":" + std::to_string(entry.first.Mark().line + 1) + ": field '" + printable(name) +
          "' is not known, expected name fx fy cx cy width height depth_scale readout stamp_delay inverse_depth_sigma k1 k2 p1 p2 k3");
  }
  if (root["name"] && root["name"].IsScalar()) camera.name = root["name"].Scalar();
  number("fx", camera.pinhole.fx, true, Pinhole::kMinFocal, Pinhole::kMaxFocal);
  number("fy", camera.pinhole.fy, true, Pinhole::kMinFocal, Pinhole::kMaxFocal);
  number("cx", camera.pinhole.cx, true, -Pinhole::kMaxPrincipal, Pinhole::kMaxPrincipal);
  number("cy", camera.pinhole.cy, true, -Pinhole::kMaxPrincipal, Pinhole::kMaxPrincipal);
  pixels("width", camera.pinhole.width);
  pixels("height", camera.pinhole.height);
  if (camera.pinhole.width > Pinhole::kMaxPixels / camera.pinhole.height)
    throw io_error(path + ": fields width and height are " + std::to_string(camera.pinhole.width) + " x " +
                   std::to_string(camera.pinhole.height) + ", expected at most " + std::to_string(Pinhole::kMaxPixels) + " pixels");
  number("depth_scale", camera.depth_scale, true, CameraModel::kMinDepthScale, CameraModel::kMaxDepthScale);
  number("readout", camera.readout, false, -CameraModel::kMaxReadout, CameraModel::kMaxReadout);
  number("stamp_delay", camera.stamp_delay, false, -CameraModel::kMaxStampDelay, CameraModel::kMaxStampDelay);
  number("inverse_depth_sigma", camera.inverse_depth_sigma, false, CameraModel::kMinDepthSigma, CameraModel::kMaxDepthSigma);
  const auto distortion = [&](const char* name, double& value) {
    number(name, value, false, -CameraModel::kMaxDistortion, CameraModel::kMaxDistortion);
  };
  distortion("k1", camera.k1);
  distortion("k2", camera.k2);
  distortion("p1", camera.p1);
  distortion("p2", camera.p2);
  distortion("k3", camera.k3);
  return camera;
}

APSO_NAMESPACE_END
