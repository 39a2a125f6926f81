/// \file
/// Poses at the stamps of frames that were seen some time before.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <apso/evaluation/trajectory.hpp>
#include <apso/math/se3.hpp>

namespace track {

/// Poses at the stamps: each between those of the frames that were seen before and after that time. Where there is none after it, as at the
/// end, or none within 0.2 s, the pose goes on as it moved from the neighbour on the other side; without one it stays as it is.
/// \param seen  poses at the time at which the frames were seen, with the stamps of the frames, which ascend
/// \param delay stamp of a frame less the time at which it was seen [s]; negative: the stamp came first
inline apso::Trajectory at_stamps(const apso::Trajectory& seen, double delay) {
  constexpr double longest_gap = 0.2;  // [s]
  apso::Trajectory out = seen;
  if (delay == 0) return out;
  // on the way from a to b, and beyond it
  const auto on_the_way = [](const apso::StampedPose& a, const apso::StampedPose& b, double time) {
    const apso::Twist way = apso::se3_log(apso::compose(apso::inverse(a.T_world_body), b.T_world_body));
    return apso::compose(a.T_world_body, apso::se3_exp((time - a.timestamp) / (b.timestamp - a.timestamp) * way));
  };
  const auto near = [&](const apso::StampedPose& a, const apso::StampedPose& b) {
    return std::abs(a.timestamp - b.timestamp) <= longest_gap;
  };
  for (auto i = seen.begin(); i != seen.end(); ++i) {
    const double time = i->timestamp + delay;  // the stamp it would have if it had been seen at this one
    const auto after =
        std::lower_bound(seen.begin(), seen.end(), time, [](const apso::StampedPose& p, double t) { return p.timestamp < t; });
    apso::Pose& T = out[static_cast<std::size_t>(i - seen.begin())].T_world_body;
    if (after != seen.begin() && after != seen.end() && near(*(after - 1), *after)) {
      T = on_the_way(*(after - 1), *after, time);
    } else if (delay > 0 && i != seen.begin() && near(*(i - 1), *i)) {
      T = on_the_way(*(i - 1), *i, time);
    } else if (delay < 0 && i + 1 != seen.end() && near(*i, *(i + 1))) {
      T = on_the_way(*i, *(i + 1), time);
    }
  }
  return out;
}

}  // namespace track
