/// \file
/// Any image, frame, pose or list as a parameter of a function that is no template: what your types are is forgotten at the
/// door, so that the code behind it is compiled once and can be virtual. Nothing is copied; an image is read row by row
/// through one indirect call per row.
///
/// \code
/// void observe(const AnyFrame& frame, const AnyPose& T_world_camera, const AnyTracks& tracks) {
///   auto depth = rows(frame.depth(), buffer_);              // see rows.hpp
///   for (const PointTrack& t : tracks.in(tracks_)) ...
/// }
/// observe(apso::frame(t, my_grey, my_depth, my_camera), my_pose, my_tracks);
/// \endcode
///
/// These types refer to what the caller passed. They are made for parameters and must not be kept after the call.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <type_traits>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/pose.hpp>
#include <apso/traits/ranges.hpp>
#include <apso/traits/rows.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
/// How the pixels of one image type are reached.
struct ImageAccess {
  const float* (*row_in_place)(const void* image, int y);
  void (*read_row)(const void* image, int y, float* out, float unit);
  float (*pixel)(const void* image, int x, int y);
};
template <class ImageT>
struct AccessTo {
  static const float* in_place(const void* image, int y) { return row_in_place(*static_cast<const ImageT*>(image), y); }
  static void read(const void* image, int y, float* out, float unit) {
    read_row(*static_cast<const ImageT*>(image), y, out, unit);
  }
  static float at(const void* image, int x, int y) { return pixel(*static_cast<const ImageT*>(image), x, y); }
  static constexpr ImageAccess value{&in_place, &read, &at};
};
}  // namespace detail

/// Any image, as float. An image itself: rows(), scaled() and pixel() take it.
class AnyImage {
 public:
  AnyImage() = default;             ///< no image
  AnyImage(None) {}                 // NOLINT: `none` says that there is no image
  template <class ImageT>
  AnyImage(const ImageT& image)     // NOLINT: made to be a parameter
      : image_((check_image<ImageT>(), &image)),
        access_(&detail::AccessTo<ImageT>::value),
        width_(image_traits<ImageT>::width(image)),
        height_(image_traits<ImageT>::height(image)) {}
  [[nodiscard]] bool empty() const { return width_ <= 0 || height_ <= 0; }
  [[nodiscard]] int width() const { return width_; }    ///< [px]
  [[nodiscard]] int height() const { return height_; }  ///< [px]
  /// Row y where it lies in memory as contiguous floats; null where it has to be converted.
  [[nodiscard]] const float* row_in_place(int y) const { return access_->row_in_place(image_, y); }
  /// Row y times `unit`, into `out`.
  void read_row(int y, float* out, float unit) const { access_->read_row(image_, y, out, unit); }
  [[nodiscard]] float at(int x, int y) const { return access_->pixel(image_, x, y); }

 private:
  const void* image_ = nullptr;
  const detail::ImageAccess* access_ = nullptr;
  int width_ = 0;
  int height_ = 0;
};
namespace detail {
template <>
struct is_view<AnyImage> : std::true_type {};
}  // namespace detail

template <>
struct image_traits<AnyImage> {
  using value_type = float;
  static int width(const AnyImage& image) { return image.width(); }
  static int height(const AnyImage& image) { return image.height(); }
  static float at(const AnyImage& image, int x, int y) { return image.at(x, y); }
};
[[nodiscard]] inline const float* row_in_place(const AnyImage& image, int y) { return image.row_in_place(y); }
inline void read_row(const AnyImage& image, int y, float* out, float unit = 1) { image.read_row(y, out, unit); }

/// Any frame: an RgbdFrame, or a frame of your images made by frame().
class AnyFrame {
 public:
  AnyFrame(const RgbdFrame& frame)  // NOLINT: made to be a parameter
      : timestamp(frame.timestamp), colour(frame.colour), intensity_(frame.intensity), depth_(frame.depth) {}
  template <class HeldIntensity, class HeldDepth>
  AnyFrame(const Frame<HeldIntensity, HeldDepth>& frame)  // NOLINT: made to be a parameter
      : timestamp(frame.timestamp), colour(frame.colour), intensity_(frame.intensity()), depth_(frame.depth()) {}
  template <class T>
  AnyFrame(const T&) {  // NOLINT: says what is wrong
    static_assert(!std::is_same_v<T, T>,
                  "apso: a frame is an apso::RgbdFrame or apso::frame(timestamp, intensity, depth, camera) of your images");
  }

  double timestamp = 0;             ///< [s]
  ImageView<const Bgr8> colour{};   ///< empty where there is none

  [[nodiscard]] const AnyImage& intensity() const { return intensity_; }  ///< in [0,1]
  [[nodiscard]] const AnyImage& depth() const { return depth_; }          ///< [m]; see depth_valid

 private:
  AnyImage intensity_;
  AnyImage depth_;
};

/// Any pose.
class AnyPose {
 public:
  AnyPose(const Pose& T_a_b) : T_(T_a_b) {}                  // NOLINT: made to be a parameter
  template <class PoseT>
  AnyPose(const PoseT& T_a_b) : T_(to_pose(T_a_b)) {}        // NOLINT: made to be a parameter
  operator const Pose&() const { return T_; }                // NOLINT: is one

 private:
  Pose T_;
};

/// Any list of elements that have traits. Made from a range, from a list in braces, or from `none`.
/// \tparam Value PointTrack, Detection or Keypoint
template <class Value>
class AnyList {
 public:
  AnyList() = default;
  AnyList(None) {}                                           // NOLINT: `none` says that there is no list
  AnyList(const std::vector<Value>& list) : list_(&list) {}  // NOLINT: made to be a parameter
  AnyList(std::initializer_list<Value> list) : range_(list.begin()), size_(list.size()), copy_(&copy_array) {}
  template <class Range>
  AnyList(const Range& range) : range_(&range), copy_(&copy_range<Range>) {}  // NOLINT: made to be a parameter

  /// False for `none`: "not looked for", which is not the same as an empty list.
  [[nodiscard]] bool given() const { return list_ != nullptr || copy_ != nullptr; }
  /// The elements: the caller's own vector if it is one of Value, else a copy in `buffer`.
  [[nodiscard]] const std::vector<Value>& in(std::vector<Value>& buffer) const {
    if (list_ != nullptr) return *list_;
    buffer.clear();
    if (copy_ != nullptr) copy_(range_, size_, buffer);
    return buffer;
  }

 private:
  static void copy_array(const void* first, std::size_t size, std::vector<Value>& out) {
    out.assign(static_cast<const Value*>(first), static_cast<const Value*>(first) + size);
  }
  template <class Range>
  static void copy_range(const void* range, std::size_t, std::vector<Value>& out) {
    const auto add = [&out](const Value& v) { out.push_back(v); };
    const Range& r = *static_cast<const Range*>(range);
    if constexpr (std::is_same_v<Value, PointTrack>) for_each_track(r, add);
    if constexpr (std::is_same_v<Value, Detection>) for_each_detection(r, add);
    if constexpr (std::is_same_v<Value, Keypoint>) for_each_keypoint(r, add);
  }
  const std::vector<Value>* list_ = nullptr;
  const void* range_ = nullptr;
  std::size_t size_ = 0;
  void (*copy_)(const void*, std::size_t, std::vector<Value>&) = nullptr;
};
using AnyTracks = AnyList<PointTrack>;
using AnyDetections = AnyList<Detection>;
using AnyKeypoints = AnyList<Keypoint>;

APSO_NAMESPACE_END
