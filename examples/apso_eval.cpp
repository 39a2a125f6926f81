// Absolute and relative error of an estimated trajectory, as table or JSON.
//   apso_eval groundtruth.txt estimate.txt --association evo --delta 1f --json
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <apso/evaluation/ate.hpp>
#include <apso/evaluation/rpe.hpp>
#include <apso/io/tum_text.hpp>

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
      "Exit status: 0 if the ATE could be computed, nonzero otherwise.");
  std::string groundtruth_path;
  std::string estimate_path;
  std::string delta = "1s";
  bool json = false;
  apso::AteOptions ate_options;
  apso::RpeOptions rpe_options;
  std::string align = "se3";
  std::string association = "tum";
  std::string form = "tum";
  app.add_option("groundtruth", groundtruth_path, "Ground-truth trajectory")->required();
  app.add_option("estimate", estimate_path, "Estimated trajectory")->required();
  app.add_option("--align", align, "Align the estimate to the ground truth: se3 (rigid, least squares) or none")
      ->check(CLI::IsMember({"se3", "none"}))
      ->capture_default_str();
  app.add_option("--association", association,
                 "Pairs of the ATE: tum (greedy one-to-one, < 0.02 s) or evo (nearest neighbour, <= 0.01 s)")
      ->check(CLI::IsMember({"tum", "evo"}))
      ->capture_default_str();
  app.add_option("--max-difference", ate_options.max_difference,
                 "Largest timestamp difference of an ATE pair [s]; 0 = 0.02 (tum), 0.01 (evo)")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  app.add_option("--offset", ate_options.time_offset, "Added to the timestamps of the estimate [s]")
      ->check(CLI::Range(-1e12, 1e12))
      ->capture_default_str();
  app.add_option("--delta", delta, "Interval of the RPE: a number with unit s, f (frames), m, rad or deg")
      ->capture_default_str();
  app.add_option("--rpe", form, "Definition of the RPE: tum (evaluate_rpe.py) or paper (as published; evo agrees)")
      ->check(CLI::IsMember({"tum", "paper"}))
      ->capture_default_str();
  app.add_flag("--json", json, "Print JSON instead of a table");
  CLI11_PARSE(app, argc, argv);

  try {
    ate_options.alignment = align == "se3" ? apso::TrajectoryAlignment::Se3 : apso::TrajectoryAlignment::None;
    ate_options.association = association == "tum" ? apso::AssociationRule::Tum : apso::AssociationRule::Evo;
    rpe_options.form = form == "tum" ? apso::RpeForm::TumScript : apso::RpeForm::Paper;
    rpe_options.time_offset = ate_options.time_offset;
    parse_delta(delta, rpe_options);

    std::vector<std::string> warnings;
    const apso::Trajectory groundtruth = apso::read_trajectory(groundtruth_path, &warnings);
    const apso::Trajectory estimate = apso::read_trajectory(estimate_path, &warnings);

    const apso::AteResult ate = apso::ate(groundtruth, estimate, ate_options);
    if (!apso::succeeded(ate.status)) {
      const double limit = ate_options.max_difference > 0 ? ate_options.max_difference
                                                          : apso::default_max_difference(ate_options.association);
      char text[400];
      std::snprintf(text, sizeof text,
                    "%zu pair(s) of poses within %g s, need %d: the ground truth covers %.3f .. %.3f s, the estimate "
                    "%.3f .. %.3f s",
                    ate.pairs.size(), limit, align == "se3" ? 3 : 1, groundtruth.front().timestamp,
                    groundtruth.back().timestamp, estimate.front().timestamp, estimate.back().timestamp);
      throw std::runtime_error(text);
    }
    if (ate.status == apso::Status::Degenerate) {
      warnings.push_back("the positions lie on a line or in one point: the rotation of the alignment is not unique");
    }
    const apso::RpeResult rpe = apso::rpe(groundtruth, estimate, rpe_options);
    if (!apso::succeeded(rpe.status)) warnings.push_back("no pair of poses is " + delta + " apart: no relative error");

    for (const std::string& w : warnings) std::fprintf(stderr, "apso_eval: warning: %s\n", w.c_str());
    if (json) {
      nlohmann::ordered_json out;
      out["pairs"] = ate.pairs.size();
      out["ate"] = to_json(ate.statistics);
      out["rpe"]["delta"] = delta;
      out["rpe"]["pairs"] = rpe.pairs.size();
      out["rpe"]["translation"] = to_json(rpe.translation);
      out["rpe"]["rotation_deg"] = to_json(rpe.rotation_deg);
      std::printf("%s\n", out.dump(2).c_str());
    } else {
      std::printf("%-22s %7s %10s %10s %10s %10s %10s %10s\n", "", "pairs", "rmse", "mean", "median", "std", "min",
                  "max");
      print_row("ATE [m]", ate.statistics);
      print_row(("RPE " + delta + " [m]").c_str(), rpe.translation);
      print_row(("RPE " + delta + " [deg]").c_str(), rpe.rotation_deg);
    }
  } catch (const std::exception& e) {
    std::fprintf(stderr, "apso_eval: error: %s\n", e.what());
    return 1;
  }
  return 0;
}
