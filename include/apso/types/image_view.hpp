/// \file
/// The two image types of the library: a view that owns nothing and an image that owns its pixels.
/// Pixel centres lie at integer coordinates; (0,0) is the top left one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// A rectangle of pixels somewhere in memory. Copying it copies no pixels.
/// \tparam T pixel type; `const T` for read-only views
template <class T>
struct ImageView {
  T* data = nullptr;
  int width = 0;              ///< pixels
  int height = 0;             ///< pixels
  std::ptrdiff_t stride = 0;  ///< distance between rows, in pixels (elements, not bytes)

  ImageView() = default;
  ImageView(T* data_, int width_, int height_, std::ptrdiff_t stride_) : data(data_), width(width_), height(height_), stride(stride_) {}
  ImageView(T* data_, int width_, int height_) : ImageView(data_, width_, height_, width_) {}
  /// A writable view converts to a read-only one.
  template <class U, std::enable_if_t<std::is_same_v<T, const U>, int> = 0>
  ImageView(const ImageView<U>& o) : ImageView(o.data, o.width, o.height, o.stride) {}  // NOLINT: intended

  [[nodiscard]] bool empty() const { return data == nullptr || width <= 0 || height <= 0; }
  [[nodiscard]] T* row(int y) const { return data + stride * y; }
  [[nodiscard]] T& operator()(int x, int y) const { return data[stride * y + x]; }
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
};

/// An image that owns its pixels, rows without padding. Resizing to a size seen before allocates nothing.
template <class T>
class Image {
 public:
  Image() = default;
  Image(int width, int height, T value = T{}) { assign(width, height, value); }

  /// Changes the size; the content is unspecified afterwards.
  void resize(int width, int height) {
    expects(width >= 0 && height >= 0, "Image::resize: negative size");
    width_ = width;
    height_ = height;
    pixels_.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  }
  /// Changes the size and sets every pixel.
  void assign(int width, int height, T value) {
    resize(width, height);
    pixels_.assign(pixels_.size(), value);
  }

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] bool empty() const { return pixels_.empty(); }
  [[nodiscard]] std::size_t size() const { return pixels_.size(); }
  [[nodiscard]] T* data() { return pixels_.data(); }
  [[nodiscard]] const T* data() const { return pixels_.data(); }
  [[nodiscard]] T* row(int y) { return pixels_.data() + static_cast<std::ptrdiff_t>(width_) * y; }
  [[nodiscard]] const T* row(int y) const { return pixels_.data() + static_cast<std::ptrdiff_t>(width_) * y; }
  [[nodiscard]] T& operator()(int x, int y) { return row(y)[x]; }
  [[nodiscard]] const T& operator()(int x, int y) const { return row(y)[x]; }

  [[nodiscard]] ImageView<T> view() { return {data(), width_, height_}; }
  [[nodiscard]] ImageView<const T> view() const { return {data(), width_, height_}; }
  operator ImageView<const T>() const { return view(); }  // NOLINT: an image is usable where a view is read

 private:
  std::vector<T> pixels_;
  int width_ = 0;
  int height_ = 0;
};

APSO_NAMESPACE_END
