#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <apso/math/sampling.hpp>

using namespace apso;

TEST_CASE("bilinear is exact on a bilinear function, value and derivative") {
  Image<float> image(6, 5);
  const auto f = [](double x, double y) { return 1 + 2 * x - 3 * y + .5 * x * y; };
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 6; ++x) image(x, y) = static_cast<float>(f(x, y));
  }
  for (const double u : {0.0, .25, 2.5, 5.0}) {
    for (const double v : {0.0, 1.75, 4.0}) {
      REQUIRE(can_sample(image, u, v));
      const Sample s = bilinear(image, u, v);
      CHECK(s.value == doctest::Approx(f(u, v)).epsilon(1e-6));
      CHECK(s.dx == doctest::Approx(2 + .5 * v).epsilon(1e-6));
      CHECK(s.dy == doctest::Approx(-3 + .5 * u).epsilon(1e-6));
    }
  }
  CHECK_FALSE(can_sample(image, -.01, 1));
  CHECK_FALSE(can_sample(image, 5.01, 1));
  CHECK_FALSE(can_sample(image, std::numeric_limits<double>::quiet_NaN(), 1));
}
