// apso_calibrate: fits the constants of the scene assessment to recordings of your camera, and writes a file for
// `apso_track --config`.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include <apso/io/parameters.hpp>
#include <apso/quality/calibration.hpp>
#include <apso/version.hpp>

#include "track/command_line.hpp"
#include "track/config.hpp"
#include "track/results.hpp"
#include "track/run_folder.hpp"
#include "track/sequence_list.hpp"

namespace {

namespace fs = std::filesystem;

constexpr const char* first_words = "# Found by apso_calibrate ";

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
    track::Job job{fs::path(a.work) / s.name, s.arguments, {}};
    job.arguments.emplace_back("--no-refinement");
    if (!a.config.empty()) job.arguments.insert(job.arguments.end(), {"--config", a.config});
    folders.push_back(job.folder.string() + (s.camera_truth.empty() ? "" : "=" + s.camera_truth));
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

void append_samples(const std::vector<track::Run>& runs, bool by_error, std::vector<apso::CalibrationSample>& out) {
  for (const track::Run& run : runs) {
    for (const track::RunFrame& f : run.frames) {
      if (!f.decided()) continue;
      const auto at = [&](const std::string& c) { return run.at(f, c); };
      apso::CalibrationSample s;
      apso::read_scores(s.assessment, at);
      s.assessment.dynamic_ratio = at("dynamic_ratio");
      s.hard = by_error && (f.failed || !f.label.empty());
      out.push_back(s);
    }
  }
}

std::vector<double> final_scores(const std::vector<apso::CalibrationSample>& samples, const apso::AssessorOptions& o, bool hard) {
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
  return static_cast<double>(std::count_if(v.begin(), v.end(), [&](double x) { return x < limit; })) / static_cast<double>(v.size());
}

/// Throws io_error when the output is an input, or a file that apso_calibrate did not write.
void check_output(const Arguments& a) {
  std::vector<track::Input> inputs{{"--config", a.config}};
  for (const auto* list : {&a.calm, &a.hard}) {
    for (const std::string& s : *list)
      inputs.push_back({"a recording or a run", track::parse_sequence(s.substr(0, s.find('='))).arguments.front()});
  }
  track::keep_apart(a.output, inputs);
  for (const track::Input& in : inputs) {  // finished runs may well be in the folder of runs
    if (!fs::exists(fs::path(in.path) / "frames.csv")) track::keep_apart(a.work, {in});
  }
  const fs::path folder = fs::absolute(a.output).parent_path();
  if (!fs::is_directory(folder)) throw apso::io_error(a.output + ": cannot write: there is no folder " + folder.string());
  std::string line;
  std::ifstream before(a.output);
  std::getline(before, line);
  if (fs::exists(a.output) && line.rfind(first_words, 0) != 0) {
    throw apso::io_error(a.output + ": is there, and apso_calibrate did not write it; take another name");
  }
}

void write_config(const std::string& file, const Arguments& a, const track::Config& config) {
  std::ostringstream out;
  out << first_words << APSO_VERSION << " on:\n";
  for (const std::string& s : a.calm) out << "#   calm " << s << '\n';
  for (const std::string& s : a.hard) out << "#   hard " << s << '\n';
  out << apso::write_parameters(config) << '\n';
  track::write_file(file, out.str());
}

void tell(const std::string& what, double before, double after) { std::printf("%-36s %8.4f -> %8.4f\n", what.c_str(), before, after); }

/// All numbers among some options, by their names.
class Numbers {
 public:
  explicit Numbers(std::vector<std::pair<std::string, double>>& out, std::string prefix = "") : out_(&out), prefix_(std::move(prefix)) {}
  template <class T, class L, class H>
  void operator()(const char* name, const T& value, L, H) const {
    out_->emplace_back(prefix_ + name, static_cast<double>(value));
  }
  template <class T>
  void operator()(const char* name, const T& value) const {
    if constexpr (apso::is_options_v<T>) T::fields(value, Numbers(*out_, prefix_ + name + '.'));
  }

 private:
  std::vector<std::pair<std::string, double>>* out_;
  std::string prefix_;
};

void tell_changes(const apso::AssessorOptions& before, const apso::AssessorOptions& after) {
  std::vector<std::pair<std::string, double>> b, a;
  apso::AssessorOptions::fields(before, Numbers(b));
  apso::AssessorOptions::fields(after, Numbers(a));
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].second != b[i].second) tell(a[i].first, b[i].second, a[i].second);
  }
}

int run(const Arguments& a) {
  check_output(a);
  track::Config config = track::read_config(a.config);
  apso::AssessorOptions& o = config.pipeline.assessor;
  const auto calm_runs = runs_of(a.calm, a);
  const auto hard_runs = runs_of(a.hard, a);
  std::vector<apso::CalibrationSample> calm;
  append_samples(calm_runs, false, calm);
  std::vector<apso::CalibrationSample> all = calm;
  append_samples(hard_runs, true, all);
  if (calm.empty()) throw apso::io_error("no frame with a decision in the calm sequences; they must be longer than the initialisation");

  if (!a.keep_scales) {
    const apso::AssessorOptions before = o;
    apso::calibrate_scales(calm, o);
    tell_changes(before, o);
  }
  for (apso::CalibrationSample& s : calm) apso::revalue(s, o);
  for (apso::CalibrationSample& s : all) apso::revalue(s, o);
  const auto threshold = [&] { return std::round(apso::calibrate_threshold(final_scores(all, o, false)) * 1e3) / 1e3; };
  const double th_before = o.decision.th_differ;
  if (a.fit_weights) {
    o.decision.th_differ = threshold();  // the weights are to tell frames apart at the threshold they will meet
    const auto w = apso::fit_weights(all, o.frame_weights, o.change_weights, o.decision);
    const apso::AssessorOptions before = o;
    o.frame_weights = w.frame;
    o.change_weights = w.change;
    tell_changes(before, o);
    tell("loss", w.loss_before, w.loss);
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
  app.add_option("SEQUENCE", a.calm, "calm recordings without people, with typical camera motion: they determine the scales and th_differ")
      ->required();
  app.add_option("--output", a.output, "configuration file to write (YAML)")->required()->check(track::not_empty());
  app.add_option("--hard", a.hard, "recordings with ground truth in which tracking fails at times, for --fit-weights");
  app.add_flag("--fit-weights", a.fit_weights, "fit the weights of the scores to predict failure");
  app.add_flag("--keep-scales", a.keep_scales, "do not change the scales of the change scores");
  app.add_option("--config", a.config, "configuration to start from");
  app.add_option("--work", a.work, "folder for the runs (default: OUTPUT.runs); finished runs in it are reused");
  app.add_option("--jobs", a.jobs, "number of parallel runs")->check(CLI::Range(1, 256))->capture_default_str();
  app.callback([&] {
    if (a.fit_weights && a.hard.empty()) throw CLI::RequiredError("--fit-weights needs --hard");
    if (a.work.empty()) a.work = a.output + ".runs";
  });
  return track::run_main("apso_calibrate", app, argc, argv, [&] { return run(a); });
}
