/// \file
/// S_spatial, size and position of the objects within the frame: a score of equation (1).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <apso/config.hpp>
#include <apso/quality/score_list.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// Which direction is good: the paper does not say whether a large central object helps or hurts.
enum class SpatialForm {
  BackgroundAvailability,  ///< share of the centre-weighted image that no object hides; 1 without objects
  ObjectObservability      ///< how well the objects themselves are seen; missing without objects
};
constexpr std::array<const char*, 2> enum_names(SpatialForm) { return {"background_availability", "object_observability"}; }

struct SpatialOptions {
  SpatialForm form = SpatialForm::BackgroundAvailability;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("form", s.form);
  }
};

/// Width of the centre weight of S_spatial, in half diagonals: at the corners a pixel counts e^-2 of one in the centre.
inline constexpr double kCentreWeightWidth = 0.5;
/// Side of the blocks over which the occupancy is averaged [px].
inline constexpr int kOccupancyBlock = 8;

namespace detail {
/// Raises the block occupancies to what one object covers of each block.
inline void cover_blocks(const Detection& d, int width, int height, int block, int nx, std::vector<float>& occupancy) {
  const bool by_mask = !d.mask.empty();
  int x0 = 0;
  int y0 = 0;
  int x1 = width;
  int y1 = height;
  Box b;
  if (!by_mask) {
    b = d.box.intersect({0, 0, static_cast<float>(width), static_cast<float>(height)});
    if (!(b.area() > 0) || !std::isfinite(b.x + b.width) || !std::isfinite(b.y + b.height)) return;
    x0 = static_cast<int>(b.x);
    y0 = static_cast<int>(b.y);
    x1 = std::min(width, static_cast<int>(std::ceil(b.x + b.width)));
    y1 = std::min(height, static_cast<int>(std::ceil(b.y + b.height)));
  }
  for (int by = y0 / block; by * block < y1; ++by) {
    const int v0 = by * block;
    const int v1 = std::min(v0 + block, height);
    for (int bx = x0 / block; bx * block < x1; ++bx) {
      const int u0 = bx * block;
      const int u1 = std::min(u0 + block, width);
      float covered = 0;
      if (by_mask) {
        int n = 0;
        for (int v = v0; v < std::min(v1, d.mask.height); ++v) {
          const std::uint8_t* row = d.mask.row(v);
          for (int u = u0; u < std::min(u1, d.mask.width); ++u) n += row[u] != 0;
        }
        covered = static_cast<float>(n);
      } else {
        covered =
            b.intersect({static_cast<float>(u0), static_cast<float>(v0), static_cast<float>(u1 - u0), static_cast<float>(v1 - v0)}).area();
      }
      float& o = occupancy[static_cast<std::size_t>(by) * static_cast<std::size_t>(nx) + static_cast<std::size_t>(bx)];
      o = std::max(o, covered / static_cast<float>((u1 - u0) * (v1 - v0)));
    }
  }
}

inline MaybeQuality object_observability(const std::vector<Detection>& objects, int width, int height) {
  const double w = width;
  const double h = height;
  const double half_diagonal = 0.5 * std::sqrt(w * w + h * h);
  double sum = 0;
  int n = 0;
  for (const Detection& d : objects) {
    if (!d.movable) continue;
    const double whole = static_cast<double>(d.box.area());
    const double seen = static_cast<double>(d.box.intersect({0, 0, static_cast<float>(width), static_cast<float>(height)}).area());
    ++n;
    if (!(whole > 0) || !std::isfinite(whole) || !std::isfinite(seen)) continue;  // scores 0
    const double a = seen / (w * h);
    const double dx = static_cast<double>(d.box.x) + 0.5 * static_cast<double>(d.box.width) - 0.5 * w;
    const double dy = static_cast<double>(d.box.y) + 0.5 * static_cast<double>(d.box.height) - 0.5 * h;
    const double e = clamp01(std::sqrt(dx * dx + dy * dy) / half_diagonal);
    const double size = clamp01((a - 0.002) / (0.02 - 0.002)) * clamp01((0.8 - a) / (0.8 - 0.35));
    sum += size * (1 - 0.5 * e) * clamp01(seen / whole);
  }
  if (n == 0) return std::nullopt;
  return Quality(sum / n);
}
}  // namespace detail

/// S_spatial. BackgroundAvailability: 1 - sum w(p) o(p) / sum w(p) with the occupancy o (union of the objects by
/// maximum, their masks or else their boxes) and the centre weight w(p) = exp(-|p - c|^2 / (2 (kappa d)^2)), d the
/// half diagonal; evaluated on blocks. Only movable objects count.
/// \param kappa   width of the centre weight in half diagonals, infinity = uniform
/// \param scratch working memory, reused from call to call
[[nodiscard]] inline MaybeQuality spatial_score(const std::vector<Detection>& objects, int width, int height, const SpatialOptions& options,
                                                std::vector<float>& scratch, double kappa = kCentreWeightWidth) {
  expects(width > 0 && height > 0, "spatial_score: empty image");
  if (options.form == SpatialForm::ObjectObservability) {
    return detail::object_observability(objects, width, height);
  }
  const int block = kOccupancyBlock;
  const int nx = (width + block - 1) / block;
  const int ny = (height + block - 1) / block;
  bool any = false;
  for (const Detection& d : objects) {
    if (!d.movable) continue;
    if (!any) {
      any = true;
      scratch.assign(static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny), 0.0F);
    }
    detail::cover_blocks(d, width, height, block, nx, scratch);
  }
  if (!any) return Quality(1.0);

  // The weight is a product of one factor per axis; the one of x stands behind the occupancies.
  const double diagonal2 = 0.25 * (static_cast<double>(width) * width + static_cast<double>(height) * height);
  const double k = 1.0 / (2.0 * kappa * kappa * diagonal2);  // 0 for infinite kappa
  const auto axis_weight = [&](int i, int size) {
    const int first = i * block;
    const int last = std::min(first + block, size);
    const double offset = 0.5 * (first + last) - 0.5 * size;
    return (last - first) * std::exp(-k * offset * offset);
  };
  const std::size_t blocks = static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny);
  scratch.resize(blocks + static_cast<std::size_t>(nx));
  float* wx = scratch.data() + blocks;
  for (int x = 0; x < nx; ++x) wx[x] = static_cast<float>(axis_weight(x, width));
  double hidden = 0;
  double all = 0;
  for (int y = 0; y < ny; ++y) {
    const float* o = scratch.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(nx);
    double row_hidden = 0;
    double row_all = 0;
    for (int x = 0; x < nx; ++x) {
      row_hidden += static_cast<double>(wx[x]) * static_cast<double>(o[x]);
      row_all += static_cast<double>(wx[x]);
    }
    const double wy = axis_weight(y, height);
    hidden += wy * row_hidden;
    all += wy * row_all;
  }
  return Quality(all > 0 ? 1.0 - hidden / all : 1.0);
}

/// The same of any range of detections, with working memory of its own.
[[nodiscard]] inline MaybeQuality spatial_score(const AnyDetections& objects, int width, int height, const SpatialOptions& options = {}) {
  std::vector<Detection> buffer;
  std::vector<float> scratch;
  return spatial_score(objects.in(buffer), width, height, options, scratch);
}

/// S_spatial as a score of a list.
struct Spatial {
  static constexpr const char* name = "S_spatial";
  static constexpr double default_weight = 0.10;  // it hardly tells which frames fail (docs/quality.md)
  using Value = Quality;
  using Options = SpatialOptions;
  using Measured = CountedObjects;
  Options options;
  Measured measured;

  MaybeQuality operator()(const FrameContext& frame) {
    measured.objects = static_cast<int>(frame.object_list().size());
    return spatial_score(frame.object_list(), frame.width(), frame.height(), options, scratch_);
  }
  static std::string reason(Quality, const Measured& m) { return m.text(); }

 private:
  std::vector<float> scratch_;
};

APSO_NAMESPACE_END
