/// \file
/// What the recognition of a place is told of a frame, and when a place counts as recognised.
#pragma once

#include <optional>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>

APSO_NAMESPACE_BEGIN

/// What a frame that is done tells the map.
struct PlacedFrame {
  double timestamp = 0;  ///< [s]
  int number = 0;
  Pose T_world_camera = identity_pose();  ///< in the part that the camera is in
  bool lost = false;                      ///< nothing tells where it is
  bool placed = false;                    ///< the map and the assessment tell where it is
};

/// A place counts as recognised when two frames find it at the same spot of the current part: what moves, and what only looks alike, does
/// not fit twice.
class SecondLook {
 public:
  /// A frame has found a place.
  /// \param place          whose number it is
  /// \param T_place_camera where the place says that the camera of the frame is
  /// \return whether an earlier frame has found the same
  [[nodiscard]] bool agrees(int place, const Pose& T_place_camera, const PlacedFrame& frame) {
    const bool known = first_ && first_->place == place && frame.timestamp - first_->timestamp < kRemembered;
    if (known && frame.timestamp - first_->timestamp < kApart) return false;
    bool same = false;
    if (known) {
      const Pose off = compose(inverse(compose(first_->T_place_current, frame.T_world_camera)), T_place_camera);
      same = norm(translation(off)) < kSameSpot && rotation_angle(off) < kSameView;
    }
    first_ = Look{place, frame.timestamp, compose(T_place_camera, inverse(frame.T_world_camera))};
    return same;
  }
  void forget() { first_.reset(); }

 private:
  static constexpr double kSameSpot = 0.06;    // of two frames that confirm each other [m]
  static constexpr double kSameView = 0.07;    // [rad]
  static constexpr double kApart = 0.3;        // between them [s]
  static constexpr double kRemembered = 10.0;  // [s]
  struct Look {
    int place = 0;
    double timestamp = 0;
    Pose T_place_current = identity_pose();
  };
  std::optional<Look> first_;
};

APSO_NAMESPACE_END
