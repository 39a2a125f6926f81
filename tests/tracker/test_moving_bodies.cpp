// The motion of the camera by tracks of which some are on a body: a wall far behind, furniture, and somebody who walks.
#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include <apso/testing/synthetic_sensor.hpp>
#include <apso/tracker/solvers/moving_bodies.hpp>
#include <apso/tracker/solvers/ransac_pose.hpp>

using namespace apso;

namespace {
const Pinhole kCamera{525, 525, 319.5, 239.5, 640, 480};
const Eigen::Vector3d kWalk(0.014, 0, 0);  // of the body between the frames [m]

struct Tracks {
  std::vector<PointObservation> all;
  std::size_t on_body = 0;
  Eigen::Vector3d body_centre = Eigen::Vector3d::Zero();
};

// The world is the previous camera. noise: of the tracks [px]
Tracks look(std::uint64_t seed, const Pose& T_previous_current, const Eigen::Vector3d& body_motion, double noise = 0.3) {
  static const testing::NormalTable table;
  testing::Random rng(seed);
  const auto normal = [&] { return static_cast<double>(table(rng.next())); };
  Tracks out;
  const Pose T_current_previous = inverse(T_previous_current);
  const auto add = [&](const Eigen::Vector3d& previous, const Eigen::Vector3d& now) {
    const Eigen::Vector3d p = transform(T_current_previous, now);
    const Eigen::Vector2d u = kCamera.project(p);
    if (!(p.z() > 0.3) || u.x() < 0 || u.y() < 0 || u.x() > 639 || u.y() > 479) return false;
    PointObservation o;
    o.point = previous * (1 + 0.002 * previous.z() * normal());
    o.u = u.x() + noise * normal();
    o.v = u.y() + noise * normal();
    o.inverse_depth = 1 / p.z() + 0.002 * normal();
    o.inverse_depth_sigma = 0.004;
    out.all.push_back(o);
    return true;
  };
  const auto at_rest = [&](const Eigen::Vector3d& p) { add(p, p); };
  for (int i = 0; i < 160; ++i) at_rest({rng.uniform(-2.5, 2.5), rng.uniform(-1.8, 1.8), 4.5});
  for (int i = 0; i < 12; ++i) at_rest({rng.uniform(-1.4, -1.0), rng.uniform(0.3, 0.9), rng.uniform(2.2, 2.6)});
  out.body_centre = {0.5, 0.0, 2.0};
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d p = out.body_centre + Eigen::Vector3d(rng.uniform(-.2, .2), rng.uniform(-.5, .5), rng.uniform(-.1, .1));
    out.on_body += add(p, p + body_motion) ? 1 : 0;
  }
  return out;
}

double error_mm(const Pose& T, const Pose& truth) { return 1e3 * translation(compose(inverse(truth), T)).norm(); }

Pose by_single_tracks(const std::vector<PointObservation>& tracks) {
  RansacOptions o;
  o.threshold = 1;
  return ransac_pose(kCamera, tracks, {identity_pose()}, o).T_world_camera;
}
}  // namespace

TEST_CASE("a body before a wall drags the pose of single tracks along, and not the pose by whole bodies") {
  Twist xi;
  xi << 0.003, -0.002, 0.004, 0.002, -0.004, 0.001;
  const Pose truth = se3_exp(xi);
  int dragged = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    CAPTURE(seed);
    Tracks tracks = look(seed, truth, kWalk);
    const std::size_t all = tracks.all.size();
    const Pose first = by_single_tracks(tracks.all);
    dragged += error_mm(first, truth) > 0.6e3 * kWalk.norm() ? 1 : 0;
    MovingBodies bodies;
    const Pose T = bodies.separate(kCamera, tracks.all, first);
    CHECK(error_mm(T, truth) < 0.5e3 * kWalk.norm());
    CHECK(tracks.all.size() <= all - tracks.on_body / 2);
    CHECK(2 * tracks.all.size() >= all);
    CHECK(bodies.moves(tracks.body_centre));
    CHECK_FALSE(bodies.moves({-1.2, 0.6, 2.4}));
    CHECK_FALSE(bodies.moves({-1.5, -1.0, 4.5}));
  }
  CHECK(dragged >= 10);  // the case is the hard one
}

TEST_CASE("a body is told to move even where the given pose is its own") {
  Twist xi;
  xi << 0.003, -0.002, 0.004, 0.002, -0.004, 0.001;
  const Pose truth = se3_exp(xi);
  const Eigen::Vector3d walk = 3 * kWalk;
  const Pose of_body = compose(make_pose(Eigen::Matrix3d::Identity(), -walk), truth);
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    CAPTURE(seed);
    Tracks tracks = look(seed, truth, walk, 0.1);
    const std::size_t all = tracks.all.size();
    MovingBodies bodies;
    const Pose T = bodies.separate(kCamera, tracks.all, of_body);
    CHECK(error_mm(T, truth) < 0.2e3 * walk.norm());
    CHECK(tracks.all.size() <= all - tracks.on_body / 2);
    CHECK(bodies.moves(tracks.body_centre));
  }
}

TEST_CASE("where nothing moves, nothing is left out") {
  Twist xi;
  xi << 0.01, 0.005, -0.01, 0.01, 0.02, -0.005;
  const Pose truth = se3_exp(xi);
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    CAPTURE(seed);
    Tracks tracks = look(seed, truth, Eigen::Vector3d::Zero());
    const std::size_t all = tracks.all.size();
    const Pose first = by_single_tracks(tracks.all);
    MovingBodies bodies;
    const Pose T = bodies.separate(kCamera, tracks.all, first);
    CHECK(tracks.all.size() == all);
    CHECK(T.matrix() == first.matrix());
    CHECK_FALSE(bodies.moves(tracks.body_centre));
  }
}

TEST_CASE("where more than half would move, nothing is left out") {
  // Three bodies that go three ways, and nothing else: no motion has the half of them.
  testing::Random rng(5);
  std::vector<PointObservation> tracks;
  for (int body = 0; body < 3; ++body) {
    const Eigen::Vector3d centre(body - 1.0, 0, 2.0);
    const Eigen::Vector3d motion(0.05 * (body == 0), 0.05 * (body == 1), -0.10 * (body == 2));
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d p = centre + Eigen::Vector3d(rng.uniform(-.2, .2), rng.uniform(-.4, .4), rng.uniform(-.1, .1));
      const Eigen::Vector2d u = kCamera.project(p + motion);
      PointObservation o;
      o.point = p;
      o.u = u.x();
      o.v = u.y();
      o.inverse_depth = 1 / (p + motion).z();
      o.inverse_depth_sigma = 0.004;
      tracks.push_back(o);
    }
  }
  MovingBodies bodies;
  const Pose T = bodies.separate(kCamera, tracks, identity_pose());
  CHECK(tracks.size() == 300);
  CHECK(T.matrix() == identity_pose().matrix());
  CHECK_FALSE(bodies.any());
}

TEST_CASE("too few tracks are no bodies, and what was found before is forgotten") {
  Tracks tracks = look(3, identity_pose(), {0.05, 0, 0});
  MovingBodies bodies;
  bodies.separate(kCamera, tracks.all, by_single_tracks(tracks.all));
  REQUIRE(bodies.moves(tracks.body_centre));
  std::vector<PointObservation> few(tracks.all.begin(), tracks.all.begin() + 15);
  const Pose T = bodies.separate(kCamera, few, identity_pose());
  CHECK(T.matrix() == identity_pose().matrix());
  CHECK(few.size() == 15);
  CHECK_FALSE(bodies.moves(tracks.body_centre));
}
