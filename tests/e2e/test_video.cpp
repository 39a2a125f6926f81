// The video of a run: what is in it, and what is refused. The window is tested by live.sh.
#ifdef APSO_TRACK
#include <doctest/doctest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include "../run_program.hpp"

namespace {

// Pixels of about one colour (BGR): the codecs lose some of it.
int count(const cv::Mat& picture, const cv::Scalar& colour) {
  const cv::Scalar off(40, 40, 40);
  cv::Mat found;
  cv::inRange(picture, colour - off, colour + off, found);
  return cv::countNonZero(found);
}

std::vector<cv::Mat> frames(const fs::path& video) {
  cv::VideoCapture in(video.string());
  std::vector<cv::Mat> all;
  for (cv::Mat frame; in.read(frame);) all.push_back(frame.clone());
  return all;
}

}  // namespace

TEST_CASE("a video shows every frame beside the path so far, with BAD frames and the truth") {
  const Folder f;
  const std::string out = (f.path / "out").string();
  const std::string track = std::string(APSO_TRACK) + " synthetic:walking_xyz --quiet --output " + out;
  Outcome o = run(track + " --spoil blur41 --max-frames 44 --video run.avi", f.path);
  INFO(o.text);
  REQUIRE(o.code == 0);
  const std::vector<cv::Mat> pictures = frames(f.path / "out/run.avi");
  REQUIRE(pictures.size() == 44);
  const int bad = read_json(f.path / "out/summary.json")["frames"]["bad"];
  REQUIRE(bad > 0);
  const cv::Scalar blue(178, 114, 0), red(60, 60, 230), grey(188, 181, 175);
  const auto path = [](const cv::Mat& picture) { return picture(cv::Rect(640, 80, picture.cols - 640, picture.rows - 80)); };
  CHECK(pictures.front().cols % 2 == 0);
  CHECK(pictures.front().rows % 2 == 0);
  CHECK(count(path(pictures.back()), blue) > 100);
  CHECK(count(path(pictures.back()), red) > 10);
  CHECK(count(path(pictures[5]), red) == 0);                                                    // none is BAD yet
  CHECK(count(pictures.back()(cv::Rect(640, 28, pictures.back().cols - 640, 20)), grey) > 20);  // in the legend

  // the next run replaces it, also by one of another kind
  o = run(track + " --max-frames 4 --video again.mp4", f.path);
  CHECK(o.code == 0);
  CHECK(frames(f.path / "out/again.mp4").size() == 4);
  CHECK_FALSE(fs::exists(f.path / "out/run.avi"));
}

TEST_CASE("a video that cannot be written, or would replace a file of the user, is refused") {
  const Folder f;
  const fs::path out = f.path / "out";
  const std::string track = std::string(APSO_TRACK) + " synthetic:static_static --max-frames 2 --quiet --output " + out.string();
  for (const char* name : {"run.mkv", "run", ".avi", "folder/run.avi", "''"}) {
    CAPTURE(name);
    const Outcome o = run(track + " --video " + name, f.path);
    CHECK(o.code == 2);
    CHECK(o.text.find("--video: expected NAME.avi or NAME.mp4") != std::string::npos);
  }
  fs::create_directories(out);
  std::ofstream(out / "holiday.avi") << "mine";
  const Outcome o = run(track + " --video holiday.avi", f.path);
  CHECK(o.code == 1);
  CHECK(o.text.find("holiday.avi is there") != std::string::npos);
  std::stringstream kept;
  kept << std::ifstream(out / "holiday.avi").rdbuf();
  CHECK(kept.str() == "mine");
}

TEST_CASE("a window without a display is refused before anything is written") {
  const Folder f;
  const std::string track =
      std::string(APSO_TRACK) + " synthetic:static_static --max-frames 2 --live --output " + (f.path / "out").string();
  for (const char* display : {"-u DISPLAY", "DISPLAY=:4711"}) {
    CAPTURE(display);
    const Outcome o = run(std::string("env -u WAYLAND_DISPLAY ") + display + ' ' + track, f.path);
    CHECK(o.code == 1);
    CHECK(o.text.find("--live: no window can be opened") != std::string::npos);
    CHECK_FALSE(fs::exists(f.path / "out"));
  }
}
#endif
