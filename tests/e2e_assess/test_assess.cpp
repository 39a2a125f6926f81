// Runs apso_assess, apso_calibrate and apso_ablate.
#include <doctest/doctest.h>

#ifndef APSO_PROGRAMS

TEST_CASE("apso_assess") { MESSAGE("skipped: the programs are not built (APSO_BUILD_EXAMPLES)"); }

#else

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "../run_program.hpp"

namespace {
Outcome run_program(const std::string& command, const fs::path& folder) { return run(APSO_PROGRAMS "/" + command, folder); }
}  // namespace

TEST_CASE("from runs to figures: track, assess, calibrate, ablate") {
  const Folder f;
  const std::string d = f.path.string();

  Outcome o =
      run_program("apso_track synthetic:stress_flash --seed 5 --max-frames 75 --quiet --no-refinement --output " + d + "/flash", f.path);
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
  o = run_program("apso_track synthetic:static_static --max-frames 3 --quiet --config " + d + "/config.yaml --output " + d + "/s", f.path);
  INFO(o.text);
  CHECK(o.code == 0);

  // two variants; what is done is not done again; a run cut short is
  const std::string ablate =
      "apso_ablate synthetic:static_static,max-frames=35 --only default,literal_polarity --jobs 2 --output " + d + "/ab";
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
                      ".yaml --output " + d + "/without",
                  f.path);
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
  CHECK(o.text.find("log.txt: exit code 1: apso_track: unknown synthetic sequence 'nonsense', known are") != std::string::npos);
  o = run_program("apso_calibrate " + d + "/broken --output " + d + "/c.yaml", f.path);
  CHECK(o.code == 1);
  o = run_program("apso_calibrate synthetic:static_static --fit-weights --output " + d + "/c.yaml", f.path);
  CHECK(o.code == 2);
}

TEST_CASE("one command makes the page of results, goes on where it stopped, and writes what it measured") {
  if (std::system("python3 -c 'import json' 2> /dev/null") != 0) {
    MESSAGE("skipped: python3 was not found");
    return;
  }
  const Folder f;
  const std::string d = f.path.string();
  REQUIRE(run_program("apso_synth static_static --seed 7 --frames 31 --quiet --output " + d + "/data/room", f.path).code == 0);
  fs::create_directories(f.path / "data/pair");  // too short to be a recording
  std::ofstream(f.path / "data/pair/associations.txt") << "1 a.png 1 b.png\n";
  const std::string command = "python3 " APSO_SOURCE "/scripts/results.py " + d + "/data --programs " APSO_PROGRAMS " --runs " + d +
                              "/runs --output " + d +
                              "/results.md --synthetic static_static --frames 31 --first-seed 101 --seeds 2 --recorded 2";
  // nothing was run: a table of nothing is told apart from one of zeros
  Outcome o = run(command + " --table", f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  const auto page = [&] {
    std::stringstream text;
    text << std::ifstream(f.path / "results.md").rdbuf();
    return text.str();
  };
  CHECK(page().find("with no of 2 seeds") != std::string::npos);
  o = run(command, f.path);
  REQUIRE(o.code == 0);
  CHECK(o.text.find("run 22/22") != std::string::npos);  // 5 variants of the recording and 6 of the synthetic one, twice
  const fs::path runs = fs::directory_iterator(f.path / "runs")->path();
  const json a = read_json(runs / "ablation.json");
  int looked_at = 0;
  for (const json& entry : a["by_sequence"]) {
    if (entry["runs"].empty()) continue;
    double sum = 0;
    for (const json& one : entry["runs"]) sum += 1e3 * one["ate_m"].get<double>();
    char cell[32];
    std::snprintf(cell, sizeof cell, "| %.1f ", sum / 2);
    CAPTURE(entry["variant"]);
    CHECK(page().find(cell) != std::string::npos);
    CHECK(page().find("(31 of 31)") != std::string::npos);
    ++looked_at;
  }
  CHECK(looked_at == 11);
  CHECK(page().find("| room | 2 | nominal stamps |") != std::string::npos);
  CHECK(page().find("with 2 of 2 seeds") != std::string::npos);
  CHECK(page().find("| pair |") == std::string::npos);

  // stopped halfway: a repetition that one variant lacks does not count, and is all that is made again
  fs::remove(runs / "default/static_static_max-frames_31_seed_101_r1/summary.json");
  REQUIRE(run(command + " --table", f.path).code == 0);
  CHECK(page().find("with 1 of 2 seeds") != std::string::npos);
  CHECK(page().find("The set is not complete.") != std::string::npos);
  o = run(command, f.path);
  REQUIRE(o.code == 0);
  std::size_t kept = 0;
  for (std::size_t at = o.text.find("(was done)"); at != std::string::npos; at = o.text.find("(was done)", at + 1)) ++kept;
  CHECK(kept == 21);
  CHECK(page().find("with 2 of 2 seeds") != std::string::npos);
}

TEST_CASE("one lost or broken run does not cost the table") {
  const Folder f;
  const std::string d = f.path.string();
  // frames without any feature: every one is LOST
  fs::create_directories(f.path / "blank/rgb");
  fs::create_directories(f.path / "blank/depth");
  std::ofstream list(f.path / "blank/associations.txt");
  std::ofstream truth(f.path / "blank/groundtruth.txt");
  for (int i = 0; i < 4; ++i) {
    const std::string stamp = std::to_string(i / 30.0);
    cv::imwrite(d + "/blank/rgb/" + stamp + ".png", cv::Mat(480, 640, CV_8UC3, cv::Scalar(99, 99, 99)));
    cv::imwrite(d + "/blank/depth/" + stamp + ".png", cv::Mat(480, 640, CV_16U, cv::Scalar(0)));
    list << stamp << " rgb/" << stamp << ".png " << stamp << " depth/" << stamp << ".png\n";
    truth << stamp << " " << i << " 0 0 0 0 0 1\n";
  }
  list.close();
  truth.close();
  REQUIRE(run_program("apso_track " + d + "/blank --camera tum-fr3 --quiet --output " + d + "/lost", f.path).code == 3);
  REQUIRE(run_program("apso_track synthetic:static_static --max-frames 3 --quiet --output " + d + "/good", f.path).code == 0);

  Outcome o = run_program("apso_assess " + d + "/lost " + d + "/good --output " + d + "/assessed", f.path);
  INFO(o.text);
  CHECK(o.code == 0);  // lost is a result
  json runs = read_json(f.path / "assessed/assess.json")["runs"];
  REQUIRE(runs.size() == 2);
  CHECK(runs[0]["lost"] == true);
  CHECK(runs[1]["lost"] == false);

  // what cannot be read is named, the rest is in the table
  fs::create_directories(f.path / "broken");
  std::ofstream(f.path / "broken/frames.csv") << "timestamp,state,label,S_final,S_total,feature_ok\n1,SPLENDID,,0.9,0.9,1\n";
  o = run_program("apso_assess " + d + "/broken " + d + "/good --output " + d + "/assessed", f.path);
  INFO(o.text);
  CHECK(o.code == 1);
  CHECK(o.text.find("frames.csv:2: the state is 'SPLENDID', expected INITIALISING, GOOD, BAD or LOST") != std::string::npos);
  CHECK(read_json(f.path / "assessed/assess.json")["runs"].size() == 1);

  // ground truth of another time
  std::ofstream(f.path / "other.txt") << "1000 0 0 0 0 0 0 1\n1001 0 0 0 0 0 0 1\n1002 0 0 0 0 0 0 1\n";
  o = run_program("apso_assess " + d + "/good=" + d + "/other.txt --output " + d + "/assessed", f.path);
  CHECK(o.code == 1);
  CHECK(o.text.find("no frame can be compared with the ground truth") != std::string::npos);
  o = run_program("apso_assess " + d + "/good --output " + d + "/good", f.path);
  CHECK(o.code == 1);
  CHECK(o.text.find("only read") != std::string::npos);

  const std::string ablate =
      "apso_ablate " + d + "/blank,camera=tum-fr3 synthetic:static_static,max-frames=3 --only default --jobs 1 --output " + d + "/ab";
  o = run_program(ablate, f.path);
  INFO(o.text);
  CHECK(o.code == 0);
  CHECK(o.text.find("(1 runs lost)") != std::string::npos);
  json row = read_json(f.path / "ab/ablation.json")["variants"][0];
  CHECK(row["runs"] == 2);
  CHECK(row["lost"] == 1);
  CHECK(row["ate_m"]["runs"] == 1);

  // an empty summary is no finished run, and a run that another file stands in for is missing
  std::ofstream(f.path / "ab/default/blank/summary.json", std::ios::trunc);
  o = run_program(ablate + " --table", f.path);
  CHECK(o.code == 0);
  CHECK(read_json(f.path / "ab/ablation.json")["variants"][0]["missing"] == 1);
  o = run_program(ablate, f.path);
  CHECK(o.code == 0);
  CHECK(o.text.find("was done") != std::string::npos);
  CHECK(read_json(f.path / "ab/ablation.json")["variants"][0]["missing"] == 0);
  std::ofstream(f.path / "ab/default/blank/frames.csv", std::ios::trunc) << "broken\n";
  o = run_program(ablate + " --table", f.path);
  INFO(o.text);
  CHECK(o.code == 1);
  CHECK(o.text.find("not in the table") != std::string::npos);
  CHECK(read_json(f.path / "ab/ablation.json")["variants"][0]["runs"] == 1);
}

TEST_CASE("wrong usage of the programs that read runs is named") {
  const Folder f;
  const std::string d = f.path.string();
  for (const char* program : {"apso_assess", "apso_ablate", "apso_calibrate"}) {
    CAPTURE(program);
    Outcome o = run_program(program, f.path);
    CHECK(o.code == 2);
    o = run_program(std::string(program) + " run --outptu x", f.path);
    CHECK(o.code == 2);
    CHECK(o.text.find("there is no option --outptu") != std::string::npos);
    o = run("cd " + d + " && " APSO_PROGRAMS "/" + program + " run --output ''", f.path);  // where an empty path would lead
    CHECK(o.code == 2);
    CHECK(o.text.find("--output: is empty") != std::string::npos);
  }
  for (const char* factor : {"nan", "inf", "0", "-1"}) {
    CAPTURE(factor);
    const Outcome o = run_program("apso_assess run --output " + d + "/x --failure-factor=" + factor, f.path);
    CHECK(o.code == 2);
    CHECK(o.text.find("expected a number from") != std::string::npos);
  }
  // a configuration that the user wrote is not replaced
  std::ofstream(f.path / "mine.yaml") << "tracker:\n";
  const Outcome o = run_program("apso_calibrate synthetic:static_static --output " + d + "/mine.yaml", f.path);
  CHECK(o.code == 1);
  CHECK(o.text.find("apso_calibrate did not write it") != std::string::npos);
}
#endif
