#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>

#include <opencv2/imgcodecs.hpp>

#include <apso/opencv/rgbd_sequence.hpp>

#include "../contains.hpp"

using namespace apso;
using namespace apso::opencv;
namespace fs = std::filesystem;

namespace {
/// A recording of 32 x 24 pixels in a folder that goes when the test ends.
class Recording {
 public:
  explicit Recording(const char* name) : path_(fs::temp_directory_path() / (std::string("apso_sequence_") + name)) {
    fs::remove_all(path_);
    fs::create_directories(path_ / "rgb");
    fs::create_directories(path_ / "depth");
  }
  ~Recording() {
    std::error_code code;
    fs::remove_all(path_, code);
  }
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  [[nodiscard]] std::string path() const { return path_.string(); }
  void text(const char* file, const std::string& content) const { std::ofstream(path_ / file) << content; }
  void image(const char* file, const cv::Mat& m) const { cv::imwrite((path_ / file).string(), m); }
  void good(int n) const {
    std::string rgb = "# colour\n";
    std::string depth = "# depth\n";
    for (int i = 0; i < n; ++i) {
      const std::string k = std::to_string(i);
      rgb += std::to_string(i / 30.0) + " rgb/" + k + ".png\n";
      depth += std::to_string(i / 30.0 + 0.005) + " depth/" + k + ".png\n";
      image(("rgb/" + k + ".png").c_str(), cv::Mat(24, 32, CV_8UC3, cv::Scalar(10, 20, 30)));
      image(("depth/" + k + ".png").c_str(), cv::Mat(24, 32, CV_16UC1, cv::Scalar(7500)));
    }
    text("rgb.txt", rgb);
    text("depth.txt", depth);
  }

 private:
  fs::path path_;
};

CameraModel small_camera() {
  CameraModel c;
  c.name = "small";
  c.pinhole = {30, 30, 15.5, 11.5, 32, 24};
  return c;
}

std::string recording_error(const std::string& folder) {
  try {
    RgbdSequence s(folder, small_camera());
  } catch (const io_error& e) {
    return e.what();
  }
  return {};
}
}  // namespace

TEST_CASE("a good recording: stamps of the colour images, metres, grey in [0,1]") {
  const Recording r("good");
  r.good(3);
  const RgbdSequence s(r.path(), small_camera());
  REQUIRE(s.size() == 3);
  CHECK(s.groundtruth_path().empty());
  CHECK(s.warnings().empty());
  const SequenceFrame f = s.frame(1);
  REQUIRE(f.ok());
  CHECK(f.timestamp == doctest::Approx(1 / 30.0).epsilon(1e-4));
  CHECK(f.depth_delay == doctest::Approx(0.005));
  CHECK(f.depth(5, 5) == doctest::Approx(1.5));
  const double gray = 0.114 * 10 + 0.587 * 20 + 0.299 * 30;
  CHECK(f.intensity(3, 4) == doctest::Approx(gray / 255).epsilon(0.03));
  CHECK(f.colour(0, 0) == cv::Vec3b(10, 20, 30));
  CHECK_THROWS_AS(s.frame(3), contract_error);
  CHECK_THROWS_AS(s.frame(-1), contract_error);
}

TEST_CASE("broken recordings name the file and what was expected") {
  CHECK(contains(recording_error("/nowhere/at/all"), "no such folder"));
  const Recording r("broken");
  CHECK(contains(recording_error(r.path()), "rgb.txt"));
  r.text("rgb.txt", "0.0 rgb/0.png\n");
  CHECK(contains(recording_error(r.path()), "depth.txt"));
  r.text("depth.txt", "# only a comment\n");
  CHECK(contains(recording_error(r.path()), "depth.txt"));
  r.text("depth.txt", "100.0 depth/0.png\n");
  CHECK(contains(recording_error(r.path()), "same recording"));
  r.text("associations.txt", "0.0 rgb/0.png\n");
  CHECK(contains(recording_error(r.path()), "associations.txt:1"));
  CHECK_THROWS_AS(RgbdSequence(r.path(), CameraModel{}), contract_error);
}

TEST_CASE("files of the lists are in the folder, and a link that leads nowhere is no missing file") {
  const Recording r("outside");
  r.good(2);
  for (const char* outside : {"../0.png", "rgb/../../0.png", "/tmp/0.png"}) {
    CAPTURE(outside);
    r.text("associations.txt", std::string("0.0 ") + outside + " 0.0 depth/0.png\n");
    CHECK(contains(recording_error(r.path()), "expected files in this folder"));
  }
  r.text("associations.txt", "0.0 rgb/../rgb/0.png 0.0 depth/0.png\n");
  CHECK(recording_error(r.path()).empty());
  fs::create_symlink("groundtruth.txt", r.path() + "/groundtruth.txt");
  CHECK(RgbdSequence(r.path(), small_camera()).groundtruth_path() == r.path() + "/groundtruth.txt");
  fs::remove(r.path() + "/associations.txt");
  fs::create_symlink("nowhere", r.path() + "/associations.txt");
  CHECK(contains(recording_error(r.path()), "associations.txt: cannot open"));
}

TEST_CASE("unsorted and repeated stamps are put right with a warning") {
  const Recording r("unsorted");
  r.good(3);
  r.text("associations.txt", "0.2 rgb/1.png 0.2 depth/1.png\n0.1 rgb/0.png 0.1 depth/0.png\n0.2 rgb/2.png 0.2 depth/2.png\n");
  const RgbdSequence s(r.path(), small_camera());
  REQUIRE(s.size() == 2);
  CHECK(s.timestamp(0) == 0.1);
  CHECK(s.timestamp(1) == 0.2);
  CHECK(s.warnings().size() == 2);
}

TEST_CASE("a broken frame tells why and the next one is read") {
  const Recording r("frames");
  r.good(6);
  fs::remove(r.path() + "/rgb/0.png");
  r.text("depth/1.png", "this is no image");
  r.image("depth/2.png", cv::Mat(24, 32, CV_8UC1, cv::Scalar(9)));
  r.image("depth/3.png", cv::Mat(12, 16, CV_16UC1, cv::Scalar(9)));
  r.text("rgb/4.png", "");
  const RgbdSequence s(r.path(), small_camera());
  SequenceFrame f;
  const char* part[] = {"rgb/0.png: no such file", "depth/1.png: not an image", "8 bit, expected one of 16 bit",
                        "16 x 12, expected 32 x 24", "rgb/4.png: empty"};
  for (int i = 0; i < 5; ++i) {
    CAPTURE(i);
    CHECK_FALSE(s.read(i, f));
    CAPTURE(f.error);
    CHECK(contains(f.error, part[i]));
    CHECK(f.intensity.empty());
  }
  CHECK(s.read(5, f));
  CHECK(f.ok());
}

TEST_CASE("rectified images: straight rays, depth never interpolated") {
  CameraModel camera = small_camera();
  camera.k1 = -0.2;
  const opencv::Rectifier rectifier(camera);
  cv::Mat distorted(24, 32, CV_16UC1);
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 32; ++x) distorted.at<std::uint16_t>(y, x) = x < 16 ? 1000 : 5000;
  cv::Mat out;
  rectifier.depth(distorted, out);
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 32; ++x) {
      const int d = out.at<std::uint16_t>(y, x);
      CHECK((d == 0 || d == 1000 || d == 5000));
    }
  // the lens moves the ray (0.4, 0) to 0.4 (1 + k1 0.16)
  CHECK(camera.distort(0.4, 0).x() == doctest::Approx(0.4 * (1 - 0.2 * 0.16)));
  CHECK(camera.distort(0.4, 0).y() == 0);
}

TEST_CASE("cameras by name") {
  CHECK(camera_by_name("tum-fr3").pinhole.fx == 535.4);
  CHECK_FALSE(camera_by_name("tum-fr3").distorted());
  CHECK(camera_by_name("tum-fr1").k3 == 1.1633);
  CHECK(camera_by_name("bonn").distorted());
  CHECK(camera_by_name("tum-fr1").stamp_delay == 0.015);
  CHECK(camera_by_name("bonn").readout == 0.03);
  CHECK(camera_by_name("bonn").stamp_delay == 0);
  CHECK(camera_by_name("icl-nuim").readout == 0);
  CHECK(camera_by_name("icl-nuim").inverse_depth_sigma == 0);  // rendered: what is not known
  // half a pixel of disparity: a focal length of 580 px, 7.5 cm between projector and camera
  CHECK(camera_by_name("tum-fr1").inverse_depth_sigma == doctest::Approx(0.5 / (580 * 0.075)).epsilon(0.05));
  try {
    (void)camera_by_name("kinect");
    FAIL("expected an exception");
  } catch (const contract_error& e) {
    CHECK(contains(e.what(), "icl-nuim"));
    CHECK(contains(e.what(), "kinect"));
  }
}
