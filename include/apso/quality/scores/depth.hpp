/// \file
/// S_depth, coverage, consistency and smoothness of the depth image: a score of equation (1).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <apso/config.hpp>
#include <apso/quality/score_list.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// Standard deviation of a measured depth.
enum class DepthNoise {
  Khoshelham,  ///< max(1 mm, 1.425e-3 z^2), Khoshelham & Elberink, Sensors 2012
  Nguyen       ///< 0.0012 + 0.0019 (z - 0.4)^2, Nguyen, Izadi & Lovell, 3DIMPVT 2012
};
constexpr std::array<const char*, 2> enum_names(DepthNoise) { return {"khoshelham", "nguyen"}; }

struct DepthQualityOptions {
  DepthNoise noise = DepthNoise::Khoshelham;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("noise", s.noise);
  }
};

/// Pixels at the edge of the image that S_depth leaves out [px]: registration leaves no depth there.
inline constexpr int kDepthBorder = 8;
/// S_depth judges every fourth pixel both ways, for a sixteenth of the time.
inline constexpr int kDepthStride = 4;
/// Share of valid pixels from which the coverage is full: edges and dark surfaces give no depth in any indoor scene.
inline constexpr double kFullCoverage = 0.8;

/// The parts of S_depth.
struct DepthScore {
  double S_cov = 0;   ///< coverage, [0,1]
  double S_cons = 0;  ///< consistency with the 3x3 neighbours, [0,1]
  double S_smo = 0;   ///< smoothness of the inverse depth, [0,1]
  int valid = 0;      ///< judged pixels with a valid depth
  int judged = 0;     ///< judged pixels
  Quality score;      ///< S_depth
};

/// The parts of S_depth with a noise model of the user, the parts weighted 2 : 1 : 1.
/// Consistent: at least 5 of 8 neighbours are valid and the median of the 3x3 pixels is within 3 sigma. (Tested by
/// counting: at most half of the values lie above the band and at most half below it.)
/// Smooth: the second difference of 1/z, which is 0 on every plane however slanted, is within 3 sqrt(6) sigma of
/// 1/z in u and in v; over pixels whose four neighbours are valid.
/// \param sigma callable: depth [m] -> standard deviation [m], > 0
/// \param scratch working memory for rows that are not floats
template <class Sigma>
[[nodiscard]] DepthScore depth_score_by(const AnyImage& depth, const DepthRange& range, Sigma&& sigma, std::vector<float>& scratch) {
  DepthScore s;
  if (depth.empty()) return s;
  auto row = rows(depth, scratch, 3);
  constexpr int border = kDepthBorder;
  int consistent = 0;
  int smooth = 0;
  int crosses = 0;
  for (int y = border; y < depth.height() - border; y += kDepthStride) {
    const float* up = row(y - 1);
    const float* mid = row(y);
    const float* down = row(y + 1);
    for (int x = border; x < depth.width() - border; x += kDepthStride) {
      ++s.judged;
      const float z = mid[x];
      if (!depth_valid(z, range)) continue;
      ++s.valid;
      const float sz = static_cast<float>(sigma(z));
      const float low = z - 3 * sz;
      const float high = z + 3 * sz;
      const std::array<float, 8> n{mid[x - 1], mid[x + 1], up[x], down[x], up[x - 1], up[x + 1], down[x - 1], down[x + 1]};
      int valid = 0;
      int above = 0;
      int below = 0;
      for (const float v : n) {
        const int ok = static_cast<int>(v >= range.min) & static_cast<int>(v <= range.max) & static_cast<int>(v > 0.0F);
        valid += ok;
        above += ok & static_cast<int>(v > high);
        below += ok & static_cast<int>(v < low);
      }
      // the centre is a ninth value and lies inside the band
      consistent += static_cast<int>(valid >= 5 && 2 * above <= valid + 1 && 2 * below <= valid + 1);
      if (valid == 8 || (depth_valid(n[0], range) && depth_valid(n[1], range) && depth_valid(n[2], range) && depth_valid(n[3], range))) {
        ++crosses;
        const float rho = 1 / z;
        const float limit = 3 * 2.44948974F * sz * rho * rho;
        smooth += static_cast<int>(std::abs(1 / n[0] - 2 * rho + 1 / n[1]) <= limit && std::abs(1 / n[2] - 2 * rho + 1 / n[3]) <= limit);
      }
    }
  }
  if (s.valid == 0) return s;
  s.S_cov = clamp01(static_cast<double>(s.valid) / s.judged / kFullCoverage);
  s.S_cons = static_cast<double>(consistent) / s.valid;
  s.S_smo = crosses > 0 ? static_cast<double>(smooth) / crosses : 0.0;
  s.score = Quality(0.5 * s.S_cov + 0.25 * s.S_cons + 0.25 * s.S_smo);
  return s;
}

/// The parts of S_depth of any image in metres. Without a valid pixel all are 0; an empty image is the caller's "missing".
[[nodiscard]] inline DepthScore depth_score(const AnyImage& depth, const DepthQualityOptions& options, const DepthRange& range,
                                            std::vector<float>& scratch) {
  if (options.noise == DepthNoise::Nguyen) {
    return depth_score_by(
        depth, range, [](float z) { return 0.0012F + 0.0019F * (z - 0.4F) * (z - 0.4F); }, scratch);
  }
  return depth_score_by(
      depth, range, [](float z) { return depth_sigma(z); }, scratch);
}
/// The same with working memory of its own.
[[nodiscard]] inline DepthScore depth_score(const AnyImage& depth, const DepthQualityOptions& options = {}, const DepthRange& range = {}) {
  std::vector<float> scratch;
  return depth_score(depth, options, range, scratch);
}

/// S_depth as a score of a list.
struct Depth {
  static constexpr const char* name = "S_depth";
  static constexpr double default_weight = 0.30;  // enough that a frame without any depth is noticed
  using Value = Quality;
  using Options = DepthQualityOptions;
  struct Measured {
    double S_cov = 0;   ///< coverage, [0,1]
    double S_cons = 0;  ///< consistency, [0,1]
    double S_smo = 0;   ///< smoothness, [0,1]
    template <class Self, class V>
    static void columns(Self& m, V&& column) {
      column("S_cov", m.S_cov);
      column("S_cons", m.S_cons);
      column("S_smo", m.S_smo);
    }
  };
  Options options;
  Measured measured;

  MaybeQuality operator()(const FrameContext& frame) {
    measured = {};
    if (frame.depth.empty()) return std::nullopt;
    const DepthScore s = depth_score(frame.depth, options, frame.depth_range, scratch_);
    measured = {s.S_cov, s.S_cons, s.S_smo};
    return s.score;
  }
  static std::string reason(Quality, const Measured& m) {
    return "coverage " + two_digits(m.S_cov) + ", consistency " + two_digits(m.S_cons) + ", smoothness " + two_digits(m.S_smo);
  }

 private:
  std::vector<float> scratch_;
};

APSO_NAMESPACE_END
