/// \file
/// Any image, frame, pose or list as a parameter of a function that is no template: what your types are is forgotten at the
/// door, so that the code behind it is compiled once and can be virtual. No image is copied; it is read row by row through
/// one indirect call per row. A list of your elements is converted into a buffer of the function.
///
/// \code
/// void observe(const AnyFrame& frame, const AnyPose& T_world_camera, const AnyTracks& tracks) {
///   auto depth = rows(frame.depth(), buffer_);              // see rows.hpp
///   for (const PointTrack& t : tracks.in(tracks_)) ...
/// }
/// observe(apso::frame(t, my_grey, my_depth, my_camera), my_pose, my_tracks);
/// \endcode
///
/// These types refer to what the caller passed: they are made for parameters and must not be kept after the call. Of views
/// they refer to the pixels.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <type_traits>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/images/rows.hpp>
#include <apso/traits/pose.hpp>
#include <apso/traits/ranges.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
/// An image whose type is forgotten: the address of the image, or of the pixels of a view, which is then made anew to be
/// read, so that it need not outlive the call that it was passed to.
struct ImageAddress {
  const void* address = nullptr;
  int width = 0;
  int height = 0;
  std::ptrdiff_t stride = 0;  // of a view [px]
};
template <class ImageT>
struct ImageAt {
  static ImageAddress address(const ImageT& image) {
    return {&image, image_traits<ImageT>::width(image), image_traits<ImageT>::height(image), 0};
  }
  static const ImageT& image(const ImageAddress& a) { return *static_cast<const ImageT*>(a.address); }
};
template <class T>
struct ImageAt<ImageView<T>> {
  static ImageAddress address(const ImageView<T>& view) { return {view.data, view.width, view.height, view.stride}; }
  static ImageView<const T> image(const ImageAddress& a) { return {static_cast<const T*>(a.address), a.width, a.height, a.stride}; }
};
/// How the pixels of one image type are reached.
struct ImageAccess {
  const float* (*row_in_place)(const ImageAddress& image, int y);
  void (*read_row)(const ImageAddress& image, int y, float* out, float unit);
  float (*pixel)(const ImageAddress& image, int x, int y);
};
template <class ImageT>
struct AccessTo {
  static const float* in_place(const ImageAddress& a, int y) { return row_in_place(ImageAt<ImageT>::image(a), y); }
  static void read(const ImageAddress& a, int y, float* out, float unit) { read_row(ImageAt<ImageT>::image(a), y, out, unit); }
  static float at(const ImageAddress& a, int x, int y) { return pixel(ImageAt<ImageT>::image(a), x, y); }
  static constexpr ImageAccess value{&in_place, &read, &at};
};
}  // namespace detail

/// Any image, as float. An image itself: rows(), scaled() and pixel() take it.
class AnyImage {
 public:
  AnyImage() = default;  ///< no image
  AnyImage(None) {}      // NOLINT: `none` says that there is no image
  template <class ImageT>
  AnyImage(const ImageT& image)  // NOLINT: made to be a parameter
      : image_((check_image<ImageT>(), detail::ImageAt<ImageT>::address(image))), access_(&detail::AccessTo<ImageT>::value) {}
  [[nodiscard]] bool empty() const { return image_.width <= 0 || image_.height <= 0; }
  [[nodiscard]] int width() const { return image_.width; }    ///< [px]
  [[nodiscard]] int height() const { return image_.height; }  ///< [px]
  /// Row y where it lies in memory as contiguous floats; null where it has to be converted.
  [[nodiscard]] const float* row_in_place(int y) const { return access_->row_in_place(image_, y); }
  /// Row y times `unit`, into `out`.
  void read_row(int y, float* out, float unit) const { access_->read_row(image_, y, out, unit); }
  [[nodiscard]] float at(int x, int y) const { return access_->pixel(image_, x, y); }

 private:
  detail::ImageAddress image_;
  const detail::ImageAccess* access_ = nullptr;
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
  AnyFrame() = default;  ///< no frame: its images are empty
  AnyFrame(double timestamp_, const AnyImage& intensity, const AnyImage& depth)
      : timestamp(timestamp_), intensity_(intensity), depth_(depth) {}
  AnyFrame(const RgbdFrame& frame)  // NOLINT: made to be a parameter
      : timestamp(frame.timestamp), colour(frame.colour), intensity_(frame.intensity), depth_(frame.depth) {}
  template <class HeldIntensity, class HeldDepth>
  AnyFrame(const Frame<HeldIntensity, HeldDepth>& frame)  // NOLINT: made to be a parameter
      : timestamp(frame.timestamp), colour(frame.colour), camera(frame.camera), intensity_(frame.intensity()), depth_(frame.depth()) {}
  template <class T>
  AnyFrame(const T&) {  // NOLINT: says what is wrong
    check_frame<T>();
  }

  double timestamp = 0;            ///< [s]
  ImageView<const Bgr8> colour{};  ///< empty where there is none
  Pinhole camera;                  ///< of a Frame; of others unknown: width 0

  [[nodiscard]] const AnyImage& intensity() const { return intensity_; }  ///< in [0,1]
  [[nodiscard]] const AnyImage& depth() const { return depth_; }          ///< [m]; see depth_valid

 private:
  AnyImage intensity_;
  AnyImage depth_;
};

/// Any pose.
class AnyPose {
 public:
  AnyPose(const Pose& T_a_b) : T_(T_a_b) {}  // NOLINT: made to be a parameter
  template <class PoseT>
  AnyPose(const PoseT& T_a_b) : T_(to_pose(T_a_b)) {}  // NOLINT: made to be a parameter
  operator const Pose&() const { return T_; }          // NOLINT: is one

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
