// Does the alignment know when it is wrong? Pairs that can be aligned and pairs that cannot, seen by a sensor whose noise is not
// the one that the alignment expects, and pairs of recordings: how many wrong results are called good, how many right ones are
// refused, and whether the errors are as large as the covariance says.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include <apso/io/camera_yaml.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/opencv/cameras.hpp>
#include <apso/refinement/align.hpp>

#include "planar_scenes.hpp"
#include "recording_pairs.hpp"

namespace {
using pairs::kDegree;
using pairs::Pair;

constexpr double kRightMillimetres = 20, kRightDegrees = 1;  // right = below both
constexpr double kGood = 0.5;                                // c_dir from which a result is called good

struct Preset {
  std::string name;
  apso::PyramidOptions pyramid;
  apso::AlignmentOptions alignment;
};

/// What can be shown without a recording.
struct SyntheticSet {
  std::string name;
  bool planar;             ///< a scenery, else a room
  double moving_share;     ///< of a room
  pairs::Scenery scenery;  ///< where planar
  double missing = 0;      ///< share of the pixels without depth
};
const std::vector<SyntheticSet> kSets{{"rooms", false, 0, {}},
                                      {"bodies", false, 0.16, {}},
                                      {"crowd", false, 0.6, {}},
                                      {"holes", false, 0, {}, 0.6},
                                      {"poster", true, 0, pairs::Scenery::Poster},
                                      {"stripes", true, 0, pairs::Scenery::Stripes},
                                      {"corridor", true, 0, pairs::Scenery::Corridor},
                                      {"wall", true, 0, pairs::Scenery::Wall},
                                      {"checkerboard", true, 0, pairs::Scenery::Checkerboard},
                                      {"facade", true, 0, pairs::Scenery::Facade},
                                      {"notice", true, 0, pairs::Scenery::Notice},
                                      {"curtains", true, 0, pairs::Scenery::Curtains}};

struct Told {
  double c_dir;
  bool right;
};

struct Row {
  int pairs = 0, right = 0, right_refused = 0, wrong_good = 0, good = 0, open = 0, ambiguous = 0;
  std::vector<double> normalised;  // squared error over its variance, mean over six directions, of right results
};

class Judge {
 public:
  explicit Judge(const std::string& csv) {
    if (csv.empty()) return;
    file_.open(csv);
    if (!file_) throw std::runtime_error(csv + ": cannot be written");
    file_ << "set,preset,step,mm,deg,right,c_dir,status,degenerate,ambiguous,valid_share,static_share,correlation,scale_intensity,scale_"
             "depth,"
             "cost,iterations,sigma_mm,sigma_deg,normalised\n";
  }

  /// The true poses err, too, by that much each: it is part of the error that is expected.
  void take(const pairs::TruthNoise& n) { truth_ = n; }

  void operator()(const std::string& set, const Preset& preset, const apso::Pinhole& camera, const Pair& p, Row& row) {
    reference_.build({0.0, p.reference.intensity, p.reference.depth}, camera, {}, preset.pyramid, apso::PyramidRole::Reference);
    current_.build({0.0, p.current.intensity, p.current.depth}, camera, {}, preset.pyramid, apso::PyramidRole::Current);
    apso::DirectAligner aligner(preset.alignment);
    const apso::AlignmentResult a = aligner.align({{&reference_, apso::Pose::Identity(), 1.0}}, current_, {apso::Pose::Identity()});
    const double c = apso::direct_confidence(a).c_dir;
    // the increment (v, w) of T_current_reference from the left
    const apso::Twist e = apso::se3_log(apso::compose(p.T_current_reference, a.T_world_camera));
    const double mm = 1e3 * e.head<3>().norm();
    const double degrees = e.tail<3>().norm() / kDegree;
    const bool right = mm < kRightMillimetres && degrees < kRightDegrees;
    const bool good = apso::succeeded(a.status) && c > kGood;
    const double normalised = squared_over_variance(a, e) / (6 - a.degenerate_count);
    ++row.pairs;
    row.right += right ? 1 : 0;
    row.good += good ? 1 : 0;
    row.wrong_good += good && !right ? 1 : 0;
    row.right_refused += right && !good ? 1 : 0;
    row.open += a.degenerate_count > 0 ? 1 : 0;
    row.ambiguous += a.ambiguous ? 1 : 0;
    told.push_back({c, right});
    if (right && apso::succeeded(a.status)) row.normalised.push_back(normalised);
    if (!file_.is_open()) return;
    const apso::Matrix6& C = a.covariance;
    file_ << set << ',' << preset.name << ',' << p.step << ',' << mm << ',' << degrees << ',' << right << ',' << c << ','
          << apso::to_string(a.status) << ',' << a.degenerate_count << ',' << a.ambiguous << ',' << a.valid_share << ',' << a.static_share
          << ',' << a.correlation << ',' << a.scale_intensity << ',' << a.scale_depth << ',' << a.cost << ',' << a.iterations << ','
          << 1e3 * std::sqrt(C(0, 0) + C(1, 1) + C(2, 2)) << ',' << std::sqrt(C(3, 3) + C(4, 4) + C(5, 5)) / kDegree << ',' << normalised
          << '\n';
  }

  /// \throws std::runtime_error when a line could not be written
  void close() {
    if (!file_.is_open()) return;
    file_.close();
    if (!file_) throw std::runtime_error("--csv: the file could not be written in full");
  }

  std::vector<Told> told;  ///< of all results

 private:
  // e^T C^-1 e in the directions that are known, C that of the alignment and of the two true poses
  [[nodiscard]] double squared_over_variance(const apso::AlignmentResult& a, const apso::Twist& e) const {
    if (a.degenerate_count > 0 || !apso::succeeded(a.status)) return (e.transpose() * a.information * e).value();
    apso::Matrix6 C = a.covariance;
    for (int i = 0; i < 6; ++i) C(i, i) += 2 * (i < 3 ? truth_.position * truth_.position : truth_.direction * truth_.direction);
    return (e.transpose() * apso::solve_symmetric(C, e)).value();
  }

  std::ofstream file_;
  pairs::TruthNoise truth_;
  apso::FramePyramid reference_, current_;
};

void print_head() {
  std::printf(
      "| set | preset | pairs | right | called good, of these wrong | right but refused | open directions told | ambiguity told | "
      "normalised error of right results: mean, 95 %% |\n|---|---|---|---|---|---|---|---|---|\n");
}
void print(const std::string& set, const Preset& preset, Row& r) {
  double mean = 0;
  for (const double n : r.normalised) mean += n / static_cast<double>(r.normalised.size());
  std::sort(r.normalised.begin(), r.normalised.end());
  const double high = r.normalised.empty() ? 0 : r.normalised[r.normalised.size() * 95 / 100];
  std::printf("| %s | %s | %d | %d | %d, %d | %d | %d | %d | %.2f, %.2f |\n", set.c_str(), preset.name.c_str(), r.pairs, r.right, r.good,
              r.wrong_good, r.right_refused, r.open, r.ambiguous, mean, high);
  std::fflush(stdout);
}
// Of the results with about the same c_dir, how many are right; and how well c_dir tells right from wrong.
void print_calibration(std::vector<Told> told) {
  std::printf("\n| c_dir | results | right |\n|---|---|---|\n");
  for (int tenth = 0; tenth < 10; ++tenth) {
    int all = 0;
    int right = 0;
    for (const Told& t : told) {
      if (std::min(9, static_cast<int>(10 * t.c_dir)) != tenth) continue;
      ++all;
      right += t.right ? 1 : 0;
    }
    if (all > 0) std::printf("| %.1f to %.1f | %d | %.0f %% |\n", 0.1 * tenth, 0.1 * (tenth + 1), all, 100.0 * right / all);
  }
  // area under the curve by ranks, those of equal values being their mean
  std::sort(told.begin(), told.end(), [](const Told& a, const Told& b) { return a.c_dir < b.c_dir; });
  double ranks = 0;
  double right = 0;
  for (std::size_t i = 0; i < told.size();) {
    std::size_t end = i;
    while (end < told.size() && !(told[end].c_dir > told[i].c_dir)) ++end;
    for (std::size_t k = i; k < end; ++k) {
      ranks += told[k].right ? 0.5 * static_cast<double>(i + end + 1) : 0.0;
      right += told[k].right ? 1 : 0;
    }
    i = end;
  }
  const double wrong = static_cast<double>(told.size()) - right;
  if (right > 0 && wrong > 0) std::printf("\narea under the curve: %.3f\n", (ranks - right * (right + 1) / 2) / (right * wrong));
}
int run(int argc, char** argv) {
  CLI::App app{"Does the alignment know when it is wrong?"};
  int views = 25;
  std::uint64_t seed = pairs::kReleaseSeed;
  std::vector<std::string> sets;
  for (const SyntheticSet& s : kSets) sets.push_back(s.name);
  std::vector<std::string> known = sets;
  known.push_back("none");
  std::vector<double> motions{0.01, 0.04, 0.10};
  std::string csv, recording, truth, camera;
  std::vector<int> steps{1, 2, 3, 5, 8};
  int max_pairs = std::numeric_limits<int>::max();
  double offset = 0;
  app.add_option("--views", views, "views of each set")->check(CLI::Range(1, 10000));
  app.add_option("--seed", seed, "of the views; the default is another one with each version")->capture_default_str();
  app.add_option("--sets", sets, "synthetic sets, or none")->check(CLI::IsMember(known));
  app.add_option("--motions", motions, "[m], each with half a degree per centimetre");
  app.add_option("--csv", csv, "file for one line per result");
  app.add_option("--recording", recording, "folder of a recording in the layout of the TUM benchmark");
  app.add_option("--truth", truth, "its trajectory");
  app.add_option("--truth-offset", offset, "added to the time of an image before the true pose is looked up [s]");
  app.add_option("--camera", camera, "of the recording: a name such as tum-fr1, or a YAML file");
  app.add_option("--steps", steps, "distances of the frames of a pair");
  app.add_option("--pairs", max_pairs, "maximum number of pairs per distance, evenly spaced (default: all)")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);

  Preset normal{"default", {}, {}};
  Preset dense{"dense", {}, apso::dense_alignment()};
  dense.pyramid.finest = 0;
  dense.pyramid.max_pixels = 0;
  const std::vector<Preset> presets{normal, dense};
  Judge judge(csv);
  const apso::Pinhole synthetic = apso::testing::freiburg3_camera(640, 480);
  const pairs::PairMaker maker(seed);
  print_head();
  for (const std::string& set : sets) {
    if (set == "none") continue;
    const SyntheticSet& source = *std::find_if(kSets.begin(), kSets.end(), [&](const SyntheticSet& k) { return k.name == set; });
    pairs::ForeignSensor sensor;
    sensor.missing = source.missing;
    std::vector<Row> rows(presets.size());
    for (int v = 0; v < views; ++v) {
      for (const double step : motions) {
        const Pair p = source.planar
                           ? pairs::make_planar_pair(source.scenery, seed * 1000 + static_cast<std::uint64_t>(v), step, synthetic, sensor)
                           : pairs::make_room_pair(maker, v, step, source.moving_share, sensor);
        for (std::size_t i = 0; i < presets.size(); ++i) judge(set, presets[i], synthetic, p, rows[i]);
      }
    }
    for (std::size_t i = 0; i < presets.size(); ++i) print(set, presets[i], rows[i]);
  }
  if (recording.empty()) {
    judge.close();
    print_calibration(judge.told);
    return 0;
  }
  const apso::CameraModel model = std::filesystem::is_regular_file(camera) ? apso::camera_from_yaml(camera) : apso::camera_by_name(camera);
  const pairs::RecordingPairs source(recording, model, truth.empty() ? recording + "/groundtruth.txt" : truth, offset);
  judge.take(source.noise());
  const std::string name = std::filesystem::path(recording).filename().string();
  for (const int step : steps) {
    std::vector<Row> rows(presets.size());
    source.each(step, max_pairs, [&](const Pair& p) {
      for (std::size_t i = 0; i < presets.size(); ++i) judge(name, presets[i], model.pinhole, p, rows[i]);
    });
    if (rows.front().pairs == 0)
      throw std::runtime_error(recording + ": no two frames " + std::to_string(step) + " apart have images of " +
                               std::to_string(model.pinhole.width) + "x" + std::to_string(model.pinhole.height) + " and true poses");
    for (std::size_t i = 0; i < presets.size(); ++i) print(name + ", step " + std::to_string(step), presets[i], rows[i]);
  }
  judge.close();
  print_calibration(judge.told);
  return 0;
}
}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "verdict: %s\n", e.what());
    return 1;
  }
}
