// What the programs do with input that is wrong, output that cannot be written, and signals. docs/reliability.md lists these cases.
#ifdef APSO_TRACK
#include <doctest/doctest.h>

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <numeric>
#include <sstream>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/math/se3.hpp>
#include <apso/testing/synthetic.hpp>

#include "../contains.hpp"
#include "../run_program.hpp"

namespace {

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
    for (const int stop : {SIGINT, SIGHUP, SIGTERM, SIGPIPE}) ::signal(stop, SIG_DFL);  // nohup, for one, has some ignored
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

/// 110 frames of 320 x 240 pixels with the truth, made once; runs of apso_track in which something happens at frame 40.
class Faulty {
 public:
  static constexpr int frames = 110;
  static constexpr int first = 40;

  explicit Faulty(int people) : sequence_("walking_xyz", options(people)), in_(f_.path / "rec") {
    for (const char* folder : {"rgb", "depth", "masks"}) fs::create_directories(in_ / folder);
    std::ofstream list(in_ / "associations.txt");
    list.precision(9);
    apso::testing::SyntheticFrame frame;
    for (int i = 0; i < frames; ++i) {
      sequence_.render(i, frame);
      const std::string file = number(i) + ".png";
      cv::Mat bgr;
      cv::Mat units;
      cv::cvtColor(cv::Mat(240, 320, CV_8UC3, frame.rgb.data()), bgr, cv::COLOR_RGB2BGR);
      cv::Mat(240, 320, CV_32F, frame.depth.data()).convertTo(units, CV_16U, 5000);
      cv::imwrite((in_ / "rgb" / file).string(), bgr);
      cv::imwrite((in_ / "depth" / file).string(), units);
      cv::imwrite((in_ / "masks" / file).string(), cv::Mat(240, 320, CV_8U, frame.instance.data()) != 0);
      list << frame.timestamp << " rgb/" << file << ' ' << frame.timestamp << " depth/" << file << '\n';
    }
    const apso::Pinhole& c = sequence_.camera();
    std::ofstream camera(in_ / "camera.yaml");
    camera.precision(12);
    camera << "fx: " << c.fx << "\nfy: " << c.fy << "\ncx: " << c.cx << "\ncy: " << c.cy
           << "\nwidth: 320\nheight: 240\ndepth_scale: 5000\n";
  }

  /// What apso_track says of each frame, and how far its pose is from the truth.
  struct Frame {
    std::string state;
    double error = 0;  ///< of the position [m]; -1 without a pose
  };
  /// \param origin of each frame as it comes: its number in the recording
  [[nodiscard]] std::vector<Frame> track(const std::string& more, const std::vector<int>& origin) const {
    const fs::path out = f_.path / "out";
    const Outcome o = run(std::string(APSO_TRACK) + " " + in_.string() + " --camera " + (in_ / "camera.yaml").string() + " --quiet " +
                              more + " --output " + out.string(),
                          f_.path);
    text_ = o.text;
    CAPTURE(o.text);
    REQUIRE(o.code == 0);
    const Table table(out / "frames.csv");
    REQUIRE(table.rows.size() == origin.size());
    std::ifstream trajectory(out / "trajectory.txt");
    std::vector<Frame> all;
    for (std::size_t i = 0; i < origin.size(); ++i) {
      all.push_back({table.field(i, "state"), -1});
      if (all.back().state == "LOST") continue;
      std::string line;
      do {
        REQUIRE(std::getline(trajectory, line));
      } while (line[0] == '#');
      std::stringstream words(line);
      double stamp = 0;
      Eigen::Vector3d t;
      words >> stamp >> t.x() >> t.y() >> t.z();
      CHECK(stamp == doctest::Approx(std::stod(table.field(i, "timestamp"))).epsilon(1e-9));
      const apso::Pose truth = apso::inverse(sequence_.T_world_camera(0)) * sequence_.T_world_camera(origin[i]);
      all.back().error = (truth.translation() - t).norm();
      CHECK(std::isfinite(all.back().error));
    }
    return all;
  }
  [[nodiscard]] static std::vector<int> in_order() {
    std::vector<int> all(frames);
    std::iota(all.begin(), all.end(), 0);
    return all;
  }
  /// What the last run printed.
  [[nodiscard]] const std::string& text() const { return text_; }
  [[nodiscard]] const fs::path& recording() const { return in_; }
  [[nodiscard]] static std::string number(int i) { return std::to_string(1000 + i); }

 private:
  static apso::testing::SyntheticOptions options(int people) {
    apso::testing::SyntheticOptions o;
    o.width = 320;
    o.height = 240;
    o.frames = frames;
    o.people = people;
    o.seed = 104;
    return o;
  }
  Folder f_;
  apso::testing::SyntheticSequence sequence_;
  fs::path in_;
  mutable std::string text_;
};

/// The largest error of frames `begin` to `end`, and how many of them have no pose or are BAD.
struct Span {
  double error = 0;
  int lost = 0;
  int bad = 0;
};
Span span(const std::vector<Faulty::Frame>& all, int begin, int end) {
  Span s;
  for (int i = begin; i < end; ++i) {
    const Faulty::Frame& f = all.at(static_cast<std::size_t>(i));
    s.error = std::max(s.error, f.error);
    s.lost += f.state == "LOST" ? 1 : 0;
    s.bad += f.state == "BAD" ? 1 : 0;
  }
  return s;
}

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
    CHECK(contains(o.text, "only read"));
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
  CHECK(contains(o.text, "groundtruth.txt is there, and no run has it in its list apso_files.txt"));
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
  CHECK(contains(second.text, "another run is writing into it"));
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
    CHECK(contains(full.text, "File too large"));
    CHECK(contains(full.text, "unfinished"));
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
  CHECK(contains(summary["sequence"].get<std::string>(), "rec\xEF\xBF\xBD"));  // U+FFFD
  REQUIRE(summary["skipped"].size() == 1);
  CHECK(contains(summary["skipped"][0]["reason"].get<std::string>(), "x\xEF\xBF\xBD.png"));
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
    CHECK(contains(o.text, text));
    CHECK(contains(o.text, "no frame has a mask that fits") == (code != 0));
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
    CHECK(contains(o.text, "detections: 0 of 4 frames have some"));
    CHECK(contains(o.text, "no stamp is that of a frame"));
    std::ofstream(file) << "0.0 10 10 50 50 0.9 0\n";
    o = r.track("--detections " + file + " --motion " + motion);
    CHECK(o.code == 0);
    CHECK(contains(o.text, "detections: 1 of 4 frames have some"));
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
    CHECK(contains(o.text, text));
  };
  const std::string unknown = "the errors are not known: the ground truth cannot be compared: ";
  std::ofstream(r.in / "groundtruth.txt") << "0 0 0 0 0 0 0 1\n";
  told(0, unknown + "1 pair(s) of poses within 0.02 s, need 3");
  CHECK(contains(read_json(r.out / "summary.json")["evaluation_problem"].get<std::string>(), "1 pair"));
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
    CHECK(contains(o.text, text));
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
  CHECK(contains(told.text, "euroc.txt (tum_ns, 3 poses)"));
  const Outcome o = run(command + " --format tum", r.path);
  CHECK(o.code == 1);
  CHECK(contains(o.text, "euroc.txt: the timestamps look like nanoseconds"));
  CHECK(contains(o.text, "--format tum_ns"));
}

TEST_CASE("paths in the lists of a recording do not lead out of it") {
  const Recording r;
  for (const std::string& outside :
       {std::string("../other.png"), std::string("rgb/../../other.png"), (r.in / "rgb" / "0.000000.png").string()}) {
    CAPTURE(outside);
    std::ofstream(r.in / "associations.txt") << "0.0 " << outside << " 0.0 depth/0.000000.png\n";
    const Outcome o = r.track("");
    CHECK(o.code == 1);
    CHECK(contains(o.text, "expected files in this folder"));
  }
}

TEST_CASE("no file outside of the output is written, and no shell reads a name") {
  const Recording r;
  // names that a shell would act upon, in a folder with everything that a program may think of: home, temporary files, where it stands
  const fs::path odd = r.path / "a b;touch x;$(touch y)`touch z`&touch v|touch w>u";
  fs::rename(r.in, odd);
  const fs::path out = r.path / "results; touch t";
  for (const char* folder : {"home", "tmp", "here"}) fs::create_directories(r.path / folder);
  const auto quoted = [](const fs::path& path) { return "'" + path.string() + "'"; };
  const std::string start = "cd " + (r.path / "here").string() + " && HOME=" + (r.path / "home").string() +
                            " XDG_CACHE_HOME=" + (r.path / "home").string() + " TMPDIR=" + (r.path / "tmp").string() + " ";
  const auto others = [&] {
    auto all = content(r.path);
    for (auto it = all.begin(); it != all.end();) {
      const bool output = it->first.rfind("results", 0) == 0 || it->first == "log.txt" || it->first.rfind("home/fontconfig", 0) == 0;
      it = output ? all.erase(it) : std::next(it);
    }
    return all;
  };
  const auto before = others();
  const std::string truth = quoted(odd / "groundtruth.txt");
  for (const std::string& command :
       {APSO_TRACK + (" " + quoted(odd)) + " --camera " + quoted(odd / "camera.yaml") + " --masks " + quoted(odd / "masks") +
            " --write-masks --report --video run.avi --output " + quoted(out),
        APSO_SYNTH + (" static_static --frames 2 --output " + quoted(r.path / "results2 `touch s`")),
        APSO_EVAL + (" " + truth) + " " + truth + " --plot " + quoted(out / "a;touch q.svg"),
        APSO_MOTION + (" --policies none --csv " + quoted(out / "m;touch p.csv") + " ") + quoted(odd.string() + "@tum-fr3")}) {
    const Outcome o = run(start + command, r.path);
    CAPTURE(command);
    CAPTURE(o.text);
    CHECK(o.code == 0);
    CHECK(others() == before);
  }
  CHECK(fs::exists(out / "run.avi"));
  CHECK(fs::exists(out / "report.html"));
  CHECK(fs::file_size(out / "a;touch q.svg") > 0);
  CHECK(fs::file_size(out / "m;touch p.csv") > 0);
}

TEST_CASE("faults of cameras, drivers and clocks") {
  const Faulty recording(2);
  const int first = Faulty::first;
  const auto spoiled = [&](const std::string& kind, int frames, const std::vector<int>& origin) {
    return recording.track("--spoil " + kind + " --max-frames " + std::to_string(frames), origin);
  };
  const std::vector<int> in_order = Faulty::in_order();
  const std::vector<int> eighty(in_order.begin(), in_order.begin() + 80);
  const auto clean = recording.track("--max-frames 80", eighty);
  CHECK(span(clean, 0, 80).error < 0.06);
  CHECK(span(clean, 60, 80).error < 0.02);

  {
    INFO("ten frames are dropped: the next ones are found again");
    std::vector<int> origin = in_order;
    origin.erase(origin.begin() + first, origin.begin() + first + 10);
    origin.resize(80);
    const auto all = spoiled("dropped", 80, origin);
    CHECK(span(all, 0, 80).lost == 0);
    CHECK(span(all, first, 50).error < 0.1);
    CHECK(span(all, 50, 80).error < 0.02);
  }
  {
    INFO("frames that come twice are skipped, and nothing else changes");
    const auto all = spoiled("doubled", 90, eighty);
    for (std::size_t i = 0; i < 80; ++i) {
      CAPTURE(i);
      CHECK(all[i].state == clean[i].state);
      CHECK(all[i].error == doctest::Approx(clean[i].error).epsilon(1e-6).scale(0.1));
    }
    CHECK(contains(recording.text(), "10 skipped"));
    CHECK(contains(recording.text(), "skipped frame 41: its stamp, 1.333333, is not later than 1.333333, which a frame before has"));
  }
  {
    INFO("frames that come too late are skipped");
    std::vector<int> origin = eighty;
    for (int i = first + 8; i >= first; i -= 2) origin.erase(origin.begin() + i);
    const auto all = spoiled("reordered", 80, origin);
    CHECK(contains(recording.text(), "5 skipped"));
    CHECK(span(all, 0, 75).error < 0.1);
    CHECK(span(all, 60, 75).error < 0.02);
  }
  {
    INFO("a clock that is set back ends what has a pose, and every frame is named");
    const auto all = spoiled("clock-back", 80, std::vector<int>(in_order.begin(), in_order.begin() + first));
    CHECK(span(all, 0, first).error < 0.02);
    CHECK(contains(recording.text(), "40 of 80 frames with a pose"));
    for (const char* frame : {"skipped frame 40: its stamp", "skipped frame 79: its stamp"}) CHECK(contains(recording.text(), frame));
  }
  {
    INFO("a flash of three frames: none of them is GOOD");
    const auto all = spoiled("flash", 80, eighty);
    const Span flash = span(all, first, first + 3);
    CHECK(flash.lost + flash.bad == 3);
    CHECK(flash.error < 0.05);
    CHECK(span(all, 60, 80).error < 0.02);
  }
  {
    INFO("a frozen camera for a second: the pose stays, and the camera is found again at once");
    const auto all = spoiled("frozen", 90, std::vector<int>(in_order.begin(), in_order.begin() + 90));
    CHECK(span(all, 0, 90).lost == 0);
    CHECK(span(all, 72, 90).error < 0.02);
  }
  {
    INFO("no depth for a second: all frames are BAD, and their poses right");
    const auto all = spoiled("depth-lost", 90, std::vector<int>(in_order.begin(), in_order.begin() + 90));
    const Span blind = span(all, first, first + 30);
    CHECK(blind.bad + blind.lost == 30);
    CHECK(blind.error < 0.06);
    CHECK(span(all, 72, 90).error < 0.02);
  }
  {
    INFO("nothing to see for two seconds: no pose, and the camera is found again");
    const auto all = spoiled("occluded", 110, in_order);
    CHECK(span(all, first, first + 60).lost >= 58);
    CHECK(span(all, 102, 110).lost == 0);
    CHECK(span(all, 102, 110).error < 0.04);
  }
  {
    INFO("masks are late, or show what is static");
    const fs::path masks = recording.recording().parent_path() / "masks";
    for (const bool late : {true, false}) {
      CAPTURE(late);
      fs::remove_all(masks);
      fs::create_directories(masks);
      for (int i = 10; i < 80; ++i) {
        const fs::path from = recording.recording() / "masks" / (Faulty::number(late ? i - 10 : i) + ".png");
        const fs::path to = masks / (Faulty::number(i) + ".png");
        if (late) {
          fs::copy_file(from, to);
        } else {
          cv::imwrite(to.string(), 255 - cv::imread(from.string(), cv::IMREAD_UNCHANGED));
        }
      }
      const auto all = recording.track("--max-frames 80 --masks '" + masks.string() + "'", eighty);
      // late masks cost nothing: the motion policy finds what they miss. With all that is static masked, no pose is trusted.
      if (late) CHECK(span(all, 0, 80).error < 0.06);
      if (late) CHECK(span(all, 60, 80).error < 0.02);
      if (!late) CHECK(std::none_of(all.begin(), all.end(), [](const Faulty::Frame& f) { return f.state == "GOOD"; }));
      CHECK(contains(recording.text(), "masks: 70 of 80 frames have one that fits"));
    }
  }
}

TEST_CASE("a camera that is carried to another place between two frames is found again, and no pose is far off") {
  for (const int people : {0, 2}) {
    CAPTURE(people);
    const Faulty recording(people);
    std::vector<int> origin = Faulty::in_order();
    origin.erase(origin.begin() + Faulty::first, origin.begin() + Faulty::first + 45);
    const auto all = recording.track("--spoil kidnapped", origin);
    CHECK(span(all, Faulty::first, 65).error < 0.05);
    CHECK(span(all, 50, 65).lost == 0);
    CHECK(span(all, 50, 65).error < 0.02);
    for (std::size_t i = 0; i < all.size(); ++i) {
      CAPTURE(i);
      if (all[i].state == "GOOD") CHECK(all[i].error < 0.02);
    }
  }
}

TEST_CASE("half of the image black for a second") {
  const Faulty recording(0);
  const std::vector<int> in_order = Faulty::in_order();
  const auto all = recording.track("--spoil half-black --max-frames 90", std::vector<int>(in_order.begin(), in_order.begin() + 90));
  const Span half = span(all, Faulty::first, Faulty::first + 30);
  CHECK(half.bad + half.lost >= 25);
  CHECK(half.error < 0.04);
  CHECK(span(all, 72, 90).error < 0.02);
}

TEST_CASE("apso_motion takes the camera of a file, and refuses true masks and frames of another size") {
  const Recording r;
  const std::string motion = std::string(APSO_MOTION) + " --policies none ";
  const std::string with_masks = motion + r.in.string() + "@" + (r.in / "camera.yaml").string() + "@" + (r.in / "masks").string();
  Outcome o = run(with_masks, r.path);
  REQUIRE_MESSAGE(o.code == 0, o.text);
  cv::imwrite((r.in / "masks" / "0.100000.png").string(), cv::Mat(240, 320, CV_8U, cv::Scalar(255)));
  o = run(with_masks, r.path);
  CHECK(o.code == 1);
  CHECK(contains(o.text, "0.100000.png: the mask is 320x240, expected the size of the images, 640x480"));
  fs::remove(r.in / "masks" / "0.100000.png");
  o = run(with_masks, r.path);
  CHECK(o.code == 0);
  CHECK(contains(o.text, "3 of 4 frames have a true mask"));
  for (const auto& e : fs::directory_iterator(r.in / "masks")) cv::imwrite(e.path().string(), cv::Mat(1, 1, CV_8U, cv::Scalar(255)));
  CHECK(run(with_masks, r.path).code == 1);
  for (const auto& e : std::vector<fs::directory_entry>(fs::directory_iterator(r.in / "rgb"), fs::directory_iterator())) {
    cv::imwrite(e.path().string(), cv::Mat(240, 320, CV_8UC3, cv::Scalar(1, 2, 3)));
  }
  o = run(motion + r.in.string() + "@tum-fr3", r.path);
  CHECK(o.code == 1);
  CHECK(contains(o.text, "no frame can be read"));
  o = r.track("");
  CHECK(o.code == 1);
  CHECK(contains(o.text, "no frame can be read"));
}

TEST_CASE("wrong usage is named, and every program returns 2") {
  const Folder f;
  const auto refused = [&](const std::string& command, const std::string& text, int code = 2) {
    const Outcome o = run("cd " + f.path.string() + " && " + command, f.path);  // where an empty path would lead
    CAPTURE(command);
    CAPTURE(o.text);
    CHECK(o.code == code);
    CHECK(contains(o.text, text));
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
  const std::string count = "--max-frames: '-3': expected a whole number, 0 or more";
  refused(std::string(APSO_TRACK) + " synthetic:static_static --max-frames -3" + out, count);
  refused(std::string(APSO_TRACK) + " recording --camera tum-fr9" + out, "apso_track: camera \"tum-fr9\" is not known, expected tum-fr1",
          1);
  refused(std::string(APSO_MOTION) + " recording@tum-fr9", "bonn or icl-nuim, or a YAML file; there is no file of this name", 1);
  fs::create_directories(f.path / "camera.yaml");
  refused(std::string(APSO_TRACK) + " recording --camera " + (f.path / "camera.yaml").string() + out, "camera.yaml: is a folder, expected",
          1);
  CHECK_FALSE(fs::exists(f.path / "out"));
  const Outcome short_run = run(track + "--spoil wall" + out, f.path);
  CHECK(short_run.code == 0);
  CHECK(contains(short_run.text, "--spoil: no frame is degraded"));
}
#endif
