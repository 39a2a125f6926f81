/// \file
/// The scores of finished runs, beside what happened in the frames.
#pragma once

#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <apso/evaluation/decision_analysis.hpp>
#include <apso/quality/assessment.hpp>

#include "../track/run_folder.hpp"

namespace assess {

using json = nlohmann::json;
using Runs = std::vector<track::Run>;

/// A column of the table, turned so that high means bad.
struct Score {
  std::string name;
  std::string column;
  bool quality;  ///< 1 - value is taken
};
/// All scores of the table; the first is that of the decision.
inline const std::vector<Score>& scores() {
  static const std::vector<Score> list = [] {
    std::vector<Score> all{{"1 - S_final", "S_final", true}, {"1 - S_total", "S_total", true}};
    const auto add = [&all](const std::string& column, apso::Better better) {
      const bool quality = better == apso::Better::Higher;
      all.push_back({(quality ? "1 - " : "") + column, column, quality});
    };
    const apso::Assessment a;
    apso::for_each_frame_score(a, [&](const char* name, const auto&, double, apso::Better better) { add(name, better); });
    // what the scores of a frame measured on the way to their value, where it is a score itself
    apso::for_each_measurement(a, [&](const std::string& column, double) {
      if (column.rfind("S_", 0) == 0) add(column, apso::Better::Higher);
    });
    all.push_back({"1 - S_inn", "S_inn", true});
    all.push_back({"S_change", "S_change", false});
    apso::for_each_change_score(a, [&](const char* name, const auto&, double, apso::Better better) { add(name, better); });
    all.push_back({"S_step", "S_step", false});
    all.push_back({"dynamic ratio", "dynamic_ratio", false});
    return all;
  }();
  return list;
}

/// JSON has no NaN.
inline json number(double v) { return std::isfinite(v) ? json(v) : json(nullptr); }
inline std::string shown(double v, const char* format = "%.3f") {
  if (!std::isfinite(v)) return "-";
  char text[32];
  std::snprintf(text, sizeof text, format, v);
  return text;
}

/// Frames with a decision that have the score, and whether something happened in them.
inline std::vector<apso::ScoredEvent> events(const Runs& runs, const Score& s, const std::function<bool(const track::RunFrame&)>& event) {
  std::vector<apso::ScoredEvent> e;
  for (const track::Run& run : runs) {
    for (const track::RunFrame& f : run.frames) {
      if (!f.decided()) continue;
      const double v = run.at(f, s.column);
      if (std::isfinite(v)) e.push_back({s.quality ? 1 - v : v, event(f)});
    }
  }
  return e;
}
inline bool failed(const track::RunFrame& f) { return f.failed; }
inline bool labelled(const track::RunFrame& f) { return !f.label.empty(); }

}  // namespace assess
