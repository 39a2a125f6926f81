/// \file
/// The two plots of a run, drawn by gnuplot from data written through a pipe.
#pragma once

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <apso/evaluation/trajectory.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/pipeline/report.hpp>

namespace track {

/// In single quotes for gnuplot. Control characters, which could end the line, become '?'.
inline std::string quoted(const std::string& text) {
  std::string s = "'";
  for (char c : text) {
    s += std::iscntrl(static_cast<unsigned char>(c)) != 0 ? '?' : c;
    if (c == '\'') s += c;
  }
  return s + "'";
}

/// A picture that gnuplot draws from what is written to it through a pipe. Without gnuplot there is no picture.
class Gnuplot {
 public:
  /// \param file the picture, PNG
  /// \param width, height [px]
  Gnuplot(std::filesystem::path file, int width, int height, int font) : file_(std::move(file)) {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0) throw apso::io_error("gnuplot: no pipe to it can be made");
    char program[] = "gnuplot";
    char* arguments[] = {program, nullptr};
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[0], STDIN_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    if (::posix_spawnp(&child_, program, &actions, nullptr, arguments, environ) != 0) child_ = -1;
    posix_spawn_file_actions_destroy(&actions);
    ::close(ends[0]);
    pipe_.reset(::fdopen(ends[1], "w"));
    (*this)("set terminal pngcairo size " + std::to_string(width) + "," + std::to_string(height) + " font 'sans," + std::to_string(font) +
            "' background rgb 'white'");
  }
  ~Gnuplot() { (void)wait(); }
  Gnuplot(const Gnuplot&) = delete;
  Gnuplot& operator=(const Gnuplot&) = delete;

  void operator()(const std::string& text) const {
    if (child_ > 0) std::fputs((text + "\n").c_str(), pipe_.get());
  }
  /// Waits for the picture. Throws io_error when it was drawn and cannot be written; tells when it was not drawn.
  void finish() {
    const bool installed = child_ > 0;
    const int status = wait();
    if (!installed || status != 0) {
      std::fprintf(stderr, "warning: %s: not drawn, %s\n", file_.c_str(), installed ? "gnuplot failed" : "gnuplot cannot be started");
      std::error_code ignored;
      std::filesystem::remove(file_, ignored);
      return;
    }
    std::ifstream picture(file_, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(picture), {}};
    const bool whole = bytes.size() > 8 && bytes.compare(bytes.size() - 8, 4, "IEND") == 0;  // the last chunk of a PNG
    if (!whole) throw apso::io_error(file_.string() + ": cannot write (disk full?)");
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
  int wait() {
    pipe_.reset();
    int status = 0;
    if (child_ > 0) ::waitpid(child_, &status, 0);
    child_ = -1;
    return status;
  }

  std::filesystem::path file_;
  pid_t child_ = -1;
  std::unique_ptr<FILE, int (*)(FILE*)> pipe_{nullptr, &std::fclose};
};

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
inline void plot_trajectory(const std::filesystem::path& file, const apso::Trajectory& truth, const apso::Trajectory& features,
                            const apso::Trajectory& final_poses, const std::string& title) {
  if (features.empty() && final_poses.empty()) return;
  Gnuplot g(file, 900, 1000, 11);
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
  g.finish();
}

/// Scores and the verdict over time.
inline void plot_scores(const std::filesystem::path& file, const std::vector<apso::FrameReport>& reports, const std::string& title) {
  if (reports.empty()) return;
  Gnuplot g(file, 1100, 760, 11);
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
  g.finish();
}

}  // namespace track
