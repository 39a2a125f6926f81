/// \file
/// Pictures of apso_assess.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include <apso/evaluation/decision_analysis.hpp>

#include "../track/gnuplot.hpp"
#include "scores.hpp"

namespace assess {

/// ROC curve of every score for the failures of the tracker.
inline void plot_roc(const std::filesystem::path& file, const Runs& runs) {
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

/// Share of failures by S_final. \return the bins
inline json plot_reliability(const std::filesystem::path& file, const Runs& runs) {
  const auto bins = apso::reliability(events(runs, scores()[0], failed), 12);
  json rows = json::array();
  std::vector<std::vector<double>> points;
  for (const auto& b : bins) {
    rows.push_back({{"mean_score", b.mean_score}, {"failure_share", b.event_share}, {"frames", b.count}});
    points.push_back({b.mean_score, b.event_share, static_cast<double>(b.count)});
  }
  track::Gnuplot g(file, 760, 640, 11);
  g("set title 'how often the feature tracker failed at a given S_final' noenhanced; set grid lc rgb '#dddddd'; set key top center");
  g("set xlabel '1 - S_final' noenhanced; set ylabel 'share of failed frames'; set y2label 'frames'; set y2tics; set ytics "
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
inline void plot_timeline(const std::filesystem::path& file, const Runs& runs) {
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

}  // namespace assess
