// apso_motion: how well does each motion policy find what moves? Runs policies side by side on the same frames, each with its
// own feature tracker, and prints one table: masks against the truth, false alarms on static recordings, the resulting
// trajectory error, and CPU time.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <opencv2/core.hpp>

#include <apso/evaluation/ate.hpp>
#include <apso/io/parameters.hpp>
#include <apso/opencv/mask_image.hpp>

#include "track/command_line.hpp"
#include "track/config.hpp"
#include "track/frame_source.hpp"
#include "track/motion_report.hpp"
#include "track/open_camera.hpp"
#include "track/progress.hpp"
#include "track/results.hpp"

namespace {

struct Arguments {
  std::vector<std::string> sequences;
  std::vector<std::string> policies{"geometric",
                                    "geometric+cluster-residual",
                                    "epipolar",
                                    "multiview-depth",
                                    "cluster-residual",
                                    "residual",
                                    "hog-people",
                                    "depth-refined-mask(hog-people)",
                                    "geometric+depth-refined-mask(hog-people)",
                                    "depth-refined-mask(boxes)",
                                    "depth-refined-mask(boxes)&geometric",
                                    "mask-propagation(truth)",
                                    "truth",
                                    "none"};
  std::string csv;
  std::string config;
  std::string model;
  int frames = 0;
  unsigned seed = 1;
  bool reverse = false;
};

/// The true mask of the current frame, shared by the policies that simulate a perfect network.
struct Truth {
  cv::Mat mask;  ///< 8-bit, nonzero = may move, k = instance; empty where there is no truth
};

/// The true mask, as from a perfect segmentation.
class TrueMask {
 public:
  explicit TrueMask(const Truth* truth) : truth_(truth) {}
  void observe(const apso::AnyFrame& frame, const apso::AnyPose&, const apso::AnyTracks&, apso::DynamicMask& out) {
    if (truth_->mask.empty()) {
      apso::set_unknown(frame.depth().width(), frame.depth().height(), out);
    } else {
      apso::mask_from_labels(apso::opencv::as_image<std::uint8_t>(truth_->mask), out);
    }
  }
  void remember(const apso::AnyFrame&, const apso::AnyPose&, const apso::DynamicMask&) {}
  void reset() {}

 private:
  const Truth* truth_;
};

/// The boxes of the true instances, as from a perfect detector.
class TrueBoxes {
 public:
  explicit TrueBoxes(const Truth* truth) : truth_(truth) {}
  const std::vector<apso::Detection>& detect(const apso::AnyFrame&) {
    found_.clear();
    if (truth_->mask.empty()) return found_;
    double largest = 0;
    cv::minMaxLoc(truth_->mask, nullptr, &largest);
    cv::Mat labels;  // masks from files have one value for all people; then each region is one
    const int count = largest < 16 ? static_cast<int>(largest) + 1 : cv::connectedComponents(truth_->mask != 0, labels, 8, CV_32S);
    for (int k = 1; k < count; ++k) {
      const cv::Rect r = cv::boundingRect(labels.empty() ? cv::Mat(truth_->mask == k) : cv::Mat(labels == k));
      if (r.area() < 400) continue;
      apso::Detection d;
      d.box = {static_cast<float>(r.x), static_cast<float>(r.y), static_cast<float>(r.width), static_cast<float>(r.height)};
      d.score = 1;
      found_.push_back(d);
    }
    return found_;
  }

 private:
  const Truth* truth_;
  std::vector<apso::Detection> found_;
};

struct Runner {
  Runner(apso::AnyMotionPolicy p, const apso::Pinhole& camera, const apso::opencv::FeatureTrackerOptions& options)
      : policy(std::move(p)), tracker(camera, options) {}
  apso::AnyMotionPolicy policy;
  apso::opencv::FeatureTracker tracker;
  apso::DynamicMask mask;
  apso::Trajectory poses;
  track::MotionScore score;
};

double cpu_ms() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// A sequence as it is called on the command line: synthetic:NAME, FOLDER@CAMERA, or FOLDER@CAMERA@MASKS with a folder of true
/// masks named by timestamp.
struct SequenceText {
  explicit SequenceText(const std::string& text) : folder(text) {
    synthetic = text.rfind(prefix, 0) == 0;
    if (synthetic) return;
    const std::size_t first = text.find('@');
    if (first == std::string::npos) throw apso::io_error(text + ": expected synthetic:NAME, FOLDER@CAMERA or FOLDER@CAMERA@MASKS");
    const std::size_t second = text.find('@', first + 1);
    folder = text.substr(0, first);
    camera = text.substr(first + 1, second == std::string::npos ? second : second - first - 1);
    if (second != std::string::npos) masks = text.substr(second + 1);
  }
  static constexpr const char* prefix = "synthetic:";
  std::string folder;  ///< with the prefix if it is synthetic
  bool synthetic = false;
  std::string camera;
  std::string masks;  ///< empty: none
};

struct Sequence {
  std::string name;
  std::unique_ptr<track::FrameSource> source;
  track::SyntheticSource* synthetic = nullptr;
  std::optional<apso::StampedFiles> masks;
};

Sequence open(const SequenceText& text, const Arguments& a) {
  Sequence s;
  if (text.synthetic) {
    s.name = text.folder.substr(std::string(SequenceText::prefix).size());
    apso::testing::SyntheticOptions options;
    options.seed = a.seed;
    auto source = std::make_unique<track::SyntheticSource>(s.name, options);
    s.synthetic = source.get();
    s.source = std::move(source);
    return s;
  }
  s.name = std::filesystem::path(text.folder).filename().string();
  s.source = std::make_unique<track::RecordedSource>(text.folder, track::open_camera(text.camera));
  if (!text.masks.empty()) s.masks.emplace(text.masks, std::vector<std::string>{".png", ".pgm"});
  return s;
}

std::vector<track::MotionScore> run(Sequence& s, const Arguments& a, track::Config config) {
  track::take_depth_noise(s.source->inverse_depth_sigma(), config);
  const apso::Pinhole camera = s.source->camera();
  Truth truth;
  apso::opencv::MotionFiles files;
  files.model = a.model;
  const apso::PolicyTable own{{"truth", [&] { return TrueMask(&truth); }},
                              {"boxes", [&] { return apso::opencv::DetectorPolicy<TrueBoxes>(TrueBoxes(&truth)); }}};
  std::vector<std::unique_ptr<Runner>> runners;
  for (const std::string& p : a.policies) {
    runners.push_back(std::make_unique<Runner>(apso::opencv::motion_by_name(p, camera, config.motion, files, own), camera, config.tracker));
  }

  track::LoadedFrame frame;
  apso::opencv::FeatureFrontEnd front_end(config.tracker.orb, config.tracker.lk);  // the same for all policies
  apso::opencv::ImageFeatures features;
  track::ProgressLine progress;
  const int total = a.frames > 0 ? std::min(a.frames, s.source->size()) : s.source->size();
  int skipped = 0;
  int judged = 0;  // frames whose true mask is known
  std::string problem;
  for (int k = 0; k < total; ++k) {
    const int i = a.reverse ? total - 1 - k : k;
    s.source->load(i, frame);
    if (!frame.ok()) {
      ++skipped;
      problem = frame.error;
      continue;
    }
    apso::RgbdFrame rgbd = frame.rgbd();
    if (a.reverse) rgbd.timestamp = k / 30.0;
    truth.mask.release();
    if (s.synthetic != nullptr) {
      truth.mask = cv::Mat(frame.gray.size(), CV_8U, frame.instance.data());
    } else if (s.masks) {
      const std::string file = s.masks->at(frame.timestamp);
      if (!file.empty()) truth.mask = apso::opencv::read_mask(file, frame.gray.size());
    }
    const bool known = !s.masks || !truth.mask.empty();
    judged += known ? 1 : 0;
    front_end.extract(frame.gray, features);
    for (const auto& r : runners) {
      r->tracker.begin(features, rgbd);
      const auto prior = r->tracker.estimate(r->mask.probability);
      const double start = cpu_ms();
      r->policy.observe(rgbd, prior.T_world_camera, r->tracker.tracks(), r->mask);
      double spent = cpu_ms() - start;
      const auto found = r->tracker.estimate(r->mask.probability);
      const apso::Pose& pose = found.ok ? found.T_world_camera : found.T_world_predicted;
      const double again = cpu_ms();
      r->policy.remember(rgbd, pose, r->mask);
      spent += cpu_ms() - again;
      r->tracker.commit(pose, r->mask.probability, found.ok);
      r->score.ms += spent;
      r->poses.push_back({frame.timestamp, pose});
      // with a single pair only the second frame has a past
      if (known && (total > 2 || k > 0)) r->score.judge(r->mask, truth.mask);
    }
    progress.show(k + 1, total, s.name);
  }
  progress.end();
  if (skipped == total) throw apso::io_error(s.name + ": no frame can be read, e.g. " + problem);
  if (judged == 0) throw apso::io_error(s.name + ": no true mask is named by the timestamp of a frame");
  if (skipped > 0) std::fprintf(stderr, "warning: %s: %d of %d frames skipped, e.g. %s\n", s.name.c_str(), skipped, total, problem.c_str());
  if (judged < total - skipped) {
    std::fprintf(stderr, "warning: %s: %d of %d frames have a true mask, the others are not judged\n", s.name.c_str(), judged,
                 total - skipped);
  }
  const bool evaluated = !s.source->groundtruth().empty() && total > 20 && !a.reverse;
  std::vector<track::MotionScore> scores;
  for (const auto& r : runners) {
    if (evaluated) {
      const apso::AteResult ate = apso::ate(s.source->groundtruth(), r->poses);
      if (succeeded(ate.status) && std::isfinite(ate.statistics.rmse)) r->score.ate = ate.statistics.rmse;
    }
    r->score.ms /= std::max(1, r->score.frames);
    scores.push_back(r->score);
  }
  if (evaluated && scores.front().ate < 0)
    std::fprintf(stderr, "warning: %s: the ground truth cannot be compared, no ATE\n", s.name.c_str());
  return scores;
}

int run_all(const Arguments& a) {
  const track::Config config = track::read_config(a.config);
  std::ostringstream csv;
  csv << "sequence,policy,frames,frames_with_people,iou,recall,false_share,worst_false_share,ate_m,ms_per_frame\n";
  const std::vector<SequenceText> sequences(a.sequences.begin(), a.sequences.end());
  const auto write_csv = [&] {
    if (!a.csv.empty()) track::write_file(a.csv, csv.str());
  };
  for (const SequenceText& s : sequences) {
    if (!a.csv.empty())
      track::keep_apart(a.csv, {{"the recording", s.folder}, {"a folder of true masks", s.masks}, {"--config", a.config}});
  }
  write_csv();  // tells now whether it can be written
  std::vector<track::MeasuredSequence> all;
  for (const SequenceText& text : sequences) {
    Sequence s = open(text, a);
    track::MeasuredSequence m;
    m.name = s.name;
    m.kind = s.synthetic == nullptr            ? track::SequenceKind::Recorded
             : s.name.rfind("walking", 0) == 0 ? track::SequenceKind::Walking
                                               : track::SequenceKind::Static;
    m.scores = run(s, a, config);
    track::print_table(m.name, a.policies, m.scores);
    for (std::size_t i = 0; i < m.scores.size(); ++i) {
      const track::MotionScore& c = m.scores[i];
      const double n = std::max(1, c.with_people);
      csv << m.name << ',' << a.policies[i] << ',' << c.frames << ',' << c.with_people << ',' << c.iou / n << ',' << c.recall / n << ','
          << c.false_share / std::max(1, c.frames) << ',' << c.worst << ',' << c.ate << ',' << c.ms << '\n';
    }
    write_csv();  // what is computed is kept, whatever happens next
    all.push_back(std::move(m));
  }
  if (all.size() > 1) track::print_overview(all, a.policies);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  CLI::App app{
      "Compares motion policies on recordings: IoU and recall of the mask (frames in which people cover 1 % or more), share\n"
      "of static pixels marked as dynamic (mean, worst frame), trajectory error of a feature tracker that uses the mask,\n"
      "and CPU time per frame. Prints Markdown tables. Exit code: 0 done, 1 bad input, 2 wrong usage.\n"
      "In addition to the policies of apso_track there are 'truth' (the true mask) and 'boxes' (boxes of the true instances)."};
  app.add_option("SEQUENCE", a.sequences,
                 "synthetic:NAME, FOLDER@CAMERA, or FOLDER@CAMERA@MASKS with true masks named by timestamp\n"
                 "(CAMERA: tum-fr1, tum-fr2, tum-fr3, bonn, icl-nuim, or a YAML file as for apso_track; frames are\n"
                 "taken as they were read, rows of a rolling shutter are not moved)")
      ->required();
  app.add_option("--policies", a.policies, "policy expressions, separated by commas, see docs/observation.md")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->default_str("fourteen of them");
  app.add_option("--frames", a.frames, "stop after this many frames (0 = all)")->check(track::count());
  app.add_option("--seed", a.seed, "of the synthetic sequences")->capture_default_str();
  app.add_option("--config", a.config, "YAML file with options, as for apso_track; those of the policies and of the tracker count");
  app.add_option("--model", a.model, "ONNX file, for the policy 'dnn'");
  app.add_option("--csv", a.csv, "also write all figures to this CSV file")->check(track::not_empty());
  app.add_flag("--reverse", a.reverse, "play the sequences backwards");
  cv::setNumThreads(1);
  return track::run_main("apso_motion", app, argc, argv, [&] { return run_all(a); });
}
