/// \file
/// Any image, read row by row as float, without copying the image; and images in another unit.
///
/// \code
/// auto depth = rows(scaled(raw, 0.001F), buffer);   // raw: 16-bit millimetres; scaled: an image in metres
/// for (int y = 0; y < depth.height(); ++y) {
///   const float* z = depth(y);                    // valid until the next row is asked for
///   for (int x = 0; x < depth.width(); ++x) use(z[x]);
/// }
/// \endcode
///
/// Contiguous rows of float are not touched: the pointer leads into the image. All else is converted one row at a time,
/// into a buffer that stays in the cache.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/images/byte_image.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
/// How a frame or another view keeps an image: views and temporaries by value, all else by address.
template <class T>
struct is_view : std::false_type {};
template <class T>
struct is_view<ImageView<T>> : std::true_type {};
template <class T>
struct is_view<ByteImage<T>> : std::true_type {};

template <class T>
class ByAddress {
 public:
  using type = T;
  explicit ByAddress(const T& image) : image_(&image) {}
  [[nodiscard]] const T& get() const { return *image_; }

 private:
  const T* image_;
};
template <class T>
class ByValue {
 public:
  using type = T;
  explicit ByValue(T image) : image_(std::move(image)) {}
  [[nodiscard]] const T& get() const { return image_; }

 private:
  T image_;
};
/// I is what a forwarding reference `I&&` deduced.
template <class I>
using held_t = std::conditional_t<std::is_lvalue_reference_v<I> && !is_view<std::decay_t<I>>::value, ByAddress<std::decay_t<I>>,
                                  ByValue<std::decay_t<I>>>;
}  // namespace detail

/// An image in another unit: pixel = unit * pixel of the image within. Made by scaled().
template <class Held>
struct ScaledImage {
  Held image;
  float unit = 1;
};
namespace detail {
template <class Held>
struct is_view<ScaledImage<Held>> : std::true_type {};
}  // namespace detail

template <class Held>
struct image_traits<ScaledImage<Held>> {
  using inner = image_traits<typename Held::type>;
  using value_type = float;
  static int width(const ScaledImage<Held>& m) { return inner::width(m.image.get()); }
  static int height(const ScaledImage<Held>& m) { return inner::height(m.image.get()); }
  static float at(const ScaledImage<Held>& m, int x, int y) { return m.unit * static_cast<float>(inner::at(m.image.get(), x, y)); }
};

/// An image in another unit, without a copy: `scaled(raw, 1 / 5000.F)` is the raw depth of a TUM recording in metres. A
/// named image must outlive the result; a view or a temporary is taken along.
template <class I>
[[nodiscard]] auto scaled(I&& image, float unit) {
  check_image<std::decay_t<I>>();
  using Held = detail::held_t<I>;
  return ScaledImage<Held>{Held(std::forward<I>(image)), unit};
}

/// Intensity in [0,1]: 8-bit and 16-bit images divided by their largest value, all others as they are.
template <class I>
[[nodiscard]] auto as_intensity(I&& image) {
  check_image<std::decay_t<I>>();
  using Value = typename image_traits<std::decay_t<I>>::value_type;
  constexpr bool bytes = std::is_same_v<Value, std::uint8_t>;
  constexpr bool words = std::is_same_v<Value, std::uint16_t>;
  constexpr float unit = bytes ? 1.0F / 255 : (words ? 1.0F / 65535 : 1.0F);
  using Held = detail::held_t<I>;
  return ScaledImage<Held>{Held(std::forward<I>(image)), unit};
}

/// Row y of any image, times `unit`, into `out`, which has room for its width.
template <class ImageT>
void read_row(const ImageT& image, int y, float* out, float unit = 1) {
  using Traits = image_traits<ImageT>;
  const int width = Traits::width(image);
  if constexpr (has_row_v<ImageT>) {
    // In blocks of a fixed size, of their own memory: compilers use vectors then from -O2 on (a shorter loop would be unrolled instead).
    constexpr int kBlock = 32;
    const typename Traits::value_type* from = Traits::row(image, y);
    int x = 0;
    for (; x + kBlock <= width; x += kBlock) {
      float block[kBlock];
      for (int i = 0; i < kBlock; ++i) block[i] = unit * static_cast<float>(from[x + i]);
      std::copy(block, block + kBlock, out + x);
    }
    for (; x < width; ++x) out[x] = unit * static_cast<float>(from[x]);
  } else {
    for (int x = 0; x < width; ++x) out[x] = unit * static_cast<float>(Traits::at(image, x, y));
  }
}
template <class Held>
void read_row(const ScaledImage<Held>& image, int y, float* out, float unit = 1) {
  read_row(image.image.get(), y, out, unit * image.unit);
}

/// Row y where it lies in memory, if the image has contiguous rows of float in the unit wanted; else null.
template <class ImageT>
[[nodiscard]] const float* row_in_place(const ImageT& image, int y) {
  if constexpr (has_row_v<ImageT> && std::is_same_v<typename image_traits<ImageT>::value_type, float>) {
    return image_traits<ImageT>::row(image, y);
  } else {
    (void)image, (void)y;
    return nullptr;
  }
}
template <class Held>
[[nodiscard]] const float* row_in_place(const ScaledImage<Held>& image, int y) {
  return image.unit == 1.0F ? row_in_place(image.image.get(), y) : nullptr;
}

/// One pixel of any image as float. For sparse access; loops over an image use rows().
template <class ImageT>
[[nodiscard]] float pixel(const ImageT& image, int x, int y) {
  return static_cast<float>(image_traits<ImageT>::at(image, x, y));
}

/// Rows of any image as float. Made by rows(). Not thread-safe: each thread makes its own.
template <class Held>
class Rows {
 public:
  static constexpr int kMaxRing = 8;

  Rows(Held image, std::vector<float>& buffer, int ring) : image_(std::move(image)), buffer_(&buffer), ring_(ring) {
    expects(ring >= 1 && ring <= kMaxRing, "rows: the ring holds 1 to 8 rows");
    expects(width() > 0 && height() > 0, "rows: the image is empty");
    converted_.fill(-1);
    if (row_in_place(image_.get(), 0) != nullptr) return;
    const auto room = static_cast<std::size_t>(width()) * static_cast<std::size_t>(ring);
    if (buffer.size() < room) buffer.resize(room);
  }
  [[nodiscard]] int width() const { return image_traits<typename Held::type>::width(image_.get()); }
  [[nodiscard]] int height() const { return image_traits<typename Held::type>::height(image_.get()); }
  /// Row y, 0 <= y < height: a pointer to `width` floats.
  [[nodiscard]] const float* operator()(int y) {
    if (const float* in_place = row_in_place(image_.get(), y)) return in_place;
    const int slot = y % ring_;
    float* out = buffer_->data() + static_cast<std::ptrdiff_t>(slot) * width();
    if (converted_[static_cast<std::size_t>(slot)] != y) read_row(image_.get(), y, out);
    converted_[static_cast<std::size_t>(slot)] = y;
    return out;
  }

 private:
  Held image_;
  std::vector<float>* buffer_;
  int ring_;
  std::array<int, kMaxRing> converted_{};  // which row each slot of the ring holds
};

/// Reads an image row by row. A named image must outlive the result; a view or a temporary is taken along.
/// \param buffer room for converted rows; one for each image that is read at the same time. Grows at the first call only
/// \param ring   how many rows in succession are needed at the same time, 1 to 8
template <class I>
[[nodiscard]] auto rows(I&& image, std::vector<float>& buffer, int ring = 1) {
  check_image<std::decay_t<I>>();
  using Held = detail::held_t<I>;
  return Rows<Held>(Held(std::forward<I>(image)), buffer, ring);
}

APSO_NAMESPACE_END
