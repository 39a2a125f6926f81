/// \file
/// Which regions of a reference move on their own: one number per tile, solved for together with the pose, so that
/// alignment holds on to the static part of a scene without being told what moves.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/refinement/cost/normal_equations.hpp>
#include <apso/refinement/pyramid/pixel_list.hpp>

APSO_NAMESPACE_BEGIN

/// Labels of the tiles of one reference, 1 = static .. 0 = moves:
///
///     l = 1 / (1 + (m / (3 m_typical))^4),  m = mean robust cost of the tile,  m_typical = its median over the tiles
///
/// The median is taken over the surface that is seen: a tile weighs as its pixels times depth^2. What moves on its own is
/// mostly near and fills much of the image; what is static is mostly large. Pixels that left the view say nothing about
/// their tile.
class RegionLabels {
 public:
  /// All static, but for what is nearer than so many metres: that moves, whatever it looks like.
  void reset(const std::vector<PixelList::Tile>& places, float nearest) {
    nearest_ = nearest;
    labels_.resize(places.size());
    std::transform(places.begin(), places.end(), labels_.begin(),
                   [this](const PixelList::Tile& t) { return t.depth < nearest_ ? 0.0F : 1.0F; });
  }
  [[nodiscard]] float operator[](std::size_t i) const { return labels_[i]; }

  /// \param tiles sums at the present pose, `places` the tiles themselves
  /// \param charge cost of a lost pixel of weight 1, and `charge_weight` what it adds to the divisor
  void update(const std::vector<TileSums>& tiles, const std::vector<PixelList::Tile>& places, double charge, double charge_weight) {
    sorted_.clear();
    means_.resize(tiles.size());
    double total = 0;
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      const TileSums& t = tiles[i];
      const double lost = static_cast<double>(t.lost);
      double weight = static_cast<double>(t.weight) - charge_weight * lost;
      const bool seen = weight > 1e-3 * static_cast<double>(t.weight);
      const double m = seen ? std::max(0.0, static_cast<double>(t.cost) - charge * lost) / weight : 0.0;
      means_[i] = static_cast<float>(m);
      if (!seen || places[i].depth < nearest_) continue;
      weight *= static_cast<double>(places[i].depth * places[i].depth);
      sorted_.push_back({m, weight});
      total += weight;
    }
    std::sort(sorted_.begin(), sorted_.end(), [](const Entry& a, const Entry& b) { return a.cost < b.cost; });
    double below = 0;
    double typical = 0;
    for (const Entry& e : sorted_) {
      below += e.weight;
      typical = e.cost;
      if (below >= 0.5 * total) break;
    }
    const auto inverse_limit = static_cast<float>(1.0 / (kCut * std::max(typical, 1e-6)));
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      labels_[i] = places[i].depth < nearest_ ? 0.0F : 1.0F / (1.0F + std::pow(means_[i] * inverse_limit, kPower));
    }
  }

 private:
  static constexpr double kCut = 3;      // a tile with this many times the typical cost counts half
  static constexpr float kPower = 4.0F;  // how sharp the cut is
  struct Entry {
    double cost, weight;
  };
  float nearest_ = 0;  // [m]
  std::vector<float> labels_, means_;
  std::vector<Entry> sorted_;
};

APSO_NAMESPACE_END
