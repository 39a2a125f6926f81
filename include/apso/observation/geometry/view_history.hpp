/// \file
/// The last few small frames with their poses, for policies that compare with one of a given age.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/geometry/small_frame.hpp>

APSO_NAMESPACE_BEGIN

/// Small frames of the last `span` seconds, oldest first. Buffers are used again.
class ViewHistory {
 public:
  /// \param span age of the frame that is compared with [s]
  explicit ViewHistory(double span) : span_(span) {}

  /// Takes in a copy of a frame.
  void add(const SmallFrame& frame) {
    // the oldest may go when the next one is old enough as well
    while (frames_.size() > kMost || (frames_.size() > 1 && frame.time - frames_[1].time >= span_)) drop();
    SmallFrame f;
    if (!spare_.empty()) {
      f = std::move(spare_.back());
      spare_.pop_back();
    }
    f = frame;
    frames_.push_back(std::move(f));
  }
  /// The youngest frame that is at least `span` old at time `now`, else the oldest there is; null when there is none.
  [[nodiscard]] const SmallFrame* reference(double now) const {
    const SmallFrame* best = frames_.empty() ? nullptr : &frames_.front();
    for (const SmallFrame& f : frames_) {
      if (now - f.time >= span_) best = &f;
    }
    return best;
  }
  /// Forgets frames that are so old that the scene may have changed altogether.
  void forget_before(double time) {
    while (!frames_.empty() && frames_.front().time < time) drop();
  }
  void clear() {
    while (!frames_.empty()) drop();
  }

 private:
  void drop() {
    spare_.push_back(std::move(frames_.front()));
    frames_.erase(frames_.begin());
  }
  static constexpr std::size_t kMost = 32;
  double span_;
  std::vector<SmallFrame> frames_;
  std::vector<SmallFrame> spare_;
};

APSO_NAMESPACE_END
