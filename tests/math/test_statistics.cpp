// The median by its definition, and the running median against a window kept by hand.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <vector>

#include <apso/math/statistics.hpp>
// Both headers in one file: no call may depend on which of them a program includes.
#include <apso/math/robust_scale.hpp>

using namespace apso;

namespace {
double median(std::vector<double> values) { return median_in_place(values); }
}  // namespace

TEST_CASE("the median of an even count is the mean of the middle two, whatever is included beside it") {
  CHECK(median({}) == 0);
  CHECK(median({7}) == 7);
  CHECK(median({4, 1}) == 2.5);
  CHECK(median({9, 1, 5}) == 5);
  CHECK(median({4, 3, 2, 1}) == 2.5);
  std::vector<double> upper{4, 3, 2, 1};
  CHECK(upper_median(upper) == 3);
  RunningMedian running(4);
  for (const double v : {1.0, 2.0, 3.0, 4.0}) running.add(v);
  CHECK(running.median() == 2.5);
}

TEST_CASE("RunningMedian remembers the last values, and only finite ones") {
  RunningMedian running(7);
  CHECK(running.median(3.5) == 3.5);
  CHECK(running.mad() == 0);
  std::deque<double> window;
  std::uint32_t state = 1;
  for (int i = 0; i < 100; ++i) {
    state = state * 1664525U + 1013904223U;
    const double v = static_cast<double>(state >> 8U) / 16777216.0;
    running.add(v);
    running.add(std::numeric_limits<double>::quiet_NaN());
    running.add(std::numeric_limits<double>::infinity());
    window.push_back(v);
    if (window.size() > 7) window.pop_front();
    std::vector<double> sorted(window.begin(), window.end());
    std::sort(sorted.begin(), sorted.end());
    const std::size_t n = sorted.size();
    const double expected = n % 2 == 1 ? sorted[n / 2] : 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]);
    CHECK(running.size() == static_cast<int>(n));
    CHECK(running.full() == (n == 7));
    CHECK(running.median(99) == expected);
    std::vector<double> deviations;
    for (const double x : window) deviations.push_back(std::abs(x - expected));
    CHECK(running.mad() == median(deviations));
  }
  running.clear();
  CHECK(running.size() == 0);
  CHECK(running.median(-1) == -1);
  CHECK_THROWS_AS(RunningMedian(0), contract_error);
}
