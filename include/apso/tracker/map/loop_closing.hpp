/// \file
/// Loops: a camera that comes back to a place of its map with more drift than matching bears is recognised there, and the drift of the way
/// round is spread over the keyframes that were made on it.
///
/// Strasdat et al. (Double window optimisation, ICCV 2011) and ORB-SLAM (Mur-Artal et al., T-RO 2015) do so on a graph of the keyframes
/// that share landmarks, as is done here. A drift that is smaller than the search around a projection needs none of this: the old
/// landmarks are found where they are expected (LandmarkMatcher::collect()).
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/status.hpp>
#include <apso/tracker/features.hpp>
#include <apso/tracker/landmark_matching.hpp>
#include <apso/tracker/map/local_map.hpp>
#include <apso/tracker/map/part_change.hpp>
#include <apso/tracker/map/place_recognition.hpp>
#include <apso/tracker/map/relocalisation.hpp>
#include <apso/tracker/solvers/pose_graph.hpp>

APSO_NAMESPACE_BEGIN

/// Moves keyframes and their landmarks: the last one to where a loop says, one stays, and those between take their share.
/// \param place              keyframe that stays
/// \param T_world_last       where the last keyframe stands
/// \param[in,out] map        unchanged when the graph has no solution
/// \param[out] corrections   of all keyframes, by time
inline Status close_loop(int place, const Pose& T_world_last, LocalMap& map, std::vector<BasicCorrection<Pose>>& corrections) {
  constexpr int kTied = 30;  // landmarks in common that make an edge between keyframes that do not follow each other
  PoseGraph graph;
  std::vector<int> node_of(map.kept_keyframes(), -1);
  std::vector<int> keyframe_of;
  for (int k = map.first_keyframe(); k <= map.last_keyframe(); ++k) {
    if (!map.keyframe(k).alive) continue;
    node_of[map.slot(k)] = static_cast<int>(keyframe_of.size());
    keyframe_of.push_back(k);
    graph.T_world_node.push_back(map.keyframe(k).T_world_camera);
    graph.fixed.push_back(k == place || k == map.last_keyframe() ? 1 : 0);
  }
  std::vector<int> shared;
  for (std::size_t i = 0; i + 1 < keyframe_of.size(); ++i) {
    shared.assign(keyframe_of.size(), 0);
    for (int l : map.keyframe(keyframe_of[i]).landmark) {
      if (l < 0) continue;
      for (const LandmarkView& v : map.landmark(l).views) ++shared[static_cast<std::size_t>(node_of[map.slot(v.keyframe)])];
    }
    const Pose T_i_world = inverse(graph.T_world_node[i]);
    for (std::size_t j = i + 1; j < keyframe_of.size(); ++j) {
      if (j > i + 1 && shared[j] < kTied) continue;
      graph.edges.push_back({static_cast<int>(i), static_cast<int>(j), compose(T_i_world, graph.T_world_node[j])});
    }
  }
  graph.T_world_node.back() = T_world_last;
  const Status status = optimise_pose_graph(graph);
  if (!succeeded(status)) return status;

  std::vector<Pose> T_world_keyframe(map.kept_keyframes(), identity_pose());
  corrections.clear();
  for (std::size_t i = 0; i < keyframe_of.size(); ++i) {
    const MapKeyframe& k = map.keyframe(keyframe_of[i]);
    T_world_keyframe[map.slot(keyframe_of[i])] = graph.T_world_node[i];
    corrections.push_back({k.timestamp, compose(graph.T_world_node[i], inverse(k.T_world_camera))});
  }
  std::sort(corrections.begin(), corrections.end(), [](const auto& a, const auto& b) { return a.timestamp < b.timestamp; });
  map.correct(T_world_keyframe);
  return status;
}

/// Looks for places of the map to which the camera has come back although no landmark that it sees says so.
class LoopClosing {
 public:
  /// \param features those of the frame, as weighed at its end
  /// \param input how a keyframe is recognised
  /// \param[in,out] map the part that the camera is in
  /// \param[in,out] frame the pose becomes the one without the drift
  /// \param[in,out] seen landmarks that the frame shows; with a loop closed those of the old place
  /// \return Closed, or None. The numbers of parts are the caller's
  PartChange update(const WeightedFeatures& features, RelocalisationInput input, LandmarkMatcher& matcher, LocalMap& map,
                    PlacedFrame& frame, std::vector<int>& seen) {
    PartChange change;
    if (!frame.placed || frame.number % kEvery != kPhase || frame.timestamp < rest_until_) return change;
    if (map.living_keyframes() <= input.window) return change;
    const int place = choose(map, seen, frame.T_world_camera, input.window);
    if (place < 0) return change;
    const int newest = map.last_keyframe() - input.window;
    const auto gather = [&](const std::vector<int>& landmarks) { matcher.collect_place(map, landmarks, input.window, newest); };
    MapPose found;
    if (!recognise_keyframe(map, features, input, place, matcher, gather, seen_there_, found)) {
      ++turn_;
      return change;
    }
    const Pose T_now_before = compose(found.T_world_camera, inverse(frame.T_world_camera));
    const Pose off = compose(inverse(frame.T_world_camera), found.T_world_camera);
    const double metres = norm(translation(off));
    const double radians = rotation_angle(off);
    if (metres < kSmall && radians < kSmallAngle) {
      rest_until_ = frame.timestamp + kRest;
      return change;
    }
    const Way way = way_from(map, place);
    if (metres > kSmall + kDrift * way.metres || radians > kSmallAngle + kDrift * way.radians) return change;
    if (!second_look_.agrees(0, found.T_world_camera, frame)) return change;
    second_look_.forget();
    const Pose T_world_last = compose(T_now_before, map.keyframe(map.last_keyframe()).T_world_camera);
    if (!succeeded(close_loop(place, T_world_last, map, change.corrections))) return change;
    change.event = PartEvent::Closed;
    frame.T_world_camera = found.T_world_camera;
    seen.swap(seen_there_);
    rest_until_ = frame.timestamp + kRest;
    return change;
  }
  /// The camera is in another part now.
  void forget() { second_look_.forget(); }

 private:
  static constexpr int kEvery = 5;             // frames: a look costs a fifth of a frame
  static constexpr int kPhase = 2;             // not the frames in which other parts are looked at
  static constexpr std::size_t kNearest = 4;   // keyframes that are looked at in turn
  static constexpr double kReach = 2.0;        // a keyframe farther off is no place that the camera may be at [m]
  static constexpr double kReachAngle = 0.8;   // [rad]
  static constexpr double kSmall = 0.03;       // a smaller drift needs no loop [m]
  static constexpr double kSmallAngle = 0.03;  // [rad]
  static constexpr double kDrift = 0.1;        // of the way: more is a place that only looks alike
  static constexpr double kRest = 2.0;         // after a loop, and where there is none to close [s]

  struct Way {
    double metres = 0;
    double radians = 0;
  };
  static Way way_from(const LocalMap& map, int keyframe) {
    Way way;
    const Pose* before = &map.keyframe(keyframe).T_world_camera;
    for (int k = keyframe + 1; k <= map.last_keyframe(); ++k) {
      if (!map.keyframe(k).alive) continue;
      const Pose step = compose(inverse(*before), map.keyframe(k).T_world_camera);
      way.metres += norm(translation(step));
      way.radians += rotation_angle(step);
      before = &map.keyframe(k).T_world_camera;
    }
    return way;
  }

  /// The keyframe to look at: one of the nearest that the camera may see though no chain of two keyframes with common landmarks leads
  /// from here to there. -1: there is none.
  int choose(const LocalMap& map, const std::vector<int>& seen, const Pose& T_world_camera, int window) {
    near_.clear();
    const Pose T_camera_world = inverse(T_world_camera);
    for (int k = map.first_keyframe(); k <= map.last_keyframe() - window; ++k) {
      if (!map.keyframe(k).alive) continue;
      const Pose T_camera_keyframe = compose(T_camera_world, map.keyframe(k).T_world_camera);
      const double remote = std::max(norm(translation(T_camera_keyframe)) / kReach, rotation_angle(T_camera_keyframe) / kReachAngle);
      if (remote < 1) near_.emplace_back(remote, k);
    }
    if (near_.empty()) return -1;
    linked_.assign(map.kept_keyframes(), 0);
    for (int k = map.last_keyframe(); k > map.last_keyframe() - window && k >= map.first_keyframe(); --k) linked_[map.slot(k)] = 1;
    marks_.begin(map.landmarks().size());
    for (int l : seen) marks_.mark(l);
    link(map);
    for (int k = map.first_keyframe(); k <= map.last_keyframe(); ++k)
      if (linked_[map.slot(k)])
        for (int l : map.keyframe(k).landmark)
          if (l >= 0) marks_.mark(l);
    link(map);
    const auto is_linked = [&](const std::pair<double, int>& each) { return linked_[map.slot(each.second)] != 0; };
    near_.erase(std::remove_if(near_.begin(), near_.end(), is_linked), near_.end());
    if (near_.empty()) return -1;
    std::sort(near_.begin(), near_.end());
    return near_[turn_ % std::min(kNearest, near_.size())].second;
  }
  /// Keyframes that show enough of the landmarks marked are linked.
  void link(const LocalMap& map) {
    for (int k = map.first_keyframe(); k <= map.last_keyframe(); ++k) {
      int shared = 0;
      for (int l : map.keyframe(k).landmark) shared += l >= 0 && marks_.marked(l) ? 1 : 0;
      if (shared >= kMinShared) linked_[map.slot(k)] = 1;
    }
  }

  SecondLook second_look_;
  std::size_t turn_ = 0;  // looks that found nothing; after one that did the next is at the same place
  double rest_until_ = 0;
  PassMarks marks_;
  std::vector<char> linked_;
  std::vector<std::pair<double, int>> near_;
  std::vector<int> seen_there_;  // landmarks of the place recognised
};

APSO_NAMESPACE_END
