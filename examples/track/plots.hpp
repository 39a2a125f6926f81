/// \file
/// The two plots of a run, as PNG, SVG or PDF.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <list>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include <apso/evaluation/trajectory.hpp>
#include <apso/pipeline/report.hpp>

#include "gnuplot.hpp"

namespace track {

/// The two axes along which a path extends most, and a square around all that is drawn.
class BestView {
 public:
  /// \param path  chooses the axes, as in the report
  /// \param other also drawn: an estimate that jumps makes the square larger, and turns nothing
  explicit BestView(const std::vector<const apso::Trajectory*>& path, const std::vector<const apso::Trajectory*>& other = {}) {
    Eigen::AlignedBox3d box;
    const auto extend = [&box](const std::vector<const apso::Trajectory*>& trajectories) {
      for (const apso::Trajectory* t : trajectories) {
        for (const auto& p : *t) box.extend(p.T_world_body.translation());
      }
    };
    extend(path);
    int flat = 1;  // y, which points down, unless another axis extends less
    for (int i = 0; i < 3 && !box.isEmpty(); ++i) {
      if (box.sizes()[i] < box.sizes()[flat]) flat = i;
    }
    extend(other);
    if (box.isEmpty()) return;
    across = flat == 0 ? 1 : 0;
    up = flat == 2 ? 1 : 2;
    half = std::max(1e-3, 0.55 * std::max(box.sizes()[across], box.sizes()[up]));
    centre = box.center();
  }
  /// Ranges, labels and the same scale on both axes.
  void set(const Gnuplot& g) const {
    char text[200];
    std::snprintf(text, sizeof text, "set xlabel '%s [m]'; set ylabel '%s [m]'; set size ratio -1", axis(across), axis(up));
    g(text);
    std::snprintf(text, sizeof text, "set xrange [%.6g:%.6g]; set yrange [%.6g:%.6g]", centre[across] - half, centre[across] + half,
                  centre[up] - half, centre[up] + half);
    g(text);
  }
  static const char* axis(int i) {
    constexpr const char* names[] = {"x", "y", "z"};
    return names[i];
  }
  int across = 0;
  int up = 2;
  double half = 1;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
};

/// What the plots of a run show.
struct PlottedRun {
  std::string title;  ///< name of the sequence
  const std::vector<apso::FrameReport>& reports;
  const apso::Trajectory& features;
  const apso::Trajectory& final_poses;
  apso::Trajectory truth;                          ///< moved into the frame of the final poses; empty: not known
  std::vector<std::vector<double>> error;          ///< rows of time since the first frame [s] and position error [m], of the final poses
  std::vector<std::vector<double>> feature_error;  ///< of the features alone
  double rmse = 0;                                 ///< of the final poses [m]
  std::size_t pairs = 0;                           ///< poses that rmse is of
  [[nodiscard]] double start() const { return reports.empty() ? 0 : reports.front().timestamp; }
  [[nodiscard]] double seconds() const { return reports.empty() ? 1 : std::max(1e-3, reports.back().timestamp - start()); }
  /// "ATE rmse 0.0123 m, 540 pairs of 540 frames", or that there is none.
  [[nodiscard]] std::string result() const {
    if (truth.empty()) return "no ground truth that can be compared";
    char text[100];
    std::snprintf(text, sizeof text, "ATE rmse %.4f m, %zu pairs of %zu frames", rmse, pairs, reports.size());
    return text;
  }
};

namespace detail {

/// The same axis of time and the same width for all panels that follow; their keys stand beside them.
inline void time_axis(const Gnuplot& g, const PlottedRun& run) {
  char text[300];
  std::snprintf(text, sizeof text,
                "set lmargin at screen 0.09; set rmargin at screen 0.80; set size noratio; set xrange [0:%.6f]; "
                "set key at screen 0.81, graph 1 left top Left reverse noenhanced samplen 2 font ',9'",
                run.seconds());
  g(text);
}

/// Bands behind the curves of a panel, from `bottom` to `top`.
inline std::string band_curves(double bottom = 0) {
  char fill[80];
  std::snprintf(fill, sizeof fill, "'-' using 1:2 with filledcurves y1=%.6g fc rgb ", bottom);
  return std::string(fill) + "'#f6c9a4' title 'BAD', " + fill + "'#d5bfe6' title 'LOST', " + fill + "'#dfe3e8' title 'initialising'";
}
inline void band_data(const Gnuplot& g, const PlottedRun& run, double top, double bottom = 0) {
  for (const apso::SceneState s : {apso::SceneState::Bad, apso::SceneState::Lost, apso::SceneState::Initialising}) {
    std::vector<std::vector<double>> rows;
    for (std::size_t i = 0; i < run.reports.size(); ++i) {  // steps: a frame lasts until the next one
      const double v = run.reports[i].state == s ? top : bottom;
      rows.push_back({run.reports[i].timestamp - run.start(), v});
      if (i + 1 < run.reports.size()) rows.push_back({run.reports[i + 1].timestamp - run.start(), v});
    }
    g.data(rows);
  }
}

/// A logarithmic axis of errors: at most four powers of ten, so that one jump does not hide the rest.
struct Decades {
  double bottom = 1e-4;
  double top = 1;
  explicit Decades(const std::vector<const std::vector<std::vector<double>>*>& curves) {
    double least = 0;
    double most = 0;
    for (const auto* curve : curves) {
      for (const auto& row : *curve) {
        if (!(row[1] > 0) || !std::isfinite(row[1])) continue;
        least = least > 0 ? std::fmin(least, row[1]) : row[1];
        most = std::fmax(most, row[1]);
      }
    }
    if (most <= 0) return;
    top = std::pow(10, std::ceil(std::log10(most)));
    bottom = std::fmax(top / 1e4, std::fmin(top / 10, std::pow(10, std::floor(std::log10(least)))));
  }
  /// The curve, raised to the axis where it is below.
  [[nodiscard]] std::vector<std::vector<double>> within(std::vector<std::vector<double>> curve) const {
    for (auto& row : curve) row[1] = row[1] < bottom ? bottom : row[1];  // NaN, a gap, stays
    return curve;
  }
};

/// The poses of an estimate as rows; a line that is drawn through them ends where frames have no pose.
template <class Row>
std::vector<std::vector<double>> rows_with_gaps(const PlottedRun& run, const apso::Trajectory& estimate, const Row& row) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::vector<double>> rows;
  std::size_t frame = 0;
  for (const apso::StampedPose& p : estimate) {
    bool gap = false;
    for (; frame < run.reports.size() && run.reports[frame].timestamp < p.timestamp; ++frame) gap = !rows.empty();
    ++frame;
    if (gap) rows.push_back({nan, nan});
    rows.push_back(row(p));
  }
  return rows;
}

}  // namespace detail

/// Pictures that are being drawn, each by a process of its own.
using Plots = std::list<Gnuplot>;

/// Trajectories in the plane of their largest extent, and over time.
inline void plot_trajectory(const std::filesystem::path& file, const PlottedRun& run, Plots& plots) {
  if (run.features.empty() && run.final_poses.empty()) return;
  Gnuplot& g = plots.emplace_back(file, 900, 1000, 11);
  const BestView view({&run.truth, &run.final_poses}, {&run.features});
  g("set multiplot layout 2,1");
  g("set title " +
    quoted(run.title + ": " + view.axis(view.across) + " and " + view.axis(view.up) + ", the plane of largest extent; " + run.result()) +
    " noenhanced");
  g("set grid lc rgb '#dddddd'; set key outside right top font ',9'");
  const bool known = !run.truth.empty();
  using Rows = std::vector<std::vector<double>>;
  const auto in_plane = [&](const apso::Pose& pose) {
    return std::vector<double>{pose.translation()[view.across], pose.translation()[view.up]};
  };
  const auto in_the_plane = [&](const apso::StampedPose& p) { return in_plane(p.T_world_body); };
  const auto path = [&](const apso::Trajectory& t) {
    Rows r;
    for (const auto& p : t) r.push_back(in_the_plane(p));
    return r;
  };
  Rows bad;
  for (const apso::FrameReport& f : run.reports) {
    if (f.state == apso::SceneState::Bad) bad.push_back(in_plane(f.T_world_camera));
  }
  view.set(g);
  std::string curves = known ? "'-' using 1:2 with lines lw 4 lc rgb '#b5bbc2' title 'ground truth', " : "";
  curves +=
      "'-' using 1:2 with lines lw 1.2 lc rgb '#d55e00' title 'features only', "
      "'-' using 1:2 with lines lw 1.8 lc rgb '#0072b2' title 'final', "
      "'-' using 1:2 with points pt 2 ps 0.7 lc rgb '#000000' title 'BAD'";
  if (!run.final_poses.empty()) {
    curves +=
        ", '-' using 1:2 with points pt 6 ps 1.6 lw 2 lc rgb '#009e73' title 'start', "
        "'-' using 1:2 with points pt 5 ps 1.3 lc rgb '#009e73' title 'end'";
  }
  g("plot " + curves);
  if (known) g.data(path(run.truth));
  g.data(detail::rows_with_gaps(run, run.features, in_the_plane));
  g.data(detail::rows_with_gaps(run, run.final_poses, in_the_plane));
  g.data(bad);
  if (!run.final_poses.empty()) {
    g.data({in_plane(run.final_poses.front().T_world_body)});
    g.data({in_plane(run.final_poses.back().T_world_body)});
  }
  g("unset title; set autoscale; set xlabel 'time [s]'; set ylabel 'position [m]'");
  detail::time_axis(g, run);
  const auto coordinate = [&](int k) {
    return [&run, k](const apso::StampedPose& p) {
      return std::vector<double>{p.timestamp - run.start(), p.T_world_body.translation()[k]};
    };
  };
  const auto over_time = [&](const apso::Trajectory& t, int k) {
    Rows r;
    for (const auto& p : t) r.push_back(coordinate(k)(p));
    return r;
  };
  g(std::string("plot ") +
    (known ? "'-' using 1:2 with lines lw 4 lc rgb '#c9ced4' title 'truth x, y, z', '-' using 1:2 with lines lw 4 lc rgb '#c9ced4' "
             "notitle, '-' using 1:2 with lines lw 4 lc rgb '#c9ced4' notitle, "
           : "") +
    "'-' using 1:2 with lines lw 1.5 lc rgb '#0072b2' title 'final x', '-' using 1:2 with lines lw 1.5 dt 2 lc rgb '#009e73' title 'final "
    "y', "
    "'-' using 1:2 with lines lw 1.5 dt 4 lc rgb '#b0558a' title 'final z'");
  for (int k = 0; known && k < 3; ++k) g.data(over_time(run.truth, k));
  for (int k = 0; k < 3; ++k) g.data(detail::rows_with_gaps(run, run.final_poses, coordinate(k)));
  g("unset multiplot");
  g.end();
}

/// Error, verdict and scores over time.
inline void plot_scores(const std::filesystem::path& file, const PlottedRun& run, Plots& plots) {
  if (run.reports.empty()) return;
  const bool known = !run.truth.empty();
  Gnuplot& g = plots.emplace_back(file, 1100, known ? 1000 : 760, 11);
  g(std::string("set multiplot layout ") + (known ? "4" : "3") + ",1 title " + quoted(run.title + ": " + run.result()) + " noenhanced");
  g("set grid lc rgb '#dddddd'");
  detail::time_axis(g, run);
  const double nan = std::nan("");
  const auto column = [&](auto&& value) {
    std::vector<std::vector<double>> r;
    for (const auto& f : run.reports) r.push_back({f.timestamp - run.start(), value(f)});
    return r;
  };
  const auto of = [nan](const auto& maybe) { return maybe ? maybe->value() : nan; };
  const std::string bands = "plot " + detail::band_curves();
  if (known) {
    const detail::Decades axis({&run.error, &run.feature_error});
    char range[120];
    std::snprintf(range, sizeof range, "set ylabel 'position error [m]'; set logscale y; set format y '%%g'; set yrange [%.6g:%.6g]",
                  axis.bottom, axis.top);
    g(range);
    g("plot " + detail::band_curves(axis.bottom) +
      ", '-' using 1:2 with lines lw 1.2 lc rgb '#d55e00' title 'features only', '-' using 1:2 with lines lw 1.8 lc rgb '#0072b2' title "
      "'final'");
    detail::band_data(g, run, axis.top, axis.bottom);
    g.data(axis.within(run.feature_error));
    g.data(axis.within(run.error));
    g("unset logscale y; set format y");
  }
  g("set yrange [0:1.02]; set ylabel 'S_final' noenhanced");
  g(bands +
    ", '-' using 1:2 with lines lw 2 lc rgb '#0072b2' title 'S_final', '-' using 1:2 with lines dt 2 lc rgb '#000000' title 'th_differ'");
  detail::band_data(g, run, 1.02);
  g.data(column([&](const auto& f) { return of(f.assessment.S_final); }));
  g.data(column([&](const auto& f) { return f.state == apso::SceneState::Initialising ? nan : f.assessment.th_differ; }));
  const auto line = [](const std::string& name, const std::string& style) {
    return "'-' using 1:2 with lines " + style + " title '" + name + "'";
  };
  const char* colours[] = {"#0072b2", "#d55e00", "#009e73", "#b0558a", "#b87f00", "#2c8fc9"};
  const auto scores = [&](const std::string& first, const auto& first_value, const std::vector<std::string>& names, bool ratio) {
    std::string plot = "plot " + line(first, "lw 2 lc rgb '#000000'");
    for (std::size_t i = 0; i < names.size(); ++i) plot += ", " + line(names[i], std::string("lc rgb '") + colours[i % 6] + "'");
    if (ratio) plot += ", " + line("dynamic ratio", "lw 2 dt 2 lc rgb '#b87f00'");
    g(plot);
    g.data(column(first_value));
    for (const std::string& name : names) g.data(column([&](const auto& f) { return f.assessment.get(name).value_or(nan); }));
    if (ratio) g.data(column([](const auto& f) { return f.assessment.dynamic_ratio; }));
  };
  std::vector<std::string> of_frame, of_change;
  apso::for_each_frame_score(apso::Assessment{}, [&](const char* name, auto&&...) { of_frame.emplace_back(name); });
  apso::for_each_change_score(apso::Assessment{}, [&](const char* name, auto&&...) { of_change.emplace_back(name); });
  g("set ylabel 'score, 1 is best'");
  scores(
      "S_total", [](const auto& f) { return f.assessment.S_total.value(); }, of_frame, false);
  g("set xlabel 'time [s]'; set ylabel 'deviation, 0 is best'");
  scores(
      "S_change", [&](const auto& f) { return of(f.assessment.S_change); }, of_change, true);
  g("unset multiplot");
  g.end();
}

}  // namespace track
