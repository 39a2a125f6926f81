/// \file
/// A window in which a run is watched, held and stepped through.
#pragma once

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <string>
#include <utility>

#include <opencv2/core.hpp>
#include <opencv2/highgui.hpp>

#include <apso/io/tum_text.hpp>

#include "signals.hpp"

namespace track {

/// A window can be opened here. Some toolkits under OpenCV end the program where they cannot, so a child of it tries.
inline bool has_display() {
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit no_core{0, 0};
    ::setrlimit(RLIMIT_CORE, &no_core);
    const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
    ::dup2(nowhere, STDOUT_FILENO);
    ::dup2(nowhere, STDERR_FILENO);
    try {
      cv::namedWindow("display");
    } catch (const cv::Exception&) {
      ::_exit(1);
    }
    ::_exit(0);
  }
  int status = 1;
  return child > 0 && ::waitpid(child, &status, 0) == child && status == 0;
}

class Window {
 public:
  /// Throws io_error where no window can be opened.
  explicit Window(std::string title) : title_(std::move(title)) {
    if (!has_display()) {
      const char* display = std::getenv("DISPLAY");
      throw apso::io_error(std::string("--live: no window can be opened, ") +
                           (display == nullptr ? "DISPLAY is not set" : std::string("DISPLAY is '") + display + "'"));
    }
    cv::namedWindow(title_, cv::WINDOW_AUTOSIZE);
  }
  ~Window() { cv::destroyAllWindows(); }
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  /// Shows a picture and obeys the keys: space holds and goes on, n and right show the next picture and hold, q and Esc, as well
  /// as closing the window, stop the program as SIGINT does. Returns when the next picture is due.
  void show(const cv::Mat& picture) {
    constexpr int escape = 27;
    constexpr int right = 65363;  // XK_Right
    constexpr int none = -1;
    cv::imshow(title_, picture);
    for (bool next = false; !next && stop_signal == 0;) {
      const int pressed = cv::waitKeyEx(held_ ? 50 : 1);
      const int key = pressed == none || pressed == right ? pressed : pressed & 0xFF;  // some backends add the state of Shift
      if (key == ' ') held_ = !held_;
      if (key == 'n' || key == right) held_ = next = true;
      if (key == 'q' || key == escape || cv::getWindowProperty(title_, cv::WND_PROP_VISIBLE) < 1) stop_signal = SIGINT;
      next = next || !held_;
    }
  }

 private:
  std::string title_;
  bool held_ = false;
};

}  // namespace track
