/// \file
/// ORB features spread over the image: FAST corners per pyramid level, the strongest of each grid cell first.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/config.hpp>
#include <apso/options.hpp>
#include <apso/types/keypoint.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// The defaults are those of ORB-SLAM2 for RGB-D recordings of 640 x 480 (Mur-Artal & Tardos, T-RO 2017).
struct OrbOptions {
  int features = 1000;         ///< wanted in an image
  int levels = 8;              ///< of the pyramid
  double scale_factor = 1.2;   ///< between levels
  int fast_threshold = 20;     ///< of a corner [grey values]
  int min_fast_threshold = 7;  ///< of a corner where the cell has no better one [grey values]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("features", s.features, 50, 20000);
    v("levels", s.levels, 1, 16);
    v("scale_factor", s.scale_factor, 1.05, 2.0);
    v("fast_threshold", s.fast_threshold, 1, 255);
    v("min_fast_threshold", s.min_fast_threshold, 1, 255);
  }
};

/// Detects and describes. Orientation is the intensity centroid of a disc of 15 px (Rublee et al., ICCV 2011).
class OrbFrontEnd {
 public:
  explicit OrbFrontEnd(const OrbOptions& options = {}) : options_(options) {
    validate(options_, "orb");
    orb_ = cv::ORB::create(options_.features, static_cast<float>(options_.scale_factor), options_.levels, kEdge, 0, 2, cv::ORB::FAST_SCORE,
                           kPatch, options_.fast_threshold);
    for (int y = 0; y <= kHalf; ++y)
      disc_[static_cast<std::size_t>(y)] = static_cast<int>(std::floor(std::sqrt(double(kHalf * kHalf - y * y)) + 0.5));
  }

  /// \param gray 8-bit image
  /// \param keypoints found, with response = FAST score, angle in degrees and octave
  /// \param descriptors one row of 32 bytes for each keypoint
  void extract(const cv::Mat& gray, std::vector<Keypoint>& keypoints, cv::Mat& descriptors) {
    found_.clear();
    const double q = 1.0 / options_.scale_factor;
    const double first = options_.features * (1 - q) / (1 - std::pow(q, options_.levels));
    double scale = 1;
    int owed = 0;  // what a level could not give the next ones may
    for (int level = 0; level < options_.levels; ++level, scale *= options_.scale_factor) {
      const int wanted = owed + static_cast<int>(std::lround(first * std::pow(q, level)));
      const std::size_t before = found_.size();
      const cv::Mat* image = &gray;
      if (level > 0) {
        const auto current = static_cast<std::size_t>(level % 2);
        const std::size_t previous = 1 - current;
        const cv::Size size(cvRound(gray.cols / scale), cvRound(gray.rows / scale));
        if (size.width < 2 * kEdge + 16 || size.height < 2 * kEdge + 16) break;
        cv::resize(level == 1 ? gray : level_[previous], level_[current], size, 0, 0, cv::INTER_LINEAR);
        image = &level_[current];
      }
      detect_level(*image, level, static_cast<float>(scale), wanted);
      owed = std::max(0, wanted - static_cast<int>(found_.size() - before));
    }
    orb_->compute(gray, found_, descriptors);
    keypoints.clear();
    for (const cv::KeyPoint& k : found_) keypoints.push_back({k.pt.x, k.pt.y, k.response, k.angle, k.octave});
  }

 private:
  static constexpr int kPatch = 31;
  static constexpr int kHalf = 15;
  static constexpr int kEdge = 19;

  struct Candidate {
    float x, y, response;
    int rank;  // 0 = the strongest of its cell
    int cell;
  };

  void detect_level(const cv::Mat& image, int level, float scale, int wanted) {
    const cv::Rect inside(kEdge - 3, kEdge - 3, image.cols - 2 * (kEdge - 3), image.rows - 2 * (kEdge - 3));
    if (inside.width < 8 || inside.height < 8) return;
    cv::FAST(image(inside), corners_, options_.min_fast_threshold, true);
    const double side = std::max(8.0, std::sqrt(double(inside.width) * inside.height / std::max(1, wanted)));
    const int columns = std::max(1, static_cast<int>(inside.width / side));
    const int rows = std::max(1, static_cast<int>(inside.height / side));
    candidates_.clear();
    for (const cv::KeyPoint& c : corners_) {
      const int cx = std::min(columns - 1, static_cast<int>(c.pt.x * static_cast<float>(columns) / static_cast<float>(inside.width)));
      const int cy = std::min(rows - 1, static_cast<int>(c.pt.y * static_cast<float>(rows) / static_cast<float>(inside.height)));
      candidates_.push_back(
          {c.pt.x + static_cast<float>(inside.x), c.pt.y + static_cast<float>(inside.y), c.response, 0, cy * columns + cx});
    }
    const auto position_less = [](const Candidate& a, const Candidate& b) { return a.y != b.y ? a.y < b.y : a.x < b.x; };
    std::sort(candidates_.begin(), candidates_.end(), [&](const Candidate& a, const Candidate& b) {
      if (a.cell != b.cell) return a.cell < b.cell;
      if (a.response != b.response) return a.response > b.response;
      return position_less(a, b);
    });
    int rank = 0;
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      rank = i > 0 && candidates_[i].cell == candidates_[i - 1].cell ? rank + 1 : 0;
      // a weak corner counts only as the best of its cell, or late
      candidates_[i].rank = rank == 0 || candidates_[i].response >= static_cast<float>(options_.fast_threshold) ? rank : rank + 100;
    }
    const auto better = [&](const Candidate& a, const Candidate& b) {
      if (a.rank != b.rank) return a.rank < b.rank;
      if (a.response != b.response) return a.response > b.response;
      return position_less(a, b);
    };
    const std::size_t count = std::min(candidates_.size(), static_cast<std::size_t>(std::max(0, wanted)));
    std::partial_sort(candidates_.begin(), candidates_.begin() + static_cast<std::ptrdiff_t>(count), candidates_.end(), better);
    for (std::size_t i = 0; i < count; ++i) {
      const Candidate& c = candidates_[i];
      found_.emplace_back(c.x * scale, c.y * scale, static_cast<float>(kPatch) * scale,
                          orientation(image, static_cast<int>(c.x), static_cast<int>(c.y)), c.response, level);
    }
  }

  [[nodiscard]] float orientation(const cv::Mat& image, int x, int y) const {
    int m01 = 0;
    int m10 = 0;
    const auto step = static_cast<std::ptrdiff_t>(image.step);
    const uchar* centre = image.ptr<uchar>(y) + x;
    for (int u = -kHalf; u <= kHalf; ++u) m10 += u * centre[u];
    for (int v = 1; v <= kHalf; ++v) {
      int sum = 0;
      const int d = disc_[static_cast<std::size_t>(v)];
      for (int u = -d; u <= d; ++u) {
        const int below = centre[u + v * step];
        const int above = centre[u - v * step];
        sum += below - above;
        m10 += u * (below + above);
      }
      m01 += v * sum;
    }
    return cv::fastAtan2(static_cast<float>(m01), static_cast<float>(m10));
  }

  OrbOptions options_;
  cv::Ptr<cv::ORB> orb_;
  std::array<int, kHalf + 1> disc_{};
  std::array<cv::Mat, 2> level_;
  std::vector<cv::KeyPoint> corners_;
  std::vector<cv::KeyPoint> found_;
  std::vector<Candidate> candidates_;
};

}  // namespace opencv
APSO_NAMESPACE_END
