// examples/minimal_tracker.cpp from the outside: it must do what apso_track does.
#ifdef APSO_MINIMAL_TRACKER
#include <doctest/doctest.h>

#include <string>

#include <apso/evaluation/ate.hpp>
#include <apso/io/tum_text.hpp>

#include "../run_program.hpp"

TEST_CASE("the minimal tracker gives the trajectory of apso_track") {
  const Folder f;
  const std::string room = (f.path / "room").string();
  const std::string own = (f.path / "trajectory.txt").string();
  REQUIRE(run(std::string(APSO_SYNTH) + " walking_xyz --seed 104 --frames 40 --output " + room, f.path).code == 0);
  const Outcome minimal = run(std::string(APSO_MINIMAL_TRACKER) + " " + room + " tum-fr3 " + own, f.path);
  INFO(minimal.text);
  REQUIRE(minimal.code == 0);
  // camera.yaml says that the rows of these images were read at once, which those of tum-fr3 are not, but nothing of the depth
  std::ofstream(room + "/camera.yaml", std::ios::app) << "inverse_depth_sigma: 0.012\n";
  const Outcome full = run(
      std::string(APSO_TRACK) + " " + room + " --camera " + room + "/camera.yaml --quiet --output " + (f.path / "full").string(), f.path);
  INFO(full.text);
  REQUIRE(full.code == 0);

  const apso::Trajectory truth = apso::read_trajectory(room + "/groundtruth.txt");
  const apso::Trajectory a = apso::read_trajectory(own);
  const apso::Trajectory b = apso::read_trajectory((f.path / "full" / "trajectory.txt").string());
  REQUIRE(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    CHECK(a[i].timestamp == b[i].timestamp);
    CHECK((a[i].T_world_body.translation() - b[i].T_world_body.translation()).norm() < 1e-3);
  }
  CHECK(apso::ate(truth, a).statistics.rmse < 2 * apso::ate(truth, b).statistics.rmse);
  CHECK(apso::ate(truth, a).statistics.rmse < 0.02);

  // numbers instead of a name, and pairs instead of two lists, are the same recording
  std::ofstream pairs(room + "/associations.txt");
  for (const apso::FileListEntry& e : apso::read_file_list(room + "/rgb.txt")) {
    std::string depth = e.file;
    depth.replace(0, 3, "depth");
    pairs << std::to_string(e.timestamp) << ' ' << e.file << ' ' << std::to_string(e.timestamp) << ' ' << depth << '\n';
  }
  pairs.close();
  const std::string again = (f.path / "again.txt").string();
  REQUIRE(run(std::string(APSO_MINIMAL_TRACKER) + " " + room + " 535.4,539.2,320.1,247.6,5000,0.012 " + again, f.path).code == 0);
  const apso::Trajectory c = apso::read_trajectory(again);
  REQUIRE(c.size() == a.size());
  CHECK(c.back().T_world_body.matrix() == a.back().T_world_body.matrix());
}

TEST_CASE("the minimal tracker says what is wrong") {
  const Folder f;
  CHECK(run(std::string(APSO_MINIMAL_TRACKER), f.path).code == 2);
  const Outcome o = run(std::string(APSO_MINIMAL_TRACKER) + " " + (f.path / "nowhere").string() + " tum-fr3 t.txt", f.path);
  CHECK(o.code == 1);
  CHECK(o.text.find("nowhere/rgb.txt") != std::string::npos);
}
#endif
