/// \file
/// The errors of one estimate, with everything that must be known to believe them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <apso/evaluation/ate.hpp>
#include <apso/evaluation/rpe.hpp>
#include <apso/io/trajectory_file.hpp>

#include "../track/stamps.hpp"

namespace eval {

/// Fewer poses than this share with an error make a figure that hides something.
inline constexpr double enough_pairs = 0.9;

/// What the errors of all estimates are computed by.
struct Rules {
  apso::AteOptions ate;
  apso::RpeOptions rpe;
  std::string delta = "1s";  ///< as the user wrote it
  bool has_stamps = true;    ///< false: poses belong together by their number
};

/// A file of poses that has been read.
struct Poses {
  std::string path;
  std::string name;  ///< in tables
  apso::TrajectoryFile file;
  [[nodiscard]] const apso::Trajectory& trajectory() const { return file.trajectory; }
};

/// Errors of one estimate.
struct Errors {
  Poses estimate;
  apso::AteResult ate;
  apso::RpeResult rpe;
  std::size_t possible = 0;  ///< pairs that there could be: poses of the estimate, or of the ground truth meanwhile if these are fewer
  std::vector<std::string> warnings;
  [[nodiscard]] double share() const { return possible > 0 ? static_cast<double>(ate.pairs.size()) / static_cast<double>(possible) : 0; }
};

/// Parses "1s", "0.5s", "5f", "2m", "10deg", "0.1rad".
inline void parse_delta(const std::string& text, apso::RpeOptions& options) {
  const std::string expected = "--delta '" + text + "': expected a positive number and a unit, e.g. 1s, 0.5s, 1f, 2m, 10deg, 1rad";
  const std::size_t end = text.find_first_not_of("0123456789.");
  if (end == std::string::npos || end == 0) throw std::invalid_argument(expected);
  std::size_t used = 0;
  try {
    options.delta = std::stod(text.substr(0, end), &used);
  } catch (const std::logic_error&) {
    throw std::invalid_argument(expected);
  }
  const auto names = enum_names(apso::DeltaUnit{});
  const auto unit = std::find(names.begin(), names.end(), text.substr(end));
  if (used != end || unit == names.end()) throw std::invalid_argument(expected);
  options.unit = static_cast<apso::DeltaUnit>(unit - names.begin());
  if (!(options.delta >= 1e-9 && options.delta <= 1e9)) throw std::invalid_argument(expected);
  if (options.unit == apso::DeltaUnit::Frames && options.delta != std::floor(options.delta)) {
    throw std::invalid_argument("--delta '" + text + "': expected a whole number of frames");
  }
}

/// The value of an enumeration that has this name. Throws when none has.
template <class E>
E enum_value(const std::string& name) {
  const auto names = enum_names(E{});
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw std::invalid_argument("'" + name + "' is not known");
  return static_cast<E>(found - names.begin());
}
template <class E>
std::string enum_name(E value) {
  return enum_names(value)[static_cast<std::size_t>(value)];
}

/// Reads a file of poses.
/// \param format "auto" or a name of TrajectoryFormat
/// \param times  stamps of a KITTI file; ignored for the other formats, which have their own
inline Poses read_poses(const std::string& path, const std::string& format, const std::string& times, std::vector<std::string>& warnings) {
  std::optional<apso::TrajectoryFormat> forced;
  if (format != "auto") forced = enum_value<apso::TrajectoryFormat>(format);
  Poses poses{path, {}, apso::read_trajectory_file(path, forced, times, &warnings)};
  if (poses.file.format != apso::TrajectoryFormat::Tum) return poses;
  try {
    track::expect_seconds(poses.trajectory(), path);
  } catch (const apso::io_error& e) {
    throw apso::io_error(std::string(e.what()) + "; nanoseconds are read with --format tum_ns or auto");
  }
  return poses;
}

/// Largest difference of time of a pair [s].
inline double limit_of(const apso::AteOptions& options) {
  return options.max_difference > 0 ? options.max_difference : apso::default_max_difference(options.association);
}

inline std::string association_text(const Rules& rules) {
  if (!rules.has_stamps) return "by frame: poses of the same number";
  const apso::AteOptions& options = rules.ate;
  char text[120];
  if (options.association == apso::AssociationRule::Tum) {
    std::snprintf(text, sizeof text, "tum: greedy one-to-one, stamps less than %g s apart", limit_of(options));
  } else {
    std::snprintf(text, sizeof text, "evo: nearest stamp of the longer list, at most %g s apart", limit_of(options));
  }
  return text;
}

inline std::string alignment_text(const apso::AteOptions& options) {
  switch (options.alignment) {
    case apso::TrajectoryAlignment::Se3:
      return "se3: rigid, least squares, no scale";
    case apso::TrajectoryAlignment::None:
      return "none";
    case apso::TrajectoryAlignment::Sim3:
      return "sim3: rigid with a scale, least squares; the relative errors are of the scaled estimate";
    case apso::TrajectoryAlignment::Yaw:
      return "yaw: translation and turn about " + enum_name(options.gravity_axis) + ", least squares";
  }
  return {};
}

inline std::string form_text(const apso::RpeOptions& options) {
  return options.form == apso::RpeForm::TumScript ? "tum: as evaluate_rpe.py --fixed_delta"
                                                  : "paper: as printed by Sturm et al. and computed by evo";
}

/// Computes the errors of one estimate. Throws when there is no ATE.
inline Errors errors_of(const Poses& truth, const Poses& estimate, const Rules& rules) {
  Errors e;
  e.estimate = estimate;
  const auto fail = [&](const std::string& what) { throw std::runtime_error(estimate.path + ": " + what); };
  if (truth.file.has_stamps != estimate.file.has_stamps) {
    fail(std::string(truth.file.has_stamps ? "the poses have no stamps, those of the ground truth have"
                                           : "the poses have stamps, those of the ground truth have none") +
         ": give the times of the KITTI file with --times");
  }
  const double limit = limit_of(rules.ate);
  e.ate = apso::ate(truth.trajectory(), estimate.trajectory(), rules.ate);
  if (!apso::succeeded(e.ate.status)) {
    fail(track::too_few_pairs(e.ate.pairs.size(), limit, apso::pairs_needed(rules.ate.alignment), truth.trajectory(),
                              estimate.trajectory()));
  }
  if (!std::isfinite(e.ate.statistics.rmse)) fail("the error is not finite: positions are too far away");
  const auto warn = [&](const std::string& text) { e.warnings.push_back(estimate.path + ": " + text); };
  if (e.ate.status == apso::Status::Degenerate) {
    warn("the positions lie on a line or in one point: the rotation of the alignment is not unique");
  }

  const double begin = estimate.trajectory().front().timestamp + rules.ate.time_offset - limit;
  const double end = estimate.trajectory().back().timestamp + rules.ate.time_offset + limit;
  const auto meanwhile = std::count_if(truth.trajectory().begin(), truth.trajectory().end(),
                                       [&](const apso::StampedPose& p) { return p.timestamp >= begin && p.timestamp <= end; });
  e.possible = std::min(estimate.trajectory().size(), static_cast<std::size_t>(meanwhile));
  if (e.share() < enough_pairs) {
    char text[240];
    std::snprintf(
        text, sizeof text,
        "the ATE is over %zu of %zu poses (%.1f %%), less than 90 %%: the others have no true pose within %g s (--max-difference)",
        e.ate.pairs.size(), e.possible, 100 * e.share(), limit);
    warn(rules.has_stamps
             ? text
             : "the ATE is over " + std::to_string(e.ate.pairs.size()) + " of " + std::to_string(e.possible) + " poses, less than 90 %");
  }
  if (rules.ate.alignment == apso::TrajectoryAlignment::Sim3 && e.ate.scale != 1) {
    e.rpe = apso::rpe(truth.trajectory(), apso::aligned(estimate.trajectory(), e.ate), rules.rpe);
  } else {
    e.rpe = apso::rpe(truth.trajectory(), estimate.trajectory(), rules.rpe);
  }
  if (!apso::succeeded(e.rpe.status)) warn("no pair of poses is " + rules.delta + " apart: no relative error");
  return e;
}

/// Warnings about estimates that have fewer than 90 % of the pairs of another: their figures are of different poses.
inline std::vector<std::string> compare_pairs(const std::vector<Errors>& all) {
  std::size_t most = 0;
  for (const Errors& e : all) most = std::max(most, e.ate.pairs.size());
  std::vector<std::string> warnings;
  for (const Errors& e : all) {
    if (static_cast<double>(e.ate.pairs.size()) >= enough_pairs * static_cast<double>(most)) continue;
    warnings.push_back(e.estimate.path + ": " + std::to_string(e.ate.pairs.size()) + " pairs, another estimate has " +
                       std::to_string(most) + ": the figures are of different poses");
  }
  return warnings;
}

}  // namespace eval
