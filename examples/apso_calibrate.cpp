// apso_calibrate: fits the constants of the scene assessment to recordings of your camera, and writes a file for
// `apso_track --config`.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include <apso/io/parameters.hpp>
#include <apso/quality/calibration.hpp>
#include <apso/version.hpp>

#include "track/config.hpp"
#include "track/run_folder.hpp"
#include "track/sequence_list.hpp"

namespace {

namespace fs = std::filesystem;

constexpr int exit_bad_input = 1;
constexpr int exit_usage = 2;

struct Arguments {
  std::vector<std::string> calm;
  std::vector<std::string> hard;
  std::string output;
  std::string work;
  std::string config;
  bool fit_weights = false;
  bool keep_scales = false;
  int jobs = 1;
};

/// Makes the runs that are not there yet and reads them. A folder with frames.csv is a run already.
std::vector<track::Run> runs_of(const std::vector<std::string>& sequences, const Arguments& a) {
  std::vector<track::Job> jobs;
  std::vector<std::string> folders;
  for (const std::string& text : sequences) {
    const std::string folder = text.substr(0, text.find('='));
    if (fs::exists(fs::path(folder) / "frames.csv")) {
      folders.push_back(text);
      continue;
    }
    const track::SequenceSpec s = track::parse_sequence(text);
    track::Job job{fs::path(a.work) / s.name, s.arguments};
    job.arguments.emplace_back("--no-refinement");
    if (!a.config.empty()) job.arguments.insert(job.arguments.end(), {"--config", a.config});
    folders.push_back(job.folder.string());
    jobs.push_back(std::move(job));
  }
  const std::vector<std::string> problems = track::run_jobs(jobs, a.jobs, "run");
  if (!problems.empty()) throw apso::io_error(problems.front());
  std::vector<track::Run> runs;
  for (const std::string& f : folders) {
    const auto eq = f.find('=');
    runs.push_back(track::read_run(f.substr(0, eq), eq == std::string::npos ? "" : f.substr(eq + 1)));
  }
  return runs;
}

template <class Score>
std::optional<Score> maybe(double v) {
  return std::isfinite(v) ? std::optional<Score>(Score(v)) : std::nullopt;
}

void append_samples(const std::vector<track::Run>& runs, bool by_error, std::vector<apso::CalibrationSample>& out) {
  for (const track::Run& run : runs) {
    for (const track::RunFrame& f : run.frames) {
      if (!f.decided()) continue;
      const auto at = [&](const char* c) { return run.at(f, c); };
      apso::CalibrationSample s;
      s.S_conf = maybe<apso::Quality>(at("S_conf"));
      s.S_spatial = maybe<apso::Quality>(at("S_spatial"));
      s.S_feature = maybe<apso::Quality>(at("S_feature"));
      s.S_depth = maybe<apso::Quality>(at("S_depth"));
      s.S_mc = maybe<apso::Deviation>(at("S_mc"));
      s.S_dc = maybe<apso::Deviation>(at("S_dc"));
      s.S_dec = maybe<apso::Deviation>(at("S_dec"));
      s.dynamic_ratio = at("dynamic_ratio");
      s.flow = at("flow");
      s.track_overlap = at("track_overlap");
      s.step_flow = at("step_flow");
      s.depth_mean = at("depth_mean");
      s.depth_spread = at("depth_spread");
      s.depth_overlap = at("depth_overlap");
      s.hard = by_error && (f.failed || !f.label.empty());
      out.push_back(s);
    }
  }
}

/// Recomputes the change scores from the recorded measurements.
void rescale(std::vector<apso::CalibrationSample>& samples, const apso::AssessorOptions& o) {
  for (apso::CalibrationSample& s : samples) {
    if (s.S_mc && std::isfinite(s.flow))
      s.S_mc = apso::motion_deviation(s.flow, s.flow, s.track_overlap, o.motion_change.scale);
    if (s.S_dc && std::isfinite(s.depth_mean)) {
      s.S_dc = apso::depth_deviation(s.depth_mean, s.depth_spread, s.depth_overlap, o.depth_change);
    }
  }
}

std::vector<double> final_scores(const std::vector<apso::CalibrationSample>& samples, const apso::AssessorOptions& o,
                                 bool hard) {
  apso::SceneDecision decision(o.decision);
  std::vector<double> scores;
  for (const apso::CalibrationSample& s : samples) {
    const double v = apso::rescore(s, o.frame_weights, o.change_weights, decision).value();
    if (s.hard == hard) scores.push_back(v);
  }
  return scores;
}

double share_below(const std::vector<double>& v, double limit) {
  if (v.empty()) return track::kNone;
  return static_cast<double>(std::count_if(v.begin(), v.end(), [&](double x) { return x < limit; })) /
         static_cast<double>(v.size());
}

void write_config(const std::string& file, const Arguments& a, const track::Config& config) {
  std::ofstream out(file);
  out << "# Found by apso_calibrate " << APSO_VERSION << " on:\n";
  for (const std::string& s : a.calm) out << "#   calm " << s << '\n';
  for (const std::string& s : a.hard) out << "#   hard " << s << '\n';
  out << apso::write_parameters(config) << '\n';
  out.flush();
  if (!out) throw apso::io_error(file + ": cannot write");
}

int run(const Arguments& a) {
  track::Config config;
  if (!a.config.empty()) apso::read_parameters(a.config, config);
  apso::AssessorOptions& o = config.pipeline.assessor;
  const auto calm_runs = runs_of(a.calm, a);
  const auto hard_runs = runs_of(a.hard, a);
  std::vector<apso::CalibrationSample> calm;
  append_samples(calm_runs, false, calm);
  std::vector<apso::CalibrationSample> all = calm;
  append_samples(hard_runs, true, all);
  if (calm.empty())
    throw apso::io_error("no frame with a decision in the calm sequences; they must be longer than the initialisation");

  const auto tell = [](const char* what, double before, double after) {
    std::printf("%-36s %8.4f -> %8.4f\n", what, before, after);
  };
  if (!a.keep_scales) {
    const apso::CalibratedScales s = apso::calibrate_scales(calm);
    const auto adopt = [&](const char* what, double& to, double found) {
      if (!(found > 0)) return;
      const double rounded = std::max(1e-4, std::round(found * 1e4) / 1e4);
      tell(what, to, rounded);
      to = rounded;
    };
    adopt("motion_change.scale", o.motion_change.scale, s.motion);
    adopt("motion_change.scale_previous", o.motion_change.scale_previous, s.motion_previous);
    adopt("depth_change.scale_mean", o.depth_change.scale_mean, s.depth_mean);
    adopt("depth_change.scale_spread", o.depth_change.scale_spread, s.depth_spread);
  }
  rescale(calm, o);
  rescale(all, o);
  const auto threshold = [&] { return std::round(apso::calibrate_threshold(final_scores(all, o, false)) * 1e3) / 1e3; };
  const double th_before = o.decision.th_differ;
  if (a.fit_weights) {
    o.decision.th_differ = threshold();  // the weights are to tell frames apart at the threshold they will meet
    const apso::FittedWeights w = apso::fit_weights(all, o.frame_weights, o.change_weights, o.decision);
    tell("frame_weights.conf", o.frame_weights.conf, w.frame.conf);
    tell("frame_weights.spatial", o.frame_weights.spatial, w.frame.spatial);
    tell("frame_weights.feature", o.frame_weights.feature, w.frame.feature);
    tell("frame_weights.depth", o.frame_weights.depth, w.frame.depth);
    tell("change_weights.motion", o.change_weights.motion, w.change.motion);
    tell("change_weights.depth", o.change_weights.depth, w.change.depth);
    tell("change_weights.detection", o.change_weights.detection, w.change.detection);
    tell("loss", w.loss_before, w.loss);
    o.frame_weights = w.frame;
    o.change_weights = w.change;
  }
  const double th = threshold();
  tell("decision.th_differ", th_before, th);
  o.decision.th_differ = th;
  std::printf("below th_differ: %.3f of %zu calm frames, %.3f of %zu others that are not hard",
              share_below(final_scores(calm, o, false), th), calm.size(), share_below(final_scores(all, o, false), th),
              final_scores(all, o, false).size());
  const auto hard_scores = final_scores(all, o, true);
  if (!hard_scores.empty()) std::printf(", %.3f of %zu hard frames", share_below(hard_scores, th), hard_scores.size());
  std::printf(" (with the references of the runs made)\n");
  write_config(a.output, a, config);
  std::printf("written to %s; use it with apso_track --config\n", a.output.c_str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app{
      "Calibrates the scene assessment. A sequence is written NAME,option=value,... with the options of apso_track, e.g.\n"
      "'recording,camera=tum-fr1,max-frames=300' or 'synthetic:static_xyz,seed=7', or is a result folder of apso_track.\n"
      "Exit code: 0 done, 1 bad input, 2 wrong usage."};
  app.set_version_flag("--version", APSO_VERSION);
  app.add_option("SEQUENCE", a.calm,
                 "calm recordings without people, with typical camera motion: they determine the scales and th_differ")
      ->required();
  app.add_option("--output", a.output, "configuration file to write (YAML)")->required();
  app.add_option("--hard", a.hard, "recordings with ground truth in which tracking fails at times, for --fit-weights");
  app.add_flag("--fit-weights", a.fit_weights, "fit the weights of the scores to predict failure");
  app.add_flag("--keep-scales", a.keep_scales, "do not change the scales of the change scores");
  app.add_option("--config", a.config, "configuration to start from");
  app.add_option("--work", a.work,
                 "folder for the runs (default: OUTPUT.runs); finished runs in it are reused");
  app.add_option("--jobs", a.jobs, "number of parallel runs")->check(CLI::Range(1, 256))->capture_default_str();
  try {
    app.parse(argc, argv);
    if (a.fit_weights && a.hard.empty()) throw CLI::RequiredError("--fit-weights needs --hard");
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : exit_usage;
  }
  if (a.work.empty()) a.work = a.output + ".runs";
  try {
    return run(a);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "apso_calibrate: %s\n", e.what());
    return exit_bad_input;
  }
}
