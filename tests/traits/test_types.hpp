// Types as a user might have them: every layout differs from apso's own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include <apso/traits/camera.hpp>
#include <apso/traits/detection.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/keypoint.hpp>
#include <apso/traits/pose.hpp>

namespace user {

struct ColumnMajorImage {  // no row pointer possible
  int rows = 0;
  int cols = 0;
  std::vector<std::uint16_t> values;
  std::uint16_t get(int row, int col) const {
    return values[static_cast<std::size_t>(col) * static_cast<std::size_t>(rows) + static_cast<std::size_t>(row)];
  }
};

struct PaddedImage {  // rows with padding
  int w = 0;
  int h = 0;
  int pitch = 0;
  std::vector<float> values;
  const float* line(int y) const { return values.data() + static_cast<std::ptrdiff_t>(pitch) * y; }
};

struct InversePose {  // stores the world in the camera, as trackers of the ORB family do
  Eigen::Quaternionf q_b_a = Eigen::Quaternionf::Identity();
  Eigen::Vector3f t_b_a = Eigen::Vector3f::Zero();
};

struct TransposedPose {  // traits with a mistake
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
};

struct Camera {
  double f = 500;
  double k = 0;  // radial distortion
};

struct Corner {
  float u, v, score;
};
struct Object {
  float left, top, right, bottom, confidence;
  int label;
  bool alive;
};
struct Nothing {};

}  // namespace user

template <>
struct apso::image_traits<user::ColumnMajorImage> {
  using value_type = std::uint16_t;
  static int width(const user::ColumnMajorImage& m) { return m.cols; }
  static int height(const user::ColumnMajorImage& m) { return m.rows; }
  static value_type at(const user::ColumnMajorImage& m, int x, int y) { return m.get(y, x); }
};
template <>
struct apso::image_traits<user::PaddedImage> {
  using value_type = float;
  static int width(const user::PaddedImage& m) { return m.w; }
  static int height(const user::PaddedImage& m) { return m.h; }
  static float at(const user::PaddedImage& m, int x, int y) { return m.line(y)[x]; }
  static const float* row(const user::PaddedImage& m, int y) { return m.line(y); }
};
template <>
struct apso::pose_traits<user::InversePose> {
  using scalar = float;
  static Eigen::Matrix3f rotation(const user::InversePose& T) { return T.q_b_a.conjugate().toRotationMatrix(); }
  static Eigen::Vector3f translation(const user::InversePose& T) { return -(T.q_b_a.conjugate() * T.t_b_a); }
  static user::InversePose make(const Eigen::Matrix3f& R, const Eigen::Vector3f& t) {
    user::InversePose T;
    T.q_b_a = Eigen::Quaternionf(R).conjugate();
    T.t_b_a = -(T.q_b_a * t);
    return T;
  }
};
template <>
struct apso::pose_traits<user::TransposedPose> {
  using scalar = double;
  static Eigen::Matrix3d rotation(const user::TransposedPose& T) { return T.R; }
  static Eigen::Vector3d translation(const user::TransposedPose& T) { return T.t; }
  static user::TransposedPose make(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) { return {R.transpose(), t}; }
};
template <>
struct apso::camera_traits<user::Camera> {
  static bool project(const user::Camera& c, const Eigen::Vector3d& X, Eigen::Vector2d& pixel) {
    if (!(X.z() > 0)) return false;
    pixel = Eigen::Vector2d(X.x() / X.z() * c.f + 320, X.y() / X.z() * c.f + 240);
    return true;
  }
  static Eigen::Vector3d unproject(const user::Camera& c, const Eigen::Vector2d& pixel) {
    const Eigen::Vector2d m((pixel.x() - 320) / c.f, (pixel.y() - 240) / c.f);
    const double s = 1 + c.k * m.squaredNorm();
    return {m.x() * s, m.y() * s, 1.0};
  }
};
template <>
struct apso::keypoint_traits<user::Corner> {
  static float x(const user::Corner& k) { return k.u; }
  static float y(const user::Corner& k) { return k.v; }
  static float response(const user::Corner& k) { return k.score; }
};
template <>
struct apso::detection_traits<user::Object> {
  static apso::Box box(const user::Object& o) { return {o.left, o.top, o.right - o.left, o.bottom - o.top}; }
  static float score(const user::Object& o) { return o.confidence; }
  static int class_id(const user::Object& o) { return o.label; }
  static bool movable(const user::Object& o) { return o.alive; }
};
