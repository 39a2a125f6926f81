// apso_assess: how well do the scores of apso_track predict where feature tracking fails? Reads finished runs, compares
// every score with the true error of the feature tracker, and writes a table, pictures and JSON.

#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <apso/evaluation/decision_analysis.hpp>
#include <apso/quality/assessment.hpp>
#include <apso/version.hpp>

#include "track/command_line.hpp"
#include "track/plots.hpp"
#include "track/results.hpp"
#include "track/run_folder.hpp"

namespace {

namespace fs = std::filesystem;
using json = nlohmann::json;

/// A column of the table, turned so that high means bad.
struct Score {
  std::string name;
  std::string column;
  bool quality;  ///< 1 - value is taken
};
const std::vector<Score>& scores() {
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
    all.push_back({"S_change", "S_change", false});
    apso::for_each_change_score(a, [&](const char* name, const auto&, double, apso::Better better) { add(name, better); });
    all.push_back({"S_step", "S_step", false});
    all.push_back({"dynamic ratio", "dynamic_ratio", false});
    return all;
  }();
  return list;
}

/// JSON has no NaN.
json number(double v) { return std::isfinite(v) ? json(v) : json(nullptr); }
std::string shown(double v, const char* format = "%.3f") {
  if (!std::isfinite(v)) return "-";
  char text[32];
  std::snprintf(text, sizeof text, format, v);
  return text;
}

using Runs = std::vector<track::Run>;

std::vector<apso::ScoredEvent> events(const Runs& runs, const Score& s, const std::function<bool(const track::RunFrame&)>& event) {
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
bool failed(const track::RunFrame& f) { return f.failed; }
bool labelled(const track::RunFrame& f) { return !f.label.empty(); }

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

void plot_roc(const fs::path& file, const Runs& runs) {
  track::Gnuplot g(file, 900, 760, 11);
  g("set title 'which score finds the frames where the feature tracker fails'; set size square; set grid lc rgb "
    "'#dddddd'");
  g("set xlabel 'false alarms / frames without failure'; set ylabel 'found / failures'; set key outside right "
    "noenhanced");
  std::string plots = "x with lines dt 2 lc rgb '#999999' notitle";
  std::vector<std::vector<std::vector<double>>> data;
  for (const Score& s : scores()) {
    const auto curve = apso::roc_curve(events(runs, s, failed));
    if (curve.empty()) continue;
    std::vector<std::vector<double>> rows;
    for (const auto& p : curve) rows.push_back({p.false_positive_rate, p.true_positive_rate});
    data.push_back(rows);
    plots += ", '-' using 1:2 with lines lw " + std::string(data.size() == 1 ? "3" : "1.3") + " title '" + s.name + " (" +
             shown(apso::area_under(curve), "%.2f") + ")'";
  }
  g("plot [0:1][0:1] " + plots);
  for (const auto& rows : data) g.data(rows);
  g.finish();
}

json plot_reliability(const fs::path& file, const Runs& runs) {
  const auto bins = apso::reliability(events(runs, scores()[0], failed), 12);
  json rows = json::array();
  std::vector<std::vector<double>> points;
  for (const auto& b : bins) {
    rows.push_back({{"mean_score", b.mean_score}, {"failure_share", b.event_share}, {"frames", b.count}});
    points.push_back({b.mean_score, b.event_share, static_cast<double>(b.count)});
  }
  track::Gnuplot g(file, 760, 640, 11);
  g("set title 'how often the feature tracker failed at a given S_final'; set grid lc rgb '#dddddd'; set key top left");
  g("set xlabel '1 - S_final'; set ylabel 'share of failed frames'; set y2label 'frames'; set y2tics; set ytics "
    "nomirror");
  g("set y2range [0:*]; set boxwidth 0.05; set style fill solid 0.3");
  g("plot [0:1][0:1] '-' using 1:3 axes x1y2 with boxes lc rgb '#bbbbbb' title 'frames', "
    "'-' using 1:2 with linespoints lw 2 pt 7 lc rgb '#1b6ca8' title 'failed'");
  g.data(points);
  g.data(points);
  g.finish();
  return rows;
}

/// S_final over time with what is known about the frames, one strip per run, at most eight of them.
void plot_timeline(const fs::path& file, const Runs& runs) {
  const std::size_t n = std::min<std::size_t>(8, runs.size());
  track::Gnuplot g(file, 1200, static_cast<int>(60 + 190 * n), 10);
  g("set multiplot layout " + std::to_string(n) + ",1");
  g("set key outside right top noenhanced; set grid lc rgb '#dddddd'; set yrange [0:1.02]");
  for (std::size_t i = 0; i < n; ++i) {
    const track::Run& run = runs[i];
    if (run.frames.empty()) continue;
    const double t0 = run.frames.front().timestamp;
    std::vector<std::vector<double>> label, flag, fail, s;
    for (const track::RunFrame& f : run.frames) {
      const double t = f.timestamp - t0;
      label.push_back({t, labelled(f) ? 1.02 : 0.0});
      flag.push_back({t, f.flagged() ? 0.1 : 0.0});
      if (f.failed) fail.push_back({t, 0.15});
      s.push_back({t, run.at(f, "S_final")});
    }
    g("set title " + track::quoted(run.name) + " noenhanced offset 0,-0.8");
    g("plot '-' using 1:2 with filledcurves y1=0 fc rgb '#fdebc8' title 'known to be hard', "
      "'-' using 1:2 with filledcurves y1=0 fc rgb '#e05050' title 'BAD or LOST', "
      "'-' using 1:2 with points pt 7 ps 0.5 lc rgb '#000000' title 'tracker failed', "
      "'-' using 1:2 with lines lw 2 lc rgb '#1b6ca8' title 'S_final'");
    g.data(label);
    g.data(flag);
    if (fail.empty()) fail.push_back({0, -1});
    g.data(fail);
    g.data(s);
  }
  g("unset multiplot");
  g.finish();
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
  plot_roc(out.file("roc.png"), runs);
  result["reliability"] = plot_reliability(out.file("reliability.png"), runs);
  plot_timeline(out.file("timeline.png"), runs);
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
