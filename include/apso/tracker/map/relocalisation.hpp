/// \file
/// Finding the pose of a camera that is lost: by comparing the image with whole keyframes.
///
/// A pose found again has to rest on landmarks that were seen again after the frame that made them. Somebody who steps before the camera
/// makes a keyframe due, which takes his points for landmarks, and is what the camera loses its place by: those landmarks fit him as long
/// as he stands there, and nothing else in view says that he moves.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/tracker/features.hpp>
#include <apso/tracker/landmark_matching.hpp>
#include <apso/tracker/map/local_map.hpp>
#include <apso/tracker/solvers/ransac_pose.hpp>

APSO_NAMESPACE_BEGIN

/// What relocalise() is told.
struct RelocalisationInput {
  Pose T_world_predicted = identity_pose();  ///< tried first
  bool lost = false;                         ///< the last frames had no pose: even the last keyframe is then a place found again
  int window = 10;                           ///< keyframes of a local map
  int min_inliers = 50;                      ///< on lasting landmarks, of a pose found again
  int min_inliers_last = 30;                 ///< of a pose at the last keyframe when the camera is not lost
  std::uint64_t seed = 1;                    ///< of RANSAC
};

/// Compares with one whole keyframe by descriptor alone, and then with what is around it.
/// \param gather chooses the landmarks around it in the matcher, given those of the keyframe
/// \param[in,out] result the pose, if one was found; else unchanged
/// \param[in,out] seen those of the keyframe, if it was tried
/// \return whether a pose with enough inliers was found
template <class Gather>
bool recognise_keyframe(const LocalMap& map, const WeightedFeatures& features, const RelocalisationInput& input, int keyframe,
                        LandmarkMatcher& matcher, Gather&& gather, std::vector<int>& seen, MapPose& result) {
  constexpr double kRadii[] = {15.0, 8.0};
  if (!matcher.match_keyframe(map, features, keyframe)) return false;
  RansacOptions ransac;
  ransac.seed = input.seed;
  const RansacPose found = ransac_pose(matcher.camera(), matcher.observe(map, features), {input.T_world_predicted}, ransac);
  if (!found.ok || found.inliers < 12) return false;
  MapPose attempt = result;
  if (!matcher.solve(map, features, found.T_world_camera, attempt) || attempt.inliers < 10) return false;
  // Gather what the neighbourhood of that keyframe knows, and solve again.
  seen.clear();
  for (int l : map.keyframe(keyframe).landmark)
    if (l >= 0) seen.push_back(l);
  gather(seen);
  for (double radius : kRadii) {
    matcher.match_projections(map, features, attempt.T_world_camera, radius);
    if (matcher.matches().size() < 10) break;
    const Pose start = attempt.T_world_camera;
    if (!matcher.solve(map, features, start, attempt)) break;
  }
  attempt.relocalised = keyframe != map.last_keyframe() || input.lost;
  const bool enough = attempt.relocalised ? attempt.lasting >= input.min_inliers : attempt.inliers >= input.min_inliers_last;
  if (!succeeded(attempt.status) || !enough) return false;
  result = attempt;
  return true;
}

/// Compares with whole keyframes, the most recent first and then spread over the past.
/// \param[in,out] result the pose, if one was found; else unchanged
/// \param[in,out] seen landmarks of the previous frame; those of the last keyframe tried afterwards
/// \return whether a pose with enough inliers was found
inline bool relocalise(const LocalMap& map, const WeightedFeatures& features, const RelocalisationInput& input, LandmarkMatcher& matcher,
                       std::vector<int>& seen, MapPose& result) {
  constexpr int kMaxTried = 12;
  constexpr int kRecent = 6;  // of them the last ones in a row
  const auto gather = [&](const std::vector<int>& landmarks) { matcher.collect(map, landmarks, input.window); };
  int tried = 0;
  int stride = 1;
  for (int k = map.last_keyframe(); k >= map.first_keyframe() && tried < kMaxTried; k -= stride) {
    if (!map.keyframe(k).alive) continue;
    ++tried;
    if (tried >= kRecent) stride = std::max(1, (map.last_keyframe() - map.first_keyframe()) / 8);
    if (recognise_keyframe(map, features, input, k, matcher, gather, seen, result)) return true;
  }
  return false;
}

APSO_NAMESPACE_END
