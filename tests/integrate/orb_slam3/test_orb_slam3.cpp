// The integration of docs/integrate/orb_slam3.md, run on synthetic recordings with a double of the host.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <apso/testing/synthetic.hpp>

#include "../../../examples/integrate/orb_slam3/apso_bridge.h"
#include "host.h"

using namespace apso;

namespace {
constexpr int kFrames = 46;
constexpr std::size_t kBad = 40;   // a frame with weak keypoints and a pose that is off
constexpr std::size_t kLost = 43;  // a frame without any pose

struct Recording {
  testing::SyntheticSequence sequence;
  std::vector<testing::SyntheticFrame> frames;
  std::vector<PlayedFrame> played;
  std::vector<HostPoint> map;
  std::vector<HostEdge> edges;

  explicit Recording(const std::string& name, int length = kFrames)
      : sequence(name, options(length)), frames(static_cast<std::size_t>(length)), played(frames.size()) {
    for (std::size_t k = 0; k < frames.size(); ++k) {
      testing::SyntheticFrame& f = frames[k];
      sequence.render(static_cast<int>(k), f);
      PlayedFrame& p = played[k];
      p = {f.timestamp, f.rgb.data(), f.depth.data(), {}, 30.0F, 1, 0, 0, 0, 0, 0, 0, 0};
      play(k, inverse(f.T_world_camera));
    }
  }
  void play(std::size_t k, const Pose& T_camera_world) {
    for (int i = 0; i < 12; ++i) played[k].pose[i] = static_cast<float>(T_camera_world.matrix()(i / 4, i % 4));
  }
  /// The features find the pose, but for so many metres.
  void play_off(std::size_t k, double x) {
    Pose T = inverse(frames[k].T_world_camera);
    T.translation().x() += x;
    play(k, T);
  }
  static testing::SyntheticOptions options(int length) {
    testing::SyntheticOptions o;
    o.width = 320;
    o.height = 240;
    o.frames = length;
    return o;
  }
  void spoil() {  // the frames kBad and kLost
    Twist off;
    off << 0.02, -0.01, 0.01, 0.005, 0.01, -0.005;
    play(kBad, se3_exp(off) * inverse(frames[kBad].T_world_camera));
    played[kBad].response = played[kLost].response = 0;
    played[kLost].ok = 0;
  }
  // most tests: a GOOD frame keeps the pose it is given
  [[nodiscard]] std::vector<HostResult> run(int refine = APSO_REFINE_BAD, bool own_thread = true, double inverse_depth_sigma = 0) {
    std::vector<HostResult> out(frames.size());
    const Pinhole c = sequence.camera();
    map.resize(10000);
    edges.resize(1000);
    HostMap end{map.data(), static_cast<int>(map.size()), 0, edges.data(), static_cast<int>(edges.size()), 0, 0, 0};
    run_host(played.data(), static_cast<int>(frames.size()), static_cast<float>(c.fx), static_cast<float>(c.cx), static_cast<float>(c.cy),
             c.width, c.height, out.data(), &end, {refine, own_thread ? 1 : 0, inverse_depth_sigma});
    CHECK(end.silent == 1);
    CHECK(end.two_parents == 0);
    map.resize(static_cast<std::size_t>(end.points_count));
    edges.resize(static_cast<std::size_t>(end.edges_count));
    return out;
  }
  // distance of the camera from the truth [m]
  [[nodiscard]] double error(const float* pose, std::size_t k) const {
    Pose T = Pose::Identity();
    for (int i = 0; i < 12; ++i) T.matrix()(i / 4, i % 4) = static_cast<double>(pose[i]);
    return (inverse(T).translation() - frames[k].T_world_camera.translation()).norm();
  }
};
}  // namespace

TEST_CASE("a BAD frame gets a better pose and no keyframe, the others keep theirs") {
  Recording recording("static_xyz");
  recording.spoil();
  for (const bool retry : {false, true}) {
    CAPTURE(retry);
    recording.played[kLost].retry = retry ? 1 : 0;
    const std::vector<HostResult> r = recording.run();
    for (std::size_t k = 0; k < kBad; ++k) {
      if (r[k].refined) continue;
      CHECK(recording.error(r[k].pose, k) < 1e-4);  // the pose of the features, to the precision of a float
    }
    const double given = recording.error(recording.played[kBad].pose, kBad);
    CHECK(given > 0.02);
    CHECK(r[kBad].refined == 1);
    CHECK(recording.error(r[kBad].pose, kBad) < given);  // a blend: how far it goes is the refiner's decision
    CHECK(r[kBad].keyframes == r[kBad - 1].keyframes);
    CHECK(r[kBad - 1].keyframes > 30);
    CHECK(r[kBad].retries == 0);
    // without features the direct pose carries the frame, and the tracker is not lost
    CHECK(r[kLost].refined == 1);
    CHECK(r[kLost].tracking == 1);
    CHECK(r[kLost].retries == 1);
    CHECK(recording.error(r[kLost].pose, kLost) < (retry ? 1e-4 : 0.02));
    CHECK(r[kLost].keyframes <= r[kLost - 1].keyframes + (retry ? 1 : 0));
    CHECK(r[kFrames - 1].keyframes > r[kLost].keyframes);  // and it goes on afterwards
    CHECK(std::any_of(r.begin(), r.end(), [](const HostResult& f) { return f.observed_ms > 0; }));
  }
}

TEST_CASE("a BAD frame of which direct alignment sees nothing is held by the prediction") {
  Recording recording("static_xyz");
  testing::SyntheticFrame& dark = recording.frames[kBad];
  dark.depth.assign(dark.depth.width(), dark.depth.height(), 0.0F);
  recording.played[kBad].depth = dark.depth.data();
  recording.played[kBad].response = 0;
  recording.play_off(kBad, .02);
  const double given = recording.error(recording.played[kBad].pose, kBad);
  REQUIRE(given > .015);
  for (const int refine : {APSO_REFINE_EVERY, APSO_REFINE_BAD}) {
    CAPTURE(refine);
    const std::vector<HostResult> r = recording.run(refine);
    CHECK(r[kBad].refined == (refine == APSO_REFINE_EVERY ? 1 : 0));
    CHECK(r[kBad].keyframes == r[kBad - 1].keyframes);
    if (refine == APSO_REFINE_EVERY) CHECK(recording.error(r[kBad].pose, kBad) < given - .001);  // the features are believed as well
    if (refine == APSO_REFINE_BAD) CHECK(recording.error(r[kBad].pose, kBad) == doctest::Approx(given).epsilon(1e-3));
  }
}

TEST_CASE("a BAD frame with few matches may become a keyframe where followed corners confirm its pose") {
  Recording recording("static_xyz");
  recording.played[kBad].response = 0;
  const std::vector<HostResult> many = recording.run(APSO_REFINE_NONE);
  CHECK(many[kBad].keyframes == many[kBad - 1].keyframes);  // BAD, and the map can do without it
  recording.played[kBad].matches = 320;
  const std::vector<HostResult> enough = recording.run(APSO_REFINE_NONE);
  CHECK(enough[kBad].keyframes == enough[kBad - 1].keyframes);
  for (const int matches : {280, 60}) {
    CAPTURE(matches);
    recording.played[kBad].matches = matches;
    const std::vector<HostResult> few = recording.run(APSO_REFINE_NONE);
    CHECK(few[kBad].keyframes == few[kBad - 1].keyframes + 1);
  }
  // not of so few keypoints that the bundle adjustment would move it about
  recording.played[kBad].keypoints = 300;
  const std::vector<HostResult> dark = recording.run(APSO_REFINE_NONE);
  CHECK(dark[kBad].keyframes == dark[kBad - 1].keyframes);
  recording.played[kBad].keypoints = 0;
  // not where the corners say another pose
  recording.play_off(kBad, 0.1);
  const std::vector<HostResult> off = recording.run(APSO_REFINE_NONE);
  CHECK(off[kBad].keyframes == off[kBad - 1].keyframes);
}

TEST_CASE("a few matches that contradict the followed corners are not believed") {
  Recording recording("static_xyz");
  recording.play_off(kBad, 0.3);
  recording.played[kBad].matches = 40;
  const std::vector<HostResult> few = recording.run(APSO_REFINE_NONE);
  CHECK(few[kBad].tracking == 1);
  CHECK(few[kBad].retries == 1);
  CHECK(recording.error(few[kBad].pose, kBad) < 0.01);
  CHECK(few[kFrames - 1].tracking == 1);
  // many that agree with each other are: a place that is found again is far from where it was expected
  recording.played[kBad].matches = 0;
  const std::vector<HostResult> many = recording.run(APSO_REFINE_NONE);
  CHECK(recording.error(many[kBad].pose, kBad) == doctest::Approx(0.3).epsilon(1e-3));
}

TEST_CASE("after frames whose pose did not come from the map, a few matches that no corners confirm are not believed for five frames") {
  Recording recording("static_xyz");
  constexpr std::size_t kFirst = 20;  // without features: the corners carry 15 frames, and some have no pose
  constexpr std::size_t kFound = 38;
  for (std::size_t k = kFirst; k < kFound; ++k) recording.played[k].ok = 0;
  for (std::size_t k = kFound; k < kFrames; ++k) {
    recording.play_off(k, 0.3);
    recording.played[k].matches = 40;
  }
  const std::vector<HostResult> few = recording.run(APSO_REFINE_NONE);
  REQUIRE(few[kFirst - 1].tracking == 1);
  for (std::size_t k = kFound - 1; k < kFound + 5; ++k) CHECK(few[k].tracking == 0);
  CHECK(few[kFound + 5].tracking == 1);
  CHECK(recording.error(few[kFound + 5].pose, kFound + 5) == doctest::Approx(0.3).epsilon(1e-3));
  // many are believed at once, and what comes after them
  recording.played[kFound].matches = 0;
  const std::vector<HostResult> many = recording.run(APSO_REFINE_NONE);
  for (std::size_t k = kFound; k < kFrames; ++k) CHECK(many[k].tracking == 1);
}

TEST_CASE("without features and direct pose the followed corners carry the frame, and the map points are looked for from there") {
  Recording recording("static_xyz");
  recording.played[kLost].ok = 0;
  for (const bool retry : {false, true}) {
    CAPTURE(retry);
    recording.played[kLost].retry = retry ? 1 : 0;
    const std::vector<HostResult> r = recording.run(APSO_REFINE_NONE);
    CHECK(r[kLost].refined == 0);
    CHECK(r[kLost].tracking == 1);
    CHECK(r[kLost].retries == 1);
    CHECK(recording.error(r[kLost].pose, kLost) < (retry ? 1e-4 : 0.01));
    CHECK(r[kLost].keyframes == r[kLost - 1].keyframes + (retry ? 1 : 0));  // the map learns from it where the points agree
    CHECK(r[kFrames - 1].tracking == 1);
  }
  // errors of corners add up: 15 frames in a row at most
  constexpr std::size_t kFirst = 20;
  for (std::size_t k = kFirst; k < kFrames; ++k) recording.played[k].ok = recording.played[k].retry = 0;
  const std::vector<HostResult> r = recording.run(APSO_REFINE_NONE);
  CHECK(r[kFirst + 14].tracking == 1);
  CHECK(recording.error(r[kFirst + 14].pose, kFirst + 14) < 0.08);
  CHECK(r[kFirst + 15].tracking == 0);
}

TEST_CASE("where few points are found again from a sure direct pose, it stays") {
  Recording recording("static_xyz");
  recording.play_off(kLost, 0.02);
  recording.played[kLost].ok = 0;
  recording.played[kLost].retry = 1;
  recording.played[kLost].matches = 40;
  const std::vector<HostResult> few = recording.run();
  CHECK(few[kLost].retries == 1);
  CHECK(recording.error(few[kLost].pose, kLost) < 0.005);
  recording.played[kLost].matches = 0;  // all of them
  const std::vector<HostResult> many = recording.run();
  CHECK(recording.error(many[kLost].pose, kLost) == doctest::Approx(0.02).epsilon(0.01));
}

TEST_CASE("a map that the back end moves takes the memory along, a new map begins anew") {
  Recording recording("static_xyz");
  recording.spoil();
  recording.played[30].map_shift = 0.7F;
  recording.played[kLost].map_shift = -2;
  const std::vector<HostResult> r = recording.run();
  CHECK(r[kBad].refined == 1);
  CHECK(recording.error(r[kBad].pose, kBad) < recording.error(recording.played[kBad].pose, kBad));
  CHECK(r[kLost].refined == 1);
  CHECK(recording.error(r[kLost].pose, kLost) < 0.02);

  recording.played[kBad].new_map = 1;
  CHECK(recording.run()[kBad].refined == 0);
}

TEST_CASE(
    "odometry edges join keyframes that follow each other, by the motion that was measured; none crosses a gap or a step of the map") {
  Recording recording("static_xyz");
  constexpr std::size_t kShift = 12;
  constexpr std::size_t kFirst = 22;  // without features: the corners carry 15 frames, the rest has no pose
  constexpr std::size_t kLast = 38;
  recording.played[kShift].map_shift = 0.7F;
  for (std::size_t k = kFirst; k <= kLast; ++k) recording.played[k].ok = 0;
  const std::vector<HostResult> r = recording.run(APSO_REFINE_NONE);
  REQUIRE(r[kLast].tracking == 0);
  REQUIRE(r.back().tracking == 1);
  int parts[3] = {0, 0, 0};  // edges before the step, before the gap and after it
  int apart[3] = {0, 0, 0};  // edges whose keyframes are so many numbers apart
  for (const HostEdge& e : recording.edges) {
    const int between = e.keyframes[1] - e.keyframes[0];
    REQUIRE(between >= 1);
    REQUIRE(between <= 2);
    ++apart[between];
    const auto a = static_cast<std::size_t>(e.frames[0]);
    const auto b = static_cast<std::size_t>(e.frames[1]);
    CHECK(a < b);
    const auto part = [](std::size_t k) { return k < kShift ? 0 : k < kFirst ? 1 : 2; };
    CHECK(part(a) == part(b));
    CHECK_FALSE((a >= kFirst && a <= kLast));
    ++parts[part(a)];
    CHECK(e.sigma == doctest::Approx(0.001 * std::sqrt(between)));
    const Pose T_b_a = inverse(recording.frames[b].T_world_camera) * recording.frames[a].T_world_camera;
    for (int i = 0; i < 12; ++i) CHECK(static_cast<double>(e.measured[i]) == doctest::Approx(T_b_a.matrix()(i / 4, i % 4)).epsilon(1e-3));
  }
  for (const int n : parts) CHECK(n >= 3);
  CHECK(apart[1] > 5);
  CHECK(apart[2] > 1);
}

TEST_CASE("the way from a recent keyframe to a frame is what was measured, wherever an adjustment has moved the keyframe") {
  Recording recording("static_xyz", 100);
  constexpr std::size_t kKeyframe = 29;
  for (std::size_t k = kKeyframe + 1; k < recording.played.size(); ++k) recording.played[k].no_keyframe = 1;
  recording.played[kKeyframe + 3].adjusted = 0.03F;
  const std::vector<HostResult> r = recording.run(APSO_REFINE_EVERY);
  for (std::size_t k = kKeyframe + 4; k < recording.played.size(); ++k) {
    CAPTURE(k);
    REQUIRE(r[k].reference == static_cast<int>(kKeyframe));
    CHECK(r[k].refined == 1);
    CHECK(recording.error(r[k].pose, k) < 0.004);
    const Pose T_frame_keyframe = inverse(recording.frames[k].T_world_camera) * recording.frames[kKeyframe].T_world_camera;
    double off = 0;  // of a frame more than two seconds later the way is that to the keyframe where it is now
    for (int i = 0; i < 3; ++i) {
      off = std::max(off, std::abs(static_cast<double>(r[k].relative[4 * i + 3]) - T_frame_keyframe.matrix()(i, 3)));
    }
    if (recording.frames[k].timestamp - recording.frames[kKeyframe].timestamp < 2) {
      CHECK(off < 0.005);
    } else {
      CHECK(off > 0.015);
    }
  }
}

TEST_CASE("the second frame of a map is aligned to the first, and an edge joins their keyframes") {
  Recording recording("static_xyz", 6);
  recording.play_off(1, 0.02);
  const std::vector<HostResult> r = recording.run(APSO_REFINE_EVERY);
  CHECK(r[0].keyframes == 1);
  CHECK(recording.error(r[0].pose, 0) < 1e-4);
  CHECK(r[1].refined == 1);
  CHECK(recording.error(r[1].pose, 1) < recording.error(recording.played[1].pose, 1));  // of both poses joined
  REQUIRE_FALSE(recording.edges.empty());
  CHECK(std::any_of(recording.edges.begin(), recording.edges.end(), [](const HostEdge& e) { return e.frames[0] == 0; }));
  recording.played[1].ok = 0;  // and the direct pose alone is that of the camera
  const std::vector<HostResult> alone = recording.run(APSO_REFINE_EVERY);
  CHECK(alone[1].refined == 1);
  CHECK(recording.error(alone[1].pose, 1) < 0.005);
}

TEST_CASE("a GOOD frame is refined while the host goes on; what was computed from its pose follows before the next frame") {
  Recording recording("static_xyz");
  for (std::size_t k = 1; k < kFrames; ++k) {
    recording.play_off(k, k % 2 == 0 ? 0.004 : -0.004);
    recording.played[k].no_keyframe = k % 5 == 4 ? 0 : 1;
  }
  const std::vector<HostResult> later = recording.run(APSO_REFINE_EVERY);
  const std::vector<HostResult> at_once = recording.run(APSO_REFINE_EVERY, false);
  const auto pose_of = [](const float* rows) {
    Pose T = Pose::Identity();
    for (int i = 0; i < 12; ++i) T.matrix()(i / 4, i % 4) = static_cast<double>(rows[i]);
    return T;
  };
  const auto apart = [](const Pose& a, const Pose& b) { return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff(); };
  int waited_for = 0;
  for (std::size_t k = 10; k < kFrames; ++k) {
    CAPTURE(k);
    REQUIRE(later[k].refined == 1);
    const bool keyframe = recording.played[k].no_keyframe == 0;
    CHECK(later[k].keyframes == later[k - 1].keyframes + (keyframe ? 1 : 0));
    if (keyframe) {  // is made of the refined pose
      CHECK(apart(pose_of(later[k].returned), pose_of(later[k].pose)) < 1e-5);
      ++waited_for;
    } else {  // the pose of the features is returned
      CHECK(recording.error(later[k].returned, k) == doctest::Approx(0.004).epsilon(1e-2));
    }
    CHECK(recording.error(later[k].pose, k) < 0.0039);  // nearer than the features
    CHECK(apart(pose_of(later[k].velocity), pose_of(later[k].pose) * inverse(pose_of(later[k - 1].pose))) < 1e-4);
    // and all is as if the host had waited
    CHECK(later[k].reference == at_once[k].reference);
    CHECK(apart(pose_of(later[k].pose), pose_of(at_once[k].pose)) < 1e-3);
    CHECK(apart(pose_of(later[k].relative), pose_of(at_once[k].relative)) < 1e-3);
    CHECK(apart(pose_of(at_once[k].returned), pose_of(at_once[k].pose)) < 1e-5);
  }
  CHECK(waited_for > 5);
}

TEST_CASE("where direct alignment alone carries some frames a keyframe is made, so that the map goes on") {
  Recording recording("static_xyz");
  constexpr std::size_t kFirst = 30;
  for (std::size_t k = kFirst; k < kFrames; ++k) recording.played[k].ok = 0;
  const std::vector<HostResult> r = recording.run(APSO_REFINE_EVERY);
  const int last = r[kFirst - 1].reference;
  for (std::size_t k = kFirst; k < kFirst + 4; ++k) {
    CHECK(r[k].tracking == 1);
    CHECK(r[k].keyframes == r[kFirst - 1].keyframes);
  }
  CHECK(r[kFirst + 4].keyframes == r[kFirst - 1].keyframes + 1);
  CHECK(r[kFirst + 4].reference == static_cast<int>(kFirst) + 4);
  CHECK(r[kFirst + 4].parent == last);  // in the spanning tree, which the trajectory is found by, and nowhere else in it
  CHECK(recording.error(r[kFirst + 4].pose, kFirst + 4) < 0.01);
  // not with few keypoints, and with the repair of BAD frames alone the map is the host's
  recording.played[kFirst + 4].keypoints = 300;
  CHECK(recording.run(APSO_REFINE_EVERY)[kFirst + 4].keyframes == r[kFirst - 1].keyframes);
  recording.played[kFirst + 4].keypoints = 0;
  CHECK(recording.run(APSO_REFINE_BAD)[kFirst + 4].keyframes == r[kFirst - 1].keyframes);
}

TEST_CASE("no keypoint stays on the mask; they are those on people, and few of the others") {
  Recording walking("walking_static");
  Recording empty("static_static");
  const std::vector<HostResult> moving = walking.run();
  const std::vector<HostResult> still = empty.run();
  for (const auto* results : {&moving, &still}) {
    for (const HostResult& r : *results) {
      CHECK(r.consistent == 1);
      CHECK(r.on_mask == 0);
    }
  }
  CHECK(moving.back().hidden > 200);
  CHECK(still.back().hidden < moving.back().hidden / 10);
}

TEST_CASE("map points of people who sit and rise are dropped, and few of the others") {
  Recording rising("rising_static", 140);
  const std::vector<HostResult> r = rising.run();
  const auto seated = static_cast<std::size_t>(testing::kSittingTime * 30);
  CHECK(r[seated - 1].dropped < 20);
  int on_people = 0;
  int left = 0;
  int wrong = 0;
  const Pinhole c = rising.sequence.camera();
  const testing::SyntheticFrame& first = rising.frames.front();  // its keypoints made the map
  for (const HostPoint& point : rising.map) {
    const Eigen::Vector3d p =
        inverse(first.T_world_camera) * Eigen::Vector3d(static_cast<double>(point.position[0]), static_cast<double>(point.position[1]),
                                                        static_cast<double>(point.position[2]));
    const Eigen::Vector2d u = c.project(p);
    const bool person = first.instance(static_cast<int>(std::lround(u.x())), static_cast<int>(std::lround(u.y()))) != 0;
    on_people += person ? 1 : 0;
    left += person && !point.bad ? 1 : 0;
    wrong += !person && point.bad ? 1 : 0;
  }
  REQUIRE(on_people > 40);
  MESSAGE(on_people, " map points on people, ", left, " of them left; ", wrong, " others dropped of ", rising.map.size());
  CHECK(left < on_people / 5);
  CHECK(wrong < static_cast<int>(rising.map.size()) / 50);
}

TEST_CASE("where the pose that is expected is wrong, the corners that were followed tell a better one") {
  Recording recording("static_xyz", 2);
  const testing::SyntheticFrame& before = recording.frames[0];
  const testing::SyntheticFrame& now = recording.frames[1];
  const Pinhole c = recording.sequence.camera();
  const Pose T_now_before = inverse(now.T_world_camera) * before.T_world_camera;
  std::vector<ApsoBridgeTrack> tracks, begun;  // the same corners in the frame before
  for (int y = 8; y < 240; y += 12) {
    for (int x = 8; x < 320; x += 12) {
      const double z = before.depth(x, y);
      if (!(z > 0)) continue;
      const Eigen::Vector3d p = T_now_before * (z * c.unproject(x, y, 1.0));
      const Eigen::Vector2d u = c.project(p);
      if (!(u.x() > 0 && u.y() > 0 && u.x() < 319 && u.y() < 239)) continue;
      const auto id = static_cast<long long>(tracks.size());
      tracks.push_back({id, static_cast<float>(u.x()), static_cast<float>(u.y()), static_cast<float>(x), static_cast<float>(y), 1});
      begun.push_back({id, static_cast<float>(x), static_cast<float>(y), static_cast<float>(x), static_cast<float>(y), 0});
    }
  }
  REQUIRE(tracks.size() > 100);
  const auto rows = [](const Pose& T, double* out) {
    for (int i = 0; i < 12; ++i) out[i] = T.matrix()(i / 4, i % 4);
  };
  const std::vector<unsigned char> grey(320 * 240, 100);
  double previous[12], prior[12], expected[12];
  rows(before.T_world_camera, previous);
  Pose wrong = now.T_world_camera;
  wrong.translation().x() += 0.1;
  rows(wrong, prior);
  const auto error = [&] { return (Eigen::Vector3d(expected[3], expected[7], expected[11]) - now.T_world_camera.translation()).norm(); };
  ApsoBridge* b = apso_bridge_create(c.fx, c.fy, c.cx, c.cy, 320, 240, nullptr);
  REQUIRE(b != nullptr);
  for (const bool known : {true, false}) {  // the pose of the frame before
    CAPTURE(known);
    apso_bridge_reset(b);
    REQUIRE(apso_bridge_observe(b, 0, grey.data(), 320, before.depth.data(), 4 * 320, previous, nullptr, begun.data(),
                                static_cast<int>(begun.size()), nullptr, 0) == 0);
    REQUIRE(apso_bridge_observe(b, 0.03, grey.data(), 320, now.depth.data(), 4 * 320, prior, known ? previous : nullptr, tracks.data(),
                                static_cast<int>(tracks.size()), nullptr, 0) == 0);
    const int followed = apso_bridge_expected(b, expected);
    CHECK((followed > 50) == known);
    CHECK((error() < 0.01) == known);
  }
  apso_bridge_destroy(b);
}

TEST_CASE("where the map fails along a wall, tracks fill the direction that alignment leaves open") {
  constexpr int kWidth = 320;
  constexpr int kHeight = 240;
  constexpr double kFocal = 300;
  constexpr double kDistance = 2;  // [m]
  constexpr double kStep = 0.01;   // along the stripes, per frame [m]
  constexpr int kFailing = 34;
  std::vector<unsigned char> grey(kWidth * kHeight);
  for (std::size_t i = 0; i < grey.size(); ++i) {
    const double x = static_cast<double>(i % kWidth);
    grey[i] = static_cast<unsigned char>(std::lround(128 + 60 * std::sin(x / 5) + 40 * std::sin(x / 13)));
  }
  const std::vector<float> depth(grey.size(), static_cast<float>(kDistance));
  const ApsoBridgeOptions options{APSO_REFINE_EVERY, 0, 0};
  for (const int found_by : {APSO_BY_NOTHING, APSO_BY_TRACKS}) {
    CAPTURE(found_by);
    ApsoBridge* b = apso_bridge_create(kFocal, kFocal, kWidth / 2.0, kHeight / 2.0, kWidth, kHeight, &options);
    REQUIRE(b != nullptr);
    ApsoBridgeReport report{};
    for (int k = 0; k <= kFailing; ++k) {
      const double shift = -kFocal * kStep / kDistance;  // of the image [px]
      std::vector<ApsoBridgeTrack> tracks;
      std::vector<ApsoBridgeKeypoint> keypoints;
      for (int i = 0; i < 500; ++i) {
        const double x = 8 + 12 * (i % 25);
        const double y = 40 + 10.0 * (i / 25);
        const double v = y + k * shift;
        if (v < 4) continue;
        const double before = k > 0 ? v - shift : v;
        tracks.push_back({i, static_cast<float>(x), static_cast<float>(v), static_cast<float>(x), static_cast<float>(before), k});
        const auto point = [&](double u, double c) { return static_cast<float>((u - c) * kDistance / kFocal); };
        keypoints.push_back({static_cast<float>(x),
                             static_cast<float>(v),
                             50.0F,
                             0.0F,
                             0,
                             static_cast<float>(kDistance),
                             1.0F,
                             i,
                             {point(x, kWidth / 2.0), point(y, kHeight / 2.0), static_cast<float>(kDistance)}});
      }
      const auto at = [](double y) { return std::vector<double>{1, 0, 0, 0, 0, 1, 0, y, 0, 0, 1, 0}; };
      const std::vector<double> before = at(kStep * std::max(0, k - 1));
      REQUIRE(apso_bridge_observe(b, k / 30.0, grey.data(), kWidth, depth.data(), 4 * kWidth, before.data(),
                                  k > 0 ? before.data() : nullptr, tracks.data(), static_cast<int>(tracks.size()), nullptr, 0) == 0);
      if (k == kFailing) {
        for (ApsoBridgeKeypoint& p : keypoints) p.point_id = -1;
      }
      const std::vector<double> tracked = at(kStep * k);
      const bool by_map = k < kFailing;
      REQUIRE(apso_bridge_conclude(b, keypoints.data(), static_cast<int>(keypoints.size()), by_map ? tracked.data() : nullptr,
                                   by_map ? int{APSO_BY_MAP} : found_by, &report) == 0);
      if (by_map) REQUIRE(report.pose_ok == 1);
    }
    const bool told = found_by == APSO_BY_TRACKS;
    CHECK(report.refined == (told ? 1 : 0));
    CHECK(report.pose_ok == (told ? 1 : 0));
    if (told) {
      CHECK(std::abs(report.T_world_camera[3]) < 1e-3);
      CHECK(std::abs(report.T_world_camera[7] - kStep * kFailing) < 1e-3);
      CHECK(std::abs(report.T_world_camera[11]) < 1e-3);
    }
    CHECK(std::string(report.state) == (told ? "BAD" : "LOST"));
    CHECK(report.keyframe_allowed == 0);
    apso_bridge_destroy(b);
  }
}

TEST_CASE("a hook that knows how exact the depth is loses less to an error that stays in the image") {
  Recording recording("static_xyz");
  for (testing::SyntheticFrame& f : recording.frames) {
    for (int y = 0; y < f.depth.height(); ++y) {
      for (int x = 0; x < f.depth.width(); ++x) {
        float& z = f.depth(x, y);
        const double error = 0.012 * std::cos(2.5 * x / f.depth.width()) * std::cos(1.5 * y / f.depth.height());
        if (z > 0) z = static_cast<float>(1 / (1 / static_cast<double>(z) + error));
      }
    }
  }
  const auto error = [&](double inverse_depth_sigma) {
    const std::vector<HostResult> r = recording.run(APSO_REFINE_EVERY, true, inverse_depth_sigma);
    double sum = 0;
    for (std::size_t k = 0; k < r.size(); ++k) sum += recording.error(r[k].pose, k);
    return sum;
  };
  const double unknown = error(0);
  const double known = error(0.012);
  CAPTURE(unknown);
  CAPTURE(known);
  CHECK(known < 0.9 * unknown);
}

TEST_CASE("the bridge says what is wrong") {
  CHECK(apso_bridge_create(0, 500, 320, 240, 640, 480, nullptr) == nullptr);
  const ApsoBridgeOptions unknown{7, 1, 0};
  CHECK(apso_bridge_create(300, 300, 160, 120, 320, 240, &unknown) == nullptr);
  for (const double sigma : {-0.01, 1e-300, 3.0, std::nan("")}) {
    const ApsoBridgeOptions of_depth{APSO_REFINE_EVERY, 1, sigma};
    CHECK(apso_bridge_create(300, 300, 160, 120, 320, 240, &of_depth) == nullptr);
  }
  const std::vector<unsigned char> grey(320 * 240, 100);
  const std::vector<float> depth(320 * 240, 1.0F);
  const std::vector<float> behind(320 * 240, 3.0F);
  for (const int own_thread : {0, 1}) {
    CAPTURE(own_thread);
    const ApsoBridgeOptions options{APSO_REFINE_BAD, own_thread, 0};
    ApsoBridge* b = apso_bridge_create(300, 300, 160, 120, 320, 240, &options);
    REQUIRE(b != nullptr);
    const auto error = [b] { return std::string(apso_bridge_error(b)); };
    ApsoBridgeReport report;
    CHECK(apso_bridge_mask(b) == nullptr);
    CHECK(apso_bridge_conclude(b, nullptr, 0, nullptr, 0, &report) != 0);
    CHECK(error().find("observe() for the frame first") != std::string::npos);
    CHECK(apso_bridge_conclude(b, nullptr, 0, nullptr, 3, &report) != 0);
    CHECK(error().find("found_by is none of APSO_BY_*") != std::string::npos);
    CHECK(apso_bridge_correct(b, nullptr, nullptr) != 0);
    CHECK(apso_bridge_settle(b, nullptr) != 0);
    double T[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    unsigned char presence = 0;
    const float point[3] = {0, 0, 1};
    CHECK(apso_bridge_presence(b, T, point, 1, &presence) != 0);
    CHECK(apso_bridge_observe(b, 0, grey.data(), 100, depth.data(), 4 * 320, T, nullptr, nullptr, 0, nullptr, 0) != 0);
    CHECK(error().find("step does not fit") != std::string::npos);
    CHECK(apso_bridge_observe(b, 0, grey.data(), 320, depth.data(), 4 * 320, T, nullptr, nullptr, 0, grey.data(), 319) != 0);
    T[3] = std::nan("");
    CHECK(apso_bridge_observe(b, 0, grey.data(), 320, depth.data(), 4 * 320, T, nullptr, nullptr, 0, nullptr, 0) != 0);
    CHECK(error().find("not finite") != std::string::npos);
    T[3] = 0;
    CHECK(apso_bridge_observe(b, 0, grey.data(), 320, depth.data(), 4 * 320, T, nullptr, nullptr, 0, grey.data(), 320) == 0);
    const unsigned char* mask = apso_bridge_mask(b);
    REQUIRE(mask != nullptr);
    CHECK(mask[0] == 255);  // the mask of the host is part of it
    CHECK(apso_bridge_presence(b, T, point, 1, &presence) == 0);
    CHECK(presence == APSO_POINT_MOVING);
    CHECK(apso_bridge_observe(b, 1, grey.data(), 320, depth.data(), 4 * 320, T, nullptr, nullptr, 0, nullptr, 0) == 0);
    REQUIRE(apso_bridge_mask(b) != nullptr);
    CHECK(apso_bridge_presence(b, T, point, 1, &presence) == 0);
    CHECK(presence == APSO_POINT_PRESENT);
    CHECK(apso_bridge_observe(b, 2, grey.data(), 320, behind.data(), 4 * 320, T, nullptr, nullptr, 0, nullptr, 0) == 0);
    CHECK(apso_bridge_presence(b, T, point, 1, &presence) == 0);
    CHECK(presence == APSO_POINT_GONE);
    apso_bridge_destroy(b);
  }
}

TEST_CASE("the integration needs few lines in the host, and its headers see nothing of apso") {
  int lines = 0;
  for (const char* name : {"Tracking.h", "Tracking.cc", "Frame.h", "Optimizer.cc"}) {
    std::ifstream file(std::string(APSO_SOURCE_DIR "/tests/integrate/orb_slam3/") + name);
    REQUIRE(file.good());
    for (std::string line; std::getline(file, line);) {
      const std::string mark = "// +apso";
      lines += line.size() >= mark.size() && line.compare(line.size() - mark.size(), mark.size(), mark) == 0;
      if (std::string(name) == "Tracking.h" || std::string(name) == "Frame.h") CHECK(line.find("#include \"apso") == std::string::npos);
    }
  }
  CHECK(lines == 28);  // docs/integrate/orb_slam3.md tells this number
}
