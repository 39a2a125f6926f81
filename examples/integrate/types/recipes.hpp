// Types as other people's systems have them, and what apso needs to know of each. docs/integrate/types.md quotes this file;
// tests/traits/test_foreign_types.cpp checks every one of them.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include <apso/traits/detection.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/keypoint.hpp>
#include <apso/traits/pose.hpp>

namespace host {

// [vector_image]
struct VectorImage {
  int cols = 0;
  int rows = 0;
  std::vector<std::uint16_t> pixels;  // row after row
};
// [/vector_image]

using NestedImage = std::vector<std::vector<float>>;  // a vector per row

// A row of pointers, as numerical libraries in C hand out.
struct PointerRows {
  const float* const* rows = nullptr;
  int width = 0;
  int height = 0;
};

// Three interleaved bytes per pixel; apso wants one grey value.
struct RgbImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;
};

// [quaternion_pose]
struct QuaternionPose {  // as the messages of many systems: position, then x y z w
  double px = 0, py = 0, pz = 0;
  double qx = 0, qy = 0, qz = 0, qw = 1;
};
// [/quaternion_pose]

// The shape of g2o::SE3Quat: rotation() is a quaternion, and the constructor takes it first.
class SE3Quat {
 public:
  SE3Quat() = default;
  SE3Quat(const Eigen::Quaterniond& q, const Eigen::Vector3d& t) : r_(q.normalized()), t_(t) {
    if (r_.w() < 0) r_.coeffs() *= -1;
  }
  const Eigen::Quaterniond& rotation() const { return r_; }
  const Eigen::Vector3d& translation() const { return t_; }
  Eigen::Vector3d map(const Eigen::Vector3d& x) const { return r_ * x + t_; }

 private:
  Eigen::Quaterniond r_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d t_ = Eigen::Vector3d::Zero();
};

// [camera_from_world]
struct TrackedPose {  // stores T_camera_world, as trackers of the ORB family do
  Eigen::Matrix3f Rcw = Eigen::Matrix3f::Identity();
  Eigen::Vector3f tcw = Eigen::Vector3f::Zero();
};
// [/camera_from_world]

using RowMajor16 = std::array<double, 16>;  // 4x4, row after row, as files and sockets have it

struct Corner {
  double u = 0;
  double v = 0;
  float strength = 0;
  float radians = 0;
};

// Centre and size as fractions of the image, as the YOLO family writes them.
struct RelativeBox {
  float cx = 0, cy = 0, w = 0, h = 0;
  float confidence = 0;
  int label = 0;
  int image_width = 0;
  int image_height = 0;
};

}  // namespace host

// [vector_image_traits]
template <>
struct apso::image_traits<host::VectorImage> {
  using value_type = std::uint16_t;
  static int width(const host::VectorImage& m) { return m.cols; }
  static int height(const host::VectorImage& m) { return m.rows; }
  static value_type at(const host::VectorImage& m, int x, int y) { return row(m, y)[x]; }
  static const value_type* row(const host::VectorImage& m, int y) { return m.pixels.data() + std::ptrdiff_t{y} * m.cols; }
};
// [/vector_image_traits]

template <>
struct apso::image_traits<host::NestedImage> {
  using value_type = float;
  static int width(const host::NestedImage& m) { return m.empty() ? 0 : static_cast<int>(m.front().size()); }
  static int height(const host::NestedImage& m) { return static_cast<int>(m.size()); }
  static float at(const host::NestedImage& m, int x, int y) { return row(m, y)[x]; }
  static const float* row(const host::NestedImage& m, int y) { return m[static_cast<std::size_t>(y)].data(); }
};

template <>
struct apso::image_traits<host::PointerRows> {
  using value_type = float;
  static int width(const host::PointerRows& m) { return m.width; }
  static int height(const host::PointerRows& m) { return m.height; }
  static float at(const host::PointerRows& m, int x, int y) { return m.rows[y][x]; }
  static const float* row(const host::PointerRows& m, int y) { return m.rows[y]; }
};

// [computed_pixels]
template <>
struct apso::image_traits<host::RgbImage> {  // no row: the grey value is computed while reading
  using value_type = float;
  static int width(const host::RgbImage& m) { return m.width; }
  static int height(const host::RgbImage& m) { return m.height; }
  static float at(const host::RgbImage& m, int x, int y) {
    const std::uint8_t* p = m.rgb.data() + 3 * (std::ptrdiff_t{y} * m.width + x);
    return (0.299F * p[0] + 0.587F * p[1] + 0.114F * p[2]) / 255.0F;  // ITU-R BT.601
  }
};
// [/computed_pixels]

// [quaternion_pose_traits]
template <>
struct apso::pose_traits<host::QuaternionPose> {
  using scalar = double;
  static Eigen::Matrix3d rotation(const host::QuaternionPose& T) {
    return Eigen::Quaterniond(T.qw, T.qx, T.qy, T.qz).normalized().toRotationMatrix();
  }
  static Eigen::Vector3d translation(const host::QuaternionPose& T) { return {T.px, T.py, T.pz}; }
  static host::QuaternionPose make(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
    const Eigen::Quaterniond q(R);
    return {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
  }
};
// [/quaternion_pose_traits]

template <>
struct apso::pose_traits<host::SE3Quat> {
  using scalar = double;
  static Eigen::Matrix3d rotation(const host::SE3Quat& T) { return T.rotation().toRotationMatrix(); }
  static Eigen::Vector3d translation(const host::SE3Quat& T) { return T.translation(); }
  static host::SE3Quat make(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) { return {Eigen::Quaterniond(R), t}; }
};

// [camera_from_world_traits]
template <>
struct apso::pose_traits<host::TrackedPose> {  // read as T_world_camera: the inverse of what is stored
  using scalar = float;
  static Eigen::Matrix3f rotation(const host::TrackedPose& T) { return T.Rcw.transpose(); }
  static Eigen::Vector3f translation(const host::TrackedPose& T) { return -(T.Rcw.transpose() * T.tcw); }
  static host::TrackedPose make(const Eigen::Matrix3f& R, const Eigen::Vector3f& t) { return {R.transpose(), -(R.transpose() * t)}; }
};
// [/camera_from_world_traits]

template <>
struct apso::pose_traits<host::RowMajor16> {
  using scalar = double;
  using matrix = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
  static Eigen::Matrix3d rotation(const host::RowMajor16& T) { return Eigen::Map<const matrix>(T.data()).topLeftCorner<3, 3>(); }
  static Eigen::Vector3d translation(const host::RowMajor16& T) { return Eigen::Map<const matrix>(T.data()).topRightCorner<3, 1>(); }
  static host::RowMajor16 make(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
    host::RowMajor16 T{};
    Eigen::Map<matrix> m(T.data());
    m.topLeftCorner<3, 3>() = R;
    m.topRightCorner<3, 1>() = t;
    m(3, 3) = 1;
    return T;
  }
};

// [corner_traits]
template <>
struct apso::keypoint_traits<host::Corner> {
  static float x(const host::Corner& k) { return static_cast<float>(k.u); }
  static float y(const host::Corner& k) { return static_cast<float>(k.v); }
  static float response(const host::Corner& k) { return k.strength; }
  static float angle(const host::Corner& k) {  // [deg] in [0, 360)
    const float degrees = std::fmod(k.radians * 57.29577951F, 360.0F);
    return degrees < 0 ? degrees + 360.0F : degrees;
  }
};
// [/corner_traits]

// [box_traits]
template <>
struct apso::detection_traits<host::RelativeBox> {
  static apso::Box box(const host::RelativeBox& d) {
    const auto w = static_cast<float>(d.image_width);
    const auto h = static_cast<float>(d.image_height);
    return {(d.cx - 0.5F * d.w) * w, (d.cy - 0.5F * d.h) * h, d.w * w, d.h * h};
  }
  static float score(const host::RelativeBox& d) { return d.confidence; }
  static int class_id(const host::RelativeBox& d) { return d.label; }
};
// [/box_traits]
