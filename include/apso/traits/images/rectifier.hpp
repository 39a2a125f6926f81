/// \file
/// Images of a camera with lens distortion as those of a pinhole: the maps are made once, then every frame is remapped.
///
/// \code
/// const apso::Rectifier rectifier(my_camera, 640, 480);      // any type with camera_traits
/// apso::Image<float> grey, depth;
/// rectifier.intensity(my_grey, grey);                        // bilinear, in [0,1]
/// rectifier.depth(apso::scaled(my_depth, 1 / 5000.F), depth);  // nearest pixel, in metres
/// pipeline.observe(apso::frame(timestamp, grey, depth, rectifier.pinhole()), T_prior);
/// \endcode
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/traits/camera.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/images/rows.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// The pinhole that a camera is near its optical axis. For a lens described by a polynomial of the radius (Brown, Kannala &
/// Brandt) that is the pinhole the polynomial starts from.
template <class CameraT>
[[nodiscard]] Pinhole central_pinhole(const CameraT& camera, int width, int height) {
  check_camera<CameraT>();
  constexpr double step = 1e-4;  // of a ray at z = 1: far above rounding, far below the curvature of a lens
  Eigen::Vector2d centre{0, 0}, left{0, 0}, right{0, 0}, above{0, 0}, below{0, 0};
  const auto projects = [&](double x, double y, Eigen::Vector2d& out) {
    return camera_traits<CameraT>::project(camera, Eigen::Vector3d(x, y, 1), out) && std::isfinite(out.x()) && std::isfinite(out.y());
  };
  expects(projects(0, 0, centre) && projects(-step, 0, left) && projects(step, 0, right) && projects(0, -step, above) &&
              projects(0, step, below),
          "central_pinhole: the camera does not project its optical axis");
  Pinhole p;
  p.fx = (right.x() - left.x()) / (2 * step);
  p.fy = (below.y() - above.y()) / (2 * step);
  p.cx = centre.x();
  p.cy = centre.y();
  p.width = width;
  p.height = height;
  p.validate();
  return p;
}

/// Remaps images of a distorted camera to a pinhole at the same place with the same axes, so that depth along the axis
/// stays what it is. Read-only after construction: threads may share one.
class Rectifier {
 public:
  /// \param camera any type with camera_traits
  /// \param width,height of its images [px]
  template <class CameraT>
  Rectifier(const CameraT& camera, int width, int height) : Rectifier(camera, width, height, central_pinhole(camera, width, height)) {}
  /// \param pinhole the camera of the rectified images, of any size
  template <class CameraT>
  Rectifier(const CameraT& camera, int width, int height, const Pinhole& pinhole) : pinhole_(pinhole), width_(width), height_(height) {
    check_camera<CameraT>();
    pinhole_.validate();
    expects(width > 1 && height > 1 && width <= kLargest && height <= kLargest, "Rectifier: width and height must be in [2, 32767]");
    map_.reserve(static_cast<std::size_t>(pinhole.width) * static_cast<std::size_t>(pinhole.height));
    for (int y = 0; y < pinhole.height; ++y) {
      for (int x = 0; x < pinhole.width; ++x) {
        Eigen::Vector2d p;
        const bool seen = camera_traits<CameraT>::project(camera, pinhole.unproject(x, y, 1.0), p);
        map_.push_back(seen ? source(p.x(), p.y()) : Source{});
      }
    }
  }

  [[nodiscard]] const Pinhole& pinhole() const { return pinhole_; }

  /// Intensity in [0,1], interpolated bilinearly; 0 where the lens does not see.
  /// \param image any image of the distorted camera; 8 and 16 bit are brought to [0,1]
  template <class ImageT>
  void intensity(const ImageT& image, Image<float>& out) const {
    check(image);
    const auto in_unit = as_intensity(image);
    remap(out, 0.0F, [&](const Source& s) {
      const int x1 = s.x + (s.fx > 0 ? 1 : 0);  // a source on the last column or row has no neighbour, and needs none
      const int y1 = s.y + (s.fy > 0 ? 1 : 0);
      const float top = (1 - s.fx) * pixel(in_unit, s.x, s.y) + s.fx * pixel(in_unit, x1, s.y);
      const float bottom = (1 - s.fx) * pixel(in_unit, s.x, y1) + s.fx * pixel(in_unit, x1, y1);
      return (1 - s.fy) * top + s.fy * bottom;
    });
  }
  /// Depth in metres, of the nearest pixel, so that no surface is made up between two; 0 where the lens does not see.
  /// \param image any image of the distorted camera, in metres: `scaled(raw, 1 / 5000.F)`
  template <class ImageT>
  void depth(const ImageT& image, Image<float>& out) const {
    static_assert(!is_image_v<ImageT> || std::is_floating_point_v<typename image_traits<ImageT>::value_type>,
                  "apso: integer depth needs its unit, e.g. `apso::scaled(depth, 1 / 5000.F)` for TUM files, "
                  "`apso::scaled(depth, 0.001F)` for millimetres");
    nearest(image, out);
  }
  /// Values of the nearest pixel, for masks and labels; 0 where the lens does not see.
  template <class ImageT, class T>
  void nearest(const ImageT& image, Image<T>& out) const {
    check(image);
    remap(out, T{}, [&](const Source& s) {
      return static_cast<T>(image_traits<ImageT>::at(image, s.x + (s.fx >= 0.5F ? 1 : 0), s.y + (s.fy >= 0.5F ? 1 : 0)));
    });
  }

 private:
  static constexpr int kLargest = 32767;  // of std::int16_t
  struct Source {                         // pixel (x + fx, y + fy) of the distorted image; x < 0: outside
    std::int16_t x = -1, y = -1;
    float fx = 0, fy = 0;
  };

  [[nodiscard]] Source source(double x, double y) const {
    constexpr double rounding = 1e-6;  // [px] a camera without distortion must find its own border
    if (!(x >= -rounding && y >= -rounding && x <= width_ - 1 + rounding && y <= height_ - 1 + rounding)) return {};
    const auto split = [](double v, int size, std::int16_t& whole, float& part) {
      v = v < 0 ? 0 : (v > size - 1 ? size - 1 : v);
      const double below = std::floor(v + rounding);
      const double rest = v - below;
      whole = static_cast<std::int16_t>(below);
      part = rest > rounding ? static_cast<float>(rest) : 0.0F;
    };
    Source s;
    split(x, width_, s.x, s.fx);
    split(y, height_, s.y, s.fy);
    return s;
  }
  template <class ImageT>
  void check(const ImageT& image) const {
    check_image<ImageT>();
    expects(image_traits<ImageT>::width(image) == width_ && image_traits<ImageT>::height(image) == height_,
            "Rectifier: the image has another size than the camera it was made for");
  }
  template <class T, class Read>
  void remap(Image<T>& out, T outside, Read&& read) const {
    out.resize(pinhole_.width, pinhole_.height);
    const Source* s = map_.data();
    for (int y = 0; y < pinhole_.height; ++y) {
      T* row = out.row(y);
      for (int x = 0; x < pinhole_.width; ++x, ++s) row[x] = s->x < 0 ? outside : read(*s);
    }
  }

  Pinhole pinhole_;
  int width_;
  int height_;
  std::vector<Source> map_;
};

APSO_NAMESPACE_END
