/// \file
/// Trajectories and the six numbers that summarise a list of errors.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>

APSO_NAMESPACE_BEGIN

/// Where a body (camera, marker frame) was at one instant.
struct StampedPose {
  double timestamp = 0;                  ///< [s]
  Pose T_world_body = Pose::Identity();  ///< maps points of the body into the world [m]
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

/// Timestamps of a trajectory [s].
[[nodiscard]] inline std::vector<double> timestamps(const Trajectory& trajectory) {
  std::vector<double> stamps;
  stamps.reserve(trajectory.size());
  for (const StampedPose& p : trajectory) stamps.push_back(p.timestamp);
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

/// Pose at time t: positions linearly, rotations by slerp between the two neighbours. A diagnostic: published
/// numbers use the nearest stamp, and so do ate() and rpe().
/// \param max_gap largest distance of the two neighbours [s]
/// \return nothing outside the trajectory or inside a gap longer than max_gap
[[nodiscard]] inline std::optional<Pose> interpolate(const Trajectory& trajectory, double t, double max_gap = 0.1) {
  const auto after = std::lower_bound(trajectory.begin(), trajectory.end(), t,
                                      [](const StampedPose& p, double stamp) { return p.timestamp < stamp; });
  if (after == trajectory.end()) return std::nullopt;
  if (after->timestamp == t) return after->T_world_body;
  if (after == trajectory.begin()) return std::nullopt;
  const StampedPose& p0 = *(after - 1);
  const StampedPose& p1 = *after;
  const double gap = p1.timestamp - p0.timestamp;
  if (!(gap <= max_gap)) return std::nullopt;
  const double s = (t - p0.timestamp) / gap;
  const Eigen::Quaterniond q = unit(slerp(quaternion(p0.T_world_body), quaternion(p1.T_world_body), s));
  return make_pose(rotation(q), plus(times(1.0 - s, translation(p0.T_world_body)), times(s, translation(p1.T_world_body))));
}

/// A trajectory interpolated at the stamps of another one; stamps that cannot be interpolated are left out.
[[nodiscard]] inline Trajectory resample(const Trajectory& trajectory, const std::vector<double>& stamps,
                                         double max_gap = 0.1) {
  Trajectory out;
  out.reserve(stamps.size());
  for (const double t : stamps) {
    if (const std::optional<Pose> T = interpolate(trajectory, t, max_gap)) out.push_back({t, *T});
  }
  return out;
}

APSO_NAMESPACE_END
