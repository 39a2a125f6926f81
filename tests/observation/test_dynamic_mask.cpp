// What is asked of masks: area ratio, widening, combination, taking in the masks of others.
#include <doctest/doctest.h>

#include <limits>
#include <vector>

#include <apso/observation/dynamic_mask.hpp>

namespace {
using namespace apso;

TEST_CASE("dynamic_ratio is the mean probability") {
  DynamicMask m;
  CHECK(dynamic_ratio(m) == 0.0);
  set_unknown(8, 4, m);
  CHECK(dynamic_ratio(m) == 0.0);
  CHECK(known_ratio(m) == 0.0);
  for (int y = 0; y < 4; ++y)
    for (int x = 4; x < 8; ++x) m.probability(x, y) = 1.0F;
  CHECK(dynamic_ratio(m) == doctest::Approx(0.5));
  m.probability(0, 0) = 0.5F;  // unknown pixels count with their value
  CHECK(dynamic_ratio(m) == doctest::Approx(16.5 / 32));
  m.probability(0, 0) = std::numeric_limits<float>::quiet_NaN();
  CHECK(dynamic_ratio(m) == doctest::Approx(0.5));
}

TEST_CASE("dilate equals the maximum over the square, for every radius") {
  for (int radius : {0, 1, 2, 3, 7, 30}) {
    Image<float> a(23, 17, 0.0F);
    unsigned state = 7;
    for (std::size_t i = 0; i < a.size(); ++i) {
      state = state * 1664525U + 1013904223U;
      a.data()[i] = static_cast<float>(state >> 8) / 16777216.0F;
    }
    Image<float> d = a;
    std::vector<float> scratch;
    dilate(d, radius, scratch);
    bool equal = true;
    for (int y = 0; y < a.height(); ++y) {
      for (int x = 0; x < a.width(); ++x) {
        float m = 0;
        for (int j = std::max(0, y - radius); j <= std::min(a.height() - 1, y + radius); ++j)
          for (int i = std::max(0, x - radius); i <= std::min(a.width() - 1, x + radius); ++i) m = std::max(m, a(i, j));
        equal = equal && d(x, y) == m;
      }
    }
    CAPTURE(radius);
    CHECK(equal);
  }
  Image<float> a(3, 3, 0.0F);
  std::vector<float> scratch;
  CHECK_THROWS_AS(dilate(a, -1, scratch), contract_error);
}

TEST_CASE("combine: both know, one knows, none knows") {
  DynamicMask a;
  DynamicMask b;
  set_unknown(4, 1, a);
  set_unknown(4, 1, b);
  for (int x = 0; x < 4; ++x) {
    a.probability(x, 0) = 0.5F;
    b.probability(x, 0) = 0.8F;
    a.known(x, 0) = x == 0 || x == 1 ? 1 : 0;
    b.known(x, 0) = x == 0 || x == 2 ? 1 : 0;
  }
  DynamicMask u = a;
  combine(b, MaskCombination::Union, u);
  CHECK(u.probability(0, 0) == doctest::Approx(0.9));
  CHECK(u.probability(1, 0) == doctest::Approx(0.5));
  CHECK(u.probability(2, 0) == doctest::Approx(0.8));
  CHECK(u.probability(3, 0) == doctest::Approx(0.8));
  CHECK(u.known(2, 0) == 1);
  CHECK(u.known(3, 0) == 0);
  DynamicMask p = a;
  combine(b, MaskCombination::Product, p);
  CHECK(p.probability(0, 0) == doctest::Approx(0.4));
  CHECK(p.probability(3, 0) == doctest::Approx(0.5));
  DynamicMask wrong;
  set_unknown(3, 1, wrong);
  CHECK_THROWS_AS(combine(wrong, MaskCombination::Union, u), contract_error);
}

TEST_CASE("masks of networks: nonzero is dynamic") {
  Image<std::uint8_t> labels(4, 2, 0);
  labels(1, 0) = 255;
  labels(2, 1) = 1;
  DynamicMask m;
  mask_from_labels(labels, m);
  CHECK(dynamic_ratio(m) == doctest::Approx(0.25));
  CHECK(known_ratio(m) == 1.0);
}

TEST_CASE("masks of detections: motion before score, mask before box") {
  Detection box;
  box.box = {2, 1, 4, 2};
  box.score = 0.9F;
  DynamicMask m;
  mask_from_detections({box}, 10, 5, false, m);
  CHECK(dynamic_ratio(m) == doctest::Approx(8 * 0.9 / 50));
  CHECK(known_ratio(m) == doctest::Approx(8.0 / 50));
  box.motion_probability = 0.25F;
  mask_from_detections({box}, 10, 5, true, m);
  CHECK(dynamic_ratio(m) == doctest::Approx(8 * 0.25 / 50));
  CHECK(known_ratio(m) == 1.0);
  Image<std::uint8_t> one(10, 5, 0);
  one(9, 4) = 255;
  box.mask = one;
  mask_from_detections({box}, 10, 5, true, m);
  CHECK(dynamic_ratio(m) == doctest::Approx(0.25 / 50));
  box.movable = false;
  mask_from_detections({box}, 10, 5, true, m);
  CHECK(dynamic_ratio(m) == 0.0);
  box.movable = true;
  box.mask = {};
  box.box = {-100, -100, 1000, 1000};  // boxes may leave the image
  mask_from_detections({box}, 10, 5, true, m);
  CHECK(dynamic_ratio(m) == doctest::Approx(0.25));
}

}  // namespace
