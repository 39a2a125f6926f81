// Cost of the motion policy and of mask operations on 640x480 frames, also when the frames are of the user's types.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/observation/objects/object_tracker.hpp>
#include <apso/observation/policies/geometric_motion.hpp>
#include <apso/testing/synthetic.hpp>
#include <apso/traits/frame.hpp>

#include "counters.hpp"

/// 16-bit depth with padding, as a driver delivers it.
struct RawDepth {
  int width = 0;
  int height = 0;
  std::ptrdiff_t stride = 0;
  std::vector<std::uint16_t> pixels;
};
template <>
struct apso::image_traits<RawDepth> {
  using value_type = std::uint16_t;
  static int width(const RawDepth& m) { return m.width; }
  static int height(const RawDepth& m) { return m.height; }
  static value_type at(const RawDepth& m, int x, int y) { return row(m, y)[x]; }
  static const value_type* row(const RawDepth& m, int y) { return m.pixels.data() + m.stride * y; }
};

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
  count_pixels(state, last.depth.width, last.depth.height);
  state.counters["views"] = static_cast<double>(motion.reference_count());
}
BENCHMARK(observe_and_remember)->ArgName("correct_prior")->Arg(0)->Arg(1);

// What a policy does with every frame before it looks for motion, on depth in metres and on raw 16 bit in its own unit.
void reduce_a_frame(benchmark::State& state) {
  Pinhole camera;
  const Image<float>& depth = frames(camera).back().depth;
  RawDepth raw{depth.width(), depth.height(), depth.width() + 16, {}};
  raw.pixels.assign(static_cast<std::size_t>(raw.stride) * static_cast<std::size_t>(raw.height), 0);
  for (int y = 0; y < raw.height; ++y) {
    for (int x = 0; x < raw.width; ++x) {
      raw.pixels[static_cast<std::size_t>(raw.stride * y + x)] = static_cast<std::uint16_t>(std::lround(5000 * depth(x, y)));
    }
  }
  FrameReducer reducer(camera, kMotionWidth, DepthRange{});
  Image<float> small;
  const RgbdFrame native{0, depth.view(), depth.view()};
  const auto foreign = frame(0, depth, scaled(raw, 1 / 5000.0F), camera);
  for (auto _ : state) {
    if (state.range(0) != 0) {
      reducer.depth(foreign, small);
    } else {
      reducer.depth(native, small);
    }
    benchmark::DoNotOptimize(small.data());
  }
  count_pixels(state, depth.width(), depth.height());
}
BENCHMARK(reduce_a_frame)->ArgName("raw_16_bit")->Arg(0)->Arg(1);

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
  count_pixels(state, image.width(), image.height());
}
BENCHMARK(dilate_full_size)->ArgName("radius")->Arg(3)->Arg(7)->Arg(15);

void objects_of_a_mask(benchmark::State& state) {
  DynamicMask mask;
  set_unknown(640, 480, mask);
  for (int k = 0; k < 3; ++k)
    for (int y = 100; y < 400; ++y)
      for (int x = 50 + 200 * k; x < 150 + 200 * k; ++x) mask.probability(x, y) = 1.0F;
  Image<float> depth(640, 480, 2.0F);
  ObjectTracker tracker;
  for (auto _ : state) benchmark::DoNotOptimize(tracker.update(mask, depth).size());
  count_pixels(state, depth.width(), depth.height());
}
BENCHMARK(objects_of_a_mask);

}  // namespace
