/// \file
/// At which distance a view falls into what stands in front and what is behind.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/refinement/pyramid/pixel_list.hpp>

APSO_NAMESPACE_BEGIN

/// Splits the tiles of one or more references by their distance. Keeps its buffer.
class DepthSplit {
 public:
  /// A distance, and what lies beyond it.
  struct At {
    float distance = 0;  ///< [m]; 0: there is nothing to split
    double beyond = 0;   ///< share of all pixels
  };

  void clear() { tiles_.clear(); }
  void add(const PixelList& list) {
    for (const PixelList::Tile& t : list.tiles) {
      if (t.count > 0 && t.depth > 0) tiles_.push_back({1 / static_cast<double>(t.depth), static_cast<double>(t.count)});
    }
  }
  /// Call it once after the last add().
  void sort() {
    std::sort(tiles_.begin(), tiles_.end(), [](const Tile& a, const Tile& b) { return a.inverse_depth < b.inverse_depth; });
  }
  /// Two classes of inverse depths that differ most, by the variance between them (Otsu, A threshold selection method from gray-level
  /// histograms, 1979). O(n), n tiles.
  /// \param nearest what is nearer is left out of both, but counts among all pixels [m]
  [[nodiscard]] At find(float nearest = 0) const {
    double all = 0;
    double pixels = 0;  // of both classes
    double sum = 0;
    std::size_t n = 0;
    for (const Tile& t : tiles_) {
      all += t.pixels;
      if (nearest > 0 && t.inverse_depth * static_cast<double>(nearest) > 1) continue;
      pixels += t.pixels;
      sum += t.pixels * t.inverse_depth;
      ++n;
    }
    At best;
    double most = 0;
    double far_pixels = 0;
    double far_sum = 0;
    for (std::size_t i = 0; i + 1 < n; ++i) {
      far_pixels += tiles_[i].pixels;
      far_sum += tiles_[i].pixels * tiles_[i].inverse_depth;
      const double near_pixels = pixels - far_pixels;
      const double apart = far_sum / far_pixels - (sum - far_sum) / near_pixels;
      const double between = far_pixels * near_pixels * apart * apart;
      if (between <= most) continue;
      most = between;
      best = {static_cast<float>(2 / (tiles_[i].inverse_depth + tiles_[i + 1].inverse_depth)), far_pixels / all};
    }
    return best;
  }

 private:
  struct Tile {
    double inverse_depth;  // [1/m]
    double pixels;
  };
  std::vector<Tile> tiles_;  // farthest first
};

APSO_NAMESPACE_END
