/// \file
/// summary.json of a run of apso_track: counts, errors against ground truth, times, settings.
#pragma once

#include <algorithm>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <apso/evaluation/ate.hpp>
#include <apso/evaluation/parted_trajectory.hpp>
#include <apso/evaluation/rpe.hpp>
#include <apso/evaluation/trajectory.hpp>
#include <apso/opencv/detectors/precomputed_motion.hpp>
#include <apso/pipeline/report.hpp>
#include <apso/tracker/map/part_change.hpp>
#include <apso/version.hpp>

#include "output.hpp"
#include "stamp_delay.hpp"
#include "stamps.hpp"

namespace track {

/// What is kept of all frames of a run.
struct Record {
  apso::PartedTrajectory all_poses;     ///< of all parts of the map
  apso::PartedTrajectory all_features;  ///< poses of the features
  struct Change {
    double timestamp = 0;
    apso::PartChange change;
  };
  std::vector<Change> changes;             ///< where a part was left or joined, or a loop closed
  int part = 0;                            ///< the largest
  apso::Trajectory final_poses;            ///< of the largest part
  apso::Trajectory feature_poses;          ///< of the same
  std::vector<apso::FrameReport> reports;  ///< of the frames processed
  std::vector<Timing> timings;             ///< of the same frames
  nlohmann::json skipped = nlohmann::json::array();
  apso::opencv::FileUse use;  ///< of masks and detections of another program
  int softened = 0;           ///< frames in which dynamic features counted a little
  std::string failure;        ///< why the run ended early; empty: it did not

  void add(const apso::FrameReport& report, bool feature_pose, const apso::PartChange& change) {
    reports.push_back(report);
    if (report.state != apso::SceneState::Lost) all_poses.add(report.timestamp, report.T_world_camera, change.before);
    if (feature_pose) all_features.add(report.timestamp, report.T_world_feature, change.before);
    if (change.event == apso::PartEvent::None) return;
    all_poses.follow(change);
    all_features.follow(change);
    changes.push_back({report.timestamp, change});
  }
  /// Poses of different parts cannot be compared: a trajectory is of one.
  /// \param stamp_delay stamp of a frame less the time at which it was seen [s]
  void choose_largest_part(double stamp_delay) {
    part = all_poses.largest();
    final_poses = at_stamps(all_poses.of(part), stamp_delay);
    feature_poses = at_stamps(all_features.of(part), stamp_delay);
  }
  [[nodiscard]] int refined() const {
    return count([](const apso::FrameReport& r) { return r.refined; });
  }
  /// BAD frames with a trusted direct pose.
  [[nodiscard]] int repaired() const {
    return count([](const apso::FrameReport& r) { return r.refined && r.state == apso::SceneState::Bad; });
  }
  /// Frames that have only a predicted pose, because nothing that was measured could be believed.
  [[nodiscard]] int predicted() const {
    return count([](const apso::FrameReport& r) { return r.source == apso::PoseSource::Prediction && r.state != apso::SceneState::Lost; });
  }
  [[nodiscard]] int loops() const {
    return static_cast<int>(std::count_if(changes.begin(), changes.end(), [](const Change& c) { return c.change.closed(); }));
  }
  [[nodiscard]] int in_state(apso::SceneState state) const {
    return count([state](const apso::FrameReport& r) { return r.state == state; });
  }

 private:
  template <class F>
  [[nodiscard]] int count(F&& is) const {
    return static_cast<int>(std::count_if(reports.begin(), reports.end(), is));
  }
};

/// ATE and RPE of an estimate. Throws when it cannot be compared with the ground truth.
inline nlohmann::json evaluate(const apso::Trajectory& truth, const apso::Trajectory& estimate) {
  const apso::AteOptions ate_options;  // the defaults, which all programs have in common
  if (estimate.empty()) throw std::runtime_error("no frame has a pose");
  const apso::AteResult ate = apso::ate(truth, estimate, ate_options);
  if (!succeeded(ate.status)) {
    throw std::runtime_error(too_few_pairs(ate.pairs.size(), apso::default_max_difference(ate_options.association),
                                           apso::pairs_needed(ate_options.alignment), truth, estimate));
  }
  nlohmann::json result{{"pairs", ate.pairs.size()}, {"ate", to_json(ate.statistics)}};
  result["association"] = {{"rule", enum_names(ate_options.association)[static_cast<std::size_t>(ate_options.association)]},
                           {"max_difference_s", apso::default_max_difference(ate_options.association)}};
  const auto add_rpe = [&](const char* name, double delta, apso::DeltaUnit unit) {
    apso::RpeOptions options;
    options.delta = delta;
    options.unit = unit;
    const apso::RpeResult rpe = apso::rpe(truth, estimate, options);
    if (!succeeded(rpe.status)) return;
    result[name] = {
        {"pairs", rpe.translation.count}, {"translation", to_json(rpe.translation)}, {"rotation_deg", to_json(rpe.rotation_deg)}};
  };
  add_rpe("rpe_1s", 1.0, apso::DeltaUnit::Seconds);
  add_rpe("rpe_1f", 1.0, apso::DeltaUnit::Frames);
  return result;
}

/// Median, 95th percentile and largest time of each stage [ms].
inline nlohmann::json stage_times(const std::vector<Timing>& timings) {
  const auto column = [&](auto&& of) {
    std::vector<double> v;
    for (const Timing& t : timings) v.push_back(of(t));
    return distribution(v);
  };
  return {{"load", column([](const Timing& t) { return t.load; })},       {"features", column([](const Timing& t) { return t.features; })},
          {"observe", column([](const Timing& t) { return t.observe; })}, {"assess", column([](const Timing& t) { return t.assess; })},
          {"refine", column([](const Timing& t) { return t.refine; })},   {"map", column([](const Timing& t) { return t.map; })},
          {"total", column([](const Timing& t) { return t.total(); })},   {"wall", column([](const Timing& t) { return t.wall; })}};
}

/// The parts of the map that have poses, and what happened to them; poses of the one that is `written` are in trajectory.txt.
inline nlohmann::json parts_of_map(const Record& r) {
  nlohmann::json parts = nlohmann::json::array();
  nlohmann::json changes = nlohmann::json::array();
  int last = 0;
  for (const Record::Change& c : r.changes) {
    last = std::max(last, c.change.part);
    changes.push_back({{"timestamp", c.timestamp},
                       {"event", enum_names(c.change.event)[static_cast<std::size_t>(c.change.event)]},
                       {"from", c.change.before},
                       {"to", c.change.part}});
  }
  for (int i = 0; i <= last; ++i) {
    const std::size_t poses = r.all_poses.of(i).size();
    if (poses > 0) parts.push_back({{"part", i}, {"poses", poses}, {"written", i == r.part}});
  }
  return {{"connected", parts}, {"changes", changes}};
}

/// Everything of summary.json that follows from the frames and the ground truth.
/// \param total       frames of the sequence that were to be processed
/// \param groundtruth empty: no errors
inline nlohmann::json summarise(const Record& r, int total, const apso::Trajectory& groundtruth) {
  const int bad = r.in_state(apso::SceneState::Bad);
  const int lost = r.in_state(apso::SceneState::Lost);
  const int initialising = r.in_state(apso::SceneState::Initialising);
  nlohmann::json summary;
  summary["version"] = APSO_VERSION;
  summary["frames"] = {{"in_sequence", total},
                       {"processed", r.reports.size()},
                       {"skipped", r.skipped.size()},
                       {"with_pose", r.final_poses.size()},
                       {"good", static_cast<int>(r.reports.size()) - bad - lost - initialising},
                       {"bad", bad},
                       {"lost", lost},
                       {"initialising", initialising},
                       {"refined", r.refined()},
                       {"repaired", r.repaired()},
                       {"predicted", r.predicted()},
                       {"soft_weights", r.softened}};
  summary["parts"] = parts_of_map(r);
  summary["skipped"] = r.skipped;
  summary["mask_problems"] = r.use.problems;
  summary["ms"] = stage_times(r.timings);
  if (!groundtruth.empty()) {
    const auto add = [&](const char* name, const apso::Trajectory& estimate) {
      try {
        summary[name] = evaluate(groundtruth, estimate);
      } catch (const std::exception& e) {
        summary[name] = nullptr;
        summary["evaluation_problem"] = e.what();
      }
    };
    add("features", r.feature_poses);
    add("final", r.final_poses);
  }
  if (!r.failure.empty()) summary["failure"] = r.failure;
  return summary;
}

}  // namespace track
