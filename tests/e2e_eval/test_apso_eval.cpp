// Runs apso_eval as a user does: exit codes, messages, table and JSON.
#include <doctest/doctest.h>

#ifndef APSO_EVAL_PROGRAM

TEST_CASE("apso_eval") { MESSAGE("skipped: the programs are not built (APSO_BUILD_EXAMPLES)"); }

#else

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <sys/wait.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "../contains.hpp"

namespace {
struct Run {
  int code = -1;
  std::string out, err;
};

std::string temporary(const std::string& name) { return "/tmp/apso_eval_" + std::to_string(getpid()) + "_" + name; }
std::string slurp(const std::string& path) {
  std::ostringstream s;
  s << std::ifstream(path).rdbuf();
  return s.str();
}
Run run(const std::string& arguments) {
  const std::string out = temporary("out");
  const std::string err = temporary("err");
  const std::string command = "\"" APSO_EVAL_PROGRAM "\" " + arguments + " >" + out + " 2>" + err;
  const int status = std::system(command.c_str());
  Run r{WIFEXITED(status) ? WEXITSTATUS(status) : -1, slurp(out), slurp(err)};
  std::remove(out.c_str());
  std::remove(err.c_str());
  return r;
}

/// Trajectory files of one test. 8 Hz on a zigzag; the estimate is the same path elsewhere.
struct Files {
  std::string truth = temporary("truth.txt"), estimate = temporary("estimate.txt"), other = temporary("other.txt");
  Files() {
    std::ofstream t(truth);
    std::ofstream e(estimate);
    for (int i = 0; i < 41; ++i) {
      const double s = 0.125 * i;
      const double x = s;
      const double y = i % 2;
      t << 100 + s << ' ' << x << ' ' << y << " 0 0 0 0 1\n";
      e << 100 + s << ' ' << 7 + x << ' ' << y << " 0.5 0 0 0 1\n";
    }
  }
  ~Files() {
    for (const auto& f : {truth, estimate, other}) std::remove(f.c_str());
  }
  void write_other(const std::string& text) const { std::ofstream(other) << text; }
};
std::vector<std::string> keys(const nlohmann::ordered_json& j) {
  std::vector<std::string> k;
  for (const auto& item : j.items()) k.push_back(item.key());
  return k;
}
/// Bad input: not 0, nothing on standard output, one line that says what is wrong.
void fails(const Run& r, const std::string& message) {
  CAPTURE(r.err);
  CHECK(r.code == 1);
  CHECK(r.out.empty());
  CHECK(std::count(r.err.begin(), r.err.end(), '\n') == 1);
  CHECK(r.err.find("apso_eval: ") == 0);
  CHECK(r.err.find(message) != std::string::npos);
}
}  // namespace

TEST_CASE("JSON has exactly the documented keys, and the numbers of a shifted copy") {
  const Files f;
  const Run r = run(f.truth + " " + f.estimate + " --json");
  CHECK(r.code == 0);
  CHECK(r.err.empty());
  const auto j = nlohmann::ordered_json::parse(r.out);
  const std::vector<std::string> six{"rmse", "mean", "median", "std", "min", "max"};
  CHECK(keys(j) == std::vector<std::string>{"pairs", "pairs_possible", "poses", "format", "association", "alignment", "ate", "rpe"});
  CHECK(j["pairs_possible"] == 41);
  CHECK(j["format"] == "tum");
  CHECK(j["association"]["rule"] == "tum");
  CHECK(j["association"]["max_difference_s"] == 0.02);
  CHECK(j["alignment"]["kind"] == "se3");
  CHECK(j["alignment"]["scale"] == 1);
  CHECK(keys(j["ate"]) == six);
  CHECK(keys(j["rpe"]) == std::vector<std::string>{"delta", "form", "pairs", "translation", "rotation_deg"});
  CHECK(keys(j["rpe"]["translation"]) == six);
  CHECK(keys(j["rpe"]["rotation_deg"]) == six);
  CHECK(j["pairs"] == 41);
  CHECK(j["ate"]["rmse"].get<double>() < 1e-12);
  CHECK(j["rpe"]["delta"] == "1s");
  CHECK(j["rpe"]["pairs"] == 32);
  CHECK(j["rpe"]["translation"]["max"].get<double>() < 1e-12);
}

TEST_CASE("without alignment the shift (7, 0, 0.5) is the error") {
  const Files f;
  const auto j = nlohmann::ordered_json::parse(run(f.truth + " " + f.estimate + " --align none --json").out);
  CHECK(j["ate"]["rmse"].get<double>() == doctest::Approx(std::sqrt(49.25)));
  CHECK(j["ate"]["median"].get<double>() == doctest::Approx(std::sqrt(49.25)));
}

TEST_CASE("intervals of frames and of other lengths") {
  const Files f;
  const auto pairs = [&](const std::string& delta) {
    const auto j = nlohmann::ordered_json::parse(run(f.truth + " " + f.estimate + " --json --delta " + delta).out);
    CHECK(j["rpe"]["delta"] == delta);
    return j["rpe"]["pairs"].get<int>();
  };
  CHECK(pairs("1f") == 39);
  CHECK(pairs("5f") == 35);
  CHECK(pairs("0.5s") == 36);
  for (const char* bad : {"1", "s", "-1s", "0s", "1h", "1.5f", "1.2.3s", "nan", "1ss"}) {
    CAPTURE(bad);
    const Run r = run(f.truth + " " + f.estimate + " --delta=" + bad);
    fails(r, "--delta '" + std::string(bad) + "'");
  }
}

TEST_CASE("the table names rows and columns") {
  const Files f;
  const Run r = run(f.truth + " " + f.estimate + " --association evo");
  CHECK(r.code == 0);
  for (const char* word : {"ATE [m]", "RPE 1s [m]", "RPE 1s [deg]", "rmse", "median", "std", "pairs", "41"}) {
    CAPTURE(word);
    CHECK(r.out.find(word) != std::string::npos);
  }
}

TEST_CASE("an interval longer than the recording: ATE as usual, RPE null, a warning") {
  const Files f;
  const Run r = run(f.truth + " " + f.estimate + " --json --delta 100s");
  CHECK(r.code == 0);
  CHECK(r.err.find("warning") != std::string::npos);
  const auto j = nlohmann::ordered_json::parse(r.out);
  CHECK(j["pairs"] == 41);
  CHECK(j["ate"]["rmse"].is_number());
  CHECK(j["rpe"]["pairs"] == 0);
  CHECK(j["rpe"]["translation"]["rmse"].is_null());
  CHECK(j["rpe"]["rotation_deg"]["max"].is_null());
  CHECK(run(f.truth + " " + f.estimate + " --delta 100s").code == 0);
}

TEST_CASE("bad input ends with one clear line") {
  const Files f;
  fails(run("/no/such/file " + f.estimate), "/no/such/file: cannot open");
  fails(run(f.truth + " /no/such/file"), "/no/such/file: cannot open");
  fails(run(f.truth + " /tmp"), "/tmp: is a folder");
  f.write_other("");
  fails(run(f.truth + " " + f.other), "no pose found");
  f.write_other("100 0 0 0\n");
  fails(run(f.truth + " " + f.other), ":1: found 4 fields, expected 8 (TUM), 12 (KITTI)");
  fails(run(f.truth + " " + f.other + " --format tum"), ":1: found 4 fields, expected 8");
  f.write_other("100 0 0 abc 0 0 0 1\n");
  fails(run(f.truth + " " + f.other), ":1: field 4 (tz) is 'abc', expected a number");
  f.write_other("5000 0 0 0 0 0 0 1\n5001 1 0 0 0 0 0 1\n");
  fails(run(f.truth + " " + f.other), "0 pair(s) of poses within 0.02 s");
  fails(run(f.truth + " " + f.other + " --association evo"), "0 pair(s) of poses within 0.01 s");
}

TEST_CASE("an offset of the clocks") {
  const Files f;
  f.write_other("5100 0 0 0 0 0 0 1\n5100.125 0.125 1 0 0 0 0 1\n5100.25 0.25 0 0 0 0 0 1\n");
  const Run r = run(f.truth + " " + f.other + " --offset=-5000 --json");
  CHECK(r.code == 0);
  CHECK(nlohmann::ordered_json::parse(r.out)["pairs"] == 3);
}

TEST_CASE("unknown options and values fail, help succeeds") {
  const Files f;
  CHECK(run("").code != 0);
  CHECK(run(f.truth).code != 0);
  CHECK(run(f.truth + " " + f.estimate + " --align sim4").code == 2);
  CHECK(run(f.truth + " " + f.estimate + " --format bag").code == 2);
  CHECK(run(f.truth + " " + f.estimate + " --json --table csv").code == 2);
  CHECK(run(f.truth + " " + f.estimate + " --association x").code != 0);
  CHECK(run(f.truth + " " + f.estimate + " --nonsense").code != 0);
  const Run help = run("--help");
  CHECK(help.code == 0);
  for (const char* word : {"groundtruth", "estimate", "--align", "--association", "--delta", "--json", "Examples"}) {
    CHECK(help.out.find(word) != std::string::npos);
  }
}

TEST_CASE("lines that are not finite are warned about on standard error, JSON stays clean") {
  const Files f;
  f.write_other("100 0 0 0 0 0 0 1\n100.125 nan 0 0 0 0 0 1\n100.25 0.25 0 0 0 0 0 1\n100.375 0.375 1 0 0 0 0 1\n");
  const Run r = run(f.truth + " " + f.other + " --json");
  CHECK(r.code == 0);
  CHECK(r.err.find(":2: tx is not finite, line skipped") != std::string::npos);
  CHECK(nlohmann::ordered_json::parse(r.out)["pairs"] == 3);
}

namespace {
const std::string kOracle = std::string(APSO_SOURCE_DIR) + "/tests/evaluation/oracle/";
/// Cells of the lines of a table.
std::vector<std::vector<std::string>> cells(const std::string& text, char separator) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    rows.emplace_back();
    std::istringstream fields(line);
    for (std::string cell; std::getline(fields, cell, separator);) rows.back().push_back(cell);
  }
  return rows;
}
}  // namespace

TEST_CASE("the formats of TUM, KITTI and EuRoC are told apart and give the numbers of the oracle") {
  const Run euroc = run(kOracle + "truth_euroc.csv " + kOracle + "estimate_ns.txt --rpe paper --align sim3");
  CHECK(euroc.code == 0);
  CHECK(euroc.err.empty());
  for (const char* word :
       {"truth_euroc.csv (euroc, 160 poses)", "estimate_ns.txt (tum_ns, 77 poses)",
        "tum: greedy one-to-one, stamps less than 0.02 s apart; 77 of 77 pairs (100.0 %)", "scale 0.987996", "  0.016928   0.015558 "}) {
    CAPTURE(word);
    CHECK(contains(euroc.out, word));
  }
  const Run kitti = run(kOracle + "truth_kitti.txt " + kOracle + "estimate_kitti.txt --rpe paper --align yaw --gravity-axis y");
  CHECK(kitti.code == 0);
  for (const char* word :
       {"(kitti, 77 poses)", "by frame: poses of the same number", "  0.243071   0.229112 ", "RPE 1f [deg]                76   0.361104"}) {
    CAPTURE(word);
    CHECK(contains(kitti.out, word));
  }
  // without stamps there are no seconds, and no matching with a file that has them
  fails(run(kOracle + "truth_kitti.txt " + kOracle + "estimate_kitti.txt --delta 1s"),
        "KITTI poses have no stamps: give them with --times");
  fails(run(kOracle + "truth_kitti.txt " + kOracle + "estimate_kitti.txt --offset 1"), "KITTI poses have none");
  fails(run(kOracle + "truth_euroc.csv " + kOracle + "estimate_kitti.txt"), "give the times of the KITTI file with --times");
  fails(run(kOracle + "truth.txt " + kOracle + "estimate.txt --times " + kOracle + "truth.txt"), "--times: no file is of the KITTI format");
  const Files f;
  std::string times;
  for (int i = 0; i < 77; ++i) times += std::to_string(0.0666 * i) + "\n";
  f.write_other(times);
  const Run seconds = run(kOracle + "truth_kitti.txt " + kOracle + "estimate_kitti.txt --times " + f.other);
  CHECK(contains(seconds.out, "RPE 1s [m]"));
  CHECK(contains(seconds.out, "  0.163151   0.149083 "));
  // a forced format is not told from the file
  fails(run(kOracle + "truth_kitti.txt " + kOracle + "estimate.txt --format tum"), "truth_kitti.txt:1: found 12 fields, expected 8");
  CHECK(run(kOracle + "truth_euroc.csv " + kOracle + "estimate_ns.txt --groundtruth-format euroc --format tum_ns").code == 0);
}

TEST_CASE("several estimates in one table: bold is the best, the improvement is against the baseline, pairs are shown") {
  const Files f;
  std::ofstream(f.other) << std::ifstream(kOracle + "estimate.txt").rdbuf();
  const std::string better = temporary("better_a&b.txt");
  {
    std::istringstream lines(slurp(kOracle + "truth.txt"));
    std::ofstream out(better);
    int i = 0;
    for (std::string line; std::getline(lines, line); ++i) {
      if (line[0] == '#') continue;
      std::istringstream fields(line);
      double v[8];
      for (double& x : v) fields >> x;
      out << v[0] << ' ' << v[1] + 0.001 * (i % 2) << ' ' << v[2] << ' ' << v[3] << ' ' << v[4] << ' ' << v[5] << ' ' << v[6] << ' ' << v[7]
          << '\n';
    }
  }
  const std::string files = "'" + kOracle + "truth.txt' '" + kOracle + "estimate.txt' '" + better + "'";
  const auto ate = [&](const std::string& file) {
    return nlohmann::json::parse(run("'" + kOracle + "truth.txt' '" + file + "' --json").out)["ate"]["rmse"].get<double>();
  };
  const double first = ate(kOracle + "estimate.txt");
  const double second = ate(better);
  REQUIRE(second < first);
  const auto fixed = [](double v, int digits) {
    char text[40];
    std::snprintf(text, sizeof text, "%.*f", digits, v);
    return std::string(text);
  };

  const Run markdown = run(files + " --table markdown --names worse,a_b --digits 5");
  CHECK(markdown.code == 0);
  auto rows = cells(markdown.out, '|');
  REQUIRE(rows.size() >= 4);
  CHECK(rows[0][3] == " ATE \\[m\\] rmse ");
  CHECK(contains(markdown.out, "RPE 1s"));
  CHECK(rows[2][1] == " worse ");
  CHECK(rows[2][2] == " 77 of 77 (100.0 %) ");
  CHECK(rows[2][3] == " " + fixed(first, 5) + " ");
  CHECK(rows[2][5] == " - ");
  CHECK(rows[3][1] == " a\\_b ");
  CHECK(rows[3][2] == " 160 of 160 (100.0 %) ");
  CHECK(rows[3][3] == " **" + fixed(second, 5) + "** ");
  CHECK(rows[3][5] == " " + fixed(100 * (first - second) / first, 2) + " ");
  CHECK(contains(markdown.out, "stamps less than 0.02 s apart"));
  CHECK(contains(markdown.err, "77 pairs, another estimate has 160"));

  const Run latex = run(files + " --table latex --baseline '" + better + "'");
  CHECK(contains(latex.out, "a\\&b & 160 of 160 (100.0 \\%) & \\textbf{" + fixed(second, 6) + "}"));
  CHECK(contains(latex.out, fixed(100 * (second - first) / second, 2)));
  CHECK(contains(latex.out, "\\begin{tabular}{lrrrrrrrrrrr}"));

  const Run csv = run(files + " --table csv --baseline estimate");
  rows = cells(csv.out, ',');
  REQUIRE(rows.size() == 3);
  CHECK(rows[0].size() == rows[2].size());
  CHECK(rows[0][4] == "pairs");
  CHECK(rows[1][4] == "77");
  CHECK(std::stod(rows[2][10]) == doctest::Approx(second).epsilon(1e-8));
  CHECK(std::stod(rows[2][16]) == doctest::Approx(100 * (first - second) / first).epsilon(1e-6));

  const Run text = run(files);
  CHECK(contains(text.out, fixed(second, 6) + "*"));
  const auto j = nlohmann::ordered_json::parse(run(files + " --json").out);
  REQUIRE(j["estimates"].size() == 2);
  CHECK(j["estimates"][1]["ate"]["rmse"].get<double>() == second);
  CHECK(j["baseline"] == "estimate");
  fails(run(files + " --baseline nobody"), "--baseline 'nobody': no such estimate, expected one of estimate, ");
  fails(run(files + " --names one"), "--names: 1 names for 2 estimates");
  std::remove(better.c_str());
}

TEST_CASE("an error over less than 90 % of the poses is warned about, marked, and not the best") {
  const Files f;
  std::string half;  // every other pose 15 ms late: within 20 ms, not within 10 ms
  for (int i = 0; i < 41; ++i)
    half +=
        std::to_string(100 + 0.125 * i + (i % 2) * 0.015) + " " + std::to_string(0.125 * i) + " " + std::to_string(i % 2) + " 0 0 0 0 1\n";
  f.write_other(half);
  const Run whole = run(f.truth + " " + f.other);
  CHECK(whole.err.empty());
  CHECK(contains(whole.out, "41 of 41 pairs"));
  const Run part = run(f.truth + " " + f.other + " --association evo");
  CHECK(part.code == 0);
  CHECK(contains(part.err, "the ATE is over 21 of 41 poses (51.2 %), less than 90 %"));
  CHECK(contains(part.out, "evo: nearest stamp of the longer list, at most 0.01 s apart; 21 of 41 pairs (51.2 %)"));
  const Run table = run(f.truth + " " + f.estimate + " " + f.other + " --association evo --names whole,part");
  CHECK(contains(table.out, "21 of 41 (51.2 %) !"));
  const auto rows = cells(table.out, '\n');
  CHECK(contains(rows[1][0], "*"));
  CHECK(!contains(rows[2][0], "*"));
}

TEST_CASE("the picture of an evaluation: PNG, SVG and PDF, and nothing of the user's is overwritten") {
  const Files f;
  if (std::system("gnuplot --version >/dev/null 2>&1") != 0) {
    MESSAGE("skipped: gnuplot is not installed");
    return;
  }
  const std::string both = f.truth + " " + f.estimate;
  const std::string svg = temporary("plot.svg");
  CHECK(run(both + " --plot " + svg).code == 0);
  const std::string text = slurp(svg);
  for (const char* word : {"</svg>", "plane of the largest extent, x and y", "ATE rmse 0.0000 m, 41 of 41 pairs", "position error [m]",
                           "time [s]", "start", "end"}) {
    CAPTURE(word);
    CHECK(contains(text, word));
  }
  CHECK(run(both + " --plot " + svg).code == 0);  // its own picture may be replaced
  for (const char* extension : {"png", "pdf"}) {
    const std::string file = temporary(std::string("plot.") + extension);
    CHECK(run(both + " --plot " + file).code == 0);
    CHECK(slurp(file).size() > 5000);
    std::remove(file.c_str());
  }
  std::ofstream(svg) << "notes of the user";
  fails(run(both + " --plot " + svg), "exists and is no such picture");
  CHECK(slurp(svg) == "notes of the user");
  fails(run(both + " --plot " + f.truth), "expected a file .png, .svg or .pdf");
  fails(run(both + " --plot /no/such/folder/a.png"), "was not drawn");
  std::remove(svg.c_str());
}

// Recordings that are not part of the repository, see ../evaluation/test_published_numbers.cpp; without them these cases are skipped.
namespace {
std::string folder_of(const char* variable, const std::string& otherwise) {
  const char* value = std::getenv(variable);
  return value != nullptr ? std::string(value) + "/" : otherwise;
}
std::string recordings() { return folder_of("APSO_DATA_DIR", std::string(APSO_SOURCE_DIR) + "/../shared/data/") + "trajectories/"; }
/// The folder test/data of the repository of evo.
std::string evo_data() { return folder_of("APSO_EVO_DATA", "no folder/"); }
bool missing(const std::string& file) { return !std::ifstream(file).good(); }
nlohmann::json evaluated(const std::string& arguments) {
  const Run r = run(arguments + " --json");
  CAPTURE(r.err);
  REQUIRE(r.code == 0);
  return nlohmann::json::parse(r.out);
}
/// Equal to the six decimals that were published.
void same(const nlohmann::json& value, double published) {
  INFO("value " << value << ", published " << published);
  CHECK(std::abs(value.get<double>() - published) <= 0.51e-6);
}
}  // namespace

TEST_CASE("published: apso_eval on TUM recordings, evo and the scripts of the benchmark" *
          doctest::skip(missing(recordings() + "groundtruth/fr2_desk.txt"))) {
  const auto files = [](const std::string& truth, const std::string& estimate) {
    return recordings() + "groundtruth/" + truth + ".txt " + recordings() + "estimated/" + estimate + ".txt";
  };
  struct Row {
    const char *truth, *estimate;
    int pairs;
    double rmse, mean, std;
  };
  for (const Row& row : {Row{"fr3_walking_xyz", "fr3_walking_xyz_orbslam3", 826, 0.665905, 0.541956, 0.386929},
                         Row{"fr3_walking_xyz", "fr3_walking_xyz_lccrf", 826, 0.022131, 0.019175, 0.011050},
                         Row{"fr2_desk", "fr2_desk_ORB", 2174, 0.008119, 0.007492, 0.003129},
                         Row{"fr1_xyz", "fr1_xyz_rgbdslam", 785, 0.013470, 0.012024, 0.006071}}) {
    const auto j = evaluated(files(row.truth, row.estimate) + " --association evo");
    CHECK(j["pairs"] == row.pairs);
    same(j["ate"]["rmse"], row.rmse);
    same(j["ate"]["mean"], row.mean);
    same(j["ate"]["std"], row.std);
  }
  const auto second = evaluated(files("fr2_desk", "fr2_desk_ORB"));
  CHECK(second["pairs"] == 2223);
  same(second["ate"]["rmse"], 0.008144);
  CHECK(second["rpe"]["pairs"] == 1998);
  same(second["rpe"]["translation"]["rmse"], 0.007161);
  same(second["rpe"]["rotation_deg"]["rmse"], 0.455005);
  const auto frame = evaluated(files("fr2_desk", "fr2_desk_ORB") + " --delta 1f");
  CHECK(frame["rpe"]["pairs"] == 2060);
  same(frame["rpe"]["translation"]["rmse"], 0.003381);
  same(frame["rpe"]["rotation_deg"]["rmse"], 0.266378);
}

TEST_CASE("published: apso_eval on EuRoC V1_02, results of evo" * doctest::skip(missing(evo_data() + "V102_groundtruth.csv"))) {
  // evo's own code on its test data. Four stamps of the estimate occur twice: the first of each counts here, and was given to evo.
  const std::string files = evo_data() + "V102_groundtruth.csv " + evo_data() + "V102.txt --association evo";
  const auto rigid = evaluated(files);
  CHECK(rigid["pairs"] == 794);
  same(rigid["ate"]["rmse"], 0.0917473311197747);
  same(rigid["ate"]["mean"], 0.0815357943944815);
  same(rigid["ate"]["median"], 0.07776140714160776);
  same(rigid["ate"]["std"], 0.042065270711864215);
  same(rigid["ate"]["max"], 0.25615233960927103);
  const auto scaled = evaluated(files + " --align sim3");
  same(scaled["ate"]["rmse"], 0.08384832612734207);
  same(scaled["ate"]["min"], 0.007165746854236681);
}

TEST_CASE("published: apso_eval on KITTI 00, results of evo" * doctest::skip(missing(evo_data() + "KITTI_00_gt.txt"))) {
  // test/data/res_files/orb_ape.zip and sptam_ape.zip of evo
  const auto orb = evaluated(evo_data() + "KITTI_00_gt.txt " + evo_data() + "KITTI_00_ORB.txt");
  CHECK(orb["format"] == "kitti");
  CHECK(orb["pairs"] == 4541);
  same(orb["ate"]["rmse"], 1.3034497145650266);
  same(orb["ate"]["mean"], 1.1569971285389768);
  same(orb["ate"]["median"], 1.065624769555848);
  same(orb["ate"]["std"], 0.6002822693968323);
  same(orb["ate"]["max"], 3.587949120678954);
  const auto sptam =
      evaluated(evo_data() + "KITTI_00_gt.txt " + evo_data() + "KITTI_00_SPTAM.txt --times " + evo_data() + "KITTI_00_gt_times.txt");
  same(sptam["ate"]["rmse"], 3.738487907582613);
  same(sptam["ate"]["min"], 0.694787347406252);
}

#endif
