// Objects: regions become boxes, detections keep theirs, identities last.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include <apso/observation/objects/object_tracker.hpp>

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

/// Two people as upright boxes, painted into mask and depth; b is drawn over a where it is nearer.
struct Crowd {
  DynamicMask mask = blank();
  Image<float> depth{160, 120, 4.0F};
  void person(int x, int width, float z) {
    for (int y = 30; y < 110; ++y) {
      for (int i = std::max(0, x); i < std::min(160, x + width); ++i) {
        if (depth(i, y) < z) continue;
        depth(i, y) = z;
        mask.probability(i, y) = 1.0F;
      }
    }
  }
};
int id_at(const std::vector<Detection>& objects, double x) {
  int best = -1;
  double least = 1e9;
  for (const Detection& d : objects) {
    const double off = std::abs(static_cast<double>(d.box.x + d.box.width / 2) - x);
    if (off < least) {
      least = off;
      best = d.track_id;
    }
  }
  return least < 8 ? best : -1;
}

TEST_CASE("people who touch at the same depth stay two, with their identities") {
  ObjectTracker tracker;
  int left = -1;
  int right = -1;
  for (int k = 0; k < 60; ++k) {
    // they come together, stand shoulder to shoulder, and part again
    const int shift = k < 20 ? k : k < 40 ? 20 : 60 - k;
    Crowd c;
    c.person(25 + shift, 30, 2.0F);
    c.person(105 - shift, 30, 2.02F);
    const auto& o = tracker.update(c.mask, c.depth);
    CAPTURE(k);
    REQUIRE(o.size() == 2);
    const int a = id_at(o, 40 + shift);
    const int b = id_at(o, 120 - shift);
    if (k == 0) {
      left = a;
      right = b;
      REQUIRE(left != right);
    }
    CHECK(a == left);
    CHECK(b == right);
  }
}

TEST_CASE("people who pass each other do not swap identities") {
  for (float near : {1.6F, 2.0F}) {
    CAPTURE(near);
    ObjectTracker tracker;
    int walker = -1;
    int other = -1;
    for (int k = 0; k <= 50; ++k) {
      Crowd c;
      const int x = 5 + 2 * k;    // to the right, behind
      const int y = 115 - 2 * k;  // to the left, in front
      c.person(x, 26, 2.2F);
      c.person(y, 26, near);
      const auto& o = tracker.update(c.mask, c.depth);
      if (k == 0) {
        walker = id_at(o, x + 13);
        other = id_at(o, y + 13);
        REQUIRE(walker != other);
      }
      if (k == 50) {
        CHECK(id_at(o, x + 13) == walker);
        CHECK(id_at(o, y + 13) == other);
        CHECK(o.size() == 2);
      }
    }
  }
}

TEST_CASE("the flow of tracks carries an identity over a jump that boxes alone would lose") {
  for (bool with_tracks : {false, true}) {
    ObjectTracker tracker;
    Crowd before;
    before.person(10, 24, 2.0F);
    const int id = tracker.update(before.mask, before.depth)[0].track_id;
    Crowd after;  // the camera swings: everything moves by 60 px
    after.person(70, 24, 2.0F);
    std::vector<PointTrack> tracks;
    for (int i = 0; i < 8; ++i) {
      const auto x = static_cast<float>(12 + 2 * i);
      tracks.push_back({i, x + 60, 60, x, 60, 4});
    }
    const int now = tracker.update(after.mask, after.depth, {}, with_tracks ? tracks : std::vector<PointTrack>{})[0].track_id;
    CHECK((now == id) == with_tracks);
  }
}

TEST_CASE("a part of an object close to it stays with it, a large one becomes another object") {
  ObjectTracker tracker;
  Crowd whole;
  whole.person(40, 40, 2.0F);
  const int id = tracker.update(whole.mask, whole.depth)[0].track_id;
  Crowd arm = whole;  // an arm is held towards the camera
  for (int y = 50; y < 70; ++y)
    for (int x = 74; x < 100; ++x) {
      arm.depth(x, y) = 1.4F;
      arm.mask.probability(x, y) = 1.0F;
    }
  const auto& one = tracker.update(arm.mask, arm.depth);
  REQUIRE(one.size() <= 2);
  CHECK(one[0].track_id == id);
  ObjectTracker again;
  (void)again.update(whole.mask, whole.depth);
  Crowd parted;
  parted.person(40, 18, 2.0F);
  parted.person(64, 16, 2.0F);
  const auto& two = again.update(parted.mask, parted.depth);
  REQUIRE(two.size() == 2);
  CHECK(two[0].track_id != two[1].track_id);
}

TEST_CASE("a body that is found in parts becomes one object, and stays one") {
  ObjectTracker tracker;
  int id = -1;
  for (int k = 0; k < 30; ++k) {
    Crowd c;
    const int x = 20 + 2 * k;
    c.person(x, 30, 2.0F);
    for (int y = 68; y < 72; ++y)  // at first and at last the waist is missing in the mask
      for (int i = x; i < x + 30; ++i) {
        if (k < 4 || k > 20) c.mask.probability(i, y) = 0.0F;
      }
    const auto& o = tracker.update(c.mask, c.depth);
    CAPTURE(k);
    if (k == 0) {
      REQUIRE(o.size() == 2);
      id = o[0].track_id;
    }
    if (k < 12) continue;
    REQUIRE(o.size() == 1);
    CHECK(o[0].track_id == id);
    CHECK(o[0].box.height == doctest::Approx(80).epsilon(0.06));
  }
}

TEST_CASE("motion probability of an object is smoothed, so one frame does not decide") {
  ObjectTrackerOptions options;
  options.keep = 0.5;
  ObjectTracker tracker(options);
  Detection chair;
  chair.box = {40, 40, 40, 40};
  chair.class_id = 56;
  const double expected[] = {0.0, 0.5, 0.75, 0.375};
  const bool moves[] = {false, true, true, false};
  for (int k = 0; k < 4; ++k) {
    DynamicMask m = blank();
    if (moves[k]) paint(m, 40, 40, 40, 40);
    const auto& o = tracker.update(m, {}, {chair});
    REQUIRE(o.size() == 1);
    CHECK(static_cast<double>(o[0].motion_probability) == doctest::Approx(expected[k]));
  }
}

}  // namespace
