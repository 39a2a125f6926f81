/// \file
/// Where tracks were some frames ago: the motion of a walking person adds up over them, noise does not.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/geometry/flow_residual.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// The last frames with their tracks and low-resolution depth. Buffers are used again.
class TrackHistory {
 public:
  /// \param span how far it looks back [s], up to eight frames
  explicit TrackHistory(double span) : span_(span) {}

  /// Pairs tracks of a new frame with their positions in the oldest frame that is kept.
  void look_back(const std::vector<PointTrack>& tracks) {
    spans_.clear();
    if (frames_.empty()) return;
    const std::vector<Point>& past = frames_.front().points;
    for (const PointTrack& t : tracks) {
      const auto it = std::lower_bound(past.begin(), past.end(), t.id, [](const Point& p, std::int64_t id) { return p.id < id; });
      if (it == past.end() || it->id != t.id) continue;
      PointTrack span = t;
      span.previous_x = it->x;
      span.previous_y = it->y;
      span.age = 1;
      spans_.push_back(span);
    }
  }

  /// Residuals of these pairs against the motion of static points, see flow_residuals. No past frame gives none.
  /// \param T_world_camera pose of the new frame
  void residuals(const Pinhole& camera, const Pose& T_world_camera, int factor, std::vector<FlowPoint>& points) const {
    points.clear();
    if (frames_.empty()) return;
    const Frame& past = frames_.front();
    flow_residuals(spans_, camera, compose(inverse(T_world_camera), past.T_world_camera), past.depth, factor, points);
  }

  /// Takes the new frame in.
  void keep(double time, const Pose& T_world_camera, const Image<float>& depth, const std::vector<PointTrack>& tracks) {
    Frame f;
    while (!frames_.empty() && (frames_.size() >= kMaximum || time - frames_.front().time > span_)) {
      f = std::move(frames_.front());
      frames_.erase(frames_.begin());
    }
    f.time = time;
    f.T_world_camera = T_world_camera;
    f.depth = depth;
    f.points.clear();
    for (const PointTrack& t : tracks) f.points.push_back({t.id, t.x, t.y});
    std::sort(f.points.begin(), f.points.end(), [](const Point& a, const Point& b) { return a.id < b.id; });
    frames_.push_back(std::move(f));
  }
  /// Corrects the pose of the last frame, once it is final.
  void correct(const Pose& T_world_camera) {
    if (!frames_.empty()) frames_.back().T_world_camera = T_world_camera;
  }
  void clear() { frames_.clear(); }

 private:
  struct Point {
    std::int64_t id;
    float x;
    float y;
  };
  struct Frame {
    double time = 0;  // [s]
    Pose T_world_camera = identity_pose();
    Image<float> depth;
    std::vector<Point> points;  // sorted by id
  };
  static constexpr std::size_t kMaximum = 8;

  double span_;
  std::vector<Frame> frames_;  // oldest first
  std::vector<PointTrack> spans_;
};

APSO_NAMESPACE_END
