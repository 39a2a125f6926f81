/// \file
/// Keyframes and landmarks, and who sees whom.
#pragma once

#include <cmath>
#include <cstddef>
#include <deque>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/tracker/descriptor_matching.hpp>
#include <apso/tracker/features.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// A keyframe: pose, features, and for each feature the landmark it shows (-1 = none).
struct MapKeyframe {
  bool alive = false;
  Pose T_world_camera = identity_pose();
  double timestamp = 0;
  FeatureSet features;
  std::vector<int> landmark;
};

/// One view of a landmark.
struct LandmarkView {
  int keyframe = -1;
  int feature = -1;
};

/// A point of the static world.
struct MapLandmark {
  bool alive = false;
  Eigen::Vector3d point = zeros<Eigen::Vector3d>();      ///< world frame [m]
  Descriptor descriptor{};                               ///< of the view that is most like the others
  Eigen::Vector3d direction = zeros<Eigen::Vector3d>();  ///< mean unit vector from the point to its viewers
  double unit_distance = 1;                              ///< distance at which it would appear on level 0 [m]
  float angle = 0;                                       ///< orientation in the last keyframe that saw it [deg]
  int visible = 1;                                       ///< frames in which it should have been seen
  int found = 1;                                         ///< frames in which it was
  int on_dynamic = 0;                                    ///< frames in which it lay on something that moves
  int born = 0;                                          ///< frame number
  std::vector<LandmarkView> views;
};

/// Says of each of many indices whether it was met in the current pass; a new pass costs nothing.
class PassMarks {
 public:
  /// Begins a pass over indices below n.
  void begin(std::size_t n) {
    if (pass_of_.size() < n) pass_of_.resize(n, 0);
    ++pass_;
  }
  /// PassMarks an index. \return false when it was marked before
  bool mark(int i) {
    int& p = pass_of_[static_cast<std::size_t>(i)];
    if (p == pass_) return false;
    p = pass_;
    return true;
  }
  [[nodiscard]] bool marked(int i) const { return pass_of_[static_cast<std::size_t>(i)] == pass_; }

 private:
  std::vector<int> pass_of_;
  int pass_ = 0;
};

/// The keyframes and the landmarks they see. Keyframes are numbered in the order in which they were made, and keep their number; what
/// is forgotten is no longer `alive`, and those that are older than all living ones are gone, so that a map of constant size needs
/// constant memory. Numbers of landmarks are used again.
class LocalMap {
 public:
  [[nodiscard]] const std::deque<MapLandmark>& landmarks() const { return landmarks_; }
  [[nodiscard]] MapLandmark& landmark(int i) { return landmarks_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const MapLandmark& landmark(int i) const { return landmarks_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] MapKeyframe& keyframe(int i) { return keyframes_[slot(i)]; }
  [[nodiscard]] const MapKeyframe& keyframe(int i) const { return keyframes_[slot(i)]; }
  [[nodiscard]] int living_landmarks() const { return living_landmarks_; }
  [[nodiscard]] int living_keyframes() const { return living_keyframes_; }
  /// The oldest keyframe that is kept, and the latest: all numbers between them are kept too. last < first: there is none.
  [[nodiscard]] int first_keyframe() const { return first_keyframe_; }
  [[nodiscard]] int last_keyframe() const { return first_keyframe_ + static_cast<int>(keyframes_.size()) - 1; }
  /// How many keyframes are kept, and the place of one among them.
  [[nodiscard]] std::size_t kept_keyframes() const { return keyframes_.size(); }
  [[nodiscard]] std::size_t slot(int keyframe) const { return static_cast<std::size_t>(keyframe - first_keyframe_); }

  int add_keyframe(double timestamp, const Pose& T_world_camera, const FeatureSet& features) {
    MapKeyframe k;
    k.alive = true;
    k.timestamp = timestamp;
    k.T_world_camera = T_world_camera;
    copy(features.keypoints, k.features.keypoints);
    copy(features.inverse_depth, k.features.inverse_depth);
    copy(features.inverse_depth_sigma, k.features.inverse_depth_sigma);
    copy(features.descriptors, k.features.descriptors);
    k.landmark.reserve(room(features.keypoints.size()));
    k.landmark.assign(features.keypoints.size(), -1);
    keyframes_.push_back(std::move(k));
    ++living_keyframes_;
    return last_keyframe();
  }

  /// Creates a landmark from a feature with depth.
  int add_landmark(const Pinhole& camera, int keyframe, int feature, int frame_number) {
    const int i = new_landmark();
    landmark(i).born = frame_number;
    add_view(i, keyframe, feature);
    move_with_keyframe(i, camera);
    return i;
  }

  /// Puts a landmark where its first view sees it, if that view has depth.
  void move_with_keyframe(int landmark_index, const Pinhole& camera) {
    MapLandmark& l = landmark(landmark_index);
    const MapKeyframe& k = keyframe(l.views.front().keyframe);
    const auto f = static_cast<std::size_t>(l.views.front().feature);
    const Keypoint& p = k.features.keypoints[f];
    if (!(k.features.inverse_depth[f] > 0)) return;
    l.point = transform(k.T_world_camera, camera.unproject(p.x, p.y, 1.0 / static_cast<double>(k.features.inverse_depth[f])));
  }

  void add_view(int landmark_index, int keyframe, int feature) {
    landmark(landmark_index).views.push_back({keyframe, feature});
    this->keyframe(keyframe).landmark[static_cast<std::size_t>(feature)] = landmark_index;
  }

  /// Removes one view; the landmark dies with its last.
  void remove_view(int landmark_index, int keyframe) {
    MapLandmark& l = landmark(landmark_index);
    for (std::size_t i = 0; i < l.views.size(); ++i)
      if (l.views[i].keyframe == keyframe) {
        this->keyframe(keyframe).landmark[static_cast<std::size_t>(l.views[i].feature)] = -1;
        l.views.erase(l.views.begin() + static_cast<std::ptrdiff_t>(i));
        break;
      }
    if (l.views.empty()) kill(landmark_index);
  }

  void kill(int landmark_index) {
    MapLandmark& l = landmark(landmark_index);
    if (!l.alive) return;
    for (const LandmarkView& v : l.views) keyframe(v.keyframe).landmark[static_cast<std::size_t>(v.feature)] = -1;
    l.views.clear();
    l.alive = false;
    --living_landmarks_;
    free_.push_back(landmark_index);
  }

  void forget_keyframe(int index) {
    if (index < first_keyframe_ || index > last_keyframe() || !keyframe(index).alive) return;
    MapKeyframe& k = keyframe(index);
    for (std::size_t f = 0; f < k.landmark.size(); ++f)
      if (k.landmark[f] >= 0) remove_view(k.landmark[f], index);
    k.features = FeatureSet{};
    k.landmark = std::vector<int>();  // clear() would keep its memory for ever
    k.alive = false;
    --living_keyframes_;
    for (; !keyframes_.empty() && !keyframes_.front().alive; ++first_keyframe_) keyframes_.pop_front();
  }

  /// Takes over the keyframes and landmarks of another map, as later than its own.
  /// \param T_this_other takes points of the other map into this one
  void append(LocalMap other, const Pose& T_this_other) {
    const int shift = last_keyframe() + 1 - other.first_keyframe_;
    std::vector<int> number(other.landmarks_.size(), -1);
    for (std::size_t i = 0; i < other.landmarks_.size(); ++i) {
      MapLandmark& l = other.landmarks_[i];
      if (!l.alive) continue;
      number[i] = new_landmark();
      l.point = transform(T_this_other, l.point);
      l.direction = transform(T_this_other, l.direction) - translation(T_this_other);
      for (LandmarkView& v : l.views) v.keyframe += shift;
      landmark(number[i]) = std::move(l);
    }
    for (MapKeyframe& k : other.keyframes_) {
      k.T_world_camera = compose(T_this_other, k.T_world_camera);
      for (int& l : k.landmark)
        if (l >= 0) l = number[static_cast<std::size_t>(l)];
      keyframes_.push_back(std::move(k));
    }
    living_keyframes_ += other.living_keyframes_;
  }

  /// Moves keyframes, and with each of them the landmarks that it saw first.
  /// \param T_world_camera of each keyframe kept, by slot(); of those that are not alive any
  void correct(const std::vector<Pose>& T_world_camera) {
    std::vector<Pose> T_now_before;
    for (std::size_t i = 0; i < keyframes_.size(); ++i)
      T_now_before.push_back(compose(T_world_camera[i], inverse(keyframes_[i].T_world_camera)));
    for (MapLandmark& l : landmarks_) {
      if (!l.alive) continue;
      const Pose& T = T_now_before[slot(l.views.front().keyframe)];
      l.point = transform(T, l.point);
      l.direction = transform(T, l.direction) - translation(T);
    }
    for (std::size_t i = 0; i < keyframes_.size(); ++i) keyframes_[i].T_world_camera = T_world_camera[i];
  }

  /// Descriptor, viewing direction and scale from the views.
  void refresh(int landmark_index, const Octaves& octaves) {
    MapLandmark& l = landmark(landmark_index);
    if (!l.alive || l.views.empty()) return;
    const std::size_t n = l.views.size();
    const std::size_t start = n > 8 ? n - 8 : 0;  // the latest views are the ones that matter
    const auto descriptor = [&](std::size_t i) -> const Descriptor& {
      return keyframe(l.views[i].keyframe).features.descriptors[static_cast<std::size_t>(l.views[i].feature)];
    };
    std::size_t best = start;
    int best_sum = 1 << 30;
    for (std::size_t i = start; i < n; ++i) {
      int sum = 0;
      for (std::size_t j = start; j < n; ++j) sum += i == j ? 0 : hamming(descriptor(i), descriptor(j));
      if (sum < best_sum) {
        best_sum = sum;
        best = i;
      }
    }
    l.descriptor = descriptor(best);
    Eigen::Vector3d sum(0, 0, 0);
    for (const LandmarkView& v : l.views) {
      const Eigen::Vector3d ray = translation(keyframe(v.keyframe).T_world_camera) - l.point;
      const double length = norm(ray);
      for (int i = 0; i < 3 && length > 0; ++i) sum(i) += ray(i) / length;
    }
    const double length = norm(sum);
    for (int i = 0; i < 3; ++i) l.direction(i) = length > 0 ? sum(i) / length : 0.0;
    const LandmarkView& last = l.views.back();
    const MapKeyframe& k = keyframe(last.keyframe);
    const Keypoint& p = k.features.keypoints[static_cast<std::size_t>(last.feature)];
    l.angle = p.angle;
    l.unit_distance = norm(translation(k.T_world_camera) - l.point) * octaves.sigma(p.octave);
  }

 private:
  [[nodiscard]] int new_landmark() {
    int i;
    if (!free_.empty()) {
      i = free_.back();
      free_.pop_back();
      landmark(i) = MapLandmark{};
    } else {
      i = static_cast<int>(landmarks_.size());
      landmarks_.emplace_back();
    }
    landmark(i).alive = true;
    ++living_landmarks_;
    return i;
  }
  // Keyframes take memory in a few sizes, so that what one leaves fits another, and the heap of a long run does not fall to pieces.
  [[nodiscard]] static std::size_t room(std::size_t features) { return (features + 255) / 256 * 256; }
  template <class T>
  static void copy(const std::vector<T>& from, std::vector<T>& to) {
    to.reserve(room(from.size()));
    to = from;
  }

  std::deque<MapKeyframe> keyframes_;
  int first_keyframe_ = 0;
  std::deque<MapLandmark> landmarks_;  // grows without a copy of twice its size
  std::vector<int> free_;
  int living_landmarks_ = 0;
  int living_keyframes_ = 0;
};

APSO_NAMESPACE_END
