/// \file
/// A recording of which some frames are degraded on purpose, to test whether they are detected.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "frame_source.hpp"

namespace track {

/// Degrades two consecutive frames of every twenty, from frame 40 on.
class DegradedSource final : public FrameSource {
 public:
  static constexpr int first = 40;  ///< frame that is degraded
  static std::vector<std::string> kinds() { return {"blur25", "blur41", "contrast", "wall", "blank", "no-depth"}; }

  DegradedSource(std::unique_ptr<FrameSource> source, std::string kind) : source_(std::move(source)), kind_(std::move(kind)) {}

  int size() const override { return source_->size(); }
  const apso::Pinhole& camera() const override { return source_->camera(); }
  const apso::Trajectory& groundtruth() const override { return source_->groundtruth(); }
  const std::vector<std::string>& warnings() const override { return source_->warnings(); }
  double timestamp(int i) const override { return source_->timestamp(i); }
  std::set<std::string> folders() const override { return source_->folders(); }
  std::string label(int i) const override { return degraded(i) ? kind_ : source_->label(i); }

  std::optional<std::string> load(int i, LoadedFrame& out) override {
    auto problem = source_->load(i, out);
    if (problem || !degraded(i)) return problem;
    out.bgr = out.bgr.clone();
    if (kind_ == "no-depth") {
      depth_.assign(out.bgr.cols, out.bgr.rows, 0.0F);
      out.rgbd.depth = depth_.view();
      return problem;
    }
    degrade(out.bgr, (i / 20) % 2 == 1);
    cv::cvtColor(out.bgr, gray_, cv::COLOR_BGR2GRAY);
    out.gray = gray_;
    intensity_.resize(gray_.cols, gray_.rows);
    for (int y = 0; y < gray_.rows; ++y) {
      const auto* from = gray_.ptr<unsigned char>(y);
      for (int x = 0; x < gray_.cols; ++x) intensity_(x, y) = static_cast<float>(from[x]) / 255.0F;
    }
    out.rgbd.intensity = intensity_.view();
    return problem;
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

  std::unique_ptr<FrameSource> source_;
  std::string kind_;
  cv::Mat gray_;
  apso::Image<float> intensity_;
  apso::Image<float> depth_;
};

}  // namespace track
