/// \file
/// The two plots of a run, drawn by gnuplot from data written through a pipe.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include <apso/evaluation/trajectory.hpp>
#include <apso/pipeline/report.hpp>

namespace track {

/// A pipe to gnuplot; writes nothing when gnuplot is not installed.
class Gnuplot {
 public:
  Gnuplot() : pipe_(popen("gnuplot >/dev/null 2>&1", "w"), &pclose) {}
  void operator()(const std::string& text) const {
    if (pipe_) std::fputs((text + "\n").c_str(), pipe_.get());
  }
  /// Inline data of a `plot '-'`: rows of numbers; a row with a NaN breaks the line.
  void data(const std::vector<std::vector<double>>& rows) const {
    for (const auto& row : rows) {
      std::string line;
      bool broken = false;
      char number[32];
      for (double v : row) {
        broken = broken || !std::isfinite(v);
        std::snprintf(number, sizeof number, "%.9g ", v);
        line += number;
      }
      (*this)(broken ? "" : line);
    }
    (*this)("e");
  }

 private:
  std::unique_ptr<FILE, int (*)(FILE*)> pipe_;
};

inline std::string quoted(const std::string& path) {
  std::string s = "'";
  for (char c : path) s += c == '\'' ? std::string("''") : std::string(1, c);
  return s + "'";
}

/// The part of space that trajectories cover: the two axes along which they extend most, and a square around them.
class BestView {
 public:
  explicit BestView(const std::vector<const apso::Trajectory*>& trajectories) {
    Eigen::AlignedBox3d box;
    for (const apso::Trajectory* t : trajectories) {
      for (const auto& p : *t) box.extend(p.T_world_body.translation());
    }
    if (box.isEmpty()) return;
    int flat = 1;  // y, which points down, unless another axis extends less
    for (int i = 0; i < 3; ++i) {
      if (box.sizes()[i] < box.sizes()[flat]) flat = i;
    }
    across = flat == 0 ? 1 : 0;
    up = flat == 2 ? 1 : 2;
    half = std::max(1e-3, 0.55 * std::max(box.sizes()[across], box.sizes()[up]));
    centre = box.center();
  }
  /// Ranges, labels and the same scale on both axes.
  void set(const Gnuplot& g) const {
    const char* names[] = {"x", "y", "z"};
    char text[200];
    std::snprintf(text, sizeof text, "set xlabel '%s [m]'; set ylabel '%s [m]'; set size ratio -1", names[across], names[up]);
    g(text);
    std::snprintf(text, sizeof text, "set xrange [%.6g:%.6g]; set yrange [%.6g:%.6g]", centre[across] - half,
                  centre[across] + half, centre[up] - half, centre[up] + half);
    g(text);
  }
  int across = 0;
  int up = 2;
  double half = 1;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
};

/// Trajectories in the plane of their largest extent, and over time.
inline void plot_trajectory(const std::string& file, const apso::Trajectory& truth, const apso::Trajectory& features,
                            const apso::Trajectory& final_poses, const std::string& title) {
  Gnuplot g;
  g("set terminal pngcairo size 900,1000 font 'sans,11' background rgb 'white'");
  g("set output " + quoted(file));
  g("set multiplot layout 2,1");
  g("set title " + quoted(title) + " noenhanced");
  g("set grid lc rgb '#dddddd'; set key outside right top");
  const BestView view({&truth, &features, &final_poses});
  const double t0 = final_poses.empty() ? 0 : final_poses.front().timestamp;
  const auto rows = [&](const apso::Trajectory& t, bool over_time) {
    std::vector<std::vector<double>> r;
    for (const auto& p : t) {
      const Eigen::Vector3d x = p.T_world_body.translation();
      if (over_time) {
        r.push_back({p.timestamp - t0, x.x(), x.y(), x.z()});
      } else {
        r.push_back({x[view.across], x[view.up]});
      }
    }
    return r;
  };
  std::string curves;
  const auto add = [&](const char* c) { curves += (curves.empty() ? "" : ", ") + std::string(c); };
  if (!truth.empty()) add("'-' using 1:2 with lines lw 3 lc rgb '#999999' title 'ground truth'");
  add("'-' using 1:2 with lines lw 1.5 lc rgb '#d95f02' title 'features only'");
  add("'-' using 1:2 with lines lw 1.5 lc rgb '#1b6ca8' title 'final'");
  view.set(g);
  g("plot " + curves);
  if (!truth.empty()) g.data(rows(truth, false));
  g.data(rows(features, false));
  g.data(rows(final_poses, false));
  g("unset title; set autoscale; set size noratio; set xlabel 'time [s]'; set ylabel 'position [m]'");
  curves.clear();
  if (!truth.empty()) {
    add("'-' using 1:2 with lines lw 3 lc rgb '#bbbbbb' title 'truth x, y, z'");
    add("'-' using 1:3 with lines lw 3 lc rgb '#bbbbbb' notitle");
    add("'-' using 1:4 with lines lw 3 lc rgb '#bbbbbb' notitle");
  }
  add("'-' using 1:2 with lines lw 1.5 lc rgb '#1b6ca8' title 'final x'");
  add("'-' using 1:3 with lines lw 1.5 lc rgb '#1b9e77' title 'final y'");
  add("'-' using 1:4 with lines lw 1.5 lc rgb '#7570b3' title 'final z'");
  g("plot " + curves);
  if (!truth.empty()) {
    for (int i = 0; i < 3; ++i) g.data(rows(truth, true));
  }
  for (int i = 0; i < 3; ++i) g.data(rows(final_poses, true));
  g("unset multiplot");
}

/// Scores and the verdict over time.
inline void plot_scores(const std::string& file, const std::vector<apso::FrameReport>& reports, const std::string& title) {
  if (reports.empty()) return;
  Gnuplot g;
  g("set terminal pngcairo size 1100,760 font 'sans,11' background rgb 'white'");
  g("set output " + quoted(file));
  g("set multiplot layout 3,1 title " + quoted(title) + " noenhanced");
  g("set grid lc rgb '#dddddd'; set key outside right top noenhanced; set yrange [0:1.02]; set ylabel 'score'");
  const double t0 = reports.front().timestamp;
  const double nan = std::nan("");
  const auto column = [&](auto&& value) {
    std::vector<std::vector<double>> r;
    for (const auto& f : reports) r.push_back({f.timestamp - t0, value(f)});
    return r;
  };
  const auto of = [nan](const auto& maybe) { return maybe ? maybe->value() : nan; };
  const auto shade = [&](apso::SceneState s) { return column([=](const auto& f) { return f.state == s ? 1.02 : 0.0; }); };
  g("plot '-' using 1:2 with filledcurves y1=0 fc rgb '#fbd0d0' title 'BAD', '-' using 1:2 with filledcurves y1=0 fc rgb '#e6d0fb' title 'LOST', "
    "'-' using 1:2 with filledcurves y1=0 fc rgb '#d8ecf8' title 'initialising', "
    "'-' using 1:2 with lines lw 2 lc rgb '#1b6ca8' title 'S_final', '-' using 1:2 with lines dt 2 lc rgb '#000000' title 'th_differ'");
  g.data(shade(apso::SceneState::Bad));
  g.data(shade(apso::SceneState::Lost));
  g.data(shade(apso::SceneState::Initialising));
  g.data(column([&](const auto& f) { return of(f.assessment.S_final); }));
  g.data(column([](const auto& f) { return f.assessment.th_differ; }));
  const auto line = [](const std::string& name, const char* style) { return "'-' using 1:2 with lines" + std::string(style) + " title '" + name + "'"; };
  std::vector<std::string> of_frame, of_change;
  apso::for_each_frame_score(apso::Assessment{}, [&](const char* name, auto&&...) { of_frame.emplace_back(name); });
  apso::for_each_change_score(apso::Assessment{}, [&](const char* name, auto&&...) { of_change.emplace_back(name); });
  const auto score_lines = [&](const std::vector<std::string>& names) {
    for (const std::string& name : names) {
      g.data(column([&](const auto& f) { return f.assessment.get(name).value_or(nan); }));
    }
  };
  std::string plot = "plot " + line("S_total", " lw 2 lc rgb '#000000'");
  for (const std::string& name : of_frame) plot += ", " + line(name, "");
  g(plot);
  g.data(column([](const auto& f) { return f.assessment.S_total.value(); }));
  score_lines(of_frame);
  g("set xlabel 'time [s]'; set ylabel 'deviation'");
  plot = "plot " + line("S_change", " lw 2 lc rgb '#000000'");
  for (const std::string& name : of_change) plot += ", " + line(name, "");
  g(plot + ", " + line("dynamic ratio", " lw 2 lc rgb '#e41a1c'"));
  g.data(column([&](const auto& f) { return of(f.assessment.S_change); }));
  score_lines(of_change);
  g.data(column([](const auto& f) { return f.assessment.dynamic_ratio; }));
  g("unset multiplot");
}

}  // namespace track
