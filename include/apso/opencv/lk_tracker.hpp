/// \file
/// Points followed from frame to frame by pyramidal Lucas-Kanade, checked forward and backward.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>

#include <apso/config.hpp>
#include <apso/options.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

struct LkOptions {
  int tracks = 500;  ///< wanted in an image
  int window = 15;   ///< side of the patch [px]; a larger one follows weak texture, and blurs motions into each other
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("tracks", s.tracks, 0, 10000);
    v("window", s.window, 5, 51);
  }
};

class LkTracker {
 public:
  explicit LkTracker(const LkOptions& options = {}) : options_(options) { validate(options_, "lk"); }

  /// Follows the tracks into this image, drops what got lost or crowded, begins new ones at keypoints.
  void track(const cv::Mat& gray, const std::vector<Keypoint>& keypoints) {
    const cv::Size window(options_.window, options_.window);
    pyramid_.swap(previous_pyramid_);
    cv::buildOpticalFlowPyramid(gray, pyramid_, window, kLevels, true);
    const int columns = gray.cols / kCell + 1;
    const int rows = gray.rows / kCell + 1;
    occupied_.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 0);
    const auto cell = [&](float x, float y) -> char& {
      const int cx = std::clamp(static_cast<int>(x) / kCell, 0, columns - 1);
      const int cy = std::clamp(static_cast<int>(y) / kCell, 0, rows - 1);
      return occupied_[static_cast<std::size_t>(cy * columns + cx)];
    };
    kept_.clear();
    if (!tracks_.empty() && !previous_pyramid_.empty() && previous_pyramid_[0].size() == pyramid_[0].size()) {
      from_.clear();
      for (const PointTrack& t : tracks_) from_.emplace_back(t.x, t.y);
      const cv::TermCriteria stop(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 20, 0.03);
      cv::calcOpticalFlowPyrLK(previous_pyramid_, pyramid_, from_, to_, ok_, cv::noArray(), window, kLevels, stop);
      back_ = from_;
      cv::calcOpticalFlowPyrLK(pyramid_, previous_pyramid_, to_, back_, ok_back_, cv::noArray(), window, kLevels, stop,
                               cv::OPTFLOW_USE_INITIAL_FLOW);
      const double limit2 = kRoundTrip * kRoundTrip;
      for (std::size_t i = 0; i < tracks_.size(); ++i) {
        const cv::Point2f d = back_[i] - from_[i];
        if (!ok_[i] || !ok_back_[i] || !(d.dot(d) <= limit2)) continue;
        const cv::Point2f p = to_[i];
        if (!(p.x >= 1 && p.y >= 1 && p.x <= static_cast<float>(gray.cols - 2) && p.y <= static_cast<float>(gray.rows - 2))) continue;
        char& here = cell(p.x, p.y);
        if (here >= 2) continue;  // tracks that run together: the older (earlier in the list) stay
        ++here;
        kept_.push_back({tracks_[i].id, p.x, p.y, from_[i].x, from_[i].y, tracks_[i].age + 1});
      }
    }
    seed(keypoints, cell);
    tracks_.swap(kept_);
  }

  [[nodiscard]] const std::vector<PointTrack>& tracks() const { return tracks_; }

 private:
  static constexpr int kLevels = 3;          // of the pyramid above the image
  static constexpr int kCell = 24;           // one track per cell of this size [px]
  static constexpr double kRoundTrip = 1.0;  // largest distance after going forward and back [px] (Kalal et al., ICPR 2010)

  template <class Cell>
  void seed(const std::vector<Keypoint>& keypoints, const Cell& cell) {
    const auto wanted = static_cast<std::size_t>(options_.tracks);
    if (kept_.size() >= wanted) return;
    order_.clear();
    for (std::size_t i = 0; i < keypoints.size(); ++i)
      if (keypoints[i].octave <= 2) order_.push_back(i);
    std::stable_sort(order_.begin(), order_.end(),
                     [&](std::size_t a, std::size_t b) { return keypoints[a].response > keypoints[b].response; });
    for (std::size_t i : order_) {
      if (kept_.size() >= wanted) break;
      char& here = cell(keypoints[i].x, keypoints[i].y);
      if (here != 0) continue;
      ++here;
      const Keypoint& k = keypoints[i];
      kept_.push_back({next_id_++, k.x, k.y, k.x, k.y, 0});
    }
  }

  LkOptions options_;
  std::int64_t next_id_ = 0;
  std::vector<PointTrack> tracks_;
  std::vector<PointTrack> kept_;
  std::vector<cv::Mat> pyramid_;
  std::vector<cv::Mat> previous_pyramid_;
  std::vector<cv::Point2f> from_;
  std::vector<cv::Point2f> to_;
  std::vector<cv::Point2f> back_;
  std::vector<uchar> ok_;
  std::vector<uchar> ok_back_;
  std::vector<char> occupied_;
  std::vector<std::size_t> order_;
};

}  // namespace opencv
APSO_NAMESPACE_END
