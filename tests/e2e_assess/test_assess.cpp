// apso_assess, apso_calibrate and apso_ablate from the outside.
#include <doctest/doctest.h>

#ifndef APSO_PROGRAMS

TEST_CASE("apso_assess") { MESSAGE("skipped: the programs are not built (APSO_BUILD_EXAMPLES)"); }

#else

#include <filesystem>
#include <fstream>
#include <string>

#include "../run_program.hpp"

namespace {
Outcome run_program(const std::string& command, const fs::path& folder) { return run(APSO_PROGRAMS "/" + command, folder); }
}  // namespace

TEST_CASE("from runs to figures: track, assess, calibrate, ablate") {
  const Folder f;
  const std::string d = f.path.string();

  Outcome o =
      run_program("apso_track synthetic:stress_flash --seed 5 --max-frames 75 --quiet --no-refinement --output " + d + "/flash",
          f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  o = run_program("apso_assess " + d + "/flash --output " + d + "/assessed", f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  const json a = read_json(f.path / "assessed/assess.json");
  // the overexposed frames with a decision, counted in what apso_track wrote; flashes last 0.14 s at 30 Hz
  const Table frames(f.path / "flash/frames.csv");
  int overexposed = 0;
  for (std::size_t i = 0; i < frames.rows.size(); ++i) {
    if (frames.field(i, "label") == "flash" && frames.field(i, "state") != "INITIALISING") ++overexposed;
  }
  REQUIRE(overexposed >= 8);  // two whole flashes at least
  CHECK(a["decisions"]["causes"]["flash"]["frames"] == overexposed);
  CHECK(a["decisions"]["causes"]["flash"]["flagged"].get<int>() >= overexposed - 1);
  CHECK(a["decisions"]["outside"]["share"].get<double>() < 0.1);
  CHECK(a["scores"][0]["score"] == "1 - S_final");
  CHECK(a["scores"][0]["auc_label"].get<double>() > 0.9);
  for (const char* picture : {"roc.png", "reliability.png", "timeline.png"}) {
    CAPTURE(picture);
    CHECK(fs::exists(f.path / "assessed" / picture));
  }

  // calibration takes the run as it is; apso_track reads what it writes
  o = run_program("apso_calibrate " + d + "/flash --output " + d + "/config.yaml", f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  o = run_program(
      "apso_track synthetic:static_static --max-frames 3 --quiet --config " + d + "/config.yaml --output " + d + "/s",
      f.path);
  INFO(o.text);
  CHECK(o.code == 0);

  // two variants; what is done is not done again; a run cut short is
  const std::string ablate =
      "apso_ablate synthetic:static_static,max-frames=35 --only default,literal_polarity --jobs 2 --output " + d +
      "/ab";
  o = run_program(ablate, f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  CHECK(o.text.find("was done") == std::string::npos);
  const json t = read_json(f.path / "ab/ablation.json");
  REQUIRE(t["variants"].size() == 2);
  CHECK(t["variants"][0]["runs"] == 1);
  CHECK(t["variants"][0]["ate_m"]["mean"].get<double>() < 0.05);
  const fs::path one = f.path / "ab/default";
  const fs::path run_folder = fs::directory_iterator(one)->path();
  fs::remove(run_folder / "summary.json");
  o = run_program(ablate, f.path);
  INFO(o.text);
  CHECK(o.code == 0);
  CHECK(o.text.find("was done") != std::string::npos);
  CHECK(fs::exists(run_folder / "summary.json"));
  o = run_program(ablate + " --plan " + d + "/plan.json", f.path);
  CHECK(o.code == 0);
  CHECK(read_json(f.path / "plan.json").size() == 2);
}

TEST_CASE("bad input is named") {
  const Folder f;
  const std::string d = f.path.string();
  Outcome o = run_program("apso_assess " + d + "/nowhere --output " + d + "/x", f.path);
  CHECK(o.code == 1);
  CHECK(o.text.find("frames.csv") != std::string::npos);
  fs::create_directories(f.path / "broken");
  std::ofstream(f.path / "broken/frames.csv") << "timestamp,state,label,S_final,S_total,feature_ok\n1,GOOD,,0.9\n";
  o = run_program("apso_assess " + d + "/broken --output " + d + "/x", f.path);
  CHECK(o.code == 1);
  CHECK(o.text.find("frames.csv:2") != std::string::npos);
  o = run_program("apso_ablate synthetic:static_static --only nonsense --output " + d + "/x", f.path);
  CHECK(o.code == 2);
  o = run_program("apso_ablate synthetic:nonsense,max-frames=5 --only default --output " + d + "/y", f.path);
  CHECK(o.code == 1);
  CHECK(o.text.find("log.txt") != std::string::npos);
  o = run_program("apso_calibrate " + d + "/broken --output " + d + "/c.yaml", f.path);
  CHECK(o.code == 1);
  o = run_program("apso_calibrate synthetic:static_static --fit-weights --output " + d + "/c.yaml", f.path);
  CHECK(o.code == 2);
}
#endif
