/// \file
/// Corners of one frame, matched with those of another by normalised correlation.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/refinement/pyramid/plane.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>

APSO_NAMESPACE_BEGIN

/// A point that both frames show, if the match is right.
struct CornerMatch {
  Eigen::Vector3f p, q;  ///< in the camera of the reference, of the current frame [m]
  float pixel;           ///< of the level it was found at, as a tangent: 1 / fx
};

/// Matches corners. Those of the reference (Shi and Tomasi, CVPR 1994), one per cell so that they cover the view, are
/// compared with every pixel of the current image that has texture in two directions: the best corner of a cell is too
/// often the best of no cell in the other image. A match is a pair of which each is the other's best by normalised
/// correlation; its position in the current image is refined to a fraction of a pixel. Keeps its buffers.
class CornerMatcher {
 public:
  /// Adds the matches of one level of both frames. Where there are few corners the cells are smaller.
  /// \return number of corners of the reference in cells of the larger size
  std::size_t operator()(const PyramidLevel& reference, const PyramidLevel& current, std::vector<CornerMatch>& matches) {
    detect(reference, Choice::Best, kCell, reference_);
    const std::size_t corners = reference_.size();
    if (corners < kMinCorners) detect(reference, Choice::Best, kSmallCell, reference_);
    best_.assign(reference_.size(), Best{});
    detect(current, Choice::All, kCell, current_);
    match_mutually();
    for (std::size_t i = 0; i < reference_.size(); ++i) {
      if (!best_[i].mutual) continue;
      const Pixel& from = reference_.pixels[i];
      const Pixel& to = best_[i].at;
      const std::array<float, 2> offset = subpixel_offset(i, current, to);
      matches.push_back(
          {back_project(reference, from, {0, 0}), back_project(current, to, offset), 1.0F / static_cast<float>(current.camera.fx)});
    }
    return corners;
  }

 private:
  static constexpr std::size_t kMinCorners = 200;  // with fewer the cells are smaller
  static constexpr int kCell = 8;                  // [px]
  static constexpr int kSmallCell = 4;             // [px]
  static constexpr float kMinCorrelation = 0.65F;  // of a match
  static constexpr float kMinCornerness = 1e-3F;   // that of nine pixels with gradients of 1 % of the brightness
  static constexpr int kSide = 8;                  // of a patch [px]
  static constexpr int kHalf = kSide / 2;
  static constexpr int kPatch = kSide * kSide;
  static constexpr std::size_t kBlock = 1024;  // corners of the current image that are kept at a time

  struct Pixel {
    int x, y;
  };
  struct Corners {
    std::vector<Pixel> pixels;
    std::vector<float> patches;  // kLanes of them at a time, pixel by pixel, the rest 0
    [[nodiscard]] std::size_t size() const { return pixels.size(); }
    [[nodiscard]] const float* patch(std::size_t i) const { return patches.data() + i / kLanes * kPatch * kLanes + i % kLanes; }
  };

  // The pixel of the current image that is most like a corner of the reference so far.
  struct Best {
    float correlation = kMinCorrelation;
    Pixel at{0, 0};
    bool mutual = false;  // no corner of the reference is more like that pixel
  };

  // The best corner of each cell, or all its pixels that could be one: these are matched block by block.
  enum class Choice { Best, All };
  APSO_NOINLINE void detect(const PyramidLevel& level, Choice choice, int cell, Corners& out) {
    const int w = level.intensity.width();
    const int h = level.intensity.height();
    out.pixels.clear();
    out.patches.clear();
    for (int y0 = kHalf; y0 + cell <= h - kHalf; y0 += cell) {
      for (int x0 = kHalf; x0 + cell <= w - kHalf; x0 += cell) {
        float best = kMinCornerness;
        Pixel at{0, 0};
        for (int y = y0; y < y0 + cell; ++y) {
          for (int x = x0; x < x0 + cell; ++x) {
            if (!(level.depth.row(y)[x] > 0)) continue;
            const float s = cornerness(level.intensity, x, y);
            if (choice == Choice::All && s > kMinCornerness) {
              add(level, {x, y}, out);
              if (out.size() == kBlock) match_mutually();
            }
            if (s > best) {
              best = s;
              at = {x, y};
            }
          }
        }
        if (choice == Choice::Best && best > kMinCornerness) add(level, at, out);
      }
    }
  }

  // Smaller eigenvalue of the structure tensor over 3 x 3 pixels [1/px^2].
  static float cornerness(const Plane& image, int x, int y) {
    float xx = 0;
    float xy = 0;
    float yy = 0;
    for (int v = y - 1; v <= y + 1; ++v) {
      const float* r = image.row(v);
      const float* above = image.row(v - 1);
      const float* below = image.row(v + 1);
      for (int u = x - 1; u <= x + 1; ++u) {
        const float gx = 0.5F * (r[u + 1] - r[u - 1]);
        const float gy = 0.5F * (below[u] - above[u]);
        xx += gx * gx;
        xy += gx * gy;
        yy += gy * gy;
      }
    }
    return 0.5F * (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy));
  }

  // The patch around a pixel, of mean 0 and length 1, without what is masked.
  // \return whether enough of it is inside the image and not masked
  static bool extract_patch(const PyramidLevel& level, Pixel at, std::array<float, kPatch>& patch) {
    if (at.x < kHalf || at.y < kHalf || at.x + kHalf > level.intensity.width() || at.y + kHalf > level.intensity.height()) {
      return false;
    }
    std::array<float, kPatch> seen;
    float sum = 0;
    float n = 0;
    for (std::size_t i = 0; i < kPatch; ++i) {
      const int u = at.x - kHalf + static_cast<int>(i) % kSide;
      const int v = at.y - kHalf + static_cast<int>(i) / kSide;
      seen[i] = level.gamma.empty() || level.gamma.row(v)[u] > 0 ? 1.0F : 0.0F;
      patch[i] = level.intensity.row(v)[u];
      sum += seen[i] * patch[i];
      n += seen[i];
    }
    if (4 * n < 3 * kPatch) return false;
    const float mean = sum / n;
    float squares = 0;
    for (std::size_t i = 0; i < kPatch; ++i) {
      patch[i] = seen[i] * (patch[i] - mean);
      squares += patch[i] * patch[i];
    }
    const float scale = squares > 0 ? 1.0F / std::sqrt(squares) : 0.0F;
    for (float& v : patch) v *= scale;
    return true;
  }

  static void add(const PyramidLevel& level, Pixel at, Corners& out) {
    std::array<float, kPatch> patch;
    if (!extract_patch(level, at, patch)) return;
    const std::size_t lane = out.size() % kLanes;
    if (lane == 0) out.patches.resize(out.patches.size() + kPatch * kLanes, 0.0F);
    float* to = out.patches.data() + out.patches.size() - kPatch * kLanes + lane;
    for (std::size_t i = 0; i < kPatch; ++i) to[i * kLanes] = patch[i];
    out.pixels.push_back(at);
  }

  // Compares the corners of the current image that are at hand with all of the reference, and forgets them: an image full of corners
  // takes no more memory than another.
  void match_mutually() {
    constexpr int kAtOnce = 4;  // of the reference, beside kLanes of the current image
    const std::size_t n = reference_.size();
    const std::size_t groups = (current_.size() + kLanes - 1) / kLanes;
    best_of_current_.assign(groups * kLanes, kMinCorrelation);
    match_of_current_.assign(groups * kLanes, -1.0F);
    match_of_reference_.assign(n, -1.0F);
    for (std::size_t first = 0; first < n; first += kAtOnce) {
      const int count = static_cast<int>(std::min<std::size_t>(kAtOnce, n - first));
      float a[kPatch][kAtOnce] = {};
      for (int r = 0; r < count; ++r) {
        const float* from = reference_.patch(first + static_cast<std::size_t>(r));
        for (int k = 0; k < kPatch; ++k) a[k][r] = from[k * kLanes];
      }
      Lanes best[kAtOnce], group[kAtOnce];
      std::fill(best, best + kAtOnce, Lanes(kMinCorrelation));
      std::fill(group, group + kAtOnce, Lanes(-1.0F));
      for (std::size_t g = 0; g < groups; ++g) {
        const float* b = current_.patch(g * kLanes);
        Lanes c[kAtOnce];
        std::fill(c, c + kAtOnce, Lanes(0.0F));
        for (int k = 0; k < kPatch; ++k) {
          const Lanes v = Lanes::load(b + k * kLanes);
          for (int r = 0; r < kAtOnce; ++r) c[r] += v * a[k][r];
        }
        Lanes most = Lanes::load(best_of_current_.data() + g * kLanes);
        Lanes partner = Lanes::load(match_of_current_.data() + g * kLanes);
        for (int r = 0; r < kAtOnce; ++r) {
          const Mask nearer = c[r] > most;
          most = select(nearer, c[r], most);
          partner = select(nearer, Lanes(static_cast<float>(first) + static_cast<float>(r)), partner);
          const Mask better = c[r] > best[r];
          best[r] = select(better, c[r], best[r]);
          group[r] = select(better, Lanes(static_cast<float>(g)), group[r]);
        }
        most.store(best_of_current_.data() + g * kLanes);
        partner.store(match_of_current_.data() + g * kLanes);
      }
      for (int r = 0; r < count; ++r) {  // the first of equal ones
        float& most = best_[first + static_cast<std::size_t>(r)].correlation;
        float& at = match_of_reference_[first + static_cast<std::size_t>(r)];
        for (int lane = 0; lane < kLanes; ++lane) {
          const float j = group[r][lane] * kLanes + static_cast<float>(lane);
          if (group[r][lane] < 0 || best[r][lane] < most || (best[r][lane] == most && (at < 0 || j > at))) continue;
          most = best[r][lane];
          at = j;
        }
      }
    }
    for (std::size_t i = 0; i < n; ++i) {
      if (match_of_reference_[i] < 0) continue;
      const auto j = static_cast<std::size_t>(match_of_reference_[i]);
      best_[i].at = current_.pixels[j];
      best_[i].mutual = match_of_current_[j] == static_cast<float>(i);
    }
    current_.pixels.clear();
    current_.patches.clear();
  }

  // How far from a pixel a corner of the reference correlates most: the top of a parabola through neighbours in x, and
  // in y [px].
  [[nodiscard]] std::array<float, 2> subpixel_offset(std::size_t of_reference, const PyramidLevel& current, Pixel at) const {
    const float* a = reference_.patch(of_reference);
    const auto correlation = [&](int x, int y) {
      std::array<float, kPatch> b;
      if (!extract_patch(current, {x, y}, b)) return -1.0F;
      float sum = 0;
      for (std::size_t k = 0; k < kPatch; ++k) sum += a[k * kLanes] * b[k];
      return sum;
    };
    const float middle = correlation(at.x, at.y);
    const auto top = [&](float before, float after) {
      const float bend = before - 2 * middle + after;
      if (!(bend < 0) || before <= -1 || after <= -1) return 0.0F;
      return std::clamp(0.5F * (before - after) / bend, -0.5F, 0.5F);
    };
    return {top(correlation(at.x - 1, at.y), correlation(at.x + 1, at.y)), top(correlation(at.x, at.y - 1), correlation(at.x, at.y + 1))};
  }

  static Eigen::Vector3f back_project(const PyramidLevel& level, Pixel at, std::array<float, 2> offset) {
    const float z = level.depth.row(at.y)[at.x];
    const float x = static_cast<float>(at.x) + offset[0] - static_cast<float>(level.camera.cx);
    const float y = static_cast<float>(at.y) + offset[1] - static_cast<float>(level.camera.cy);
    return {x / static_cast<float>(level.camera.fx) * z, y / static_cast<float>(level.camera.fy) * z, z};
  }

  Corners reference_, current_;
  std::vector<Best> best_;  // of each corner of the reference
  // Correlations, and numbers of patches, -1 = none; floats hold them, exactly as far as there are pixels.
  std::vector<float> best_of_current_, match_of_current_, match_of_reference_;
};

APSO_NAMESPACE_END
