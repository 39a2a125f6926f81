#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/opencv/feature_tracker.hpp>

using namespace apso;
using namespace apso::opencv;

namespace {
const Pinhole kCamera{300, 300, 159.5, 119.5, 320, 240};

/// A slanted textured wall, drawn exactly: every ray is cut with the plane n.x = 2.
class Wall {
 public:
  Wall() : texture_(900, 1200, CV_8UC1) {
    cv::RNG random(4);
    texture_.setTo(128);
    for (int i = 0; i < 2500; ++i) {
      const cv::Point a(random.uniform(0, 1200), random.uniform(0, 900));
      const cv::Point b = a + cv::Point(random.uniform(6, 40), random.uniform(6, 40));
      cv::rectangle(texture_, a, b, cv::Scalar(random.uniform(0, 256)), cv::FILLED);
    }
    cv::GaussianBlur(texture_, texture_, cv::Size(3, 3), 0.8);
  }
  void render(const Pose& T_world_camera, cv::Mat& gray, Image<float>& intensity, Image<float>& depth) const {
    const Eigen::Vector3d n = Eigen::Vector3d(0.2, 0.1, 1).normalized();
    gray.create(kCamera.height, kCamera.width, CV_8UC1);
    intensity.resize(kCamera.width, kCamera.height);
    depth.resize(kCamera.width, kCamera.height);
    cv::Mat mx(gray.size(), CV_32FC1);
    cv::Mat my(gray.size(), CV_32FC1);
    for (int y = 0; y < gray.rows; ++y)
      for (int x = 0; x < gray.cols; ++x) {
        const Eigen::Vector3d ray = kCamera.unproject(x, y, 1);
        const Eigen::Vector3d direction = T_world_camera.linear() * ray;
        const double z = (2 - n.dot(T_world_camera.translation())) / n.dot(direction);
        const Eigen::Vector3d p = T_world_camera.translation() + z * direction;
        depth(x, y) = static_cast<float>(z);
        mx.at<float>(y, x) = static_cast<float>(600 + 250 * p.x());
        my.at<float>(y, x) = static_cast<float>(450 + 250 * p.y());
      }
    cv::remap(texture_, gray, mx, my, cv::INTER_LINEAR, cv::BORDER_REFLECT);
    for (int y = 0; y < gray.rows; ++y)
      for (int x = 0; x < gray.cols; ++x) intensity(x, y) = static_cast<float>(gray.at<uchar>(y, x)) / 255.0F;
  }

 private:
  cv::Mat texture_;
};

Pose path(int i) {
  const double t = i / 30.0;
  Twist xi;
  xi << 0.25 * std::sin(2 * t), 0.1 * std::sin(3 * t), 0.15 * std::sin(t), 0.05 * std::sin(2 * t), 0.06 * std::sin(t), 0;
  return se3_exp(xi);
}

struct Run {
  cv::Mat gray;
  Image<float> intensity;
  Image<float> depth;
  FeatureResult step(FeatureTracker& tracker, double time, ImageView<const float> mask = {}, bool keyframe = true) {
    RgbdFrame frame{time, intensity.view(), depth.view()};
    tracker.begin(gray, frame);
    const FeatureResult r = tracker.estimate(mask);
    tracker.commit(r.T_world_camera, mask, keyframe);
    return r;
  }
};

FeatureTrackerOptions small() {
  FeatureTrackerOptions o;
  o.orb.features = 500;
  o.lk.tracks = 200;
  return o;
}
}  // namespace

TEST_CASE("follows a textured wall within millimetres; ids of tracks are never used twice; runs are the same") {
  const Wall wall;
  std::vector<Pose> first_run;
  for (int repeat = 0; repeat < 2; ++repeat) {
    FeatureTracker tracker(kCamera, small());
    Run run;
    std::set<std::int64_t> gone;
    std::map<std::int64_t, int> living;
    for (int i = 0; i < 40; ++i) {
      wall.render(path(i), run.gray, run.intensity, run.depth);
      const FeatureResult r = run.step(tracker, i / 30.0);
      REQUIRE(r.ok);
      const Pose error = inverse(path(i)) * path(0) * r.T_world_camera;
      CHECK(error.translation().norm() < 0.01);
      CHECK(rotation_angle(error) < 0.006);
      std::map<std::int64_t, int> now;
      for (const PointTrack& t : tracker.tracks()) {
        CHECK(now.count(t.id) == 0);
        CHECK(gone.count(t.id) == 0);
        const auto before = living.find(t.id);
        CHECK(t.age == (before == living.end() ? 0 : before->second + 1));
        now[t.id] = t.age;
      }
      for (const auto& [id, age] : living)
        if (now.count(id) == 0) gone.insert(id);
      living = now;
      if (repeat == 0) {
        first_run.push_back(r.T_world_camera);
      } else {
        CHECK(r.T_world_camera.matrix() == first_run[static_cast<std::size_t>(i)].matrix());
      }
    }
    CHECK(tracker.keyframes() >= 2);
    CHECK(tracker.landmarks() > 100);
  }
}

TEST_CASE("keypoints lie everywhere in the image") {
  const Wall wall;
  FeatureTracker tracker(kCamera, small());
  Run run;
  wall.render(path(0), run.gray, run.intensity, run.depth);
  run.step(tracker, 0);
  std::set<int> cells;
  for (const Keypoint& k : tracker.keypoints()) {
    CHECK(kCamera.contains(k.x, k.y));
    CHECK(k.response > 0);
    CHECK(k.angle >= 0);
    CHECK(k.angle <= 360);
    cells.insert(static_cast<int>(k.x) / 80 + 4 * (static_cast<int>(k.y) / 80));
  }
  CHECK(cells.size() == 12);
}

TEST_CASE("corners are those of FAST in the whole image; where strong ones are lacking, weak ones are found") {
  // left half with strong corners, right half with weak ones, a flat frame around both
  cv::Mat_<uchar> image(480, 640, uchar{100});
  cv::RNG random(7);
  for (int y = 40; y < 440; y += 8) {
    for (int x = 40; x < 600; x += 8) {
      const int contrast = x < 320 ? random.uniform(30, 90) : random.uniform(9, 18);
      const cv::Point at(x + random.uniform(0, 4), y + random.uniform(0, 4));
      image(cv::Rect(at, cv::Size(3, 3))).setTo(100 + contrast);
      image(at + cv::Point(1, 1)) += 3;  // stronger than its neighbours
    }
  }
  opencv::OrbOptions options;
  options.levels = 1;
  std::vector<cv::KeyPoint> all;
  cv::FAST(image, all, options.min_fast_threshold, true);
  std::map<std::pair<float, float>, float> response;
  std::size_t strong = 0;
  for (const cv::KeyPoint& k : all) {
    response[{k.pt.x, k.pt.y}] = k.response;
    strong += k.response >= static_cast<float>(options.fast_threshold);
  }
  std::vector<Keypoint> keypoints;
  cv::Mat descriptors;
  for (const int wanted : {300, 1000, 5000}) {
    CAPTURE(wanted);
    options.features = wanted;
    opencv::OrbFrontEnd(options).extract(image, keypoints, descriptors);
    std::size_t weak = 0;
    bool same = true;
    std::set<std::pair<float, float>> found;
    for (const Keypoint& k : keypoints) {
      const auto i = response.find({k.x, k.y});
      same = same && i != response.end() && i->second == k.response && found.insert({k.x, k.y}).second;
      weak += k.response < static_cast<float>(options.fast_threshold);
    }
    CHECK(same);
    if (wanted == 5000) {  // more than there are: all of them
      CHECK(keypoints.size() == all.size());
      continue;
    }
    REQUIRE(strong > static_cast<std::size_t>(wanted));
    CHECK(keypoints.size() == static_cast<std::size_t>(wanted));
    // the cells are about as many as corners are wanted, and the best one of each is among them
    const double side = std::sqrt(608.0 * 448 / wanted);
    const int columns = static_cast<int>(608 / side);
    const int rows = static_cast<int>(448 / side);
    std::map<int, float> best, best_found;
    const auto note = [&](std::map<int, float>& of, float x, float y, float value) {
      float& most = of[static_cast<int>((y - 16) * static_cast<float>(rows) / 448) * columns +
                       static_cast<int>((x - 16) * static_cast<float>(columns) / 608)];
      most = std::max(most, value);
    };
    for (const cv::KeyPoint& k : all) note(best, k.pt.x, k.pt.y, k.response);
    for (const Keypoint& k : keypoints) note(best_found, k.x, k.y, k.response);
    CHECK(best == best_found);
    CHECK(weak > static_cast<std::size_t>(wanted) / 4);  // the right half has its share
  }
}

TEST_CASE("frames that are not trusted leave the map as it is") {
  const Wall wall;
  FeatureTracker tracker(kCamera, small());
  Run run;
  for (int i = 0; i < 20; ++i) {
    wall.render(path(i), run.gray, run.intensity, run.depth);
    run.step(tracker, i / 30.0, {}, i == 0);
  }
  CHECK(tracker.keyframes() == 1);
}

TEST_CASE("masked features are not used, and nothing masked becomes a landmark") {
  const Wall wall;
  FeatureTracker tracker(kCamera, small());
  Run run;
  Image<float> mask(kCamera.width, kCamera.height, 0.0F);
  for (int y = 0; y < kCamera.height; ++y)
    for (int x = 0; x < kCamera.width / 2; ++x) mask(x, y) = 1.0F;
  wall.render(path(0), run.gray, run.intensity, run.depth);
  run.step(tracker, 0, mask);
  for (const MapLandmark& l : tracker.map().landmarks()) CHECK(kCamera.project(l.point).x() >= kCamera.width / 2 - 1);
  CHECK(tracker.landmarks() > 50);
}

TEST_CASE("after black frames it says so, keeps the prediction, and finds its place again") {
  const Wall wall;
  FeatureTracker tracker(kCamera, small());
  Run run;
  Pose before = Pose::Identity();
  for (int i = 0; i < 15; ++i) {
    wall.render(path(i), run.gray, run.intensity, run.depth);
    const FeatureResult r = run.step(tracker, i / 30.0);
    REQUIRE(r.ok);
    before = r.T_world_camera;
  }
  double last = 0;
  for (int i = 15; i < 22; ++i) {
    run.gray.setTo(0);
    run.intensity.assign(kCamera.width, kCamera.height, 0.0F);
    run.depth.assign(kCamera.width, kCamera.height, 0.0F);
    const FeatureResult r = run.step(tracker, i / 30.0);
    CHECK_FALSE(r.ok);
    CHECK_FALSE(succeeded(r.status));
    CHECK(is_finite(r.T_world_camera));
    CHECK(r.T_world_camera.matrix() == r.T_world_predicted.matrix());
    const double step = (inverse(before) * r.T_world_camera).translation().norm();
    if (i > 15) CHECK(step == doctest::Approx(0.8 * last).epsilon(1e-3).scale(0));  // a motion that is only guessed fades
    last = step;
    before = r.T_world_camera;
  }
  wall.render(path(5), run.gray, run.intensity, run.depth);  // a place seen before, far from the prediction
  const FeatureResult r = run.step(tracker, 22 / 30.0);
  REQUIRE(r.ok);
  const Pose error = inverse(path(5)) * path(0) * r.T_world_camera;
  CHECK(error.translation().norm() < 0.015);
}

TEST_CASE("wrong calls are told") {
  FeatureTracker tracker(kCamera, small());
  Image<float> depth(kCamera.width, kCamera.height, 1.0F);
  RgbdFrame frame{0, depth.view(), depth.view()};
  CHECK_THROWS_AS(tracker.begin(cv::Mat(10, 10, CV_8UC1), frame), contract_error);
  CHECK_THROWS_AS(tracker.begin(cv::Mat(kCamera.height, kCamera.width, CV_8UC3), frame), contract_error);
  CHECK_THROWS_AS(tracker.estimate({}), contract_error);
  FeatureTrackerOptions bad;
  bad.dynamic_threshold = 3;
  CHECK_THROWS_AS(FeatureTracker(kCamera, bad), contract_error);
  tracker.begin(cv::Mat(kCamera.height, kCamera.width, CV_8UC1, cv::Scalar(0)), frame);
  Image<float> mask(5, 5, 0.0F);
  CHECK_THROWS_AS(tracker.estimate(mask), contract_error);
  CHECK_FALSE(tracker.estimate({}).ok);  // nothing to see in a black image
}
