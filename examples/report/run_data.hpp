/// \file
/// A folder of a run as the data that a report shows.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <apso/evaluation/ate.hpp>
#include <apso/evaluation/trajectory.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/quality/assessment.hpp>

#include "../track/run_folder.hpp"
#include "events.hpp"

namespace report {

namespace fs = std::filesystem;
using nlohmann::json;

/// A position, to 0.01 mm.
inline json point(const Eigen::Vector3d& p) {
  const auto r = [](double v) { return std::round(v * 1e5) / 1e5; };
  return {r(p.x()), r(p.y()), r(p.z())};
}

/// The last part of a path; of a synthetic sequence its name.
inline std::string sequence_name(const std::string& sequence) {
  const std::string prefix = "synthetic:";
  if (sequence.rfind(prefix, 0) == 0) return sequence.substr(prefix.size());
  const fs::path path = fs::path(sequence).lexically_normal();
  const std::string name = path.has_filename() ? path.filename().string() : path.parent_path().filename().string();
  return name.empty() || name == "." || name == ".." ? fs::absolute(path).lexically_normal().filename().string() : name;
}

inline json read_summary(const fs::path& folder) {
  const fs::path file = folder / "summary.json";
  std::ifstream stream(file);
  if (!stream) throw apso::io_error(file.string() + ": cannot open; expected a folder written by apso_track");
  try {
    json summary = json::parse(stream);
    for (const char* key : {"sequence", "version", "frames", "ms", "options"}) (void)summary.at(key);
    return summary;
  } catch (const json::exception& e) {
    throw apso::io_error(file.string() + ": not a summary of apso_track: " + e.what());
  }
}

/// Positions of an estimate by frame, laid onto the ground truth if there is one, with their errors. null: no pose, no error.
struct EstimateData {
  json position = json::array();
  json error = json::array();
  bool aligned = false;
};
inline EstimateData estimate_data(const track::Run& run, const apso::Trajectory& estimate, const apso::Trajectory& truth) {
  apso::Pose T = apso::identity_pose();
  std::map<const apso::Pose*, double> error_of;
  EstimateData data;
  if (!truth.empty() && !estimate.empty()) {
    const apso::AteResult ate = apso::ate(truth, estimate);  // by the defaults, as in summary.json: the same pairs
    data.aligned = succeeded(ate.status);
    if (data.aligned) {
      T = ate.T_groundtruth_estimate;
      for (std::size_t i = 0; i < ate.pairs.size(); ++i) error_of[&estimate[ate.pairs[i].second].T_world_body] = ate.errors[i];
    }
  }
  for (const track::RunFrame& f : run.frames) {
    const apso::Pose* pose = track::pose_near(estimate, f.timestamp, 1e-5);
    const auto error = error_of.find(pose);
    data.position.push_back(pose == nullptr ? json() : point(T * pose->translation()));
    data.error.push_back(error == error_of.end() ? json() : json(error->second));
  }
  return data;
}

/// Settings as "group.name": value.
inline json flat(const json& options) {
  json all = json::object();
  const json paths = options.flatten();
  for (const auto& [path, value] : paths.items()) {
    std::string name = path.empty() ? path : path.substr(1);
    for (char& c : name) c = c == '/' ? '.' : c;
    all[name] = value;
  }
  return all;
}

/// The columns of numbers of the table of frames.
inline json columns(const track::Run& run) {
  json all = json::object();
  const double t0 = run.frames.front().timestamp;
  for (const auto& [name, index] : run.column) {
    if (name == "state" || name == "label" || name == "explanation" || name == "refine_status") continue;
    json values = json::array();
    for (const track::RunFrame& f : run.frames) values.push_back(std::isfinite(f.value[index]) ? json(f.value[index]) : json());
    all[name] = std::move(values);
  }
  json time = json::array();
  for (const track::RunFrame& f : run.frames) time.push_back(std::round((f.timestamp - t0) * 1e6) / 1e6);
  all["time"] = std::move(time);
  return all;
}

/// Everything that a report shows of a run, but for its pictures. Throws io_error for a folder that is none of a run.
/// \param name of the run; empty: that of the folder
inline json run_data(const fs::path& folder, const std::string& name = {}) {
  if (!fs::is_directory(folder)) throw apso::io_error(folder.string() + ": no such folder; expected a folder written by apso_track");
  const track::Run run = track::read_run(folder.string());
  if (run.frames.empty()) throw apso::io_error((folder / "frames.csv").string() + ": holds no frame, there is nothing to report");
  const json summary = read_summary(folder);
  const auto poses = [&](const char* file) {
    const fs::path path = folder / file;
    return fs::exists(path) && fs::file_size(path) > 0 ? apso::read_trajectory(path.string()) : apso::Trajectory{};
  };
  const apso::Trajectory truth = poses("groundtruth.txt");
  const apso::Trajectory final_poses = run.with_pose > 0 ? poses("trajectory.txt") : apso::Trajectory{};
  const bool features = std::any_of(run.frames.begin(), run.frames.end(), [](const track::RunFrame& f) { return !f.lost; });
  const apso::Trajectory feature_poses = features ? poses("trajectory_features.txt") : apso::Trajectory{};

  json data;
  data["name"] = name.empty() ? run.name : name;
  data["sequence"] = sequence_name(summary.at("sequence").get<std::string>());
  for (const char* key : {"version", "command", "motion", "failure", "evaluation_problem", "frames", "ms", "final", "features"}) {
    data["summary"][key] = summary.value(key, json());
  }
  data["options"] = flat(summary.at("options"));
  data["options"]["motion policy"] = summary.value("motion", json());
  data["columns"] = columns(run);
  for (const char* text : {"state", "label", "refine_status", "explanation"}) data[text] = json::array();
  for (const track::RunFrame& f : run.frames) {
    data["state"].push_back(f.state);
    data["label"].push_back(f.label);
    data["refine_status"].push_back(f.refine_status);
    data["explanation"].push_back(f.explanation);
  }
  EstimateData estimate = estimate_data(run, final_poses, truth);
  data["position"] = std::move(estimate.position);
  data["error"] = std::move(estimate.error);
  EstimateData by_features = estimate_data(run, feature_poses, truth);
  data["feature_position"] = std::move(by_features.position);
  data["feature_error"] = std::move(by_features.error);
  data["truth"] = json::array();
  if (estimate.aligned) {
    const double first = run.frames.front().timestamp, last = run.frames.back().timestamp;
    for (const apso::StampedPose& p : truth) {
      if (p.timestamp >= first && p.timestamp <= last) data["truth"].push_back(point(p.T_world_body.translation()));
    }
  }
  const json parts = summary.value("parts", json::object());
  data["events"] = events(run, summary.value("skipped", json::array()), parts.value("changes", json::array()));
  data["frame_scores"] = json::array();
  data["change_scores"] = json::array();
  apso::for_each_frame_score(apso::Assessment{}, [&](const char* score, auto&&...) { data["frame_scores"].push_back(score); });
  apso::for_each_change_score(apso::Assessment{}, [&](const char* score, auto&&...) { data["change_scores"].push_back(score); });
  return data;
}

}  // namespace report
