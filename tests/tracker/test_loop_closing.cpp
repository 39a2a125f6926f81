#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/evaluation/parted_trajectory.hpp>
#include <apso/testing/numeric_jacobian.hpp>
#include <apso/testing/synthetic_features.hpp>
#include <apso/track.hpp>
#include <apso/tracker/map/loop_closing.hpp>
#include <apso/tracker/solvers/pose_graph.hpp>

#include "../foreign_types.hpp"
#include "room_camera.hpp"

using namespace apso;

namespace {

Pose screw(double x, double y, double z, double rx, double ry, double rz) {
  return se3_exp(Twist((Twist() << x, y, z, rx, ry, rz).finished()));
}

double difference(const Pose& a, const Pose& b) { return (a.matrix() - b.matrix()).norm(); }

/// A camera that turns round and comes back to where it began, seen by a tracker that takes its focal length for longer than it is.
template <class PoseT = Pose>
struct BasicTurn {
  PartedTrajectory trajectory;
  std::vector<Pose> truth;  ///< of the poses in the trajectory
  int closed = 0;           ///< loops
  double jump = 0;          ///< largest step of the pose at a loop [rad]

  BasicTurn(double focal_factor, bool reconnect, unsigned seed = 103) {
    constexpr int kFrames = 400, kStep = 3;  // a turn takes 330
    testing::SyntheticOptions o;
    o.width = 320;
    o.height = 240;
    o.seed = seed;
    o.noise = o.blur = false;
    o.frames = kFrames;
    testing::SyntheticSequence room("static_360", o);
    testing::SyntheticFeatures found(room.camera(), 12, 0.3, 1, true);
    Pinhole camera = room.camera();
    camera.fx *= focal_factor;
    camera.fy *= focal_factor;
    BasicLandmarkTracker<PoseT> tracker(camera);
    testing::SyntheticFrame image;
    for (int i = 0; i < kFrames; i += kStep) {
      CAPTURE(i);
      trajectory.add(image.timestamp, track_frame(i, room, found, image, tracker), 0);
      truth.push_back(compose(inverse(room.T_world_camera(0)), room.T_world_camera(i)));
      if (!reconnect) continue;
      const Pose before = to_pose(tracker.predicted());
      const BasicPartChange<PoseT> change = tracker.reconnect();
      trajectory.follow(change);
      if (change.event == PartEvent::None) continue;
      REQUIRE(change.event == PartEvent::Closed);
      CHECK(change.part == 0);
      CHECK(change.before == 0);
      CHECK(static_cast<int>(change.corrections.size()) == tracker.keyframes());
      // the frame of the loop itself is moved to where the place says that it is
      CHECK(difference(to_pose(tracker.predicted()), trajectory.of(0).back().T_world_body) < 0.02);
      jump = std::max(jump, rotation_angle(compose(inverse(before), to_pose(tracker.predicted()))));
      ++closed;
    }
  }
  [[nodiscard]] double largest_rotation_error() const {
    const Trajectory poses = trajectory.of(0);
    REQUIRE(poses.size() == truth.size());
    double largest = 0;
    for (std::size_t i = 0; i < truth.size(); ++i)
      largest = std::max(largest, rotation_angle(compose(inverse(truth[i]), poses[i].T_world_body)));
    return largest;
  }
};
using Turn = BasicTurn<>;

}  // namespace

TEST_CASE("the derivative of an edge of the pose graph is that of differences") {
  const Pose T_from = screw(1, -2, 0.5, 0.4, -1.1, 0.3), T_to = screw(0.2, 0.3, -1, -0.7, 0.2, 1.9);
  for (const double size : {0.0, 0.1, 0.3}) {
    CAPTURE(size);
    PoseGraphEdge edge;
    edge.T_from_to = compose(compose(inverse(T_from), T_to), screw(size, -size, 0.5 * size, 0.6 * size, 0.5 * size, -0.6 * size));
    const Twist e = edge_residual(edge, T_from, T_to);
    const auto moved = [](const Pose& T, const Eigen::VectorXd& x) { return compose(se3_exp(Twist(x)), T); };
    const Eigen::MatrixXd to = testing::numeric_jacobian(
        [&](const Eigen::VectorXd& x) { return Eigen::VectorXd(edge_residual(edge, T_from, moved(T_to, x))); }, Eigen::VectorXd::Zero(6));
    const Eigen::MatrixXd from = testing::numeric_jacobian(
        [&](const Eigen::VectorXd& x) { return Eigen::VectorXd(edge_residual(edge, moved(T_from, x), T_to)); }, Eigen::VectorXd::Zero(6));
    const Matrix6 J = edge_jacobian(e, T_to);
    CHECK((to - J).norm() < 1e-7 + 1e-2 * std::pow(size, 4));
    CHECK((from + J).norm() < 1e-7 + 1e-2 * std::pow(size, 4));
  }
}

TEST_CASE("a pose graph whose edges agree is solved exactly, from poses that are far off") {
  constexpr int kNodes = 40;
  std::vector<Pose> truth;
  for (int i = 0; i < kNodes; ++i) {
    const double a = 2 * 3.14159265358979 * i / kNodes;
    truth.push_back(compose(screw(2 * std::cos(a), 0.1 * i, 2 * std::sin(a), 0, 0, 0), screw(0, 0, 0, 0, -a, 0.2)));
  }
  PoseGraph graph;
  for (int i = 0; i < kNodes; ++i) {
    for (const int step : {1, 3}) {
      const int j = (i + step) % kNodes;
      graph.edges.push_back({i, j, compose(inverse(truth[static_cast<std::size_t>(i)]), truth[static_cast<std::size_t>(j)])});
    }
    const double drift = 0.01 * i;
    graph.T_world_node.push_back(compose(screw(drift, -drift, 0, 0, drift, 0.5 * drift), truth[static_cast<std::size_t>(i)]));
    graph.fixed.push_back(i == 0 ? 1 : 0);
  }
  REQUIRE(optimise_pose_graph(graph) == Status::Converged);
  CHECK(difference(graph.T_world_node[0], truth[0]) == 0);
  for (std::size_t i = 0; i < truth.size(); ++i) CHECK(difference(graph.T_world_node[i], truth[i]) < 1e-7);
  // nothing is left to do
  const PoseGraph solved = graph;
  REQUIRE(optimise_pose_graph(graph) == Status::Converged);
  for (std::size_t i = 0; i < truth.size(); ++i) CHECK(difference(graph.T_world_node[i], solved.T_world_node[i]) < 1e-9);
}

TEST_CASE("what a loop is off by is spread evenly over edges that are equally exact") {
  constexpr int kNodes = 11;
  PoseGraph graph;
  for (int i = 0; i < kNodes; ++i) {
    graph.T_world_node.push_back(screw(0.5 * i, 0, 0, 0, 0, 0));
    graph.fixed.push_back(i == 0 || i == kNodes - 1 ? 1 : 0);
    if (i > 0) graph.edges.push_back({i - 1, i, screw(0.5, 0, 0, 0, 0, 0)});
  }
  graph.T_world_node.back() = screw(5.3, 0, 0, 0, 0, 0);
  REQUIRE(succeeded(optimise_pose_graph(graph)));
  for (int i = 0; i < kNodes; ++i)
    CHECK(difference(graph.T_world_node[static_cast<std::size_t>(i)], screw(0.53 * i, 0, 0, 0, 0, 0)) < 1e-8);
}

TEST_CASE("a pose graph with numbers that are none is left as it was") {
  PoseGraph graph;
  graph.T_world_node = {identity_pose(), screw(1, 0, 0, 0, 0, 0)};
  graph.fixed = {1, 0};
  graph.edges.push_back({0, 1, screw(std::nan(""), 0, 0, 0, 0, 0)});
  CHECK(optimise_pose_graph(graph) == Status::Diverged);
  CHECK(difference(graph.T_world_node[1], screw(1, 0, 0, 0, 0, 0)) == 0);
}

TEST_CASE("poses between the keyframes of a loop move by what is between their corrections, in types of the user too") {
  PartChange change;
  change.event = PartEvent::Closed;
  const Pose first = screw(0.1, 0, 0, 0, 0.02, 0), second = screw(0.3, 0, -0.1, 0, 0.06, 0.01);
  change.corrections = {{1.0, first}, {3.0, second}};
  const Pose T = screw(1, 2, 3, 0.1, 0.2, 0.3);
  CHECK(difference(change.moved(0.0, T), compose(first, T)) < 1e-12);
  CHECK(difference(change.moved(1.0, T), compose(first, T)) < 1e-12);
  CHECK(difference(change.moved(1.5, T), compose(sclerp(first, second, 0.25), T)) < 1e-12);
  CHECK(difference(change.moved(3.0, T), compose(second, T)) < 1e-12);
  CHECK(difference(change.moved(9.0, T), compose(second, T)) < 1e-12);
  const auto theirs = in_type<foreign::DualQuaternionPose>(change);
  CHECK(theirs.closed());
  CHECK(difference(to_pose(theirs.moved(1.5, from_pose<foreign::DualQuaternionPose>(T))), change.moved(1.5, T)) < 1e-9);
  // what did not move anything
  CHECK(difference(PartChange{}.moved(2.0, T), T) == 0);
  CHECK_FALSE(PartChange{}.moves_poses());

  PartedTrajectory trajectory;
  trajectory.add(1.0, T, 0);
  trajectory.add(2.0, T, 0);
  trajectory.add(2.0, T, 1);
  trajectory.follow(theirs);
  CHECK(difference(trajectory.of(0)[1].T_world_body, change.moved(2.0, T)) < 1e-9);
  CHECK(difference(trajectory.of(1)[0].T_world_body, T) == 0);
}

TEST_CASE("two looks at the same drift close a loop, and a place that moves or is seen once does not") {
  SecondLook look;
  const Pose drift = screw(0.2, 0.1, 0, 0, 0.1, 0);
  const auto at = [](double t) {
    PlacedFrame frame;
    frame.timestamp = t;
    frame.T_world_camera = screw(t, 0, 0, 0, 0.3 * t, 0);
    return frame;
  };
  const auto seen = [&](double t, const Pose& off) { return look.agrees(0, compose(off, at(t).T_world_camera), at(t)); };
  CHECK_FALSE(seen(1.0, drift));
  CHECK_FALSE(seen(1.2, drift));  // as good as the same frame
  CHECK(seen(1.4, drift));
  look.forget();
  CHECK_FALSE(seen(2.0, drift));
  CHECK_FALSE(seen(2.5, compose(screw(0.1, 0, 0, 0, 0, 0), drift)));   // 10 cm elsewhere
  CHECK_FALSE(seen(13.0, compose(screw(0.1, 0, 0, 0, 0, 0), drift)));  // too long ago
}

TEST_CASE("a camera that turns round and finds its first place again loses the drift of the way, also on the way") {
  for (const unsigned seed : {103U, 104U, 105U, 106U}) {
    CAPTURE(seed);
    const Turn open(1.03, false, seed);
    const Turn closed(1.03, true, seed);
    MESSAGE("seed " << seed << ", " << open.truth.size() << " poses, largest rotation error: " << open.largest_rotation_error()
                    << " rad open, " << closed.largest_rotation_error() << " closed");
    CHECK(open.closed == 0);
    CHECK(closed.closed == 1);
    CHECK(closed.jump > 0.05);
    CHECK(open.largest_rotation_error() > 0.08);
    CHECK(closed.largest_rotation_error() < 0.4 * open.largest_rotation_error());
  }
}

TEST_CASE("a loop is closed for a host's own poses as for apso's") {
  const BasicTurn<foreign::DualQuaternionPose> theirs(1.03, true);
  const Turn ours(1.03, true);
  REQUIRE(theirs.closed == 1);
  const Trajectory a = theirs.trajectory.of(0), b = ours.trajectory.of(0);
  REQUIRE(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i) CHECK(difference(a[i].T_world_body, b[i].T_world_body) < 1e-6);
}

TEST_CASE("where there is no drift there is no loop to close") {
  const Turn right(1.0, true);
  CHECK(right.closed == 0);
  CHECK(right.largest_rotation_error() < 0.02);
}

TEST_CASE("landmarks keep their place before the keyframe that saw them first") {
  testing::SyntheticOptions o;
  o.width = 320;
  o.height = 240;
  testing::SyntheticSequence room("static_xyz", o);
  testing::SyntheticFeatures found(room.camera(), 20, 0.3);
  testing::SyntheticFrame image;
  LandmarkTrackerOptions options;
  options.keyframe_interval = 0.03;
  LandmarkTracker tracker(room.camera(), options);
  for (int i = 0; i < 5; ++i) track_frame(i, room, found, image, tracker);
  const LocalMap before = tracker.map();
  REQUIRE(before.living_keyframes() >= 3);
  LocalMap map = before;
  std::vector<Pose> moved;
  for (int k = map.first_keyframe(); k <= map.last_keyframe(); ++k)
    moved.push_back(compose(screw(0.1 * k, 0, 0.05, 0, 0.03 * k, 0), map.keyframe(k).T_world_camera));
  map.correct(moved);
  int checked = 0;
  for (int k = map.first_keyframe(); k <= map.last_keyframe(); ++k) {
    CHECK(difference(map.keyframe(k).T_world_camera, moved[map.slot(k)]) == 0);
    for (const int l : map.keyframe(k).landmark) {
      if (l < 0 || map.landmark(l).views.front().keyframe != k) continue;
      ++checked;
      const Pose T_now = map.keyframe(k).T_world_camera, T_then = before.keyframe(k).T_world_camera;
      CHECK((T_now.inverse() * map.landmark(l).point - T_then.inverse() * before.landmark(l).point).norm() < 1e-9);
      CHECK((T_now.linear().transpose() * map.landmark(l).direction - T_then.linear().transpose() * before.landmark(l).direction).norm() <
            1e-9);
    }
  }
  CHECK(checked == map.living_landmarks());
}
