/// \file
/// What apso_ablate measures of a run of apso_track, and the mean of it over several runs.
#pragma once

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <apso/evaluation/decision_analysis.hpp>

#include "run_folder.hpp"
#include "summary.hpp"

namespace track {

/// A figure: name in the files, heading of the printed table (none: only in the files), unit and format there.
struct Figure {
  const char* name;
  const char* heading;
  double factor;
  const char* format;
};
inline constexpr std::array<Figure, 16> figures{{{"ate_m", "ATE [mm]", 1e3, "%.2f"},
                                                 {"pairs", "pairs", 1, "%.0f"},
                                                 {"ate_features_m", nullptr, 1e3, "%.2f"},
                                                 {"rpe_1s_m", "RPE 1 s", 1e3, "%.2f"},
                                                 {"rpe_1f_m", "RPE 1 f", 1e3, "%.2f"},
                                                 {"auc_failure", "AUC", 1, "%.3f"},
                                                 {"bad_share", "BAD", 100, "%.1f %%"},
                                                 {"flagged_inside", "inside", 100, "%.0f %%"},
                                                 {"flagged_outside", "outside", 100, "%.1f %%"},
                                                 {"wrong_good", "wrong", 1, "%.1f"},
                                                 {"good", nullptr, 1, "%.0f"},
                                                 {"median_ms", "ms", 1, "%.1f"},
                                                 {"frames", nullptr, 1, "%.0f"},
                                                 {"rpe_1s_deg", nullptr, 1, "%.3f"},
                                                 {"rpe_1f_deg", nullptr, 1, "%.3f"},
                                                 {"repaired", nullptr, 1, "%.0f"}}};

/// The figures of one run; NaN where it has none.
struct Measured {
  std::array<double, figures.size()> values{};
  std::vector<apso::ScoredEvent> events;  ///< of every frame with a decision: 1 - S_final, and whether the tracker failed
  bool lost = false;                      ///< no frame has a pose
};

/// A GOOD frame is wrong when its pose has moved since the frame before by this much more or less than the camera did.
inline constexpr double wrong_metres = 0.02;
inline constexpr double wrong_degrees = 1;

/// \param camera_truth ground truth in the camera's frame, for errors of motion; empty: that of the run
inline Measured measure(const std::filesystem::path& folder, const std::string& camera_truth) {
  using json = nlohmann::json;
  const json summary = json::parse(std::ifstream((folder / "summary.json").string()));
  const Run run = read_run(folder.string(), camera_truth);
  json motion = summary.contains("final") ? summary["final"] : json();
  if (!camera_truth.empty() && run.with_pose > 0)
    motion = evaluate(apso::read_trajectory(camera_truth), apso::read_trajectory((folder / "trajectory.txt").string()));
  const auto value = [](const json& from, const char* path) {
    const json::json_pointer p(path);
    return from.is_object() && from.contains(p) && from[p].is_number() ? from[p].get<double>() : kNone;
  };
  Measured m;
  m.lost = run.with_pose == 0;
  apso::Confusion label;
  double flagged = 0;
  double decided = 0;
  double good = 0;
  double wrong = 0;
  constexpr double degree = 0.017453292519943295;
  for (const RunFrame& f : run.frames) {
    if (!f.decided()) continue;
    decided += 1;
    flagged += f.flagged();
    label.add(f.flagged(), !f.label.empty());
    m.events.push_back({1 - run.at(f, "S_final"), f.failed});
    if (f.state != "GOOD" || !std::isfinite(f.final_1f)) continue;
    good += 1;
    wrong += f.final_1f > wrong_metres || f.final_angle > wrong_degrees * degree;
  }
  m.values = {value(summary, "/final/ate/rmse"),
              value(summary, "/final/pairs"),
              value(summary, "/features/ate/rmse"),
              value(motion, "/rpe_1s/translation/rmse"),
              value(motion, "/rpe_1f/translation/rmse"),
              apso::area_under_roc(m.events),
              flagged / decided,
              label.recall(),
              label.false_alarm_rate(),
              good > 0 ? wrong : kNone,
              good,
              value(summary, "/ms/total/median"),
              value(summary, "/frames/in_sequence"),
              value(motion, "/rpe_1s/rotation_deg/rmse"),
              value(motion, "/rpe_1f/rotation_deg/rmse"),
              value(summary, "/frames/repaired")};
  return m;
}

struct Spread {
  std::vector<double> values;
  void add(double v) {
    if (std::isfinite(v)) values.push_back(v);
  }
  [[nodiscard]] double mean() const {
    if (values.empty()) return kNone;
    double s = 0;
    for (const double v : values) s += v;
    return s / static_cast<double>(values.size());
  }
  /// Standard error of the mean.
  [[nodiscard]] double error() const {
    if (values.size() < 2) return kNone;
    double s = 0;
    for (const double v : values) s += (v - mean()) * (v - mean());
    const double n = static_cast<double>(values.size());
    return std::sqrt(s / (n - 1) / n);
  }
};

/// Several runs together.
struct Row {
  int runs = 0;
  int missing = 0;  ///< runs that did not end, or whose results cannot be read
  int lost = 0;     ///< runs in which no frame has a pose: they have no error
  std::array<Spread, figures.size()> spread;

  void add(const Measured& m) {
    for (std::size_t i = 0; i < figures.size(); ++i) spread[i].add(m.values[i]);
    ++runs;
    lost += m.lost ? 1 : 0;
  }
};

}  // namespace track
