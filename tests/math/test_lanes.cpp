#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <apso/math/lanes/lane_functions.hpp>
#include <apso/math/lanes/lane_memory.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>

using namespace apso;

namespace {
Lanes ramp(float first, float step) {
  Lanes r;
  for (int i = 0; i < kLanes; ++i) r.v[i] = first + step * static_cast<float>(i);
  return r;
}
}  // namespace

TEST_CASE("lanes compute what floats compute") {
  const Lanes a = ramp(-2, .75F);
  const Lanes b = ramp(3, -.5F);
  float sum = 0;
  for (int i = 0; i < kLanes; ++i) {
    CHECK((a + b)[i] == a[i] + b[i]);
    CHECK((a - b)[i] == a[i] - b[i]);
    CHECK((a * b)[i] == a[i] * b[i]);
    CHECK((a / b)[i] == a[i] / b[i]);
    CHECK(min(a, b)[i] == std::min(a[i], b[i]));
    CHECK(max(a, b)[i] == std::max(a[i], b[i]));
    CHECK(abs(a)[i] == std::abs(a[i]));
    CHECK(select(a < b, a, b)[i] == std::min(a[i], b[i]));
    CHECK(select(!(a < b), a, b)[i] == std::max(a[i], b[i]));
    CHECK(to_int(a)[i] == static_cast<int>(a[i]));
    CHECK(to_float(to_int(a))[i] == std::trunc(a[i]));
    sum += a[i];
  }
  CHECK(a.sum() == doctest::Approx(sum));
}

TEST_CASE("a comparison with NaN is false") {
  const Lanes nan = std::numeric_limits<float>::quiet_NaN();
  const Lanes one = 1.0F;
  for (int i = 0; i < kLanes; ++i) {
    CHECK((nan < one)[i] == 0);
    CHECK((nan > one)[i] == 0);
    CHECK((nan <= one)[i] == 0);
    CHECK((nan >= one)[i] == 0);
    CHECK((one <= one)[i] == -1);
    CHECK(((one <= one) & (nan < one))[i] == 0);
    CHECK(((one <= one) | (nan < one))[i] == -1);
  }
}

TEST_CASE("the square root is exact to rounding") {
  for (double x = 1e-30; x < 1e30; x *= 1.37) {
    CAPTURE(x);
    const Lanes l = sqrt(Lanes(static_cast<float>(x)));
    const double truth = std::sqrt(static_cast<double>(static_cast<float>(x)));
    for (int i = 0; i < kLanes; ++i) CHECK(std::abs(static_cast<double>(l[i]) - truth) <= 3e-7 * truth);
  }
  CHECK(sqrt(Lanes(0.0F))[0] == 0.0F);
}

TEST_CASE("the logarithm is that of the standard library") {
  for (double x = 1e-6; x < 1e9; x *= 1.003) {
    const Lanes l = log(Lanes(static_cast<float>(x)));
    const double truth = std::log(static_cast<double>(static_cast<float>(x)));
    CHECK(std::abs(static_cast<double>(l[0]) - truth) <= 3e-7 * std::max(1e-3, std::abs(truth)));
    CHECK(l[kLanes - 1] == l[0]);
  }
}

TEST_CASE("log1p, exp and expm1 are those of the standard library, also where the result is small") {
  const auto close = [](float found, double truth) { return std::abs(static_cast<double>(found) - truth) <= 4e-7 * std::abs(truth); };
  for (double magnitude = 1e-12; magnitude < 80; magnitude *= 1.01) {
    const auto x = static_cast<float>(magnitude);
    const auto d = static_cast<double>(x);
    CAPTURE(d);
    CHECK(close(log1p(Lanes(x))[0], std::log1p(d)));
    CHECK(close(exp(Lanes(x))[0], std::exp(d)));
    CHECK(close(exp(Lanes(-x))[kLanes - 1], std::exp(-d)));
    CHECK(close(expm1(Lanes(x))[0], std::expm1(d)));
    CHECK(close(expm1(Lanes(-x))[kLanes - 1], std::expm1(-d)));
  }
  CHECK(log1p(Lanes(0.0F))[0] == 0.0F);
  CHECK(exp(Lanes(0.0F))[0] == 1.0F);
  CHECK(expm1(Lanes(0.0F))[0] == 0.0F);
  CHECK(exp(Lanes(-1e6F))[0] == 0.0F);
  CHECK(expm1(Lanes(-1e6F))[0] == -1.0F);
}

TEST_CASE("loads and stores that reorder") {
  float memory[6 * kLanes];
  for (int i = 0; i < 6 * kLanes; ++i) memory[i] = static_cast<float>(i);
  Lanes even, odd;
  load_pairs(memory, even, odd);
  IntLanes offset{};
  for (int i = 0; i < kLanes; ++i) offset.v[i] = 3 * i;
  const Quad q = load_quads(memory, offset);
  const Lanes first = gather(memory, offset);
  float back[2 * kLanes];
  store_pairs(even, odd, back);
  for (int i = 0; i < kLanes; ++i) {
    CHECK(even[i] == static_cast<float>(2 * i));
    CHECK(odd[i] == static_cast<float>(2 * i + 1));
    CHECK(first[i] == static_cast<float>(3 * i));
    for (int k = 0; k < 4; ++k) CHECK(q.c[k][i] == static_cast<float>(3 * i + k));
    CHECK(back[2 * i] == even[i]);
    CHECK(back[2 * i + 1] == odd[i]);
  }
}

TEST_CASE("a loop gets the lanes of the processor, and sums in them are added in the order of kLanes") {
  constexpr int kNumbers = 4 * kWideLanes;
  float numbers[kNumbers];
  for (int i = 0; i < kNumbers; ++i) numbers[i] = 1.0F / static_cast<float>(3 + i);  // their sum depends on its order
  Lanes narrow = 0.0F;
  for (int i = 0; i < kNumbers; i += kLanes) narrow += Lanes::load(numbers + i);
  Lanes widest = 0.0F;
  const int at_once = in_widest_lanes([&](auto lanes) {
    for (int i = 0; i < kNumbers; i += lanes) add(widest, BasicLanes<lanes>::load(numbers + i));
    return int{lanes};
  });
  CHECK((at_once == kLanes || at_once == kWideLanes));
  for (int i = 0; i < kLanes; ++i) CHECK(widest[i] == narrow[i]);
}

TEST_CASE("parts of lanes are those in their order") {
  float numbers[8];
  for (int i = 0; i < 8; ++i) numbers[i] = static_cast<float>(i);
  const auto eight = BasicLanes<8>::load(numbers);
  for (int i = 0; i < 4; ++i) {
    CHECK(eight.part<4, 0>()[i] == static_cast<float>(i));
    CHECK(eight.part<4, 1>()[i] == static_cast<float>(4 + i));
  }
  CHECK(eight.sum() == 28.0F);
}
