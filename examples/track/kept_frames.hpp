/// \file
/// Rendered frames of a synthetic sequence in a file, so that several runs on one sequence render each frame once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include <apso/io/parameters.hpp>
#include <apso/testing/synthetic.hpp>

#include "kept_file.hpp"

namespace track {

class KeptFrames {
 public:
  KeptFrames(const std::string& file, const std::string& name, const apso::testing::SyntheticOptions& options)
      : width_(options.width),
        height_(options.height),
        file_(file, pixel_bytes * static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height),
              name + '\n' + apso::write_parameters(options), "every frame is rendered") {}

  /// Images of frame i as they were rendered. \return false: they are not there
  [[nodiscard]] bool read(int i, apso::testing::SyntheticFrame& out) {
    if (!file_.read(i)) return false;
    const unsigned char* from = file_.bytes();
    const auto take = [&from](auto& image, int width, int height) {
      image.resize(width, height);
      const std::size_t size = image.size() * sizeof *image.data();
      std::memcpy(image.data(), from, size);
      from += size;
    };
    take(out.rgb, 3 * width_, height_);
    take(out.depth, width_, height_);
    take(out.instance, width_, height_);
    grey_of(out.rgb, out.intensity);
    return true;
  }

  /// Keeps frame i if there is room.
  void write(int i, const apso::testing::SyntheticFrame& frame) {
    grey_of(frame.rgb, grey_);  // is not kept: it follows from the colours
    if (std::memcmp(grey_.data(), frame.intensity.data(), grey_.size() * sizeof(float)) != 0) return;
    unsigned char* to = file_.bytes();
    const auto put = [&to](const auto& image) {
      const std::size_t size = image.size() * sizeof *image.data();
      std::memcpy(to, image.data(), size);
      to += size;
    };
    put(frame.rgb);
    put(frame.depth);
    put(frame.instance);
    file_.write(i);
  }

 private:
  static constexpr std::size_t pixel_bytes = 3 + sizeof(float) + 1;  // colour, depth, person

  /// As the generator computes it.
  static void grey_of(const apso::Image<std::uint8_t>& rgb, apso::Image<float>& grey) {
    grey.resize(rgb.width() / 3, rgb.height());
    const std::uint8_t* c = rgb.data();
    for (std::size_t k = 0; k < grey.size(); ++k, c += 3) {
      grey.data()[k] =
          (0.299F * static_cast<float>(c[0]) + 0.587F * static_cast<float>(c[1]) + 0.114F * static_cast<float>(c[2])) * (1.0F / 255.0F);
    }
  }

  int width_;
  int height_;
  KeptFile file_;
  apso::Image<float> grey_;
};

}  // namespace track
