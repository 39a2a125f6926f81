// OpenCV's RGB-D odometry alone and with apso around it, on the same frames.
#include <algorithm>
#include <cstdint>
#include <string>

#include <doctest/doctest.h>
#include <opencv2/imgproc.hpp>

#include <apso/testing/synthetic.hpp>

#include "odometry.hpp"

using namespace apso;

namespace {
struct Errors {
  double alone = 0;  // largest distance of the camera from the truth [m]
  double with = 0;
  bool finite = true;
};
Errors run(const std::string& name, int frames) {
  testing::SyntheticOptions o;
  o.width = 320;
  o.height = 240;
  o.frames = frames;
  o.seed = 101;
  const testing::SyntheticSequence sequence(name, o);
  Odometry alone(sequence.camera(), false);
  Odometry with(sequence.camera());
  testing::SyntheticFrame f;
  cv::Mat grey;
  Errors e;
  const Pose T_world_first = sequence.T_world_camera(0);
  for (int i = 0; i < frames; ++i) {
    sequence.render(i, f);
    cv::cvtColor(cv::Mat(o.height, o.width, CV_8UC3, f.rgb.data()), grey, cv::COLOR_RGB2GRAY);
    const cv::Mat depth(o.height, o.width, CV_32F, f.depth.data());
    const auto error = [&](const Pose& T) -> Eigen::Vector3d { return (T_world_first * T).translation() - f.T_world_camera.translation(); };
    const Pose a = alone.track(f.timestamp, grey, depth);
    const Pose b = with.track(f.timestamp, grey, depth);
    e.finite = e.finite && is_finite(a) && is_finite(b);
    e.alone = std::max(e.alone, error(a).norm());
    e.with = std::max(e.with, error(b).norm());
  }
  return e;
}
}  // namespace

TEST_CASE("people who walk drag OpenCV's odometry, and not the one with apso around it") {
  const Errors e = run("walking_static", 60);
  MESSAGE("largest error [m]: alone ", e.alone, ", with apso ", e.with);
  CHECK(e.finite);
  CHECK(e.alone > 0.03);
  CHECK(e.with < 0.5 * e.alone);
}

TEST_CASE("where nobody moves it is no worse") {
  const Errors e = run("static_xyz", 40);
  MESSAGE("largest error [m]: alone ", e.alone, ", with apso ", e.with);
  CHECK(e.finite);
  CHECK(e.with < 1.05 * e.alone);
}
