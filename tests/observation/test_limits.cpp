// What is too much: brackets, objects, coordinates.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <apso/observation/geometry/low_res_depth.hpp>
#include <apso/observation/objects/object_tracker.hpp>
#include <apso/observation/policy_expression.hpp>

using namespace apso;

namespace {
std::string error_of(const std::string& expression) {
  const PolicyTable table{{"none", [] { return NoMotion{}; }}, {"around", [](AnyMotionPolicy inner) { return inner; }}};
  try {
    static_cast<void>(parse_policy(expression, table));
  } catch (const contract_error& e) {
    return e.what();
  }
  return {};
}
std::string repeated(const std::string& text, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) all += text;
  return all;
}
// Boxes all over an image of 640 x 480, with scores in no order.
std::vector<Detection> boxes(int count, unsigned seed) {
  std::mt19937 rng(seed);
  std::vector<Detection> all(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i].box = {static_cast<float>(rng() % 600), static_cast<float>(rng() % 440), 40, 40};
    all[i].score = static_cast<float>((i * 7919) % all.size()) / static_cast<float>(all.size());
  }
  return all;
}
}  // namespace

TEST_CASE("an expression of a hundred names and brackets is read, a longer one is refused before the stack ends") {
  CHECK(error_of(repeated("(", 99) + "none" + repeated(")", 99)).empty());
  CHECK(error_of(repeated("none | ", 99) + "none").empty());
  const std::string limit = "more than 100 names and brackets";
  CHECK(error_of(repeated("(", 100) + "none" + repeated(")", 100)).find(limit) != std::string::npos);
  for (const std::string& huge : {repeated("(", 20000), repeated("(", 20000) + "none" + repeated(")", 20000), repeated("around(", 20000),
                                  repeated("none * ", 20000) + "none", repeated("none | ", 20000) + "none", repeated("none & (", 20000)}) {
    const std::string error = error_of(huge);
    CHECK(error.find(limit) != std::string::npos);
    CHECK(error.size() < 300);  // quotes the beginning only
  }
}

TEST_CASE("an expression with control characters is quoted without them") {
  const std::string error = error_of("none \x1b[31m");
  CHECK(error.find('\x1b') == std::string::npos);
  CHECK(error.find("\\x1b[31m") != std::string::npos);
}

TEST_CASE("of ten thousand detections the three hundred with the highest scores count, in their order") {
  std::vector<Detection> all = boxes(10000, 1);
  for (std::size_t i = 0; i < 20; ++i) all[500 * i].score = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t i = 0; i < all.size(); ++i) all[i].class_id = static_cast<int>(i);
  std::vector<float> scores;
  for (const Detection& d : all) {
    if (d.score == d.score) scores.push_back(d.score);
  }
  std::sort(scores.rbegin(), scores.rend());
  keep_strongest(all);
  REQUIRE(all.size() == 300);
  int before = -1;
  for (const Detection& d : all) {
    CHECK(d.score >= scores[299]);
    CHECK(d.class_id > before);
    before = d.class_id;
  }
  std::vector<Detection> equal(1000);
  for (std::size_t i = 0; i < equal.size(); ++i) equal[i].class_id = static_cast<int>(i);
  keep_strongest(equal);
  REQUIRE(equal.size() == 300);
  CHECK(equal.front().class_id == 0);
  CHECK(equal.back().class_id == 299);
  equal.resize(299);
  keep_strongest(equal);
  CHECK(equal.size() == 299);
}

TEST_CASE("ten thousand detections in each frame: the tracker follows the strongest and forgets the oldest of the others") {
  ObjectTracker tracker;
  DynamicMask mask;
  set_unknown(640, 480, mask);
  const std::vector<Detection> first = boxes(10000, 1);
  std::set<int> ids;
  for (const Detection& d : tracker.update(mask, none, first)) ids.insert(d.track_id);
  CHECK(ids.size() == 300);
  for (const Detection& d : tracker.update(mask, none, first)) CHECK(ids.count(d.track_id) == 1);  // recognised one by one
  for (unsigned frame = 0; frame < 6; ++frame) CHECK(tracker.update(mask, none, boxes(10000, 10 + frame)).size() == 300);
}

TEST_CASE("a mask of countless regions gives at most three hundred objects") {
  DynamicMask mask;
  set_unknown(1600, 1200, mask);
  for (int y = 0; y < 1200; ++y) {
    for (int x = 0; x < 1600; ++x) {
      mask.known(x, y) = 1;
      mask.probability(x, y) = x % 40 < 32 && y % 40 < 32 ? 1.0F : 0.0F;  // 40 x 30 regions of 1024 px
    }
  }
  ObjectTracker tracker;
  CHECK(tracker.update(mask, none).size() == 300);
  CHECK(tracker.update(mask, none).size() == 300);
}

TEST_CASE("the small pixel of a point is the one that covers it, and coordinates beyond any integer are outside") {
  std::mt19937 rng(5);
  std::vector<float> values{0.0F,
                            -0.0F,
                            -0.5F,
                            -0.500001F,
                            0.49F,
                            1e10F,
                            -1e10F,
                            3.4e38F,
                            -3.4e38F,
                            2147483647.0F,
                            2147483648.0F,
                            -2147483649.0F,
                            4294967296.0F,
                            9.3e18F,
                            std::numeric_limits<float>::infinity(),
                            -std::numeric_limits<float>::infinity(),
                            std::numeric_limits<float>::quiet_NaN(),
                            std::numeric_limits<float>::denorm_min()};
  const auto random_value = [&](int size) {
    if (rng() % 3 == 0) return values[rng() % values.size()];
    return static_cast<float>(static_cast<int>(rng() % static_cast<unsigned>(4 * size + 64)) - size) * 0.5F + 0.25F;
  };
  int inside = 0;
  for (int i = 0; i < 200000; ++i) {
    const int factor = 1 + static_cast<int>(rng() % 16);
    const int width = 1 + static_cast<int>(rng() % 300);
    const int height = 1 + static_cast<int>(rng() % 300);
    const float x = random_value(width * factor);
    const float y = random_value(height * factor);
    // pixel centres are at integers: the small pixel u covers [u factor - 1/2, (u + 1) factor - 1/2)
    const double u = std::floor((static_cast<double>(x) + 0.5) / factor);
    const double v = std::floor((static_cast<double>(y) + 0.5) / factor);
    const bool covered = u >= 0 && u < width && v >= 0 && v < height;
    const int expected = covered ? static_cast<int>(v) * width + static_cast<int>(u) : -1;
    const int found = small_pixel(x, y, factor, width, height);
    if (found == expected) {
      inside += covered ? 1 : 0;
      continue;
    }
    CAPTURE(x);
    CAPTURE(y);
    CAPTURE(factor);
    CHECK(found == expected);
  }
  CHECK(inside > 10000);
  // the largest image whose pixels an int can count
  CHECK(small_pixel(46339.0F, 46339.0F, 1, 46340, 46340) == 46340 * 46340 - 1);
}
