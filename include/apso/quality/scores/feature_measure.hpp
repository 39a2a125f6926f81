/// \file
/// What S_feature is made of: number, response and spread of the static keypoints, counted on a grid.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/statistics.hpp>
#include <apso/quality/frame_context.hpp>
#include <apso/quality/scores/spread.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// What a median response is compared with.
enum class ResponseScale {
  Relative,       ///< min(1, median / s_ref), s_ref the running median of earlier frames
  HalfSaturation  ///< median / (median + s_0)
};
constexpr std::array<const char*, 2> enum_names(ResponseScale) { return {"relative", "half_saturation"}; }

/// How evenly the keypoints lie.
enum class Uniformity {
  EntropyOccupancy,  ///< (S_ent + S_occ) / 2
  Participation,     ///< S_par = (sum c)^2 / (|V| sum c^2)
  Coverage,          ///< harmonic mean distance, see coverage_spread; slow
  Covering           ///< suppression by square covering, see covering_spread
};
constexpr std::array<const char*, 4> enum_names(Uniformity) { return {"entropy_occupancy", "participation", "coverage", "covering"}; }

/// How count, response and uniformity are combined.
enum class FeatureForm {
  Geometric,  ///< sqrt(S_cnt S_resp S_unif)
  Gated,      ///< sqrt(S_cnt) (0.4 S_resp + 0.6 S_unif)
  Linear      ///< 0.3 S_cnt + 0.3 S_resp + 0.4 S_unif
};
constexpr std::array<const char*, 3> enum_names(FeatureForm) { return {"geometric", "gated", "linear"}; }

struct FeatureOptions {
  int n_ref = 500;  ///< static keypoints of a full count: half of what the detector may give
  ResponseScale response = ResponseScale::Relative;
  double response_floor = 12;  ///< s_ref is never below this (FAST score); keeps blur from calibrating itself
  Uniformity uniformity = Uniformity::EntropyOccupancy;
  FeatureForm form = FeatureForm::Geometric;
  bool sharpness = true;  ///< S_feature is multiplied by S_sharp; false: from keypoints alone, as printed
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("n_ref", s.n_ref, 1, 1000000);
    v("response", s.response);
    v("response_floor", s.response_floor, 1e-12, 1e12);
    v("uniformity", s.uniformity);
    v("form", s.form);
    v("sharpness", s.sharpness);
  }
};

/// Cells of the grid on which uniformity is measured: 80 px at 640x480.
inline constexpr int kFeatureGridX = 8;
inline constexpr int kFeatureGridY = 6;
/// A cell takes part when at least this share of it is static, so that a masked person is not punished twice.
inline constexpr double kValidCellShare = 0.5;
/// s_0 of ResponseScale::HalfSaturation (FAST score): the first threshold of the detector of ORB-SLAM.
inline constexpr double kHalfSaturation = 20;

/// What is counted on the keypoints of one frame.
struct FeatureMeasure {
  int keypoints = 0;           ///< all with a position in the image
  int static_keypoints = 0;    ///< N
  int valid_cells = 0;         ///< |V|
  int occupied_cells = 0;      ///< cells of V with at least one static keypoint
  double median_response = 0;  ///< of the static keypoints
  double entropy = 0;          ///< S_ent, normalised entropy over V, [0,1]
  double occupancy = 0;        ///< S_occ, [0,1]
  double participation = 0;    ///< S_par, [0,1]
  double spread = 0;           ///< of the policies Coverage and Covering, [0,1]; else 0
};

/// Working memory of measure_features.
struct FeatureScratch {
  std::vector<double> responses;
  std::vector<int> cell_count;
  std::vector<int> cell_static;
  std::vector<int> cell_samples;
  std::vector<Keypoint> points;
  std::vector<int> kept;
  std::vector<float> row;
};

/// Uniformity of counts over cells: entropy, occupancy, participation. 0 for fewer than two cells or no keypoint.
/// \param counts keypoints per cell
/// \param used   nonzero = the cell belongs to V
inline void measure_uniformity(const std::vector<int>& counts, const std::vector<int>& used, FeatureMeasure& m) {
  double sum = 0;
  double squares = 0;
  m.valid_cells = m.occupied_cells = 0;
  m.entropy = m.occupancy = m.participation = 0;
  for (std::size_t g = 0; g < counts.size(); ++g) {
    if (!used[g]) continue;
    ++m.valid_cells;
    m.occupied_cells += counts[g] > 0;
    sum += counts[g];
    squares += static_cast<double>(counts[g]) * counts[g];
  }
  if (m.valid_cells < 2 || !(sum > 0)) return;
  for (std::size_t g = 0; g < counts.size(); ++g) {
    if (!used[g] || counts[g] <= 0) continue;
    const double p = counts[g] / sum;
    m.entropy -= p * std::log(p);
  }
  m.entropy = clamp01(m.entropy / std::log(static_cast<double>(m.valid_cells)));
  m.occupancy = static_cast<double>(m.occupied_cells) / m.valid_cells;
  m.participation = clamp01(sum * sum / (m.valid_cells * squares));
}

namespace detail {
inline std::size_t feature_cell(int x, int y, int width, int height) {
  return static_cast<std::size_t>(y * kFeatureGridY / height) * static_cast<std::size_t>(kFeatureGridX) +
         static_cast<std::size_t>(x * kFeatureGridX / width);
}

/// Which cells are static enough, from every fourth pixel both ways; into scratch.cell_static.
/// \return the static share of the image
inline double find_static_cells(const AnyImage& dynamic_probability, int width, int height, FeatureScratch& scratch) {
  constexpr std::size_t cells = std::size_t{kFeatureGridX} * kFeatureGridY;
  scratch.cell_static.assign(cells, 0);
  scratch.cell_samples.assign(cells, 0);
  auto dynamic_row = rows(dynamic_probability, scratch.row);
  const int step = std::max(1, std::min(4, std::min(width / kFeatureGridX, height / kFeatureGridY)));
  for (int y = step / 2; y < height; y += step) {
    const float* row = dynamic_row(y);
    const std::size_t base = feature_cell(0, y, width, height);
    int x = step / 2;
    for (int gx = 0; gx < kFeatureGridX; ++gx) {
      const int end = ((gx + 1) * width + kFeatureGridX - 1) / kFeatureGridX;  // first x of the next cell
      int n = 0;
      int n_static = 0;
      for (; x < end && x < width; x += step) {
        ++n;
        n_static += row[x] < kDynamicThreshold;
      }
      scratch.cell_samples[base + static_cast<std::size_t>(gx)] += n;
      scratch.cell_static[base + static_cast<std::size_t>(gx)] += n_static;
    }
  }
  double samples = 0;
  double still = 0;
  for (std::size_t g = 0; g < cells; ++g) {
    samples += scratch.cell_samples[g];
    still += scratch.cell_static[g];
  }
  for (std::size_t g = 0; g < cells; ++g) {
    scratch.cell_static[g] = scratch.cell_samples[g] > 0 && scratch.cell_static[g] >= kValidCellShare * scratch.cell_samples[g];
  }
  return samples > 0 ? still / samples : 0.0;
}
}  // namespace detail

/// Counts the static keypoints, their responses and their spread over the grid.
/// \param dynamic_probability map of the image's size, or empty: everything is static
[[nodiscard]] inline FeatureMeasure measure_features(const std::vector<Keypoint>& keypoints, const AnyImage& dynamic_probability, int width,
                                                     int height, const FeatureOptions& options, FeatureScratch& scratch) {
  expects(width > 0 && height > 0, "measure_features: empty image");
  FeatureMeasure m;
  constexpr std::size_t cells = std::size_t{kFeatureGridX} * kFeatureGridY;
  scratch.cell_count.assign(cells, 0);
  scratch.responses.clear();
  scratch.points.clear();
  const bool by_points = options.uniformity == Uniformity::Coverage || options.uniformity == Uniformity::Covering;
  for (const Keypoint& k : keypoints) {
    if (!is_static_point({}, width, height, k.x, k.y)) continue;
    ++m.keypoints;
    if (!is_static_point(dynamic_probability, width, height, k.x, k.y)) continue;
    const double response = static_cast<double>(k.response);
    scratch.responses.push_back(std::isfinite(response) && response > 0 ? response : 0.0);
    if (by_points) scratch.points.push_back({k.x, k.y, static_cast<float>(scratch.responses.back()), 0, 0});
    ++scratch.cell_count[detail::feature_cell(static_cast<int>(std::lround(k.x)), static_cast<int>(std::lround(k.y)), width, height)];
  }
  m.static_keypoints = static_cast<int>(scratch.responses.size());
  m.median_response = median_in_place(scratch.responses);

  double static_share = 1;
  scratch.cell_static.assign(cells, 1);
  if (!dynamic_probability.empty()) static_share = detail::find_static_cells(dynamic_probability, width, height, scratch);
  measure_uniformity(scratch.cell_count, scratch.cell_static, m);
  if (options.uniformity == Uniformity::Coverage) m.spread = coverage_spread(scratch.points, width, height);
  if (options.uniformity == Uniformity::Covering) {
    m.spread = covering_spread(scratch.points, options.n_ref, static_share * width * height, width, height, scratch.kept);
  }
  return m;
}
/// The same of any range of keypoints, with working memory of its own.
[[nodiscard]] inline FeatureMeasure measure_features(const AnyKeypoints& keypoints, const AnyImage& dynamic_probability, int width,
                                                     int height, const FeatureOptions& options = {}) {
  std::vector<Keypoint> buffer;
  FeatureScratch scratch;
  return measure_features(keypoints.in(buffer), dynamic_probability, width, height, options, scratch);
}

APSO_NAMESPACE_END
