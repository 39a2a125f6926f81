// What the programs do with input that is wrong, output that cannot be written, and signals. docs/reliability.md lists these cases.
#ifdef APSO_TRACK
#include <doctest/doctest.h>

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "../run_program.hpp"

namespace {

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

std::string bytes_of(const fs::path& file) {
  std::stringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

/// All files below a folder with their content.
std::map<std::string, std::string> content(const fs::path& folder) {
  std::map<std::string, std::string> all;
  for (const auto& e : fs::recursive_directory_iterator(folder)) {
    if (e.is_regular_file()) all[fs::relative(e.path(), folder).string()] = bytes_of(e.path());
  }
  return all;
}

/// A recording of 4 frames with true masks, and apso_track on it.
struct Recording : Folder {
  fs::path in = path / "rec";
  fs::path out = path / "out";
  Recording() { REQUIRE(run(std::string(APSO_SYNTH) + " walking_xyz --frames 4 --quiet --output " + in.string(), path).code == 0); }
  [[nodiscard]] Outcome track(const std::string& more) const { return track(in.string(), more + " --output " + out.string()); }
  [[nodiscard]] Outcome track(const std::string& sequence, const std::string& more) const {
    return run(std::string(APSO_TRACK) + " '" + sequence + "' --camera " + (in / "camera.yaml").string() + " --quiet " + more, path);
  }
  /// Writes the first columns of each line of a list or trajectory again, changed by `change`.
  void rewrite(const std::string& file, const std::function<std::string(int line, std::vector<std::string> fields)>& change) const {
    std::stringstream lines(bytes_of(in / file));
    std::ofstream changed(in / file);
    int n = 0;
    for (std::string line; std::getline(lines, line);) {
      if (line.empty() || line[0] == '#') continue;
      std::stringstream words(line);
      std::vector<std::string> fields;
      for (std::string w; words >> w;) fields.push_back(w);
      changed << change(n++, fields) << '\n';
    }
  }
};

/// apso_track on a recording without end, in the background.
class Endless {
 public:
  explicit Endless(const fs::path& out) : pid_((std::fflush(nullptr), ::fork())) {
    if (pid_ != 0) return;
    const std::string log = out.string() + ".log";
    if (std::freopen(log.c_str(), "w", stdout) == nullptr || ::dup2(1, 2) < 0) ::_exit(127);
    ::execl(APSO_TRACK, "apso_track", "synthetic:walking_xyz", "--max-frames", "100000", "--quiet", "--output", out.c_str(), nullptr);
    ::_exit(127);
  }
  ~Endless() { stop(SIGKILL); }
  Endless(const Endless&) = delete;
  Endless& operator=(const Endless&) = delete;
  /// Sends a signal and waits. \returns what a shell would
  int stop(int signal) {
    if (pid_ <= 0) return -1;
    int status = 0;
    ::kill(pid_, signal);
    ::waitpid(pid_, &status, 0);
    pid_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  /// Waits until a file has that many lines. \returns false if the program ended before
  bool wait_for(const fs::path& file, int lines) {
    while (true) {
      const std::string text = bytes_of(file);
      if (std::count(text.begin(), text.end(), '\n') >= lines) return true;
      if (::waitpid(pid_, nullptr, WNOHANG) == pid_) return pid_ = 0, false;
      ::usleep(10000);
    }
  }

 private:
  pid_t pid_;
};

std::string joined(const std::vector<std::string>& fields) {
  std::string line;
  for (const std::string& f : fields) line += (line.empty() ? "" : " ") + f;
  return line;
}

}  // namespace

TEST_CASE("an output folder that is, contains or lies in an input is refused, and nothing in it is changed") {
  const Recording r;
  fs::create_directory_symlink(r.in, r.path / "link");
  fs::create_directories(r.path / "elsewhere");
  fs::rename(r.in / "depth", r.path / "elsewhere" / "depth");
  fs::create_directory_symlink(r.path / "elsewhere" / "depth", r.in / "depth");
  fs::create_directories(r.path / "masks");
  fs::copy(r.in / "masks", r.path / "masks" / "all");
  const auto before = content(r.path / "rec");
  const std::string in = r.in.string();
  const std::string masks = " --masks " + (r.path / "masks" / "all").string();
  const std::vector<std::string> outputs{in,
                                         in + "/new",
                                         in + "/new/../new/deep",
                                         r.path.string(),
                                         (r.path / "link").string(),
                                         (r.path / "link" / "new").string(),
                                         in + "/masks",
                                         in + "/../rec",
                                         (r.path / "elsewhere").string(),
                                         (r.path / "elsewhere" / "depth" / "new").string(),
                                         (r.path / "masks").string(),
                                         (r.path / "masks" / "all" / "new").string()};
  for (const std::string& output : outputs) {
    CAPTURE(output);
    const Outcome o = r.track(in, masks + " --write-masks --output " + output);
    CAPTURE(o.text);
    CHECK(o.code == 1);
    CHECK(has(o.text, "only read"));
  }
  CHECK(content(r.path / "rec") == before);
  CHECK_FALSE(fs::exists(r.path / "masks" / "all" / "new"));

  // the programs that are given folders write nowhere near them either
  const Outcome again = run(std::string(APSO_SYNTH) + " static_xyz --frames 2 --quiet --output " + r.path.string() + "/masks", r.path);
  CHECK(again.code == 0);  // masks/ holds no recording
  const Outcome csv = run(std::string(APSO_MOTION) + " " + in + "@tum-fr3 --policies none --csv " + in + "/groundtruth.txt", r.path);
  CHECK(csv.code == 1);
  CHECK(content(r.path / "rec") == before);
}

TEST_CASE("files in an output folder that no run wrote are neither replaced nor removed") {
  const Recording r;
  fs::create_directories(r.out);
  std::ofstream(r.out / "groundtruth.txt") << "mine";
  Outcome o = r.track("");
  CAPTURE(o.text);
  CHECK(o.code == 1);
  CHECK(has(o.text, "groundtruth.txt is there, and no run has it in its list apso_files.txt"));
  CHECK(content(r.out).size() == 1);
  CHECK(bytes_of(r.out / "groundtruth.txt") == "mine");

  // a recording is not replaced by a synthetic one, but one that apso_synth made is
  const fs::path own = r.path / "own";
  fs::create_directories(own);
  std::ofstream(own / "rgb.txt") << "mine";
  const std::string synth = std::string(APSO_SYNTH) + " static_static --quiet --output ";
  CHECK(run(synth + own.string() + " --frames 2", r.path).code == 1);
  CHECK(content(own).size() == 1);
  CHECK(run(synth + r.in.string() + " --frames 2", r.path).code == 0);
  CHECK(std::distance(fs::directory_iterator(r.in / "rgb"), fs::directory_iterator()) == 2);

  // a link is not followed out of the folder
  fs::remove_all(r.out);
  fs::create_directories(r.out);
  fs::create_directories(r.path / "pictures");
  fs::create_directory_symlink(r.path / "pictures", r.out / "overlays");
  CHECK(r.track("").code == 1);
  CHECK(fs::is_empty(r.path / "pictures"));
}

TEST_CASE("results of two runs never mix") {
  const Recording r;
  REQUIRE(r.track("--write-masks").code == 0);
  std::ofstream(r.out / "overlays" / "000099.png") << "mine";
  REQUIRE(fs::exists(r.out / "groundtruth.txt"));
  fs::remove(r.in / "groundtruth.txt");
  const Outcome o = r.track("--max-frames 2");
  INFO(o.text);
  REQUIRE(o.code == 0);
  CHECK_FALSE(fs::exists(r.out / "groundtruth.txt"));  // of the run before
  CHECK_FALSE(fs::exists(r.out / "masks"));
  CHECK_FALSE(fs::exists(r.out / "unfinished"));
  CHECK(bytes_of(r.out / "overlays" / "000099.png") == "mine");
  const auto done = content(r.out);

  // a run that fails, and one that is killed in the middle, leave the results as they are
  CHECK(r.track("--masks " + (r.path / "nowhere").string()).code == 1);
  CHECK(content(r.out) == done);
  Endless endless(r.out);
  REQUIRE(endless.wait_for(r.out / "unfinished" / "frames.csv", 2));
  CHECK(endless.stop(SIGKILL) == 128 + SIGKILL);
  CHECK(bytes_of(r.out / "summary.json") == done.at("summary.json"));
  CHECK(bytes_of(r.out / "frames.csv") == done.at("frames.csv"));
  CHECK(Table(r.out / "unfinished" / "frames.csv").rows.size() >= 1);
  CHECK(r.track("--max-frames 2").code == 0);
  CHECK_FALSE(fs::exists(r.out / "unfinished"));
}

TEST_CASE("two runs do not write into one folder at a time") {
  const Folder f;
  const fs::path out = f.path / "out";
  Endless endless(out);
  REQUIRE(endless.wait_for(out / "unfinished" / "frames.csv", 1));
  const Outcome second = run(std::string(APSO_TRACK) + " synthetic:walking_xyz --max-frames 1 --quiet --output " + out.string(), f.path);
  CHECK(second.code == 1);
  CHECK(has(second.text, "another run is writing into it"));
}

TEST_CASE("a signal to stop keeps what was computed") {
  for (const int signal : {SIGINT, SIGHUP, SIGTERM, SIGPIPE}) {
    CAPTURE(signal);
    const Folder f;
    const fs::path out = f.path / "out";
    Endless endless(out);
    REQUIRE(endless.wait_for(out / "unfinished" / "frames.csv", 4));
    CHECK(endless.stop(signal) == 128 + signal);
    const json summary = read_json(out / "summary.json");
    CHECK(summary["failure"] == "interrupted");
    const auto poses = summary["frames"]["with_pose"].get<std::size_t>();
    CHECK(poses >= 3);
    const std::string trajectory = bytes_of(out / "trajectory.txt");
    CHECK(static_cast<std::size_t>(std::count(trajectory.begin(), trajectory.end(), '\n')) >= poses);
    CHECK(Table(out / "frames.csv").rows.size() == poses);
  }
}

TEST_CASE("output that cannot be written is told, and the exit code is not zero") {
  const Recording r;
  REQUIRE(r.track("--max-frames 2").code == 0);
  const auto before = content(r.out);
  // no file may have more than some kB, as on a full disk: first not even the table of frames, then all but the pictures
  for (const char* limit : {"1", "16"}) {
    CAPTURE(limit);
    const Outcome full = run("sh -c 'ulimit -f " + std::string(limit) + "; " + APSO_TRACK + " " + r.in.string() + " --camera " +
                                 (r.in / "camera.yaml").string() + " --quiet --output " + r.out.string() + "'",
                             r.path);
    CAPTURE(full.text);
    CHECK(full.code == 1);
    CHECK(has(full.text, "File too large"));
    CHECK(has(full.text, "unfinished"));
    auto kept = content(r.out);
    for (auto it = kept.begin(); it != kept.end();) it = it->first.rfind("unfinished", 0) == 0 ? kept.erase(it) : std::next(it);
    CHECK(kept == before);  // the results before
  }
  CHECK(fs::file_size(r.out / "unfinished" / "trajectory.txt") > 0);

  const std::string to_full = " > /dev/full 2>&1";
  const std::string truth = (r.in / "groundtruth.txt").string();
  CHECK(std::system((std::string(APSO_EVAL) + " " + truth + " " + truth + to_full).c_str()) != 0);
  CHECK(std::system((std::string(APSO_EVAL) + " " + truth + " " + truth + " > /dev/null 2>&1").c_str()) == 0);
  const std::string csv = " --csv " + (r.path / "no" / "x.csv").string();
  CHECK(run(std::string(APSO_MOTION) + " synthetic:static_static --frames 1 --policies none" + csv, r.path).code == 1);
}

TEST_CASE("bytes that are not UTF-8 in names do not cost the summary") {
  const Recording r;
  const fs::path odd = r.path / "rec\xff\xfe";
  fs::rename(r.in, odd);
  fs::create_symlink(odd / "camera.yaml", r.path / "camera.yaml");
  std::ofstream(odd / "rgb" / "x\xe9.png") << "no image";
  std::stringstream lines(bytes_of(odd / "associations.txt"));
  std::ofstream list(odd / "associations.txt");
  int n = 0;
  for (std::string stamp, rgb, stamp2, depth; lines >> stamp >> rgb >> stamp2 >> depth; ++n) {
    list << stamp << ' ' << (n == 3 ? "rgb/x\xe9.png" : rgb) << ' ' << stamp2 << ' ' << depth << '\n';
  }
  list.close();
  const Outcome o = run(std::string(APSO_TRACK) + " '" + odd.string() + "' --camera " + (r.path / "camera.yaml").string() +
                            " --quiet --output " + r.out.string(),
                        r.path);
  INFO(o.text);
  CHECK(o.code == 0);
  const json summary = read_json(r.out / "summary.json");
  CHECK(has(summary["sequence"].get<std::string>(), "rec\xEF\xBF\xBD"));  // U+FFFD
  REQUIRE(summary["skipped"].size() == 1);
  CHECK(has(summary["skipped"][0]["reason"].get<std::string>(), "x\xEF\xBF\xBD.png"));
}

TEST_CASE("masks are counted, and a run that could use none of them fails") {
  const Recording r;
  fs::create_directories(r.path / "masks");
  const std::string given = "--masks " + (r.path / "masks").string();
  const auto each_mask = [&](auto&& change) {
    fs::remove_all(r.path / "masks");
    fs::copy(r.in / "masks", r.path / "masks");
    int n = 0;
    for (const auto& e : std::vector<fs::directory_entry>(fs::directory_iterator(r.path / "masks"), fs::directory_iterator()))
      change(e.path(), n++);
  };
  const auto check = [&](const char* motion, int code, const std::string& text) {
    CAPTURE(motion);
    const Outcome o = r.track(given + " --motion " + motion);
    CAPTURE(o.text);
    CHECK(o.code == code);
    CHECK(has(o.text, text));
    CHECK(has(o.text, "no frame has a mask that fits") == (code != 0));
  };
  check("geometric", 1, "masks: 0 of 4 frames have one that fits, 0 do not fit");  // an empty folder
  each_mask([](const fs::path& file, int) { std::ofstream(file) << "no image"; });
  check("geometric", 1, "masks: 0 of 4 frames have one that fits, 4 do not fit, e.g. ");
  each_mask([](const fs::path& file, int) { cv::imwrite(file.string(), cv::Mat(24, 32, CV_8U, cv::Scalar(255))); });
  check("precomputed", 1, "the mask is 32x24, expected the size of the images, 640x480");
  each_mask([&](const fs::path& file, int n) { fs::rename(file, r.path / "masks" / (std::to_string(100 + n) + ".5.png")); });
  check("precomputed", 1, "masks: 0 of 4 frames have one that fits, 0 do not fit");
  each_mask([](const fs::path& file, int n) { n < 1 ? (void)(std::ofstream(file) << "no image") : (void)(n < 3 && fs::remove(file)); });
  for (const char* motion : {"geometric", "precomputed"}) check(motion, 0, "masks: 1 of 4 frames have one that fits, 1 do not fit, e.g. ");
}

TEST_CASE("masks of 16 bit and of colours count as those of 8 bit do") {
  const Recording r;
  const auto ratio = [&](const std::string& arguments) {  // sum over the frames
    const Outcome o = r.track(arguments);
    REQUIRE_MESSAGE(o.code == 0, o.text);
    const Table table(r.out / "frames.csv");
    double sum = 0;
    for (std::size_t i = 0; i < table.rows.size(); ++i) sum += std::stod(table.field(i, "dynamic_ratio"));
    return sum;
  };
  const std::string motion = " --motion precomputed --masks ";
  const double expected = ratio(motion + (r.in / "masks").string());
  REQUIRE(expected > 0.1);
  for (const int type : {CV_16UC1, CV_8UC3}) {
    CAPTURE(type);
    fs::create_directories(r.path / "masks");
    for (const auto& e : fs::directory_iterator(r.in / "masks")) {
      const cv::Mat mask = cv::imread(e.path().string(), cv::IMREAD_UNCHANGED);
      cv::Mat labels(mask.size(), type, cv::Scalar(0, 0, 0, 255));
      labels.setTo(cv::Scalar(1, 0, 0, 255), mask);  // label 1 of 65535, or a dark blue
      cv::imwrite((r.path / "masks" / e.path().filename()).string(), labels);
    }
    CHECK(ratio(motion + (r.path / "masks").string()) == doctest::Approx(expected));
  }
}

TEST_CASE("detections are counted, and a run in which no stamp is that of a frame fails") {
  const Recording r;
  const std::string file = (r.path / "boxes.txt").string();
  for (const char* motion : {"geometric", "precomputed"}) {
    CAPTURE(motion);
    std::ofstream(file) << "1000.0 10 10 50 50 0.9 0\n";
    Outcome o = r.track("--detections " + file + " --motion " + motion);
    CHECK(o.code == 1);
    CHECK(has(o.text, "detections: 0 of 4 frames have some"));
    CHECK(has(o.text, "no stamp is that of a frame"));
    std::ofstream(file) << "0.0 10 10 50 50 0.9 0\n";
    o = r.track("--detections " + file + " --motion " + motion);
    CHECK(o.code == 0);
    CHECK(has(o.text, "detections: 1 of 4 frames have some"));
  }
  // a file that says that there is nothing was used
  fs::create_directories(r.path / "boxes");
  std::ofstream(r.path / "boxes" / "0.000000.txt") << "";
  CHECK(r.track("--detections " + (r.path / "boxes").string()).code == 0);
}

TEST_CASE("ground truth that cannot be compared is told") {
  const Recording r;
  const std::string truth = bytes_of(r.in / "groundtruth.txt");
  const auto told = [&](int code, const std::string& text) {
    const Outcome o = r.track("");
    CAPTURE(o.text);
    CHECK(o.code == code);
    CHECK(has(o.text, text));
  };
  const std::string unknown = "the errors are not known: the ground truth cannot be compared: ";
  std::ofstream(r.in / "groundtruth.txt") << "0 0 0 0 0 0 0 1\n";
  told(0, unknown + "1 pair(s) of poses within 0.02 s, need 3");
  CHECK(has(read_json(r.out / "summary.json")["evaluation_problem"].get<std::string>(), "1 pair"));
  std::ofstream(r.in / "groundtruth.txt") << truth;
  r.rewrite("groundtruth.txt", [](int, std::vector<std::string> f) { return f[0] = std::to_string(std::stod(f[0]) + 1000), joined(f); });
  told(0, "the ground truth covers 1000.000 .. ");
  std::ofstream(r.in / "groundtruth.txt") << truth;
  r.rewrite("groundtruth.txt", [](int n, std::vector<std::string> f) { return f[1] = n % 2 == 0 ? "1e200" : "-1e200", joined(f); });
  told(1, "no pose found");  // a position that no camera has is no pose
  fs::remove(r.in / "groundtruth.txt");
  fs::create_symlink("groundtruth.txt", r.in / "groundtruth.txt");
  told(1, "groundtruth.txt: cannot open");
}

TEST_CASE("timestamps that are no seconds or far apart are told once") {
  const Recording r;
  const auto warnings = [&](const std::string& text) {
    const Outcome o = r.track("");
    CAPTURE(o.text);
    const std::size_t at = o.text.find("warning: ");
    REQUIRE(at != std::string::npos);
    CHECK(o.text.find("warning: ", at + 1) == std::string::npos);
    CHECK(has(o.text, text));
  };
  const std::string lists = bytes_of(r.in / "associations.txt");
  fs::remove(r.in / "groundtruth.txt");
  const auto stretch = [&](double factor, const std::string& start) {
    std::ofstream(r.in / "associations.txt") << lists;
    r.rewrite("associations.txt", [&](int n, std::vector<std::string> f) {
      f[0] = f[2] = start + std::to_string(static_cast<long long>(factor * n) + 10'000'000'000);
      return joined(f);
    });
  };
  stretch(1e9 / 30, "14036365");
  warnings("the timestamps look like nanoseconds");
  stretch(10, "");
  warnings("the frames are 10 s apart");

  // nanoseconds are told from seconds; read as seconds, they are refused
  const fs::path euroc = r.path / "euroc.txt";
  std::ofstream(euroc) << "1403636579763555584 0 0 0 0 0 0 1\n1403636579813555456 1 0 0 0 0 0 1\n1403636579863555584 1 1 0 0 0 0 1\n";
  const std::string command = std::string(APSO_EVAL) + " " + euroc.string() + " " + euroc.string();
  const Outcome told = run(command, r.path);
  CHECK(told.code == 0);
  CHECK(has(told.text, "euroc.txt (tum_ns, 3 poses)"));
  const Outcome o = run(command + " --format tum", r.path);
  CHECK(o.code == 1);
  CHECK(has(o.text, "euroc.txt: the timestamps look like nanoseconds"));
  CHECK(has(o.text, "--format tum_ns"));
}

TEST_CASE("paths in the lists of a recording do not lead out of it") {
  const Recording r;
  for (const std::string& outside :
       {std::string("../other.png"), std::string("rgb/../../other.png"), (r.in / "rgb" / "0.000000.png").string()}) {
    CAPTURE(outside);
    std::ofstream(r.in / "associations.txt") << "0.0 " << outside << " 0.0 depth/0.000000.png\n";
    const Outcome o = r.track("");
    CHECK(o.code == 1);
    CHECK(has(o.text, "expected files in this folder"));
  }
}

TEST_CASE("apso_motion refuses true masks and frames of another size") {
  const Recording r;
  const std::string motion = std::string(APSO_MOTION) + " --policies none ";
  const std::string with_masks = motion + r.in.string() + "@tum-fr3@" + (r.in / "masks").string();
  Outcome o = run(with_masks, r.path);
  REQUIRE_MESSAGE(o.code == 0, o.text);
  cv::imwrite((r.in / "masks" / "0.100000.png").string(), cv::Mat(240, 320, CV_8U, cv::Scalar(255)));
  o = run(with_masks, r.path);
  CHECK(o.code == 1);
  CHECK(has(o.text, "0.100000.png: the mask is 320x240, expected the size of the images, 640x480"));
  fs::remove(r.in / "masks" / "0.100000.png");
  o = run(with_masks, r.path);
  CHECK(o.code == 0);
  CHECK(has(o.text, "3 of 4 frames have a true mask"));
  for (const auto& e : fs::directory_iterator(r.in / "masks")) cv::imwrite(e.path().string(), cv::Mat(1, 1, CV_8U, cv::Scalar(255)));
  CHECK(run(with_masks, r.path).code == 1);
  for (const auto& e : std::vector<fs::directory_entry>(fs::directory_iterator(r.in / "rgb"), fs::directory_iterator())) {
    cv::imwrite(e.path().string(), cv::Mat(240, 320, CV_8UC3, cv::Scalar(1, 2, 3)));
  }
  o = run(motion + r.in.string() + "@tum-fr3", r.path);
  CHECK(o.code == 1);
  CHECK(has(o.text, "no frame can be read"));
  o = r.track("");
  CHECK(o.code == 1);
  CHECK(has(o.text, "no frame can be read"));
}

TEST_CASE("wrong usage is named, and every program returns 2") {
  const Folder f;
  const auto refused = [&](const std::string& command, const std::string& text, int code = 2) {
    const Outcome o = run("cd " + f.path.string() + " && " + command, f.path);  // where an empty path would lead
    CAPTURE(command);
    CAPTURE(o.text);
    CHECK(o.code == code);
    CHECK(has(o.text, text));
  };
  const std::string out = " --output " + (f.path / "out").string();
  const std::string track = std::string(APSO_TRACK) + " synthetic:static_static --max-frames 1 --quiet ";
  for (const char* program : {APSO_TRACK, APSO_EVAL, APSO_SYNTH, APSO_MOTION}) {
    refused(program, "required");
    refused(std::string(program) + " a b --outptu x", "there is no option --outptu");
  }
  refused(track + "--output ''", "--output: is empty");
  refused(std::string(APSO_SYNTH) + " static_static --frames 1 --output ''", "--output: is empty");
  refused(track + "--movable unicorn" + out, "no class 'unicorn', expected a number or one of: person, bicycle");
  refused(track + "--movable person" + out, "nothing has classes");
  refused(track + "--model net.onnx" + out, "no policy of --motion uses a network");
  refused(track + "--camera tum-fr1" + out, "brings its own camera");
  refused(track + "--true-masks --masks " + f.path.string() + out, "--masks excludes --true-masks");
  for (const char* option : {"--seed 3", "--people 1", "--true-masks"}) {
    refused(std::string(APSO_TRACK) + " recording --camera bonn " + option + out, "only synthetic sequences have that");
  }
  refused(std::string(APSO_EVAL) + " a b --max-difference nan", "expected a number from 0");
  refused(track + "--config " + f.path.string() + out, f.path.string() + ": is a folder, expected a YAML file", 1);
  fs::create_directories(f.path / "camera.yaml");
  refused(std::string(APSO_TRACK) + " recording --camera " + (f.path / "camera.yaml").string() + out, "camera.yaml: is a folder, expected",
          1);
  CHECK_FALSE(fs::exists(f.path / "out"));
  const Outcome short_run = run(track + "--spoil wall" + out, f.path);
  CHECK(short_run.code == 0);
  CHECK(has(short_run.text, "--spoil: no frame is degraded"));
}
#endif
