// apso_assess: how well do the scores of apso_track predict where feature tracking fails? Reads finished runs, compares
// every score with the true error of the feature tracker, and writes a table, pictures and JSON.

#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <apso/evaluation/decision_analysis.hpp>
#include <apso/quality/assessment.hpp>
#include <apso/version.hpp>

#include "assess/plots.hpp"
#include "assess/scores.hpp"
#include "track/command_line.hpp"
#include "track/results.hpp"
#include "track/run_folder.hpp"

namespace {

namespace fs = std::filesystem;
using json = nlohmann::json;

using assess::events;
using assess::failed;
using assess::labelled;
using assess::number;
using assess::Runs;
using assess::Score;
using assess::scores;
using assess::shown;

json table_of_scores(const Runs& runs) {
  json rows = json::array();
  std::printf("\n%-15s %8s %8s %11s %11s %8s\n", "score", "AUC", "AUC", "rank corr.", "rank corr.", "frames");
  std::printf("%-15s %8s %8s %11s %11s\n", "", "failure", "label", "1-frame err", "1-s err");
  for (const Score& s : scores()) {
    const auto of_failure = events(runs, s, failed);
    const double auc = apso::area_under_roc(of_failure);
    const double auc_label = apso::area_under_roc(events(runs, s, labelled));
    std::vector<double> x, y, x1, y1;
    for (const track::Run& run : runs) {
      for (const track::RunFrame& f : run.frames) {
        const double v = run.at(f, s.column);
        if (!f.decided() || !std::isfinite(v)) continue;
        const double bad = s.quality ? 1 - v : v;
        // errors in units of the run's own median, so that runs can be put together
        if (std::isfinite(f.rpe_1f)) x.push_back(bad), y.push_back(f.rpe_1f / run.median_rpe_1f);
        if (std::isfinite(f.rpe_1s)) x1.push_back(bad), y1.push_back(f.rpe_1s / run.median_rpe_1f);
      }
    }
    const double r = apso::rank_correlation(x, y);
    const double r1 = apso::rank_correlation(x1, y1);
    std::printf("%-15s %8s %8s %11s %11s %8zu\n", s.name.c_str(), shown(auc).c_str(), shown(auc_label).c_str(), shown(r, "%+.2f").c_str(),
                shown(r1, "%+.2f").c_str(), of_failure.size());
    rows.push_back({{"score", s.name},
                    {"frames", of_failure.size()},
                    {"auc_failure", number(auc)},
                    {"auc_label", number(auc_label)},
                    {"rank_correlation_1_frame", number(r)},
                    {"rank_correlation_1_s", number(r1)}});
  }
  return rows;
}

json decisions(const Runs& runs) {
  apso::Confusion by_failure, by_label;
  std::map<std::string, apso::Confusion> by_cause;
  double before = 0, after = 0;
  int repaired = 0;
  for (const track::Run& run : runs) {
    for (const track::RunFrame& f : run.frames) {
      if (!f.decided()) continue;
      by_failure.add(f.flagged(), f.failed);
      by_label.add(f.flagged(), labelled(f));
      if (labelled(f)) by_cause[f.label].add(f.flagged(), f.failed);
      if (std::isfinite(f.before) && std::isfinite(f.after)) {
        before += f.before;
        after += f.after;
        ++repaired;
      }
    }
  }
  std::printf("\nBAD or LOST predicts failure: precision %s, recall %s, false alarms %s of the frames without failure\n",
              shown(by_failure.precision()).c_str(), shown(by_failure.recall()).c_str(), shown(by_failure.false_alarm_rate()).c_str());
  json j{{"failure",
          {{"precision", number(by_failure.precision())},
           {"recall", number(by_failure.recall())},
           {"false_alarm_rate", number(by_failure.false_alarm_rate())},
           {"failures", by_failure.hits + by_failure.misses}}}};
  std::printf("flagged outside of labelled spans: %d of %d (%s)\n", by_label.false_alarms, by_label.false_alarms + by_label.quiet,
              shown(by_label.false_alarm_rate()).c_str());
  j["outside"] = {{"frames", by_label.false_alarms + by_label.quiet},
                  {"flagged", by_label.false_alarms},
                  {"share", number(by_label.false_alarm_rate())}};
  if (!by_cause.empty()) {
    std::printf("flagged within labelled spans: %d of %d (%s)\n", by_label.hits, by_label.hits + by_label.misses,
                shown(by_label.recall()).c_str());
    j["inside"] = {{"frames", by_label.hits + by_label.misses}, {"flagged", by_label.hits}, {"share", number(by_label.recall())}};
    for (const auto& [cause, c] : by_cause) {
      const int frames = c.hits + c.false_alarms + c.misses + c.quiet;
      const int flagged = c.hits + c.false_alarms;
      std::printf("  %-10s flagged %4d of %4d (%s), tracker failed in %d\n", cause.c_str(), flagged, frames,
                  shown(static_cast<double>(flagged) / frames).c_str(), c.hits + c.misses);
      j["causes"][cause] = {{"frames", frames}, {"flagged", flagged}, {"failed", c.hits + c.misses}};
    }
  }
  if (repaired > 0) {
    std::printf(
        "BAD frames with both poses: %d; mean error since the last GOOD frame %.4f m from features, %.4f m finally "
        "(%+.0f %%)\n",
        repaired, before / repaired, after / repaired, 100 * (after / before - 1));
    j["bad_frames"] = {{"count", repaired}, {"mean_error_features", before / repaired}, {"mean_error_final", after / repaired}};
  }
  return j;
}

json per_run(const Runs& runs) {
  json rows = json::array();
  std::printf("\n%-28s %7s %7s %9s %9s %9s %9s\n", "run", "frames", "failed", "median", "AUC", "flagged", "flagged");
  std::printf("%-28s %7s %7s %9s %9s %9s %9s\n", "", "", "", "err [mm]", "S_final", "inside", "outside");
  for (const track::Run& run : runs) {
    const double auc = apso::area_under_roc(events({run}, scores()[0], failed));
    int n = 0, bad = 0;
    apso::Confusion label;
    for (const track::RunFrame& f : run.frames) {
      if (!f.decided()) continue;
      ++n;
      bad += f.failed;
      label.add(f.flagged(), labelled(f));
    }
    std::printf("%-28s %7d %7d %9s %9s %9s %9s\n", run.name.c_str(), n, bad,
                run.with_pose == 0 ? "lost" : shown(1e3 * run.median_rpe_1f, "%.2f").c_str(), shown(auc).c_str(),
                shown(label.recall()).c_str(), shown(label.false_alarm_rate()).c_str());
    rows.push_back({{"run", run.name},
                    {"frames", n},
                    {"failed", bad},
                    {"lost", run.with_pose == 0},
                    {"median_error_1_frame", number(run.median_rpe_1f)},
                    {"auc", number(auc)},
                    {"flagged_inside", number(label.recall())},
                    {"flagged_outside", number(label.false_alarm_rate())}});
  }
  return rows;
}

struct Arguments {
  std::vector<std::string> folders;
  std::string output;
  double factor = 3;
};

int run(const Arguments& a) {
  std::vector<track::Input> inputs;
  for (const std::string& f : a.folders) {
    inputs.push_back({"a run", f.substr(0, f.find('='))});
    if (f.find('=') != std::string::npos) inputs.push_back({"a ground truth", f.substr(f.find('=') + 1)});
  }
  track::keep_apart(a.output, inputs);
  Runs runs;
  int problems = 0;
  const auto problem = [&](const std::string& what) {
    std::fprintf(stderr, "apso_assess: %s\n", what.c_str());
    ++problems;
  };
  for (const std::string& f : a.folders) {
    const auto eq = f.find('=');
    try {
      track::Run run = track::read_run(f.substr(0, eq), eq == std::string::npos ? "" : f.substr(eq + 1), a.factor);
      if (run.frames.empty()) throw apso::io_error(f + ": frames.csv holds no frame");
      if (!run.compared)
        problem(f + ": no frame can be compared with the ground truth, as the stamps do not meet or the numbers are too large");
      runs.push_back(std::move(run));
    } catch (const std::exception& e) {
      problem(std::string(e.what()) + "; not in the table");
    }
  }
  if (runs.empty()) return track::exit_bad_input;
  track::ResultFolder out(a.output, {"roc.png", "reliability.png", "timeline.png", "assess.json"});
  json result{{"version", APSO_VERSION}, {"failure_factor", a.factor}};
  result["runs"] = per_run(runs);
  result["scores"] = table_of_scores(runs);
  result["decisions"] = decisions(runs);
  assess::plot_roc(out.file("roc.png"), runs);
  result["reliability"] = assess::plot_reliability(out.file("reliability.png"), runs);
  assess::plot_timeline(out.file("timeline.png"), runs);
  track::write_json(out.file("assess.json"), result);
  out.finish();
  return problems == 0 ? 0 : track::exit_bad_input;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app{
      "Compares the scores of finished runs of apso_track with the true error of its feature tracker. Use runs with\n"
      "--no-refinement to judge the prediction, runs with refinement to judge the correction.\n"
      "Exit code: 0 done, 1 bad input (the table holds what can be read), 2 wrong usage."};
  app.add_option("RUN", a.folders, "result folders of apso_track; FOLDER=FILE takes the ground truth from FILE")->required();
  app.add_option("--output", a.output, "folder for assess.json, roc.png, reliability.png, timeline.png")
      ->required()
      ->check(track::not_empty());
  app.add_option("--failure-factor", a.factor,
                 "a frame counts as failed if it is lost or its 1-frame error exceeds this multiple of the run's median")
      ->check(track::number_in(1e-9, 1e9))
      ->capture_default_str();
  std::signal(SIGPIPE, SIG_IGN);  // gnuplot may end before it has read everything
  return track::run_main("apso_assess", app, argc, argv, [&] { return run(a); });
}
