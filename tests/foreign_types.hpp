// Types that no code of apso has seen, each with the traits a user would write, and converters from apso's own images,
// poses and lists. A test runs an algorithm on both and compares: a door that takes these takes anything.
//
// | type             | what is unusual about it                                                              |
// |------------------|---------------------------------------------------------------------------------------|
// | PaddedU16        | 16-bit pixels, padding after each row; unit is the user's: scaled(image, 1 / 5000.F)  |
// | FloatMillimetres | float, row pointer, millimetres: scaled(image, 0.001F); invalid = -1                  |
// | XyzCloud         | organised points [m], depth is their z, NaN where nothing was measured; no row pointer |
// | AtOnly           | 8-bit grey behind a function, column-major; no row pointer                            |
// | DualQuaternionPose | pose as two quaternions                                                              |
// | RowMajor3x4Pose  | pose as twelve floats, row by row                                                    |
// | Corner, Feature, Box2d | keypoint, track, detection with other names, units and types of members         |
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <list>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/traits/detection.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/keypoint.hpp>
#include <apso/traits/pose.hpp>
#include <apso/traits/track.hpp>
#include <apso/types/image_view.hpp>

namespace foreign {

struct PaddedU16 {
  int columns = 0;
  int lines = 0;
  std::size_t stride = 0;  // pixels from one row to the next
  std::vector<std::uint16_t> buffer;
  const std::uint16_t* line(int y) const { return buffer.data() + stride * static_cast<std::size_t>(y); }
};

struct FloatMillimetres {
  static constexpr float kInvalid = -1;
  int w = 0;
  int h = 0;
  std::vector<float> mm;
};

struct XyzCloud {
  int w = 0;
  int h = 0;
  std::vector<Eigen::Vector3f> points;
};

class AtOnly {
 public:
  AtOnly(int rows, int columns)
      : rows_(rows), columns_(columns), cells_(static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns)) {}
  int rows() const { return rows_; }
  int columns() const { return columns_; }
  std::uint8_t get(int row, int column) const { return cells_[index(row, column)]; }
  void set(int row, int column, std::uint8_t value) { cells_[index(row, column)] = value; }

 private:
  std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(column) * static_cast<std::size_t>(rows_) + static_cast<std::size_t>(row);
  }
  int rows_;
  int columns_;
  std::vector<std::uint8_t> cells_;
};

struct DualQuaternionPose {
  Eigen::Quaternion<double, Eigen::DontAlign> real = Eigen::Quaterniond::Identity();
  Eigen::Quaternion<double, Eigen::DontAlign> dual{0, 0, 0, 0};  // 0.5 t real
};

struct RowMajor3x4Pose {
  std::array<float, 12> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
};

struct Corner {
  std::array<double, 2> uv{};
  double strength = 0;
};

struct Feature {
  std::uint32_t number = 0;
  Eigen::Vector2f now = Eigen::Vector2f::Zero();
  Eigen::Vector2f motion = Eigen::Vector2f::Zero();  // now - before [px]
  unsigned seen = 1;                                 // in how many images, 1 = only in this one
};

struct Box2d {
  int left = 0, top = 0, right = 0, bottom = 0;  // [px], right and bottom are outside
  int percent = 0;                               // confidence
  std::uint8_t label = 0;
  std::vector<std::uint8_t> silhouette;  // of the whole image, empty = none
  int image_width = 0, image_height = 0;
};

}  // namespace foreign

template <>
struct apso::image_traits<foreign::PaddedU16> {
  using value_type = std::uint16_t;
  static int width(const foreign::PaddedU16& m) { return m.columns; }
  static int height(const foreign::PaddedU16& m) { return m.lines; }
  static value_type at(const foreign::PaddedU16& m, int x, int y) { return m.line(y)[x]; }
  static const value_type* row(const foreign::PaddedU16& m, int y) { return m.line(y); }
};
template <>
struct apso::image_traits<foreign::FloatMillimetres> {
  using value_type = float;
  using M = foreign::FloatMillimetres;
  static int width(const M& m) { return m.w; }
  static int height(const M& m) { return m.h; }
  static float at(const M& m, int x, int y) { return row(m, y)[x]; }
  static const float* row(const M& m, int y) { return m.mm.data() + static_cast<std::ptrdiff_t>(m.w) * y; }
};
template <>
struct apso::image_traits<foreign::XyzCloud> {
  using value_type = float;
  static int width(const foreign::XyzCloud& m) { return m.w; }
  static int height(const foreign::XyzCloud& m) { return m.h; }
  static float at(const foreign::XyzCloud& m, int x, int y) {
    return m.points[static_cast<std::size_t>(y) * static_cast<std::size_t>(m.w) + static_cast<std::size_t>(x)].z();
  }
};
template <>
struct apso::image_traits<foreign::AtOnly> {
  using value_type = std::uint8_t;
  static int width(const foreign::AtOnly& m) { return m.columns(); }
  static int height(const foreign::AtOnly& m) { return m.rows(); }
  static value_type at(const foreign::AtOnly& m, int x, int y) { return m.get(y, x); }
};
template <>
struct apso::pose_traits<foreign::DualQuaternionPose> {
  using scalar = double;
  static Eigen::Matrix3d rotation(const foreign::DualQuaternionPose& T) { return T.real.toRotationMatrix(); }
  static Eigen::Vector3d translation(const foreign::DualQuaternionPose& T) { return 2.0 * (T.dual * T.real.conjugate()).vec(); }
  static foreign::DualQuaternionPose make(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
    foreign::DualQuaternionPose T;
    T.real = Eigen::Quaterniond(R);
    T.dual = Eigen::Quaterniond(0, 0.5 * t.x(), 0.5 * t.y(), 0.5 * t.z()) * T.real;
    return T;
  }
};
template <>
struct apso::pose_traits<foreign::RowMajor3x4Pose> {
  using scalar = float;
  using RowMajor = Eigen::Matrix<float, 3, 4, Eigen::RowMajor>;
  static Eigen::Matrix3f rotation(const foreign::RowMajor3x4Pose& T) { return Eigen::Map<const RowMajor>(T.m.data()).leftCols<3>(); }
  static Eigen::Vector3f translation(const foreign::RowMajor3x4Pose& T) { return Eigen::Map<const RowMajor>(T.m.data()).col(3); }
  static foreign::RowMajor3x4Pose make(const Eigen::Matrix3f& R, const Eigen::Vector3f& t) {
    foreign::RowMajor3x4Pose T;
    Eigen::Map<RowMajor> m(T.m.data());
    m.leftCols<3>() = R;
    m.col(3) = t;
    return T;
  }
};
template <>
struct apso::keypoint_traits<foreign::Corner> {
  static float x(const foreign::Corner& k) { return static_cast<float>(k.uv[0]); }
  static float y(const foreign::Corner& k) { return static_cast<float>(k.uv[1]); }
  static float response(const foreign::Corner& k) { return static_cast<float>(k.strength); }
};
template <>
struct apso::track_traits<foreign::Feature> {
  static std::int64_t id(const foreign::Feature& t) { return t.number; }
  static float x(const foreign::Feature& t) { return t.now.x(); }
  static float y(const foreign::Feature& t) { return t.now.y(); }
  static float previous_x(const foreign::Feature& t) { return t.now.x() - t.motion.x(); }
  static float previous_y(const foreign::Feature& t) { return t.now.y() - t.motion.y(); }
  static int age(const foreign::Feature& t) { return static_cast<int>(t.seen) - 1; }
};
template <>
struct apso::detection_traits<foreign::Box2d> {
  static apso::Box box(const foreign::Box2d& o) {
    return {static_cast<float>(o.left), static_cast<float>(o.top), static_cast<float>(o.right - o.left),
            static_cast<float>(o.bottom - o.top)};
  }
  static float score(const foreign::Box2d& o) { return static_cast<float>(o.percent) / 100; }
  static int class_id(const foreign::Box2d& o) { return o.label; }
  static apso::ImageView<const std::uint8_t> mask(const foreign::Box2d& o) {
    if (o.silhouette.empty()) return {};
    return {o.silhouette.data(), o.image_width, o.image_height};
  }
};

namespace foreign {

// `value = round(image / unit)`, 0 where the image is invalid (0, negative, NaN). Unit 1 / 5000.F for depth in metres,
// 1.F / 65535 for intensity in [0,1]. The padding holds a value that no image should show.
inline PaddedU16 padded_u16(const apso::Image<float>& image, float unit) {
  PaddedU16 m;
  m.columns = image.width();
  m.lines = image.height();
  m.stride = static_cast<std::size_t>(m.columns) + 13;
  m.buffer.assign(m.stride * static_cast<std::size_t>(m.lines), 0xBEEF);
  for (int y = 0; y < m.lines; ++y) {
    for (int x = 0; x < m.columns; ++x) {
      const float v = std::round(image(x, y) / unit);
      const float kept = v > 0 ? (v < 65535.0F ? v : 65535.0F) : 0.0F;
      m.buffer[m.stride * static_cast<std::size_t>(y) + static_cast<std::size_t>(x)] = static_cast<std::uint16_t>(kept);
    }
  }
  return m;
}

// What a native user would hold of the same image: unit * value, so that results can be compared to the last digit.
inline apso::Image<float> native(const PaddedU16& m, float unit) {
  apso::Image<float> image(m.columns, m.lines);
  for (int y = 0; y < m.lines; ++y) {
    for (int x = 0; x < m.columns; ++x) image(x, y) = unit * static_cast<float>(m.line(y)[x]);
  }
  return image;
}

// Depth [m] to millimetres, -1 where it is invalid.
inline FloatMillimetres float_millimetres(const apso::Image<float>& depth) {
  FloatMillimetres m;
  m.w = depth.width();
  m.h = depth.height();
  for (int y = 0; y < m.h; ++y) {
    for (int x = 0; x < m.w; ++x) {
      const float z = depth(x, y);
      m.mm.push_back(z > 0 && std::isfinite(z) ? 1000 * z : FloatMillimetres::kInvalid);
    }
  }
  return m;
}
// Metres of the same image, as scaled(image, 0.001F) reads them.
inline apso::Image<float> native(const FloatMillimetres& m) {
  apso::Image<float> depth(m.w, m.h);
  for (int y = 0; y < m.h; ++y) {
    for (int x = 0; x < m.w; ++x) depth(x, y) = 0.001F * apso::image_traits<FloatMillimetres>::at(m, x, y);
  }
  return depth;
}

// Depth [m] to points of a camera with the given focal length and centre; NaN where it is invalid.
inline XyzCloud xyz_cloud(const apso::Image<float>& depth, float f, float cx, float cy) {
  XyzCloud m;
  m.w = depth.width();
  m.h = depth.height();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (int y = 0; y < m.h; ++y) {
    for (int x = 0; x < m.w; ++x) {
      const float z = depth(x, y);
      if (z > 0 && std::isfinite(z)) {
        m.points.emplace_back((static_cast<float>(x) - cx) / f * z, (static_cast<float>(y) - cy) / f * z, z);
      } else {
        m.points.emplace_back(nan, nan, nan);
      }
    }
  }
  return m;
}

// Intensity in [0,1] to 8 bit.
inline AtOnly at_only(const apso::Image<float>& intensity) {
  AtOnly m(intensity.height(), intensity.width());
  for (int y = 0; y < m.rows(); ++y) {
    for (int x = 0; x < m.columns(); ++x) {
      const float v = std::round(255 * intensity(x, y));
      m.set(y, x, static_cast<std::uint8_t>(v > 0 ? (v < 255.0F ? v : 255.0F) : 0.0F));
    }
  }
  return m;
}
// Intensity in [0,1] of the same image, as the library reads 8 bit.
inline apso::Image<float> native(const AtOnly& m) {
  apso::Image<float> intensity(m.columns(), m.rows());
  for (int y = 0; y < m.rows(); ++y) {
    for (int x = 0; x < m.columns(); ++x) intensity(x, y) = (1.0F / 255) * static_cast<float>(m.get(y, x));
  }
  return intensity;
}

inline std::vector<Corner> corners(const std::vector<apso::Keypoint>& keypoints) {
  std::vector<Corner> list;
  for (const apso::Keypoint& k : keypoints) list.push_back({{k.x, k.y}, k.response});
  return list;
}
// A list without random access, as some trackers keep it.
inline std::list<Feature> features(const std::vector<apso::PointTrack>& tracks) {
  std::list<Feature> list;
  for (const apso::PointTrack& t : tracks) {
    list.push_back(
        {static_cast<std::uint32_t>(t.id), {t.x, t.y}, {t.x - t.previous_x, t.y - t.previous_y}, static_cast<unsigned>(t.age + 1)});
  }
  return list;
}
// Boxes are rounded to whole pixels and confidences to percent: build the native list from the result with to_detection.
inline std::vector<Box2d> boxes(const std::vector<apso::Detection>& detections) {
  std::vector<Box2d> list;
  for (const apso::Detection& d : detections) {
    Box2d box;
    box.left = static_cast<int>(std::lround(d.box.x));
    box.top = static_cast<int>(std::lround(d.box.y));
    box.right = static_cast<int>(std::lround(d.box.x + d.box.width));
    box.bottom = static_cast<int>(std::lround(d.box.y + d.box.height));
    box.percent = static_cast<int>(std::lround(100 * d.score));
    box.label = static_cast<std::uint8_t>(d.class_id);
    for (int y = 0; y < d.mask.height && !d.mask.empty(); ++y) {
      box.silhouette.insert(box.silhouette.end(), d.mask.row(y), d.mask.row(y) + d.mask.width);
    }
    box.image_width = d.mask.width;
    box.image_height = d.mask.height;
    list.push_back(box);
  }
  return list;
}

}  // namespace foreign
