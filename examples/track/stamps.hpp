/// \file
/// Timestamps that are no seconds, or far apart.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <string>
#include <vector>

#include <apso/evaluation/trajectory.hpp>
#include <apso/io/tum_text.hpp>

namespace track {

/// Median time from one stamp to the next [s]; 0 with less than two.
inline double median_step(const std::vector<double>& stamps) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < stamps.size(); ++i) steps.push_back(stamps[i] - stamps[i - 1]);
  if (steps.empty()) return 0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

/// The unit that stamps have instead of seconds; empty if they may be seconds. Either they are too large for the time since
/// 1970, which is 1.8e9 s, or they are too far apart for a camera.
inline std::string other_unit(const std::vector<double>& stamps) {
  if (stamps.empty()) return {};
  const double largest = std::abs(stamps.back());
  const double step = median_step(stamps);
  if (largest > 1e17 || step > 1e6) return "nanoseconds";
  if (largest > 1e14 || step > 1e4) return "microseconds";
  if (largest > 1e11) return "milliseconds";
  return {};
}

/// What is wrong with the stamps of a recording; empty if nothing is.
inline std::string stamp_problem(const std::vector<double>& stamps) {
  constexpr double far_apart = 1;  // [s]
  char text[240] = "";
  const double step = median_step(stamps);
  if (const std::string unit = other_unit(stamps); !unit.empty()) {
    std::snprintf(text, sizeof text, "the timestamps look like %s (%.17g, median step %.6g), expected seconds", unit.c_str(),
                  stamps.front(), step);
  } else if (step > far_apart) {
    std::snprintf(text, sizeof text,
                  "the frames are %.3g s apart (median), or the timestamps are no seconds: frames are rated by comparing neighbours, "
                  "expected 10 or more per second",
                  step);
  }
  return text;
}

/// Throws io_error when the stamps of a trajectory are no seconds. \param file for the message
inline void expect_seconds(const apso::Trajectory& trajectory, const std::string& file) {
  std::vector<double> stamps;
  for (const apso::StampedPose& p : trajectory) stamps.push_back(p.timestamp);
  const std::string unit = other_unit(stamps);
  if (!unit.empty()) throw apso::io_error(file + ": " + stamp_problem(stamps));
}

/// Why two trajectories cannot be compared: their times do not meet. Neither may be empty.
/// \param limit largest difference of two stamps that belong together [s]
inline std::string too_few_pairs(std::size_t pairs, double limit, int needed, const apso::Trajectory& truth,
                                 const apso::Trajectory& estimate) {
  char text[400];
  std::snprintf(text, sizeof text,
                "%zu pair(s) of poses within %g s, need %d: the ground truth covers %.3f .. %.3f s, the estimate %.3f .. %.3f s", pairs,
                limit, needed, truth.front().timestamp, truth.back().timestamp, estimate.front().timestamp, estimate.back().timestamp);
  return text;
}

}  // namespace track
