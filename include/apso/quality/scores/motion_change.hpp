/// \file
/// S_mc of the paper: the motion residual of S_change (eq. Change Score), from points followed since the reference.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/statistics.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// One point in the reference and in the current frame.
struct Correspondence {
  float reference_x = 0;  ///< [px]
  float reference_y = 0;  ///< [px]
  float x = 0;            ///< in the current frame [px]
  float y = 0;            ///< in the current frame [px]
};

/// Which flow is measured.
enum class FlowKind {
  Raw,      ///< all of it: motion of the camera counts, because an abrupt change of viewpoint is to be found
  Residual  ///< what the best affine flow leaves, which takes most of the camera's own motion out
};
constexpr std::array<const char*, 2> enum_names(FlowKind) { return {"raw", "residual"}; }

struct MotionChangeOptions {
  FlowKind flow = FlowKind::Raw;
  double scale = 0.12;           ///< s_m against the benchmark frame [image diagonals]
  double scale_previous = 0.04;  ///< s_m against the previous frame [image diagonals]
  double trim = 0.10;            ///< share of the flows dropped at each end of the mean, [0, 0.49]
  double full_overlap = 0.5;     ///< share of the reference's points that counts as all of them
  int grid_x = 8;                ///< cells across
  int grid_y = 6;                ///< cells down
  int min_per_cell = 3;          ///< tracks of a valid cell
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("flow", s.flow);
    v("scale", s.scale, 1e-6, 10.0);
    v("scale_previous", s.scale_previous, 1e-6, 10.0);
    v("trim", s.trim, 0.0, 0.49);
    v("full_overlap", s.full_overlap, 1e-3, 1.0);
    v("grid_x", s.grid_x, 1, 64);
    v("grid_y", s.grid_y, 1, 64);
    v("min_per_cell", s.min_per_cell, 1, 1000);
  }
};

struct MotionChange {
  double m_point = 0;  ///< trimmed mean of the flow [image diagonals]
  double m_grid = 0;   ///< mean over the valid cells of the median flow [image diagonals]
  double overlap = 0;  ///< rho_t, [0,1]
  int tracks = 0;      ///< correspondences used
  int cells = 0;       ///< valid cells
  Deviation score{1.0};
};

/// S_mc of the measured numbers: 1 - rho_t exp(-(m_point + m_grid) / 2 / s_m).
[[nodiscard]] inline Deviation motion_deviation(double m_point, double m_grid, double overlap, double scale) {
  return Deviation(1.0 - overlap * std::exp(-0.5 * (m_point + m_grid) / scale));
}

/// The affine flow (2x3, applied to (x, y, 1) of the reference) that fits the correspondences best: four rounds of least
/// squares in which flows far from it count less (Cauchy weights, scale 2 px). Zero for fewer than six of them.
[[nodiscard]] inline Eigen::Matrix<double, 2, 3> affine_flow(const std::vector<Correspondence>& matches) {
  Eigen::Matrix<double, 2, 3> A;
  for (int k = 0; k < 6; ++k) A(k / 3, k % 3) = 0;
  for (int round = 0; round < 4; ++round) {
    double H[3][3] = {};  // lower triangle
    double b[2][3] = {};  // right side of each row of A
    int n = 0;
    for (const Correspondence& m : matches) {
      const double x[3] = {static_cast<double>(m.reference_x), static_cast<double>(m.reference_y), 1};
      const double f[2] = {static_cast<double>(m.x) - x[0], static_cast<double>(m.y) - x[1]};
      if (!std::isfinite(x[0]) || !std::isfinite(x[1]) || !(f[0] * f[0] + f[1] * f[1] <= 1e10)) continue;
      double e[2];
      for (int i = 0; i < 2; ++i) e[i] = f[i] - (A(i, 0) * x[0] + A(i, 1) * x[1] + A(i, 2));
      const double w = round == 0 ? 1.0 : 1.0 / (1.0 + (e[0] * e[0] + e[1] * e[1]) / 4.0);
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j <= i; ++j) H[i][j] += w * x[i] * x[j];
        for (int j = 0; j < 2; ++j) b[j][i] += w * x[i] * f[j];
      }
      ++n;
    }
    if (n < 6) return A;
    for (int i = 0; i < 3; ++i) H[i][i] += 1e-6;
    Eigen::Matrix<double, 2, 3> next;
    for (int j = 0; j < 2; ++j) {
      double L[3][3];
      for (int k = 0; k < 9; ++k) L[k / 3][k % 3] = H[k / 3][k % 3];
      solve_definite(L, 3, b[j]);
      for (int i = 0; i < 3; ++i) next(j, i) = b[j][i];
    }
    if (!all_finite(next)) return A;
    A = next;
  }
  return A;
}

/// Working memory of motion_change.
struct MotionScratch {
  std::vector<double> flows;
  std::vector<double> sorted;
  std::vector<double> cell_flows;
  std::vector<int> cell;
  std::vector<int> first;
};

/// S_mc.
/// Cells are those of the reference frame. Correspondences that are not finite are dropped; none left gives 1.
/// \param reference_points how many points the reference had
/// \param scale            s_m [image diagonals]
[[nodiscard]] inline MotionChange motion_change(const std::vector<Correspondence>& matches, int reference_points,
                                                int width, int height, const MotionChangeOptions& options, double scale,
                                                MotionScratch& scratch) {
  expects(width > 0 && height > 0 && scale > 0, "motion_change: empty image or scale <= 0");
  MotionChange r;
  const double diagonal = std::sqrt(static_cast<double>(width) * width + static_cast<double>(height) * height);
  const int cells = options.grid_x * options.grid_y;
  scratch.flows.clear();
  scratch.cell.clear();
  scratch.first.assign(static_cast<std::size_t>(cells) + 1, 0);
  const Eigen::Matrix<double, 2, 3> ego = options.flow == FlowKind::Residual ? affine_flow(matches) : affine_flow({});
  for (const Correspondence& m : matches) {
    const double u = static_cast<double>(m.reference_x);
    const double v = static_cast<double>(m.reference_y);
    const double dx = static_cast<double>(m.x) - u - (ego(0, 0) * u + ego(0, 1) * v + ego(0, 2));
    const double dy = static_cast<double>(m.y) - v - (ego(1, 0) * u + ego(1, 1) * v + ego(1, 2));
    const double flow = std::sqrt(dx * dx + dy * dy) / diagonal;
    if (!std::isfinite(flow)) continue;
    const double gx = std::clamp(static_cast<double>(m.reference_x) * options.grid_x / width, 0.0, options.grid_x - 1.0);
    const double gy = std::clamp(static_cast<double>(m.reference_y) * options.grid_y / height, 0.0, options.grid_y - 1.0);
    const int g = static_cast<int>(gy) * options.grid_x + static_cast<int>(gx);
    scratch.flows.push_back(flow);
    scratch.cell.push_back(g);
    ++scratch.first[static_cast<std::size_t>(g) + 1];
  }
  r.tracks = static_cast<int>(scratch.flows.size());
  if (r.tracks == 0) return r;
  r.overlap = std::min(1.0, r.tracks / std::max(1.0, options.full_overlap * reference_points));

  scratch.sorted = scratch.flows;
  const auto cut = static_cast<std::ptrdiff_t>(options.trim * r.tracks);
  const auto low = scratch.sorted.begin() + cut;
  const auto high = scratch.sorted.end() - cut;
  std::sort(scratch.sorted.begin(), scratch.sorted.end());
  double sum = 0;
  for (auto i = low; i != high; ++i) sum += *i;
  r.m_point = sum / static_cast<double>(high - low);

  // flows in the order of their cells (counting sort), then the median of each valid cell
  for (std::size_t g = 0; g < static_cast<std::size_t>(cells); ++g) scratch.first[g + 1] += scratch.first[g];
  scratch.cell_flows.resize(scratch.flows.size());
  for (std::size_t i = scratch.flows.size(); i-- > 0;) {
    const auto slot = --scratch.first[static_cast<std::size_t>(scratch.cell[i]) + 1];
    scratch.cell_flows[static_cast<std::size_t>(slot)] = scratch.flows[i];
  }
  // first[g + 1] is now where cell g begins
  double medians = 0;
  for (int g = 0; g < cells; ++g) {
    const int begin = scratch.first[static_cast<std::size_t>(g) + 1];
    const int end = g + 1 < cells ? scratch.first[static_cast<std::size_t>(g) + 2] : r.tracks;
    if (end - begin < options.min_per_cell) continue;
    scratch.sorted.assign(scratch.cell_flows.begin() + begin, scratch.cell_flows.begin() + end);
    medians += median_in_place(scratch.sorted);
    ++r.cells;
  }
  r.m_grid = r.cells > 0 ? medians / r.cells : r.m_point;
  r.score = motion_deviation(r.m_point, r.m_grid, r.overlap, scale);
  return r;
}

APSO_NAMESPACE_END
