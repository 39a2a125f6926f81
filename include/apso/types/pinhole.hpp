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

  /// Limits of what is taken for a camera: far beyond any that is built, and such that no product of these numbers overflows.
  static constexpr double kMinFocal = 1e-3;     ///< [px]
  static constexpr double kMaxFocal = 1e6;      ///< [px]
  static constexpr double kMaxPrincipal = 1e6;  ///< of |cx| and |cy| [px]
  static constexpr int kMaxSide = 32767;        ///< of width and height [px]; remapping stores pixels in 16 bits
  static constexpr int kMaxPixels = 100000000;  ///< of width times height

  /// Throws contract_error unless all is within the limits above and the size is not empty. NaN is not.
  void validate() const {
    const auto focal = [](double f) { return f >= kMinFocal && f <= kMaxFocal; };
    expects(focal(fx) && focal(fy), "Pinhole: fx and fy must be > 0, in [0.001, 1e6]");
    expects(std::abs(cx) <= kMaxPrincipal && std::abs(cy) <= kMaxPrincipal, "Pinhole: cx and cy must be finite, in [-1e6, 1e6]");
    expects(width > 0 && height > 0 && width <= kMaxSide && height <= kMaxSide, "Pinhole: width and height must be > 0 and at most 32767");
    expects(width <= kMaxPixels / height, "Pinhole: the image must have at most 100,000,000 pixels");
  }

  /// Pixel of a camera point [m]. Valid for Z > 0; the caller checks Z and the image bounds.
  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& p) const { return {fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy}; }
  /// Camera point [m] of pixel (u,v) at depth z [m] along the optical axis.
  [[nodiscard]] Eigen::Vector3d unproject(double u, double v, double z) const { return {(u - cx) / fx * z, (v - cy) / fy * z, z}; }
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
  [[nodiscard]] Pinhole halved() const { return {fx / 2, fy / 2, (cx + 0.5) / 2 - 0.5, (cy + 0.5) / 2 - 0.5, width / 2, height / 2}; }
};

APSO_NAMESPACE_END
