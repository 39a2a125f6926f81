// The feature tracker, stage by stage, on a synthetic recording of 640 x 480.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include <apso/opencv/feature_tracker.hpp>
#include <apso/testing/synthetic.hpp>

#include "counters.hpp"

namespace {
using namespace apso;

constexpr int kFrames = 12;

struct Recording {
  Pinhole camera;
  std::vector<testing::SyntheticFrame> frames;
  std::vector<cv::Mat> gray;
  Recording() {
    testing::SyntheticOptions options;
    options.frames = kFrames;
    const testing::SyntheticSequence sequence("walking_xyz", options);
    camera = sequence.camera();
    frames.resize(kFrames);
    for (int i = 0; i < kFrames; ++i) {
      testing::SyntheticFrame& f = frames[static_cast<std::size_t>(i)];
      sequence.render(i, f);
      cv::Mat(camera.height, camera.width, CV_32FC1, f.intensity.data()).convertTo(gray.emplace_back(), CV_8U, 255);
    }
  }
};

const Recording& recording() {
  static const Recording r;
  return r;
}

std::size_t back_and_forth(std::size_t i) {  // 0 .. 11 .. 0: no jump when the recording starts again
  const std::size_t period = 2 * (kFrames - 1);
  const std::size_t k = i % period;
  return k < kFrames ? k : period - k;
}

void extract(benchmark::State& state) {
  const Recording& r = recording();
  opencv::OrbFrontEnd orb;
  std::vector<Keypoint> keypoints;
  cv::Mat descriptors;
  for (auto _ : state) orb.extract(r.gray[0], keypoints, descriptors);
  count_pixels(state, r.camera.width, r.camera.height);
  state.counters["keypoints"] = static_cast<double>(keypoints.size());
}

void follow(benchmark::State& state) {
  const Recording& r = recording();
  opencv::OrbFrontEnd orb;
  opencv::LkTracker lk;
  std::vector<Keypoint> keypoints;
  cv::Mat descriptors;
  orb.extract(r.gray[0], keypoints, descriptors);
  std::size_t i = 0;
  for (auto _ : state) lk.track(r.gray[back_and_forth(i++)], keypoints);
  count_pixels(state, r.camera.width, r.camera.height);
  state.counters["tracks"] = static_cast<double>(lk.tracks().size());
}

void track_frame(benchmark::State& state) {
  const Recording& r = recording();
  opencv::FeatureTracker tracker(r.camera);
  std::size_t i = 0;
  double error = 0;
  for (auto _ : state) {
    const std::size_t k = back_and_forth(i);
    RgbdFrame frame = r.frames[k].rgbd();
    frame.timestamp = static_cast<double>(i++) / 30.0;
    tracker.begin(r.gray[k], frame);
    (void)tracker.estimate({});
    const opencv::FeatureResult result = tracker.estimate({});
    tracker.commit(result.T_world_camera, {}, true);
    const Pose T_truth = inverse(r.frames[0].T_world_camera) * r.frames[k].T_world_camera;
    error = (result.T_world_camera.translation() - T_truth.translation()).norm();
  }
  count_pixels(state, r.camera.width, r.camera.height);
  state.counters["error_mm"] = 1e3 * error;  // of the last frame
  state.counters["landmarks"] = tracker.landmarks();
}
}  // namespace

BENCHMARK(extract);
BENCHMARK(follow);
BENCHMARK(track_frame);
