// Pipeline and assessor over frames that a tracker may deliver: first some that are good, so that GOOD is reached, then what the
// input says. No pose that comes out is anything but a rigid motion, and no frame with a broken pose is GOOD.
#include <array>
#include <optional>

#include <apso/pipeline/pipeline.hpp>
#include <apso/quality/explain.hpp>

#include "input.hpp"

namespace {
using namespace apso;
constexpr int kWidth = 48;
constexpr int kHeight = 36;

struct Input {
  Image<float> grey{kWidth, kHeight, 0.5F}, depth{kWidth, kHeight, 2.0F};
  std::vector<Keypoint> keypoints;
  std::vector<PointTrack> tracks;
  std::vector<Detection> detections;
  Input() {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        grey(x, y) = static_cast<float>((x * 31 + y * 17) % 23) / 23.0F;
        depth(x, y) = 2.0F + 0.01F * static_cast<float>((x / 8 + y / 6) % 7);
      }
    }
    for (int y = 1; y < kHeight; y += 2) {
      for (int x = 1; x < kWidth; x += 2) {
        const auto u = static_cast<float>(x);
        const auto v = static_cast<float>(y);
        keypoints.push_back({u, v, 30, 0, 0});
        tracks.push_back({y * kWidth + x, u, v, u, v, 5});
      }
    }
  }
  void change(fuzz::Bytes& in) {
    const auto value = [&](double low, double high) { return static_cast<float>(in.number(low, high)); };
    for (int n = in.below(8); n > 0; --n) {
      const int x = in.below(kWidth);
      const int y = in.below(kHeight);
      const int w = in.below(kWidth);
      const float g = value(0, 1);
      const float z = value(0, 7);
      for (int j = y; j < kHeight; ++j) {
        for (int i = x; i < kWidth && i < x + w; ++i) {
          grey(i, j) = g;
          depth(i, j) = z;
        }
      }
    }
    if (in.flag()) keypoints.resize(static_cast<std::size_t>(in.below(static_cast<int>(keypoints.size()))));
    for (int n = in.below(4); n > 0 && !keypoints.empty(); --n) {
      Keypoint& k = keypoints[static_cast<std::size_t>(in.below(static_cast<int>(keypoints.size())))];
      k = {value(-5, kWidth + 5), value(-5, kHeight + 5), value(-1, 100), value(0, 360), in.below(10)};
    }
    for (int n = in.below(4); n > 0; --n) {
      PointTrack& t = tracks[static_cast<std::size_t>(in.below(static_cast<int>(tracks.size())))];
      t = {in.below(500), value(-5, kWidth + 5), value(-5, kHeight + 5), value(-5, kWidth + 5), value(-5, kHeight + 5), in.below(9) - 1};
    }
    for (int n = in.below(4); n > 0; --n) {
      Detection d;
      d.box = {value(-5, kWidth), value(-5, kHeight), value(-5, kWidth), value(-5, kHeight)};
      d.score = value(0, 1);
      d.class_id = in.below(4) - 1;
      d.movable = in.flag();
      if (in.flag()) d.motion_probability = value(0, 1);
      if (in.flag()) d.track_id = in.below(5) - 1;
      detections.push_back(d);
    }
  }
};

// A pipeline that has seen some good frames, in each of its six settings; made once.
constexpr int kGoodFrames = 5;
const Pipeline& after_good_frames(bool motion, RefinedFrames refine) {
  static std::array<std::optional<Pipeline>, 6> made;
  std::optional<Pipeline>& pipeline = made[static_cast<std::size_t>(refine) * 2 + (motion ? 1 : 0)];
  if (pipeline) return *pipeline;
  PipelineOptions options;
  options.motion = motion;
  options.refine = refine;
  options.assessor.initialisation.frames = 3;
  pipeline.emplace(Pinhole{40, 40, kWidth / 2.0 - 0.5, kHeight / 2.0 - 0.5, kWidth, kHeight}, options);
  for (int i = 0; i < kGoodFrames; ++i) {
    const Input frame;
    pipeline->observe(RgbdFrame{i / 30.0, frame.grey, frame.depth}, identity_pose(), frame.tracks, frame.detections);
    pipeline->assess(frame.keypoints, frame.tracks, {identity_pose(), identity_pose(), true});
    pipeline->conclude();
  }
  fuzz::require(pipeline->report().state == SceneState::Good, "GOOD is reached");
  return *pipeline;
}
}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Bytes in(data, size);
  const bool motion = in.flag();
  Pipeline pipeline = after_good_frames(motion, static_cast<RefinedFrames>(in.below(3)));
  for (int i = kGoodFrames; i < kGoodFrames + 4 && !in.empty(); ++i) {
    Input frame;
    frame.change(in);
    FeaturePose<> pose{in.pose(), identity_pose(), in.below(4) != 0};
    Pose prior = identity_pose();
    double t = i / 30.0;
    if (in.flag()) pose.T_world_predicted = in.pose();
    if (in.flag()) prior = in.pose();
    if (in.flag()) pose.information(in.below(6), in.below(6)) = in.number(-1e6, 1e6);
    if (in.below(16) == 0) t = in.number(-10, 10);
    try {
      const Observation& seen = pipeline.observe(RgbdFrame{t, frame.grey, frame.depth}, prior, frame.tracks, frame.detections);
      fuzz::require(seen.dynamic_ratio >= 0 && seen.dynamic_ratio <= 1, "the dynamic ratio is in [0,1]");
      const Assessment& a = pipeline.assess(frame.keypoints, frame.tracks, pose);
      fuzz::require(!explain(a).empty(), "each frame is explained");
      for_each_score(a, [](const char*, const std::optional<double>& v, double, Better) {
        fuzz::require(!v || (*v >= 0 && *v <= 1), "scores are in [0,1]");
      });
      const FrameReport& r = pipeline.conclude();
      fuzz::require(is_rigid(r.T_world_camera), "a pose that comes out is a rigid motion");
      const bool usable = pose.ok && is_rigid(pose.T_world_feature);
      fuzz::require(usable || r.state != SceneState::Good, "no frame without a usable feature pose is GOOD");
      fuzz::require(usable || a.state == SceneState::Bad, "such a frame is BAD");
    } catch (const contract_error&) {
      fuzz::require(!is_rigid(prior) || !is_rigid(pose.T_world_predicted) || !std::isfinite(t), "only a wrong call throws");
    }
  }
  return 0;
}
