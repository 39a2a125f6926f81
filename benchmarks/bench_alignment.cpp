// Cost of refinement: preparing a frame, aligning it to one or several references, blending.
#include <benchmark/benchmark.h>

#include <string>

#include <apso/refinement/cost/tile_summer.hpp>
#include <apso/refinement/refiner.hpp>

#include "../tests/refinement/room.hpp"
#include "counters.hpp"

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
  count_pixels(state, s.camera.width, s.camera.height);
}

/// \param pixels of all references at the finest level
void count(benchmark::State& state, const apso::AlignmentResult& result, int pixels) {
  count_pixels(state, pixels);
  state.counters["iterations"] = result.iterations;
  state.counters["error_mm"] = 1e3 * room::translation_error(result.T_world_camera, scene().truth);
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
  count(state, result, references * r.level(0).pixels.count);
}

// One pass over all pixels of the finest level by each kernel: warp, weigh, sum.
void kernel(benchmark::State& state, apso::KernelKind kind) {
  const Scene& s = scene();
  apso::FramePyramid r, c;
  r.build(s.reference.view(), s.camera, {}, {}, apso::PyramidRole::Reference);
  c.build(s.current.view(), s.camera, {}, {}, apso::PyramidRole::Current);
  const apso::RobustKernel robust{kind};
  const apso::NoiseModel noise;
  const apso::Warper warper(c.level(0), apso::inverse(s.truth), {}, {}, 1.0F, 1.0F);
  const apso::PixelList& pixels = r.level(0).pixels;
  apso::TileSummer summer(warper, apso::NoiseRef(noise), apso::KernelRef(robust), {});
  apso::TileSums sums;
  for (auto _ : state) {
    for (const apso::PixelList::Tile& tile : pixels.tiles) {
      summer(pixels, tile, sums);
      benchmark::DoNotOptimize(sums);
    }
  }
  count_pixels(state, pixels.count);
  state.counters["efficiency"] = apso::gaussian_efficiency(robust);  // share of the information of Gaussian residuals that it keeps
}

// A whole alignment by each kernel: how many iterations it takes is part of it.
void align_by(benchmark::State& state, apso::KernelKind kind) {
  const Scene& s = scene();
  apso::FramePyramid r, c;
  r.build(s.reference.view(), s.camera, {}, {}, apso::PyramidRole::Reference);
  c.build(s.current.view(), s.camera, {}, {}, apso::PyramidRole::Current);
  apso::AlignmentOptions options;
  options.kernel.kind = kind;
  apso::DirectAligner aligner(options);
  apso::AlignmentResult result;
  for (auto _ : state) {
    result = aligner.align({{&r, apso::Pose::Identity(), 1.0}}, c, {apso::Pose::Identity()});
    benchmark::DoNotOptimize(result);
  }
  count(state, result, r.level(0).pixels.count);
}

const bool every_kernel = [] {
  const auto names = apso::enum_names(apso::KernelKind{});
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto kind = static_cast<apso::KernelKind>(i);
    const std::string name = names[i];
    if (kind != apso::KernelKind::AdaptiveBarron) {  // the same loop as Barron's
      benchmark::RegisterBenchmark(("kernel/" + name).c_str(), kernel, kind);
    }
    benchmark::RegisterBenchmark(("align_by/" + name).c_str(), align_by, kind);
  }
  return true;
}();

void blend(benchmark::State& state) {
  const apso::Pose a = apso::Pose::Identity();
  const apso::Pose b = scene().truth;
  for (auto _ : state) benchmark::DoNotOptimize(apso::blend(a, b, 0.4));
}

}  // namespace

BENCHMARK_CAPTURE(build_pyramid, current, apso::PyramidRole::Current);
BENCHMARK_CAPTURE(build_pyramid, reference, apso::PyramidRole::Reference);
BENCHMARK_CAPTURE(align, default_preset, 1, 1, 20000);
BENCHMARK_CAPTURE(align, dense_half_resolution, 1, 1, 1000000);
BENCHMARK_CAPTURE(align, full_resolution, 1, 0, 20000);
BENCHMARK_CAPTURE(align, three_references, 3, 1, 20000);
BENCHMARK(blend);
