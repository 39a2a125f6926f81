// The integration of docs/integrate/orb_slam3.md, both routes, run on a synthetic recording.
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
constexpr int kBad = 40;   // a frame with weak keypoints and a pose that is off
constexpr int kLost = 43;  // a frame without any pose

struct Recording {
  testing::SyntheticSequence sequence;
  std::vector<testing::SyntheticFrame> frames;
  std::vector<PlayedFrame> played;

  explicit Recording(const std::string& name) : sequence(name, options()), frames(kFrames), played(kFrames) {
    Twist off;
    off << 0.02, -0.01, 0.01, 0.005, 0.01, -0.005;
    for (int k = 0; k < kFrames; ++k) {
      testing::SyntheticFrame& f = frames[static_cast<std::size_t>(k)];
      sequence.render(k, f);
      PlayedFrame& p = played[static_cast<std::size_t>(k)];
      p = {f.timestamp, f.rgb.data(), f.depth.data(), {}, k == kBad || k == kLost ? 0.0F : 30.0F, k != kLost, 0};
      Pose T_camera_world = inverse(f.T_world_camera);
      if (k == kBad) T_camera_world = se3_exp(off) * T_camera_world;
      for (int i = 0; i < 12; ++i) p.pose[i] = static_cast<float>(T_camera_world.matrix()(i / 4, i % 4));
    }
  }
  static testing::SyntheticOptions options() {
    testing::SyntheticOptions o;
    o.width = 320;
    o.height = 240;
    o.frames = kFrames;
    return o;
  }
  [[nodiscard]] std::vector<HostResult> run(Host host) const {
    std::vector<HostResult> out(kFrames);
    const Pinhole c = sequence.camera();
    host(played.data(), kFrames, static_cast<float>(c.fx), static_cast<float>(c.cx), static_cast<float>(c.cy), c.width, c.height,
         out.data());
    return out;
  }
  // distance of the camera from the truth [m]
  [[nodiscard]] double error(const float* pose, int k) const {
    Pose T = Pose::Identity();
    for (int i = 0; i < 12; ++i) T.matrix()(i / 4, i % 4) = static_cast<double>(pose[i]);
    return (inverse(T).translation() - frames[static_cast<std::size_t>(k)].T_world_camera.translation()).norm();
  }
};
}  // namespace

TEST_CASE("both routes: a BAD frame gets a better pose and no keyframe, the others keep theirs") {
  const Recording recording("static_xyz");
  const std::vector<HostResult> a = recording.run(run_host_cxx17);
  const std::vector<HostResult> b = recording.run(run_host_cxx14);
  for (const auto* results : {&a, &b}) {
    const auto& r = *results;
    for (int k = 0; k < kBad; ++k) {
      const auto i = static_cast<std::size_t>(k);
      if (r[i].refined) continue;
      CHECK(recording.error(r[i].pose, k) < 1e-4);  // the pose of the features, to the precision of a float
    }
    const double given = recording.error(recording.played[kBad].pose, kBad);
    CHECK(given > 0.02);
    CHECK(r[kBad].refined == 1);
    CHECK(recording.error(r[kBad].pose, kBad) < given);  // a blend: how far it goes is the refiner's decision
    CHECK(r[kBad].keyframes == r[kBad - 1].keyframes);
    CHECK(r[kBad - 1].keyframes > 30);
    CHECK(r[kLost].keyframes == r[kLost - 1].keyframes);
    CHECK(r[kFrames - 1].keyframes > r[kLost].keyframes);  // and it goes on afterwards
    // without features the direct pose carries the frame, and the tracker is not lost
    CHECK(r[kLost].refined == 1);
    CHECK(r[kLost].tracking == 1);
    CHECK(recording.error(r[kLost].pose, kLost) < 0.02);
  }
  for (std::size_t k = 0; k < kFrames; ++k) {
    CHECK(a[k].keyframes == b[k].keyframes);
    CHECK(a[k].hidden == b[k].hidden);
    CHECK(a[k].refined == b[k].refined);
    double difference = 0;
    for (int i = 0; i < 12; ++i) difference = std::max(difference, static_cast<double>(std::abs(a[k].pose[i] - b[k].pose[i])));
    CHECK(difference < 1e-5);
  }
}

TEST_CASE("keypoints on people are hidden from matching, and few of the others") {
  const Recording walking("walking_static");
  const Recording empty("static_static");
  const auto moving = walking.run(run_host_cxx14);
  const auto still = empty.run(run_host_cxx14);
  CHECK(moving[kBad - 1].hidden > 200);
  CHECK(still[kBad - 1].hidden < moving[kBad - 1].hidden / 10);
}

TEST_CASE("a big change of the map makes it begin anew instead of repairing with poses of the old map") {
  Recording recording("static_xyz");
  for (std::size_t k = kBad; k < kFrames; ++k) recording.played[k].big_change = 1;
  const auto r = recording.run(run_host_cxx17);
  CHECK(r[kBad].refined == 0);
}

TEST_CASE("the bridge says what is wrong") {
  CHECK(apso_bridge_create(0, 500, 320, 240, 640, 480) == nullptr);
  ApsoBridge* b = apso_bridge_create(300, 300, 160, 120, 320, 240);
  REQUIRE(b != nullptr);
  ApsoBridgeReport report;
  CHECK(apso_bridge_conclude(b, nullptr, 0, nullptr, 0, &report) != 0);
  CHECK(std::string(apso_bridge_error(b)).find("observe() for the frame first") != std::string::npos);
  const std::vector<unsigned char> grey(320 * 240, 100);
  const std::vector<float> depth(320 * 240, 1.0F);
  double T[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  CHECK(apso_bridge_observe(b, 0, grey.data(), 100, depth.data(), 4 * 320, T) != 0);
  CHECK(std::string(apso_bridge_error(b)).find("step does not fit") != std::string::npos);
  T[3] = std::nan("");
  CHECK(apso_bridge_observe(b, 0, grey.data(), 320, depth.data(), 4 * 320, T) != 0);
  T[3] = 0;
  CHECK(apso_bridge_observe(b, 0, grey.data(), 320, depth.data(), 4 * 320, T) == 0);
  CHECK(apso_bridge_moves(b, std::nanf(""), 0) == 0);
  apso_bridge_destroy(b);
}

TEST_CASE("the integration needs fewer than 60 lines in the host") {
  int lines = 0;
  for (const char* name : {"Tracking.h", "Tracking.cc"}) {
    std::ifstream file(std::string(APSO_SOURCE_DIR "/tests/integrate/orb_slam3/") + name);
    REQUIRE(file.good());
    for (std::string line; std::getline(file, line);) lines += line.find("// +apso") != std::string::npos;
  }
  CHECK(lines >= 8);
  CHECK(lines < 60);
  MESSAGE(lines, " lines");
}
