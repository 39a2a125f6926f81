// Cost of refinement: preparing a frame, aligning it to one or several references, blending.
#include <benchmark/benchmark.h>

#include <apso/refinement/refiner.hpp>

#include "../tests/refinement/room.hpp"

namespace {

struct Scene {
  apso::Pinhole camera = room::camera(640);
  apso::Pose truth = room::pose(.03, -.01, .02, .7, -1.2, .3);
  room::Frame reference = room::render(camera, apso::Pose::Identity(), {}, 1);
  room::Frame current = room::render(camera, truth, {}, 2);
};
const Scene& scene() {
  static const Scene s;
  return s;
}

void build_pyramid(benchmark::State& state, apso::PyramidRole role) {
  const Scene& s = scene();
  apso::FramePyramid p;
  for (auto _ : state) p.build(s.current.view(), s.camera, s.current.probability, {}, role);
}

void align(benchmark::State& state, int references, int finest, int max_pixels) {
  const Scene& s = scene();
  apso::PyramidOptions o;
  o.finest = finest;
  o.max_pixels = max_pixels;
  apso::FramePyramid r, c;
  r.build(s.reference.view(), s.camera, {}, o, apso::PyramidRole::Reference);
  c.build(s.current.view(), s.camera, {}, o, apso::PyramidRole::Current);
  const std::vector<apso::AlignmentReference> all(static_cast<std::size_t>(references), {&r, apso::Pose::Identity(), 1.0});
  apso::DirectAligner aligner;
  apso::AlignmentResult result;
  for (auto _ : state) {
    result = aligner.align(all, c, {apso::Pose::Identity()});
    benchmark::DoNotOptimize(result);
  }
  state.counters["iterations"] = result.iterations;
  state.counters["error_mm"] = 1e3 * room::translation_error(result.T_world_camera, s.truth);
}

void blend(benchmark::State& state) {
  const apso::Pose a = apso::Pose::Identity();
  const apso::Pose b = scene().truth;
  for (auto _ : state) benchmark::DoNotOptimize(apso::blend(a, b, 0.4));
}

}  // namespace

BENCHMARK_CAPTURE(build_pyramid, current, apso::PyramidRole::Current)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(build_pyramid, reference, apso::PyramidRole::Reference)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, default_preset, 1, 1, 20000)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, dense_half_resolution, 1, 1, 1000000)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, full_resolution, 1, 0, 20000)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, three_references, 3, 1, 20000)->Unit(benchmark::kMillisecond);
BENCHMARK(blend);
