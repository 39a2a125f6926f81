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
  static constexpr int kLate = 1 << 20;  // added to the rank of weak corners, more than a cell has corners

  struct Candidate {
    float x, y, response;  // position inside the border
    int rank;              // 0 = the strongest of its cell
    int cell;
  };

  /// The part of a level that has corners, in cells, about as many as corners are wanted.
  struct Grid {
    cv::Rect inside;
    int columns, rows;
    Grid(const cv::Mat& image, int wanted) : inside(kEdge - 3, kEdge - 3, image.cols - 2 * (kEdge - 3), image.rows - 2 * (kEdge - 3)) {
      const double side = std::max(8.0, std::sqrt(double(inside.width) * inside.height / std::max(1, wanted)));
      columns = std::max(1, static_cast<int>(inside.width / side));
      rows = std::max(1, static_cast<int>(inside.height / side));
    }
    [[nodiscard]] int cell(const cv::Point2f& p) const {
      const int cx = std::min(columns - 1, static_cast<int>(p.x * static_cast<float>(columns) / static_cast<float>(inside.width)));
      const int cy = std::min(rows - 1, static_cast<int>(p.y * static_cast<float>(rows) / static_cast<float>(inside.height)));
      return cy * columns + cx;
    }
    /// What FAST has to see to find the corners of these cells: its circle of 3 px, also of their neighbours, and a pixel for rounding.
    [[nodiscard]] cv::Rect around(int first, int last) const {
      constexpr int margin = 5;
      const bool one_row = last - first < columns;
      const int left = one_row ? first % columns : 0;
      const int right = one_row ? left + last - first : columns;
      const cv::Point from(left * inside.width / columns - margin, first / columns * inside.height / rows - margin);
      const cv::Point to(right * inside.width / columns + margin + 1, ((last - 1) / columns + 1) * inside.height / rows + margin + 1);
      return cv::Rect(from, to) & cv::Rect({}, inside.size());
    }
  };

  // Weak corners are most of those that can be found, and few of those that are taken: unless the strong ones are too few, they are looked
  // for only in cells that have no strong one.
  void detect_level(const cv::Mat& image, int level, float scale, int wanted) {
    const Grid grid(image, wanted);
    if (grid.inside.width < 8 || grid.inside.height < 8) return;
    const auto count = static_cast<std::size_t>(std::max(0, wanted));
    candidates_.clear();
    add_corners(image, grid, 0, grid.columns * grid.rows, std::max(options_.fast_threshold, options_.min_fast_threshold));
    if (candidates_.size() < count) {
      candidates_.clear();
      add_corners(image, grid, 0, grid.columns * grid.rows, options_.min_fast_threshold);
    } else if (options_.min_fast_threshold < options_.fast_threshold) {
      has_corner_.assign(static_cast<std::size_t>(grid.columns * grid.rows), false);
      for (const Candidate& c : candidates_) has_corner_[static_cast<std::size_t>(c.cell)] = true;
      for (int row = 0; row < grid.rows; ++row) {
        const auto first = has_corner_.begin() + row * grid.columns;
        const auto last = first + grid.columns;
        for (auto from = std::find(first, last, false); from != last;) {
          const auto to = std::find(from, last, true);
          add_corners(image, grid, static_cast<int>(from - has_corner_.begin()), static_cast<int>(to - has_corner_.begin()),
                      options_.min_fast_threshold);
          from = std::find(to, last, false);
        }
      }
    }
    take_best(image, grid, count, level, scale);
  }

  // Those in the cells from first up to, not including, last: a part of one row, or whole rows.
  void add_corners(const cv::Mat& image, const Grid& grid, int first, int last, int threshold) {
    const cv::Rect part = grid.around(first, last);
    cv::FAST(image(grid.inside)(part), corners_, threshold, true);
    for (const cv::KeyPoint& k : corners_) {
      const cv::Point2f p = k.pt + cv::Point2f(part.tl());
      const int cell = grid.cell(p);
      if (first <= cell && cell < last) candidates_.push_back({p.x, p.y, k.response, 0, cell});
    }
  }

  void take_best(const cv::Mat& image, const Grid& grid, std::size_t wanted, int level, float scale) {
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
      candidates_[i].rank = rank == 0 || candidates_[i].response >= static_cast<float>(options_.fast_threshold) ? rank : rank + kLate;
    }
    const std::size_t count = std::min(candidates_.size(), wanted);
    std::partial_sort(candidates_.begin(), candidates_.begin() + static_cast<std::ptrdiff_t>(count), candidates_.end(),
                      [&](const Candidate& a, const Candidate& b) {
                        if (a.rank != b.rank) return a.rank < b.rank;
                        if (a.response != b.response) return a.response > b.response;
                        return position_less(a, b);
                      });
    for (std::size_t i = 0; i < count; ++i) {
      const Candidate& c = candidates_[i];
      const float x = c.x + static_cast<float>(grid.inside.x);
      const float y = c.y + static_cast<float>(grid.inside.y);
      found_.emplace_back(x * scale, y * scale, static_cast<float>(kPatch) * scale,
                          orientation(image, static_cast<int>(x), static_cast<int>(y)), c.response, level);
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
  std::vector<bool> has_corner_;  // for each cell
};

}  // namespace opencv
APSO_NAMESPACE_END
