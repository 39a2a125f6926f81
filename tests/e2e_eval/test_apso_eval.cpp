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
  CHECK(keys(j) == std::vector<std::string>{"pairs", "ate", "rpe"});
  CHECK(keys(j["ate"]) == six);
  CHECK(keys(j["rpe"]) == std::vector<std::string>{"delta", "pairs", "translation", "rotation_deg"});
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
  fails(run(f.truth + " " + f.other), ":1: found 4 fields, expected 8");
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
  CHECK(run(f.truth + " " + f.estimate + " --align sim3").code != 0);
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

#endif
