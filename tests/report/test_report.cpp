// apso_report and apso_track --report from the outside: what is in the page, what never breaks it, what is refused.
#include <doctest/doctest.h>
#ifndef APSO_REPORT
TEST_CASE("apso_report") { MESSAGE("skipped: the programs are not built (APSO_BUILD_EXAMPLES)"); }
#else

#include <cmath>

#include "../contains.hpp"
#include "../run_program.hpp"

namespace {

std::string bytes_of(const fs::path& file) {
  std::stringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

/// The JSON in the script element with this id.
json embedded(const std::string& page, const std::string& id) {
  const std::string open = "<script type=\"application/json\" id=\"" + id + "\">";
  const std::size_t begin = page.find(open);
  REQUIRE(begin != std::string::npos);
  const std::size_t end = page.find("</script>", begin);
  return json::parse(page.substr(begin + open.size(), end - begin - open.size()));
}

std::size_t occurrences(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

Outcome report(const std::string& arguments, const fs::path& folder) { return run(std::string(APSO_REPORT) + " " + arguments, folder); }

/// One run for all cases, made once.
const fs::path& run_of_walking() {
  static const Folder keep;
  static const fs::path out = keep.path / "the_run";
  if (!fs::exists(out)) {
    const Outcome o = run(std::string(APSO_TRACK) +
                              " synthetic:walking_xyz --seed 104 --max-frames 60 --spoil blank --quiet --report --output " + out.string(),
                          keep.path);
    INFO(o.text);
    REQUIRE(o.code == 0);
  }
  return out;
}

struct Work {
  fs::path path = run_of_walking().parent_path() / "work";
  Work() {
    fs::remove_all(path);
    fs::create_directories(path);
    fs::copy(run_of_walking(), path / "run", fs::copy_options::recursive);
  }
};

}  // namespace

TEST_CASE("a report holds every frame of the run, and its errors are those of the summary") {
  const fs::path& out = run_of_walking();
  const json summary = read_json(out / "summary.json");
  const std::string page = bytes_of(out / "report.html");
  const json data = embedded(page, "runs");
  REQUIRE(data["runs"].size() == 1);
  const json& r = data["runs"][0];
  const Table table(out / "frames.csv");
  CHECK(r["name"] == "the_run");
  CHECK(r["sequence"] == "walking_xyz");
  CHECK(r["state"].size() == table.rows.size());
  CHECK("\"" + r["explanation"][35].get<std::string>() + "\"" == table.field(35, "explanation"));
  CHECK(r["summary"]["command"].get<std::string>().find("apso_track synthetic:walking_xyz --seed 104") == 0);

  double squares = 0;
  int pairs = 0;
  for (const json& e : r["error"]) {
    if (e.is_null()) continue;
    squares += e.get<double>() * e.get<double>();
    ++pairs;
  }
  CHECK(pairs == summary["final"]["pairs"]);
  CHECK(std::sqrt(squares / pairs) == doctest::Approx(summary["final"]["ate"]["rmse"].get<double>()).epsilon(1e-9));

  const json pictures = embedded(page, "pictures");
  REQUIRE(pictures.size() == 1);
  CHECK(pictures[0].size() == table.rows.size());
  CHECK(pictures[0]["7"].get<std::string>().rfind("data:image/jpeg;base64,/9j/", 0) == 0);  // begins as a JPEG file does

  std::size_t bad_runs = 0;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    bad_runs += table.field(i, "state") == "BAD" && table.field(i - 1, "state") != "BAD" ? 1 : 0;
  }
  REQUIRE(bad_runs > 0);
  std::size_t told = 0;
  for (const json& e : r["events"]) told += e["kind"] == "BAD" ? 1 : 0;
  CHECK(told == bad_runs);

  CHECK(!contains(page, " src=\"http"));
  CHECK(contains(page, "default-src 'none'"));
}

TEST_CASE("a report pairs poses by the rule of all programs") {
  const Work w;
  std::ifstream in(w.path / "run/groundtruth.txt");
  std::stringstream late;  // stamps 15 ms off: a pair by the default rule, and none by that of evo
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    late << std::fixed << std::stod(line) + 0.015 << line.substr(line.find(' ')) << '\n';
  }
  in.close();
  std::ofstream(w.path / "run/groundtruth.txt") << late.str();
  const Outcome o = report((w.path / "run").string() + " --output " + (w.path / "late.html").string(), w.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  const json r = embedded(bytes_of(w.path / "late.html"), "runs")["runs"][0];
  int known = 0;
  for (const json& e : r["error"]) known += e.is_null() ? 0 : 1;
  CHECK(known == r["summary"]["final"]["pairs"]);
}

TEST_CASE("several runs are in one page, and a limit of size is kept") {
  const Work w;
  const std::string out = (w.path / "both.html").string();
  const Outcome o = report(run_of_walking().string() + " " + (w.path / "run").string() + "/ --megabytes 1 --output " + out, w.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  CHECK(fs::file_size(out) < 1000000);
  const std::string page = bytes_of(out);
  const json data = embedded(page, "runs");
  REQUIRE(data["runs"].size() == 2);
  CHECK(data["runs"][1]["name"] == "run");
  CHECK(embedded(page, "pictures")[1].size() > 10);
  CHECK(report(run_of_walking().string() + " --output " + out, w.path).code == 0);  // an earlier report is replaced
  CHECK(embedded(bytes_of(out), "runs")["runs"].size() == 1);
}

TEST_CASE("without small pictures, those of overlays/ are in the report; files that are no pictures are not") {
  const Work w;
  fs::remove_all(w.path / "run" / "thumbnails");
  std::ofstream(w.path / "run" / "overlays" / "notes.txt") << "mine";
  REQUIRE(report((w.path / "run").string() + " --output " + (w.path / "r.html").string(), w.path).code == 0);
  const std::size_t overlays = static_cast<std::size_t>(std::distance(fs::directory_iterator(w.path / "run" / "overlays"), {})) - 1;
  CHECK(embedded(bytes_of(w.path / "r.html"), "pictures")[0].size() == overlays);
}

TEST_CASE("text of files cannot break the page, neither can missing numbers") {
  const Work w;
  const fs::path in = w.path / "run";
  json summary = read_json(in / "summary.json");
  const std::string evil = "</script><b>\"&'<!--";
  summary["sequence"] = "synthetic:" + evil;
  summary["command"] = evil;
  summary["final"]["ate"]["rmse"] = nullptr;
  std::ofstream(in / "summary.json") << summary;
  std::string table = bytes_of(in / "frames.csv");
  const std::size_t word = table.find("\"INITIALISING: frame 3");
  REQUIRE(word != std::string::npos);
  table.replace(word + 1, 12, "</script>\xff\xfe<");
  const std::size_t row = table.find("\n5,") + 1;
  const std::size_t score = table.find("INITIALISING,,", row) + 14;
  table.replace(score, table.find(',', score) - score, "nan");
  std::ofstream(in / "frames.csv", std::ios::binary) << table;
  const fs::path strange = w.path / "<img src=x>\xff";
  fs::rename(in, strange);
  const Outcome o = report("'" + strange.string() + "' --output " + (w.path / "r.html").string(), w.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  const std::string page = bytes_of(w.path / "r.html");
  CHECK(occurrences(page, "</script") == 3);  // runs, pictures, program
  CHECK(!contains(page, "<img src=x>"));
  const json r = embedded(page, "runs")["runs"][0];
  CHECK(r["sequence"] == evil);
  CHECK(r["summary"]["command"] == evil);
  CHECK(r["name"] == "<img src=x>\xEF\xBF\xBD");
  CHECK(r["explanation"][2].get<std::string>().rfind("</script>\xEF\xBF\xBD\xEF\xBF\xBD<", 0) == 0);
  CHECK(r["columns"]["S_conf"][5].is_null());
}

TEST_CASE("what is no run is named, and nothing is written") {
  const Work w;
  const fs::path in = w.path / "run";
  const std::string to = " --output " + (w.path / "r.html").string();
  const auto refused = [&](const std::string& text, const std::string& arguments) {
    const Outcome o = report(arguments, w.path);
    INFO(o.text);
    CHECK(o.code == 1);
    CHECK(contains(o.text, text));
    CHECK(!fs::exists(w.path / "r.html"));
  };
  refused("nowhere: no such folder", (w.path / "nowhere").string() + to);
  fs::create_directories(w.path / "empty");
  refused("empty/frames.csv: cannot open", (w.path / "empty").string() + to);
  const std::string header = bytes_of(in / "frames.csv").substr(0, bytes_of(in / "frames.csv").find('\n') + 1);
  std::ofstream(in / "frames.csv") << header;
  refused("frames.csv: holds no frame", in.string() + to);
  std::ofstream(in / "frames.csv", std::ios::trunc).close();
  refused("frames.csv:1: the column 'timestamp' is missing", in.string() + to);
  fs::copy_file(run_of_walking() / "frames.csv", in / "frames.csv", fs::copy_options::overwrite_existing);
  std::ofstream(in / "summary.json") << "{\"sequence\": 1}";
  refused("summary.json: not a summary of apso_track", in.string() + to);
  fs::remove(in / "summary.json");
  refused("summary.json: cannot open", in.string() + to);
  refused("cannot write", run_of_walking().string() + " --output " + (w.path / "no" / "such" / "r.html").string());
  CHECK(report(to, w.path).code == 2);
}

TEST_CASE("a file that is no report is not replaced") {
  const Work w;
  const fs::path mine = w.path / "mine.html";
  std::ofstream(mine) << "<html>mine</html>";
  const Outcome o = report(run_of_walking().string() + " --output " + mine.string(), w.path);
  CHECK(o.code == 1);
  CHECK(contains(o.text, "mine.html: is there and is no report"));
  CHECK(bytes_of(mine) == "<html>mine</html>");
  fs::create_directories(w.path / "again");
  std::ofstream(w.path / "again" / "report.html") << "mine";
  const Outcome t = run(
      std::string(APSO_TRACK) + " synthetic:static_xyz --max-frames 2 --quiet --report --output " + (w.path / "again").string(), w.path);
  CHECK(t.code == 1);
  CHECK(contains(t.text, "report.html is there"));
  CHECK(bytes_of(w.path / "again" / "report.html") == "mine");
}
#endif
