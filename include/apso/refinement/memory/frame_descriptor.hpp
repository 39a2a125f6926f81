/// \file
/// What a frame is recognised by when references are chosen: the characteristics D (depth) and M (motion) of the paper's
/// eq. (12), on a grid of 8 x 6 cells.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/refinement/pyramid/pyramid_options.hpp>
#include <apso/traits/any.hpp>
#include <apso/traits/ranges.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
inline constexpr int kGridColumns = 8;
inline constexpr int kGridRows = 6;
inline constexpr int kGridCells = kGridColumns * kGridRows;
inline constexpr double kMinCommonCells = 0.3;  // share of the cells; grids that share fewer are not compared
}  // namespace detail

/// Median inverse depth [1/m] of the static part of an image by cell; 0 = unknown.
struct DepthGrid {
  std::array<float, detail::kGridCells> inverse_depth{};
};

/// Mean optical flow (u, v) of the tracks in each cell [px], and how many they are.
struct FlowGrid {
  struct Cell {
    float u = 0, v = 0;
    int tracks = 0;
  };
  std::array<Cell, detail::kGridCells> cells{};
};

struct FrameDescriptor {
  DepthGrid depth;
  FlowGrid flow;  ///< asked for by MotionForm::FlowGrid only
};

/// Makes depth grids. Keeps its buffers.
class DepthDescriber {
 public:
  /// \param depth [m]
  /// \param dynamic_probability any image of the size of the depth, or none
  [[nodiscard]] DepthGrid operator()(const AnyImage& depth, const AnyImage& dynamic_probability = {}, const DepthRange& range = {}) {
    const int w = depth.width();
    const int h = depth.height();
    const bool masked = !dynamic_probability.empty();
    expects(!masked || (dynamic_probability.width() == w && dynamic_probability.height() == h),
            "DepthDescriber: depth and dynamic probability differ in size");
    DepthGrid grid;
    const int step = std::max(1, w / 160);
    depth_row_.resize(static_cast<std::size_t>(w));
    probability_row_.resize(masked ? static_cast<std::size_t>(w) : 0);
    for (int r = 0; r < detail::kGridRows; ++r) {
      std::array<int, detail::kGridColumns> looked_at{};
      for (std::vector<float>& v : values_) v.clear();
      for (int y = h * r / detail::kGridRows; y < h * (r + 1) / detail::kGridRows; y += step) {
        const float* z = row(depth, y, depth_row_);
        const float* p = masked ? row(dynamic_probability, y, probability_row_) : nullptr;
        for (std::size_t c = 0; c < values_.size(); ++c) {
          const int column = static_cast<int>(c);
          for (int x = w * column / detail::kGridColumns; x < w * (column + 1) / detail::kGridColumns; x += step) {
            ++looked_at[c];
            if (!depth_valid(z[x], range)) continue;
            if (masked && !(p[x] < kPotentialProbability)) continue;
            values_[c].push_back(1.0F / z[x]);
          }
        }
      }
      for (std::size_t c = 0; c < values_.size(); ++c) {
        const bool enough = values_[c].size() >= 4 && values_[c].size() * 10 >= static_cast<std::size_t>(looked_at[c]);
        grid.inverse_depth[static_cast<std::size_t>(r) * values_.size() + c] = enough ? upper_median(values_[c]) : 0.0F;
      }
    }
    return grid;
  }

 private:
  static const float* row(const AnyImage& image, int y, std::vector<float>& buffer) {
    if (const float* in_place = image.row_in_place(y)) return in_place;
    image.read_row(y, buffer.data(), 1);
    return buffer.data();
  }
  std::array<std::vector<float>, detail::kGridColumns> values_;  // of a row of cells
  std::vector<float> depth_row_, probability_row_;
};

/// The depth grid of one image.
template <class DepthT, class ProbabilityT = None>
[[nodiscard]] DepthGrid depth_grid(const DepthT& depth, const ProbabilityT& dynamic_probability = none, const DepthRange& range = {}) {
  return DepthDescriber()(AnyImage(depth), AnyImage(dynamic_probability), range);
}

/// The flow grid of the tracks of a frame.
/// \param tracks any range of tracks; those that begin in this frame say nothing
/// \param width,height of the image [px]
template <class Tracks>
[[nodiscard]] FlowGrid flow_grid(const Tracks& tracks, int width, int height) {
  expects(width > 0 && height > 0, "flow_grid: the image is empty");
  FlowGrid grid;
  for_each_track(tracks, [&](const PointTrack& t) {
    const bool inside = t.x >= 0 && t.y >= 0 && t.x < static_cast<float>(width) && t.y < static_cast<float>(height);
    if (t.age < 1 || !inside) return;
    const int column = static_cast<int>(t.x) * detail::kGridColumns / width;
    const int row = static_cast<int>(t.y) * detail::kGridRows / height;
    FlowGrid::Cell& cell = grid.cells[static_cast<std::size_t>(row * detail::kGridColumns + column)];
    cell.u += t.x - t.previous_x;
    cell.v += t.y - t.previous_y;
    ++cell.tracks;
  });
  for (FlowGrid::Cell& cell : grid.cells) {
    const float n = cell.tracks > 0 ? static_cast<float>(cell.tracks) : 1.0F;
    cell.u /= n;
    cell.v /= n;
  }
  return grid;
}

namespace detail {
// Root mean square of f(cell), which is nothing where a cell is not known in both grids.
template <class F>
[[nodiscard]] std::optional<double> grid_distance(const F& squared_difference) {
  double sum = 0;
  int n = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(kGridCells); ++i) {
    if (const std::optional<double> d = squared_difference(i)) {
      sum += *d;
      ++n;
    }
  }
  if (n == 0 || n < kMinCommonCells * static_cast<double>(kGridCells)) return std::nullopt;
  return std::sqrt(sum / n);
}
}  // namespace detail

/// Root mean square difference over the cells known in both [1/m]; nothing if these are fewer than 30 % of all.
[[nodiscard]] inline std::optional<double> grid_distance(const DepthGrid& a, const DepthGrid& b) {
  return detail::grid_distance([&](std::size_t i) -> std::optional<double> {
    if (!(a.inverse_depth[i] > 0) || !(b.inverse_depth[i] > 0)) return std::nullopt;
    const double d = static_cast<double>(a.inverse_depth[i]) - static_cast<double>(b.inverse_depth[i]);
    return d * d;
  });
}
/// The same of the mean flow [px].
[[nodiscard]] inline std::optional<double> grid_distance(const FlowGrid& a, const FlowGrid& b) {
  return detail::grid_distance([&](std::size_t i) -> std::optional<double> {
    if (a.cells[i].tracks == 0 || b.cells[i].tracks == 0) return std::nullopt;
    const auto u = static_cast<double>(a.cells[i].u - b.cells[i].u);
    const auto v = static_cast<double>(a.cells[i].v - b.cells[i].v);
    return u * u + v * v;
  });
}

APSO_NAMESPACE_END
