/// \file
/// Keyframes: when one is due, what it adds to the map, and the bundle adjustment that follows.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/status.hpp>
#include <apso/tracker/features.hpp>
#include <apso/tracker/landmark_matching.hpp>
#include <apso/tracker/map/local_map.hpp>
#include <apso/tracker/solvers/windowed_adjustment.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// When a keyframe is due: after some time, when much of what the last one showed is gone, or when too little that is close
/// is on the map (the rule for RGB-D of ORB-SLAM2, Mur-Artal & Tardos, T-RO 2017).
class KeyframeDecision {
 public:
  /// \param interval a keyframe is due after this time [s]
  /// \param share    ... or when the inliers fall below this share of the most since the last, [0,1]
  KeyframeDecision(double interval, double share) : interval_(interval), share_(share) {}

  [[nodiscard]] bool due(const LocalMap& map, const WeightedFeatures& features, const std::vector<LandmarkMatch>& matches, int inliers,
                         double timestamp) {
    max_inliers_ = std::max(max_inliers_, inliers);
    if (inliers < kMinInliers) return false;
    if (static_cast<double>(inliers) < share_ * max_inliers_) return true;
    if (timestamp - map.keyframe(map.last_keyframe()).timestamp > interval_) return true;
    int close_tracked = 0;
    for (const LandmarkMatch& m : matches)
      if (m.inlier && is_close(features, static_cast<std::size_t>(m.feature))) ++close_tracked;
    int close = 0;
    for (std::size_t f = 0; f < features.weight.size(); ++f)
      if (features.weight[f] > 0 && is_close(features, f)) ++close;
    return close_tracked < 100 && close - close_tracked > 70;
  }
  /// A keyframe was made.
  void made() { max_inliers_ = 0; }

 private:
  static constexpr int kMinInliers = 15;      // a pose from fewer is no place for a keyframe
  static constexpr double kCloseDepth = 3.0;  // depth is exact up to here [m]
  [[nodiscard]] static bool is_close(const WeightedFeatures& features, std::size_t f) {
    const float inverse_depth = features.inverse_depth[f];
    return inverse_depth > 0 && static_cast<double>(inverse_depth) * kCloseDepth > 1.0;
  }
  double interval_;
  double share_;
  int max_inliers_ = 0;
};

/// What new_keyframe() is told.
struct KeyframeInput {
  double timestamp = 0;
  Pose T_world_camera = identity_pose();
  int frame_number = 0;
  double landmark_depth = 5.0;  ///< landmarks are created up to here [m]
  double max_sigma = 0.015;     ///< ... and where the deviation of the inverse depth is no larger [1/m]
};

/// Adds a keyframe: views of the landmarks it shows, and new landmarks at the other features with depth.
/// \return its index
inline int new_keyframe(const Pinhole& camera, const WeightedFeatures& features, const std::vector<LandmarkMatch>& matches,
                        const KeyframeInput& input, LocalMap& map) {
  const int k = map.add_keyframe(input.timestamp, input.T_world_camera, features);
  for (const LandmarkMatch& m : matches)
    if (m.inlier && map.landmark(m.landmark).alive) map.add_view(m.landmark, k, m.feature);
  for (std::size_t f = 0; f < features.weight.size(); ++f) {
    if (map.keyframe(k).landmark[f] >= 0 || features.weight[f] <= 0) continue;
    const float inverse_depth = features.inverse_depth[f];
    if (!(inverse_depth > 0) || 1.0 / static_cast<double>(inverse_depth) > input.landmark_depth) continue;
    if (static_cast<double>(features.inverse_depth_sigma[f]) > input.max_sigma) continue;
    map.add_landmark(camera, k, static_cast<int>(f), input.frame_number);
  }
  return k;
}

/// Deviation of a depth measurement in the adjustment, as a multiple of that of a single one. A depth camera's errors have a part that
/// neighbouring pixels and frames from nearby places share (calibration, registration to the colours), so that many measurements together
/// say less than if they were independent. With 1 they bend the path, 2 and 3 measure alike (docs/tracker.md).
inline constexpr double kSharedDepthError = 2;

/// Motion of the newest keyframe [m, rad] from which on an adjustment is refused. What tracked the frame has placed it within a few
/// centimetres; few or wrong matches may take it metres away (docs/tracker.md).
inline constexpr double kMostMoved = 0.1;

/// Refines the last keyframes and what they see; keyframes outside the window that see the same stay fixed. The map stays as
/// it is when the adjustment fails. When it takes the newest keyframe elsewhere, that one no longer counts as a view of what others see.
/// \param window how many keyframes are refined
inline void adjust_last_keyframes(const Pinhole& camera, const Octaves& octaves, int window, LocalMap& map, PassMarks& marks,
                                  AdjustmentBuffers& buffers) {
  constexpr int kIterations = 4;  // one keyframe after another, so that each starts close to its end
  AdjustmentProblem& problem = buffers.fresh();
  std::vector<int> pose_of(map.kept_keyframes(), -1);
  std::vector<int> keyframe_of;
  const auto take = [&](int k, bool fixed) {
    pose_of[map.slot(k)] = static_cast<int>(keyframe_of.size());
    keyframe_of.push_back(k);
    problem.T_camera_world.push_back(inverse(map.keyframe(k).T_world_camera));
    problem.fixed.push_back(fixed ? 1 : 0);
  };
  for (int k = map.last_keyframe(); k >= map.first_keyframe() && static_cast<int>(keyframe_of.size()) < window; --k)
    if (map.keyframe(k).alive) take(k, k == 0);
  if (keyframe_of.size() < 2) return;
  const std::size_t refined = keyframe_of.size();
  std::vector<int> points;
  std::vector<int> single;
  marks.begin(map.landmarks().size());
  for (std::size_t w = 0; w < refined; ++w)
    for (int l : map.keyframe(keyframe_of[w]).landmark)
      if (l >= 0 && marks.mark(l)) (map.landmark(l).views.size() > 1 ? points : single).push_back(l);
  bool anchored = problem.fixed[refined - 1] != 0;
  for (int l : points) {
    const MapLandmark& landmark = map.landmark(l);
    AdjustmentProblem::Point point;
    point.point = landmark.point;
    point.first = static_cast<int>(problem.views.size());
    for (const LandmarkView& v : landmark.views) {
      if (pose_of[map.slot(v.keyframe)] < 0) {
        take(v.keyframe, true);
        anchored = true;
      }
      AdjustmentProblem::View view;
      view.pose = pose_of[map.slot(v.keyframe)];
      view.observation = observation_of(map.keyframe(v.keyframe).features, v.feature, landmark.point, 1.0F, octaves);
      view.observation.inverse_depth_sigma *= kSharedDepthError;
      problem.views.push_back(view);
      ++point.count;
    }
    problem.points.push_back(point);
  }
  if (!anchored) problem.fixed[refined - 1] = 1;
  const Pose T_newest_world = problem.T_camera_world.front();
  if (!succeeded(adjust_window(camera, problem, buffers, kIterations).status)) return;
  const Pose moved = compose(problem.T_camera_world.front(), inverse(T_newest_world));
  if (norm(translation(moved)) > kMostMoved || rotation_angle(moved) > kMostMoved) {
    const std::vector<int> seen = map.keyframe(keyframe_of.front()).landmark;
    for (int l : seen)
      if (l >= 0 && map.landmark(l).views.size() > 1) map.remove_view(l, keyframe_of.front());
    return;
  }
  for (std::size_t i = 0; i < keyframe_of.size(); ++i)
    if (!problem.fixed[i]) map.keyframe(keyframe_of[i]).T_world_camera = inverse(problem.T_camera_world[i]);
  for (std::size_t i = 0; i < points.size(); ++i) {
    map.landmark(points[i]).point = problem.points[i].point;
    for (int v = problem.points[i].first; v < problem.points[i].first + problem.points[i].count; ++v) {
      const AdjustmentProblem::View& view = problem.views[static_cast<std::size_t>(v)];
      if (!view.observation.inlier) map.remove_view(points[i], keyframe_of[static_cast<std::size_t>(view.pose)]);
    }
  }
  for (int l : single) map.move_with_keyframe(l, camera);
}

APSO_NAMESPACE_END
