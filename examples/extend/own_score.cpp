// Two scores of your own in one file of yours: one of the frame, one of change. They appear by themselves in the weights,
// the settings, the table, the explanation and the ablation. Eigen is all this file needs.
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <apso/score.hpp>
#include <apso/testing/synthetic.hpp>

// [score]
// Is the image well exposed? The share of its pixels that are neither black nor white.
struct Exposure {
  static constexpr const char* name = "S_exposure";  // its weight and its settings are called "exposure"
  static constexpr double default_weight = 0.25;     // next to those of the others, whose sum is 1
  using Value = apso::Quality;                       // higher is better
  struct Options {
    double margin = 0.02;  // grey values nearer to 0 or 1 count as clipped
    template <class Self, class V>
    static void fields(Self& s, V&& v) {
      v("margin", s.margin, 0.0, 0.5);
    }
  };
  struct Measured {
    double clipped = 0;  // share of the pixels, [0,1]
    template <class Self, class V>
    static void columns(Self& m, V&& column) {
      column("clipped", m.clipped);
    }
  };
  Options options;
  Measured measured;

  apso::MaybeQuality operator()(const apso::FrameContext& frame) {
    if (frame.intensity.empty()) return std::nullopt;  // missing, which is not zero
    auto rows = apso::rows(frame.intensity, buffer);   // any image of the caller's, row by row
    double clipped = 0;
    for (int y = 0; y < rows.height(); ++y) {
      const float* row = rows(y);
      for (int x = 0; x < rows.width(); ++x) clipped += std::abs(static_cast<double>(row[x]) - 0.5) > 0.5 - options.margin;
    }
    measured.clipped = clipped / (static_cast<double>(rows.width()) * rows.height());
    return apso::Quality(1 - measured.clipped);
  }
  static std::string reason(apso::Quality, const Measured& m) { return std::to_string(std::lround(100 * m.clipped)) + " % clipped"; }

  std::vector<float> buffer;
};
// [/score]

// [change]
// How far have the keypoints moved out of sight? A score of change says what it keeps of a frame.
struct KeypointLoss {
  static constexpr const char* name = "S_loss";
  using Value = apso::Deviation;  // higher is worse
  struct Memory {
    double keypoints = 0;
  };
  void remember(const apso::FrameContext& frame, Memory& memory) const {
    memory.keypoints = frame.keypoints != nullptr ? static_cast<double>(frame.keypoints->size()) : 0.0;
  }
  apso::MaybeDeviation operator()(const apso::ChangeContext<Memory>& frames) const {
    if (!(frames.reference.keypoints > 0)) return std::nullopt;
    return apso::Deviation(1 - frames.current.keypoints / frames.reference.keypoints);
  }
};
// [/change]

// [list]
using FrameScores = apso::ScoreList<apso::Confidence, apso::Spatial, apso::Feature, apso::Depth, Exposure>;
using ChangeScores = apso::ScoreList<apso::MotionChange, apso::DepthChange, apso::DetectionChange, KeypointLoss>;
using MyAssessor = apso::BasicAssessor<FrameScores, ChangeScores>;
// [/list]

namespace {
int failures = 0;
void check(bool ok, const char* what) {
  if (!ok) std::printf("FAILED: %s\n", what), ++failures;
}
// Names of all settings, as files write them.
struct Names {
  std::string* out;
  std::string prefix;
  template <class T, class... Range>
  void operator()(const char* name, const T& value, Range...) const {
    if constexpr (apso::is_options_v<T>) T::fields(value, Names{out, prefix + name + '.'});
    else *out += prefix + name + ' ';
  }
};
}  // namespace

int main() {
  const apso::testing::SyntheticSequence sequence("walking_xyz");
  apso::testing::SyntheticFrame image;
  sequence.render(0, image);
  std::vector<apso::Keypoint> keypoints;
  for (int i = 0; i < 600; ++i) keypoints.push_back({static_cast<float>(i % 30 * 21), static_cast<float>(i / 30 * 23), 30, 0, 0});

  MyAssessor::Options options;
  options.get<Exposure>().margin = 0.05;
  check(std::abs(options.weight<Exposure>() - 0.25 / 1.25) < 1e-12, "the weights sum to 1");
  std::string settings;
  MyAssessor::Options::fields(options, Names{&settings, ""});
  check(settings.find("exposure.margin ") != std::string::npos, "its settings are among the others");
  check(settings.find("frame_weights.exposure ") != std::string::npos, "and its weight");
  check(settings.find("change_weights.loss ") != std::string::npos, "and that of the other one");

  MyAssessor assessor(sequence.camera(), options);
  auto frame = apso::frame(0.0, image.intensity, image.depth, sequence.camera());
  const auto good = assessor.assess(apso::assessment_input(frame, keypoints));
  for (int y = 0; y < image.intensity.height(); ++y) {
    for (int x = 0; x < image.intensity.width() / 2; ++x) image.intensity(x, y) = 1;  // half of it overexposed
  }
  frame.timestamp = 0.1;
  keypoints.resize(300);
  const auto spoilt = assessor.assess(apso::assessment_input(frame, keypoints));
  check(good.get<Exposure>()->value() > 0.9, "a good frame");
  check(spoilt.get<Exposure>()->value() < 0.55, "a spoilt frame");
  check(spoilt.get<KeypointLoss>()->value() == 0.5, "half of the keypoints are gone");
  check(spoilt.S_total < good.S_total, "S_total knows it");
  check(spoilt.get("S_exposure") == spoilt.get<Exposure>()->value(), "by its name");

  std::string header;
  apso::for_each_score(spoilt, [&](const char* name, const auto&, double, apso::Better) { header += std::string(name) + ','; });
  apso::for_each_measurement(spoilt, [&](const std::string& name, double) { header += name + ','; });
  check(header.find("S_exposure,") != std::string::npos && header.find("S_loss,") != std::string::npos, "columns of scores");
  check(header.find("clipped,") != std::string::npos, "column of the measurement");
  std::string variants;
  apso::for_each_without_score(options, [&](const std::string& name, const MyAssessor::Options& without) {
    variants += name + ' ';
    if (name == "no_exposure") check(without.frame_weights.get<Exposure>() == 0, "switched off");
  });
  check(variants.find("no_exposure ") != std::string::npos && variants.find("no_loss ") != std::string::npos, "ablation");
  const std::string why = apso::explain(spoilt);
  check(why.find("S_exposure") != std::string::npos && why.find("% clipped") != std::string::npos, "explanation");
  check(why.find("S_loss") != std::string::npos, "explanation of the change");
  std::printf("%s\n%s\n%s\n", header.c_str(), variants.c_str(), why.c_str());
  return failures;
}
