/// \file
/// Trajectories and the six numbers that summarise a list of errors.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <string>
#include <type_traits>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/traits/pose.hpp>
#include <apso/traits/ranges.hpp>
#include <apso/traits/stamped_pose.hpp>

APSO_NAMESPACE_BEGIN

/// Where a body (camera, marker frame) was at one instant.
struct StampedPose {
  double timestamp = 0;                 ///< [s]
  Pose T_world_body = identity_pose();  ///< maps points of the body into the world [m]
};

template <>
struct stamped_pose_traits<StampedPose> {
  static double timestamp(const StampedPose& p) { return p.timestamp; }
  static const Pose& pose(const StampedPose& p) { return p.T_world_body; }
};

/// Poses with strictly increasing timestamps.
using Trajectory = std::vector<StampedPose>;

/// Summary of a list of errors, in the unit of the errors. All 0 when the list is empty (count == 0).
/// rmse^2 = mean^2 + std^2 holds, because `std` is the standard deviation of the population (divided by n).
struct Statistics {
  double rmse = 0;
  double mean = 0;
  double median = 0;  ///< mean of the two middle values when count is even
  double std = 0;     ///< of the population
  double min = 0;
  double max = 0;
  std::size_t count = 0;
};

/// Statistics of a list of finite values.
[[nodiscard]] inline Statistics compute_statistics(std::vector<double> values) {
  Statistics s;
  s.count = values.size();
  if (values.empty()) return s;
  for (const double v : values) expects(std::isfinite(v), "compute_statistics: a value is not finite");
  std::sort(values.begin(), values.end());  // small values first: the sums do not depend on the order given
  const double n = static_cast<double>(values.size());
  double sum = 0;
  double squares = 0;
  for (const double v : values) {
    sum += v;
    squares += v * v;
  }
  s.mean = sum / n;
  s.rmse = std::sqrt(squares / n);
  double deviation = 0;
  for (const double v : values) deviation += (v - s.mean) * (v - s.mean);
  s.std = std::sqrt(deviation / n);
  s.min = values.front();
  s.max = values.back();
  const std::size_t h = values.size() / 2;
  s.median = values.size() % 2 == 1 ? values[h] : 0.5 * (values[h - 1] + values[h]);
  return s;
}

/// Your trajectory as apso's.
/// \param range entries with stamped_pose_traits, e.g. pairs of seconds and a pose of yours
template <class Range>
[[nodiscard]] Trajectory trajectory(const Range& range) {
  using Entry = detail::range_value_t<Range>;
  check_stamped_pose<Entry>();
  Trajectory out;
  for (const auto& entry : range) {
    out.push_back({stamped_pose_traits<Entry>::timestamp(entry), to_pose(stamped_pose_traits<Entry>::pose(entry))});
  }
  return out;
}
/// Your stamps [s] and your poses as a trajectory. Throws contract_error when they are not equally many.
template <class Stamps, class Poses>
[[nodiscard]] Trajectory trajectory(const Stamps& stamps, const Poses& poses) {
  check_pose<detail::range_value_t<Poses>>();
  Trajectory out;
  auto pose = std::begin(poses);
  for (const auto& stamp : stamps) {
    expects(pose != std::end(poses), "trajectory: there are more stamps than poses");
    out.push_back({static_cast<double>(stamp), to_pose(*pose)});
    ++pose;
  }
  expects(pose == std::end(poses), "trajectory: there are more poses than stamps");
  return out;
}
/// Your trajectory as apso's: itself when it is one, else a copy in `buffer`.
template <class Range>
[[nodiscard]] const Trajectory& as_trajectory(const Range& range, Trajectory& buffer) {
  if constexpr (std::is_same_v<Range, Trajectory>) {
    (void)buffer;
    return range;
  } else {
    buffer = trajectory(range);
    return buffer;
  }
}

/// Stamps [s] of a range: of numbers, or of entries of a trajectory.
template <class Range>
[[nodiscard]] std::vector<double> timestamps(const Range& range) {
  using Entry = detail::range_value_t<Range>;
  std::vector<double> stamps;
  for (const auto& entry : range) {
    if constexpr (std::is_arithmetic_v<Entry>) {
      stamps.push_back(static_cast<double>(entry));
    } else {
      check_stamped_pose<Entry>();
      stamps.push_back(stamped_pose_traits<Entry>::timestamp(entry));
    }
  }
  return stamps;
}

/// Throws contract_error unless every pose is finite and timestamps are finite and strictly increasing.
/// \param name how the trajectory is called in the message
inline void validate(const Trajectory& trajectory, const std::string& name) {
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    if (!std::isfinite(trajectory[i].timestamp) || !is_finite(trajectory[i].T_world_body)) {
      contract_violation(name + ": pose " + std::to_string(i) + " is not finite");
    }
    if (i > 0 && !(trajectory[i - 1].timestamp < trajectory[i].timestamp)) {
      contract_violation(name + ": timestamps must be strictly increasing, broken at pose " + std::to_string(i));
    }
  }
}

APSO_NAMESPACE_END
