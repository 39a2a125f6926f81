/// \file
/// A map in several parts: a camera that is lost for good begins a new one, and two are joined when a place is recognised.
///
/// ORB-SLAM3 calls it an atlas (Campos et al., T-RO 2021).
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/tracker/features.hpp>
#include <apso/tracker/landmark_matching.hpp>
#include <apso/tracker/map/local_map.hpp>
#include <apso/tracker/map/part_change.hpp>
#include <apso/tracker/map/place_recognition.hpp>
#include <apso/tracker/map/relocalisation.hpp>

APSO_NAMESPACE_BEGIN

/// The parts of a map that the camera is not in, and when it goes from one to another.
class MapParts {
 public:
  /// The part that the camera is in.
  [[nodiscard]] int current() const { return current_; }

  /// A camera that is lost is looked for in the other parts, and begins a new one when it was lost for a while on good images. One that
  /// is not lost is looked for as well, so that parts are joined.
  /// \param input how a keyframe is recognised
  /// \param[in,out] map the part that the camera is in
  /// \param[in,out] frame the pose becomes the one in the part that it is in afterwards
  /// \param[in,out] seen landmarks that the frame shows
  PartChange update(const WeightedFeatures& features, RelocalisationInput input, int max_keyframes, LandmarkMatcher& matcher, LocalMap& map,
                    PlacedFrame& frame, std::vector<int>& seen) {
    PartChange change;
    change.part = change.before = current_;
    if (!frame.lost || features.with_depth < kEnoughFeatures) lost_since_ = frame.timestamp;
    const bool look = frame.lost || (frame.placed && frame.number % kRecogniseEvery == 0);
    input.lost = true;
    const std::optional<Place> place = look ? recognise(features, input, matcher) : std::nullopt;
    if (frame.lost && place) {
      enter(place->index, map);
      seen.swap(seen_there_);
      frame.T_world_camera = place->T_part_camera;
      change.event = PartEvent::Left;
    } else if (frame.lost && frame.timestamp - lost_since_ >= kNewAfter && map.living_keyframes() > 0) {
      begin(map);
      seen.clear();
      change.event = PartEvent::Left;
    } else if (place && second_look_.agrees(others_[place->index].number, place->T_part_camera, frame)) {
      change.T_part_before = compose(place->T_part_camera, inverse(frame.T_world_camera));
      join(place->index, change.T_part_before, map);
      seen.swap(seen_there_);
      frame.T_world_camera = place->T_part_camera;
      change.event = PartEvent::Joined;
    }
    change.part = current_;
    forget_down_to(max_keyframes);
    return change;
  }

 private:
  static constexpr double kNewAfter = 1.0;     // [s]
  static constexpr int kEnoughFeatures = 200;  // static and with depth: an image that a map can begin with
  static constexpr int kRecogniseEvery = 5;    // frames, while the camera is not lost: it costs as much as the frame
  static constexpr int kSmallest = 3;          // keyframes: less is no place to be found again

  struct Part {
    int number = 0;
    LocalMap map;
  };
  /// A place of another part that the camera sees.
  struct Place {
    std::size_t index = 0;
    Pose T_part_camera = identity_pose();
  };

  [[nodiscard]] std::optional<Place> recognise(const WeightedFeatures& features, const RelocalisationInput& input,
                                               LandmarkMatcher& matcher) {
    for (std::size_t i = others_.size(); i-- > 0;) {
      MapPose found;
      if (relocalise(others_[i].map, features, input, matcher, seen_there_, found)) return Place{i, found.T_world_camera};
    }
    return std::nullopt;
  }

  [[nodiscard]] Part taken(std::size_t index) {
    Part part = std::move(others_[index]);
    others_.erase(others_.begin() + static_cast<std::ptrdiff_t>(index));
    second_look_.forget();
    return part;
  }
  void put_away(LocalMap& map) {
    second_look_.forget();
    if (map.living_keyframes() >= kSmallest || others_.empty()) others_.push_back({current_, std::move(map)});
  }
  void begin(LocalMap& map) {
    put_away(map);
    map = LocalMap{};
    current_ = ++last_;
  }
  void enter(std::size_t index, LocalMap& map) {
    Part found = taken(index);
    put_away(map);
    map = std::move(found.map);
    current_ = found.number;
  }
  void join(std::size_t index, const Pose& T_part_current, LocalMap& map) {
    Part found = taken(index);
    found.map.append(std::move(map), T_part_current);
    map = std::move(found.map);
    current_ = found.number;
  }
  /// The smallest parts go first; the last one is kept.
  void forget_down_to(int keyframes) {
    const auto fewer = [](const Part& a, const Part& b) { return a.map.living_keyframes() < b.map.living_keyframes(); };
    int sum = 0;
    for (const Part& p : others_) sum += p.map.living_keyframes();
    while (sum > keyframes && others_.size() > 1) {
      const auto smallest = std::min_element(others_.begin(), others_.end(), fewer);
      sum -= smallest->map.living_keyframes();
      others_.erase(smallest);
    }
  }

  int current_ = 0;
  int last_ = 0;
  std::vector<Part> others_;
  SecondLook second_look_;
  std::vector<int> seen_there_;  // landmarks of the place recognised
  double lost_since_ = 0;        // and ever since on images that a map can begin with
};

APSO_NAMESPACE_END
