/// \file
/// S_feature of the paper: feature response strength and distribution uniformity (eq. quality_score_initial).
/// Only static keypoints count. Measuring and scoring are two steps because the reference response s_ref is a
/// running median of what is measured.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/statistics.hpp>
#include <apso/quality/scores/spread.hpp>
#include <apso/quality/static_pixel.hpp>
#include <apso/types/image_view.hpp>
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
constexpr std::array<const char*, 4> enum_names(Uniformity) {
  return {"entropy_occupancy", "participation", "coverage", "covering"};
}

/// How count, response and uniformity are combined.
enum class FeatureForm {
  Geometric,  ///< sqrt(S_cnt S_resp S_unif)
  Gated,      ///< sqrt(S_cnt) (0.4 S_resp + 0.6 S_unif)
  Linear      ///< 0.3 S_cnt + 0.3 S_resp + 0.4 S_unif
};
constexpr std::array<const char*, 3> enum_names(FeatureForm) { return {"geometric", "gated", "linear"}; }

struct FeatureOptions {
  int n_ref = 500;                   ///< static keypoints of a full count: half of what the detector may give
  int grid_x = 8;                    ///< cells across
  int grid_y = 6;                    ///< cells down
  double cell_valid_fraction = 0.5;  ///< a cell takes part when at least this share of it is static, [0,1]
  ResponseScale response = ResponseScale::Relative;
  double response_floor = 12;   ///< s_ref is never below this (FAST score); keeps blur from calibrating itself
  double half_saturation = 20;  ///< s_0 (FAST score)
  Uniformity uniformity = Uniformity::EntropyOccupancy;
  FeatureForm form = FeatureForm::Geometric;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("n_ref", s.n_ref, 1, 1000000);
    v("grid_x", s.grid_x, 1, 64);
    v("grid_y", s.grid_y, 1, 64);
    v("cell_valid_fraction", s.cell_valid_fraction, 0.0, 1.0);
    v("response", s.response);
    v("response_floor", s.response_floor, 1e-12, 1e12);
    v("half_saturation", s.half_saturation, 1e-12, 1e12);
    v("uniformity", s.uniformity);
    v("form", s.form);
  }
};

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

/// Counts the static keypoints, their responses and their spread over the grid.
/// \param dynamic_probability map of the image's size, or empty: everything is static
[[nodiscard]] inline FeatureMeasure measure_features(const std::vector<Keypoint>& keypoints,
                                                     ImageView<const float> dynamic_probability, int width, int height,
                                                     const FeatureOptions& options, FeatureScratch& scratch) {
  expects(width > 0 && height > 0, "measure_features: empty image");
  FeatureMeasure m;
  const std::size_t cells = static_cast<std::size_t>(options.grid_x) * static_cast<std::size_t>(options.grid_y);
  const auto cell_of = [&](int x, int y) {
    return static_cast<std::size_t>(y * options.grid_y / height) * static_cast<std::size_t>(options.grid_x) +
           static_cast<std::size_t>(x * options.grid_x / width);
  };
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
    ++scratch.cell_count[cell_of(static_cast<int>(std::lround(k.x)), static_cast<int>(std::lround(k.y)))];
  }
  m.static_keypoints = static_cast<int>(scratch.responses.size());
  m.median_response = median_in_place(scratch.responses);

  double static_share = 1;
  scratch.cell_static.assign(cells, 1);
  if (!dynamic_probability.empty()) {  // which cells are static enough, from every fourth pixel both ways
    scratch.cell_static.assign(cells, 0);
    scratch.cell_samples.assign(cells, 0);
    const int step = std::max(1, std::min(4, std::min(width / options.grid_x, height / options.grid_y)));
    for (int y = step / 2; y < height; y += step) {
      const float* row = dynamic_probability.row(y);
      const std::size_t base = cell_of(0, y);
      int x = step / 2;
      for (int gx = 0; gx < options.grid_x; ++gx) {
        const int end = ((gx + 1) * width + options.grid_x - 1) / options.grid_x;  // first x of the next cell
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
    static_share = samples > 0 ? still / samples : 0.0;
    for (std::size_t g = 0; g < cells; ++g) {
      scratch.cell_static[g] =
          scratch.cell_samples[g] > 0 && scratch.cell_static[g] >= options.cell_valid_fraction * scratch.cell_samples[g];
    }
  }
  measure_uniformity(scratch.cell_count, scratch.cell_static, m);
  if (options.uniformity == Uniformity::Coverage) m.spread = coverage_spread(scratch.points, width, height);
  if (options.uniformity == Uniformity::Covering) {
    m.spread = covering_spread(scratch.points, options.n_ref, static_share * width * height, width, height, scratch.kept);
  }
  return m;
}

/// The parts of S_feature.
struct FeatureScore {
  double S_cnt = 0;   ///< count, [0,1]
  double S_resp = 0;  ///< response strength, [0,1]
  double S_unif = 0;  ///< uniformity, [0,1]
  Quality score;      ///< S_feature
};

/// S_feature of what was measured.
/// \param s_ref reference response (ResponseScale::Relative); the floor of the options is applied to it
[[nodiscard]] inline FeatureScore feature_score(const FeatureMeasure& m, double s_ref, const FeatureOptions& options = {}) {
  FeatureScore s;
  s.S_cnt = clamp01(static_cast<double>(m.static_keypoints) / options.n_ref);
  if (m.static_keypoints > 0) {
    s.S_resp = options.response == ResponseScale::Relative
                   ? clamp01(m.median_response / (s_ref > options.response_floor ? s_ref : options.response_floor))
                   : clamp01(m.median_response / (m.median_response + options.half_saturation));
  }
  switch (options.uniformity) {
    case Uniformity::EntropyOccupancy: s.S_unif = 0.5 * (m.entropy + m.occupancy); break;
    case Uniformity::Participation: s.S_unif = m.participation; break;
    case Uniformity::Coverage:
    case Uniformity::Covering: s.S_unif = m.spread; break;
  }
  switch (options.form) {
    case FeatureForm::Geometric: s.score = Quality(std::sqrt(s.S_cnt * s.S_resp * s.S_unif)); break;
    case FeatureForm::Gated: s.score = Quality(std::sqrt(s.S_cnt) * (0.4 * s.S_resp + 0.6 * s.S_unif)); break;
    case FeatureForm::Linear: s.score = Quality(0.3 * s.S_cnt + 0.3 * s.S_resp + 0.4 * s.S_unif); break;
  }
  return s;
}

APSO_NAMESPACE_END
