// apso_track and apso_rectify on a recording whose rows were read one after another, and whose depth came later than its colour.
#ifdef APSO_MINIMAL_TRACKER
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <apso/evaluation/trajectory.hpp>
#include <apso/io/camera_yaml.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/math/se3.hpp>
#include <apso/opencv/rgbd_sequence.hpp>

#include "../../examples/track/stamp_delay.hpp"
#include "../refinement/room.hpp"
#include "../run_program.hpp"

namespace {

namespace fs = std::filesystem;

constexpr double kReadout = 0.03;
constexpr double kDelay = 0.01;  // of the depth [s]

// A hand that shakes twice a second: up to 0.4 m/s and 60 degrees per second.
apso::Pose at(double t) {
  const double w = 12.566;
  return room::pose(0.03 * std::sin(w * t), 0.02 * std::sin(w * t + 1), 0.3 + 0.02 * std::cos(w * t), 3.5 * std::sin(w * t + 2),
                    4.5 * std::cos(w * t), 2 * std::sin(w * t));
}

// Stands still; the masks of the recording are those of it.
const room::Slab kSlab{true, -0.6, 0.8, 1.5};

cv::Mat mask_of(const room::Frame& f) {
  cv::Mat_<std::uint8_t> mask(f.probability.height(), f.probability.width());
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) mask(y, x) = f.probability(x, y) > 0 ? 255 : 0;
  }
  return mask;
}

void record(const fs::path& folder, int frames) {
  const apso::Pinhole camera = room::camera(640);
  fs::create_directories(folder / "rgb");
  fs::create_directories(folder / "depth");
  fs::create_directories(folder / "masks");
  fs::create_directories(folder / "at_once");
  std::ofstream list(folder / "associations.txt");
  apso::Trajectory truth;
  for (int i = 0; i < frames; ++i) {
    const double t = 1 + i / 30.0;
    const auto rows_from = [&](double middle) {
      return [&camera, middle](int y) { return at(middle + kReadout * ((y + 0.5) / camera.height - 0.5)); };
    };
    const room::Frame colour = room::render_rows(camera, rows_from(t), kSlab, 1 + static_cast<unsigned>(i));
    const room::Frame depth = room::render_rows(camera, rows_from(t + kDelay), kSlab, 1000 + static_cast<unsigned>(i));
    cv::Mat_<std::uint8_t> grey(camera.height, camera.width);
    cv::Mat_<std::uint16_t> units(camera.height, camera.width);
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        grey(y, x) = cv::saturate_cast<std::uint8_t>(255 * colour.intensity(x, y));
        units(y, x) = cv::saturate_cast<std::uint16_t>(5000 * depth.depth(x, y));
      }
    }
    const std::string name = std::to_string(t) + ".png";
    cv::imwrite((folder / "rgb" / name).string(), grey);
    cv::imwrite((folder / "depth" / name).string(), units);
    cv::imwrite((folder / "masks" / name).string(), mask_of(colour));
    cv::imwrite((folder / "at_once" / name).string(), mask_of(room::render(camera, at(t), kSlab)));
    list << std::to_string(t) << " rgb/" << name << ' ' << std::to_string(t + kDelay) << " depth/" << name << '\n';
    truth.push_back({t, at(t)});
  }
  apso::write_trajectory((folder / "groundtruth.txt").string(), truth);
  const auto camera_file = [&](const char* name, double readout) {
    std::ofstream(folder / name) << "fx: " << camera.fx << "\nfy: " << camera.fy << "\ncx: " << camera.cx << "\ncy: " << camera.cy
                                 << "\nwidth: 640\nheight: 480\ndepth_scale: 5000\nreadout: " << readout << '\n';
  };
  camera_file("rolling.yaml", kReadout);
  camera_file("global.yaml", 0);
  camera_file("late.yaml", kReadout);
  std::ofstream(folder / "late.yaml", std::ios::app) << "stamp_delay: 0.01\n";
}

std::string text(const fs::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

// Share of pixels whose colour or depth is not the true one.
double difference(const apso::opencv::SequenceFrame& f, const room::Frame& truth) {
  double wrong = 0;
  for (int y = 20; y < 460; ++y) {
    for (int x = 20; x < 620; ++x) {
      const bool colour = std::abs(f.intensity(x, y) - truth.intensity(x, y)) > 0.05F;
      const bool depth = std::abs(f.depth(x, y) - truth.depth(x, y)) > 0.02F;
      wrong += colour || depth ? 1 : 0;
    }
  }
  return wrong / (440.0 * 600.0);
}

}  // namespace

TEST_CASE("a recording of a rolling shutter is tracked as one of a global shutter, with any number of threads") {
  const Folder f;
  const fs::path in = f.path / "in";
  record(in, 40);
  const auto track = [&](const char* camera, const char* more, const char* out) {
    const Outcome o = run(std::string(APSO_TRACK) + " " + in.string() + " --camera " + (in / camera).string() + " --quiet --no-pictures " +
                              more + " --output " + (f.path / out).string(),
                          f.path);
    INFO(o.text);
    REQUIRE(o.code == 0);
    return read_json(f.path / out / "summary.json");
  };
  const auto rolling = track("rolling.yaml", "--threads 2", "rolling");
  const auto global = track("global.yaml", "--threads 2", "global");
  CHECK(rolling["frames"]["with_pose"] == 40);
  const auto rpe = [](const auto& summary) { return summary["final"]["rpe_1f"]["translation"]["rmse"].template get<double>(); };
  CAPTURE(rpe(global));
  CAPTURE(rolling["final"]["ate"]["rmse"].get<double>());
  CAPTURE(global["final"]["ate"]["rmse"].get<double>());
  CHECK(rpe(rolling) < 0.5 * rpe(global));
  CHECK(rolling["final"]["ate"]["rmse"].get<double>() < 0.5 * global["final"]["ate"]["rmse"].get<double>());

  track("rolling.yaml", "--threads 1", "alone");
  CHECK(text(f.path / "alone/trajectory.txt") == text(f.path / "rolling/trajectory.txt"));

  // a camera that gives stamps late: the same poses, moved on to the time of the stamps
  track("late.yaml", "", "late");
  const apso::Trajectory moved = track::at_stamps(apso::read_trajectory((f.path / "rolling/trajectory.txt").string()), 0.01);
  const apso::Trajectory late = apso::read_trajectory((f.path / "late/trajectory.txt").string());
  REQUIRE(late.size() == moved.size());
  for (std::size_t i = 0; i < late.size(); ++i) {
    CHECK(late[i].timestamp == moved[i].timestamp);
    CHECK((late[i].T_world_body.matrix() - moved[i].T_world_body.matrix()).norm() < 1e-8);
  }

  // masks of the images as they were read lie on the images as they are tracked
  const auto wrong = [&](const char* camera) {
    track(camera, ("--motion none --write-masks --masks " + (in / "masks").string()).c_str(), "masked");
    double pixels = 0;
    for (const auto& e : fs::directory_iterator(f.path / "masked" / "masks")) {
      const cv::Mat mask = cv::imread(e.path().string(), cv::IMREAD_GRAYSCALE);
      const cv::Mat truth = cv::imread((in / "at_once" / e.path().filename()).string(), cv::IMREAD_GRAYSCALE);
      pixels += cv::countNonZero((mask > 127) != (truth > 127));
    }
    return pixels / 40;
  };
  const double as_read = wrong("global.yaml");
  const double mended = wrong("rolling.yaml");
  CAPTURE(as_read);
  CAPTURE(mended);
  CHECK(mended < 0.5 * as_read);

  // a broken image in between: the frames beside it have one neighbour each
  std::ofstream(in / "rgb" / (std::to_string(1 + 20 / 30.0) + ".png"), std::ios::trunc) << "no picture";
  const auto broken = track("rolling.yaml", "", "broken");
  CHECK(broken["frames"]["with_pose"] == 39);
  CHECK(broken["final"]["ate"]["rmse"].get<double>() < global["final"]["ate"]["rmse"].get<double>());
}

TEST_CASE("apso_rectify writes what a pinhole with a global shutter would have seen") {
  const Folder f;
  const fs::path in = f.path / "in";
  constexpr int frames = 12;
  record(in, frames);
  const auto rectify = [&](const std::string& camera, const std::string& out) {
    return run(std::string(APSO_RECTIFY) + " " + in.string() + " --camera " + (in / camera).string() + " --output " + out, f.path);
  };
  std::ofstream(in / "rolling.yaml", std::ios::app) << "inverse_depth_sigma: 0.01\n";
  const fs::path out = f.path / "out";
  const Outcome done = rectify("rolling.yaml", out.string());
  INFO(done.text);
  REQUIRE(done.code == 0);
  CHECK(done.text.find("12 of 12 frames") != std::string::npos);
  CHECK(done.text.find("12 frames brought to one time") != std::string::npos);

  // the camera is that of images of one time, and the truth came along
  const apso::CameraModel camera = apso::camera_from_yaml((out / "camera.yaml").string());
  CHECK(camera.readout == 0);
  CHECK_FALSE(camera.distorted());
  CHECK(camera.inverse_depth_sigma == 0.01);
  CHECK(apso::read_trajectory((out / "groundtruth.txt").string()).size() == frames);

  const apso::opencv::RgbdSequence as_read(in.string(), apso::camera_from_yaml((in / "global.yaml").string()));
  const apso::opencv::RgbdSequence mended(out.string(), camera);
  REQUIRE(mended.size() == frames);
  double before = 0;
  double after = 0;
  for (int i = 0; i < frames; ++i) {
    CHECK(mended.timestamp(i) == doctest::Approx(as_read.timestamp(i)).epsilon(1e-9));
    const room::Frame truth = room::render(room::camera(640), at(mended.timestamp(i)), kSlab);
    before += difference(as_read.frame(i), truth);
    after += difference(mended.frame(i), truth);
    CHECK(mended.frame(i).depth_delay == 0);
  }
  CAPTURE(before);
  CAPTURE(after);
  CHECK(after < 0.5 * before);

  // stamps that came late are put right
  const fs::path early = f.path / "early";
  REQUIRE(rectify("late.yaml", early.string()).code == 0);
  CHECK(apso::opencv::RgbdSequence(early.string(), camera).timestamp(3) == doctest::Approx(as_read.timestamp(3) - 0.01).epsilon(1e-9));

  // without a readout and without distortion nothing changes
  const fs::path same = f.path / "same";
  REQUIRE(rectify("global.yaml", same.string()).code == 0);
  const apso::opencv::RgbdSequence copy(same.string(), camera);
  const apso::opencv::SequenceFrame a = as_read.frame(3);
  const apso::opencv::SequenceFrame b = copy.frame(3);
  CHECK(cv::norm(a.colour, b.colour, cv::NORM_INF) == 0);
  CHECK(std::equal(a.depth.data(), a.depth.data() + a.depth.size(), b.depth.data()));
  CHECK(rectify("global.yaml", same.string()).code == 0);  // its own work may be replaced

  // a broken frame is told and left out; a recording is never written into
  std::ofstream(in / "depth" / (std::to_string(1 + 5 / 30.0) + ".png"), std::ios::trunc) << "no picture";
  const Outcome broken = rectify("rolling.yaml", out.string());
  CHECK(broken.code == 0);
  CHECK(broken.text.find("frame 5 is left out") != std::string::npos);
  CHECK(broken.text.find("11 of 12 frames") != std::string::npos);
  CHECK(apso::opencv::RgbdSequence(out.string(), camera).size() == 11);
  const Outcome into = rectify("rolling.yaml", (in / "mended").string());
  CHECK(into.code == 1);
  CHECK(into.text.find("only read") != std::string::npos);
  fs::remove_all(in / "depth");
  const Outcome none = rectify("rolling.yaml", out.string());
  CHECK(none.code == 1);
  CHECK(apso::opencv::RgbdSequence(out.string(), camera).size() == 11);  // what was there stays
}
#endif
