/// \file
/// What the benchmarks count besides time.
#pragma once

#include <benchmark/benchmark.h>

/// Pixels that every iteration goes through, as a rate.
inline void count_pixels(benchmark::State& state, double pixels) {
  state.counters["pixels_per_second"] = benchmark::Counter(pixels, benchmark::Counter::kIsIterationInvariantRate);
}
inline void count_pixels(benchmark::State& state, int width, int height) { count_pixels(state, static_cast<double>(width) * height); }
