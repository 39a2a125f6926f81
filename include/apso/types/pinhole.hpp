/// \file
/// The pinhole camera, u = fx X/Z + cx, v = fy Y/Z + cy, pixel centres at integer coordinates.
#pragma once

#include <cmath>

#include <Eigen/Core>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// Camera without distortion. Distorted images are rectified before they enter the library.
struct Pinhole {
  double fx = 0;   ///< focal length [px]
  double fy = 0;   ///< focal length [px]
  double cx = 0;   ///< principal point [px]
  double cy = 0;   ///< principal point [px]
  int width = 0;   ///< image width [px]
  int height = 0;  ///< image height [px]

  /// Throws contract_error unless the focal lengths are positive, all is finite and the size is not empty.
  void validate() const {
    expects(std::isfinite(fx) && std::isfinite(fy) && fx > 0 && fy > 0, "Pinhole: fx and fy must be > 0");
    expects(std::isfinite(cx) && std::isfinite(cy), "Pinhole: cx and cy must be finite");
    expects(width > 0 && height > 0, "Pinhole: width and height must be > 0");
  }

  /// Pixel of a camera point [m]. Valid for Z > 0; the caller checks Z and the image bounds.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& p) const {
    return {fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy};
  }
  /// Camera point [m] of pixel (u,v) at depth z [m] along the optical axis.
  [[nodiscard]] Eigen::Vector3d unproject(double u, double v, double z) const {
    return {(u - cx) / fx * z, (v - cy) / fy * z, z};
  }
  /// d(u,v)/d(X,Y,Z).
  [[nodiscard]] Eigen::Matrix<double, 2, 3> project_jacobian(const Eigen::Vector3d& p) const {
    const double iz = 1.0 / p.z();
    Eigen::Matrix<double, 2, 3> j;
    j(0, 0) = fx * iz;
    j(1, 1) = fy * iz;
    j(0, 1) = j(1, 0) = 0;
    j(0, 2) = -fx * p.x() * iz * iz;
    j(1, 2) = -fy * p.y() * iz * iz;
    return j;
  }
  /// True when (u,v) lies at least `border` pixels inside the image.
  [[nodiscard]] bool contains(double u, double v, double border = 0) const {
    return u >= border && v >= border && u <= width - 1 - border && v <= height - 1 - border;
  }
  /// Camera of the image at half the size: a pixel there covers 2x2 pixels here, so c' = (c + 0.5)/2 - 0.5.
  [[nodiscard]] Pinhole halved() const {
    return {fx / 2, fy / 2, (cx + 0.5) / 2 - 0.5, (cy + 0.5) / 2 - 0.5, width / 2, height / 2};
  }
};

APSO_NAMESPACE_END
