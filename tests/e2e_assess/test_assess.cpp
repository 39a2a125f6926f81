// Runs apso_assess, apso_calibrate and apso_ablate.
#include <doctest/doctest.h>

#ifndef APSO_PROGRAMS

TEST_CASE("apso_assess") { MESSAGE("skipped: the programs are not built (APSO_BUILD_EXAMPLES)"); }

#else

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
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

  // calibration accepts the finished run; apso_track accepts what it writes
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

TEST_CASE("the settings of a run go into every program") {
  const Folder f;
  const std::string d = f.path.string();
  Outcome o = run_program("apso_track synthetic:static_static --max-frames 2 --quiet --output " + d + "/run", f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  std::ofstream(f.path / "all.yaml") << read_json(f.path / "run/summary.json")["options"].dump(2) << '\n';  // JSON is YAML
  const std::string with = " --config " + d + "/all.yaml --output " + d;

  // every variant can be made from these settings, and each but the first differs from them
  o = run_program("apso_ablate synthetic:static_static --plan " + d + "/plan.json" + with + "/ab", f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  const auto text_of = [](const fs::path& file) {
    std::stringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  };
  const std::string shipped = text_of(f.path / "ab/configs/default.yaml");
  int variants = 0;
  for (const auto& entry : fs::directory_iterator(f.path / "ab/configs")) {
    CAPTURE(entry.path().string());
    if (++variants; entry.path().stem() != "default") CHECK(text_of(entry.path()) != shipped);
  }
  CHECK(variants > 30);
  CHECK(read_json(f.path / "plan.json").size() == static_cast<std::size_t>(variants));

  // a score that is left out gives its weight to the others
  const json base = read_json(f.path / "run/summary.json")["options"]["pipeline"]["assessor"]["frame_weights"];
  const std::string first = base.begin().key();
  REQUIRE(fs::exists(f.path / ("ab/configs/no_" + first + ".yaml")));
  o = run_program("apso_track synthetic:static_static --max-frames 1 --quiet --config " + d + "/ab/configs/no_" + first +
                      ".yaml --output " + d + "/without", f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  const json without = read_json(f.path / "without/summary.json")["options"]["pipeline"]["assessor"]["frame_weights"];
  CHECK(without[first] == 0);
  double before = 0, after = 0;
  for (const auto& [name, weight] : base.items()) {
    before += weight.get<double>();
    after += without[name].get<double>();
    if (name != first) CHECK(without[name].get<double>() > weight.get<double>());
  }
  CHECK(std::abs(after - before) < 1e-9);

  o = run_program("apso_motion synthetic:static_static --frames 1 --policies geometric --config " + d + "/all.yaml", f.path);
  INFO(o.text);
  CHECK(o.code == 0);
  o = run_program("apso_calibrate " + d + "/run" + with + "/calibrated.yaml", f.path);
  INFO(o.text);
  CHECK(o.text.find("no frame with a decision") != std::string::npos);  // so it read the settings
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
