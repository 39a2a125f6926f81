// apso_track on maps that change: two rooms are two parts, of which the trajectory is one; and a turn that comes back is a loop.
#ifdef APSO_MINIMAL_TRACKER
#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <sstream>
#include <string>
#include <vector>

#include <apso/evaluation/trajectory.hpp>
#include <apso/io/camera_yaml.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/math/se3.hpp>
#include <nlohmann/json.hpp>

#include "../run_program.hpp"

namespace {

constexpr double kStep = 1.0 / 30;  // [s]
std::string stamp(int frame) {
  std::ostringstream s;
  s << std::fixed << std::setprecision(6) << kStep * frame;
  return s.str();
}

}  // namespace

TEST_CASE("another room is another part of the map, and its poses are not mixed with those of the first") {
  constexpr int kLeft = 35, kBack = 83, kEnd = 93;  // frames of the second room: [kLeft, kBack)
  const Folder f;
  const std::filesystem::path walk = f.path / "walk";
  const auto synth = [&](const char* seed, int frames, const char* name) {
    REQUIRE(run(std::string(APSO_SYNTH) + " static_halfsphere --seed " + seed + " --frames " + std::to_string(frames) + " --output " +
                    (walk / name).string(),
                f.path)
                .code == 0);
  };
  synth("103", kLeft + kEnd - kBack, "a");
  synth("105", kBack - kLeft, "b");
  const apso::Trajectory truth_a = apso::read_trajectory((walk / "a/groundtruth.txt").string());
  std::ofstream pairs(walk / "associations.txt");
  apso::Trajectory truth;  // of the first room
  for (int i = 0; i < kEnd; ++i) {
    const bool first = i < kLeft || i >= kBack;
    const int k = i < kLeft ? i : i < kBack ? i - kLeft : i - (kBack - kLeft);
    const std::string folder = first ? "a" : "b";
    pairs << stamp(i) << ' ' << folder << "/rgb/" << stamp(k) << ".png " << stamp(i) << ' ' << folder << "/depth/" << stamp(k) << ".png\n";
    if (first) truth.push_back({kStep * i, truth_a[static_cast<std::size_t>(k)].T_world_body});
  }
  pairs.close();
  apso::write_trajectory((walk / "groundtruth.txt").string(), truth);

  const std::filesystem::path out = f.path / "out";
  const Outcome o = run(std::string(APSO_TRACK) + " " + walk.string() + " --camera " + (walk / "a/camera.yaml").string() +
                            " --report --quiet --output " + out.string(),
                        f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  CHECK(o.text.find("the map has 2 parts that are not connected") != std::string::npos);

  const apso::Trajectory poses = apso::read_trajectory((out / "trajectory.txt").string());
  CHECK(poses.size() >= static_cast<std::size_t>(kEnd - (kBack - kLeft) - 2));
  for (const apso::StampedPose& p : poses) CHECK((p.timestamp < kStep * (kLeft - 0.5) || p.timestamp > kStep * (kBack - 0.5)));

  std::ifstream stream(out / "summary.json");
  const nlohmann::json summary = nlohmann::json::parse(stream);
  const nlohmann::json& parts = summary["parts"];
  REQUIRE(parts["connected"].size() == 2);
  CHECK(parts["connected"][0] == nlohmann::json{{"part", 0}, {"poses", poses.size()}, {"written", true}});
  CHECK(parts["connected"][1]["part"] == 1);
  CHECK(parts["connected"][1]["poses"].get<int>() >= 15);
  CHECK(parts["connected"][1]["written"] == false);
  REQUIRE(parts["changes"].size() == 2);
  CHECK(parts["changes"][0]["event"] == "left");
  CHECK(parts["changes"][0]["timestamp"].get<double>() == doctest::Approx(kStep * (kLeft - 1 + 30)).epsilon(0.01));
  CHECK(parts["changes"][1]["event"] == "left");
  CHECK(parts["changes"][1]["to"] == 0);
  CHECK(summary["frames"]["with_pose"] == poses.size());
  CHECK(summary["final"]["ate"]["rmse"].get<double>() < 0.01);

  std::ifstream page(out / "report.html");
  const std::string html((std::istreambuf_iterator<char>(page)), std::istreambuf_iterator<char>());
  CHECK(html.find("part 1 of the map begins") != std::string::npos);
  CHECK(html.find("found again in part 0 of the map") != std::string::npos);
}

TEST_CASE("a loop moves the poses of the way round, and the report tells of it") {
  constexpr int kFrames = 381, kEvery = 3;  // a turn takes 330
  const Folder f;
  const std::filesystem::path turn = f.path / "turn";
  REQUIRE(run(std::string(APSO_SYNTH) + " static_360 --seed 103 --frames " + std::to_string(kFrames) + " --output " + turn.string(), f.path)
              .code == 0);
  std::ofstream pairs(turn / "associations.txt");
  for (int i = 0; i < kFrames; i += kEvery)
    pairs << stamp(i) << " rgb/" << stamp(i) << ".png " << stamp(i) << " depth/" << stamp(i) << ".png\n";
  pairs.close();
  // a focal length that is too long makes the turn too short
  apso::CameraModel camera = apso::camera_from_yaml((turn / "camera.yaml").string());
  std::ofstream(turn / "wrong.yaml") << "fx: " << 1.03 * camera.pinhole.fx << "\nfy: " << 1.03 * camera.pinhole.fy
                                     << "\ncx: " << camera.pinhole.cx << "\ncy: " << camera.pinhole.cy
                                     << "\nwidth: 640\nheight: 480\ndepth_scale: 5000\n";
  const std::filesystem::path out = f.path / "out";
  const Outcome o = run(std::string(APSO_TRACK) + " " + turn.string() + " --camera " + (turn / "wrong.yaml").string() +
                            " --report --quiet --output " + out.string(),
                        f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  std::ifstream stream(out / "summary.json");
  const nlohmann::json summary = nlohmann::json::parse(stream);
  const nlohmann::json& changes = summary["parts"]["changes"];
  REQUIRE(changes.size() == 1);
  CHECK(changes[0]["event"] == "closed");
  CHECK(o.text.find("loops closed: 1") != std::string::npos);
  CHECK(changes[0]["from"] == 0);
  CHECK(changes[0]["to"] == 0);
  CHECK(summary["frames"]["with_pose"] == kFrames / kEvery);
  // the rotation of the trajectory, against that of the ground truth, since its first frame
  const apso::Trajectory poses = apso::read_trajectory((out / "trajectory.txt").string());
  const apso::Trajectory truth = apso::read_trajectory((turn / "groundtruth.txt").string());
  REQUIRE(poses.size() == kFrames / kEvery);
  double largest = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const apso::Pose estimated = apso::compose(apso::inverse(poses[0].T_world_body), poses[i].T_world_body);
    const apso::Pose true_pose = apso::compose(apso::inverse(truth[0].T_world_body), truth[kEvery * i].T_world_body);
    largest = std::max(largest, apso::rotation_angle(apso::compose(apso::inverse(true_pose), estimated)));
  }
  CHECK(largest < 0.05);  // 0.086 with the loop left open
  std::ifstream page(out / "report.html");
  const std::string html((std::istreambuf_iterator<char>(page)), std::istreambuf_iterator<char>());
  CHECK(html.find("back at a place of part 0 of the map: the drift of the way round is taken out") != std::string::npos);
}
#endif
