/// \file
/// What a map tells when the poses that were given lie elsewhere now: in another part of it, or corrected by a loop.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/traits/pose.hpp>

APSO_NAMESPACE_BEGIN

/// What became of the part of the map that the poses lie in.
enum class PartEvent {
  None,
  Left,    ///< the poses to come lie in another part, new or found again: no pose before says anything about them
  Joined,  ///< it was recognised in an earlier one, and is now a piece of that
  Closed,  ///< the camera came back to a place of the same part, and the drift of the way round was taken out
};
constexpr std::array<const char*, 4> enum_names(PartEvent) { return {"none", "left", "joined", "closed"}; }
[[nodiscard]] constexpr const char* to_string(PartEvent e) { return enum_names(e)[static_cast<std::size_t>(e)]; }

/// How far a loop has moved the poses of one time.
template <class PoseT = Pose>
struct BasicCorrection {
  double timestamp = 0;                                    ///< of a keyframe [s]
  PoseT T_now_before = from_pose<PoseT>(identity_pose());  ///< takes the pose before to the one now: T_now_before T_world_camera
};

/// \tparam PoseT your pose type
template <class PoseT = Pose>
struct BasicPartChange {
  PartEvent event = PartEvent::None;
  int part = 0;                                             ///< that the poses to come lie in; the first is 0
  int before = 0;                                           ///< that the poses up to now lie in
  PoseT T_part_before = from_pose<PoseT>(identity_pose());  ///< Joined: takes the poses of `before` to `part`
  std::vector<BasicCorrection<PoseT>> corrections;          ///< Closed: by time, the earliest first

  [[nodiscard]] bool joined() const { return event == PartEvent::Joined; }
  [[nodiscard]] bool closed() const { return event == PartEvent::Closed; }
  /// Whether the poses of `before` have moved, as moved() tells.
  [[nodiscard]] bool moves_poses() const { return joined() || closed(); }

  /// A pose of `before` as it is now; between two keyframes of a loop what moved them is interpolated. O(log corrections).
  /// \param timestamp of the pose [s]
  [[nodiscard]] PoseT moved(double timestamp, const PoseT& T_world_camera) const {
    if (joined()) return from_pose<PoseT>(compose(to_pose(T_part_before), to_pose(T_world_camera)));
    if (corrections.empty()) return T_world_camera;
    const auto earlier = [](double t, const BasicCorrection<PoseT>& c) { return t < c.timestamp; };
    const auto next = std::upper_bound(corrections.begin(), corrections.end(), timestamp, earlier);
    const auto& last = next == corrections.begin() ? corrections.front() : *(next - 1);
    const auto& following = next == corrections.end() ? corrections.back() : *next;
    const double interval = following.timestamp - last.timestamp;
    const double share = interval > 0 ? (timestamp - last.timestamp) / interval : 0.0;
    return from_pose<PoseT>(compose(sclerp(to_pose(last.T_now_before), to_pose(following.T_now_before), share), to_pose(T_world_camera)));
  }
};
using PartChange = BasicPartChange<>;

template <class PoseT>
[[nodiscard]] BasicPartChange<PoseT> in_type(const PartChange& c) {
  BasicPartChange<PoseT> out{c.event, c.part, c.before, from_pose<PoseT>(c.T_part_before), {}};
  for (const auto& each : c.corrections) out.corrections.push_back({each.timestamp, from_pose<PoseT>(each.T_now_before)});
  return out;
}

APSO_NAMESPACE_END
