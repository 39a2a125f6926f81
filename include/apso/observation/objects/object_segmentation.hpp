/// \file
/// A dynamic mask cut into bodies: connected regions, divided between the known objects that have pixels in them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/objects/object_prediction.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// Parts above each other at one depth are one body, as are a small part or a box within a box with what they lie
/// before; people stand side by side, or apart in depth.
/// \param za, zb mean depths [m], 0 = not known
[[nodiscard]] inline bool one_body(const Box& a, double za, const Box& b, double zb) {
  constexpr double kBodyDepth = 0.35;  // parts above each other that differ by less are one body [m]
  const double apart = za > 0 && zb > 0 ? std::abs(za - zb) : 0.0;
  const float across = std::min(a.x + a.width, b.x + b.width) - std::max(a.x, b.x);
  const float along = std::min(a.y + a.height, b.y + b.height) - std::max(a.y, b.y);
  const float shorter = std::min(a.height, b.height);
  const bool small_part = shorter < 0.4F * std::max(a.height, b.height);
  const bool nested = a.intersect(b).area() > 0.8F * std::min(a.area(), b.area()) && apart < 0.5 * kBodyDepth;
  const bool stacked = across > 0.6F * std::min(a.width, b.width) && (small_part || along < 0.4F * shorter);
  return nested || (stacked && apart < kBodyDepth);
}

/// A connected part of the mask, or the part of one that belongs to a known object.
struct ObjectPiece {
  int known = -1;                                    ///< number of the known object; -1 = none
  int x0 = 1 << 28, x1 = -1, y0 = 1 << 28, y1 = -1;  ///< small pixels, ends included
  int pixels = 0;                                    ///< small pixels; 0 = joined to another piece
  double sum = 0;                                    ///< of the probability
  double depth = 0;                                  ///< sum over pixels that have one [m]
  int measured = 0;                                  ///< their number

  [[nodiscard]] double mean_depth() const { return measured > 0 ? depth / measured : 0.0; }
  [[nodiscard]] Box box() const {  ///< [small px]
    return {static_cast<float>(x0), static_cast<float>(y0), static_cast<float>(x1 - x0 + 1), static_cast<float>(y1 - y0 + 1)};
  }
  /// Takes in another piece.
  void add(const ObjectPiece& part) {
    x0 = std::min(x0, part.x0);
    x1 = std::max(x1, part.x1);
    y0 = std::min(y0, part.y0);
    y1 = std::max(y1, part.y1);
    pixels += part.pixels;
    sum += part.sum;
    depth += part.depth;
    measured += part.measured;
  }
};

/// Cuts masks; owns the buffers.
class ObjectSegmentation {
 public:
  /// \param min_pixels smaller regions are left out [px of the frame]
  /// \param depth_gap  regions are cut where neighbouring depths differ by more [m]
  void cut(const ObjectGrid& grid, const DynamicMask& mask, const ObjectPrediction& prediction, std::size_t known, int min_pixels,
           double depth_gap) {
    const auto gap = static_cast<float>(depth_gap);
    const Image<int>& seed = prediction.seed();
    const auto at = [&](int i) { return mask.probability(grid.x(i), grid.y(i)); };
    piece_.assign(grid.width, grid.height, 0);
    pieces_.clear();
    if (grid.size() == 0) return;
    for_each_component(
        grid.width, grid.height, scratch_, [&](int i) { return at(i) >= 0.5F; },
        [&](int i, int j) {
          const float a = grid.depth.data()[i];
          const float b = grid.depth.data()[j];
          return !(a > 0 && b > 0) || !(std::abs(a - b) > gap + 0.05F * std::min(a, b));
        },
        [&](const int* first, const int* last) {
          if ((last - first) * kObjectStep * kObjectStep < min_pixels) return;
          count_.assign(known, 0);
          for (const int* i = first; i != last; ++i) {
            if (seed.data()[*i] > 0) ++count_[static_cast<std::size_t>(seed.data()[*i]) - 1];
          }
          const auto begin = static_cast<int>(pieces_.size());
          owner_.assign(known, 0);
          for (std::size_t k = 0; k < known; ++k) {
            if (count_[k] < 6 || 5 * count_[k] < prediction.count()[k]) continue;
            ObjectPiece p;
            p.known = static_cast<int>(k);
            pieces_.push_back(p);
            owner_[k] = static_cast<int>(pieces_.size());
          }
          if (static_cast<int>(pieces_.size()) == begin) pieces_.emplace_back();
          const bool alone = static_cast<int>(pieces_.size()) == begin + 1;
          front_.clear();
          for (const int* i = first; i != last; ++i) {
            const int k = seed.data()[*i] - 1;
            const int owner = k >= 0 ? owner_[static_cast<std::size_t>(k)] : 0;
            piece_.data()[*i] = alone ? begin + 1 : owner > 0 ? owner : -1;
            if (!alone && piece_.data()[*i] > 0) front_.push_back(*i);
          }
          share_rest(grid, gap);
          for (const int* i = first; i != last; ++i) {
            ObjectPiece pixel;
            pixel.x0 = pixel.x1 = *i % grid.width;
            pixel.y0 = pixel.y1 = *i / grid.width;
            pixel.pixels = 1;
            pixel.sum = static_cast<double>(at(*i));
            const float z = grid.depth.data()[*i];
            pixel.depth = z > 0 ? static_cast<double>(z) : 0.0;
            pixel.measured = z > 0 ? 1 : 0;
            pieces_[static_cast<std::size_t>(piece_.data()[*i]) - 1].add(pixel);
          }
        });
    join();
  }

  [[nodiscard]] const std::vector<ObjectPiece>& pieces() const { return pieces_; }
  /// Number of the piece of a small pixel plus one; 0 = none.
  [[nodiscard]] const Image<int>& piece() const { return piece_; }

 private:
  // The rest of a region goes to the nearest piece, first along its surface, then anywhere.
  void share_rest(const ObjectGrid& grid, float gap) {
    for (const bool along : {true, false}) {
      for (std::size_t q = 0; q < front_.size(); ++q) {
        const int i = front_[q];
        const int x = i % grid.width;
        const int y = i / grid.width;
        const auto visit = [&](int j) {
          if (piece_.data()[j] != -1) return;
          if (along && std::abs(grid.depth.data()[i] - grid.depth.data()[j]) > 0.4F * gap) return;
          piece_.data()[j] = piece_.data()[i];
          front_.push_back(j);
        };
        if (x > 0) visit(i - 1);
        if (x + 1 < grid.width) visit(i + 1);
        if (y > 0) visit(i - grid.width);
        if (y + 1 < grid.height) visit(i + grid.width);
      }
    }
  }

  // An object that falls apart: parts of its body and small parts close by stay with it, all else is another object.
  void join() {
    into_.assign(pieces_.size(), -1);
    for (std::size_t a = 0; a < pieces_.size(); ++a) {
      if (pieces_[a].known < 0) continue;
      std::size_t largest = a;
      for (std::size_t b = 0; b < pieces_.size(); ++b) {
        if (pieces_[b].known == pieces_[a].known && pieces_[b].pixels > pieces_[largest].pixels) largest = b;
      }
      if (largest == a) continue;
      const ObjectPiece& main = pieces_[largest];
      const int gap =
          std::max(std::max(pieces_[a].x0 - main.x1, main.x0 - pieces_[a].x1), std::max(pieces_[a].y0 - main.y1, main.y0 - pieces_[a].y1));
      const int reach = 2 + std::max(main.x1 - main.x0, main.y1 - main.y0) / 8;
      const bool body = one_body(pieces_[a].box(), pieces_[a].mean_depth(), main.box(), main.mean_depth());
      const bool stays = gap <= reach && (body || 3 * pieces_[a].pixels <= main.pixels);
      into_[a] = stays ? static_cast<int>(largest) : -1;
      if (!stays) pieces_[a].known = -1;
    }
    for (std::size_t a = 0; a < pieces_.size(); ++a) {
      if (into_[a] < 0) continue;
      pieces_[static_cast<std::size_t>(into_[a])].add(pieces_[a]);
      for (std::size_t i = 0; i < piece_.size(); ++i) {
        if (piece_.data()[i] == static_cast<int>(a) + 1) piece_.data()[i] = into_[a] + 1;
      }
      pieces_[a].pixels = 0;
    }
  }

  std::vector<ObjectPiece> pieces_;
  Image<int> piece_;
  std::vector<int> count_, owner_, front_, into_;
  RegionScratch scratch_;
};

APSO_NAMESPACE_END
