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
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/lanes/lane_functions.hpp>
#include <apso/math/lanes/lane_memory.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>
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
    x_.resize(static_cast<std::size_t>(camera.width + kWideLanes));
    for (int x = 0; x < camera.width; ++x) x_[static_cast<std::size_t>(x)] = static_cast<float>((x - camera.cx) / camera.fx);
    inverse_depth_.resize(x_.size());
    seen_.resize(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height) + kWideLanes);
    for (int i = 0; i < kWideLanes; ++i) count_[static_cast<std::size_t>(i)] = static_cast<float>(i);
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
    moved_.resize(w, h);
    map_x_.resize(w, h);
    map_y_.resize(w, h);
    for (int y = 0; y < h; ++y) read_row(frame.depth(), y, seen_row(y));
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
  /// [m]; false for NaN.
  template <int lanes>
  [[nodiscard]] static APSO_INLINE BasicIntLanes<lanes> measured(const BasicLanes<lanes>& z) {
    return (z > BasicLanes<lanes>(1e-3F)) & (z < BasicLanes<lanes>(1e6F));
  }
  /// The inverse depth of each pixel of a row, or that of the nearest to the left that has one.
  void find_inverse_depth(int y) {
    const int w = camera_.width;
    const float* seen = seen_row(y);
    for (int x = 0; x < w; x += kLanes) {
      const Lanes z = Lanes::load(seen + x);
      const Mask known = measured(z);
      select(known, 1.0F / select(known, z, 1.0F), 0.0F).store(inverse_depth_.data() + x);
    }
    float last = 0;
    for (int x = 0; x < w; ++x) {
      float& k = inverse_depth_[static_cast<std::size_t>(x)];
      last = k > 0 ? k : last;
      k = last;
    }
  }
  void follow_row(int y, const Twist& velocity, float delay) {
    find_inverse_depth(y);
    in_widest_lanes([this, y, velocity, delay](auto lanes) {
      using std::max;
      using std::min;
      using L = BasicLanes<lanes>;
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
      const auto width = static_cast<float>(w);
      const auto height = static_cast<float>(h);
      float* map_x = map_x_.row(y);
      float* map_y = map_y_.row(y);
      float* moved = moved_.row(y);
      for (int x = 0; x < w; x += lanes) {
        const auto offset = static_cast<std::size_t>(x);
        const L column = L(static_cast<float>(x)) + L::load(count_.data());
        const L X = L::load(x_.data() + offset);
        const L k = L::load(inverse_depth_.data() + offset);
        // velocity of a point that stands still, seen from the camera, by its depth
        const L qx = -(vx * k + wy - wz * Y);
        const L qy = -(vy * k + wz * X - wx);
        const L qz = -(vz * k + wx * Y - wy * X);
        const L flow_x = fx * (qx - X * qz);  // [px/s]
        const L flow_y = fy * (qy - Y * qz);
        // it was seen in row r = y + flow_y s(r) at time s(r) = first + row_time r, in the depth image `delay` later
        const L slower = 1.0F / max(1.0F - flow_y * row_time, L(kLeast));
        const L r = (yf + flow_y * first) * slower;
        const int n = min<int>(lanes, w - x);
        store(min(max(r, L(0.0F)), L(height - 1)), n, map_y + x);
        store(min(max(column + flow_x * (first + row_time * r), L(0.0F)), L(width - 1)), n, map_x + x);

        const L depth_y = (yf + flow_y * (first + delay)) * slower;
        const L time = delay + first + row_time * depth_y;
        const L u = column + flow_x * time + 0.5F;
        const L v = depth_y + 0.5F;
        const auto inside = (u > L(0.0F)) & (v > L(0.0F)) & (u < L(width)) & (v < L(height));
        const L z = nearest(select(inside, u, 0.0F), select(inside, v, 0.0F));
        const L z_now = z + time * (vz + z * (wx * Y - wy * X));
        store(select(inside & measured(z) & (z_now > L(0.0F)), z_now, 0.0F), n, moved + x);
      }
    });
  }
  /// The first n lanes.
  template <int lanes>
  static APSO_INLINE void store(const BasicLanes<lanes>& v, int n, float* to) {
    if (n == lanes) {
      v.store(to);
    } else {
      std::memcpy(to, &v.v, sizeof(float) * static_cast<std::size_t>(n));
    }
  }
  /// Depth of the pixels (u, v), inside of the image, rounded down.
  template <int lanes>
  [[nodiscard]] APSO_INLINE BasicLanes<lanes> nearest(const BasicLanes<lanes>& u, const BasicLanes<lanes>& v) const {
    return gather(seen_.data(), to_int(v) * all_lanes<lanes>(camera_.width) + to_int(u));
  }
  [[nodiscard]] float* seen_row(int y) { return seen_.data() + static_cast<std::ptrdiff_t>(camera_.width) * y; }
  [[nodiscard]] const float* seen_row(int y) const { return seen_.data() + static_cast<std::ptrdiff_t>(camera_.width) * y; }
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
  std::array<float, kWideLanes> count_;  // 0, 1, 2 ...
  std::vector<float> x_;                 // of the ray (x, y, 1) of each column; as the next two with room for lanes beyond the end
  std::vector<float> inverse_depth_;     // of one row [1/m]
  std::vector<float> seen_;              // depth as it was read [m]
  Image<float> moved_;                   // depth [m]
  Image<float> map_x_, map_y_;           // [px]
  Image<float> read_;                    // intensity as it was read
};

APSO_NAMESPACE_END
