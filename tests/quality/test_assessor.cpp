// The assessor over scripted sequences.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <apso/quality/assessor.hpp>
#include <apso/quality/explain.hpp>

using namespace apso;
using doctest::Approx;

namespace {
/// A camera that stands before a wall with 960 strong keypoints, each of which is tracked for ever.
struct Scene {
  Pinhole camera{525, 525, 319.5, 239.5, 640, 480};
  Image<float> intensity{640, 480, 0.5F};
  Image<float> depth{640, 480, 2.F};
  Image<float> mask;
  std::vector<Keypoint> keypoints;
  std::vector<PointTrack> tracks;
  std::vector<Detection> objects;
  AssessmentInput in;
  double t = 0;

  Scene() {
    for (int y = 0; y < 24; ++y) {
      for (int x = 0; x < 40; ++x) {
        const float u = 8.F + 16.F * static_cast<float>(x);
        const float v = 10.F + 20.F * static_cast<float>(y);
        keypoints.push_back({u, v, 30, 0, 0});
        tracks.push_back({y * 40 + x, u, v, u, v, 5});
      }
    }
  }
  AssessmentInput& input() {
    t += 1.0 / 30;
    in.frame = {t, intensity, depth};
    in.dynamic_probability = mask;
    in.keypoints = &keypoints;
    in.tracks = &tracks;
    in.objects = &objects;
    return in;
  }
  void new_tracks() {
    for (auto& k : tracks) k.id += 1000;
  }
};
double measurement(const Assessment& a, const std::string& wanted) {
  double found = std::numeric_limits<double>::quiet_NaN();
  for_each_measurement(a, [&](const std::string& name, double v) {
    if (name == wanted) found = v;
  });
  return found;
}
}  // namespace

TEST_CASE("the mean of an image is that of its pixels") {
  Image<float> image(4, 3, 0.F);
  for (int y = 0; y < 3; ++y) image(0, y) = 1.F;  // a row that went on would meet the next one's
  std::vector<float> scratch;
  CHECK(mean_of(image, scratch) == Approx(.25));
  CHECK(mean_of(Image<float>(), scratch) == 0);
}

TEST_CASE("a good start commits at the thirtieth frame and is GOOD from then on") {
  Scene s;
  SceneAssessor assessor(s.camera);
  for (int n = 1; n <= 30; ++n) {
    const Assessment& a = assessor.assess(s.input());
    CHECK(a.state == SceneState::Initialising);
    CHECK(a.benchmark_updated == (n == 30));
    CHECK(a.S_change.has_value() == (n > 1));  // nothing to compare the first frame with
  }
  const Assessment& a = assessor.assess(s.input());
  CHECK(a.state == SceneState::Good);
  CHECK_FALSE(a.degraded);
  CHECK(a.S_change->value() == Approx(0));
  CHECK(a.S_final->value() > .9);
  CHECK(a.result<MotionChange>().measured.tracks == 960);
  CHECK(a.W_base + a.W_change == Approx(1));
  CHECK(a.scenario_static);
  CHECK(std::string(to_string(a.state)) == "GOOD");
  assessor.reset();
  CHECK(assessor.assess(s.input()).state == SceneState::Initialising);
}

TEST_CASE("a start without features ends degraded at frame 150") {
  Scene s;
  s.keypoints.clear();
  s.depth = Image<float>(640, 480, 0.F);
  SceneAssessor assessor(s.camera);
  for (int n = 1; n <= 149; ++n) CHECK_FALSE(assessor.assess(s.input()).benchmark_updated);
  CHECK(assessor.assess(s.input()).degraded);
  CHECK(assessor.assessment().th_s == Approx(.45));
  CHECK(assessor.assess(s.input()).state == SceneState::Bad);
  CHECK(assessor.assessment().degraded);
}

TEST_CASE("the restart policy searches anew") {
  Scene s;
  s.keypoints.clear();
  AssessorOptions o;
  o.initialisation.timeout = InitialTimeout::Restart;
  s.depth = Image<float>(640, 480, 0.F);
  SceneAssessor assessor(s.camera, o);
  for (int n = 1; n <= 149; ++n) CHECK_FALSE(assessor.assess(s.input()).initialisation_failed);
  CHECK(assessor.assess(s.input()).initialisation_failed);
  CHECK(assessor.assess(s.input()).state == SceneState::Initialising);
}

TEST_CASE("blank images are BAD, also with perfect depth and tracks") {
  Scene s;
  SceneAssessor assessor(s.camera);
  for (int n = 1; n <= 31; ++n) assessor.assess(s.input());
  Scene blank;
  blank.t = s.t;
  blank.keypoints.clear();
  blank.tracks.clear();
  const Assessment& a = assessor.assess(blank.input());
  CHECK(a.get<Feature>()->value() == 0);
  CHECK(a.state == SceneState::Bad);
  CHECK_FALSE(a.benchmark_updated);
  CHECK(explain(a).find("0 static keypoints") != std::string::npos);
  CHECK(assessor.assess(s.input()).state == SceneState::Good);  // s went on in time by one frame
}

TEST_CASE("the score to beat decays, so an equal frame replaces the reference one frame later") {
  Scene s;
  SceneAssessor assessor(s.camera);
  for (int n = 1; n <= 30; ++n) assessor.assess(s.input());
  CHECK(assessor.assess(s.input()).benchmark_updated);

  AssessorOptions o;  // the ratchet as printed never lets go, and is never too old
  o.benchmark.half_life = std::numeric_limits<double>::infinity();
  o.benchmark.max_age = std::numeric_limits<double>::infinity();
  o.benchmark.hand_over = false;
  Scene p;
  SceneAssessor ratchet(p.camera, o);
  for (int n = 1; n <= 30; ++n) ratchet.assess(p.input());
  for (int n = 31; n <= 600; ++n) CHECK_FALSE(ratchet.assess(p.input()).benchmark_updated);
  CHECK(ratchet.assessment().benchmark_age == Approx(599. / 30));
}

TEST_CASE("Benchmark: the number alone, as printed") {
  BenchmarkOptions o;
  o.update = BenchmarkUpdate::NumberOnly;
  o.half_life = std::numeric_limits<double>::infinity();
  Benchmark<> b(o);
  b.set({0, Quality(.6)});
  CHECK_FALSE(b.update({1, Quality(.5)}, true, {}, 1, 0));
  CHECK_FALSE(b.update({2, Quality(.8)}, false, {}, 1, 0));  // beats it, but is BAD
  CHECK(b.update({3, Quality(.7)}, true, {}, 1, 0));
  CHECK(b.S_reference().value() == .7);
  CHECK(b.score_to_beat(99) == .7);
  CHECK(b.reference().timestamp == 0);
  CHECK(b.reference().S_total.value() == .6);
  // neither age nor lost sight nor a steady camera replaces the frame
  for (int i = 4; i < 40; ++i) CHECK_FALSE(b.update({static_cast<double>(i), Quality(.65)}, true, Deviation(.9), 0, 99));
  CHECK(b.reference().timestamp == 0);
}

TEST_CASE("Benchmark: decay, age, overlap, hand-over") {
  BenchmarkOptions o;
  o.half_life = 1e9;
  ScoredFrame f;
  f.S_total = Quality(.9);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const MaybeDeviation near(Deviation(.1));
  const MaybeDeviation far(Deviation(.9));
  Benchmark<> b(o);
  b.set(f);
  f.S_total = Quality(.7);
  f.timestamp = 9;
  CHECK_FALSE(b.update(f, true, near, nan, 9));
  f.timestamp = 9.5;
  f.S_total = Quality(.8);
  CHECK_FALSE(b.update(f, true, {}, nan, 9));
  f.timestamp = 10.1;
  f.S_total = Quality(.6);
  CHECK(b.update(f, true, near, nan, 9));  // too old: the best of the last two seconds follows
  CHECK(b.reference().timestamp == 9.5);
  CHECK(b.reference().S_total.value() == .8);

  for (int i = 1; i <= 8; ++i) {  // out of sight, but no GOOD frame is left and the scene is not steady
    f.timestamp = 10.1 + i;
    CHECK_FALSE(b.update(f, false, far, .1, kSteadyFrames - 1));
  }
  b.reset();
  f.timestamp = 0;
  f.S_total = Quality(.9);
  b.set(f);
  f.S_total = Quality(.7);
  for (int i = 1; i <= 5; ++i) {
    f.timestamp = i;
    CHECK(b.update(f, false, near, .1, 9) == (i == 5));  // BAD for another reason, and out of sight
  }
  b.set(f);
  CHECK(b.update(f, false, far, 1, kSteadyFrames));  // turned away smoothly
  b.reset();
  CHECK_FALSE(b.present());
  o.half_life = 1;
  o.hand_over = false;
  Benchmark<> d(o);
  f.timestamp = 0;
  f.S_total = Quality(.8);
  d.set(f);
  CHECK(d.score_to_beat(2) == Approx(.2));
  for (int i = 1; i <= 9; ++i) CHECK_FALSE(d.update(f, false, far, .1, 99));
}

namespace {
/// Before a wall of strong keypoints and uneven depth the camera turns right, `step` pixels per frame; what leaves on
/// the left comes in anew on the right. People cover the share `dynamic` of the image.
struct TurningScene : Scene {
  int at = 0;
  std::vector<PointTrack> all = tracks;
  explicit TurningScene(int people = 0) : mask_of_people(640, 480, 0.F) {
    for (int y = 0; y < 480; ++y)
      for (int x = 640 - people; x < 640; ++x) mask_of_people(x, y) = 1.F;
  }
  AssessmentInput& turn(int step, double quality = 1) {
    at += step;
    for (PointTrack& k : all) {
      k.x -= static_cast<float>(step);
      while (k.x < 0) {
        k.x += 640;
        k.id += 10000;
      }
    }
    const auto kept = static_cast<std::ptrdiff_t>(quality * static_cast<double>(all.size()));
    tracks.assign(all.begin(), all.begin() + kept);
    keypoints.clear();
    for (const PointTrack& k : tracks) keypoints.push_back({k.x, k.y, 30, 0, 0});
    for (int y = 0; y < 480; ++y)
      for (int x = 0; x < 640; ++x) depth(x, y) = 2.F + static_cast<float>(std::sin(0.01 * (x + at)));
    mask = mask_of_people;
    input().dynamic_ratio = static_cast<double>(mask_ratio());
    return in;
  }
  [[nodiscard]] double mask_ratio() const {
    double n = 0;
    for (int x = 0; x < 640; ++x) n += static_cast<double>(mask_of_people(x, 0));
    return n / 640;
  }
  Image<float> mask_of_people;
};
}  // namespace

TEST_CASE("a turning camera does not lock itself in BAD") {
  for (const int people : {0, 240}) {  // 0 and 37 % of the image: a static and a dynamic scene
    CAPTURE(people);
    const auto bad_frames = [&](bool hand_over) {
      AssessorOptions o;
      o.benchmark.hand_over = hand_over;
      TurningScene s(people);
      SceneAssessor assessor(s.camera, o);
      for (int n = 0; n < 40; ++n) assessor.assess(s.turn(0));
      CHECK(assessor.assessment().state == SceneState::Good);
      int bad = 0;
      for (int n = 0; n < 300; ++n) {
        // never as good again as at first: only the decay of the score to beat and the hand-over replace references
        const double quality = n < 10 ? 1.0 : 0.6;
        bad += assessor.assess(s.turn(13, quality)).state == SceneState::Bad;
      }
      return bad;
    };
    CHECK(bad_frames(true) <= 3);  // 1 %
    if (people > 0) CHECK(bad_frames(false) > 30);
  }
}

TEST_CASE("hand-over does not excuse what is truly bad") {
  const auto prepared = [](TurningScene& s) {
    SceneAssessor assessor(s.camera);
    for (int n = 0; n < 40; ++n) assessor.assess(s.turn(0));
    return assessor;
  };
  SUBCASE("hardly any keypoints left, however smooth the motion") {
    TurningScene s;
    SceneAssessor assessor = prepared(s);
    for (int n = 0; n < 60; ++n) {
      assessor.assess(s.turn(5, 0.05));
      CHECK(assessor.assessment().state == SceneState::Bad);
      CHECK_FALSE(assessor.assessment().benchmark_updated);
    }
  }
  SUBCASE("every track is lost in every frame") {
    TurningScene s;
    SceneAssessor assessor = prepared(s);
    for (int n = 0; n < 60; ++n) {
      for (auto& k : s.all) k.id += 10000000;
      CHECK(assessor.assess(s.turn(120)).steady_frames == 0);
    }
  }
  SUBCASE("people fill most of the image") {
    TurningScene s;
    SceneAssessor assessor = prepared(s);
    for (int x = 100; x < 640; ++x)
      for (int y = 0; y < 480; ++y) s.mask_of_people(x, y) = 1.F;
    for (auto& k : s.all) k.id += 10000000;
    for (int n = 0; n < 60; ++n) CHECK(assessor.assess(s.turn(0)).steady_frames == 0);
  }
  SUBCASE("the tracker has no pose") {
    TurningScene s;
    SceneAssessor assessor = prepared(s);
    for (int n = 0; n < 20; ++n) {
      s.turn(20).feature_tracking_ok = false;
      assessor.assess(s.in);
      CHECK_FALSE(assessor.assessment().benchmark_updated);
    }
  }
}

TEST_CASE("a crowd makes the scene dynamic and BAD, and GOOD again when it has left") {
  Scene s;
  SceneAssessor assessor(s.camera);
  for (int n = 1; n <= 40; ++n) assessor.assess(s.input());
  Scene crowd;
  crowd.t = s.t;
  crowd.mask = Image<float>(640, 480, 0.F);
  for (int y = 0; y < 480; ++y)
    for (int x = 0; x < 400; ++x) crowd.mask(x, y) = 1.F;
  crowd.objects.resize(2);
  crowd.objects[0].box = {0, 0, 200, 480};
  crowd.objects[1].box = {200, 0, 200, 480};
  crowd.objects[0].score = crowd.objects[1].score = .5F;
  for (auto& k : crowd.tracks) k.id += 5000;
  for (int n = 0; n < 10; ++n) {
    AssessmentInput& in = crowd.input();
    in.dynamic_ratio = .625;
    const Assessment& a = assessor.assess(in);
    CHECK(a.scenario_dynamic);
    CHECK(a.W_base == Approx(.075));
    CHECK(a.state == SceneState::Bad);
    CHECK_FALSE(a.benchmark_updated);
    CHECK(explain(a).find("dynamic") != std::string::npos);
  }
  s.t = crowd.t;
  CHECK(assessor.assess(s.input()).state == SceneState::Good);
}

TEST_CASE("a new place is accepted again although its reference is out of sight") {
  Scene s;
  for (auto& k : s.keypoints) k.response = 30;
  SceneAssessor assessor(s.camera);
  for (int n = 1; n <= 35; ++n) assessor.assess(s.input());
  s.new_tracks();
  s.depth = Image<float>(640, 480, 5.5F);
  s.keypoints.resize(480);
  int bad = 0;
  for (int n = 0; n < 60; ++n) bad += assessor.assess(s.input()).state == SceneState::Bad;
  CHECK(bad < 60);
  CHECK(assessor.assessment().state == SceneState::Good);
}

TEST_CASE("without a pose of the tracker the frame is BAD and no reference") {
  Scene s;
  SceneAssessor assessor(s.camera);
  for (int n = 1; n <= 31; ++n) assessor.assess(s.input());
  s.input().feature_tracking_ok = false;
  const Assessment& a = assessor.assess(s.in);
  CHECK(a.state == SceneState::Bad);
  CHECK_FALSE(a.benchmark_updated);
}

TEST_CASE("keypoints that match nothing are worth nothing: without a match no frame is GOOD, however many there are") {
  Scene s;
  SceneAssessor assessor(s.camera);
  for (int n = 1; n <= 31; ++n) assessor.assess(s.input());
  REQUIRE(assessor.assessment().state == SceneState::Good);
  const double before = assessor.assessment().S_total.value();
  s.input().matches = 0;
  CHECK(assessor.assess(s.in).S_total.value() < 0.6 * before);
  CHECK(assessor.assessment().state == SceneState::Bad);
  CHECK(measurement(assessor.assessment(), "S_match") == 0);
  CHECK(explain(assessor.assessment()).find("too few match the map") != std::string::npos);
  for (const int enough : {kEnoughMatches, 500, -1}) {  // -1: the tracker does not tell
    s.input().matches = enough;
    CHECK(assessor.assess(s.in).S_total.value() > 0.99 * before);
    CHECK(assessor.assessment().state == SceneState::Good);
  }
}

TEST_CASE("whatever comes in, no NaN gets out, and the assessor recovers") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  for (const ChangeBaseline baseline : {ChangeBaseline::Reference, ChangeBaseline::Previous}) {
    AssessorOptions o;
    o.change_baseline = baseline;
    Scene s;
    SceneAssessor assessor(s.camera, o);
    for (int n = 0; n < 200; ++n) {
      Scene x;
      x.t = s.t;
      if (n > 40) {
        const float values[] = {nan, inf, -inf, 0.F, 1.F, -1.F, 1e30F};
        const float v = values[n % 7];
        if (n % 2) x.depth = Image<float>(640, 480, v);
        if (n % 3) x.mask = Image<float>(640, 480, v);
        if (n % 5 == 0) x.keypoints.assign(300, {v, 5, v, v, 0});
        if (n % 5 == 1) x.tracks.assign(300, {n, v, v, v, v, 0});
        if (n % 5 == 2) x.keypoints.clear();
        Detection d;
        d.box = {v, 0, v, v};
        d.score = v;
        x.objects.assign(static_cast<std::size_t>(n % 4), d);
      }
      AssessmentInput& in = x.input();
      if (n > 40 && n % 7 == 3) in.dynamic_ratio = std::nan("");
      if (n % 11 == 10) in.frame.depth = {};
      if (n % 13 == 12) in.keypoints = nullptr;
      if (n % 17 == 16) in.tracks = nullptr;
      if (n % 19 == 18) in.objects = nullptr;
      s.t = x.t;
      const Assessment& a = assessor.assess(in);
      CHECK(a.W_base + a.W_change == Approx(1));
      for (const double v : {a.W_base, a.W_change, a.dynamic_ratio, a.th_s, a.th_differ}) CHECK((v >= 0 && v <= 1));
      // what the scores measured is not limited by a type
      CHECK(a.get<DepthChange>().has_value() == std::isfinite(measurement(a, "depth_mean")));
      CHECK(a.get<MotionChange>().has_value() == std::isfinite(measurement(a, "flow")));
      if (a.get<DepthChange>()) CHECK((measurement(a, "depth_mean") >= 0 && measurement(a, "depth_mean") <= 1));
      CHECK(explain(a).find("nan") == std::string::npos);
    }
    Scene fresh;
    SceneAssessor other(fresh.camera, o);
    const double expected = other.assess(fresh.input()).S_total.value();
    for (int n = 0; n < 60; ++n) assessor.assess(s.input());
    CHECK(assessor.assessment().state == SceneState::Good);
    CHECK(assessor.assessment().S_total.value() == expected);
  }
}

TEST_CASE("two runs give the same, and the order of the tracks does not matter") {
  const auto run = [](bool reversed) {
    Scene s;
    SceneAssessor assessor(s.camera);
    std::string log;
    for (int n = 0; n < 80; ++n) {
      Scene x;
      x.t = s.t;
      for (auto& k : x.tracks) {
        k.x += static_cast<float>(n);
        if (k.id % 7 < n % 7) k.id += 10000;
      }
      if (reversed) x.tracks = {x.tracks.rbegin(), x.tracks.rend()};
      const Assessment& a = assessor.assess(x.input());
      s.t = x.t;
      log += explain(a) + std::to_string(a.S_change ? a.S_change->value() : -1.0);
    }
    return log;
  };
  CHECK(run(false) == run(false));
  CHECK(run(false) == run(true));
}

TEST_CASE("scores do not depend on the position of the clock") {
  Scene a;
  Scene b;
  b.t = 1e6;
  SceneAssessor x(a.camera);
  SceneAssessor y(b.camera);
  for (int n = 0; n < 50; ++n) {
    const double p = x.assess(a.input()).S_total.value();
    CHECK(p == y.assess(b.input()).S_total.value());
    CHECK(x.assessment().state == y.assessment().state);
  }
}

TEST_CASE("wrong calls and options are refused by name") {
  Scene s;
  SceneAssessor assessor(s.camera);
  s.depth = Image<float>(320, 240, 2.F);
  CHECK_THROWS_AS(assessor.assess(s.input()), contract_error);
  AssessorOptions o;
  o.decision.th_differ = 1.5;
  CHECK_THROWS_WITH_AS(SceneAssessor(s.camera, o), doctest::Contains("assessor.decision.th_differ"), contract_error);
  o = {};
  o.frame_weights.get<Confidence>() = .5;
  CHECK_THROWS_WITH_AS(SceneAssessor(s.camera, o), doctest::Contains("frame_weights"), contract_error);
  o = {};
  o.initialisation.quality_min = .9;
  CHECK_THROWS_AS(SceneAssessor(s.camera, o), contract_error);
}

TEST_CASE("a feature pose that is no pose counts as failed tracking: BAD, and the explanation says why") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {nan, std::numeric_limits<double>::infinity(), 1e308}) {
    Scene s;
    SceneAssessor assessor(s.camera);
    Pose T = Pose::Identity();
    s.in.T_world_camera = &T;
    for (int n = 1; n <= 40; ++n) assessor.assess(s.input());
    REQUIRE(assessor.assessment().state == SceneState::Good);
    CHECK_FALSE(assessor.assessment().feature_pose_refused);
    T(1, 1) = bad;
    const Assessment& a = assessor.assess(s.input());
    CHECK(a.state == SceneState::Bad);
    CHECK(a.feature_pose_refused);
    CHECK_FALSE(a.feature_tracking_ok);
    CHECK(explain(a).find("the pose of the feature tracker is not finite or no rigid motion") != std::string::npos);
    T = Pose::Identity();
    CHECK(assessor.assess(s.input()).state == SceneState::Good);
    s.in.T_world_camera = nullptr;  // a host that has no pose to tell
    CHECK(assessor.assess(s.input()).state == SceneState::Good);
  }
}

TEST_CASE("a pose that is no pose starts nothing: no reference is made of its frame") {
  Scene s;
  SceneAssessor assessor(s.camera);
  Pose T = Pose::Identity();
  T(0, 3) = std::numeric_limits<double>::quiet_NaN();
  s.in.T_world_camera = &T;
  for (int n = 1; n <= 40; ++n) {
    const Assessment& a = assessor.assess(s.input());
    CHECK(a.state == SceneState::Initialising);
    CHECK(explain(a).find("not finite") != std::string::npos);
  }
}

TEST_CASE("a timestamp that is not finite is refused, and the frames go on") {
  Scene s;
  SceneAssessor assessor(s.camera);
  for (int n = 1; n <= 40; ++n) assessor.assess(s.input());
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    AssessmentInput in = s.input();
    in.frame.timestamp = bad;
    CHECK_THROWS_AS(assessor.assess(in), contract_error);
  }
  CHECK(assessor.assess(s.input()).state == SceneState::Good);
}
