/// \file
/// Gnuplot as a process that is told what to draw through a pipe.
#pragma once

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <apso/io/tum_text.hpp>

namespace track {

/// In single quotes for gnuplot. Control characters, which could end the line, become '?'.
inline std::string quoted(const std::string& text) {
  std::string s = "'";
  for (char c : text) {
    s += std::iscntrl(static_cast<unsigned char>(c)) != 0 ? '?' : c;
    if (c == '\'') s += c;
  }
  return s + "'";
}

/// A picture that gnuplot draws from what is written to it through a pipe. Without gnuplot there is no picture.
class Gnuplot {
 public:
  /// \param file the picture, .png, .svg or .pdf
  /// \param width, height [px]
  Gnuplot(std::filesystem::path file, int width, int height, int font) : file_(std::move(file)) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw apso::io_error("gnuplot: no pipe to it can be made");
    char program[] = "gnuplot";
    char* arguments[] = {program, nullptr};
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[0], STDIN_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    if (::posix_spawnp(&child_, program, &actions, nullptr, arguments, environ) != 0) child_ = -1;
    posix_spawn_file_actions_destroy(&actions);
    ::close(ends[0]);
    pipe_.reset(::fdopen(ends[1], "w"));
    (*this)("set terminal " + terminal(width, height) + " font 'sans," + std::to_string(font) + "' background rgb 'white'");
  }
  ~Gnuplot() { (void)wait(); }
  Gnuplot(const Gnuplot&) = delete;
  Gnuplot& operator=(const Gnuplot&) = delete;

  void operator()(const std::string& text) const {
    if (child_ > 0) std::fputs((text + "\n").c_str(), pipe_.get());
  }
  /// Nothing more follows: the picture is drawn while the caller goes on. finish() waits for it.
  void end() { pipe_.reset(); }
  /// Waits for the picture. Throws io_error when it was drawn and cannot be written; tells when it was not drawn.
  void finish() {
    const bool installed = child_ > 0;
    const int status = wait();
    if (!installed || status != 0) {
      std::fprintf(stderr, "warning: %s: not drawn, %s\n", file_.c_str(), installed ? "gnuplot failed" : "gnuplot cannot be started");
      std::error_code ignored;
      std::filesystem::remove(file_, ignored);
      return;
    }
    std::ifstream picture(file_, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(picture), {}};
    const std::string end = bytes.substr(bytes.size() - std::min<std::size_t>(bytes.size(), 12));
    const char* last = svg() ? "</svg>" : pdf() ? "%%EOF" : "IEND";  // IEND: the last chunk of a PNG
    const bool whole = end.find(last) != std::string::npos;
    if (!whole) throw apso::io_error(file_.string() + ": cannot write (disk full?)");
  }
  /// Inline data of a `plot '-'`: rows of numbers; a row with a NaN breaks the line.
  void data(const std::vector<std::vector<double>>& rows) const {
    for (const auto& row : rows) {
      std::string line;
      bool broken = false;
      char number[32];
      for (double v : row) {
        broken = broken || !std::isfinite(v);
        std::snprintf(number, sizeof number, "%.9g ", v);
        line += number;
      }
      (*this)(broken ? "" : line);
    }
    (*this)("e");
  }

 private:
  [[nodiscard]] bool svg() const { return file_.extension() == ".svg"; }
  [[nodiscard]] bool pdf() const { return file_.extension() == ".pdf"; }
  [[nodiscard]] std::string terminal(int width, int height) const {
    char text[80];
    constexpr double dots_per_inch = 72;  // of the fonts of the other formats
    if (pdf()) {
      std::snprintf(text, sizeof text, "pdfcairo fontscale 0.8 size %.4fin,%.4fin", width / dots_per_inch, height / dots_per_inch);
    } else {
      std::snprintf(text, sizeof text, "%s size %d,%d", svg() ? "svg" : "pngcairo", width, height);
    }
    return text;
  }
  int wait() {
    pipe_.reset();
    int status = 0;
    if (child_ > 0) ::waitpid(child_, &status, 0);
    child_ = -1;
    return status;
  }

  std::filesystem::path file_;
  pid_t child_ = -1;
  std::unique_ptr<FILE, int (*)(FILE*)> pipe_{nullptr, &std::fclose};
};

}  // namespace track
