// apso_ablate: what is each part of the method worth? Runs apso_track on a list of sequences with every variant of
// track/ablation.hpp in turn, and puts the results in one table.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <apso/evaluation/decision_analysis.hpp>
#include <apso/io/parameters.hpp>
#include <apso/version.hpp>

#include "track/ablation.hpp"
#include "track/ablation_figures.hpp"
#include "track/command_line.hpp"
#include "track/config.hpp"
#include "track/results.hpp"
#include "track/run_folder.hpp"
#include "track/sequence_list.hpp"

namespace {

namespace fs = std::filesystem;
using json = nlohmann::json;
using track::figures;
using track::Row;

struct Arguments {
  std::vector<std::string> sequences;
  std::vector<std::string> only;
  std::string output;
  std::string config;
  std::string plan;
  int repeats = 1;
  int recorded_repeats = 1;
  int jobs = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  bool table_only = false;
};

struct PlannedRun {
  std::size_t variant;
  std::size_t sequence;
  track::Job job;
  std::string camera_truth;
};

/// Repetitions of a recording differ in the number of features, of which the result must not depend: 1000, 990, 1010, 980, ...
int features_of(int base, int repetition) { return base + (repetition % 2 == 1 ? -10 : 10) * ((repetition + 1) / 2); }

/// Writes the settings of a variant, unless runs with other settings are in the folder already. \return the file
fs::path write_settings(const Arguments& a, const track::Variant& variant, int repetition) {
  track::Config config = track::read_config(a.config);
  std::string name = variant.name;
  if (repetition > 0) {
    int& features = config.tracker.orb.features;
    features = features_of(features, repetition);
    name += "_" + std::to_string(features) + "_features";
  }
  const fs::path file = fs::path(a.output) / "configs" / (name + ".yaml");
  const std::string text = apso::write_parameters(track::changed(config, variant)) + "\n";
  std::string old;
  if (std::ifstream in(file.string()); in) old.assign(std::istreambuf_iterator<char>(in), {});
  if (old == text) return file;
  if (!old.empty()) {
    throw apso::io_error(file.string() + ": the runs in " + a.output + " were made with other settings; take another --output");
  }
  track::write_file(file, text);
  return file;
}

/// The arguments of apso_track for the n-th repetition of a sequence: seeds that follow each other.
std::vector<std::string> with_seed(std::vector<std::string> arguments, int n) {
  const auto seed = std::find(arguments.begin(), arguments.end(), "--seed");
  const int first = seed == arguments.end() ? 1 : std::stoi(*(seed + 1));
  if (seed != arguments.end()) arguments.erase(seed, seed + 2);
  arguments.insert(arguments.end(), {"--seed", std::to_string(first + n)});
  return arguments;
}

/// Every variant on every sequence, as often as asked for: first once on all, then once more, so that whatever has been done when
/// somebody stops it is a table of fewer repetitions.
std::vector<PlannedRun> plan(const Arguments& a, const std::vector<track::Variant>& chosen) {
  fs::create_directories(fs::path(a.output) / "configs");
  std::vector<PlannedRun> runs;
  for (int r = 0; r < std::max(a.repeats, a.recorded_repeats); ++r) {
    for (std::size_t q = 0; q < a.sequences.size(); ++q) {
      const track::SequenceSpec s = track::parse_sequence(a.sequences[q]);
      const int repeats = s.synthetic() ? a.repeats : a.recorded_repeats;
      if (r >= repeats) continue;
      for (std::size_t v = 0; v < chosen.size(); ++v) {
        if (chosen[v].true_masks && !s.synthetic()) continue;  // a recording has none
        const fs::path file = write_settings(a, chosen[v], s.synthetic() ? 0 : r);
        PlannedRun run{v, q, {}, s.camera_truth};
        run.job.arguments = s.synthetic() && repeats > 1 ? with_seed(s.arguments, r) : s.arguments;
        run.job.arguments.insert(run.job.arguments.end(), {"--config", file.string(), "--no-pictures"});
        if (chosen[v].true_masks) run.job.arguments.emplace_back("--true-masks");
        run.job.folder = fs::path(a.output) / chosen[v].name / (repeats > 1 ? s.name + "_r" + std::to_string(r) : s.name);
        if (s.synthetic()) run.job.kept_frames = fs::path(a.output) / "kept_frames" / run.job.folder.filename();
        runs.push_back(std::move(run));
      }
    }
  }
  return runs;
}

/// A run with its figures; none if it is not finished or cannot be read.
struct FinishedRun {
  const PlannedRun* run;
  std::optional<track::Measured> measured;
};

/// \param problems one more for every run that cannot be read
std::vector<FinishedRun> measure_all(const std::vector<PlannedRun>& runs, std::vector<std::string>& problems) {
  std::vector<FinishedRun> all;
  for (const PlannedRun& run : runs) {
    all.push_back({&run, {}});
    if (!track::complete(run.job.folder)) continue;
    try {
      all.back().measured = track::measure(run.job.folder, run.camera_truth);
    } catch (const std::exception& e) {
      problems.push_back(run.job.folder.string() + ": not in the table: " + e.what());
    }
  }
  return all;
}

Row row_of(std::size_t variant, const std::vector<FinishedRun>& runs) {
  Row row;
  for (const FinishedRun& f : runs) {
    if (f.run->variant != variant) continue;
    if (f.measured) {
      row.add(*f.measured);
    } else {
      ++row.missing;
    }
  }
  return row;
}

void print_head() {
  std::printf("%-20s %5s", "variant", "runs");
  for (const track::Figure& f : figures) {
    if (f.heading != nullptr) std::printf(" %9s", f.heading);
  }
  std::printf("\n");
}

void print(const track::Variant& variant, const Row& row) {
  std::printf("%-20s %5d", variant.name.c_str(), row.runs);
  for (std::size_t i = 0; i < figures.size(); ++i) {
    if (figures[i].heading == nullptr) continue;
    char text[32] = "-";
    if (const double v = row.spread[i].mean(); std::isfinite(v)) std::snprintf(text, sizeof text, figures[i].format, figures[i].factor * v);
    std::printf(" %9s", text);
  }
  std::printf("  %s", variant.meaning.c_str());
  if (row.lost > 0) std::printf(" (%d runs lost)", row.lost);
  if (row.missing > 0) std::printf(" (%d runs missing)", row.missing);
  std::printf("\n");
}

json to_json(const track::Variant& variant, const Row& row) {
  json j{{"variant", variant.name}, {"meaning", variant.meaning}, {"runs", row.runs}, {"missing", row.missing}, {"lost", row.lost}};
  for (std::size_t i = 0; i < figures.size(); ++i) {
    const track::Spread& s = row.spread[i];
    json& entry = j[figures[i].name];
    if (s.values.empty()) continue;
    entry = {{"mean", s.mean()}, {"standard_error", nullptr}, {"runs", s.values.size()}};
    if (s.values.size() > 1) entry["standard_error"] = s.error();
  }
  return j;
}

/// The runs of one variant on one sequence; the area under the ROC curve is that of all their frames together.
json sequence_to_json(const Arguments& a, const std::vector<track::Variant>& chosen, const std::vector<FinishedRun>& runs,
                      std::size_t variant, std::size_t sequence) {
  json list = json::array();
  std::vector<apso::ScoredEvent> events;
  for (const FinishedRun& f : runs) {
    if (f.run->variant != variant || f.run->sequence != sequence || !f.measured) continue;
    json one{{"folder", f.run->job.folder.string()}, {"lost", f.measured->lost}};
    for (std::size_t i = 0; i < figures.size(); ++i) {
      const double v = f.measured->values[i];
      one[figures[i].name] = std::isfinite(v) ? json(v) : json();
    }
    list.push_back(std::move(one));
    events.insert(events.end(), f.measured->events.begin(), f.measured->events.end());
  }
  const auto failed = std::count_if(events.begin(), events.end(), [](const auto& e) { return e.event; });
  const double auc = apso::area_under_roc(events);
  return {{"variant", chosen[variant].name},
          {"sequence", a.sequences[sequence]},
          {"decided", events.size()},
          {"failed", failed},
          {"auc", std::isfinite(auc) ? json(auc) : json()},
          {"runs", list}};
}

/// Prints the table, and writes it as ablation.json and ablation.csv.
void table(const Arguments& a, const std::vector<track::Variant>& chosen, const std::vector<FinishedRun>& runs) {
  json rows = json::array();
  json sequences = json::array();
  std::ostringstream csv;
  csv << "variant,runs,missing,lost";
  for (const track::Figure& f : figures) csv << ',' << f.name;
  csv << '\n';
  print_head();
  for (std::size_t v = 0; v < chosen.size(); ++v) {
    const Row row = row_of(v, runs);
    print(chosen[v], row);
    csv << chosen[v].name << ',' << row.runs << ',' << row.missing << ',' << row.lost;
    for (const track::Spread& s : row.spread) {
      csv << ',';
      if (std::isfinite(s.mean())) csv << s.mean();
    }
    csv << '\n';
    rows.push_back(to_json(chosen[v], row));
    for (std::size_t q = 0; q < a.sequences.size(); ++q) sequences.push_back(sequence_to_json(a, chosen, runs, v, q));
  }
  track::write_file(fs::path(a.output) / "ablation.csv", csv.str());
  track::write_json(fs::path(a.output) / "ablation.json", {{"version", APSO_VERSION},
                                                           {"sequences", a.sequences},
                                                           {"repeats", a.repeats},
                                                           {"recorded_repeats", a.recorded_repeats},
                                                           {"variants", rows},
                                                           {"by_sequence", sequences}});
}

int run(const Arguments& a) {
  std::vector<track::Input> inputs{{"--config", a.config}};
  for (const std::string& s : a.sequences) inputs.push_back({"a recording", track::parse_sequence(s).arguments.front()});
  track::keep_apart(a.output, inputs);
  std::vector<track::Variant> chosen = track::variants();
  if (!a.only.empty()) {
    const auto left_out = [&](const track::Variant& v) { return std::find(a.only.begin(), a.only.end(), v.name) == a.only.end(); };
    chosen.erase(std::remove_if(chosen.begin(), chosen.end(), left_out), chosen.end());
  }
  const std::vector<PlannedRun> runs = plan(a, chosen);
  if (!a.plan.empty()) {
    json list = json::array();
    for (const PlannedRun& r : runs) list.push_back({{"folder", r.job.folder.string()}, {"arguments", r.job.arguments}});
    track::write_json(a.plan, list);
    return 0;
  }
  std::vector<std::string> problems;
  if (!a.table_only) {
    std::vector<track::Job> jobs;
    for (const PlannedRun& r : runs) jobs.push_back(r.job);
    problems = track::run_jobs(jobs, a.jobs, "run");
  }
  table(a, chosen, measure_all(runs, problems));
  for (const std::string& p : problems) std::fprintf(stderr, "apso_ablate: %s\n", p.c_str());
  return problems.empty() ? 0 : track::exit_bad_input;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app{
      "Runs apso_track with one part of the method switched off or exchanged at a time, and compares the results.\n"
      "A sequence is written NAME,option=value,... with the options of apso_track, e.g. 'recording,camera=bonn' or\n"
      "'synthetic:stress_all,max-frames=540,seed=1'; camera-truth=FILE names ground truth in the camera's frame for errors\n"
      "of motion, where that of a recording follows another body. Finished runs are kept: interrupt and restart it as you like.\n"
      "The variants share the rendered frames of a synthetic sequence: they lie in DIR/kept_frames of --output DIR until its last\n"
      "variant is done, 2.5 MB a frame (740 MB for 300 frames), and 1 GB of the disk stays free.\n"
      "Exit code: 0 done, 1 bad input or a run failed, 2 wrong usage."};
  std::vector<std::string> names;
  for (const track::Variant& v : track::variants()) names.push_back(v.name);
  app.add_option("SEQUENCE", a.sequences, "sequences to run on")->required();
  app.add_option("--output", a.output, "folder for the runs, ablation.json and ablation.csv")->required()->check(track::not_empty());
  app.add_option("--only", a.only, "only these variants")->check(CLI::IsMember(names))->delimiter(',');
  app.add_option("--repeats", a.repeats, "runs of each synthetic sequence, with consecutive seeds")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--recorded-repeats", a.recorded_repeats,
                 "runs of each recording, with 1000, 990, 1010, 980, ... features (tracker.orb.features) per frame")
      ->check(CLI::Range(1, 50))
      ->capture_default_str();
  app.add_option("--jobs", a.jobs, "number of parallel runs")->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--config", a.config, "YAML file with the settings that all variants start from");
  app.add_option("--plan", a.plan, "only write the list of runs to this file (JSON), e.g. for a cluster");
  app.add_flag("--table", a.table_only, "run nothing, only print the table of the finished runs");
  return track::run_main("apso_ablate", app, argc, argv, [&] { return run(a); });
}
