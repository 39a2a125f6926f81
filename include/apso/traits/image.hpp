/// \file
/// Images: specialise image_traits, and every algorithm reads your image type where it lies.
///
/// \code
/// template <>
/// struct apso::image_traits<MyImage> {
///   using value_type = std::uint16_t;                                   // arithmetic
///   static int width(const MyImage& m) { return m.cols; }               // pixels
///   static int height(const MyImage& m) { return m.rows; }              // pixels
///   static value_type at(const MyImage& m, int x, int y) { return m.get(y, x); }  // 0 <= x < width, 0 <= y < height
///   static const value_type* row(const MyImage& m, int y) { return m.line(y); }   // optional: the fast path
/// };
/// \endcode
///
/// `row` must point to `width` contiguous pixels; without it every pixel is read through `at`.
/// testing/conformance.hpp checks that the members agree with each other.
#pragma once

#include <type_traits>

#include <apso/config.hpp>
#include <apso/traits/detail.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// Specialise for your image type. The second parameter is free for std::enable_if.
template <class T, class Enable = void>
struct image_traits {};

template <class T>
struct image_traits<ImageView<T>> {
  using value_type = std::remove_const_t<T>;
  static int width(const ImageView<T>& image) { return image.width; }
  static int height(const ImageView<T>& image) { return image.height; }
  static value_type at(const ImageView<T>& image, int x, int y) { return image(x, y); }
  static const value_type* row(const ImageView<T>& image, int y) { return image.row(y); }
};

template <class T>
struct image_traits<Image<T>> {
  using value_type = T;
  static int width(const Image<T>& image) { return image.width(); }
  static int height(const Image<T>& image) { return image.height(); }
  static value_type at(const Image<T>& image, int x, int y) { return image(x, y); }
  static const value_type* row(const Image<T>& image, int y) { return image.row(y); }
};

namespace detail {
template <class T>
using image_value_t = typename image_traits<T>::value_type;
template <class T>
using image_width_t = decltype(image_traits<T>::width(std::declval<const T&>()));
template <class T>
using image_height_t = decltype(image_traits<T>::height(std::declval<const T&>()));
template <class T>
using image_at_t = decltype(image_traits<T>::at(std::declval<const T&>(), 0, 0));
template <class T>
using image_row_t = decltype(image_traits<T>::row(std::declval<const T&>(), 0));

template <class T, class = void>
struct image_has_value : std::false_type {};
template <class T>
struct image_has_value<T, std::void_t<image_value_t<T>>> : std::is_arithmetic<image_value_t<T>> {};

template <class T, class = void>
struct image_has_row : std::false_type {};
template <class T>
struct image_has_row<T, std::void_t<image_row_t<T>, image_value_t<T>>> : std::is_convertible<image_row_t<T>, const image_value_t<T>*> {};
}  // namespace detail

/// True when T can be used as an image.
template <class T>
inline constexpr bool is_image_v = detail::image_has_value<T>::value&& detail::detected_as_v<int, detail::image_width_t, T>&&
    detail::detected_as_v<int, detail::image_height_t, T>&& detail::detected_as_v<double, detail::image_at_t, T>;

/// True when T offers the optional `row`.
template <class T>
inline constexpr bool has_row_v = detail::image_has_row<T>::value;

/// Names every member of image_traits<T> that is missing, in the compiler's message.
template <class T>
struct require_image {
  static_assert(detail::image_has_value<T>::value,
                "apso: image_traits<T> needs `using value_type = float;` (your arithmetic pixel type; "
                "an untyped cv::Mat is passed as apso::opencv::as_image<float>(mat))");
  static_assert(detail::detected_as_v<int, detail::image_width_t, T>, "apso: image_traits<T> needs `static int width(const T& image);`");
  static_assert(detail::detected_as_v<int, detail::image_height_t, T>, "apso: image_traits<T> needs `static int height(const T& image);`");
  static_assert(detail::detected_as_v<double, detail::image_at_t, T>,
                "apso: image_traits<T> needs `static value_type at(const T& image, int x, int y);`");
};

/// Stands first in every function that takes an image type of the user. Its result has no meaning: it makes the
/// compiler look at the requirements before it looks at the rest of that function.
template <class T>
constexpr require_image<T> check_image() {
  return {};
}

/// Copies any image into floats, `out(x,y) = scale * image(x,y)`. Allocates only when `out` grows.
/// \param scale 1/255 for 8-bit intensity, 1/5000 for depth in the TUM unit, 0.001 for millimetres
template <class ImageT>
void copy_to_float(const ImageT& image, double scale, Image<float>& out) {
  check_image<ImageT>();
  using Traits = image_traits<ImageT>;
  const int width = Traits::width(image);
  const int height = Traits::height(image);
  const auto s = static_cast<float>(scale);
  out.resize(width, height);
  for (int y = 0; y < height; ++y) {
    float* to = out.row(y);
    if constexpr (has_row_v<ImageT>) {
      const typename Traits::value_type* from = Traits::row(image, y);
      for (int x = 0; x < width; ++x) to[x] = s * static_cast<float>(from[x]);
    } else {
      for (int x = 0; x < width; ++x) to[x] = s * static_cast<float>(Traits::at(image, x, y));
    }
  }
}

APSO_NAMESPACE_END
