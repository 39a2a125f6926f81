/// \file
/// Cameras: specialise camera_traits for your camera model. Algorithms accept it if it is a pinhole; images of a lens with
/// distortion are rectified first (rectifier.hpp).
///
/// \code
/// template <>
/// struct apso::camera_traits<MyCamera> {
///   // false when the point cannot be seen (behind the camera); the pixel may lie outside the image
///   static bool project(const MyCamera& c, const Eigen::Vector3d& X, Eigen::Vector2d& pixel);
///   // ray through a pixel, scaled to z = 1
///   static Eigen::Vector3d unproject(const MyCamera& c, const Eigen::Vector2d& pixel);
/// };
/// \endcode
///
/// Pixel centres lie at integer coordinates; X is in the camera frame (x right, y down, z forward), in metres.
#pragma once

#include <cmath>
#include <type_traits>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/traits/detail.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Specialise for your camera type. The second parameter is free for std::enable_if.
template <class T, class Enable = void>
struct camera_traits {};

template <>
struct camera_traits<Pinhole> {
  static bool project(const Pinhole& camera, const Eigen::Vector3d& X, Eigen::Vector2d& pixel) {
    if (!(X.z() > 0)) return false;
    pixel = camera.project(X);
    return true;
  }
  static Eigen::Vector3d unproject(const Pinhole& camera, const Eigen::Vector2d& pixel) {
    return camera.unproject(pixel.x(), pixel.y(), 1.0);
  }
};

namespace detail {
template <class T>
using camera_project_t =
    decltype(camera_traits<T>::project(std::declval<const T&>(), std::declval<const Eigen::Vector3d&>(), std::declval<Eigen::Vector2d&>()));
template <class T>
using camera_unproject_t = decltype(camera_traits<T>::unproject(std::declval<const T&>(), std::declval<const Eigen::Vector2d&>()));
template <class T>
inline constexpr bool camera_has_project = detected_as_v<bool, camera_project_t, T>;
template <class T>
inline constexpr bool camera_has_unproject = detected_as_v<Eigen::Vector3d, camera_unproject_t, T>;
}  // namespace detail

/// True when T can be used as a camera.
template <class T>
inline constexpr bool is_camera_v = detail::camera_has_project<T>&& detail::camera_has_unproject<T>;

/// Names every member of camera_traits<T> that is missing, in the compiler's message.
template <class T>
struct require_camera {
  static_assert(detail::camera_has_project<T>,
                "apso: camera_traits<T> needs `static bool project(const T& camera, const Eigen::Vector3d& X, "
                "Eigen::Vector2d& pixel);`");
  static_assert(detail::camera_has_unproject<T>,
                "apso: camera_traits<T> needs `static Eigen::Vector3d unproject(const T& camera, "
                "const Eigen::Vector2d& pixel);`");
};

/// Stands first in every function that takes a camera type of the user; see check_image.
template <class T>
constexpr require_camera<T> check_camera() {
  return {};
}

/// The pinhole that your camera is. Throws contract_error when it is none (lens distortion): apso::Rectifier makes images of a
/// pinhole from those of such a camera.
/// \param tolerance_px how far a pixel of your camera may lie from the pinhole's [px]
template <class CameraT>
[[nodiscard]] Pinhole to_pinhole(const CameraT& camera, int width, int height, double tolerance_px = 0.01) {
  check_camera<CameraT>();
  using Traits = camera_traits<CameraT>;
  expects(width > 1 && height > 1, "to_pinhole: width and height must be > 1");
  const double right = width - 1;
  const double bottom = height - 1;
  const Eigen::Vector3d first = Traits::unproject(camera, Eigen::Vector2d(0, 0));
  const Eigen::Vector3d last = Traits::unproject(camera, Eigen::Vector2d(right, bottom));
  Pinhole p;
  p.fx = right / (last.x() - first.x());
  p.fy = bottom / (last.y() - first.y());
  p.cx = -first.x() * p.fx;
  p.cy = -first.y() * p.fy;
  p.width = width;
  p.height = height;
  p.validate();
  for (int j = 0; j <= 4; ++j) {
    for (int i = 0; i <= 4; ++i) {
      const Eigen::Vector2d pixel(right * i / 4.0, bottom * j / 4.0);
      const Eigen::Vector3d ray = Traits::unproject(camera, pixel);
      const double error = norm(p.project(ray) - pixel);
      // false for NaN
      expects(
          error <= tolerance_px,
          "to_pinhole: the camera has lens distortion; rectify its images first, with apso::Rectifier (apso/traits/images/rectifier.hpp)");
    }
  }
  return p;
}

APSO_NAMESPACE_END
