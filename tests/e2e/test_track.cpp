// Runs the programs, and checks what they write and how they report bad input.
#ifdef APSO_TRACK
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/io/tum_text.hpp>
#include <apso/testing/synthetic.hpp>

#include "../run_program.hpp"

namespace {

Outcome run(const std::string& program, const std::string& arguments, const fs::path& folder) {
  return run(program + " " + arguments, folder);
}

std::string nth_file(const fs::path& folder, int n) {
  std::vector<std::string> files;
  for (const auto& e : fs::directory_iterator(folder)) files.push_back(e.path().string());
  std::sort(files.begin(), files.end());
  return files.at(static_cast<std::size_t>(n));
}

}  // namespace

TEST_CASE("apso_track runs the whole method on people walking, and apso_eval agrees with its summary") {
  const Folder f;
  const fs::path out = f.path / "out";
  const Outcome o = run(APSO_TRACK, "synthetic:walking_xyz --max-frames 60 --quiet --write-masks --output " + out.string(), f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  for (const char* file :
       {"trajectory.txt", "trajectory_features.txt", "frames.csv", "summary.json", "trajectory.png", "scores.png", "trajectory.svg",
        "trajectory.pdf", "scores.svg", "scores.pdf", "contact_sheet.png", "overview.png", "overview.svg"}) {
    CAPTURE(file);
    CHECK(fs::file_size(out / file) > 0);
  }
  const json summary = read_json(out / "summary.json");
  CHECK(summary["frames"]["processed"] == 60);
  CHECK(summary["frames"]["with_pose"] == 60);
  CHECK(summary["final"]["ate"]["rmse"].get<double>() < 0.05);

  const Table table(out / "frames.csv");
  for (const char* name :
       {"frame", "timestamp", "state",         "S_conf", "S_spatial", "S_feature", "S_depth", "S_total", "S_mc",       "S_dc",
        "S_dec", "S_change",  "dynamic_ratio", "W_base", "S_final",   "th_differ", "w_eff",   "c_dir",   "references", "ms_total"}) {
    CAPTURE(name);
    CHECK(table.has(name));
  }
  for (const auto& row : table.rows) CHECK(row.size() == table.header.size());
  CHECK(table.rows.size() == 60);

  int masks = 0;
  for (const auto& e : fs::directory_iterator(out / "masks")) {
    const cv::Mat mask = cv::imread(e.path().string(), cv::IMREAD_UNCHANGED);
    REQUIRE(mask.type() == CV_8UC1);
    CHECK(cv::countNonZero(mask == 0) + cv::countNonZero(mask == 255) == 640 * 480);
    ++masks;
  }
  CHECK(masks == 60);
}

TEST_CASE("runs give the same bytes, on one thread and on several") {
  const Folder f;
  for (const char* threads : {"1", "3"}) {
    const Outcome o = run(APSO_TRACK,
                          std::string("synthetic:walking_halfsphere --max-frames 40 --quiet --write-masks --report --threads ") + threads +
                              " --output " + (f.path / threads).string(),
                          f.path);
    REQUIRE(o.code == 0);
  }
  int pictures = 0;
  const auto bytes = [](const fs::path& file) {
    std::stringstream all;
    all << std::ifstream(file, std::ios::binary).rdbuf();
    return all.str();
  };
  for (const auto& e : fs::recursive_directory_iterator(f.path / "1")) {
    if (!e.is_regular_file()) continue;
    const fs::path name = fs::relative(e.path(), f.path / "1");
    const bool picture = name.has_parent_path();
    pictures += picture ? 1 : 0;
    CAPTURE(name.string());
    if (picture || name.extension() == ".txt" || name == "contact_sheet.png") CHECK(bytes(e.path()) == bytes(f.path / "3" / name));
  }
  CHECK(pictures > 80);  // masks and thumbnails of all frames, and some overlays
}

TEST_CASE("a recording with broken frames is tracked, and every broken frame is reported") {
  const Folder f;
  const fs::path in = f.path / "in";
  REQUIRE(run(APSO_SYNTH, "static_xyz --frames 14 --quiet --output " + in.string(), f.path).code == 0);
  fs::remove(in / "associations.txt");  // so that colour and depth are paired by their timestamps
  std::ofstream(nth_file(in / "rgb", 5), std::ios::trunc) << "not a picture";
  fs::remove(nth_file(in / "depth", 7));
  cv::imwrite(nth_file(in / "depth", 9), cv::Mat(480, 640, CV_8U, cv::Scalar(9)));
  cv::imwrite(nth_file(in / "depth", 10), cv::Mat(240, 320, CV_16U, cv::Scalar(9000)));
  const fs::path out = f.path / "out";
  const Outcome o = run(APSO_TRACK, in.string() + " --camera tum-fr3 --quiet --output " + out.string(), f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  const json summary = read_json(out / "summary.json");
  CHECK(summary["frames"]["skipped"] == 4);
  CHECK(summary["skipped"].size() == 4);
  CHECK(summary["frames"]["with_pose"] == 10);
  CHECK(summary["final"]["ate"]["rmse"].get<double>() < 0.02);

  const Outcome e = run(APSO_EVAL, "--json " + (in / "groundtruth.txt").string() + " " + (out / "trajectory.txt").string(), f.path);
  REQUIRE(e.code == 0);
  const json evaluation = json::parse(e.text.substr(e.text.find('{')));  // warnings may stand before it
  CHECK(evaluation["ate"]["rmse"].get<double>() == doctest::Approx(summary["final"]["ate"]["rmse"].get<double>()).epsilon(1e-4).scale(0));
}

TEST_CASE("the policy is chosen by name: masks of one run serve the next, and boxes become masks") {
  const Folder f;
  const std::string start = "synthetic:walking_static --people 1 --seed 3 --max-frames 24 --quiet --no-refinement ";
  const Outcome first = run(APSO_TRACK, start + "--write-masks --output " + (f.path / "a").string(), f.path);
  INFO(first.text);
  REQUIRE(first.code == 0);
  const auto ratio = [](const fs::path& folder) {  // of the last frame
    const Table table(folder / "frames.csv");
    return std::stod(table.field(table.rows.size() - 1, "dynamic_ratio"));
  };
  const double own = ratio(f.path / "a");
  REQUIRE(own > 0.05);
  const std::string masks = "--masks " + (f.path / "a" / "masks").string();
  const Outcome again = run(APSO_TRACK, start + "--motion precomputed " + masks + " --output " + (f.path / "b").string(), f.path);
  INFO(again.text);
  REQUIRE(again.code == 0);
  CHECK(ratio(f.path / "b") == doctest::Approx(own).epsilon(0.05).scale(0));  // the mask on disk is cut at 0.5
  CHECK(read_json(f.path / "b" / "summary.json")["motion"] == "precomputed");

  // a box around nothing that moves is dropped by '&', kept by '+'
  fs::create_directories(f.path / "boxes");
  for (int i = 0; i < 24; ++i) {
    char name[32];
    std::snprintf(name, sizeof name, "%.6f.txt", i / 30.0);
    std::ofstream(f.path / "boxes" / name) << "left:0 top:0 right:40 bottom:60 class:person 0.9\n";
  }
  const std::string boxes = "--detections " + (f.path / "boxes").string();
  const Outcome gate =
      run(APSO_TRACK, start + "--motion 'precomputed & geometric' " + boxes + " --output " + (f.path / "c").string(), f.path);
  INFO(gate.text);
  REQUIRE(gate.code == 0);
  CHECK(ratio(f.path / "c") < 0.5 * own);
  const Outcome either =
      run(APSO_TRACK, start + "--motion precomputed+geometric " + boxes + " --output " + (f.path / "d").string(), f.path);
  REQUIRE(either.code == 0);
  CHECK(ratio(f.path / "d") > own);
}

TEST_CASE("a synthetic recording on disk is the one that apso_track makes on the fly") {
  const Folder f;
  const Outcome made = run(APSO_SYNTH, "walking_halfsphere --frames 8 --seed 4 --quiet --output " + (f.path / "in").string(), f.path);
  INFO(made.text);
  REQUIRE(made.code == 0);
  const std::string camera = " --camera " + (f.path / "in" / "camera.yaml").string();
  const Outcome tracked = run(APSO_TRACK, (f.path / "in").string() + camera + " --quiet --output " + (f.path / "out").string(), f.path);
  INFO(tracked.text);
  REQUIRE(tracked.code == 0);
  const json summary = read_json(f.path / "out" / "summary.json");
  CHECK(summary["frames"]["with_pose"] == 8);
  CHECK(summary["final"]["ate"]["rmse"].get<double>() < 0.02);

  // the noise of its depth is that of its camera, unless the settings say something else
  double follow = 0;  // of the refiner
  int references = 0;
  const auto depth_noise = [&](const std::string& more) {
    const std::string command =
        (f.path / "in").string() + camera + " --quiet --max-frames 2 --output " + (f.path / "noise").string() + more;
    REQUIRE(run(APSO_TRACK, command, f.path).code == 0);
    const json settings = read_json(f.path / "noise" / "summary.json")["options"];
    follow = settings["pipeline"]["refiner"]["follow_features"].get<double>();
    references = settings["pipeline"]["refiner"]["memory"]["references"].get<int>();
    return settings["tracker"]["inverse_depth_sigma"].get<double>();
  };
  CHECK(depth_noise("") == 0);
  CHECK(follow == -1);
  CHECK(references == 0);
  std::ofstream(f.path / "in" / "camera.yaml", std::ios::app) << "inverse_depth_sigma: 0.012\n";
  CHECK(depth_noise("") == 0.012);
  CHECK(follow == doctest::Approx(0.3));
  CHECK(references == 1);
  std::ofstream(f.path / "noise.yaml")
      << "tracker: {inverse_depth_sigma: 0.02}\npipeline: {refiner: {follow_features: 0.1, memory: {references: 2}}}\n";
  CHECK(depth_noise(" --config " + (f.path / "noise.yaml").string()) == 0.02);
  CHECK(follow == 0.1);
  CHECK(references == 2);

  apso::testing::SyntheticOptions options;
  options.frames = 8;
  options.seed = 4;
  const apso::testing::SyntheticSequence sequence("walking_halfsphere", options);
  apso::testing::SyntheticFrame frame;
  sequence.render(7, frame);
  const cv::Mat rgb = cv::imread(nth_file(f.path / "in" / "rgb", 7), cv::IMREAD_COLOR);
  const cv::Mat depth = cv::imread(nth_file(f.path / "in" / "depth", 7), cv::IMREAD_UNCHANGED);
  const cv::Mat mask = cv::imread(nth_file(f.path / "in" / "masks", 7), cv::IMREAD_UNCHANGED);
  REQUIRE(rgb.size() == cv::Size(640, 480));
  REQUIRE(depth.type() == CV_16UC1);
  REQUIRE(mask.type() == CV_8UC1);
  bool same = true;
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) {
      same = same && rgb.at<cv::Vec3b>(y, x)[2] == frame.rgb(3 * x, y) && (mask.at<uchar>(y, x) == 255) == (frame.instance(x, y) != 0) &&
             std::abs(depth.at<std::uint16_t>(y, x) / 5000.0 - static_cast<double>(frame.depth(x, y))) <= 0.00011;
    }
  }
  CHECK(same);

  CHECK(run(APSO_SYNTH, "walking_xyz --frames 0 --output " + (f.path / "no").string(), f.path).code != 0);
}

TEST_CASE("an alignment believes all of a frame against itself, and doubts people who walk") {
  const Folder f;
  const Outcome made = run(APSO_SYNTH, "walking_xyz --frames 8 --seed 4 --quiet --output " + (f.path / "in").string(), f.path);
  REQUIRE_MESSAGE(made.code == 0, made.text);
  const auto pair = [&](int n) { return nth_file(f.path / "in" / "rgb", n) + " " + nth_file(f.path / "in" / "depth", n) + " "; };
  const auto doubted = [&](int first, int second) {  // 255 where the picture is strongly red
    const std::string picture = (f.path / "weights.png").string();
    const Outcome painted = run(APSO_WEIGHTS, pair(first) + pair(second) + picture, f.path);
    INFO(painted.text);
    REQUIRE(painted.code == 0);
    const cv::Mat weights = cv::imread(picture, cv::IMREAD_COLOR);
    REQUIRE(weights.size() == cv::Size(320, 240));
    cv::Mat red(weights.size(), CV_8UC1, cv::Scalar(0));
    for (int y = 0; y < 240; ++y) {
      for (int x = 0; x < 320; ++x) red.at<uchar>(y, x) = weights.at<cv::Vec3b>(y, x)[2] - weights.at<cv::Vec3b>(y, x)[0] > 120 ? 255 : 0;
    }
    return red;
  };
  CHECK(cv::countNonZero(doubted(4, 4)) == 0);

  // the true masks of both frames, with a border: chance alone would put as much of the red there as they have of the area
  const cv::Mat masks = cv::imread(nth_file(f.path / "in" / "masks", 0), cv::IMREAD_UNCHANGED) |
                        cv::imread(nth_file(f.path / "in" / "masks", 7), cv::IMREAD_UNCHANGED);
  cv::Mat people;
  cv::resize(masks, people, {320, 240}, 0, 0, cv::INTER_NEAREST);
  cv::dilate(people, people, cv::Mat::ones(11, 11, CV_8U));
  const cv::Mat red = doubted(0, 7);
  REQUIRE(cv::countNonZero(red) > 0);
  const double inside = static_cast<double>(cv::countNonZero(red & people)) / cv::countNonZero(red);
  CHECK(inside > 2.0 * cv::countNonZero(people) / (320 * 240));

  CHECK(run(APSO_WEIGHTS, pair(4) + pair(4) + (f.path / "no" / "folder.png").string(), f.path).code == 1);
  CHECK(run(APSO_WEIGHTS, "a b c d e", f.path).text.find("cannot use a") != std::string::npos);
}

TEST_CASE("apso_motion compares its own list of policies, or those it is given") {
  const Folder folder;
  const std::string csv = (folder.path / "motion.csv").string();
  const std::string command = std::string(APSO_MOTION) + " synthetic:walking_xyz --frames 3 --csv " + csv;
  const Outcome own = run(command, folder.path);
  REQUIRE_MESSAGE(own.code == 0, own.text);
  CHECK(Table(csv).rows.size() == 14);
  const Outcome given = run(command + " --policies 'truth,geometric + epipolar'", folder.path);
  REQUIRE_MESSAGE(given.code == 0, given.text);
  const Table table(csv);
  REQUIRE(table.rows.size() == 2);
  CHECK(std::stod(table.field(0, "recall")) == doctest::Approx(1));  // true masks find all
  CHECK(run(command + " --policies nonsense", folder.path).code == 1);
}

TEST_CASE("a folder of results holds the last run only, and nothing is lost that no run wrote") {
  const Folder f;
  const fs::path out = f.path / "out";
  const std::string start = "synthetic:static_static --quiet --output " + out.string();
  REQUIRE(run(APSO_TRACK, start + " --max-frames 6 --write-masks", f.path).code == 0);
  std::ofstream(out / "overlays" / "notes.png") << "mine";
  std::ofstream(out / "notes.txt") << "mine";
  const auto files = [](const fs::path& folder) {
    int n = 0;
    for (const auto& e : fs::directory_iterator(folder)) n += e.is_regular_file() ? 1 : 0;
    return n;
  };
  CHECK(files(out / "masks") == 6);
  CHECK(files(out / "overlays") == 6 + 1);
  REQUIRE(run(APSO_TRACK, start + " --max-frames 3 --write-masks", f.path).code == 0);
  CHECK(files(out / "masks") == 3);
  REQUIRE(run(APSO_TRACK, start + " --max-frames 2", f.path).code == 0);
  CHECK_FALSE(fs::exists(out / "masks"));
  CHECK(files(out / "overlays") == 2 + 1);
  CHECK(Table(out / "frames.csv").rows.size() == 2);
  CHECK(fs::exists(out / "notes.txt"));

  const Outcome plain = run(APSO_TRACK, start + " --max-frames 2 --no-pictures", f.path);
  REQUIRE(plain.code == 0);
  CHECK(plain.text.find("overview.png") == std::string::npos);
  CHECK(read_json(out / "summary.json")["frames"]["with_pose"] == 2);
  CHECK(Table(out / "frames.csv").rows.size() == 2);
  CHECK(files(out / "overlays") == 1);
  for (const auto& e : fs::directory_iterator(out)) {
    CAPTURE(e.path().string());
    CHECK((e.is_directory() || e.path().extension() == ".txt" || e.path().extension() == ".csv" || e.path().extension() == ".json"));
  }
}

TEST_CASE("progress is shown on a terminal only") {
  const Folder f;
  const auto returns = [&](const std::string& program, const std::string& arguments) {
    const Outcome o = run(program, arguments, f.path);  // both streams go to a file
    INFO(o.text);
    CHECK(o.code == 0);
    return std::count(o.text.begin(), o.text.end(), '\r');
  };
  CHECK(returns(APSO_TRACK, "synthetic:static_static --max-frames 2 --output " + (f.path / "out").string()) == 0);
  CHECK(returns(APSO_SYNTH, "static_static --frames 2 --output " + (f.path / "in").string()) == 0);
  CHECK(returns(APSO_MOTION, "synthetic:static_static --frames 2 --policies none") == 0);
}

TEST_CASE("there are at most 200 settings, and each has a range") {
  const Folder f;
  const Outcome o = run(APSO_TRACK, "--list-options", f.path);
  REQUIRE(o.code == 0);
  const std::size_t end = o.text.find("\n\n");
  REQUIRE(end != std::string::npos);
  MESSAGE(o.text.substr(end + 2));
  const int count = std::stoi(o.text.substr(end + 2));
  CHECK(count <= 200);
  std::stringstream lines(o.text.substr(0, end + 1));
  int listed = 0;
  for (std::string line; std::getline(lines, line); ++listed) {
    CAPTURE(line);
    std::stringstream words(line);
    std::string path, value, range;
    CHECK(bool(words >> path >> value >> range));
  }
  CHECK(listed == count);
}

TEST_CASE("bad input is named, and the exit code is not zero") {
  const Folder f;
  const std::string out = " --quiet --output " + (f.path / "out").string();
  const auto fails = [&](const std::string& arguments, const std::string& expected) {
    const Outcome o = run(APSO_TRACK, arguments + out, f.path);
    CAPTURE(arguments);
    CAPTURE(o.text);
    CHECK(o.code != 0);
    CHECK(o.text.find(expected) != std::string::npos);
  };
  fails((f.path / "nothing").string() + " --camera tum-fr1", "nothing");
  fails("synthetic:dancing", "walking_xyz");
  fails((f.path).string(), "--camera");
  fails(f.path.string() + " --camera tum-fr9", "tum-fr3");
  fails("synthetic:walking_xyz --threads 0", "--threads");
  fails("synthetic:walking_xyz --motion crystal-ball", "geometric");
  fails("synthetic:walking_xyz --motion 'geometric+(residual'", "expected ')'");
  fails("synthetic:walking_xyz --motion dnn", "file of a network");
  fails("synthetic:walking_xyz --motion dnn --model " + (f.path / "no.onnx").string(), "no.onnx");
  fails("synthetic:walking_xyz --masks " + (f.path / "no_masks").string(), "no_masks");
  fails("synthetic:walking_xyz --detections " + (f.path / "no.txt").string(), "no.txt");
  std::ofstream(f.path / "bad.yaml") << "pipeline:\n  assessor:\n    no_such_option: 1\n";
  fails("synthetic:walking_xyz --config " + (f.path / "bad.yaml").string(), "bad.yaml:3");
  std::ofstream(f.path / "bad.txt") << "1.0 2 3\n";
  fails("synthetic:walking_xyz --detections " + (f.path / "bad.txt").string(), "bad.txt:1");
  fs::create_directories(f.path / "empty");
  std::ofstream(f.path / "empty" / "rgb.txt") << "# nothing\n";
  std::ofstream(f.path / "empty" / "depth.txt") << "# nothing\n";
  fails((f.path / "empty").string() + " --camera tum-fr1", "rgb.txt");
}
#endif
