#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <apso/evaluation/parted_trajectory.hpp>
#include <apso/testing/synthetic_features.hpp>
#include <apso/track.hpp>

#include "../foreign_types.hpp"
#include "position_error.hpp"
#include "room_camera.hpp"

using namespace apso;

namespace {

testing::SyntheticOptions small_room() {
  testing::SyntheticOptions o;
  o.width = 320;
  o.height = 240;
  o.seed = 103;
  return o;
}

/// A camera that sees a place, then for a while nothing it knows, then the new and the old place at once.
template <class PoseT = Pose>
class BasicWanderer {
 public:
  static constexpr int kElsewhere = 10;  // first frame of the new place
  static constexpr int kBoth = 60;       // first frame in which every other keypoint is one of the old place again
  int back = 1000;                       // first frame in which all are
  std::size_t most = 10000;              // keypoints of the new place before kBoth

  BasicWanderer() : room_("static_xyz", small_room()), found_(room_.camera(), 12, 0.3), tracker_(room_.camera()) {}

  /// \param turn what the old place turns in the image, from kBoth on [px in a frame]; 0 = both places stand still
  BasicPartChange<PoseT> next(int i, float turn = 0) {
    room_.render(i, image_);
    found_.find(image_);
    std::vector<Keypoint> keypoints = found_.keypoints();
    std::vector<Descriptor> descriptors = found_.descriptors();
    for (std::size_t k = 0; k < keypoints.size(); ++k) {
      const bool old = i < kElsewhere || i >= back || (i >= kBoth && k % 2 == 0);
      if (old && i >= kBoth) keypoints[k].x = std::clamp(keypoints[k].x + turn * static_cast<float>(i - kBoth), 0.0F, 319.0F);
      if (old) continue;
      for (std::uint8_t& byte : descriptors[k]) byte = static_cast<std::uint8_t>(~byte);
    }
    if (i >= kElsewhere && i < kBoth && keypoints.size() > most) keypoints.resize(most), descriptors.resize(most);
    tracker_.begin(image_.rgbd(), keypoints, descriptors, none);
    pose_ = tracker_.estimate();
    tracker_.commit(pose_.T_world_camera, none, pose_.ok);
    return tracker_.reconnect();
  }
  [[nodiscard]] const BasicFeatureResult<PoseT>& pose() const { return pose_; }
  [[nodiscard]] double time() const { return image_.timestamp; }
  [[nodiscard]] Pose truth(int i) const { return compose(inverse(room_.T_world_camera(0)), room_.T_world_camera(i)); }
  [[nodiscard]] const BasicLandmarkTracker<PoseT>& tracker() const { return tracker_; }

 private:
  testing::SyntheticSequence room_;
  testing::SyntheticFeatures found_;
  testing::SyntheticFrame image_;
  BasicLandmarkTracker<PoseT> tracker_;
  BasicFeatureResult<PoseT> pose_;
};
using Wanderer = BasicWanderer<>;

}  // namespace

TEST_CASE("a camera that is lost for a second begins a new part of the map, and the parts are joined where both are seen") {
  Wanderer camera;
  PartedTrajectory trajectory;
  int left_at = 0, joined_at = 0;
  for (int i = 0; i < 100; ++i) {
    CAPTURE(i);
    const PartChange change = camera.next(i);
    if (camera.pose().ok) trajectory.add(camera.time(), camera.pose().T_world_camera, change.before);
    trajectory.follow(change);
    if (change.event == PartEvent::Left) {
      CHECK(left_at == 0);
      CHECK(change.before == 0);
      CHECK(change.part == 1);
      left_at = i;
    }
    if (change.event == PartEvent::Joined) {
      CHECK(joined_at == 0);
      CHECK(change.before == 1);
      CHECK(change.part == 0);
      CHECK(trajectory.of(1).empty());
      CHECK(position_error(camera.tracker().predicted(), camera.truth(i)) < 0.01);
      joined_at = i;
    }
    CHECK(camera.pose().ok == (i < Wanderer::kElsewhere || (left_at > 0 && i > left_at)));
    if (joined_at > 0 && i > joined_at) CHECK(position_error(camera.pose().T_world_camera, camera.truth(i)) < 0.01);
  }
  // a second after the last frame that had a place; and two frames must say where the places lie to each other
  CHECK(left_at == Wanderer::kElsewhere - 1 + 30);
  CHECK(joined_at >= Wanderer::kBoth + 5 + 9);  // it looks every five frames
  CHECK(joined_at < Wanderer::kBoth + 25);
  // the poses of the new part lie where the camera was, also those from before it was recognised
  const Trajectory poses = trajectory.of(0);
  CHECK(trajectory.largest() == 0);
  REQUIRE(poses.size() == static_cast<std::size_t>(100 - (left_at + 1 - Wanderer::kElsewhere)));
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const int i = static_cast<int>(std::lround(poses[k].timestamp * 30));
    CHECK(position_error(poses[k].T_world_body, camera.truth(i)) < 0.015);
  }
}

TEST_CASE("a program with poses of its own is told of parts in these, and they lie where apso's own lie") {
  BasicWanderer<foreign::DualQuaternionPose> dual;
  Wanderer own;
  PartedTrajectory a, b;
  int joined = 0;
  for (int i = 0; i < 90; ++i) {
    CAPTURE(i);
    const BasicPartChange<foreign::DualQuaternionPose> theirs = dual.next(i);
    const PartChange ours = own.next(i);
    CHECK(theirs.event == ours.event);
    CHECK(theirs.part == ours.part);
    CHECK((to_pose(theirs.T_part_before).matrix() - ours.T_part_before.matrix()).norm() < 1e-9);
    if (dual.pose().ok) a.add(dual.time(), dual.pose().T_world_camera, theirs.before);
    if (own.pose().ok) b.add(own.time(), own.pose().T_world_camera, ours.before);
    a.follow(theirs);
    b.follow(ours);
    joined += ours.joined() ? 1 : 0;
  }
  CHECK(joined == 1);
  const Trajectory ta = a.of(0), tb = b.of(0);
  REQUIRE(ta.size() == tb.size());
  for (std::size_t k = 0; k < ta.size(); ++k) CHECK((ta[k].T_world_body.matrix() - tb[k].T_world_body.matrix()).norm() < 1e-9);
}

TEST_CASE("no part of the map begins on images with too few features") {
  Wanderer camera;
  camera.most = 150;
  for (int i = 0; i < Wanderer::kBoth; ++i) {
    CHECK(camera.next(i).event == PartEvent::None);
    CHECK(camera.pose().ok == (i < Wanderer::kElsewhere));
  }
}

TEST_CASE("a part that moves against the other one is not joined with it") {
  Wanderer camera;
  int part = 0;
  for (int i = 0; i < 90; ++i) {
    const PartChange change = camera.next(i, 2.0F);
    CHECK(change.event != PartEvent::Joined);
    part = change.part;
  }
  CHECK(part == 1);
}

TEST_CASE("a camera that is lost again finds its way back to an earlier part") {
  Wanderer camera;
  constexpr int kBack = 52;
  camera.back = kBack;
  for (int i = 0; i < kBack + 8; ++i) {
    CAPTURE(i);
    const PartChange change = camera.next(i);
    if (i == kBack) {
      CHECK_FALSE(camera.pose().ok);
      CHECK(change.event == PartEvent::Left);
      CHECK(change.before == 1);
      CHECK(change.part == 0);
      CHECK(position_error(camera.tracker().predicted(), camera.truth(i)) < 0.01);
    }
    if (i > kBack) {
      REQUIRE(camera.pose().ok);
      CHECK(change.event == PartEvent::None);
      CHECK(position_error(camera.pose().T_world_camera, camera.truth(i)) < 0.01);
    }
  }
}

TEST_CASE("where a camera comes back to a place, the local map has what was seen there, though nothing is shared") {
  testing::SyntheticSequence room("static_xyz", small_room());
  testing::SyntheticFeatures found(room.camera(), 20, 0.0);
  testing::SyntheticFrame image;
  LocalMap map;
  LandmarkMatcher matcher(room.camera(), Octaves{});
  const auto add = [&](int i, const Pose& T_world_camera) {  // every keyframe has landmarks of its own
    room.render(i, image);
    found.find(image);
    WeightedFeatures features;
    copy_keypoints(found.keypoints(), image.depth, DepthRange{}, 0.003F, features);
    features.descriptors = found.descriptors();
    weigh(none, 0.5, features);
    KeyframeInput input;
    input.timestamp = i;
    input.T_world_camera = T_world_camera;
    new_keyframe(room.camera(), features, {}, input, map);
  };
  const auto moved = [](double x, double yaw) { return se3_exp(Twist((Twist() << x, 0, 0, 0, yaw, 0).finished())); };
  constexpr int kWindow = 2;
  add(0, moved(0, 0));
  add(1, moved(0.1, 0));
  for (int i = 2; i < 6; ++i) add(i, moved(0.3, 0));
  const auto local = [&](int keyframe) {  // whether its landmarks are in the local map
    for (const LocalLandmark& l : matcher.local())
      if (map.landmark(l.landmark).views.front().keyframe == keyframe) return true;
    return false;
  };
  const std::vector<int> nothing;
  matcher.collect(map, nothing, kWindow, moved(0, 0));
  CHECK_FALSE(local(0));  // near, but the camera has not been anywhere else
  CHECK(local(5));
  for (int i = 6; i < 9; ++i) add(i, moved(1.5, 0));
  matcher.collect(map, nothing, kWindow);
  CHECK_FALSE(local(0));
  matcher.collect(map, nothing, kWindow, moved(0, 0));
  CHECK(local(0));
  CHECK(local(1));
  CHECK(local(8));
  CHECK_FALSE(local(6));
  std::vector<int> numbers;
  for (const LocalLandmark& l : matcher.local()) numbers.push_back(l.landmark);
  std::sort(numbers.begin(), numbers.end());
  CHECK(std::adjacent_find(numbers.begin(), numbers.end()) == numbers.end());  // none twice
  matcher.collect(map, nothing, kWindow, moved(0, 0.7));                       // looking 40 degrees to the side it is another place
  CHECK_FALSE(local(0));
  matcher.collect(map, nothing, kWindow, moved(-0.45, 0));
  CHECK(local(0));
  CHECK_FALSE(local(1));
}

TEST_CASE("a map that takes over another one has all of both, and everybody still sees whom they saw") {
  testing::SyntheticSequence room("static_xyz", small_room());
  testing::SyntheticFeatures found(room.camera(), 20, 0.0);
  testing::SyntheticFrame image;
  LandmarkTrackerOptions options;
  options.keyframe_interval = 0.03;
  LandmarkTracker first(room.camera(), options), second(room.camera(), options);
  for (int i = 0; i < 9; ++i) track_frame(i, room, found, image, i < 4 ? first : second);
  LocalMap map = first.map();
  LocalMap other = second.map();
  other.kill(3);  // numbers that are free, and keyframes that are gone, in both
  map.kill(5);
  other.forget_keyframe(other.first_keyframe());
  const Pose T = se3_exp(Twist((Twist() << 1, -2, 0.5, 0.1, 0.2, -0.3).finished()));
  const int keyframes = map.living_keyframes(), landmarks = map.living_landmarks();
  const LocalMap before = other;
  map.append(other, T);
  CHECK(map.living_keyframes() == keyframes + before.living_keyframes());
  CHECK(map.living_landmarks() == landmarks + before.living_landmarks());
  int alive = 0;
  for (std::size_t l = 0; l < map.landmarks().size(); ++l) {
    const MapLandmark& landmark = map.landmarks()[l];
    if (!landmark.alive) continue;
    ++alive;
    for (const LandmarkView& v : landmark.views) {
      REQUIRE(map.keyframe(v.keyframe).alive);
      CHECK(map.keyframe(v.keyframe).landmark[static_cast<std::size_t>(v.feature)] == static_cast<int>(l));
    }
  }
  CHECK(alive == map.living_landmarks());
  const int shift = map.last_keyframe() - before.last_keyframe();
  for (int k = before.first_keyframe(); k <= before.last_keyframe(); ++k) {
    const MapKeyframe& here = map.keyframe(k + shift);
    const MapKeyframe& there = before.keyframe(k);
    if (!there.alive) continue;
    CHECK((here.T_world_camera.matrix() - compose(T, there.T_world_camera).matrix()).norm() < 1e-12);
    for (std::size_t f = 0; f < there.landmark.size(); ++f) {
      REQUIRE((here.landmark[f] >= 0) == (there.landmark[f] >= 0));
      if (there.landmark[f] < 0) continue;
      const MapLandmark& a = map.landmark(here.landmark[f]);
      const MapLandmark& b = before.landmark(there.landmark[f]);
      CHECK((a.point - T * b.point).norm() < 1e-12);
      CHECK((a.direction - T.linear() * b.direction).norm() < 1e-12);
      CHECK(a.descriptor == b.descriptor);
    }
  }
}
