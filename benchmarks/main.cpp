// The benchmarks' main(): every run says what was measured, and all times of all programs have one unit.
#include <benchmark/benchmark.h>

#include <apso/version.hpp>

int main(int argc, char** argv) {
  benchmark::SetDefaultTimeUnit(benchmark::kMicrosecond);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::AddCustomContext("apso_version", APSO_VERSION);
  benchmark::AddCustomContext("compiler", APSO_COMPILER);
  benchmark::AddCustomContext("flags", APSO_FLAGS);
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
