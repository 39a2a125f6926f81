/// \file
/// A recording to which something happens once, at frame 40: the faults that cameras, drivers and clocks have.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "frame_source.hpp"

namespace track {

/// Changes the order, the stamps or the images of some frames of another source. docs/reliability.md says what the program
/// does with each fault.
class FaultySource final : public ChangedSource {
 public:
  static constexpr int first = 40;       ///< frame from which on the fault lasts
  static constexpr int a_few = 10;       ///< frames that are dropped, doubled or in another order
  static constexpr int one_second = 30;  ///< frames, at 30 Hz
  static constexpr int carried = 45;     ///< frames that are not seen while the camera is carried to another place
  static std::vector<std::string> kinds() {
    return {"dropped", "doubled", "reordered", "clock-back", "flash", "frozen", "depth-lost", "half-black", "occluded", "kidnapped"};
  }

  FaultySource(std::unique_ptr<FrameSource> source, std::string kind) : ChangedSource(std::move(source)), kind_(std::move(kind)) {
    const int n = source_->size();
    for (int i = 0; i < n; ++i) {
      const bool few = i >= first && i < first + a_few;
      if (few && kind_ == "dropped") continue;
      if (kind_ == "kidnapped" && i >= first && i < first + carried) continue;
      const bool swapped = few && kind_ == "reordered" && i + 1 - 2 * (i % 2) < n;
      order_.push_back(swapped ? i + 1 - 2 * (i % 2) : i);
      if (few && kind_ == "doubled") order_.push_back(i);
    }
    groundtruth_ = source_->groundtruth();
    if (kind_ == "kidnapped" && n > first + carried) {  // the clock tells nothing of the time in between
      clock_ = source_->timestamp(first + carried) - source_->timestamp(first);
      const double gone = source_->timestamp(first) - 1e-6;
      const auto in_between = [&](const apso::StampedPose& p) { return p.timestamp >= gone && p.timestamp < gone + clock_; };
      groundtruth_.erase(std::remove_if(groundtruth_.begin(), groundtruth_.end(), in_between), groundtruth_.end());
      for (apso::StampedPose& p : groundtruth_)
        if (p.timestamp > gone) p.timestamp -= clock_;
    }
    if (kind_ == "clock-back" && n > 0) clock_ = source_->timestamp(n - 1) - source_->timestamp(0) + 1;
  }

  int size() const override { return static_cast<int>(order_.size()); }
  const apso::Trajectory& groundtruth() const override { return groundtruth_; }
  double timestamp(int i) const override { return source_->timestamp(origin(i)) - (faulty(i) ? clock_ : 0); }
  std::string label(int i) const override { return faulty(i) ? kind_ : source_->label(origin(i)); }

  void load(int i, LoadedFrame& out) override {
    const bool still = kind_ == "frozen" && faulty(i);
    source_->load(still ? first - 1 : origin(i), out);
    out.timestamp = timestamp(i);
    if (!out.ok() || !faulty(i)) return;
    cv::Mat depth(out.depth.height(), out.depth.width(), CV_32FC1, out.depth.data());
    if (kind_ == "depth-lost") {
      depth.setTo(0);
    } else if (kind_ == "flash") {
      out.colour.convertTo(out.colour, -1, 3, 60);
      out.take_colour();
    } else if (kind_ == "half-black") {
      out.colour.colRange(0, out.colour.cols / 2).setTo(0);
      depth.colRange(0, depth.cols / 2).setTo(0);
      out.take_colour();
    } else if (kind_ == "occluded") {  // a hand before the lens, too near to be measured
      out.colour.setTo(cv::Scalar(30, 35, 50));
      depth.setTo(0);
      out.take_colour();
    }
  }

 private:
  [[nodiscard]] int origin(int i) const { return order_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] bool faulty(int i) const {
    const int lasting = kind_ == "clock-back"  ? source_->size()
                        : kind_ == "flash"     ? 3
                        : kind_ == "occluded"  ? 2 * one_second
                        : kind_ == "doubled"   ? 2 * a_few
                        : kind_ == "dropped"   ? 0
                        : kind_ == "reordered" ? a_few
                        : kind_ == "kidnapped" ? source_->size()
                                               : one_second;
    return i >= first && i - first < lasting;
  }

  std::string kind_;
  apso::Trajectory groundtruth_;
  std::vector<int> order_;  ///< frames of the other source, as they come
  double clock_ = 0;        ///< by which the stamps of the faulty frames are put back [s]
};

}  // namespace track
