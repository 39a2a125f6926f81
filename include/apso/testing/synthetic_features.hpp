/// \file
/// Keypoints, descriptors and tracks of a synthetic recording without a detector: points of the room are drawn once and then
/// projected with the true pose. For tests and first steps of anything that wants features but no image library.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/linear_congruential.hpp>
#include <apso/math/se3.hpp>
#include <apso/testing/synthetic.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

/// Finds the same points again in frame after frame, as a perfect matcher would, but for `noise` on their positions. A point
/// is visible where the depth image agrees with it; new points begin where the image has none. What lies on a person is no
/// point of the room: it is lost as soon as the person has moved on.
class SyntheticFeatures {
 public:
  /// \param spacing one point in each square of this size [px]
  /// \param noise   largest error of a position in u and in v [px]
  /// \param remember points that are out of view are found again when they come back, as new tracks; else they are new points then
  explicit SyntheticFeatures(const Pinhole& camera, int spacing = 20, double noise = 0.5, std::uint32_t seed = 1, bool remember = false)
      : camera_(camera), spacing_(spacing), noise_(noise), random_(seed), remember_(remember) {}

  /// The features of the next frame. Uses its depth and its true pose.
  void find(const SyntheticFrame& frame) {
    keypoints_.clear();
    descriptors_.clear();
    tracks_.clear();
    taken_.assign(static_cast<std::size_t>(columns() * rows()), 0);
    const Pose T_camera_world = inverse(frame.T_world_camera);
    std::size_t kept = 0;
    for (Point& point : points_) {
      if (see(point, transform(T_camera_world, point.world), frame.depth)) {
        add(point);
      } else if (remember_) {
        point.track.age = -1;
      } else {
        continue;
      }
      points_[kept++] = point;
    }
    points_.resize(kept, Point{});
    begin_points(frame);
  }

  [[nodiscard]] const std::vector<Keypoint>& keypoints() const { return keypoints_; }
  [[nodiscard]] const std::vector<std::array<std::uint8_t, 32>>& descriptors() const { return descriptors_; }
  [[nodiscard]] const std::vector<PointTrack>& tracks() const { return tracks_; }

 private:
  struct Point {
    Eigen::Vector3d world = Eigen::Vector3d::Zero();
    std::array<std::uint8_t, 32> descriptor{};
    PointTrack track;
  };

  [[nodiscard]] int columns() const { return camera_.width / spacing_ + 1; }
  [[nodiscard]] int rows() const { return camera_.height / spacing_ + 1; }
  [[nodiscard]] std::size_t cell(double u, double v) const {
    return static_cast<std::size_t>(static_cast<int>(v) / spacing_ * columns() + static_cast<int>(u) / spacing_);
  }
  [[nodiscard]] double jitter() { return noise_ * (2.0 * (random_() >> 8U) / 16777216.0 - 1.0); }

  /// Moves the track of a point to where it is seen. \return false if it is not
  bool see(Point& point, const Eigen::Vector3d& p, const Image<float>& depth) {
    if (p.z() < 0.3) return false;
    const Eigen::Vector2d uv = camera_.project(p);
    if (!camera_.contains(uv.x(), uv.y(), 2)) return false;
    const double z = depth(static_cast<int>(std::lround(uv.x())), static_cast<int>(std::lround(uv.y())));
    if (!(std::abs(z - p.z()) < 0.03 * p.z())) return false;
    char& taken = taken_[cell(uv.x(), uv.y())];
    if (taken != 0) return false;
    taken = 1;
    PointTrack& t = point.track;
    const PointTrack before = t;
    t.y = static_cast<float>(uv.y() + jitter());
    t.x = static_cast<float>(uv.x() + jitter());
    if (before.age < 0) t.id = next_id_++;
    t.previous_x = before.age < 0 ? t.x : before.x;
    t.previous_y = before.age < 0 ? t.y : before.y;
    ++t.age;
    return true;
  }
  void add(const Point& point) {
    Keypoint k;
    k.x = point.track.x;
    k.y = point.track.y;
    k.response = 1;
    keypoints_.push_back(k);
    descriptors_.push_back(point.descriptor);
    tracks_.push_back(point.track);
  }

  void begin_points(const SyntheticFrame& frame) {
    for (int v = spacing_ / 2; v < camera_.height; v += spacing_)
      for (int u = spacing_ / 2; u < camera_.width; u += spacing_) {
        const double z = frame.depth(u, v);
        if (!(z > 0.3) || taken_[cell(u, v)] != 0) continue;
        Point point;
        point.world = transform(frame.T_world_camera, camera_.unproject(u, v, z));
        for (std::uint8_t& byte : point.descriptor) byte = static_cast<std::uint8_t>(random_() >> 24U);
        point.track.id = next_id_++;
        point.track.x = point.track.previous_x = static_cast<float>(u);
        point.track.y = point.track.previous_y = static_cast<float>(v);
        add(point);
        points_.push_back(point);
      }
  }

  Pinhole camera_;
  int spacing_;
  double noise_;
  LinearCongruential random_;
  bool remember_;
  std::vector<Point> points_;
  std::vector<char> taken_;
  std::vector<Keypoint> keypoints_;
  std::vector<std::array<std::uint8_t, 32>> descriptors_;
  std::vector<PointTrack> tracks_;
  std::int64_t next_id_ = 1;
};

}  // namespace testing
APSO_NAMESPACE_END
