/// \file
/// Signals that ask a program to stop: it ends its loop and keeps its results.
#pragma once

#include <csignal>

namespace track {

inline volatile std::sig_atomic_t stop_signal = 0;  ///< the last one that came; 0: none

/// Notes SIGINT, SIGTERM, SIGHUP and SIGPIPE instead of ending the program. What is ignored already, as by nohup, stays ignored.
/// A file that grows beyond its limit (SIGXFSZ) is an error of the stream.
inline void note_stop_signals() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) {
    if (std::signal(signal, [](int s) { stop_signal = s; }) == SIG_IGN) std::signal(signal, SIG_IGN);
  }
  std::signal(SIGXFSZ, SIG_IGN);
}

}  // namespace track
