// Absolute and relative error of estimated trajectories, as table or JSON, and as a picture.
//   apso_eval groundtruth.txt estimate.txt --association evo --delta 1f --json
//   apso_eval groundtruth.csv ours.txt theirs.txt --table markdown --plot errors.svg
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "eval/errors.hpp"
#include "eval/plot.hpp"
#include "eval/table.hpp"
#include "track/command_line.hpp"

namespace {

nlohmann::ordered_json to_json(const apso::Statistics& s) {
  nlohmann::ordered_json j;
  const auto value = [&](double v) { return s.count > 0 ? nlohmann::ordered_json(v) : nlohmann::ordered_json(nullptr); };
  j["rmse"] = value(s.rmse);
  j["mean"] = value(s.mean);
  j["median"] = value(s.median);
  j["std"] = value(s.std);
  j["min"] = value(s.min);
  j["max"] = value(s.max);
  return j;
}

void print_row(const char* name, const apso::Statistics& s) {
  if (s.count == 0) {
    std::printf("%-22s %7d %10s %10s %10s %10s %10s %10s\n", name, 0, "-", "-", "-", "-", "-", "-");
    return;
  }
  std::printf("%-22s %7zu %10.6f %10.6f %10.6f %10.6f %10.6f %10.6f\n", name, s.count, s.rmse, s.mean, s.median, s.std, s.min, s.max);
}

struct Arguments {
  std::string groundtruth;
  std::vector<std::string> estimates;
  std::vector<std::string> names;
  std::string baseline;
  std::string format = "auto";
  std::string groundtruth_format;
  std::string times;
  std::string delta;
  std::string align = eval::enum_name(apso::AteOptions{}.alignment);
  std::string gravity = eval::enum_name(apso::AteOptions{}.gravity_axis);
  std::string association = eval::enum_name(apso::AteOptions{}.association);
  std::string form = eval::enum_name(apso::RpeOptions{}.form);
  std::string table = "text";
  std::string plot;
  double max_difference = 0;
  double offset = 0;
  int digits = 6;
  bool json = false;
};

struct Evaluation {
  eval::Rules rules;
  eval::Poses truth;
  std::vector<eval::Errors> all;
  std::size_t baseline = 0;
  std::vector<std::string> warnings;
};

/// Short names that tell the files apart: without folder and extension where these are the same for all, else with as many folders as it
/// takes.
std::vector<std::string> short_names(const std::vector<std::string>& files) {
  namespace fs = std::filesystem;
  for (int folders = 0; folders < 32; ++folders) {
    std::vector<std::string> names;
    for (const std::string& file : files) {
      const fs::path path = fs::path(file).lexically_normal();
      std::string name = path.stem().string();
      fs::path folder = path.parent_path();
      for (int i = 0; i < folders && !folder.filename().empty(); ++i, folder = folder.parent_path())
        name = (folder.filename() / name).string();
      names.push_back(name);
    }
    std::vector<std::string> sorted = names;
    std::sort(sorted.begin(), sorted.end());
    if (std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end()) return names;
  }
  return files;
}

/// Throws when something that was asked for cannot be computed.
Evaluation evaluate(const Arguments& a) {
  Evaluation e;
  e.rules.ate.alignment = eval::enum_value<apso::TrajectoryAlignment>(a.align);
  e.rules.ate.gravity_axis = eval::enum_value<apso::Axis>(a.gravity);
  e.rules.ate.association = eval::enum_value<apso::AssociationRule>(a.association);
  e.rules.ate.max_difference = a.max_difference;
  e.rules.ate.time_offset = a.offset;
  e.rules.rpe.form = eval::enum_value<apso::RpeForm>(a.form);
  e.rules.rpe.time_offset = a.offset;
  if (!a.delta.empty()) eval::parse_delta(a.delta, e.rules.rpe);

  const std::vector<std::string> names = a.names.empty() ? short_names(a.estimates) : a.names;
  if (names.size() != a.estimates.size()) {
    throw std::invalid_argument("--names: " + std::to_string(names.size()) + " names for " + std::to_string(a.estimates.size()) +
                                " estimates");
  }
  e.truth = eval::read_poses(a.groundtruth, a.groundtruth_format.empty() ? a.format : a.groundtruth_format, a.times, e.warnings);
  // The name of a recording is that of its folder.
  const std::filesystem::path truth_path = std::filesystem::absolute(a.groundtruth).lexically_normal();
  const bool generic = truth_path.stem() == "groundtruth" && truth_path.parent_path().has_filename();
  e.truth.name = (generic ? truth_path.parent_path().filename() : truth_path.stem()).string();
  std::vector<eval::Poses> estimates;
  bool any_kitti = e.truth.file.format == apso::TrajectoryFormat::Kitti;
  for (std::size_t i = 0; i < a.estimates.size(); ++i) {
    estimates.push_back(eval::read_poses(a.estimates[i], a.format, a.times, e.warnings));
    estimates.back().name = names[i];
    any_kitti = any_kitti || estimates.back().file.format == apso::TrajectoryFormat::Kitti;
  }
  if (!a.times.empty() && !any_kitti)
    throw std::invalid_argument("--times: no file is of the KITTI format, the others have their own stamps");
  if (!a.baseline.empty()) {
    const auto found = std::find(names.begin(), names.end(), a.baseline);
    const auto file = std::find(a.estimates.begin(), a.estimates.end(), a.baseline);
    if (found == names.end() && file == a.estimates.end()) {
      std::string known;
      for (const std::string& n : names) known += (known.empty() ? "" : ", ") + n;
      throw std::invalid_argument("--baseline '" + a.baseline + "': no such estimate, expected one of " + known);
    }
    e.baseline = static_cast<std::size_t>(found != names.end() ? found - names.begin() : file - a.estimates.begin());
  }
  e.rules.has_stamps = e.truth.file.has_stamps;
  // Without stamps there are no seconds: from frame to frame.
  e.rules.delta = !a.delta.empty() ? a.delta : e.truth.file.has_stamps ? "1s" : "1f";
  eval::parse_delta(e.rules.delta, e.rules.rpe);
  if (!e.truth.file.has_stamps && e.rules.rpe.unit == apso::DeltaUnit::Seconds) {
    throw std::invalid_argument("--delta " + a.delta +
                                ": KITTI poses have no stamps: give them with --times, or an interval in f, m, deg or rad");
  }
  if (!e.truth.file.has_stamps && (a.offset != 0 || a.max_difference != 0)) {
    throw std::invalid_argument("--offset and --max-difference are of stamps, and KITTI poses have none: give them with --times");
  }
  for (const eval::Poses& p : estimates) e.all.push_back(eval::errors_of(e.truth, p, e.rules));
  for (const eval::Errors& x : e.all) e.warnings.insert(e.warnings.end(), x.warnings.begin(), x.warnings.end());
  for (const std::string& w : eval::compare_pairs(e.all)) e.warnings.push_back(w);
  return e;
}

nlohmann::ordered_json to_json(const eval::Errors& x, const Evaluation& e) {
  nlohmann::ordered_json out;
  out["pairs"] = x.ate.pairs.size();
  out["pairs_possible"] = x.possible;
  out["poses"] = x.estimate.trajectory().size();
  out["format"] = eval::enum_name(x.estimate.file.format);
  if (e.rules.has_stamps) {
    out["association"] = {{"rule", eval::enum_name(e.rules.ate.association)}, {"max_difference_s", eval::limit_of(e.rules.ate)}};
  } else {
    out["association"] = {{"rule", "frame"}};
  }
  out["alignment"] = {{"kind", eval::enum_name(e.rules.ate.alignment)}, {"scale", x.ate.scale}};
  out["ate"] = to_json(x.ate.statistics);
  out["rpe"]["delta"] = e.rules.delta;
  out["rpe"]["form"] = eval::enum_name(e.rules.rpe.form);
  out["rpe"]["pairs"] = x.rpe.pairs.size();
  out["rpe"]["translation"] = to_json(x.rpe.translation);
  out["rpe"]["rotation_deg"] = to_json(x.rpe.rotation_deg);
  return out;
}

void print_one(const Evaluation& e) {
  const eval::Errors& x = e.all.front();
  const auto file = [](const char* role, const eval::Poses& p) {
    std::printf("%-12s  %s (%s, %zu poses)\n", role, p.path.c_str(), eval::enum_name(p.file.format).c_str(), p.trajectory().size());
  };
  file("ground truth", e.truth);
  file("estimate", x.estimate);
  std::printf("association   %s; %zu of %zu pairs (%.1f %%)\n", eval::association_text(e.rules).c_str(), x.ate.pairs.size(), x.possible,
              100 * x.share());
  std::printf("alignment     %s", eval::alignment_text(e.rules.ate).c_str());
  if (e.rules.ate.alignment == apso::TrajectoryAlignment::Sim3) std::printf("; scale %.6f", x.ate.scale);
  std::printf("\nRPE           over %s, form %s\n\n", e.rules.delta.c_str(), eval::form_text(e.rules.rpe).c_str());
  std::printf("%-22s %7s %10s %10s %10s %10s %10s %10s\n", "", "pairs", "rmse", "mean", "median", "std", "min", "max");
  print_row("ATE [m]", x.ate.statistics);
  print_row(("RPE " + e.rules.delta + " [m]").c_str(), x.rpe.translation);
  print_row(("RPE " + e.rules.delta + " [deg]").c_str(), x.rpe.rotation_deg);
}

void print(const Evaluation& e, const Arguments& a) {
  if (a.json) {
    nlohmann::ordered_json out;
    if (e.all.size() == 1) {
      out = to_json(e.all.front(), e);
    } else {
      for (const eval::Errors& x : e.all) {
        nlohmann::ordered_json one{{"name", x.estimate.name}};
        one.update(to_json(x, e));
        out["estimates"].push_back(one);
      }
      out["baseline"] = e.all[e.baseline].estimate.name;
    }
    std::printf("%s\n", out.dump(2, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
    return;
  }
  const auto kind = eval::enum_value<eval::TableFormat>(a.table);
  if (kind == eval::TableFormat::Text && e.all.size() == 1) return print_one(e);
  if (kind == eval::TableFormat::Csv) {
    std::fputs(eval::csv(e.all, e.baseline, e.rules).c_str(), stdout);
    return;
  }
  const eval::Table table(e.all, e.baseline, e.rules, a.digits);
  const std::string text = kind == eval::TableFormat::Markdown ? table.markdown()
                           : kind == eval::TableFormat::Latex  ? table.latex()
                                                               : table.text();
  std::fputs(text.c_str(), stdout);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Errors of estimated camera trajectories against ground truth.\n"
      "Files of TUM RGB-D ('timestamp tx ty tz qx qy qz qw', also with nanoseconds), KITTI\n"
      "odometry (3x4 matrices) and EuRoC (csv, nanoseconds) are told apart by themselves.\n"
      "ATE: distance of the positions after one alignment, rigid unless --align says otherwise.\n"
      "RPE: error of the motion over --delta, pairs as in evaluate_rpe.py --fixed_delta.");
  app.footer(
      "Examples:\n"
      "  apso_eval groundtruth.txt estimate.txt\n"
      "  apso_eval groundtruth.txt estimate.txt --association evo --delta 1f --json\n"
      "  apso_eval groundtruth.csv a.txt b.txt --table latex --baseline a --plot errors.svg\n\n"
      "Exit code: 0 the ATE of every estimate could be computed, 1 it could not, 2 wrong usage.");
  const std::vector<std::string> formats{"auto", "tum", "tum_ns", "kitti", "euroc"};
  Arguments a;
  app.add_option("groundtruth", a.groundtruth, "Ground-truth trajectory")->required();
  app.add_option("estimates", a.estimates, "Estimated trajectories, one or more")->required();
  app.add_option("--format", a.format, "Format of all files")->check(CLI::IsMember(formats))->capture_default_str();
  app.add_option("--groundtruth-format", a.groundtruth_format, "Format of the ground truth, if it is another")
      ->check(CLI::IsMember(formats));
  app.add_option("--times", a.times, "Stamps of KITTI files, times.txt: one number a line [s]");
  app.add_option("--align", a.align,
                 "How an estimate is laid onto the ground truth: se3 (rigid), sim3 (with a scale),\n"
                 "yaw (translation and turn about gravity), none")
      ->check(CLI::IsMember({"se3", "sim3", "yaw", "none"}))
      ->capture_default_str();
  app.add_option("--gravity-axis", a.gravity, "Axis of both worlds that points up or down, for --align yaw")
      ->check(CLI::IsMember({"x", "y", "z"}))
      ->capture_default_str();
  app.add_option("--association", a.association,
                 "Pairs of the ATE: tum (greedy one-to-one, < 0.02 s) or evo (nearest neighbour, <= 0.01 s)")
      ->check(CLI::IsMember({"tum", "evo"}))
      ->capture_default_str();
  app.add_option("--max-difference", a.max_difference, "Largest timestamp difference of an ATE pair [s]; 0 = 0.02 (tum), 0.01 (evo)")
      ->check(track::number_in(0, 1e9))
      ->capture_default_str();
  app.add_option("--offset", a.offset, "Added to the timestamps of the estimates [s]")
      ->check(track::number_in(-1e12, 1e12))
      ->capture_default_str();
  app.add_option("--delta", a.delta, "Interval of the RPE: a number with unit s, f (frames), m, rad or deg [1s; 1f without stamps]");
  app.add_option("--rpe", a.form, "Definition of the RPE: tum (evaluate_rpe.py) or paper (as published; evo agrees)")
      ->check(CLI::IsMember({"tum", "paper"}))
      ->capture_default_str();
  app.add_option("--names", a.names, "Names of the estimates in tables and pictures: A,B,C")->delimiter(',')->allow_extra_args(false);
  app.add_option("--baseline", a.baseline, "Name of the estimate that improvements refer to [the first]");
  auto* table = app.add_option("--table", a.table, "text, markdown, latex or csv")
                    ->check(CLI::IsMember({"text", "markdown", "latex", "csv"}))
                    ->capture_default_str();
  app.add_option("--digits", a.digits, "Decimals of the errors in tables")->check(CLI::Range(1, 12))->capture_default_str();
  app.add_flag("--json", a.json, "Print JSON instead of a table")->excludes(table);
  app.add_option("--plot", a.plot, "Picture of trajectories and errors: a file .png, .svg or .pdf")->check(track::not_empty());
  return track::run_main("apso_eval", app, argc, argv, [&] {
    std::vector<track::Input> inputs{{"the ground truth", a.groundtruth}, {"the times", a.times}};
    for (const std::string& f : a.estimates) inputs.push_back({"an estimate", f});
    if (!a.plot.empty()) eval::check_picture(a.plot, inputs);
    const Evaluation e = evaluate(a);
    for (const std::string& w : e.warnings) std::fprintf(stderr, "apso_eval: warning: %s\n", w.c_str());
    if (!a.plot.empty()) eval::plot_errors(a.plot, e.truth, e.all, e.rules);
    print(e, a);
    return 0;
  });
}
