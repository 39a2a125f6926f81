/// \file
/// Reads the results of a run of apso_track, and adds the true error of every frame.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <apso/evaluation/trajectory.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/math/se3.hpp>
#include <apso/quality/assessment.hpp>

#include "stamps.hpp"

namespace track {

inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// One frame of a run.
struct RunFrame {
  double timestamp = 0;
  std::string state;
  std::string label;           ///< known difficulty; empty: none known
  std::string refine_status;   ///< empty: not refined
  std::string explanation;     ///< why the frame has its state
  std::vector<double> value;   ///< by column of the table; NaN if the field is empty or not a number
  bool lost = false;           ///< the feature tracker had no pose
  double rpe_1f = kNone;       ///< translational error of the motion since the frame before [m]
  double rotation_1f = kNone;  ///< [rad]
  double rpe_1s = kNone;       ///< ... since one second before [m]
  bool failed = false;         ///< lost, or rpe_1f above a multiple of its median
  double final_1f = kNone;     ///< error of the motion of the final pose since the frame before: translation [m]
  double final_angle = kNone;  ///< ... rotation [rad]
  double before = kNone;       ///< BAD frames: error of the feature pose since the last GOOD frame [m]
  double after = kNone;        ///< ... of the final pose
  [[nodiscard]] bool decided() const { return state != "INITIALISING"; }
  [[nodiscard]] bool flagged() const { return state == "BAD" || state == "LOST"; }
};

struct Run {
  std::string name;
  std::map<std::string, std::size_t> column;
  std::vector<RunFrame> frames;
  double median_rpe_1f = kNone;  ///< [m]
  int with_pose = 0;             ///< frames that are not LOST
  bool compared = true;          ///< false: there is ground truth, and no frame could be compared with it
  [[nodiscard]] double at(const RunFrame& f, const std::string& name_of_column) const {
    const auto c = column.find(name_of_column);
    return c == column.end() ? kNone : f.value[c->second];
  }
};

/// Fields of a line of CSV; quotes may hold commas.
inline std::vector<std::string> split_csv(const std::string& line) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (const char c : line) {
    if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      fields.emplace_back();
    } else {
      fields.back() += c;
    }
  }
  return fields;
}

inline double median_of(std::vector<double> v) {
  v.erase(std::remove_if(v.begin(), v.end(), [](double x) { return !std::isfinite(x); }), v.end());
  if (v.empty()) return kNone;
  const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), middle, v.end());
  return *middle;
}

/// Pose within `tolerance` seconds of a time; null if there is none.
inline const apso::Pose* pose_near(const apso::Trajectory& t, double time, double tolerance) {
  const auto it = std::lower_bound(t.begin(), t.end(), time, [](const apso::StampedPose& p, double s) { return p.timestamp < s; });
  const apso::StampedPose* best = nullptr;
  if (it != t.end()) best = &*it;
  if (it != t.begin() && (best == nullptr || time - (it - 1)->timestamp < best->timestamp - time)) best = &*(it - 1);
  return best != nullptr && std::abs(best->timestamp - time) <= tolerance ? &best->T_world_body : nullptr;
}

/// \param folder      of a run of apso_track
/// \param groundtruth file to use instead of the run's own; empty: the run's own
/// \param failure_factor multiple of the median 1-frame error from which a frame counts as failed
inline Run read_run(const std::string& folder, const std::string& groundtruth = {}, double failure_factor = 3) {
  namespace fs = std::filesystem;
  const std::string table = (fs::path(folder) / "frames.csv").string();
  std::ifstream stream(table);
  if (!stream) throw apso::io_error(table + ": cannot open; expected a folder written by apso_track");
  Run run;
  run.name = fs::path(folder).lexically_normal().filename().string();
  if (run.name.empty()) run.name = fs::path(folder).parent_path().filename().string();
  std::string line;
  std::getline(stream, line);
  const std::vector<std::string> header = split_csv(line);
  for (std::size_t i = 0; i < header.size(); ++i) run.column[header[i]] = i;
  for (const char* needed : {"timestamp", "state", "label", "S_final", "S_total", "feature_ok"}) {
    if (run.column.count(needed) == 0) throw apso::io_error(table + ":1: the column '" + needed + "' is missing");
  }
  for (int number = 2; std::getline(stream, line); ++number) {
    const std::vector<std::string> fields = split_csv(line);
    if (fields.size() != header.size()) {
      throw apso::io_error(table + ":" + std::to_string(number) + ": expected " + std::to_string(header.size()) + " fields, got " +
                           std::to_string(fields.size()));
    }
    RunFrame f;
    for (const std::string& text : fields) {
      char* end = nullptr;
      const double v = std::strtod(text.c_str(), &end);
      f.value.push_back(end != text.c_str() && *end == 0 ? v : kNone);
    }
    f.timestamp = run.at(f, "timestamp");
    f.state = fields[run.column["state"]];
    const auto known = enum_names(apso::SceneState{});
    if (std::find(known.begin(), known.end(), f.state) == known.end()) {
      throw apso::io_error(table + ":" + std::to_string(number) + ": the state is '" + f.state +
                           "', expected INITIALISING, GOOD, BAD or LOST");
    }
    f.label = fields[run.column["label"]];
    const auto text = [&](const char* column) { return run.column.count(column) != 0 ? fields[run.column[column]] : std::string(); };
    f.refine_status = text("refine_status");
    f.explanation = text("explanation");
    f.lost = run.at(f, "feature_ok") == 0;
    run.frames.push_back(std::move(f));
  }

  const auto count = [&](auto&& has) { return std::count_if(run.frames.begin(), run.frames.end(), has); };
  run.with_pose = static_cast<int>(count([](const RunFrame& f) { return f.state != "LOST"; }));
  const std::string truth_file = groundtruth.empty() ? (fs::path(folder) / "groundtruth.txt").string() : groundtruth;
  if (groundtruth.empty() && !fs::exists(truth_file)) return run;  // decisions without truth
  const apso::Trajectory truth = apso::read_trajectory(truth_file);
  expect_seconds(truth, truth_file);
  const auto poses = [&](const char* file, bool any) {
    return any ? apso::read_trajectory((fs::path(folder) / file).string()) : apso::Trajectory{};
  };
  const apso::Trajectory features = poses("trajectory_features.txt", count([](const RunFrame& f) { return !f.lost; }) > 0);
  const apso::Trajectory finals = poses("trajectory.txt", run.with_pose > 0);
  constexpr double same = 1e-5;   // between files of one run [s]
  constexpr double close = 0.02;  // to the ground truth [s]
  const auto difference = [&](const apso::Pose& a0, const apso::Pose& a1, double t0, double t1) {
    const apso::Pose* g0 = pose_near(truth, t0, close);
    const apso::Pose* g1 = pose_near(truth, t1, close);
    if (g0 == nullptr || g1 == nullptr) return apso::Pose(Eigen::Matrix4d::Constant(kNone));
    return apso::inverse(apso::inverse(*g0) * *g1) * (apso::inverse(a0) * a1);
  };
  double anchor = kNone;
  std::vector<double> errors;
  for (std::size_t i = 0; i < run.frames.size(); ++i) {
    RunFrame& f = run.frames[i];
    const apso::Pose* now = f.lost ? nullptr : pose_near(features, f.timestamp, same);
    const auto since = [&](double t0, double* rotation) {
      const apso::Pose* then = pose_near(features, t0, same);
      if (now == nullptr || then == nullptr) return kNone;
      const apso::Pose d = difference(*then, *now, t0, f.timestamp);
      if (rotation != nullptr) *rotation = std::isfinite(d(0, 0)) ? apso::rotation_angle(d) : kNone;
      return d.translation().norm();
    };
    if (i > 0 && !run.frames[i - 1].lost) f.rpe_1f = since(run.frames[i - 1].timestamp, &f.rotation_1f);
    for (std::size_t k = i; k-- > 0;) {
      if (f.timestamp - run.frames[k].timestamp < 1 - 1e-6) continue;
      if (!run.frames[k].lost) f.rpe_1s = since(run.frames[k].timestamp, nullptr);
      break;
    }
    errors.push_back(f.rpe_1f);
    if (i > 0) {
      const apso::Pose* last = pose_near(finals, run.frames[i - 1].timestamp, same);
      const apso::Pose* own = pose_near(finals, f.timestamp, same);
      if (last != nullptr && own != nullptr) {
        const apso::Pose d = difference(*last, *own, run.frames[i - 1].timestamp, f.timestamp);
        f.final_1f = d.translation().norm();
        if (std::isfinite(f.final_1f)) f.final_angle = apso::rotation_angle(d);
      }
    }
    if (f.state == "GOOD") anchor = f.timestamp;
    if (f.state == "BAD" && std::isfinite(anchor)) {
      const apso::Pose* a = pose_near(finals, anchor, same);
      const apso::Pose* last = pose_near(finals, f.timestamp, same);
      if (a != nullptr && last != nullptr && now != nullptr) {
        f.before = difference(*a, *now, anchor, f.timestamp).translation().norm();
        f.after = difference(*a, *last, anchor, f.timestamp).translation().norm();
      }
    }
  }
  run.median_rpe_1f = median_of(errors);
  run.compared = !(features.size() > 1 && std::isnan(run.median_rpe_1f));
  for (RunFrame& f : run.frames) f.failed = f.lost || f.rpe_1f > failure_factor * run.median_rpe_1f;
  return run;
}

}  // namespace track
