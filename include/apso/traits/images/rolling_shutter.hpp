/// \file
/// Images of a camera that reads its rows one after another, as if all had been read at one time.
///
/// While the camera moves, each row is seen from another place: at 100 degrees per second the last row of a Kinect is 27 pixels from where
/// it would be at the time of the first. The depth image is read in the same way, often some milliseconds before or after the colour
/// image. Both are brought to the time of the middle row of the colour image, by the velocity of the camera
/// (refinement/camera_velocity.hpp) and the depth of each pixel, as Ringaby & Forssen (ICCV 2011) move the points of a range sensor.
///
/// \code
/// apso::RollingShutter shutter(camera, 0.03);  // seconds from the first row to the last
/// shutter.follow(frame, velocity, depth_stamp - colour_stamp);
/// shutter.intensity(frame, intensity);
/// use(intensity, shutter.depth());
/// \endcode
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Keeps its buffers: after the first frame nothing is allocated.
class RollingShutter {
 public:
  /// Longest time from the first row to the last, and between colour and depth [s].
  static constexpr double kLongest = 0.2;
  /// Highest speed of a camera [m/s] and [rad/s].
  static constexpr double kFastest = 100;

  /// \param camera without distortion, or rectified: that a lens bends rows by some pixels is not seen
  /// \param readout time from the first row to the last [s], in [-kLongest, kLongest]; negative: the last row is read first, as in images
  ///        that were turned upside down
  RollingShutter(const Pinhole& camera, double readout) : camera_(camera), readout_(readout) {
    camera.validate();
    expects(std::abs(readout) <= kLongest, "RollingShutter: readout must be in [-0.2, 0.2] s");
    x_.resize(static_cast<std::size_t>(camera.width));
    for (int x = 0; x < camera.width; ++x) x_[static_cast<std::size_t>(x)] = static_cast<float>((x - camera.cx) / camera.fx);
    inverse_depth_.resize(x_.size());
    depth_x_.resize(x_.size());
    depth_y_.resize(x_.size());
  }

  [[nodiscard]] double readout() const { return readout_; }

  /// Finds where each pixel was seen.
  /// \param frame where its depth is not known, that of the pixel to the left counts; without one, only the rotation
  /// \param velocity of the camera (v, w) in its own frame at the time t of the middle row [m/s, rad/s]:
  ///        T_world_camera(t + s) = T_world_camera(t) Exp(s velocity);
  ///        each part at most kFastest long
  /// \param depth_delay time of the depth image less that of the colour image [s], in [-kLongest, kLongest]
  void follow(const AnyFrame& frame, const Twist& velocity, double depth_delay = 0) {
    check(frame);
    expects(translation_norm(velocity) <= kFastest && rotation_norm(velocity) <= kFastest,
            "RollingShutter: velocity must be at most 100 m/s and 100 rad/s");
    expects(std::abs(depth_delay) <= kLongest, "RollingShutter: depth_delay must be in [-0.2, 0.2] s");
    const int w = camera_.width;
    const int h = camera_.height;
    seen_.resize(w, h);
    moved_.resize(w, h);
    map_x_.resize(w, h);
    map_y_.resize(w, h);
    for (int y = 0; y < h; ++y) read_row(frame.depth(), y, seen_.row(y));
    for (int y = 0; y < h; ++y) follow_row(y, velocity, static_cast<float>(depth_delay));
  }

  /// Depth at the time of the middle row [m], of the nearest pixel; 0 where nothing was measured.
  [[nodiscard]] const Image<float>& depth() const { return moved_; }
  /// Where each pixel lies in the image that was read [px], inside of it: for cv::remap and the like.
  [[nodiscard]] const Image<float>& map_x() const { return map_x_; }
  [[nodiscard]] const Image<float>& map_y() const { return map_y_; }

  /// Intensity at that time in [0,1], interpolated bilinearly between pixels; not finite where one of them is not.
  /// \param frame that of follow()
  void intensity(const AnyFrame& frame, Image<float>& out) {
    expects(!map_x_.empty(), "RollingShutter: call follow() for the frame first");
    check(frame);
    const int w = camera_.width;
    const int h = camera_.height;
    read_.resize(w, h);
    for (int y = 0; y < h; ++y) read_row(frame.intensity(), y, read_.row(y));
    out.resize(w, h);
    for (int y = 0; y < h; ++y) {
      const float* u = map_x_.row(y);
      const float* v = map_y_.row(y);
      float* row = out.row(y);
      for (int x = 0; x < w; ++x) row[x] = interpolated(u[x], v[x]);
    }
  }

 private:
  static constexpr float kLeast = 0.5F;  // of 1 - what a row moves while the next is read: faster is not followed

  void check(const AnyFrame& f) const {
    const auto fits = [&](const AnyImage& image) { return image.width() == camera_.width && image.height() == camera_.height; };
    expects(fits(f.intensity()) && fits(f.depth()), "RollingShutter: the frame has another size than the camera");
    const Pinhole& c = f.camera;
    expects(c.width == 0 || (c.fx == camera_.fx && c.fy == camera_.fy && c.cx == camera_.cx && c.cy == camera_.cy),
            "RollingShutter: the frame was taken with another camera");
  }
  [[nodiscard]] static bool measured(float z) { return z > 1e-3F && z < 1e6F; }  // [m]; false for NaN
  void follow_row(int y, const Twist& velocity, float delay) {
    const int w = camera_.width;
    const int h = camera_.height;
    const auto fx = static_cast<float>(camera_.fx);
    const auto fy = static_cast<float>(camera_.fy);
    const auto vx = static_cast<float>(velocity(0)), vy = static_cast<float>(velocity(1)), vz = static_cast<float>(velocity(2));
    const auto wx = static_cast<float>(velocity(3)), wy = static_cast<float>(velocity(4)), wz = static_cast<float>(velocity(5));
    const auto Y = static_cast<float>((y - camera_.cy) / camera_.fy);
    const auto row_time = static_cast<float>(readout_ / h);             // from one row to the next
    const auto first = static_cast<float>(readout_ * (0.5 / h - 0.5));  // time of row 0
    const auto yf = static_cast<float>(y);
    const float* seen = seen_.row(y);
    float known = 0;
    for (int x = 0; x < w; ++x) {
      if (measured(seen[x])) known = 1 / seen[x];
      inverse_depth_[static_cast<std::size_t>(x)] = known;
    }
    float* map_x = map_x_.row(y);
    float* map_y = map_y_.row(y);
    float* depth_x = depth_x_.data();
    float* depth_y = depth_y_.data();
    const float* ray = x_.data();
    const float* inverse_depth = inverse_depth_.data();
    const float right = static_cast<float>(w - 1);
    const float bottom = static_cast<float>(h - 1);
    for (int x = 0; x < w; ++x) {
      const float X = ray[x];
      const float k = inverse_depth[x];
      // velocity of a point that stands still, seen from the camera, by its depth
      const float qx = -(vx * k + wy - wz * Y);
      const float qy = -(vy * k + wz * X - wx);
      const float qz = -(vz * k + wx * Y - wy * X);
      const float flow_x = fx * (qx - X * qz);  // [px/s]
      const float flow_y = fy * (qy - Y * qz);
      // it was seen in row r = y + flow_y s(r) at time s(r) = first + row_time r, in the depth image `delay` later
      const float slower = 1 / std::max(1 - flow_y * row_time, kLeast);
      const float r = (yf + flow_y * first) * slower;
      map_y[x] = std::min(std::max(r, 0.0F), bottom);
      map_x[x] = std::min(std::max(static_cast<float>(x) + flow_x * (first + row_time * r), 0.0F), right);
      depth_y[x] = (yf + flow_y * (first + delay)) * slower;
      depth_x[x] = static_cast<float>(x) + flow_x * (delay + first + row_time * depth_y[x]);
    }
    float* moved = moved_.row(y);
    for (int x = 0; x < w; ++x) {
      const float u = depth_x[x] + 0.5F;
      const float v = depth_y[x] + 0.5F;
      moved[x] = 0;
      if (!(u > 0 && v > 0 && u < static_cast<float>(w) && v < static_cast<float>(h))) continue;
      const float z = seen_(static_cast<int>(u), static_cast<int>(v));
      if (!measured(z)) continue;
      const float z_now = z + (delay + first + row_time * depth_y[x]) * (vz + z * (wx * Y - wy * ray[x]));
      if (z_now > 0) moved[x] = z_now;
    }
  }
  [[nodiscard]] float interpolated(float u, float v) const {
    const int x0 = static_cast<int>(u);
    const int y0 = static_cast<int>(v);
    const int x1 = std::min(x0 + 1, read_.width() - 1);
    const int y1 = std::min(y0 + 1, read_.height() - 1);
    const float a = u - static_cast<float>(x0);
    const float b = v - static_cast<float>(y0);
    return (1 - b) * ((1 - a) * read_(x0, y0) + a * read_(x1, y0)) + b * ((1 - a) * read_(x0, y1) + a * read_(x1, y1));
  }

  Pinhole camera_;
  double readout_;
  std::vector<float> x_;                  // of the ray (x, y, 1) of each column
  std::vector<float> inverse_depth_;      // of one row [1/m]
  std::vector<float> depth_x_, depth_y_;  // where the pixels of one row lie in the depth image [px]
  Image<float> seen_, moved_;             // depth [m]
  Image<float> map_x_, map_y_;            // [px]
  Image<float> read_;                     // intensity as it was read
};

APSO_NAMESPACE_END
