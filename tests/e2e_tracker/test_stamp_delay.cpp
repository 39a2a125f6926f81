// Poses of frames that were seen some time before their stamps.
#include <cmath>
#include <cstddef>

#include <doctest/doctest.h>

#include "../../examples/track/stamp_delay.hpp"

namespace {

apso::Twist speed() {
  apso::Twist v;
  v << 0.3, -0.2, 0.1, 0.4, 0.5, -0.6;  // [m/s, rad/s]
  return v;
}
apso::Pose steady(double t) { return apso::se3_exp(apso::Twist(t * speed())); }
apso::Pose shaken(double t) {
  apso::Twist xi;
  xi << 0.03 * std::sin(12 * t), 0.02 * std::cos(12 * t), 0, 0, 0.05 * std::sin(12 * t), 0.05 * std::cos(12 * t);
  return apso::se3_exp(xi);
}
// Frames that were seen `delay` before their stamps, 30 a second; the tenth comes half a second after the ninth.
template <class Path>
apso::Trajectory seen(Path&& path, double delay, int frames = 20) {
  apso::Trajectory all;
  for (int i = 0; i < frames; ++i) {
    const double stamp = 5 + i / 30.0 + (i < 10 ? 0 : 0.5);
    all.push_back({stamp, path(stamp - delay)});
  }
  return all;
}
double distance(const apso::Pose& a, const apso::Pose& b) { return apso::norm(apso::se3_log(apso::compose(apso::inverse(a), b))); }

}  // namespace

TEST_CASE("poses of a steady motion are right at the stamps, at the ends and beside a gap as well") {
  for (const double delay : {0.015, -0.015, 0.05, -0.1, 0.2}) {
    CAPTURE(delay);
    const apso::Trajectory at = track::at_stamps(seen(steady, delay), delay);
    REQUIRE(at.size() == 20);
    for (const apso::StampedPose& p : at) CHECK(distance(p.T_world_body, steady(p.timestamp)) < 1e-12);
  }
}

TEST_CASE("poses of a shaken camera are nearer to those at the stamps") {
  const double delay = 0.015;
  const apso::Trajectory before = seen(shaken, delay);
  const apso::Trajectory at = track::at_stamps(before, delay);
  for (std::size_t i = 0; i < at.size(); ++i) {
    CHECK(at[i].timestamp == before[i].timestamp);
    const apso::Pose truth = shaken(at[i].timestamp);
    // the acceleration is below 9 / s^2, a step 1/30 s, s = 0.45 of it are missing: s (1 - s) / 2 of a step squared between frames,
    // (1 + s) s / 2 beyond the last
    const bool between = i != 9 && i != 19;
    CHECK(distance(at[i].T_world_body, truth) < 9 / 900.0 * (between ? 0.125 : 0.33));
    CHECK(distance(before[i].T_world_body, truth) > 0.6 * delay);  // it turns at 0.6 rad/s
  }
}

TEST_CASE("without a delay or a neighbour a pose stays what it is") {
  const apso::Trajectory before = seen(shaken, 0);
  const apso::Trajectory at = track::at_stamps(before, 0);
  for (std::size_t i = 0; i < at.size(); ++i) CHECK(at[i].T_world_body.matrix() == before[i].T_world_body.matrix());
  CHECK(track::at_stamps({}, 0.01).empty());
  const apso::Trajectory alone{{1.0, steady(1)}, {1.5, steady(1.5)}};
  for (const double delay : {0.01, -0.01}) {
    const apso::Trajectory same = track::at_stamps(alone, delay);
    CHECK(same[0].T_world_body.matrix() == alone[0].T_world_body.matrix());
    CHECK(same[1].T_world_body.matrix() == alone[1].T_world_body.matrix());
  }
}
