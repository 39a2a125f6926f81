/// \file
/// A file in which runs keep for each other what they have computed of each frame.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

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

#include <apso/version.hpp>

namespace track {

/// Beside FILE of --keep-frames, the features lie in a file of this name.
inline constexpr const char* kept_features_suffix = ".features";

/// Each frame has a place of its own, with a checksum of what it depends on, its number and its bytes. A frame whose checksum is not
/// right, because the file is new, broken, of another sequence or still being written by another run, is not there. So no order has to be
/// kept between runs, and nothing that happens to the file changes a result.
class KeptFile {
 public:
  static constexpr std::uintmax_t spare_bytes = 1000000000;  ///< that stay free on the disk: runs have results to write

  /// \param file    made if it is not there; a file that holds something else is left as it is, and keeps nothing
  /// \param bytes   of a frame at most
  /// \param depends what the bytes depend on, besides the number of the frame and this build of the program
  /// \param instead what happens if the file cannot be used, for the warning
  KeptFile(std::string file, std::size_t bytes, const std::string& depends, const char* instead)
      : file_(std::move(file)),
        buffer_(sizeof(std::uint64_t) + (bytes + 7) / 8 * 8),
        open_(::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644)) {
    const std::string key = depends + '\n' + program() + std::string(8, ' ');
    key_ = checksum(0, reinterpret_cast<const unsigned char*>(key.data()), key.size());
    if (open_ >= 0 && ours()) return;
    std::fprintf(stderr, "warning: --keep-frames: %s %s; %s\n", file_.c_str(),
                 open_ < 0 ? "cannot be opened" : "is no file of frames, and stays as it is", instead);
    if (open_ >= 0) ::close(open_);
    open_ = -1;
  }
  ~KeptFile() {
    if (open_ >= 0) ::close(open_);
  }
  KeptFile(const KeptFile&) = delete;
  KeptFile& operator=(const KeptFile&) = delete;

  /// The bytes of the frame that was read, or is to be written.
  [[nodiscard]] unsigned char* bytes() { return buffer_.data() + sizeof(std::uint64_t); }

  /// \param also what the bytes of this frame depend on besides
  /// \return false: they are not there
  [[nodiscard]] bool read(int i, std::uint64_t also = 0) {
    if (open_ < 0 || ::pread(open_, buffer_.data(), buffer_.size(), place(i)) != static_cast<ssize_t>(buffer_.size())) return false;
    std::uint64_t sum = 0;
    std::memcpy(&sum, buffer_.data(), sizeof sum);
    return sum == sum_of_bytes(i, also);
  }
  /// Keeps the bytes if there is room.
  void write(int i, std::uint64_t also = 0) {
    if (open_ < 0 || full_) return;
    const std::uint64_t sum = sum_of_bytes(i, also);
    std::memcpy(buffer_.data(), &sum, sizeof sum);
    std::error_code unknown;
    const std::filesystem::space_info space = std::filesystem::space(file_, unknown);
    full_ = unknown || space.available < spare_bytes ||
            ::pwrite(open_, buffer_.data(), buffer_.size(), place(i)) != static_cast<ssize_t>(buffer_.size());
  }

  /// The whole words of `bytes`, mixed into a sum. Four sums side by side: none waits for the multiplication of another.
  static std::uint64_t checksum(std::uint64_t sum, const unsigned char* bytes, std::size_t count) {
    const auto mix = [](std::uint64_t& to, std::uint64_t word) {
      to = (to ^ word) * 0x9E3779B97F4A7C15ULL;
      to ^= to >> 32;
    };
    const auto word = [bytes](std::size_t k) {
      std::uint64_t w = 0;
      std::memcpy(&w, bytes + k, sizeof w);
      return w;
    };
    std::array<std::uint64_t, 4> sums{sum, sum + 1, sum + 2, sum + 3};
    std::size_t k = 0;
    for (; k + 32 <= count; k += 32) {
      for (std::size_t i = 0; i < 4; ++i) mix(sums[i], word(k + 8 * i));
    }
    for (; k + 8 <= count; k += 8) mix(sums[0], word(k));
    for (std::size_t i = 1; i < 4; ++i) mix(sums[0], sums[i]);
    return sums[0];
  }

 private:
  static constexpr std::array<char, 16> magic{"apso frames 1\n"};

  /// Another build of the program may compute something else.
  static std::string program() {
    const std::filesystem::path self = "/proc/self/exe";
    std::error_code unknown;
    return APSO_VERSION " " + std::to_string(std::filesystem::last_write_time(self, unknown).time_since_epoch().count()) + ' ' +
           std::to_string(std::filesystem::file_size(self, unknown));
  }
  [[nodiscard]] std::uint64_t sum_of_bytes(int i, std::uint64_t also) const {
    return checksum((key_ ^ also) + static_cast<std::uint64_t>(i) + 1, buffer_.data() + sizeof(std::uint64_t),
                    buffer_.size() - sizeof(std::uint64_t));
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

  std::string file_;
  std::vector<unsigned char> buffer_;  // a checksum and a frame
  int open_;
  bool full_ = false;
  std::uint64_t key_ = 0;
};

}  // namespace track
