/// \file
/// What a frame with a trusted pose teaches the map about its landmarks: which were seen, and which should have been.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/tracker/features.hpp>
#include <apso/tracker/landmark_matching.hpp>
#include <apso/tracker/map/local_map.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
/// Whether a landmark projects onto something masked, and whether it lies on the masked thing itself, not behind it.
struct MaskedAt {
  bool masked = false;
  bool same_depth = false;
};
inline MaskedAt masked_at(const WeightedFeatures& features, const LocalLandmark& entry, double inverse_depth) {
  constexpr double kRadius = 4;            // [px]
  constexpr double kMaxDifference = 0.03;  // of inverse depths on the same surface [1/m]
  MaskedAt found;
  features.grid.near(entry.u, entry.v, kRadius, [&](int f) {
    const auto fi = static_cast<std::size_t>(f);
    if (features.weight[fi] > 0) return;
    const double du = static_cast<double>(features.keypoints[fi].x) - entry.u;
    const double dv = static_cast<double>(features.keypoints[fi].y) - entry.v;
    if (du * du + dv * dv < kRadius * kRadius) found.masked = true;
    const float measured = features.inverse_depth[fi];
    if (measured > 0 && std::abs(inverse_depth - static_cast<double>(measured)) < kMaxDifference) found.same_depth = true;
  });
  return found;
}
}  // namespace detail

/// Counts for each local landmark whether it was seen; the unreliable ones, and those that lie on something that moves, go.
/// \param[out] seen the landmarks that the frame shows
/// \return how many these are
inline int update_landmarks(const WeightedFeatures& features, const Pose& T_world_camera, LandmarkMatcher& matcher, LocalMap& map,
                            PassMarks& marks, std::vector<int>& seen) {
  matcher.check(map, features, T_world_camera);
  seen.clear();
  marks.begin(map.landmarks().size());
  for (const LandmarkMatch& m : matcher.matches()) {
    if (!m.inlier) continue;
    marks.mark(m.landmark);
    seen.push_back(m.landmark);
    ++map.landmark(m.landmark).found;
    ++map.landmark(m.landmark).visible;
  }
  const Pose T_camera_world = inverse(T_world_camera);
  for (const LocalLandmark& entry : matcher.local()) {
    MapLandmark& l = map.landmark(entry.landmark);
    if (!l.alive || !entry.inside || marks.marked(entry.landmark)) continue;
    const detail::MaskedAt here = detail::masked_at(features, entry, 1 / transform(T_camera_world, l.point).z());
    if (!here.masked) {
      ++l.visible;
    } else if (here.same_depth) {
      ++l.on_dynamic;
    }
    const bool rarely = l.visible > 8 && l.found * 4 < l.visible;
    if (rarely || l.on_dynamic > 1) map.kill(entry.landmark);
  }
  return static_cast<int>(seen.size());
}

APSO_NAMESPACE_END
