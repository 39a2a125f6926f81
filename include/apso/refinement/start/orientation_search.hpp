/// \file
/// Rotations between two frames from the surface normals in both.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>

APSO_NAMESPACE_BEGIN

/// Estimates how the camera turned from the normals of walls, floors and furniture: these keep their directions whatever
/// part of a surface is seen, so that the frames need not share a single pixel. The normals of
/// the current frame are gathered in a map of directions (extended Gaussian image, Horn, Proc. IEEE 1984), and
/// rotations that map those of the reference to where it is filled are searched on a grid, then refined: a third of a
/// million look-ups at 160 x 120 pixels. Deterministic; keeps its buffers.
class OrientationSearch {
 public:
  /// Largest angle between a candidate, before it is refined, and the centre of the search [rad].
  static constexpr double kMaxAngle = 13 * kDegree;

  /// \param reference,current the same level of both frames, about 160 x 120 pixels
  /// \param centre R_current_reference around which to search
  /// \param R_current_reference receives up to four rotations, the best first; empty without surfaces
  void operator()(const PyramidLevel& reference, const PyramidLevel& current, const Eigen::Matrix3d& centre,
                  std::vector<Eigen::Matrix3d>& R_current_reference) {
    R_current_reference.clear();
    normals(current, normals_);
    build_map();
    normals(reference, normals_);
    if (normals_.empty()) return;
    candidates_.clear();
    constexpr int kSteps = static_cast<int>(kMaxAngle / kStep);
    for (int x = -kSteps; x <= kSteps; ++x) {
      for (int y = -kSteps; y <= kSteps; ++y) {
        for (int z = -kSteps; z <= kSteps; ++z) {
          const Eigen::Vector3d turn(x * kStep, y * kStep, z * kStep);
          if (norm(turn) > kMaxAngle) continue;
          const Eigen::Matrix3d R = rotation(so3_exp(turn)) * centre;
          candidates_.push_back({R, score(R)});
        }
      }
    }
    double best_score = 0;
    for (int tried = 0; tried < kMaxCandidates && !candidates_.empty(); ++tried) {
      const auto best = std::max_element(candidates_.begin(), candidates_.end(),
                                         [](const Candidate& a, const Candidate& b) { return a.score < b.score; });
      best_score = std::max(best_score, best->score);
      if (!(best->score > kMinScoreRatio * best_score)) break;
      Eigen::Matrix3d R = best->R;
      candidates_.erase(
          std::remove_if(candidates_.begin(), candidates_.end(), [&](const Candidate& c) { return angle(c.R, R) < kMinSeparation; }),
          candidates_.end());
      for (int i = 0; i < kRefinements; ++i) refine(R);
      // most candidates that were separate converge to the same rotation
      if (std::any_of(R_current_reference.begin(), R_current_reference.end(),
                      [&](const Eigen::Matrix3d& other) { return angle(R, other) < kDuplicateAngle; })) {
        continue;
      }
      R_current_reference.push_back(R);
    }
  }

 private:
  static constexpr double kStep = 3 * kDegree;            // of the grid [rad]
  static constexpr double kMinSeparation = 5 * kDegree;   // of two candidates, before they are refined [rad]
  static constexpr double kMinScoreRatio = 0.8;           // score of a candidate over that of the best
  static constexpr double kDuplicateAngle = 1 * kDegree;  // refined candidates that are closer are the same [rad]
  static constexpr int kMaxCandidates = 4;
  static constexpr int kRefinements = 6;
  static constexpr int kPixels = 4;       // between normals
  static constexpr int kRadius = 3;       // of the window of a normal [px]
  static constexpr int kSide = 96;        // of the map, cells
  static constexpr float kExtent = 1.3F;  // of the map to each side; 1 is perpendicular to the viewing direction
  static constexpr float kMaxZ = 0.5F;    // of a direction; others face away from the camera, beyond the map
  static constexpr float kCone = 0.01F;   // 1 - cosine of the largest angle between directions that agree: 8 degrees

  struct Candidate {
    Eigen::Matrix3d R;
    double score;
  };
  // What the current frame shows of a direction: how many normals near it, and their sum.
  struct Cell {
    float weight = 0, x = 0, y = 0, z = 0;
  };

  static double angle(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
    return rotation_angle(make_pose(transposed_times(a, b), Eigen::Vector3d(0, 0, 0)));
  }

  // Of planes through the pixels around each, towards the camera.
  APSO_NOINLINE static void normals(const PyramidLevel& level, std::vector<Eigen::Vector3f>& out) {
    out.clear();
    const Plane& depth = level.depth;
    for (int y = kRadius; y + kRadius < depth.height(); y += kPixels) {
      for (int x = kRadius; x + kRadius < depth.width(); x += kPixels) {
        const float z = depth.row(y)[x];
        float du, dv;
        if (!(z > 0) || !slope(depth, x, y, 1, 0, du) || !slope(depth, x, y, 0, 1, dv)) continue;
        // of z(u, v): (fx dz/du, fy dz/dv, -(z + (u - cx) dz/du + (v - cy) dz/dv))
        const float w = z + (static_cast<float>(x) - static_cast<float>(level.camera.cx)) * du +
                        (static_cast<float>(y) - static_cast<float>(level.camera.cy)) * dv;
        const Eigen::Vector3f n(static_cast<float>(level.camera.fx) * du, static_cast<float>(level.camera.fy) * dv, -w);
        out.push_back(1.0F / norm(n) * n);
      }
    }
  }
  // Of the depth along (dx, dy), from pixels on both sides at the same distance from the line across, least squares:
  // what is missing, or lies on another surface, is left out. \return whether enough remains
  static bool slope(const Plane& depth, int x, int y, int dx, int dy, float& out) {
    float sum = 0;
    int weight = 0;
    int all = 0;
    for (int across = -kRadius; across <= kRadius; ++across) {
      const float z = depth.row(y + dx * across)[x + dy * across];
      for (int along = 1; along <= kRadius; ++along) {
        const float after = depth.row(y + dy * along + dx * across)[x + dx * along + dy * across];
        const float before = depth.row(y - dy * along + dx * across)[x - dx * along + dy * across];
        all += along * along;
        if (!(z > 0 && after > 0 && before > 0)) continue;
        if (std::abs(0.5F * (after + before) - z) > 0.03F * z) continue;
        sum += static_cast<float>(along) * (after - before);
        weight += along * along;
      }
    }
    if (2 * weight < all) return false;
    out = sum / static_cast<float>(2 * weight);
    return true;
  }

  // Stereographic: directions towards the camera fill the unit disk.
  static float to_cell(float v) { return (v + kExtent) * (0.5F * kSide / kExtent); }
  static const Cell* find(const std::vector<Cell>& map, const Eigen::Vector3f& n) {
    if (!(n.z() < kMaxZ)) return nullptr;
    const float x = to_cell(n.x() / (1.0F - n.z()));
    const float y = to_cell(n.y() / (1.0F - n.z()));
    if (!(x >= 0 && y >= 0 && x < kSide && y < kSide)) return nullptr;
    return &map[static_cast<std::size_t>(y) * kSide + static_cast<std::size_t>(x)];
  }
  // Each normal counts in the cells of a cone around it.
  void build_map() {
    map_.assign(static_cast<std::size_t>(kSide) * kSide, Cell{});
    for (const Eigen::Vector3f& n : normals_) {
      if (!(n.z() < kMaxZ)) continue;
      const float s = 1.0F / (1.0F - n.z());
      const int x0 = static_cast<int>(to_cell(n.x() * s));
      const int y0 = static_cast<int>(to_cell(n.y() * s));
      constexpr int kAround = 6;  // cells that the cone reaches at most
      for (int y = std::max(0, y0 - kAround); y <= std::min(kSide - 1, y0 + kAround); ++y) {
        for (int x = std::max(0, x0 - kAround); x <= std::min(kSide - 1, x0 + kAround); ++x) {
          const float p = (static_cast<float>(x) + 0.5F) * (2 * kExtent / kSide) - kExtent;
          const float q = (static_cast<float>(y) + 0.5F) * (2 * kExtent / kSide) - kExtent;
          const float squared = p * p + q * q;
          const float cosine = (2 * (p * n.x() + q * n.y()) - (1 - squared) * n.z()) / (1 + squared);
          const float weight = 1.0F - (1.0F - cosine) / kCone;
          if (!(weight > 0)) continue;
          Cell& c = map_[static_cast<std::size_t>(y) * kSide + static_cast<std::size_t>(x)];
          c.weight += weight;
          c.x += weight * n.x();
          c.y += weight * n.y();
          c.z += weight * n.z();
        }
      }
    }
    for (Cell& c : map_) {
      // the root: a large wall must not outvote all the rest
      const float length = std::sqrt(c.x * c.x + c.y * c.y + c.z * c.z);
      if (!(length > 0)) continue;
      c.weight = std::sqrt(c.weight);
      c.x /= length;
      c.y /= length;
      c.z /= length;
    }
  }

  [[nodiscard]] double score(const Eigen::Matrix3d& R) const {
    const FloatPose turn(make_pose(R, Eigen::Vector3d(0, 0, 0)));
    float sum = 0;
    for (const Eigen::Vector3f& n : normals_) {
      const Cell* c = find(map_, turn.rotate(n.x(), n.y(), n.z()));
      if (c != nullptr) sum += c->weight;
    }
    return static_cast<double>(sum);
  }
  // One Gauss-Newton step towards the mean normals where those of the reference fall.
  void refine(Eigen::Matrix3d& R) const {
    const FloatPose turn(make_pose(R, Eigen::Vector3d(0, 0, 0)));
    Eigen::Matrix3d H = identity<Eigen::Matrix3d>();  // what is not seen does not turn
    Eigen::Vector3d b(0, 0, 0);
    for (const Eigen::Vector3f& n : normals_) {
      const Eigen::Vector3f m = turn.rotate(n.x(), n.y(), n.z());
      const Cell* c = find(map_, m);
      if (c == nullptr || !(c->weight > 0)) continue;
      const Eigen::Vector3f e = cross(m, Eigen::Vector3f(c->x, c->y, c->z));
      for (int i = 0; i < 3; ++i) {
        b(i) += static_cast<double>(c->weight * e(i));
        for (int j = 0; j < 3; ++j) H(i, j) += static_cast<double>(c->weight * ((i == j ? 1.0F : 0.0F) - m(i) * m(j)));
      }
    }
    const Eigen::Vector3d step = solve_symmetric(H, b);
    if (all_finite(step)) R = rotation(so3_exp(step)) * R;
  }

  std::vector<Eigen::Vector3f> normals_;
  std::vector<Cell> map_;
  std::vector<Candidate> candidates_;
};

APSO_NAMESPACE_END
