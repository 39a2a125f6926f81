// Absolute and relative error of an estimated trajectory, as table or JSON.
//   apso_eval groundtruth.txt estimate.txt --association evo --delta 1f --json
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <apso/evaluation/ate.hpp>
#include <apso/evaluation/rpe.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/version.hpp>

#include "track/command_line.hpp"
#include "track/stamps.hpp"

namespace {

/// Parses "1s", "0.5s", "5f", "2m", "10deg", "0.1rad".
void parse_delta(const std::string& text, apso::RpeOptions& options) {
  const std::string expected =
      "--delta '" + text + "': expected a positive number and a unit, e.g. 1s, 0.5s, 1f, 2m, 10deg, 1rad";
  const std::size_t end = text.find_first_not_of("0123456789.");
  if (end == std::string::npos || end == 0) throw std::invalid_argument(expected);
  std::size_t used = 0;
  try {
    options.delta = std::stod(text.substr(0, end), &used);
  } catch (const std::logic_error&) {
    throw std::invalid_argument(expected);
  }
  const auto names = enum_names(apso::DeltaUnit{});
  const auto unit = std::find(names.begin(), names.end(), text.substr(end));
  if (used != end || unit == names.end()) throw std::invalid_argument(expected);
  options.unit = static_cast<apso::DeltaUnit>(unit - names.begin());
  if (!(options.delta >= 1e-9 && options.delta <= 1e9)) throw std::invalid_argument(expected);
  if (options.unit == apso::DeltaUnit::Frames && options.delta != std::floor(options.delta)) {
    throw std::invalid_argument("--delta '" + text + "': expected a whole number of frames");
  }
}

nlohmann::ordered_json to_json(const apso::Statistics& s) {
  nlohmann::ordered_json j;
  const auto value = [&](double v) {
    return s.count > 0 ? nlohmann::ordered_json(v) : nlohmann::ordered_json(nullptr);
  };
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
  std::printf("%-22s %7zu %10.6f %10.6f %10.6f %10.6f %10.6f %10.6f\n", name, s.count, s.rmse, s.mean, s.median, s.std,
              s.min, s.max);
}

struct Arguments {
  std::string groundtruth;
  std::string estimate;
  std::string delta = "1s";
  std::string align = "se3";
  std::string association = "tum";
  std::string form = "tum";
  double max_difference = 0;
  double offset = 0;
  bool json = false;
};

struct Evaluation {
  apso::AteResult ate;
  apso::RpeResult rpe;
  std::vector<std::string> warnings;
};

/// Throws when the ATE cannot be computed.
Evaluation evaluate(const Arguments& a) {
  apso::AteOptions ate_options;
  ate_options.alignment = a.align == "se3" ? apso::TrajectoryAlignment::Se3 : apso::TrajectoryAlignment::None;
  ate_options.association = a.association == "tum" ? apso::AssociationRule::Tum : apso::AssociationRule::Evo;
  ate_options.max_difference = a.max_difference;
  ate_options.time_offset = a.offset;
  apso::RpeOptions rpe_options;
  rpe_options.form = a.form == "tum" ? apso::RpeForm::TumScript : apso::RpeForm::Paper;
  rpe_options.time_offset = a.offset;
  parse_delta(a.delta, rpe_options);

  Evaluation e;
  const apso::Trajectory groundtruth = apso::read_trajectory(a.groundtruth, &e.warnings);
  const apso::Trajectory estimate = apso::read_trajectory(a.estimate, &e.warnings);
  track::expect_seconds(groundtruth, a.groundtruth);
  track::expect_seconds(estimate, a.estimate);
  e.ate = apso::ate(groundtruth, estimate, ate_options);
  if (!apso::succeeded(e.ate.status)) {
    const double limit = a.max_difference > 0 ? a.max_difference : apso::default_max_difference(ate_options.association);
    throw std::runtime_error(track::too_few_pairs(e.ate.pairs.size(), limit, a.align == "se3" ? 3 : 1, groundtruth, estimate));
  }
  if (!std::isfinite(e.ate.statistics.rmse)) throw std::runtime_error("the error is not finite: positions are too far away");
  if (e.ate.status == apso::Status::Degenerate) {
    e.warnings.emplace_back("the positions lie on a line or in one point: the rotation of the alignment is not unique");
  }
  e.rpe = apso::rpe(groundtruth, estimate, rpe_options);
  if (!apso::succeeded(e.rpe.status)) e.warnings.push_back("no pair of poses is " + a.delta + " apart: no relative error");
  return e;
}

void print(const Evaluation& e, const Arguments& a) {
  if (a.json) {
    nlohmann::ordered_json out;
    out["pairs"] = e.ate.pairs.size();
    out["ate"] = to_json(e.ate.statistics);
    out["rpe"]["delta"] = a.delta;
    out["rpe"]["pairs"] = e.rpe.pairs.size();
    out["rpe"]["translation"] = to_json(e.rpe.translation);
    out["rpe"]["rotation_deg"] = to_json(e.rpe.rotation_deg);
    std::printf("%s\n", out.dump(2).c_str());
    return;
  }
  std::printf("%-22s %7s %10s %10s %10s %10s %10s %10s\n", "", "pairs", "rmse", "mean", "median", "std", "min", "max");
  print_row("ATE [m]", e.ate.statistics);
  print_row(("RPE " + a.delta + " [m]").c_str(), e.rpe.translation);
  print_row(("RPE " + a.delta + " [deg]").c_str(), e.rpe.rotation_deg);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Errors of an estimated camera trajectory against ground truth.\n"
      "Both files hold lines 'timestamp tx ty tz qx qy qz qw' (TUM RGB-D format, seconds and metres).\n"
      "ATE: distance of the positions after one rigid alignment (never a scale).\n"
      "RPE: error of the motion over --delta, pairs as in evaluate_rpe.py --fixed_delta.");
  app.footer(
      "Examples:\n"
      "  apso_eval groundtruth.txt estimate.txt\n"
      "  apso_eval groundtruth.txt estimate.txt --association evo --delta 1f --json\n"
      "Exit code: 0 the ATE could be computed, 1 it could not, 2 wrong usage.");
  app.set_version_flag("--version", APSO_VERSION);
  Arguments a;
  app.add_option("groundtruth", a.groundtruth, "Ground-truth trajectory")->required();
  app.add_option("estimate", a.estimate, "Estimated trajectory")->required();
  app.add_option("--align", a.align, "Align the estimate to the ground truth: se3 (rigid, least squares) or none")
      ->check(CLI::IsMember({"se3", "none"}))
      ->capture_default_str();
  app.add_option("--association", a.association,
                 "Pairs of the ATE: tum (greedy one-to-one, < 0.02 s) or evo (nearest neighbour, <= 0.01 s)")
      ->check(CLI::IsMember({"tum", "evo"}))
      ->capture_default_str();
  app.add_option("--max-difference", a.max_difference,
                 "Largest timestamp difference of an ATE pair [s]; 0 = 0.02 (tum), 0.01 (evo)")
      ->check(track::number_in(0, 1e9))
      ->capture_default_str();
  app.add_option("--offset", a.offset, "Added to the timestamps of the estimate [s]")
      ->check(track::number_in(-1e12, 1e12))
      ->capture_default_str();
  app.add_option("--delta", a.delta, "Interval of the RPE: a number with unit s, f (frames), m, rad or deg")
      ->capture_default_str();
  app.add_option("--rpe", a.form, "Definition of the RPE: tum (evaluate_rpe.py) or paper (as published; evo agrees)")
      ->check(CLI::IsMember({"tum", "paper"}))
      ->capture_default_str();
  app.add_flag("--json", a.json, "Print JSON instead of a table");
  return track::run_main("apso_eval", app, argc, argv, [&] {
    const Evaluation e = evaluate(a);
    for (const std::string& w : e.warnings) std::fprintf(stderr, "apso_eval: warning: %s\n", w.c_str());
    print(e, a);
    return 0;
  });
}
