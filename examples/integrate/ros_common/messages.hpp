// Images of ROS messages, ROS 1 or ROS 2: the message types have the same members in both.
#pragma once

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include <apso/traits/image.hpp>
#include <apso/traits/images/byte_image.hpp>

namespace apso_ros {

inline bool machine_is_big_endian() {
  const std::uint16_t one = 1;
  std::uint8_t first = 0;
  std::memcpy(&first, &one, 1);
  return first == 0;
}

// [channel]
/// One channel of a message, as an apso image. Throws apso::contract_error when the data are shorter than the message says.
template <class T, class ImageMessage>
apso::ByteImage<T> channel(const ImageMessage& m, std::size_t pixel_step, std::size_t offset) {
  apso::expects(m.data.size() > offset, "image message without data");
  return apso::byte_image<T>(m.data.data() + offset, m.data.size() - offset, static_cast<int>(m.width), static_cast<int>(m.height), m.step,
                             pixel_step, sizeof(T) > 1 && (m.is_bigendian != 0) != machine_is_big_endian());
}
// [/channel]

/// Grey image of a colour or grey message: mono8, mono16, rgb8, bgr8, rgba8, bgra8. Throws for any other encoding.
template <class ImageMessage>
void to_grey(const ImageMessage& m, apso::Image<std::uint8_t>& out) {
  out.resize(static_cast<int>(m.width), static_cast<int>(m.height));
  if (m.encoding == "mono8" || m.encoding == "mono16" || m.encoding == "8UC1") {
    const bool wide = m.encoding == "mono16";
    const auto fill = [&](const auto& image, int shift) {
      using Traits = apso::image_traits<std::decay_t<decltype(image)>>;
      for (int y = 0; y < out.height(); ++y) {
        for (int x = 0; x < out.width(); ++x) out(x, y) = static_cast<std::uint8_t>(Traits::at(image, x, y) >> shift);
      }
    };
    wide ? fill(channel<std::uint16_t>(m, 2, 0), 8) : fill(channel<std::uint8_t>(m, 1, 0), 0);
    return;
  }
  const bool four = m.encoding == "rgba8" || m.encoding == "bgra8";
  const bool red_first = m.encoding == "rgb8" || m.encoding == "rgba8";
  if (!four && m.encoding != "rgb8" && m.encoding != "bgr8") {
    throw std::invalid_argument("colour image has encoding '" + m.encoding + "'; mono8, mono16, rgb8, bgr8, rgba8 or bgra8 is needed");
  }
  const std::size_t step = four ? 4 : 3;
  const auto r = channel<std::uint8_t>(m, step, red_first ? 0 : 2);
  const auto g = channel<std::uint8_t>(m, step, 1);
  const auto b = channel<std::uint8_t>(m, step, red_first ? 2 : 0);
  using Traits = apso::image_traits<apso::ByteImage<std::uint8_t>>;
  for (int y = 0; y < out.height(); ++y) {
    for (int x = 0; x < out.width(); ++x) {  // ITU-R BT.601 in 1/256
      out(x, y) = static_cast<std::uint8_t>((77 * Traits::at(r, x, y) + 150 * Traits::at(g, x, y) + 29 * Traits::at(b, x, y) + 128) >> 8);
    }
  }
}

/// Depth in metres: 16UC1 in millimetres (0 = none) or 32FC1 in metres (NaN = none), REP 118. Throws for any other encoding.
template <class ImageMessage>
void to_depth(const ImageMessage& m, apso::Image<float>& out) {
  if (m.encoding == "16UC1" || m.encoding == "mono16") {
    apso::copy_to_float(channel<std::uint16_t>(m, 2, 0), 0.001, out);
  } else if (m.encoding == "32FC1") {
    apso::copy_to_float(channel<float>(m, 4, 0), 1.0, out);
  } else {
    throw std::invalid_argument("depth image has encoding '" + m.encoding + "'; 16UC1 (mm) or 32FC1 (m) is needed");
  }
}

/// A bgr8 message from interleaved bytes.
template <class ImageMessage>
void from_bgr(const std::vector<std::uint8_t>& bgr, int width, int height, ImageMessage& m) {
  m.width = static_cast<std::uint32_t>(width);
  m.height = static_cast<std::uint32_t>(height);
  m.encoding = "bgr8";
  m.is_bigendian = 0;
  m.step = static_cast<std::uint32_t>(3 * width);
  m.data.assign(bgr.begin(), bgr.end());
}

}  // namespace apso_ros
