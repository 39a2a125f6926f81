/// \file
/// Which regions of a reference move on their own: one number per tile, solved for together with the pose, so that
/// alignment holds on to the static part of a scene without being told what moves.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/options.hpp>
#include <apso/refinement/normal_equations.hpp>

APSO_NAMESPACE_BEGIN

struct RegionOptions {
  bool on = true;
  double cut = 3;    ///< a tile with this many times the usual cost counts half
  double power = 4;  ///< how sharp the cut is
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("on", s.on);
    v("cut", s.cut, 1.0, 1e6);
    v("power", s.power, 0.5, 100.0);
  }
};

/// Labels of the tiles of one reference, 1 = static .. 0 = moves:
///
///     l = 1 / (1 + (m / (cut m_usual))^power),  m = mean robust cost of the tile,  m_usual = its median over the tiles
///
/// The median is taken over the image area, so that what is near, and therefore measured well, does not outvote what fills
/// most of the image.
class RegionLabels {
 public:
  /// All static.
  void reset(std::size_t tiles) { labels_.assign(tiles, 1.0F); }
  [[nodiscard]] float operator[](std::size_t i) const { return labels_[i]; }
  [[nodiscard]] const std::vector<float>& all() const { return labels_; }

  void update(const std::vector<TileSums>& tiles, const RegionOptions& o) {
    labels_.resize(tiles.size());
    sorted_.clear();
    double total = 0;
    for (const TileSums& t : tiles) {
      if (!(t.weight > 0)) continue;
      sorted_.push_back({t.cost / t.weight, t.weight});
      total += static_cast<double>(t.weight);
    }
    std::sort(sorted_.begin(), sorted_.end(), [](const Entry& a, const Entry& b) { return a.cost < b.cost; });
    double below = 0;
    double usual = 0;
    for (const Entry& e : sorted_) {
      below += static_cast<double>(e.weight);
      usual = static_cast<double>(e.cost);
      if (below >= 0.5 * total) break;
    }
    const double limit = o.cut * std::max(usual, 1e-6);
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      const double m = tiles[i].weight > 0 ? static_cast<double>(tiles[i].cost / tiles[i].weight) : 0.0;
      labels_[i] = static_cast<float>(1.0 / (1.0 + std::pow(m / limit, o.power)));
    }
  }

 private:
  struct Entry {
    float cost, weight;
  };
  std::vector<float> labels_;
  std::vector<Entry> sorted_;
};

APSO_NAMESPACE_END
