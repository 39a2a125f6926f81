/// \file
/// The trajectory of a camera whose map has several parts.
#pragma once

#include <algorithm>
#include <cstddef>
#include <type_traits>
#include <vector>

#include <apso/config.hpp>
#include <apso/evaluation/trajectory.hpp>
#include <apso/math/se3.hpp>
#include <apso/traits/pose.hpp>

APSO_NAMESPACE_BEGIN

/// Poses of all parts of a map, kept where the parts are now.
class PartedTrajectory {
 public:
  /// \param T_world_camera any type with pose_traits
  template <class PoseT>
  void add(double timestamp, const PoseT& T_world_camera, int part) {
    poses_.push_back({{timestamp, to_pose(T_world_camera)}, part});
  }
  /// Moves the poses of a part that was joined with another one, or in which a loop was closed.
  /// \param change of LandmarkTracker::reconnect(), or alike
  template <class Change>
  void follow(const Change& change) {
    using PoseT = std::decay_t<decltype(change.T_part_before)>;
    if (!change.moves_poses()) return;
    for (Entry& e : poses_) {
      if (e.part != change.before) continue;
      e.pose.T_world_body = to_pose(change.moved(e.pose.timestamp, from_pose<PoseT>(e.pose.T_world_body)));
      e.part = change.part;
    }
  }
  /// Poses of one part, and of all that became pieces of it.
  [[nodiscard]] Trajectory of(int part) const {
    Trajectory t;
    for (const Entry& e : poses_)
      if (e.part == part) t.push_back(e.pose);
    return t;
  }
  /// The part with the most poses, of several the first; 0 without any.
  [[nodiscard]] int largest() const {
    std::vector<int> count(1, 0);
    for (const Entry& e : poses_) {
      count.resize(std::max(count.size(), static_cast<std::size_t>(e.part) + 1), 0);
      ++count[static_cast<std::size_t>(e.part)];
    }
    return static_cast<int>(std::max_element(count.begin(), count.end()) - count.begin());
  }
  [[nodiscard]] std::size_t size() const { return poses_.size(); }

 private:
  struct Entry {
    StampedPose pose;
    int part = 0;
  };
  std::vector<Entry> poses_;
};

APSO_NAMESPACE_END
