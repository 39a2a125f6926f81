/// \file
/// Another source, of which the next frame is read on a thread of its own.
#pragma once

#include <future>
#include <memory>
#include <utility>

#include "frame_source.hpp"

namespace track {

/// Frames are the same bit by bit. To decode two images takes a third of the time before a frame can be tracked.
class ReadAhead final : public ChangedSource {
 public:
  using ChangedSource::ChangedSource;

  void load(int i, LoadedFrame& out) override {
    const int there = std::exchange(ahead_, -1);
    if (reading_.valid()) reading_.get();  // what loading throws is thrown here
    if (there == i) {
      std::swap(out, frame_);
    } else {
      source_->load(i, out);
    }
    if (i + 1 == size()) return;
    ahead_ = i + 1;
    reading_ = std::async(std::launch::async, [this, next = i + 1] { source_->load(next, frame_); });
  }

 private:
  LoadedFrame frame_;
  int ahead_ = -1;             // number of frame_; -1: none
  std::future<void> reading_;  // last: its thread ends before what it uses
};

}  // namespace track
