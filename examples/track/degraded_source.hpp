/// \file
/// A recording of which some frames are degraded on purpose, to test whether they are detected.
#pragma once

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

/// Degrades two consecutive frames of every twenty, from frame 40 on.
class DegradedSource final : public ChangedSource {
 public:
  static constexpr int first = 40;  ///< frame that is degraded
  static std::vector<std::string> kinds() { return {"blur25", "blur41", "contrast", "wall", "blank", "no-depth"}; }

  DegradedSource(std::unique_ptr<FrameSource> source, std::string kind) : ChangedSource(std::move(source)), kind_(std::move(kind)) {}

  std::string label(int i) const override { return degraded(i) ? kind_ : source_->label(i); }

  void load(int i, LoadedFrame& out) override {
    source_->load(i, out);
    if (!out.ok() || !degraded(i)) return;
    if (kind_ == "no-depth") {
      out.depth.assign(out.depth.width(), out.depth.height(), 0.0F);
      return;
    }
    degrade(out.colour, (i / 20) % 2 == 1);
    out.take_colour();
  }

 private:
  static bool degraded(int i) { return i >= first && i % 20 < 2; }
  void degrade(cv::Mat& image, bool other_way) const {
    if (kind_ == "blur25" || kind_ == "blur41") {  // as by a pan or a tilt
      const int n = kind_ == "blur25" ? 25 : 41;
      cv::blur(image, image, other_way ? cv::Size(1, n) : cv::Size(n, 1));
    } else if (kind_ == "contrast") {
      image.convertTo(image, -1, 0.1, 0.9 * cv::mean(image)[0]);
    } else if (kind_ == "wall") {
      image.colRange(0, 3 * image.cols / 4).setTo(cv::mean(image));
    } else if (kind_ == "blank") {
      image.setTo(cv::mean(image));
    }
  }

  std::string kind_;
};

}  // namespace track
