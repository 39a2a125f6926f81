/// \file
/// Images that come as bytes: the buffers of messages, drivers and shared memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include <apso/config.hpp>
#include <apso/traits/image.hpp>

APSO_NAMESPACE_BEGIN

/// Read-only view of pixels of type T inside a byte buffer: rows begin `row_step` bytes apart, pixels `pixel_step` bytes
/// apart, and nothing needs to be aligned. Pixels are copied out one by one, so this works where a typed pointer would be
/// undefined behaviour, at the price of the fast path. The buffer must outlive the view.
template <class T>
struct ByteImage {
  static_assert(std::is_arithmetic_v<T>, "apso: ByteImage<T> needs an arithmetic pixel type, e.g. std::uint16_t");
  const std::uint8_t* data = nullptr;
  int width = 0;                       ///< pixels
  int height = 0;                      ///< pixels
  std::size_t row_step = 0;            ///< bytes from a row to the next, padding included
  std::size_t pixel_step = sizeof(T);  ///< bytes from a pixel to the next; more than sizeof(T) picks one channel
  bool swap_bytes = false;             ///< the buffer has the other byte order than this machine
};

template <class T>
struct image_traits<ByteImage<T>> {
  using value_type = T;
  static int width(const ByteImage<T>& image) { return image.width; }
  static int height(const ByteImage<T>& image) { return image.height; }
  static value_type at(const ByteImage<T>& image, int x, int y) {
    const std::uint8_t* from = image.data + image.row_step * static_cast<std::size_t>(y) + image.pixel_step * static_cast<std::size_t>(x);
    unsigned char bytes[sizeof(T)];
    std::memcpy(bytes, from, sizeof(T));
    if (image.swap_bytes) {
      for (std::size_t i = 0; i < sizeof(T); ++i) bytes[i] = from[sizeof(T) - 1 - i];
    }
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return value;
  }
};

/// A view of a byte buffer of the given size. Throws contract_error when the rows do not fit into it.
/// \param bytes size of the buffer
template <class T>
[[nodiscard]] ByteImage<T> byte_image(const std::uint8_t* data, std::size_t bytes, int width, int height, std::size_t row_step,
                                      std::size_t pixel_step = sizeof(T), bool swap_bytes = false) {
  expects(data != nullptr && width > 0 && height > 0, "byte_image: the image is empty");
  expects(pixel_step >= sizeof(T), "byte_image: pixel_step is smaller than a pixel");
  const std::size_t row = pixel_step * static_cast<std::size_t>(width - 1) + sizeof(T);
  expects(row_step >= row, "byte_image: row_step is smaller than a row");
  // written so that no product can overflow, whatever a damaged message says
  const auto steps = static_cast<std::size_t>(height - 1);
  expects(bytes >= row && (steps == 0 || row_step <= (bytes - row) / steps), "byte_image: the buffer is smaller than the image");
  return {data, width, height, row_step, pixel_step, swap_bytes};
}

APSO_NAMESPACE_END
