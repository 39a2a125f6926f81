#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include <apso/math/robust_scale.hpp>

using namespace apso;

TEST_CASE("scales of Gaussian residuals, with and without outliers") {
  std::mt19937 rng(7);
  std::normal_distribution<double> gauss(0, 2);
  std::vector<double> r(20000);
  for (double& x : r) x = gauss(rng);
  std::vector<double> a = r;
  CHECK(mad_scale_in_place(a) == doctest::Approx(2).epsilon(.03));
  CHECK(mean_abs(r) == doctest::Approx(2 * std::sqrt(2 / 3.14159265)).epsilon(.03));
  CHECK(t_scale(r, 1e9, 1.0) == doctest::Approx(2).epsilon(.03));  // Student-t with many degrees is Gaussian
  for (std::size_t i = 0; i < r.size(); i += 5) r[i] += 1000;
  a = r;
  CHECK(mad_scale_in_place(a) < 3);
  CHECK(t_scale(r, 5.0, 2.0) < 0.5 * std::sqrt(.2 * 1e6));  // softer than MAD, harder than the standard deviation
}

TEST_CASE("t scale is a fixed point and does not depend on the unit") {
  std::mt19937 rng(3);
  std::student_t_distribution<double> t5(5);
  std::vector<double> r(20000), r1000(20000);
  for (std::size_t i = 0; i < r.size(); ++i) r[i] = t5(rng), r1000[i] = 1000 * r[i];
  CHECK(t_scale(r, 5.0, 1.0) == doctest::Approx(1).epsilon(.03));
  CHECK(t_scale(r1000, 5.0, 1000.0) == doctest::Approx(1000 * t_scale(r, 5.0, 1.0)));
}

TEST_CASE("bivariate scale finds the correlation") {
  std::mt19937 rng(3);
  std::normal_distribution<double> g;
  std::vector<double> a(20000), b(20000);
  for (std::size_t i = 0; i < a.size(); ++i) a[i] = g(rng), b[i] = 3 * (.6 * a[i] + .8 * g(rng));
  const Eigen::Matrix2d s = bivariate_t_scale(a, b);
  CHECK(s(0, 1) / std::sqrt(s(0, 0) * s(1, 1)) == doctest::Approx(.6).epsilon(.05));
  CHECK(std::sqrt(s(1, 1) / s(0, 0)) == doctest::Approx(3).epsilon(.05));
  CHECK(s(1, 0) == s(0, 1));
  // Student-t with five degrees of freedom, of Gaussian numbers: a little less than their variance
  CHECK(s(0, 0) > 0.6);
  CHECK(s(0, 0) < 1);
}

TEST_CASE("the median of floats is the one that sorting finds") {
  std::mt19937 rng(5);
  std::normal_distribution<float> gauss;
  for (std::size_t n = 1; n < 200; ++n) {
    CAPTURE(n);
    for (int kind = 0; kind < 4; ++kind) {
      std::vector<float> v(n);
      for (float& x : v) {
        const float g = gauss(rng);
        x = kind == 0 ? g : (kind == 1 ? std::round(2 * g) : (kind == 2 ? std::exp(40 * g) : -std::abs(g)));
      }
      if (kind == 1) v[n / 3] = -0.0F;
      std::vector<float> sorted = v;
      std::sort(sorted.begin(), sorted.end());
      CHECK(upper_median(v) == sorted[n / 2]);
    }
  }
  std::vector<float> far{-std::numeric_limits<float>::infinity(), std::numeric_limits<float>::max(), 0.0F,
                         std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::max()};
  CHECK(upper_median(far) == 0.0F);
}

TEST_CASE("nothing in, nothing out") {
  std::vector<float> none;
  CHECK(mad_scale_in_place(none) == 0);
  CHECK(mean_abs(none) == 0);
  CHECK(t_scale(none, 5.0, 1.0) == 0);
}
