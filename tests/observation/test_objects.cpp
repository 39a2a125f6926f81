// Objects: regions become boxes, detections keep theirs, identities last.
#include <doctest/doctest.h>

#include <apso/observation/objects.hpp>

namespace {
using namespace apso;

void paint(DynamicMask& m, int x0, int y0, int w, int h, float p = 1.0F) {
  for (int y = y0; y < y0 + h; ++y)
    for (int x = x0; x < x0 + w; ++x) m.probability(x, y) = p;
}
DynamicMask blank() {
  DynamicMask m;
  set_unknown(160, 120, m);
  m.known.assign(160, 120, 1);
  return m;
}

TEST_CASE("a region becomes a box with its identity, small ones do not") {
  ObjectTracker tracker;
  int id = -1;
  for (int k = 0; k < 10; ++k) {
    DynamicMask m = blank();
    paint(m, 20 + 4 * k, 40, 40, 60);
    paint(m, 4, 4, 8, 8);
    const auto& o = tracker.update(m, {});
    REQUIRE(o.size() == 1);
    CHECK(iou(o[0].box, Box{static_cast<float>(20 + 4 * k), 40, 40, 60}) == 1.0F);
    CHECK(o[0].class_id == kUnknownClass);
    CHECK(o[0].motion_probability == 1.0F);
    CHECK(o[0].movable);
    if (k == 0) id = o[0].track_id;
    CHECK(o[0].track_id == id);
  }
}

TEST_CASE("an identity survives a short absence and not a long one") {
  ObjectTrackerOptions options;
  options.max_missed = 3;
  ObjectTracker tracker(options);
  DynamicMask seen = blank();
  paint(seen, 20, 40, 40, 60);
  const int id = tracker.update(seen, {})[0].track_id;
  for (int k = 0; k < 3; ++k) CHECK(tracker.update(blank(), {}).empty());
  CHECK(tracker.update(seen, {})[0].track_id == id);
  for (int k = 0; k < 5; ++k) tracker.update(blank(), {});
  CHECK(tracker.update(seen, {})[0].track_id != id);
}

TEST_CASE("touching regions are cut at a step of the depth") {
  ObjectTracker tracker;
  DynamicMask m = blank();
  paint(m, 20, 40, 80, 60);
  Image<float> depth(160, 120, 2.0F);
  for (int y = 0; y < 120; ++y)
    for (int x = 60; x < 160; ++x) depth(x, y) = 3.0F;
  CHECK(tracker.update(m, {}).size() == 1);
  tracker.reset();
  const auto& o = tracker.update(m, depth);
  REQUIRE(o.size() == 2);
  CHECK(o[0].track_id != o[1].track_id);
}

TEST_CASE("a detection takes in its region and learns from the mask whether it moves") {
  ObjectTracker tracker;
  DynamicMask m = blank();
  paint(m, 20, 40, 40, 60);
  Detection person;
  person.box = {16, 36, 48, 68};
  person.score = 0.7F;
  person.class_id = 0;
  Detection resting = person;
  resting.box = {100, 40, 40, 40};
  const auto& o = tracker.update(m, {}, {person, resting});
  REQUIRE(o.size() == 2);
  CHECK(o[0].class_id == 0);
  CHECK(o[0].score == 0.7F);
  CHECK(o[0].motion_probability == doctest::Approx(2400.0 / (48 * 68)).epsilon(0.05));
  CHECK(o[1].motion_probability == 0.0F);
  CHECK(o[0].track_id != o[1].track_id);
}

TEST_CASE("motion of a detection where nothing is known is not known") {
  ObjectTracker tracker;
  DynamicMask m;
  set_unknown(160, 120, m);
  Detection d;
  d.box = {10, 10, 50, 50};
  const auto& o = tracker.update(m, {}, {d});
  REQUIRE(o.size() == 1);
  CHECK(o[0].motion_probability != o[0].motion_probability);
}

}  // namespace
