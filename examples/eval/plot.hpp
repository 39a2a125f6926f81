/// \file
/// The picture of an evaluation: trajectories over the ground truth, and their errors over time.
#pragma once

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <system_error>
#include <vector>

#include "../track/plots.hpp"
#include "../track/results.hpp"
#include "errors.hpp"

namespace eval {

/// How a picture begins and ends in a file of this extension; nothing for one that cannot be written.
struct PictureFormat {
  const char* extension;
  const char* terminal;  ///< of gnuplot
  const char* begins;
  const char* ends;
};
inline const PictureFormat* picture_format(const std::string& file) {
  static constexpr std::array<PictureFormat, 3> formats{
      {{".png", "pngcairo size 1000,1150 font 'sans,11' background rgb 'white'", "\x89PNG", "IEND"},
       {".svg", "svg size 1000,1150 dynamic font 'sans,14' background rgb 'white'", "<?xml", "</svg>"},
       {".pdf", "pdfcairo size 7in,8in font 'sans,10' background rgb 'white'", "%PDF", "%%EOF"}}};
  std::string extension = std::filesystem::path(file).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const PictureFormat& f : formats) {
    if (extension == f.extension) return &f;
  }
  return nullptr;
}

/// Throws unless the picture may be written there: not over an input, and over an existing file only if that is a picture.
inline void check_picture(const std::string& file, const std::vector<track::Input>& inputs) {
  const PictureFormat* format = picture_format(file);
  if (format == nullptr) throw std::invalid_argument("--plot " + file + ": expected a file .png, .svg or .pdf");
  track::keep_apart(file, inputs);
  std::ifstream old(file, std::ios::binary);
  if (!old) return;
  std::string start(std::string(format->begins).size(), ' ');
  old.read(start.data(), static_cast<std::streamsize>(start.size()));
  if (old.gcount() > 0 && start != format->begins)
    throw apso::io_error("--plot " + file + ": exists and is no such picture, take another name");
}

/// Runs of gnuplot data: a gap of time breaks the line.
inline std::vector<std::vector<double>> with_gaps(std::vector<std::vector<double>> rows, const std::vector<double>& stamps) {
  const double gap = 10 * track::median_step(stamps);
  std::vector<std::vector<double>> out;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i > 0 && gap > 0 && stamps[i] - stamps[i - 1] > gap) out.push_back({std::numeric_limits<double>::quiet_NaN(), 0});
    out.push_back(std::move(rows[i]));
  }
  return out;
}

/// Draws the estimates, aligned, over the ground truth in the plane of the largest extent, and the position errors over time.
/// \param file .png, .svg or .pdf, already checked by check_picture
inline void plot_errors(const std::filesystem::path& file, const Poses& truth, const std::vector<Errors>& all, const Rules& rules) {
  // Okabe and Ito's colours, which the colour-blind tell apart; the dashes differ as well.
  const std::array<const char*, 7> colours{"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000"};
  const PictureFormat& format = *picture_format(file.string());
  const std::filesystem::path part = file.string() + ".part";

  std::vector<apso::Trajectory> estimates;
  double first = std::numeric_limits<double>::infinity();
  double last = -first;
  for (const Errors& e : all) {
    estimates.push_back(apso::aligned(e.estimate.trajectory(), e.ate));
    first = std::min(first, truth.trajectory()[e.ate.pairs.front().first].timestamp);
    last = std::max(last, truth.trajectory()[e.ate.pairs.back().first].timestamp);
  }
  apso::Trajectory meanwhile;  // the truth while there is an estimate
  for (const apso::StampedPose& p : truth.trajectory()) {
    if (p.timestamp >= first && p.timestamp <= last) meanwhile.push_back(p);
  }
  std::vector<const apso::Trajectory*> shown{&meanwhile};
  for (const apso::Trajectory& t : estimates) shown.push_back(&t);
  const track::BestView view(shown);
  const auto path = [&](const apso::Trajectory& t) {
    std::vector<std::vector<double>> rows;
    for (const apso::StampedPose& p : t) rows.push_back({p.T_world_body(view.across, 3), p.T_world_body(view.up, 3)});
    return with_gaps(std::move(rows), apso::timestamps(t));
  };
  const auto style = [&](std::size_t i) {
    return "with lines lw 1.5 dt " + std::to_string(1 + i / colours.size()) + " lc rgb '" + colours[i % colours.size()] + "'";
  };
  {
    track::Gnuplot g(part, 1000, 1150, 11);
    g(std::string("set terminal ") + format.terminal);
    g("set multiplot layout 2,1");
    const char* axes = "xyz";
    const std::string title = truth.name + ", aligned by " + enum_name(rules.ate.alignment) + ": plane of the largest extent, " +
                              axes[view.across] + " and " + axes[view.up];
    g("set title " + track::quoted(title) + " noenhanced");
    g("set grid lt 1 lw 0.5 lc rgb '#cccccc'; set key below vertical maxcols 1 left Left reverse noenhanced");
    view.set(g);
    std::string curves =
        "'-' using 1:2 with lines lw 4 lc rgb '#bbbbbb' title 'ground truth', "
        "'-' using 1:2 with points pt 7 ps 1.3 lc rgb '#000000' title 'start', '-' using 1:2 with points pt 5 ps 1.3 lc rgb '#000000' "
        "title 'end'";
    for (std::size_t i = 0; i < all.size(); ++i) {
      char figures[120];
      std::snprintf(figures, sizeof figures, ": ATE rmse %.4f m, %zu of %zu pairs", all[i].ate.statistics.rmse, all[i].ate.pairs.size(),
                    all[i].possible);
      curves += ", '-' using 1:2 " + style(i) + " title " + track::quoted(all[i].estimate.name + figures);
    }
    g("plot " + curves);
    g.data(path(meanwhile));
    for (const apso::StampedPose* p : {&meanwhile.front(), &meanwhile.back()})
      g.data({{p->T_world_body(view.across, 3), p->T_world_body(view.up, 3)}});
    for (const apso::Trajectory& t : estimates) g.data(path(t));

    g("set title 'position error of each pair'; set autoscale; set size noratio; set yrange [0:*]");
    g("set autoscale xfix; set key below horizontal left Left reverse noenhanced");
    g(std::string("set xlabel '") + (truth.file.has_stamps ? "time [s]" : "frame") + "'; set ylabel 'position error [m]'");
    curves.clear();
    for (std::size_t i = 0; i < all.size(); ++i) {
      curves += (i > 0 ? ", " : "") + ("'-' using 1:2 " + style(i)) + " title " + track::quoted(all[i].estimate.name);
    }
    g("plot " + curves);
    const double zero = truth.file.has_stamps ? first : 0;
    for (const Errors& e : all) {
      std::vector<std::vector<double>> rows;
      std::vector<double> stamps;
      for (std::size_t k = 0; k < e.ate.pairs.size(); ++k) {
        stamps.push_back(truth.trajectory()[e.ate.pairs[k].first].timestamp);
        rows.push_back({stamps.back() - zero, e.ate.errors[k]});
      }
      g.data(with_gaps(std::move(rows), stamps));
    }
    g("unset multiplot");
  }
  std::ifstream drawn(part, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(drawn), {}};
  const std::size_t tail = bytes.size() > 16 ? bytes.size() - 16 : 0;
  if (bytes.find(format.ends, tail) == std::string::npos) {
    std::error_code ignored;
    std::filesystem::remove(part, ignored);
    throw apso::io_error("--plot " + file.string() + ": was not drawn: gnuplot is missing (package gnuplot-nox) or cannot write there");
  }
  std::filesystem::rename(part, file);
}

}  // namespace eval
