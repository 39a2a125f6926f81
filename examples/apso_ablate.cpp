// apso_ablate: what is each part of the method worth? Runs apso_track on a list of sequences with every component,
// weight, scenario and policy switched off or exchanged in turn, and puts the results in one table.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <apso/evaluation/decision_analysis.hpp>
#include <apso/io/parameters.hpp>
#include <apso/opencv/feature_tracker.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/version.hpp>

#include "track/run_folder.hpp"
#include "track/sequence_list.hpp"

namespace {

namespace fs = std::filesystem;
using json = nlohmann::json;

constexpr int exit_bad_input = 1;
constexpr int exit_usage = 2;

/// The options of apso_track.
struct Config {
  apso::PipelineOptions pipeline;
  apso::opencv::FeatureTrackerOptions tracker;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("pipeline", s.pipeline);
    v("tracker", s.tracker);
  }
};

struct Variant {
  const char* name;
  const char* meaning;
  void (*change)(Config&);
};

/// Takes one weight out and gives it to the others in proportion.
template <class Weights>
void drop(Weights& all, double Weights::*one) {
  const double rest = 1 - all.*one;
  Weights::fields(all, [&](const char*, double& w, auto&&...) { w /= rest; });
  all.*one = 0;
}

const auto& variants() {
  using namespace apso;
  constexpr double infinity = std::numeric_limits<double>::infinity();
  static const Variant list[] = {
      {"default", "everything as shipped", [](Config&) {}},
      {"no_refinement", "BAD frames are not repaired", [](Config& c) { c.pipeline.refinement = false; }},
      {"screw_blend", "blend along the screw, one weight for all directions",
       [](Config& c) { c.pipeline.refiner.blend.form = BlendForm::ScrewLinear; }},
      {"one_reference", "alignment to one reference", [](Config& c) { c.pipeline.refiner.memory.references = 1; }},
      {"both_scales", "brightness residuals count in c_dir as well",
       [](Config& c) { c.pipeline.refiner.confidence.intensity_share = 0.5; }},
      {"no_motion", "nothing is masked", [](Config& c) { c.pipeline.motion = false; }},
      {"no_conf", "S_total without S_conf",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         drop(o.frame_weights, &FrameWeights::conf);
       }},
      {"no_spatial", "S_total without S_spatial",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         drop(o.frame_weights, &FrameWeights::spatial);
       }},
      {"no_feature", "S_total without S_feature",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         drop(o.frame_weights, &FrameWeights::feature);
       }},
      {"no_depth", "S_total without S_depth",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         drop(o.frame_weights, &FrameWeights::depth);
       }},
      {"no_mc", "S_change without S_mc",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         drop(o.change_weights, &ChangeWeights::motion);
       }},
      {"no_dc", "S_change without S_dc",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         drop(o.change_weights, &ChangeWeights::depth);
       }},
      {"no_dec", "S_change without S_dec",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         drop(o.change_weights, &ChangeWeights::detection);
       }},
      {"no_change", "S_final = S_total",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.decision.w_base = 1, o.decision.a = 0, o.decision.w_dyn = 1;
       }},
      {"no_sharpness", "S_feature from keypoints alone",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.sharpness.enabled = false;
       }},
      {"no_dynamic_ratio", "W_base does not fall with what moves",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.decision.a = 0;
       }},
      {"no_static_boost", "static scenario off",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.decision.boost_static = 0;
       }},
      {"no_dynamic_scenario", "dynamic scenario off",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.decision.th_dynamic = 1;
       }},
      {"no_object_boost", "scenario of confident objects off",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.decision.boost_object = 0;
       }},
      {"no_hand_over", "a reference is not handed on",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.benchmark.hand_over = false;
       }},
      {"ratchet", "benchmark update as printed",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.benchmark.hand_over = false;
         o.benchmark.half_life = o.benchmark.max_age = infinity;
       }},
      {"literal_polarity", "S_change raises S_final, as printed",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.decision.polarity = ChangePolarity::Literal;
       }},
      {"cumulative_base", "W_base falls from frame to frame, as printed",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.decision.base_weight = BaseWeight::Cumulative;
       }},
      {"literal_thresholds", "th_s by the printed recursion",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.initialisation.quality_threshold = QualityThreshold::Literal;
       }},
      {"first_passing", "the first frame that passes is the reference",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.initialisation.initial_frame = InitialFrame::FirstPassing;
       }},
      {"paper", "all of the printed forms together",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.decision.polarity = ChangePolarity::Literal;
         o.decision.base_weight = BaseWeight::Cumulative;
         o.initialisation.quality_threshold = QualityThreshold::Literal;
         o.benchmark.hand_over = false;
         o.benchmark.half_life = o.benchmark.max_age = infinity;
         o.sharpness.enabled = false;
       }},
      {"previous_baseline", "change against the frame before",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.change_baseline = ChangeBaseline::Previous;
       }},
      {"residual_flow", "S_mc without the camera's own motion",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.motion_change.flow = FlowKind::Residual;
       }},
      {"gated_feature", "S_feature in the gated form",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.feature.form = FeatureForm::Gated;
       }},
      {"linear_feature", "S_feature in the linear form",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.feature.form = FeatureForm::Linear;
       }},
      {"half_saturation", "responses against a constant",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.feature.response = ResponseScale::HalfSaturation;
       }},
      {"covering", "uniformity by square covering",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.feature.uniformity = Uniformity::Covering;
       }},
      {"observability", "S_spatial: how well objects are seen",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.spatial.form = SpatialForm::ObjectObservability;
       }},
      {"ratio_features", "dynamic ratio of keypoints",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.dynamic_ratio = DynamicRatio::Features;
       }},
      {"ratio_count", "dynamic ratio of objects",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.dynamic_ratio = DynamicRatio::Count;
       }},
      {"hysteresis", "th_differ 0.03 higher once BAD",
       [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.decision.hysteresis = 0.03;
       }},
      {"auto_threshold", "th_differ follows the GOOD frames", [](Config& c) {
         AssessorOptions& o = c.pipeline.assessor;
         o.decision.auto_calibrate = true;
       }}};
  return list;
}

struct Arguments {
  std::vector<std::string> sequences;
  std::vector<std::string> only;
  std::string output;
  std::string config;
  std::string plan;
  int repeats = 1;
  int jobs = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  bool table_only = false;
};

struct PlannedRun {
  std::size_t variant;
  track::Job job;
};

/// Every variant on every sequence; a synthetic one as often as asked for, with seeds that follow each other.
std::vector<PlannedRun> plan(const Arguments& a, const std::vector<const Variant*>& chosen) {
  fs::create_directories(fs::path(a.output) / "configs");
  std::vector<PlannedRun> runs;
  for (std::size_t v = 0; v < chosen.size(); ++v) {
    Config config;
    if (!a.config.empty()) apso::read_parameters(a.config, config);
    chosen[v]->change(config);
    apso::validate(config, chosen[v]->name);
    const fs::path file = fs::path(a.output) / "configs" / (std::string(chosen[v]->name) + ".yaml");
    const std::string text = apso::write_parameters(config) + "\n";
    std::string old;
    if (std::ifstream in(file.string()); in) old.assign(std::istreambuf_iterator<char>(in), {});
    if (old != text) {
      if (!old.empty()) {
        throw apso::io_error(file.string() + ": the runs in " + a.output +
                             " were made with other settings; take another --output");
      }
      std::ofstream(file.string()) << text;
    }
    for (const std::string& sequence : a.sequences) {
      const track::SequenceSpec s = track::parse_sequence(sequence);
      const bool synthetic = s.arguments[0].rfind("synthetic:", 0) == 0;
      for (int r = 0; r < (synthetic ? a.repeats : 1); ++r) {
        PlannedRun run{v, {}};
        run.job.arguments = s.arguments;
        std::string name = s.name;
        if (synthetic && a.repeats > 1) {
          const auto seed = std::find(run.job.arguments.begin(), run.job.arguments.end(), "--seed");
          const int first = seed == run.job.arguments.end() ? 1 : std::stoi(*(seed + 1));
          if (seed != run.job.arguments.end()) run.job.arguments.erase(seed, seed + 2);
          run.job.arguments.insert(run.job.arguments.end(), {"--seed", std::to_string(first + r)});
          name += "_r" + std::to_string(r);
        }
        run.job.arguments.insert(run.job.arguments.end(), {"--config", file.string()});
        run.job.folder = fs::path(a.output) / chosen[v]->name / name;
        runs.push_back(std::move(run));
      }
    }
  }
  return runs;
}

struct Spread {
  std::vector<double> values;
  void add(double v) {
    if (std::isfinite(v)) values.push_back(v);
  }
  [[nodiscard]] double mean() const {
    if (values.empty()) return track::kNone;
    double s = 0;
    for (const double v : values) s += v;
    return s / static_cast<double>(values.size());
  }
  /// Standard error of the mean.
  [[nodiscard]] double error() const {
    if (values.size() < 2) return track::kNone;
    double s = 0;
    for (const double v : values) s += (v - mean()) * (v - mean());
    const double n = static_cast<double>(values.size());
    return std::sqrt(s / (n - 1) / n);
  }
};

json entry(const Spread& s) {
  if (s.values.empty()) return nullptr;
  return {{"mean", s.mean()},
          {"standard_error", s.values.size() > 1 ? json(s.error()) : json(nullptr)},
          {"runs", s.values.size()}};
}
std::string shown(double v, double factor, const char* format) {
  if (!std::isfinite(v)) return "-";
  char text[32];
  std::snprintf(text, sizeof text, format, factor * v);
  return text;
}

void table(const Arguments& a, const std::vector<const Variant*>& chosen, const std::vector<PlannedRun>& runs) {
  json rows = json::array();
  std::ofstream csv((fs::path(a.output) / "ablation.csv").string());
  csv << "variant,runs,missing,ate_m,ate_features_m,rpe_1s_m,rpe_1f_m,auc_failure,bad_share,flagged_inside,flagged_"
         "outside\n";
  std::printf("%-20s %5s %9s %9s %9s %7s %7s %8s %8s  %s\n", "variant", "runs", "ATE [mm]", "RPE 1 s", "RPE 1 f", "AUC",
              "BAD", "inside", "outside", "");
  for (std::size_t v = 0; v < chosen.size(); ++v) {
    Spread ate, ate_features, rpe_1s, rpe_1f, auc, bad, inside, outside;
    int missing = 0;
    int count = 0;
    for (const PlannedRun& run : runs) {
      if (run.variant != v) continue;
      if (!track::complete(run.job.folder)) {
        ++missing;
        continue;
      }
      ++count;
      const json summary = json::parse(std::ifstream((run.job.folder / "summary.json").string()));
      const auto value = [&](const char* path) {
        const json::json_pointer p(path);
        return summary.contains(p) && summary[p].is_number() ? summary[p].get<double>() : track::kNone;
      };
      ate.add(value("/final/ate/rmse"));
      ate_features.add(value("/features/ate/rmse"));
      rpe_1s.add(value("/final/rpe_1s/translation/rmse"));
      rpe_1f.add(value("/final/rpe_1f/translation/rmse"));
      const track::Run r = track::read_run(run.job.folder.string());
      std::vector<apso::ScoredEvent> events;
      apso::Confusion label;
      double flagged = 0;
      double decided = 0;
      for (const track::RunFrame& f : r.frames) {
        if (!f.decided()) continue;
        decided += 1;
        flagged += f.flagged();
        label.add(f.flagged(), !f.label.empty());
        events.push_back({1 - r.at(f, "S_final"), f.failed});
      }
      auc.add(apso::area_under_roc(events));
      bad.add(flagged / decided);
      inside.add(label.recall());
      outside.add(label.false_alarm_rate());
    }
    std::printf("%-20s %5d %9s %9s %9s %7s %7s %8s %8s  %s%s\n", chosen[v]->name, count,
                shown(ate.mean(), 1e3, "%.2f").c_str(), shown(rpe_1s.mean(), 1e3, "%.2f").c_str(),
                shown(rpe_1f.mean(), 1e3, "%.2f").c_str(), shown(auc.mean(), 1, "%.3f").c_str(),
                shown(bad.mean(), 100, "%.1f %%").c_str(), shown(inside.mean(), 100, "%.0f %%").c_str(),
                shown(outside.mean(), 100, "%.1f %%").c_str(), chosen[v]->meaning,
                missing > 0 ? (" (" + std::to_string(missing) + " runs missing)").c_str() : "");
    csv << chosen[v]->name << ',' << count << ',' << missing;
    for (const Spread* s : {&ate, &ate_features, &rpe_1s, &rpe_1f, &auc, &bad, &inside, &outside}) {
      csv << ',';
      if (std::isfinite(s->mean())) csv << s->mean();
    }
    csv << '\n';
    rows.push_back({{"variant", chosen[v]->name},
                    {"meaning", chosen[v]->meaning},
                    {"runs", count},
                    {"missing", missing},
                    {"ate_m", entry(ate)},
                    {"ate_features_m", entry(ate_features)},
                    {"rpe_1s_m", entry(rpe_1s)},
                    {"rpe_1f_m", entry(rpe_1f)},
                    {"auc_failure", entry(auc)},
                    {"bad_share", entry(bad)},
                    {"flagged_inside", entry(inside)},
                    {"flagged_outside", entry(outside)}});
  }
  std::ofstream((fs::path(a.output) / "ablation.json").string())
      << json{{"version", APSO_VERSION}, {"sequences", a.sequences}, {"repeats", a.repeats}, {"variants", rows}}.dump(2)
      << '\n';
}

int run(const Arguments& a) {
  std::vector<const Variant*> chosen;
  for (const Variant& v : variants()) {
    if (a.only.empty() || std::find(a.only.begin(), a.only.end(), v.name) != a.only.end()) chosen.push_back(&v);
  }
  const std::vector<PlannedRun> runs = plan(a, chosen);
  if (!a.plan.empty()) {
    json list = json::array();
    for (const PlannedRun& r : runs)
      list.push_back({{"folder", r.job.folder.string()}, {"arguments", r.job.arguments}});
    std::ofstream file(a.plan);
    file << list.dump(2) << '\n';
    if (!file) throw apso::io_error(a.plan + ": cannot write");
    return 0;
  }
  std::vector<std::string> problems;
  if (!a.table_only) {
    std::vector<track::Job> jobs;
    for (const PlannedRun& r : runs) jobs.push_back(r.job);
    problems = track::run_jobs(jobs, a.jobs, "run");
  }
  table(a, chosen, runs);
  for (const std::string& p : problems) std::fprintf(stderr, "apso_ablate: %s\n", p.c_str());
  return problems.empty() ? 0 : exit_bad_input;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app{
      "Switches every part of the assessment off in turn, on a list of sequences. A sequence is written "
      "NAME,option=value,...\n"
      "with the options of apso_track, e.g. 'recording,camera=bonn' or 'synthetic:stress_all,max-frames=540,seed=1'. "
      "What is done\n"
      "is not done again: stop it and start it anew as you like. Exit code: 0 done, 1 bad input or a run failed, 2 "
      "wrong usage."};
  app.set_version_flag("--version", APSO_VERSION);
  std::vector<std::string> names;
  for (const Variant& v : variants()) names.push_back(v.name);
  app.add_option("SEQUENCE", a.sequences, "sequences to run on")->required();
  app.add_option("--output", a.output, "folder for the runs, ablation.json and ablation.csv")->required();
  app.add_option("--only", a.only, "only these variants")->check(CLI::IsMember(names))->delimiter(',');
  app.add_option("--repeats", a.repeats, "runs of each synthetic sequence, with seeds that follow each other")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--jobs", a.jobs, "runs at the same time")->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--config", a.config, "settings that all variants start from");
  app.add_option("--plan", a.plan, "write the list of runs to this file (JSON) instead of running them, for a cluster");
  app.add_flag("--table", a.table_only, "run nothing, only make the table of what is done");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : exit_usage;
  }
  try {
    return run(a);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "apso_ablate: %s\n", e.what());
    return exit_bad_input;
  }
}
