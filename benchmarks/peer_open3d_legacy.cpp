// Open3D's hybrid RGB-D odometry of before its tensors, as it is shipped. It hands matrices of Eigen to and fro, whose
// alignment depends on the flags: this file is compiled with those of the library, into a library of its own that shows nothing
// of Eigen, and is spoken to in plain numbers.
#include <cstring>

#include <open3d/pipelines/odometry/Odometry.h>

#include <open3d/camera/PinholeCameraIntrinsic.h>
#include <open3d/geometry/Image.h>
#include <open3d/geometry/RGBDImage.h>

#include "peer_open3d_legacy.hpp"

struct Open3dLegacy {
  open3d::camera::PinholeCameraIntrinsic camera;
  open3d::geometry::RGBDImage source, target;
};

extern "C" {
Open3dLegacy* open3d_legacy_create() { return new Open3dLegacy; }
void open3d_legacy_destroy(Open3dLegacy* o) { delete o; }
void open3d_legacy_camera(Open3dLegacy* o, int width, int height, double fx, double fy, double cx, double cy) {
  o->camera.SetIntrinsics(width, height, fx, fy, cx, cy);
}
void open3d_legacy_frame(Open3dLegacy* o, int is_target, const float* intensity, const float* depth, int width, int height) {
  open3d::geometry::RGBDImage& frame = is_target != 0 ? o->target : o->source;
  const auto take = [&](const float* from, open3d::geometry::Image& to) {
    to.Prepare(width, height, 1, sizeof(float));
    std::memcpy(to.data_.data(), from, to.data_.size());
  };
  take(intensity, frame.color_);
  take(depth, frame.depth_);
}
int open3d_legacy_solve(Open3dLegacy* o, const double* guess, double* found) {
  using Matrix = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
  const Eigen::Matrix4d start = Eigen::Map<const Matrix>(guess);
  const auto [good, T, information] = open3d::pipelines::odometry::ComputeRGBDOdometry(o->source, o->target, o->camera, start);
  Eigen::Map<Matrix>{found} = T;
  return good ? 1 : 0;
}
}
