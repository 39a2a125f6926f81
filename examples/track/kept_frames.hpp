/// \file
/// Rendered frames of a synthetic sequence in a file, so that several runs on one sequence render each frame once.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <apso/io/parameters.hpp>
#include <apso/testing/synthetic.hpp>
#include <apso/version.hpp>

namespace track {

/// Each frame has a place of its own, with a checksum of what it depends on, its number and its pixels. A frame whose checksum is not
/// right, because the file is new, broken, of another sequence or still being written by another run, is not there. So no order has to be
/// kept between runs, and nothing that happens to the file changes a frame.
class KeptFrames {
 public:
  static constexpr std::uintmax_t spare_bytes = 1000000000;  ///< that stay free on the disk: runs have results to write

  /// \param file made if it is not there; a file that holds something else is left as it is, and keeps nothing
  KeptFrames(std::string file, const std::string& name, const apso::testing::SyntheticOptions& options)
      : file_(std::move(file)),
        bytes_(pixel_bytes * static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height)),
        width_(options.width),
        height_(options.height),
        buffer_(sizeof(std::uint64_t) + bytes_),
        open_(::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644)) {
    const std::string key = name + '\n' + apso::write_parameters(options) + '\n' + program() + std::string(8, ' ');
    key_ = checksum(0, reinterpret_cast<const unsigned char*>(key.data()), key.size());
    if (open_ < 0 || !ours()) give_up();
  }
  ~KeptFrames() {
    if (open_ >= 0) ::close(open_);
  }
  KeptFrames(const KeptFrames&) = delete;
  KeptFrames& operator=(const KeptFrames&) = delete;

  /// Images of frame i as they were rendered. \return false: they are not there
  [[nodiscard]] bool read(int i, apso::testing::SyntheticFrame& out) {
    if (open_ < 0 || ::pread(open_, buffer_.data(), buffer_.size(), place(i)) != static_cast<ssize_t>(buffer_.size())) return false;
    std::uint64_t sum = 0;
    std::memcpy(&sum, buffer_.data(), sizeof sum);
    if (sum != sum_of_buffer(i)) return false;
    const unsigned char* from = buffer_.data() + sizeof sum;
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
    if (open_ < 0 || full_) return;
    grey_of(frame.rgb, grey_);  // is not kept: it follows from the colours
    if (std::memcmp(grey_.data(), frame.intensity.data(), grey_.size() * sizeof(float)) != 0) return;
    unsigned char* to = buffer_.data() + sizeof(std::uint64_t);
    const auto put = [&to](const auto& image) {
      const std::size_t size = image.size() * sizeof *image.data();
      std::memcpy(to, image.data(), size);
      to += size;
    };
    put(frame.rgb);
    put(frame.depth);
    put(frame.instance);
    const std::uint64_t sum = sum_of_buffer(i);
    std::memcpy(buffer_.data(), &sum, sizeof sum);
    std::error_code unknown;
    const std::filesystem::space_info space = std::filesystem::space(file_, unknown);
    full_ = unknown || space.available < spare_bytes ||
            ::pwrite(open_, buffer_.data(), buffer_.size(), place(i)) != static_cast<ssize_t>(buffer_.size());
  }

 private:
  static constexpr std::size_t pixel_bytes = 3 + sizeof(float) + 1;  // colour, depth, person
  static constexpr std::array<char, 16> magic{"apso frames 1\n"};

  /// Another build of the program may render other frames.
  static std::string program() {
    const std::filesystem::path self = "/proc/self/exe";
    std::error_code unknown;
    return APSO_VERSION " " + std::to_string(std::filesystem::last_write_time(self, unknown).time_since_epoch().count()) + ' ' +
           std::to_string(std::filesystem::file_size(self, unknown));
  }
  static std::uint64_t checksum(std::uint64_t sum, const unsigned char* bytes, std::size_t count) {
    for (std::size_t k = 0; k + 8 <= count; k += 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, bytes + k, sizeof word);
      sum = (sum ^ word) * 0x9E3779B97F4A7C15ULL;
      sum ^= sum >> 32;
    }
    return sum;
  }
  /// As the generator computes it.
  static void grey_of(const apso::Image<std::uint8_t>& rgb, apso::Image<float>& grey) {
    grey.resize(rgb.width() / 3, rgb.height());
    const std::uint8_t* c = rgb.data();
    for (std::size_t k = 0; k < grey.size(); ++k, c += 3) {
      grey.data()[k] =
          (0.299F * static_cast<float>(c[0]) + 0.587F * static_cast<float>(c[1]) + 0.114F * static_cast<float>(c[2])) * (1.0F / 255.0F);
    }
  }
  [[nodiscard]] std::uint64_t sum_of_buffer(int i) const {
    return checksum(key_ + static_cast<std::uint64_t>(i) + 1, buffer_.data() + sizeof(std::uint64_t), bytes_);
  }
  [[nodiscard]] off_t place(int i) const { return static_cast<off_t>(magic.size() + static_cast<std::size_t>(i) * buffer_.size()); }
  /// The file begins as such a file does, or it is new.
  [[nodiscard]] bool ours() const {
    struct stat kind {};
    if (::fstat(open_, &kind) != 0 || !S_ISREG(kind.st_mode)) return false;
    std::array<char, 16> start{};
    if (kind.st_size == 0) return ::pwrite(open_, magic.data(), magic.size(), 0) == static_cast<ssize_t>(magic.size());
    return ::pread(open_, start.data(), start.size(), 0) == static_cast<ssize_t>(start.size()) && start == magic;
  }
  void give_up() {
    std::fprintf(stderr, "warning: --keep-frames %s: %s; every frame is rendered\n", file_.c_str(),
                 open_ < 0 ? "cannot be opened" : "is no file of frames, and stays as it is");
    if (open_ >= 0) ::close(open_);
    open_ = -1;
  }

  std::string file_;
  std::size_t bytes_;  // of a frame
  int width_;
  int height_;
  std::vector<unsigned char> buffer_;  // a checksum and a frame
  apso::Image<float> grey_;
  int open_;
  bool full_ = false;
  std::uint64_t key_ = 0;
};

}  // namespace track
