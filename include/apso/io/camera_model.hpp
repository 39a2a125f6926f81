/// \file
/// A camera as data sets describe it: pinhole, lens distortion, depth unit.
#pragma once

#include <cmath>
#include <limits>
#include <string>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/traits/camera.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Pinhole with radial-tangential distortion (Brown) and the unit of its depth images.
struct CameraModel {
  std::string name;
  Pinhole pinhole;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;  ///< order and meaning as in OpenCV
  double depth_scale = 5000;                      ///< units of the depth image per metre
  double readout = 0;                             ///< time from the first row to the last [s]; 0: all rows at once (rolling_shutter.hpp)
  double stamp_delay = 0;                         ///< stamp of an image less the time at which its middle row was read [s]
  double inverse_depth_sigma = 0;                 ///< of a depth, with what neighbours and frames share [1/m]; 0: not known

  /// Limits of what is taken for a camera, besides those of Pinhole.
  static constexpr double kMinDepthScale = 1e-3;  ///< [units per metre]: kilometres
  static constexpr double kMaxDepthScale = 1e9;   ///< [units per metre]: nanometres
  static constexpr double kMaxDistortion = 1e6;   ///< of each coefficient
  static constexpr double kMaxReadout = 0.2;      ///< [s], in either direction
  static constexpr double kMaxStampDelay = 0.2;   ///< [s], in either direction
  static constexpr double kMinDepthSigma = 1e-6;  ///< [1/m], where it is known
  static constexpr double kMaxDepthSigma = 1;     ///< [1/m]

  [[nodiscard]] bool distorted() const { return k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || k3 != 0; }

  /// Where the lens puts the ray (x, y, 1).
  [[nodiscard]] Eigen::Vector2d distort(double x, double y) const {
    const double r2 = x * x + y * y;
    const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
  }

  void validate() const {
    pinhole.validate();
    expects(depth_scale >= kMinDepthScale && depth_scale <= kMaxDepthScale,
            "CameraModel: depth_scale must be > 0, in [0.001, 1e9] units per metre");
    expects(std::abs(readout) <= kMaxReadout, "CameraModel: readout must be in [-0.2, 0.2] s");
    expects(std::abs(stamp_delay) <= kMaxStampDelay, "CameraModel: stamp_delay must be in [-0.2, 0.2] s");
    expects(inverse_depth_sigma == 0 || (inverse_depth_sigma >= kMinDepthSigma && inverse_depth_sigma <= kMaxDepthSigma),
            "CameraModel: inverse_depth_sigma must be 0 (not known) or in [1e-6, 1] 1/m");
    for (const double c : {k1, k2, p1, p2, k3})
      expects(std::abs(c) <= kMaxDistortion, "CameraModel: the distortion must be finite, in [-1e6, 1e6]");
  }
};

/// Takes part wherever a camera does, e.g. `Rectifier(camera_by_name("tum-fr1"), 640, 480)`.
template <>
struct camera_traits<CameraModel> {
  /// False behind the camera and beyond the radius where the polynomial of the lens turns back: no image shows such a point.
  static bool project(const CameraModel& c, const Eigen::Vector3d& X, Eigen::Vector2d& pixel) {
    if (!(X.z() > 0)) return false;
    const double x = X.x() / X.z();
    const double y = X.y() / X.z();
    const double r2 = x * x + y * y;
    if (!(1 + r2 * (3 * c.k1 + r2 * (5 * c.k2 + r2 * 7 * c.k3)) > 0)) return false;  // d(r radial)/dr
    const Eigen::Vector2d d = c.distort(x, y);
    pixel = {c.pinhole.fx * d.x() + c.pinhole.cx, c.pinhole.fy * d.y() + c.pinhole.cy};
    return true;
  }
  /// Newton's method from the distorted point; NaN where it finds no ray.
  static Eigen::Vector3d unproject(const CameraModel& c, const Eigen::Vector2d& pixel) {
    const double u = (pixel.x() - c.pinhole.cx) / c.pinhole.fx;
    const double v = (pixel.y() - c.pinhole.cy) / c.pinhole.fy;
    double x = u;
    double y = v;
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector2d d = c.distort(x, y);
      const double ex = d.x() - u;
      const double ey = d.y() - v;
      if (std::abs(ex) + std::abs(ey) < 1e-13) return {x, y, 1};
      const double r2 = x * x + y * y;
      const double radial = 1 + r2 * (c.k1 + r2 * (c.k2 + r2 * c.k3));
      const double slope = c.k1 + r2 * (2 * c.k2 + r2 * 3 * c.k3);  // d radial / d r2
      const double xx = radial + 2 * x * x * slope + 2 * c.p1 * y + 6 * c.p2 * x;
      const double xy = 2 * x * y * slope + 2 * c.p1 * x + 2 * c.p2 * y;
      const double yy = radial + 2 * y * y * slope + 6 * c.p1 * y + 2 * c.p2 * x;
      const double determinant = xx * yy - xy * xy;
      if (!(std::abs(determinant) > 1e-12)) break;
      x -= (yy * ex - xy * ey) / determinant;
      y -= (xx * ey - xy * ex) / determinant;
    }
    const Eigen::Vector2d d = c.distort(x, y);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    return std::abs(d.x() - u) + std::abs(d.y() - v) < 1e-9 ? Eigen::Vector3d(x, y, 1) : Eigen::Vector3d(nan, nan, nan);
  }
};

/// Cameras of public data sets: tum-fr1, tum-fr2, tum-fr3 (Sturm et al. 2012), bonn (Palazzolo et al. 2019),
/// icl-nuim (Handa et al. 2014). All 640 x 480 with 5000 depth units per metre. The Kinects and Xtions of tum-* and bonn read an image
/// within 30 ms (docs/tracker.md; Kerl et al., ICCV 2015, simulate 28 ms). The Kinect of tum-fr1 stamps an image when it has been read:
/// 15 ms after its middle row. Their depth comes from a disparity of structured light, which proved to be wrong by about half a pixel with
/// calibration and registration: 0.5 / (580 px x 7.5 cm) = 0.012 1/m (docs/tracker.md; tum-fr2 and tum-fr3 were not measured).
[[nodiscard]] inline CameraModel camera_by_name(const std::string& name) {
  const auto make = [&](double fx, double fy, double cx, double cy) {
    CameraModel c;
    if (name != "icl-nuim") {  // which is rendered
      c.readout = 0.03;
      c.inverse_depth_sigma = 0.012;
    }
    c.name = name;
    c.pinhole = {fx, fy, cx, cy, 640, 480};
    return c;
  };
  const auto distorted = [](CameraModel c, double k1, double k2, double p1, double p2, double k3) {
    c.k1 = k1;
    c.k2 = k2;
    c.p1 = p1;
    c.p2 = p2;
    c.k3 = k3;
    return c;
  };
  if (name == "tum-fr1") {
    CameraModel c = make(517.3, 516.5, 318.6, 255.3);
    c.stamp_delay = 0.015;
    return distorted(c, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633);
  }
  if (name == "tum-fr2") return distorted(make(520.9, 521.0, 325.1, 249.7), 0.2312, -0.7849, -0.0033, -0.0001, 0.9172);
  if (name == "tum-fr3") return make(535.4, 539.2, 320.1, 247.6);
  if (name == "bonn") return distorted(make(542.822841, 542.576870, 315.593520, 237.756098), 0.039903, -0.099343, -0.000730, -0.000144, 0);
  if (name == "icl-nuim") return make(481.2, 480.0, 319.5, 239.5);  // published fy = -480: its y axis points up
  contract_violation("camera \"" + name + "\" is not known, expected tum-fr1, tum-fr2, tum-fr3, bonn or icl-nuim");
}

APSO_NAMESPACE_END
