/// \file
/// What the fuzz targets share: numbers taken from the bytes of an input, and the input as a file.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>

#include <apso/math/se3.hpp>

namespace fuzz {

/// Stops with a message that libFuzzer keeps with the input. For what must hold of every input.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz: does not hold: %s\n", what);
  std::abort();
}

/// Reads the input from its front; zeros when it is used up.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  [[nodiscard]] bool empty() const { return size_ == 0; }
  template <class T>
  T take() {
    T value{};
    const std::size_t n = size_ < sizeof value ? size_ : sizeof value;
    if (n > 0) std::memcpy(&value, data_, n);
    data_ += n;
    size_ -= n;
    return value;
  }
  /// In [0, count).
  int below(int count) { return static_cast<int>(take<std::uint16_t>()) % count; }
  bool flag() { return (take<std::uint8_t>() & 1U) != 0; }
  /// Mostly a number in [lowest, highest], sometimes any double: NaN, infinite, huge.
  double number(double lowest, double highest) {
    const auto kind = take<std::uint8_t>();
    if (kind == 255) return take<double>();
    if (kind == 254) return std::numeric_limits<double>::quiet_NaN();
    if (kind == 253) return std::numeric_limits<double>::infinity();
    return lowest + (highest - lowest) * take<std::uint16_t>() / 65535.0;
  }
  /// Mostly a small motion, sometimes one that is none.
  apso::Pose pose() {
    apso::Twist xi;
    for (int i = 0; i < 6; ++i) xi(i) = static_cast<double>(take<std::int8_t>()) / 1000.0;
    apso::Pose T = apso::se3_exp(xi);
    const auto kind = take<std::uint8_t>();
    if (kind >= 240) T(kind % 3, (kind / 3) % 4) = number(-2, 2);
    return T;
  }
  std::string rest() { return {reinterpret_cast<const char*>(data_), size_}; }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

/// A file in memory with the content given, and a path under which it can be opened.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(::memfd_create("fuzz", 0)), path_("/proc/self/fd/" + std::to_string(descriptor_)) {
    require(descriptor_ >= 0, "memfd_create");
  }
  ~MemoryFile() { ::close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  const std::string& write(const std::uint8_t* data, std::size_t size) {
    require(::ftruncate(descriptor_, 0) == 0 && ::pwrite(descriptor_, data, size, 0) == static_cast<ssize_t>(size), "write");
    return path_;
  }

 private:
  int descriptor_;
  std::string path_;
};

/// True for a message that may be printed: not empty, not endless, no control character.
inline bool printable_message(const char* message) {
  const std::size_t n = std::strlen(message);
  for (std::size_t i = 0; i < n; ++i) {
    if (static_cast<unsigned char>(message[i]) < 0x20) return false;
  }
  return n > 0 && n < 4000;
}
/// For the message about a file that is refused.
inline void require_names_file(const char* message, const std::string& path) {
  require(printable_message(message), "a message is printable");
  require(std::strncmp(message, path.c_str(), path.size()) == 0, "a message begins with the file");
}

}  // namespace fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
