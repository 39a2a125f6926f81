// apso_ablate: what is each part of the method worth? Runs apso_track on a list of sequences with every variant of
// track/ablation.hpp in turn, and puts the results in one table.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
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
#include "track/command_line.hpp"
#include "track/config.hpp"
#include "track/results.hpp"
#include "track/run_folder.hpp"
#include "track/sequence_list.hpp"

namespace {

namespace fs = std::filesystem;
using json = nlohmann::json;

struct Arguments {
  std::vector<std::string> sequences;
  std::vector<std::string> only;
  std::string output;
  std::string config;
  std::string plan;
  int repeats = 1;
  int jobs = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  bool table_only = false;
};

struct PlannedRun {
  std::size_t variant;
  track::Job job;
};

/// Writes the settings of a variant, unless runs with other settings are in the folder already. \return the file
fs::path write_settings(const Arguments& a, const track::Variant& variant) {
  const track::Config config = track::read_config(a.config);
  const fs::path file = fs::path(a.output) / "configs" / (variant.name + ".yaml");
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

/// Every variant on every sequence; a synthetic one as often as asked for.
std::vector<PlannedRun> plan(const Arguments& a, const std::vector<track::Variant>& chosen) {
  fs::create_directories(fs::path(a.output) / "configs");
  std::vector<PlannedRun> runs;
  for (std::size_t v = 0; v < chosen.size(); ++v) {
    const fs::path file = write_settings(a, chosen[v]);
    for (const std::string& sequence : a.sequences) {
      const track::SequenceSpec s = track::parse_sequence(sequence);
      const bool repeated = s.arguments[0].rfind("synthetic:", 0) == 0 && a.repeats > 1;
      for (int r = 0; r < (repeated ? a.repeats : 1); ++r) {
        PlannedRun run{v, {}};
        run.job.arguments = repeated ? with_seed(s.arguments, r) : s.arguments;
        run.job.arguments.insert(run.job.arguments.end(), {"--config", file.string()});
        run.job.folder = fs::path(a.output) / chosen[v].name / (repeated ? s.name + "_r" + std::to_string(r) : s.name);
        runs.push_back(std::move(run));
      }
    }
  }
  return runs;
}

/// The figures of a variant: name in the files, heading of the table (none: only in the files), unit and format there.
struct Figure {
  const char* name;
  const char* heading;
  double factor;
  const char* format;
};
constexpr std::array<Figure, 8> figures{{{"ate_m", "ATE [mm]", 1e3, "%.2f"},
                                         {"ate_features_m", nullptr, 1e3, "%.2f"},
                                         {"rpe_1s_m", "RPE 1 s", 1e3, "%.2f"},
                                         {"rpe_1f_m", "RPE 1 f", 1e3, "%.2f"},
                                         {"auc_failure", "AUC", 1, "%.3f"},
                                         {"bad_share", "BAD", 100, "%.1f %%"},
                                         {"flagged_inside", "inside", 100, "%.0f %%"},
                                         {"flagged_outside", "outside", 100, "%.1f %%"}}};

struct Spread {
  std::vector<double> values;
  void add(double v) {
    if (std::isfinite(v)) values.push_back(v);
  }
  [[nodiscard]] double mean() const {
    if (values.empty()) return track::kNone;
    double s = 0;
    for (const double v : values) s += v;
    return s / static_cast<double>(values.size());
  }
  /// Standard error of the mean.
  [[nodiscard]] double error() const {
    if (values.size() < 2) return track::kNone;
    double s = 0;
    for (const double v : values) s += (v - mean()) * (v - mean());
    const double n = static_cast<double>(values.size());
    return std::sqrt(s / (n - 1) / n);
  }
};

struct Row {
  int runs = 0;
  int missing = 0;  ///< runs that did not end, or whose results cannot be read
  int lost = 0;     ///< runs in which no frame has a pose: they have no error
  std::array<Spread, figures.size()> spread;
};

/// Adds the figures of one finished run; what it has none of is left out.
void measure(const fs::path& folder, Row& row) {
  const json summary = json::parse(std::ifstream((folder / "summary.json").string()));
  const auto value = [&](const char* path) {
    const json::json_pointer p(path);
    return summary.contains(p) && summary[p].is_number() ? summary[p].get<double>() : track::kNone;
  };
  const track::Run run = track::read_run(folder.string());
  std::vector<apso::ScoredEvent> events;
  apso::Confusion label;
  double flagged = 0;
  double decided = 0;
  for (const track::RunFrame& f : run.frames) {
    if (!f.decided()) continue;
    decided += 1;
    flagged += f.flagged();
    label.add(f.flagged(), !f.label.empty());
    events.push_back({1 - run.at(f, "S_final"), f.failed});
  }
  const std::array<double, figures.size()> measured{value("/final/ate/rmse"),
                                                    value("/features/ate/rmse"),
                                                    value("/final/rpe_1s/translation/rmse"),
                                                    value("/final/rpe_1f/translation/rmse"),
                                                    apso::area_under_roc(events),
                                                    flagged / decided,
                                                    label.recall(),
                                                    label.false_alarm_rate()};
  for (std::size_t i = 0; i < figures.size(); ++i) row.spread[i].add(measured[i]);
  ++row.runs;
  row.lost += run.with_pose == 0 ? 1 : 0;
}

/// \param problems one more for every run that cannot be read
Row row_of(std::size_t variant, const std::vector<PlannedRun>& runs, std::vector<std::string>& problems) {
  Row row;
  for (const PlannedRun& run : runs) {
    if (run.variant != variant) continue;
    if (!track::complete(run.job.folder)) {
      ++row.missing;
      continue;
    }
    try {
      measure(run.job.folder, row);
    } catch (const std::exception& e) {
      ++row.missing;
      problems.push_back(run.job.folder.string() + ": not in the table: " + e.what());
    }
  }
  return row;
}

void print_head() {
  std::printf("%-20s %5s", "variant", "runs");
  for (const Figure& f : figures) {
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
    const Spread& s = row.spread[i];
    json& entry = j[figures[i].name];
    if (s.values.empty()) continue;
    entry = {{"mean", s.mean()}, {"standard_error", nullptr}, {"runs", s.values.size()}};
    if (s.values.size() > 1) entry["standard_error"] = s.error();
  }
  return j;
}

/// Prints the table, and writes it as ablation.json and ablation.csv.
void table(const Arguments& a, const std::vector<track::Variant>& chosen, const std::vector<PlannedRun>& runs,
           std::vector<std::string>& problems) {
  json rows = json::array();
  std::ostringstream csv;
  csv << "variant,runs,missing,lost";
  for (const Figure& f : figures) csv << ',' << f.name;
  csv << '\n';
  print_head();
  for (std::size_t v = 0; v < chosen.size(); ++v) {
    const Row row = row_of(v, runs, problems);
    print(chosen[v], row);
    csv << chosen[v].name << ',' << row.runs << ',' << row.missing << ',' << row.lost;
    for (const Spread& s : row.spread) {
      csv << ',';
      if (std::isfinite(s.mean())) csv << s.mean();
    }
    csv << '\n';
    rows.push_back(to_json(chosen[v], row));
  }
  track::write_file(fs::path(a.output) / "ablation.csv", csv.str());
  track::write_json(fs::path(a.output) / "ablation.json",
                    {{"version", APSO_VERSION}, {"sequences", a.sequences}, {"repeats", a.repeats}, {"variants", rows}});
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
  table(a, chosen, runs, problems);
  for (const std::string& p : problems) std::fprintf(stderr, "apso_ablate: %s\n", p.c_str());
  return problems.empty() ? 0 : track::exit_bad_input;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app{
      "Runs apso_track with one part of the method switched off or exchanged at a time, and compares the results.\n"
      "A sequence is written NAME,option=value,... with the options of apso_track, e.g. 'recording,camera=bonn' or\n"
      "'synthetic:stress_all,max-frames=540,seed=1'. Finished runs are kept: interrupt and restart it as you like.\n"
      "Exit code: 0 done, 1 bad input or a run failed, 2 wrong usage."};
  std::vector<std::string> names;
  for (const track::Variant& v : track::variants()) names.push_back(v.name);
  app.add_option("SEQUENCE", a.sequences, "sequences to run on")->required();
  app.add_option("--output", a.output, "folder for the runs, ablation.json and ablation.csv")->required()->check(track::not_empty());
  app.add_option("--only", a.only, "only these variants")->check(CLI::IsMember(names))->delimiter(',');
  app.add_option("--repeats", a.repeats, "runs of each synthetic sequence, with consecutive seeds")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--jobs", a.jobs, "number of parallel runs")->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--config", a.config, "YAML file with the settings that all variants start from");
  app.add_option("--plan", a.plan, "only write the list of runs to this file (JSON), e.g. for a cluster");
  app.add_flag("--table", a.table_only, "run nothing, only print the table of the finished runs");
  return track::run_main("apso_ablate", app, argc, argv, [&] { return run(a); });
}
