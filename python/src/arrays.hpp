/// \file
/// NumPy arrays as what the library takes: images where they lie, poses, cameras and lists.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/traits/any.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/images/byte_image.hpp>
#include <apso/traits/images/rows.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

namespace py = pybind11;

namespace apso_python {

/// "(480, 640)", as NumPy prints a shape.
inline std::string shape_text(const py::array& a) { return py::str(a.attr("shape")); }
inline std::string dtype_text(const py::array& a) { return py::str(a.attr("dtype")); }

/// A two-dimensional array of uint8, uint16 or float32, read where it lies: rows and pixels may be any positive number of bytes apart,
/// and of either byte order. Must stay in place, as must the array.
class ArrayImage {
 public:
  /// \param name of the argument, for messages
  ArrayImage(py::array array, const char* name) : array_(std::move(array)) {
    if (array_.ndim() != 2) fail(name, "expected an image of two dimensions, (height, width)");
    if (array_.shape(0) < 1 || array_.shape(1) < 1 || array_.shape(0) > apso::Pinhole::kMaxSide ||
        array_.shape(1) > apso::Pinhole::kMaxSide) {
      fail(name, "expected 1 to 32767 rows and columns");
    }
    if (array_.strides(0) < 0 || array_.strides(1) < 0) fail(name, "its strides are negative: give a copy, numpy.ascontiguousarray(...)");
    const char kind = array_.dtype().kind();
    const py::ssize_t size = array_.itemsize();
    if (kind == 'u' && size == 1) view<std::uint8_t>(name);
    else if (kind == 'u' && size == 2) view<std::uint16_t>(name);
    else if (kind == 'f' && size == 4) view<float>(name);
    else throw py::type_error(std::string(name) + " has dtype " + dtype_text(array_) + ", expected uint8, uint16 or float32");
  }
  ArrayImage(const ArrayImage&) = delete;
  ArrayImage& operator=(const ArrayImage&) = delete;

  /// As the library takes it; refers to this object.
  [[nodiscard]] const apso::AnyImage& any() const { return any_; }
  [[nodiscard]] bool floating() const { return floating_; }
  /// What 8 and 16 bit are multiplied with to be in [0,1].
  [[nodiscard]] float intensity_unit() const { return floating_ ? 1.0F : array_.itemsize() == 1 ? 1.0F / 255 : 1.0F / 65535; }
  [[nodiscard]] int width() const { return static_cast<int>(array_.shape(1)); }
  [[nodiscard]] int height() const { return static_cast<int>(array_.shape(0)); }
  [[nodiscard]] std::string shape() const { return shape_text(array_); }

 private:
  [[noreturn]] void fail(const char* name, const char* expected) const {
    throw py::value_error(std::string(name) + " has shape " + shape_text(array_) + ": " + expected);
  }
  template <class T>
  void view(const char* name) {
    const auto* bytes = static_cast<const std::uint8_t*>(array_.data());
    const auto row = static_cast<std::size_t>(array_.strides(0));
    const auto pixel = static_cast<std::size_t>(array_.strides(1));
    const bool swapped = sizeof(T) > 1 && !array_.dtype().attr("isnative").cast<bool>();
    floating_ = std::is_floating_point_v<T>;
    const bool rows_of_pixels = pixel == sizeof(T) && row % sizeof(T) == 0 && reinterpret_cast<std::uintptr_t>(bytes) % alignof(T) == 0;
    if (rows_of_pixels && !swapped) {
      any_ = apso::ImageView<const T>{reinterpret_cast<const T*>(bytes), width(), height(), static_cast<std::ptrdiff_t>(row / sizeof(T))};
      return;
    }
    if (pixel < sizeof(T) && width() > 1) fail(name, "its pixels overlap");
    image_ = apso::ByteImage<T>{bytes, width(), height(), row, pixel, swapped};
    any_ = std::get<apso::ByteImage<T>>(image_);
  }

  py::array array_;
  bool floating_ = false;
  std::variant<std::monostate, apso::ByteImage<std::uint8_t>, apso::ByteImage<std::uint16_t>, apso::ByteImage<float>> image_;
  apso::AnyImage any_;
};

/// A camera of a 3x3 matrix, or of four numbers fx, fy, cx, cy.
inline apso::Pinhole camera_of(const py::object& K, int width, int height) {
  const auto a = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(K);
  if (!a) throw py::error_already_set();
  apso::Pinhole camera;
  camera.width = width;
  camera.height = height;
  const double* k = a.data();
  if (a.ndim() == 1 && a.shape(0) == 4) {
    camera.fx = k[0], camera.fy = k[1], camera.cx = k[2], camera.cy = k[3];
  } else if (a.ndim() == 2 && a.shape(0) == 3 && a.shape(1) == 3) {
    if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
      throw py::value_error("K must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]: no skew");
    }
    camera.fx = k[0], camera.fy = k[4], camera.cx = k[2], camera.cy = k[5];
  } else {
    throw py::value_error("K has shape " + shape_text(a) + ": expected (3, 3), or (4,) of fx, fy, cx, cy");
  }
  camera.validate();
  return camera;
}

/// Intensity and depth of one moment, of the same shape.
class ArrayFrame {
 public:
  /// \param depth_unit metres per unit of the depth; must be given for integers
  ArrayFrame(const py::array& intensity, const py::array& depth, const char* intensity_name, const char* depth_name,
             const std::optional<double>& depth_unit)
      : intensity_(intensity, intensity_name), depth_(depth, depth_name) {
    if (intensity_.width() != depth_.width() || intensity_.height() != depth_.height()) {
      throw py::value_error(std::string(intensity_name) + " has shape " + intensity_.shape() + " and " + depth_name + " has shape " +
                            depth_.shape() + ": expected the same shape");
    }
    if (!depth_unit && !depth_.floating()) {
      throw py::value_error(std::string(depth_name) +
                            " has integers: give their unit, depth_unit=1/5000 (TUM) or depth_unit=0.001 (millimetres)");
    }
    unit_ = static_cast<float>(depth_unit.value_or(1.0));
    if (!(unit_ >= 1e-12F && unit_ <= 1e9F)) throw py::value_error("depth_unit must be a positive number of metres");
  }
  [[nodiscard]] int width() const { return intensity_.width(); }
  [[nodiscard]] int height() const { return intensity_.height(); }
  [[nodiscard]] std::string shape() const { return intensity_.shape(); }
  [[nodiscard]] auto at(double timestamp, const apso::Pinhole& camera) const {
    return apso::frame(timestamp, apso::scaled(intensity_.any(), intensity_.intensity_unit()), apso::scaled(depth_.any(), unit_), camera);
  }

 private:
  ArrayImage intensity_;
  ArrayImage depth_;
  float unit_ = 1;
};

/// An array of numbers with `columns` columns or more, as double.
inline py::array_t<double> table(const py::object& object, const char* name, py::ssize_t least, const char* columns) {
  auto a = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(object);
  if (!a) throw py::error_already_set();
  if (a.size() == 0 && a.ndim() <= 2) return py::array_t<double>(std::vector<py::ssize_t>{0, least});
  if (a.ndim() != 2 || a.shape(1) < least) {
    throw py::value_error(std::string(name) + " has shape " + shape_text(a) + ": expected (N, " + std::to_string(least) + " or more), " +
                          columns);
  }
  return a;
}

inline std::vector<apso::Keypoint> keypoints_of(const py::object& object) {
  const auto a = table(object, "keypoints", 2, "x, y[, response[, angle[, octave]]]");
  std::vector<apso::Keypoint> out;
  for (py::ssize_t i = 0; i < a.shape(0); ++i) {
    const auto value = [&](py::ssize_t k) { return a.shape(1) > k ? static_cast<float>(a.at(i, k)) : 0.0F; };
    out.push_back({value(0), value(1), value(2), value(3), a.shape(1) > 4 ? static_cast<int>(a.at(i, 4)) : 0});
  }
  return out;
}
inline std::vector<apso::PointTrack> tracks_of(const py::object& object) {
  const auto a = table(object, "tracks", 6, "id, x, y, previous_x, previous_y, age");
  std::vector<apso::PointTrack> out;
  for (py::ssize_t i = 0; i < a.shape(0); ++i) {
    const auto value = [&](py::ssize_t k) { return static_cast<float>(a.at(i, k)); };
    out.push_back({static_cast<std::int64_t>(a.at(i, 0)), value(1), value(2), value(3), value(4), static_cast<int>(a.at(i, 5))});
  }
  return out;
}
inline std::vector<apso::Detection> detections_of(const py::object& object) {
  const auto a = table(object, "detections", 6, "x, y, width, height, score, class_id[, movable]");
  std::vector<apso::Detection> out;
  for (py::ssize_t i = 0; i < a.shape(0); ++i) {
    const auto value = [&](py::ssize_t k) { return static_cast<float>(a.at(i, k)); };
    apso::Detection d;
    d.box = {value(0), value(1), value(2), value(3)};
    d.score = value(4);
    d.class_id = static_cast<int>(a.at(i, 5));
    d.movable = a.shape(1) <= 6 || a.at(i, 6) != 0;
    out.push_back(d);
  }
  return out;
}

/// A list that may be None, for the library: `list` refers to `values`.
template <class Value>
struct MaybeList {
  std::vector<Value> values;
  apso::AnyList<Value> list;
  template <class Convert>
  MaybeList(const py::object& object, Convert&& convert) {
    if (object.is_none()) return;
    values = convert(object);
    list = values;
  }
};

/// An NxM matrix as an array, row by row.
template <class Matrix>
py::array_t<double> array_of(const Matrix& m) {
  py::array_t<double> out({static_cast<py::ssize_t>(m.rows()), static_cast<py::ssize_t>(m.cols())});
  auto to = out.mutable_unchecked<2>();
  for (py::ssize_t i = 0; i < to.shape(0); ++i) {
    for (py::ssize_t j = 0; j < to.shape(1); ++j) to(i, j) = static_cast<double>(m(static_cast<int>(i), static_cast<int>(j)));
  }
  return out;
}
inline py::array_t<double> array_of(const apso::Pose& T) { return array_of(T.matrix()); }

/// An N x N array as a matrix.
template <class Matrix>
Matrix matrix_of(const py::object& object, const char* name, py::ssize_t n) {
  const auto a = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(object);
  if (!a) throw py::error_already_set();
  if (a.ndim() != 2 || a.shape(0) != n || a.shape(1) != n) {
    throw py::value_error(std::string(name) + " has shape " + shape_text(a) + ": expected (" + std::to_string(n) + ", " +
                          std::to_string(n) + ")");
  }
  Matrix m;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) m(i, j) = a.at(i, j);
  }
  return m;
}
/// A 4x4 array as a pose, whatever its numbers are: the function that gets it says what it may be.
inline apso::Pose pose_of(const py::object& object, const char* name) {
  return apso::Pose(matrix_of<apso::Pose::MatrixType>(object, name, 4));
}
/// A pose that must be a rigid motion.
inline apso::Pose rigid_pose_of(const py::object& object, const char* name) {
  const apso::Pose T = pose_of(object, name);
  if (!apso::is_rigid(T))
    throw py::value_error(std::string(name) + " is no rigid motion: expected [[R, t], [0, 0, 0, 1]] with R orthonormal, t in metres");
  return T;
}

}  // namespace apso_python
