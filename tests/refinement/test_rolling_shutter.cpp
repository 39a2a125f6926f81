// Rolling shutters against rows that are ray cast one by one, each from where the camera was when it was read.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include <apso/refinement/align.hpp>
#include <apso/refinement/camera_velocity.hpp>
#include <apso/traits/images/rolling_shutter.hpp>

#include "room.hpp"

using namespace apso;

namespace {

// A camera in a hand that shakes twice a second: up to 0.4 m/s and 60 degrees per second.
Pose pose_at(double t) {
  const double w = 4 * kPi;
  return room::pose(0.03 * std::sin(w * t), 0.02 * std::sin(w * t + 1), 0.3 + 0.02 * std::cos(w * t), 3.5 * std::sin(w * t + 2),
                    4.5 * std::cos(w * t), 2 * std::sin(w * t));
}
Twist velocity_at(double t) {
  const double h = 1e-4;
  return Twist(se3_log(compose(inverse(pose_at(t - h)), pose_at(t + h))) / (2 * h));
}

struct Read {
  room::Frame seen;     // row by row, depth `delay` later
  room::Frame at_once;  // what a global shutter would see
};
Read read(const Pinhole& camera, double t, double readout, double delay, unsigned noise = 0) {
  const auto row = [&](double start) {
    return [&camera, readout, start](int y) { return pose_at(start + readout * ((y + 0.5) / camera.height - 0.5)); };
  };
  Read r{room::render_rows(camera, row(t), {}, noise), room::render(camera, pose_at(t))};
  r.seen.depth = room::render_rows(camera, row(t + delay), {}, noise).depth;
  return r;
}
// Medians of what two frames differ by, inside of a border that the shift leaves: intensity, depth [m].
std::pair<double, double> difference(const Image<float>& i, const Image<float>& d, const room::Frame& b) {
  std::vector<float> intensity;
  std::vector<float> depth;
  for (int y = 20; y < i.height() - 20; ++y) {
    for (int x = 20; x < i.width() - 20; ++x) {
      intensity.push_back(std::abs(i(x, y) - b.intensity(x, y)));
      if (d(x, y) > 0) depth.push_back(std::abs(d(x, y) - b.depth(x, y)));
    }
  }
  const auto median = [](std::vector<float>& v) {
    std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
    return static_cast<double>(v[v.size() / 2]);
  };
  return {median(intensity), median(depth)};
}

}  // namespace

TEST_CASE("a frame that was read row by row becomes what a global shutter would have seen") {
  const Pinhole camera = room::camera();
  for (const double readout : {0.03, -0.03}) {
    for (const double delay : {0.0, 0.012, -0.012}) {
      for (const double t : {0.1, 0.23, 0.4}) {
        CAPTURE(readout);
        CAPTURE(delay);
        CAPTURE(t);
        const Read r = read(camera, t, readout, delay);
        RollingShutter shutter(camera, readout);
        shutter.follow(r.seen.view(), velocity_at(t), delay);
        Image<float> grey;
        shutter.intensity(r.seen.view(), grey);
        const auto raw = difference(r.seen.intensity, r.seen.depth, r.at_once);
        const auto mended = difference(grey, shutter.depth(), r.at_once);
        CHECK(mended.first < 0.3 * raw.first);
        CHECK(mended.second < 0.5 * raw.second);
        CHECK(mended.second < 0.002);  // [m]: nearest pixels of walls that are seen at a slant
      }
    }
  }
}

TEST_CASE("a camera that rests, and one that reads all rows at once, leave the images as they are") {
  const Pinhole camera = room::camera();
  const room::Frame f = room::render(camera, pose_at(0));
  const auto same = [&](RollingShutter shutter, const Twist& velocity) {
    shutter.follow(f.view(), velocity);
    Image<float> grey;
    shutter.intensity(f.view(), grey);
    bool equal = true;
    for (std::size_t i = 0; i < grey.size(); ++i) {
      equal = equal && grey.data()[i] == f.intensity.data()[i] && shutter.depth().data()[i] == f.depth.data()[i];
    }
    CHECK(equal);
  };
  same(RollingShutter(camera, 0.03), zeros<Twist>());
  same(RollingShutter(camera, 0), velocity_at(0.1));
}

TEST_CASE("depth that was not measured stays so, and velocities of any size lead to no pixel outside of the image") {
  const Pinhole camera = room::camera();
  room::Frame f = room::render(camera, pose_at(0));
  const float none[] = {0, -1, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()};
  for (int y = 100; y < 140; ++y) {
    for (int x = 100; x < 140; ++x) f.depth(x, y) = none[(x + y) % 4];
  }
  RollingShutter shutter(camera, 0.03);
  shutter.follow(f.view(), velocity_at(0.1), 0.005);
  CHECK(shutter.depth()(120, 120) == 0.0F);
  for (std::size_t i = 0; i < shutter.depth().size(); ++i) REQUIRE(std::isfinite(shutter.depth().data()[i]));
  Twist fast;
  fast << 60, -50, 40, 60, -50, 40;
  shutter.follow(f.view(), fast, 0.2);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      REQUIRE(shutter.map_x()(x, y) >= 0);
      REQUIRE(shutter.map_x()(x, y) <= camera.width - 1);
      REQUIRE(shutter.map_y()(x, y) >= 0);
      REQUIRE(shutter.map_y()(x, y) <= camera.height - 1);
    }
  }
}

TEST_CASE("a narrower image is mended as the left part of a wider one, whatever its width") {
  const Pinhole camera = room::camera();
  const room::Frame f = room::render(camera, pose_at(0.1));
  RollingShutter shutter(camera, 0.03);
  shutter.follow(f.view(), velocity_at(0.1), 0.005);
  for (const int width : {1, 3, 47, 64, 301}) {
    CAPTURE(width);
    Pinhole narrow = camera;
    narrow.width = width;
    RgbdFrame part = f.view();
    part.intensity.width = part.depth.width = width;  // same rows
    RollingShutter same(narrow, 0.03);
    same.follow(part, velocity_at(0.1), 0.005);
    bool equal = true;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < width; ++x) {
        equal = equal && same.map_y()(x, y) == shutter.map_y()(x, y);
        const float u = shutter.map_x()(x, y);
        if (u > static_cast<float>(width - 1)) continue;  // seen beyond the narrow image
        equal = equal && same.map_x()(x, y) == u;
      }
    }
    CHECK(equal);
  }
}

TEST_CASE("the velocity at a frame comes from the frames beside it, better than from the one before alone") {
  const Pinhole camera = room::camera();
  const double step = 1.0 / 30;
  CameraVelocity velocity(camera);
  double two_sided = 0;
  double one_sided = 0;
  std::optional<Twist> late;
  for (int i = 0; i < 16; ++i) {
    const double t = i * step;
    const room::Frame f = room::render(camera, pose_at(t), {}, 7 + static_cast<unsigned>(i));
    velocity.push(f.view(t));
    if (i < 2) continue;
    const Twist truth = velocity_at(t - step);
    const std::optional<Twist> found = velocity.of_frame_before();
    REQUIRE(found);
    two_sided += squared_norm(Twist(*found - truth));
    if (late) one_sided += squared_norm(Twist(*late - truth));
    late = velocity.of_latest_frame();
    REQUIRE(late);
  }
  CHECK(std::sqrt(two_sided / 14) < 0.1);  // of up to 1.2 m/s and rad/s; the mean of the neighbours is off by (w h)^2 / 6 = 3 % of it
  CHECK(two_sided < 0.25 * one_sided);     // whose lag is w h / 2 = 21 %
}

TEST_CASE("frames without a neighbour, far apart or without texture tell no velocity") {
  const Pinhole camera = room::camera(160);
  const room::Frame f = room::render(camera, pose_at(0));
  CameraVelocity velocity(camera);
  CHECK_FALSE(velocity.of_frame_before());
  velocity.push(f.view(0));
  CHECK_FALSE(velocity.of_frame_before());
  CHECK_FALSE(velocity.of_latest_frame());
  velocity.push(f.view(1));  // [s]
  CHECK_FALSE(velocity.of_latest_frame());
  velocity.push(f.view(1));  // a stamp that stands still
  CHECK_FALSE(velocity.of_latest_frame());
  room::Frame wall = f;
  std::fill_n(wall.intensity.data(), wall.intensity.size(), 0.5F);
  std::fill_n(wall.depth.data(), wall.depth.size(), 2.0F);
  velocity.push(wall.view(1.03));
  CHECK_FALSE(velocity.of_latest_frame());
  velocity.push(f.view(1.06));
  velocity.push(f.view(1.1));
  REQUIRE(velocity.of_frame_before());  // from the frame after alone
  CHECK(norm(*velocity.of_frame_before()) < 1e-3);
  const room::Frame moved = room::render(camera, pose_at(1.0 / 30));
  velocity.push(moved.view(1.1 + 1e-6));  // centimetres within a microsecond
  CHECK_FALSE(velocity.of_latest_frame());
  velocity.reset();
  CHECK_FALSE(velocity.of_frame_before());
}

TEST_CASE("alignment of frames that a rolling shutter has read is more exact once they are mended") {
  const Pinhole camera = room::camera();
  const double readout = 0.03;
  const double step = 1.0 / 30;
  CameraVelocity velocity(camera);
  RollingShutter shutter(camera, readout);
  std::vector<Read> all;
  std::vector<room::Frame> mended;
  for (int i = 0; i < 12; ++i) {
    all.push_back(read(camera, i * step, readout, 0.008, 3 + static_cast<unsigned>(i)));
    velocity.push(all.back().seen.view(i * step));
    if (i < 2) continue;
    const room::Frame& before = all[static_cast<std::size_t>(i - 1)].seen;
    REQUIRE(velocity.of_frame_before());
    shutter.follow(before.view(), *velocity.of_frame_before(), 0.008);
    mended.emplace_back();
    shutter.intensity(before.view(), mended.back().intensity);
    mended.back().depth = shutter.depth();
  }
  double raw = 0;
  double now = 0;
  for (std::size_t k = 1; k < mended.size(); ++k) {
    const double t = static_cast<double>(k + 1) * step;
    const Pose T_before_after = compose(inverse(pose_at(t - step)), pose_at(t));
    const auto error = [&](const RgbdFrame& a, const RgbdFrame& b) {
      const auto found = align(frame(0.0, a.intensity, a.depth, camera), frame(0.0, b.intensity, b.depth, camera));
      REQUIRE(succeeded(found.status));
      return room::translation_error(inverse(found.T_current_reference), T_before_after);
    };
    raw += error(all[k].seen.view(), all[k + 1].seen.view());
    now += error(mended[k - 1].view(), mended[k].view());
  }
  CHECK(now < 0.4 * raw);
}

TEST_CASE("what is no rolling shutter is refused") {
  const Pinhole camera = room::camera(160);
  const auto refused = [](auto&& f, const std::string& text) {
    try {
      f();
      FAIL("not refused");
    } catch (const contract_error& e) {
      CHECK(std::string(e.what()).find(text) != std::string::npos);
    }
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused([&] { RollingShutter(camera, 0.3); }, "readout must be in [-0.2, 0.2] s");
  refused([&] { RollingShutter(camera, nan); }, "readout must be in [-0.2, 0.2] s");
  RollingShutter shutter(camera, 0.03);
  const Image<float> image(160, 120, 0.5F);
  const Image<float> other(80, 60, 0.5F);
  const RgbdFrame f{0, image, image};
  Image<float> grey;
  refused([&] { shutter.intensity(f, grey); }, "call follow() for the frame first");
  refused([&] { shutter.follow(RgbdFrame{0, image, other}, zeros<Twist>()); }, "another size");
  refused([&] { shutter.follow(RgbdFrame{0, other, image}, zeros<Twist>()); }, "another size");
  Pinhole elsewhere = camera;
  elsewhere.cx += 1;
  refused([&] { shutter.follow(frame(0, image, image, elsewhere), zeros<Twist>()); }, "another camera");
  Twist v = zeros<Twist>();
  refused([&] { shutter.follow(f, v, nan); }, "depth_delay must be in [-0.2, 0.2] s");
  for (const double wrong : {nan, 101.0}) {
    v(4) = wrong;
    refused([&] { shutter.follow(f, v); }, "velocity must be at most 100 m/s and 100 rad/s");
  }
}
