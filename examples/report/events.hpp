/// \file
/// What happened in a run, from its table of frames: states, references, refinements, known difficulties, frames without images.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "../track/run_folder.hpp"

namespace report {

/// "3 frames"
inline std::string counted(std::size_t n, const char* what) { return std::to_string(n) + ' ' + what + (n == 1 ? "" : "s"); }

/// What is told about consecutive frames [first, last) of one state.
inline std::string state_event(const track::Run& run, std::size_t first, std::size_t last) {
  const std::string& state = run.frames[first].state;
  std::string text = state + ": " + counted(last - first, "frame");
  if (state != "BAD") return text;
  std::size_t repaired = 0;
  std::map<std::string, std::size_t> failures;
  for (std::size_t i = first; i < last; ++i) {
    const track::RunFrame& f = run.frames[i];
    if (run.at(f, "refined") == 1) {
      ++repaired;
    } else if (!f.refine_status.empty()) {
      ++failures[f.refine_status];
    }
  }
  text += ", " + std::to_string(repaired) + " with a refined pose";
  for (const auto& [status, n] : failures)
    text += ", " + std::to_string(n) + " not refined (" + (status == "Converged" ? "aligned, but not trusted" : status) + ")";
  return text;
}

/// The reference was replaced within the half second before, in the same state: that is told with the first of these frames.
inline bool follows_update(const track::Run& run, std::size_t row) {
  const track::RunFrame& f = run.frames[row];
  for (std::size_t i = row; i-- > 0 && run.frames[i].state == f.state && f.timestamp - run.frames[i].timestamp <= 0.5;) {
    if (run.at(run.frames[i], "benchmark_updated") == 1) return true;
  }
  return false;
}

/// What is told about replacements of the reference that follow each other, from that of `row` on.
inline std::string reference_event(const track::Run& run, std::size_t row) {
  if (run.frames[row].state == "INITIALISING") return "reference found";
  std::size_t count = 1;
  double until = run.frames[row].timestamp;
  for (std::size_t i = row + 1; i < run.frames.size() && run.frames[i].state == run.frames[row].state; ++i) {
    if (run.at(run.frames[i], "benchmark_updated") != 1) continue;
    if (!follows_update(run, i)) break;
    ++count;
    until = run.frames[i].timestamp;
  }
  char text[100];
  if (count > 1) {
    std::snprintf(text, sizeof text, "reference replaced %zu times until %.2f s", count, until - run.frames.front().timestamp);
  } else {
    std::snprintf(text, sizeof text, "reference replaced, the old one was %.2f s old", run.at(run.frames[row], "benchmark_age_s"));
  }
  return text;
}

/// What is told when the camera went on in another part of the map, the part was joined with another one, or a loop in it was closed.
/// \param change one of "changes" of the "parts" in summary.json
/// \param last   the highest number of a part so far
inline std::string part_event(const nlohmann::json& change, int last) {
  const std::string to = "part " + std::to_string(change.at("to").get<int>());
  if (change.at("event") == "joined")
    return "part " + std::to_string(change.at("from").get<int>()) + " was recognised in " + to + " and joined with it";
  if (change.at("event") == "closed") return "back at a place of " + to + " of the map: the drift of the way round is taken out";
  return change.at("to").get<int>() > last ? "lost for a second on good images: " + to + " of the map begins"
                                           : "found again in " + to + " of the map";
}

/// Events in the order of their frames: {"row", "time", "kind", "text"}. The row is that of the table of frames.
/// \param skipped of summary.json: frames whose images cannot be read
/// \param changes of the "parts" in summary.json
inline nlohmann::json events(const track::Run& run, const nlohmann::json& skipped, const nlohmann::json& changes) {
  using nlohmann::json;
  std::vector<json> all;
  const double t0 = run.frames.front().timestamp;
  const auto add = [&](std::size_t row, double time, const char* kind, const std::string& text) {
    all.push_back({{"row", row}, {"time", time - t0}, {"kind", kind}, {"text", text}});
  };
  const std::size_t n = run.frames.size();
  for (std::size_t i = 0; i < n; ++i) {
    const track::RunFrame& f = run.frames[i];
    const track::RunFrame* before = i > 0 ? &run.frames[i - 1] : nullptr;
    if (before == nullptr || before->state != f.state) {
      std::size_t last = i + 1;
      while (last < n && run.frames[last].state == f.state) ++last;
      add(i, f.timestamp, f.state.c_str(), state_event(run, i, last));
    }
    if (run.at(f, "benchmark_updated") == 1 && (i == 0 || !follows_update(run, i)))
      add(i, f.timestamp, "reference", reference_event(run, i));
    const auto begins = [&](const char* column) { return run.at(f, column) == 1 && (before == nullptr || run.at(*before, column) != 1); };
    if (begins("degraded")) add(i, f.timestamp, "reference", "the reference is poor from here on");
    const std::string label_before = before == nullptr ? "" : before->label;
    if (f.label != label_before)
      add(i, f.timestamp, "difficulty", f.label.empty() ? "end of " + label_before : "known difficulty: " + f.label);
  }
  const auto row_at = [&](double time) {
    std::size_t row = 0;
    while (row + 1 < n && run.frames[row + 1].timestamp <= time) ++row;
    return row;
  };
  int last_part = 0;
  for (const json& c : changes) {
    const double time = c.at("timestamp").get<double>();
    add(row_at(time), time, "map", part_event(c, last_part));
    last_part = std::max(last_part, c.at("to").get<int>());
  }
  for (const json& s : skipped) {
    const double time = s.at("timestamp").get<double>();
    add(row_at(time), time, "skipped",
        "frame " + std::to_string(s.at("frame").get<int>()) + " has no images: " + s.at("reason").get<std::string>());
  }
  std::stable_sort(all.begin(), all.end(), [](const json& a, const json& b) { return a["time"].get<double>() < b["time"].get<double>(); });
  return all;
}

}  // namespace report
