/// \file
/// A camera from a YAML file. Needs yaml-cpp.
/// \code
///   fx: 535.4        # [px]
///   fy: 539.2
///   cx: 320.1
///   cy: 247.6
///   width: 640
///   height: 480
///   depth_scale: 5000  # units of the depth image per metre
///   k1: 0              # distortion as in OpenCV, optional: k1 k2 p1 p2 k3
/// \endcode
#pragma once

#include <string>

#include <apso/io/camera_model.hpp>
#include <apso/io/parameters.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
/// The fields of a camera file; the required ones start out of range so that a missing one is refused.
struct CameraFile {
  double fx = -1, fy = -1, cx = -1, cy = -1;
  int width = -1, height = -1;
  double depth_scale = -1;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("fx", s.fx, 1.0, 1e6);
    v("fy", s.fy, 1.0, 1e6);
    v("cx", s.cx, 0.0, 1e6);
    v("cy", s.cy, 0.0, 1e6);
    v("width", s.width, 16, 100000);
    v("height", s.height, 16, 100000);
    v("depth_scale", s.depth_scale, 1e-6, 1e9);
    v("k1", s.k1, -1e3, 1e3);
    v("k2", s.k2, -1e3, 1e3);
    v("p1", s.p1, -1e3, 1e3);
    v("p2", s.p2, -1e3, 1e3);
    v("k3", s.k3, -1e3, 1e3);
  }
};
}  // namespace detail

/// Reads a camera. Throws io_error naming file, line and field; every field but the distortion is required.
[[nodiscard]] inline CameraModel camera_from_yaml(const std::string& file) {
  detail::CameraFile f;
  read_parameters(file, f);
  const auto require = [&](bool present, const char* field) {
    if (!present) throw io_error(file + ": camera field '" + field + "' is missing");
  };
  require(f.fx > 0, "fx");
  require(f.fy > 0, "fy");
  require(f.cx >= 0, "cx");
  require(f.cy >= 0, "cy");
  require(f.width > 0, "width");
  require(f.height > 0, "height");
  require(f.depth_scale > 0, "depth_scale");
  CameraModel camera;
  camera.name = file;
  camera.pinhole = {f.fx, f.fy, f.cx, f.cy, f.width, f.height};
  camera.k1 = f.k1;
  camera.k2 = f.k2;
  camera.p1 = f.p1;
  camera.p2 = f.p2;
  camera.k3 = f.k3;
  camera.depth_scale = f.depth_scale;
  return camera;
}

APSO_NAMESPACE_END
