// Cost of the motion policy and of mask operations on 640x480 frames.
#include <benchmark/benchmark.h>

#include <vector>

#include <apso/observation/policies/geometric_motion.hpp>
#include <apso/observation/objects/object_tracker.hpp>
#include <apso/testing/synthetic.hpp>

namespace {
using namespace apso;

const std::vector<testing::SyntheticFrame>& frames(Pinhole& camera) {
  static const testing::SyntheticSequence sequence("walking_xyz", {});
  static const std::vector<testing::SyntheticFrame> rendered = [] {
    std::vector<testing::SyntheticFrame> f(24);
    for (int i = 0; i < 24; ++i) sequence.render(3 * i, f[static_cast<std::size_t>(i)]);
    return f;
  }();
  camera = sequence.camera();
  return rendered;
}

// One frame with a full memory of past views.
void observe_and_remember(benchmark::State& state) {
  Pinhole camera;
  const auto& sequence = frames(camera);
  GeometricMotionOptions options;
  options.correct_prior = state.range(0) != 0;
  GeometricMotion motion(camera, options);
  DynamicMask mask;
  for (const auto& f : sequence) {
    motion.observe(f.rgbd(), f.T_world_camera, {}, mask);
    motion.remember(f.rgbd(), f.T_world_camera, mask);
  }
  RgbdFrame last = sequence.back().rgbd();
  for (auto _ : state) {
    last.timestamp += 1e-5;
    motion.observe(last, sequence.back().T_world_camera, {}, mask);
    benchmark::DoNotOptimize(mask.probability.data());
  }
  state.counters["views"] = static_cast<double>(motion.reference_count());
}
BENCHMARK(observe_and_remember)->ArgName("correct_prior")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

void dilate_full_size(benchmark::State& state) {
  Image<float> image(640, 480, 0.0F);
  for (int y = 100; y < 400; ++y)
    for (int x = 200; x < 300; ++x) image(x, y) = 1.0F;
  Image<float> work;
  std::vector<float> scratch;
  for (auto _ : state) {
    work = image;
    dilate(work, static_cast<int>(state.range(0)), scratch);
    benchmark::DoNotOptimize(work.data());
  }
}
BENCHMARK(dilate_full_size)->ArgName("radius")->Arg(3)->Arg(7)->Arg(15)->Unit(benchmark::kMillisecond);

void objects_of_a_mask(benchmark::State& state) {
  DynamicMask mask;
  set_unknown(640, 480, mask);
  for (int k = 0; k < 3; ++k)
    for (int y = 100; y < 400; ++y)
      for (int x = 50 + 200 * k; x < 150 + 200 * k; ++x) mask.probability(x, y) = 1.0F;
  Image<float> depth(640, 480, 2.0F);
  ObjectTracker tracker;
  for (auto _ : state) benchmark::DoNotOptimize(tracker.update(mask, depth).size());
}
BENCHMARK(objects_of_a_mask)->Unit(benchmark::kMillisecond);

}  // namespace
