// Time of every score of the quality module, and of the whole assessment, on a 640x480 frame.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <deque>
#include <list>
#include <vector>

#include <apso/quality/assessor.hpp>
#include <apso/quality/explain.hpp>

#include "counters.hpp"

namespace {
using namespace apso;

/// A slanted, noisy room with a person-sized dynamic region; the same numbers on every machine.
struct Inputs {
  Pinhole camera{525, 525, 319.5, 239.5, 640, 480};
  Image<float> intensity{640, 480, 0.5F};
  Image<float> depth{640, 480};
  Image<float> mask{640, 480, 0.F};
  Image<std::uint8_t> grey{640, 480};
  Image<std::uint16_t> raw{640, 480};
  std::vector<Keypoint> keypoints;
  std::vector<PointTrack> tracks;
  std::vector<Detection> objects;
  std::vector<Correspondence> matches;

  Inputs() {
    std::uint32_t state = 1;
    const auto random = [&state] {  // linear congruential, [0,1)
      state = state * 1664525U + 1013904223U;
      return static_cast<float>(state >> 8U) / 16777216.F;
    };
    for (int y = 0; y < 480; ++y) {
      for (int x = 0; x < 640; ++x) {
        const float z = 1.5F + 2.F * static_cast<float>(x) / 640.F;
        depth(x, y) = random() < 0.1F ? 0.F : z + 0.003F * (random() - 0.5F) * z * z;
        intensity(x, y) = random();
        grey(x, y) = static_cast<std::uint8_t>(255 * intensity(x, y));
        raw(x, y) = static_cast<std::uint16_t>(5000 * depth(x, y));
        if (x >= 250 && x < 400 && y >= 80) mask(x, y) = 1.F;
      }
    }
    for (int i = 0; i < 1000; ++i) {
      const float u = 16 + 608 * random();
      const float v = 16 + 448 * random();
      keypoints.push_back({u, v, 20 + 30 * random(), 0, 0});
      tracks.push_back({i, u, v, u - 1, v, 3});
      matches.push_back({u - 3, v, u, v});
    }
    for (int i = 0; i < 3; ++i) {
      Detection d;
      d.box = {static_cast<float>(80 + 150 * i), 80, 150, 400};
      d.score = 0.8F;
      objects.push_back(d);
    }
  }
  AssessmentInput frame(double t) const {
    AssessmentInput in;
    in.frame = {t, intensity, depth};
    in.dynamic_probability = mask;
    in.keypoints = &keypoints;
    in.tracks = &tracks;
    in.objects = &objects;
    in.dynamic_ratio = 0.2;
    return in;
  }
};
const Inputs& inputs() {
  static const Inputs i;
  return i;
}

void S_conf(benchmark::State& s) {
  for (auto _ : s) benchmark::DoNotOptimize(confidence_score(inputs().objects, 640, 480));
}
void S_spatial(benchmark::State& s) {
  std::vector<float> scratch;
  for (auto _ : s) benchmark::DoNotOptimize(spatial_score(inputs().objects, 640, 480, SpatialOptions{}, scratch));
}
void S_feature(benchmark::State& s) {
  FeatureScratch scratch;
  for (auto _ : s) {
    const FeatureMeasure m = measure_features(inputs().keypoints, inputs().mask, 640, 480, {}, scratch);
    benchmark::DoNotOptimize(feature_score(m, 30.0));
  }
}
void S_sharp(benchmark::State& s) {
  for (auto _ : s) benchmark::DoNotOptimize(measure_sharpness(inputs().intensity));
  count_pixels(s, 640, 480);
}
void S_depth(benchmark::State& s) {
  std::vector<float> scratch;
  for (auto _ : s) benchmark::DoNotOptimize(depth_score(inputs().depth, {}, {}, scratch));
  count_pixels(s, 640, 480);
}
void S_depth_of_raw_16_bit(benchmark::State& s) {
  std::vector<float> scratch;
  const auto metres = scaled(inputs().raw, 1 / 5000.F);
  for (auto _ : s) benchmark::DoNotOptimize(depth_score(metres, {}, {}, scratch));
  count_pixels(s, 640, 480);
}
void S_mc(benchmark::State& s) {
  MotionScratch scratch;
  for (auto _ : s) benchmark::DoNotOptimize(motion_change(inputs().matches, 1000, 640, 480, {}, 0.1, scratch));
}
void S_dc(benchmark::State& s) {
  DepthSamples a;
  DepthSamples b;
  std::vector<float> scratch, scratch_mask;
  sample_depth(inputs().depth, inputs().mask, a);
  for (auto _ : s) {
    sample_depth(inputs().depth, inputs().mask, {}, b, scratch, scratch_mask);
    benchmark::DoNotOptimize(depth_change(a, b));
  }
  count_pixels(s, 640, 480);
}
void S_dec(benchmark::State& s) {
  DetectionScratch scratch;
  for (auto _ : s) benchmark::DoNotOptimize(detection_change(inputs().objects, inputs().objects, scratch));
}
void Assess(benchmark::State& s) {
  SceneAssessor assessor(inputs().camera);
  double t = 0;
  for (int i = 0; i < 60; ++i) assessor.assess(inputs().frame(t += 1.0 / 30));
  for (auto _ : s) benchmark::DoNotOptimize(assessor.assess(inputs().frame(t += 1.0 / 30)).S_final);
  count_pixels(s, 640, 480);
}
/// The same frame as other types: 8-bit grey, raw 16-bit depth, keypoints and tracks in lists of their own.
void AssessForeign(benchmark::State& s) {
  SceneAssessor assessor(inputs().camera);
  const std::list<PointTrack> tracks(inputs().tracks.begin(), inputs().tracks.end());
  const std::deque<Keypoint> keypoints(inputs().keypoints.begin(), inputs().keypoints.end());
  double t = 0;
  const auto next = [&] {
    const auto now = frame(t += 1.0 / 30, inputs().grey, scaled(inputs().raw, 1 / 5000.F), inputs().camera);
    auto input = assessment_input(now, keypoints, tracks, inputs().objects, inputs().mask);
    input.dynamic_ratio = 0.2;
    return assessor.assess(input).S_final;
  };
  for (int i = 0; i < 60; ++i) next();
  for (auto _ : s) benchmark::DoNotOptimize(next());
  count_pixels(s, 640, 480);
}
void Explain(benchmark::State& s) {
  SceneAssessor assessor(inputs().camera);
  for (int i = 0; i < 60; ++i) assessor.assess(inputs().frame(i / 30.0));
  for (auto _ : s) benchmark::DoNotOptimize(explain(assessor.assessment()));
}
}  // namespace

BENCHMARK(S_conf);
BENCHMARK(S_spatial);
BENCHMARK(S_feature);
BENCHMARK(S_sharp);
BENCHMARK(S_depth);
BENCHMARK(S_depth_of_raw_16_bit);
BENCHMARK(S_mc);
BENCHMARK(S_dc);
BENCHMARK(S_dec);
BENCHMARK(Assess);
BENCHMARK(AssessForeign);
BENCHMARK(Explain);
