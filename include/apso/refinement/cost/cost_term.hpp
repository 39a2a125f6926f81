/// \file
/// What the cost of an alignment keeps of one reference.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/refinement/alignment_result.hpp>
#include <apso/refinement/cost/illumination.hpp>
#include <apso/refinement/cost/image_cells.hpp>
#include <apso/refinement/cost/normal_equations.hpp>
#include <apso/refinement/cost/region_labels.hpp>
#include <apso/refinement/cost/residuals.hpp>
#include <apso/refinement/cost/scale/term_scales.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>

APSO_NAMESPACE_BEGIN

/// A unit of work: some tiles of a reference.
struct CostPart {
  int term = 0;
  int begin = 0;  ///< tiles
  int end = 0;
  WarpCounts counts;
  PixelSums<double> sum;
};

/// One reference: its frame, scales, brightness, labels, and the sums of its tiles at two poses.
struct CostTerm {
  const FramePyramid* pyramid = nullptr;
  const PyramidLevel* level = nullptr;  ///< that was entered
  Pose T_world_reference = identity_pose();
  double weight = 1;  ///< B_k
  TermScales scales;
  Illumination light;
  double correlation = 0;  ///< of the sampled intensities
  std::vector<TileSums> sums[2];
  RegionLabels labels;
  float nearest = 0;  ///< what is nearer is left out [m]
  WarpCounts counts[2];

  void begin(const AlignmentReference& r) {
    pyramid = r.pyramid;
    T_world_reference = r.T_world_reference;
    weight = r.weight;
    nearest = 0;
    light = Illumination{};
  }

  /// Turns to the level after so many halvings, and appends its units of work.
  void enter(int halvings, int index, std::vector<CostPart>& parts) {
    level = &pyramid->halved(halvings);
    const PixelList& list = level->pixels;
    const int n = static_cast<int>(list.tiles.size());
    for (auto& s : sums) s.resize(static_cast<std::size_t>(n));
    labels.reset(list.tiles, nearest);
    const int count = std::clamp(list.blocks() / kSmallestPart, 1, kParts);
    for (int part = 0, b = 0; part < count; ++part) {
      CostPart p{};
      p.term = index;
      p.begin = b;
      const int last = list.blocks() * (part + 1) / count;
      while (b < n && list.tiles[static_cast<std::size_t>(b)].end <= last) ++b;
      p.end = b;
      if (p.end > p.begin) parts.push_back(p);
    }
  }

  /// As CostTerms::look_beyond().
  void look_beyond(float distance) {
    nearest = distance;
    labels.reset(level->pixels.tiles, nearest);
  }

  /// Adds cost and divisor of every `step`-th tile, by the labels.
  void add_cost(int buffer, std::size_t step, double& cost, double& divisor) const {
    for (std::size_t i = 0; i < sums[buffer].size(); i += step) {
      const double w = weight * static_cast<double>(labels[i]);
      cost += w * static_cast<double>(sums[buffer][i].cost);
      divisor += w * static_cast<double>(sums[buffer][i].weight);
    }
  }
  /// Adds the part whose label says that it moves, and all.
  void add_moving(int buffer, double& moving, double& all) const {
    for (std::size_t i = 0; i < sums[buffer].size(); ++i) {
      const auto w = static_cast<double>(sums[buffer][i].weight);
      all += w;
      moving += w * (1 - static_cast<double>(labels[i]));
    }
  }
  /// Adds the right side of each tile to that of the cell of the image in which the tile lies.
  void add_right_sides(int buffer, const Pose& T_current_reference, ImageCells& cells) const {
    const Matrix6 A = adjoint_inverse(T_current_reference);
    const PixelList& list = level->pixels;
    for (std::size_t i = 0; i < sums[buffer].size(); ++i) {
      const TileSums& s = sums[buffer][i];
      const int tile = static_cast<int>(i);
      const double w = weight * static_cast<double>(labels[i]);
      if (!(w > 0) || !(s.weight > 0)) continue;
      Twist b;
      for (int k = 0; k < 3; ++k) {
        b(k) = -w * static_cast<double>(s.v[k]);
        b(3 + k) = -w * static_cast<double>(s.w[k]);
      }
      cells.add(tile / list.columns * ImageCells::kRows / list.rows, tile % list.columns * ImageCells::kColumns / list.columns,
                transposed_times(A, b));
    }
  }
  /// Adds what every `step`-th tile tells about a direction, and the squares of that.
  /// \param d twist in the frame of the reference
  void add_information_about(const Twist& d, int buffer, std::size_t step, double& sum, double& squares) const {
    for (std::size_t i = 0; i < sums[buffer].size(); i += step) {
      PixelSums<double> tile{};
      add(tile, sums[buffer][i], static_cast<float>(weight) * labels[i]);
      const Matrix6 H = tile.equations().H;
      double s = 0;
      for (int r = 0; r < 6; ++r) {
        for (int c = 0; c < 6; ++c) s += d(r) * H(r, c) * d(c);
      }
      sum += s;
      squares += s * s;
    }
  }
  /// Counts the tiles that are mostly seen at both poses, and those that the pose on trial contradicts.
  /// \param charge cost of a lost pixel of weight 1
  /// \param more by how much a seen pixel has to cost more on trial than accepted
  void count_contradicted(double charge, double more, int& seen, int& contradicted) const {
    for (std::size_t i = 0; i < sums[0].size(); ++i) {
      double mean[2];
      bool both = true;
      for (const std::size_t buffer : {0U, 1U}) {
        const TileSums& s = sums[buffer][i];
        const auto lost = static_cast<double>(s.lost);
        const double here = static_cast<double>(s.weight) - scales.both() * lost;
        both = both && here > 0.5 * static_cast<double>(s.weight);
        mean[buffer] = both ? std::max(0.0, static_cast<double>(s.cost) - charge * lost) / here : 0.0;
      }
      if (!both) continue;
      ++seen;
      if (mean[1] - mean[0] > more) ++contradicted;
    }
  }
  /// Sums in which a tile counts by the surface that it shows, depth^2.
  struct OverSurface {
    double cost = 0;  ///< of what is seen
    double seen = 0;  ///< divisor of that
    double all = 0;   ///< the same with what left the view
  };
  /// \param charge cost of a lost pixel of weight 1
  [[nodiscard]] OverSurface over_surface(int buffer, double charge) const {
    OverSurface o;
    for (std::size_t i = 0; i < sums[buffer].size(); ++i) {
      const TileSums& s = sums[buffer][i];
      const auto depth = static_cast<double>(level->pixels.tiles[i].depth);
      const double w = weight * depth * depth;
      const auto lost = static_cast<double>(s.lost);
      o.cost += w * std::max(0.0, static_cast<double>(s.cost) - charge * lost);
      o.seen += w * (static_cast<double>(s.weight) - scales.both() * lost);
      o.all += w * static_cast<double>(s.weight);
    }
    return o;
  }

 private:
  static constexpr int kParts = 16;         // most units of work that a reference gives at a level
  static constexpr int kSmallestPart = 16;  // blocks of pixels of the smallest
};

APSO_NAMESPACE_END
