#include <doctest/doctest.h>

#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <list>
#include <random>
#include <vector>

#include <apso/testing/synthetic_features.hpp>
#include <apso/track.hpp>

#include "../foreign_types.hpp"
#include "position_error.hpp"

using namespace apso;

namespace {

struct Recording {
  testing::SyntheticSequence room;
  testing::SyntheticFeatures found;
  testing::SyntheticFrame image;
  explicit Recording(const char* name) : room(name, small()), found(room.camera(), 12, 0.3) {}
  static testing::SyntheticOptions small() {
    testing::SyntheticOptions o;
    o.width = 320;
    o.height = 240;
    o.seed = 103;
    return o;
  }
  void next(int i) {
    room.render(i, image);
    found.find(image);
  }
  [[nodiscard]] Pose truth(int i) const { return compose(inverse(room.T_world_camera(0)), room.T_world_camera(i)); }
};

}  // namespace

TEST_CASE("the distance of descriptors counts differing bits, up to all of them") {
  std::mt19937 rng(1);
  Descriptor zero{};
  Descriptor ones;
  ones.fill(0xFF);
  CHECK(hamming(zero, zero) == 0);
  CHECK(hamming(zero, ones) == 256);
  for (int i = 0; i < 200; ++i) {
    Descriptor a, b;
    int expected = 0;
    for (std::size_t k = 0; k < 32; ++k) {
      a[k] = static_cast<std::uint8_t>(rng());
      b[k] = static_cast<std::uint8_t>(rng());
      expected += static_cast<int>(std::bitset<8>(static_cast<unsigned>(a[k] ^ b[k])).count());
    }
    CHECK(hamming(a, b) == expected);
  }
}

TEST_CASE("the tracker follows a room without OpenCV, says how certain it is, and keeps the people out by their mask") {
  Recording r("walking_xyz");
  LandmarkTracker tracker(r.room.camera());
  Image<float> mask;
  for (int i = 0; i < 25; ++i) {
    r.next(i);
    testing::true_dynamic_probability(r.image, mask);
    tracker.begin(r.image.rgbd(), r.found.keypoints(), r.found.descriptors(), r.found.tracks());
    const FeatureResult pose = tracker.estimate(mask);
    REQUIRE(pose.ok);
    CHECK(position_error(pose.T_world_camera, r.truth(i)) < 0.01);
    if (i > 0) {
      CHECK(pose.matches >= pose.inliers);
      CHECK(pose.inliers > 100);
      CHECK(pose.track_inliers > 100);
      CHECK(eigenvalues_exceed(1.0, pose.information));  // every direction is known better than to a metre or radian
    }
    tracker.commit(pose.T_world_camera, mask, true);
  }
  CHECK(tracker.keyframes() >= 2);
  CHECK(tracker.landmarks() > 100);
}

TEST_CASE("foreign images, keypoints, tracks and poses give the same poses as apso's own") {
  Recording r("static_xyz");
  LandmarkTracker own(r.room.camera());
  BasicLandmarkTracker<foreign::DualQuaternionPose> dual(r.room.camera());
  BasicLandmarkTracker<foreign::RowMajor3x4Pose> rows(r.room.camera());
  for (int i = 0; i < 12; ++i) {
    r.next(i);
    const foreign::PaddedU16 raw = foreign::padded_u16(r.image.depth, 1 / 5000.F);
    const foreign::AtOnly grey = foreign::at_only(r.image.intensity);
    const Image<float> depth = foreign::native(raw, 1 / 5000.F);
    const auto corners = foreign::corners(r.found.keypoints());
    const auto features = foreign::features(r.found.tracks());
    const std::list<Descriptor> descriptors(r.found.descriptors().begin(), r.found.descriptors().end());
    Image<float> mask(320, 240, 0.0F);
    for (int y = 0; y < 240; ++y)
      for (int x = 0; x < 60; ++x) mask(x, y) = 0.8F;
    const foreign::PaddedU16 foreign_mask = foreign::padded_u16(mask, 1 / 5.F);

    RgbdFrame frame{r.image.timestamp, r.image.intensity.view(), depth.view()};
    own.begin(frame, r.found.keypoints(), r.found.descriptors(), r.found.tracks());
    const FeatureResult a = own.estimate(mask);
    own.commit(a.T_world_camera, mask, true);

    const auto theirs = apso::frame(r.image.timestamp, grey, scaled(raw, 1 / 5000.F), r.room.camera());
    dual.begin(theirs, corners, descriptors, features);
    const auto b = dual.estimate(scaled(foreign_mask, 1 / 5.F));
    dual.commit(b.T_world_camera, scaled(foreign_mask, 1 / 5.F), true);

    ImageView<const std::uint8_t> bytes(descriptors.front().data(), 32, 1);
    std::vector<std::uint8_t> table;
    for (const Descriptor& d : descriptors) table.insert(table.end(), d.begin(), d.end());
    bytes = {table.data(), 32, static_cast<int>(descriptors.size())};
    rows.begin(theirs, corners, bytes, none);
    const auto c = rows.estimate(scaled(foreign_mask, 1 / 5.F));
    rows.commit(c.T_world_camera, none, true);

    REQUIRE(a.ok);
    REQUIRE(b.ok);
    REQUIRE(c.ok);
    CHECK(b.inliers == a.inliers);
    CHECK(b.track_inliers == a.track_inliers);
    CHECK(c.track_inliers == 0);
    CHECK((to_pose(b.T_world_camera).matrix() - a.T_world_camera.matrix()).norm() < 1e-9);
    CHECK(position_error(to_pose(c.T_world_camera), r.truth(i)) < 0.02);
  }
}

TEST_CASE("errors of the depth that all frames share hardly bend the path") {
  // the inverse depth is wrong by up to 0.01 1/m, 4 cm at 2 m, by a smooth pattern that stays on the sensor
  const auto error = [](double amplitude) {
    Recording r("static_rpy");
    LandmarkTracker tracker(r.room.camera());
    double sum = 0;
    constexpr int kFrames = 60;
    for (int i = 0; i < kFrames; ++i) {
      r.next(i);
      for (int y = 0; y < r.image.depth.height(); ++y)
        for (int x = 0; x < r.image.depth.width(); ++x) {
          float& z = r.image.depth(x, y);
          if (z > 0) z = static_cast<float>(1 / (1 / static_cast<double>(z) + amplitude * std::sin(0.03 * x) * std::cos(0.04 * y)));
        }
      tracker.begin(r.image.rgbd(), r.found.keypoints(), r.found.descriptors(), r.found.tracks());
      const FeatureResult pose = tracker.estimate();
      REQUIRE(pose.ok);
      sum += std::pow(position_error(pose.T_world_camera, r.truth(i)), 2);
      tracker.commit(pose.T_world_camera, none, true);
    }
    return std::sqrt(sum / kFrames);
  };
  CHECK(error(0.01) < 3 * error(0.0));
}

TEST_CASE("tracks may come in any order") {
  Recording r("static_xyz");
  LandmarkTracker sorted(r.room.camera());
  LandmarkTracker shuffled(r.room.camera());
  std::mt19937 rng(5);
  for (int i = 0; i < 6; ++i) {
    r.next(i);
    std::vector<PointTrack> tracks = r.found.tracks();
    std::shuffle(tracks.begin(), tracks.end(), rng);
    sorted.begin(r.image.rgbd(), r.found.keypoints(), r.found.descriptors(), r.found.tracks());
    shuffled.begin(r.image.rgbd(), r.found.keypoints(), r.found.descriptors(), tracks);
    const FeatureResult a = sorted.estimate();
    const FeatureResult b = shuffled.estimate();
    if (i > 0) {
      CHECK(a.track_inliers > 100);
      CHECK(std::abs(a.track_inliers - b.track_inliers) < 10);
    }
    sorted.commit(a.T_world_camera, none, true);
    shuffled.commit(b.T_world_camera, none, true);
  }
}

TEST_CASE("the tracks carry the pose where the map shows nothing, but not for ever") {
  Recording r("static_xyz");
  LandmarkTrackerOptions options;
  options.max_frames_on_tracks = 3;
  LandmarkTracker tracker(r.room.camera(), options);
  const std::vector<Keypoint> no_keypoints;
  const std::vector<Descriptor> no_descriptors;
  for (int i = 0; i < 12; ++i) {
    r.next(i);
    if (i < 5) {
      tracker.begin(r.image.rgbd(), r.found.keypoints(), r.found.descriptors(), r.found.tracks());
    } else {
      tracker.begin(r.image.rgbd(), no_keypoints, no_descriptors, r.found.tracks());
    }
    const FeatureResult pose = tracker.estimate();
    CHECK(pose.ok == (i < 8));
    CHECK(pose.from_tracks == (i >= 5 && i < 8));
    // what speaks for the pose: nothing to match yet, landmarks, tracks, nothing
    CHECK(pose.confirmed_matches() == (i == 0 ? -1 : i < 5 ? pose.inliers : i < 8 ? pose.track_inliers : 0));
    if (i > 0 && i < 8) CHECK(pose.confirmed_matches() > 30);
    if (pose.ok) CHECK(position_error(pose.T_world_camera, r.truth(i)) < 0.02);
    tracker.commit(pose.T_world_camera, none, true);
  }
}

TEST_CASE("tracks from a frame whose place nobody knows lead to no pose") {
  for (const bool known : {false, true}) {  // whether something else than features told where the frames 5 and 6 were
    CAPTURE(known);
    Recording r("static_xyz");
    LandmarkTracker tracker(r.room.camera());
    const std::vector<Keypoint> no_keypoints;
    const std::vector<Descriptor> no_descriptors;
    const std::vector<PointTrack> no_tracks;
    for (int i = 0; i < 10; ++i) {
      CAPTURE(i);
      r.next(i);
      if (i < 5 || i > 7) {
        tracker.begin(r.image.rgbd(), r.found.keypoints(), r.found.descriptors(), r.found.tracks());
      } else {  // frame 5 shows nothing, and in frame 6 tracks begin
        tracker.begin(r.image.rgbd(), no_keypoints, no_descriptors, i == 5 ? no_tracks : r.found.tracks());
      }
      const FeatureResult pose = tracker.estimate();
      const bool blind = i == 5 || i == 6;
      CHECK(pose.ok == (!blind && (known || i != 7)));
      if (i == 7) CHECK(pose.track_inliers > 30);
      if (pose.ok) CHECK(position_error(pose.T_world_camera, r.truth(i)) < 0.02);
      if (blind && known) {
        tracker.commit(r.truth(i), none, true);
      } else {
        tracker.commit(pose.ok ? pose.T_world_camera : pose.T_world_predicted, none, pose.ok);
      }
    }
  }
}

TEST_CASE("where the map shows nothing it grows from a pose that is known otherwise, if that is allowed") {
  for (const bool allowed : {true, false}) {
    Recording r("static_xyz");
    LandmarkTracker tracker(r.room.camera());
    const auto estimate = [&](int i, bool same_place) {
      r.next(i);
      std::vector<Descriptor> descriptors = r.found.descriptors();
      for (Descriptor& d : descriptors)
        for (std::uint8_t& byte : d) byte = static_cast<std::uint8_t>(same_place ? byte : ~byte);
      tracker.begin(r.image.rgbd(), r.found.keypoints(), descriptors, none);
      return tracker.estimate();
    };
    for (int i = 0; i < 5; ++i) tracker.commit(estimate(i, true).T_world_camera, none, true);
    const int keyframes = tracker.keyframes();
    const FeatureResult lost = estimate(5, false);
    REQUIRE_FALSE(lost.ok);
    CHECK(lost.information == Matrix6::Zero());  // nothing is known of a pose that was not found
    tracker.commit(r.truth(5), none, allowed);
    CHECK(tracker.keyframes() == keyframes + (allowed ? 1 : 0));
    const FeatureResult next = estimate(6, false);
    CHECK(next.ok == allowed);
    if (next.ok) CHECK(position_error(next.T_world_camera, r.truth(6)) < 0.01);
  }
}

TEST_CASE("a keyframe whose pose is known otherwise stays there, whatever few landmarks say") {
  Recording r("static_xyz");
  LandmarkTracker tracker(r.room.camera());
  for (int i = 0; i < 5; ++i) {
    r.next(i);
    tracker.begin(r.image.rgbd(), r.found.keypoints(), r.found.descriptors(), none);
    tracker.commit(tracker.estimate().T_world_camera, none, true);
  }
  r.next(5);
  std::vector<Keypoint> keypoints = r.found.keypoints();
  std::vector<Descriptor> descriptors = r.found.descriptors();
  const std::size_t step = keypoints.size() / 24;
  for (std::size_t k = 0; k < keypoints.size(); ++k) {
    if (k % step == 0) {  // the few that are recognised are 2 pixels off
      keypoints[k].x += 2;
    } else {
      for (std::uint8_t& byte : descriptors[k]) byte = static_cast<std::uint8_t>(~byte);
    }
  }
  tracker.begin(r.image.rgbd(), keypoints, descriptors, none);
  REQUIRE_FALSE(tracker.estimate().ok);
  const int keyframes = tracker.keyframes();
  tracker.commit(r.truth(5), none, true);
  REQUIRE(tracker.keyframes() == keyframes + 1);
  const LocalMap& map = tracker.map();
  CHECK(position_error(map.keyframe(map.last_keyframe()).T_world_camera, r.truth(5)) < 1e-9);
  CHECK(position_error(tracker.predicted(), r.truth(5)) < 1e-9);
}

TEST_CASE("after a frame of which nothing was known, few matches are no proof of a place") {
  for (const bool was_lost : {true, false}) {
    Recording r("static_xyz");
    LandmarkTracker tracker(r.room.camera());
    for (int i = 0; i < 7; ++i) {
      r.next(i);
      std::vector<Keypoint> keypoints = r.found.keypoints();
      std::vector<Descriptor> descriptors = r.found.descriptors();
      if (i == 5 && was_lost) keypoints.clear(), descriptors.clear();
      if (i == 6) {  // as many as are enough for a camera that is known to be near, and too few for one found again
        std::size_t n = 0;
        for (std::size_t k = 0; k < keypoints.size(); k += keypoints.size() / 42, ++n) {
          keypoints[n] = keypoints[k];
          descriptors[n] = descriptors[k];
        }
        keypoints.resize(n);
        descriptors.resize(n);
      }
      tracker.begin(r.image.rgbd(), keypoints, descriptors, none);
      const FeatureResult pose = tracker.estimate();
      if (i == 6) {
        CHECK(pose.ok == !was_lost);
        CHECK(pose.matches < 50);
        if (!was_lost) CHECK(pose.inliers >= 30);
      }
      tracker.commit(i < 6 ? r.truth(i) : pose.T_world_camera, none, i < 5);
    }
  }
}

TEST_CASE("a place is found again by landmarks that were seen again since they were made, and by no others") {
  for (const bool seen_again : {true, false}) {
    Recording r("static_xyz");
    LandmarkTrackerOptions options;
    options.keyframe_interval = 0.03;  // each frame is a keyframe
    LandmarkTracker tracker(r.room.camera(), options);
    const int lost = seen_again ? 7 : 6;
    for (int i = 0; i <= lost + 1; ++i) {
      r.next(i);
      // the right half of the image begins with frame 5, as that of somebody who steps before the camera, and is all that is left at last
      std::vector<Keypoint> keypoints;
      std::vector<Descriptor> descriptors;
      for (std::size_t k = 0; k < r.found.keypoints().size(); ++k) {
        const bool right = r.found.keypoints()[k].x > 160;
        if (i == lost || (right ? i < 5 : i > lost)) continue;
        keypoints.push_back(r.found.keypoints()[k]);
        descriptors.push_back(r.found.descriptors()[k]);
      }
      tracker.begin(r.image.rgbd(), keypoints, descriptors, none);
      const FeatureResult pose = tracker.estimate();
      CHECK(pose.ok == (i < lost || (i > lost && seen_again)));
      if (i > lost && seen_again) CHECK(position_error(pose.T_world_camera, r.truth(i)) < 0.01);
      tracker.commit(r.truth(i), none, i < lost);
    }
  }
}

TEST_CASE("a map that is full takes no more memory, and follows on") {
  Recording r("static_xyz");
  LandmarkTrackerOptions options;
  options.keyframe_interval = 0.03;  // each frame is a keyframe
  options.max_keyframes = 6;
  LandmarkTracker tracker(r.room.camera(), options);
  std::size_t landmarks = 0;
  for (int i = 0; i < 40; ++i) {
    r.next(i);
    tracker.begin(r.image.rgbd(), r.found.keypoints(), r.found.descriptors(), none);
    const FeatureResult pose = tracker.estimate();
    REQUIRE(pose.ok);
    CHECK(position_error(pose.T_world_camera, r.truth(i)) < 0.02);
    tracker.commit(pose.T_world_camera, none, true);
    CHECK(tracker.map().kept_keyframes() <= 6);
    if (i == 20) landmarks = tracker.map().landmarks().size();
  }
  CHECK(tracker.keyframes() == 6);
  CHECK(tracker.map().first_keyframe() > 20);
  CHECK(tracker.map().landmarks().size() < landmarks * 5 / 4);  // the numbers of those that are gone are used again
}

TEST_CASE("wrong calls of the tracker are told") {
  Recording r("static_xyz");
  r.next(0);
  LandmarkTracker tracker(r.room.camera());
  CHECK_THROWS_AS(tracker.estimate(), contract_error);
  CHECK_THROWS_AS(tracker.commit(Pose::Identity(), none, true), contract_error);
  const std::vector<Descriptor> too_few(r.found.descriptors().begin(), r.found.descriptors().begin() + 3);
  CHECK_THROWS_AS(tracker.begin(r.image.rgbd(), r.found.keypoints(), too_few, none), contract_error);
  const std::vector<std::uint8_t> bytes(16 * r.found.keypoints().size());
  const ImageView<const std::uint8_t> half(bytes.data(), 16, static_cast<int>(r.found.keypoints().size()));
  CHECK_THROWS_AS(tracker.begin(r.image.rgbd(), r.found.keypoints(), half, none), contract_error);
  const Image<float> small(10, 10, 1.0F);
  const RgbdFrame wrong_size{0, small.view(), small.view()};
  CHECK_THROWS_AS(tracker.begin(wrong_size, r.found.keypoints(), r.found.descriptors(), none), contract_error);
  tracker.begin(r.image.rgbd(), r.found.keypoints(), r.found.descriptors(), none);
  CHECK_THROWS_AS(tracker.estimate(small), contract_error);
  LandmarkTrackerOptions bad;
  bad.dynamic_threshold = 3;
  CHECK_THROWS_AS(LandmarkTracker(r.room.camera(), bad), contract_error);
  LandmarkTrackerOptions too_exact;
  too_exact.inverse_depth_sigma = 1e-300;  // its inverse is infinite
  CHECK_THROWS_AS(LandmarkTracker(r.room.camera(), too_exact), contract_error);
}
