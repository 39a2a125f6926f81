/// \file
/// A line that shows how far a program has come, overwritten in place.
#pragma once

#include <unistd.h>

#include <cstdio>
#include <string>

namespace track {

/// Shows nothing where the output is no terminal: in a file or a pipe such a line would only be in the way.
class ProgressLine {
 public:
  /// \param enabled false: show nothing
  explicit ProgressLine(bool enabled = true) : enabled_(enabled && ::isatty(STDERR_FILENO) == 1) {}
  ~ProgressLine() { end(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// \param text what stands behind the bar and the counts
  void show(int done, int total, const std::string& text) {
    if (!enabled_) return;
    constexpr int width = 32;  // characters of the bar
    const int filled = total > 0 ? width * done / total : width;
    const std::string bar = std::string(static_cast<std::size_t>(filled), '#') + std::string(static_cast<std::size_t>(width - filled), '.');
    std::fprintf(stderr, "\r[%s] %d/%d  %s ", bar.c_str(), done, total, text.c_str());
    shown_ = true;
  }
  /// Ends the line, so that what is printed next begins a new one.
  void end() {
    if (shown_) std::fputc('\n', stderr);
    shown_ = false;
  }

 private:
  bool enabled_;
  bool shown_ = false;
};

}  // namespace track
