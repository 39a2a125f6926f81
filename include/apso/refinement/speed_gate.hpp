/// \file
/// How fast the camera moves on good frames, and whether a pose would mean that it moved much faster.
#pragma once

#include <apso/config.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/statistics.hpp>
#include <apso/traits/any.hpp>

APSO_NAMESPACE_BEGIN

/// Learns the median speed on good frames. A pose is too fast when it is farther from the last one that was trusted than
/// three times the median speed plus 1.5 m/s, or plus 600 deg/s, would bring the camera in the time since then. The poses
/// between may be the wrong ones that are to be repaired: against them the way back would look fast.
class SpeedGate {
 public:
  /// A good frame of time t [s].
  void learn(double t, const AnyPose& T_world_camera) {
    const double dt = t - timestamp_;
    if (follows_good_ && dt > 0) {
      const Pose motion = compose(inverse(T_world_trusted_), T_world_camera);
      speed_.add(norm(translation(motion)) / dt);
      turn_.add(rotation_angle(motion) / dt);
    }
    trust(t, T_world_camera);
    follows_good_ = true;
  }
  /// A frame that is not good.
  void interrupt() { follows_good_ = false; }
  /// A pose that was believed.
  void trust(double t, const AnyPose& T_world_camera) {
    T_world_trusted_ = T_world_camera;
    timestamp_ = t;
    trusted_ = true;
  }
  /// \param multiple of the bound; 0 = every speed is believed
  [[nodiscard]] bool too_fast(double t, const AnyPose& T_world_camera, double multiple = 1) {
    const double dt = t - timestamp_;
    if (!(multiple > 0) || !trusted_ || speed_.size() < kMinSamples || !(dt > 0)) return false;
    const Pose motion = compose(inverse(T_world_trusted_), T_world_camera);
    return norm(translation(motion)) > dt * multiple * (kFactor * speed_.median(0) + kSpeed) ||
           rotation_angle(motion) > dt * multiple * (kFactor * turn_.median(0) + kTurn);
  }
  /// Forgets everything, as at construction.
  void reset() { *this = SpeedGate(); }

 private:
  static constexpr int kWindow = 60;     // good frames, two seconds
  static constexpr int kMinSamples = 5;  // speeds needed before the gate is used
  static constexpr double kFactor = 3;
  static constexpr double kSpeed = 1.5;           // [m/s], a hand that moves fast
  static constexpr double kTurn = 600 * kDegree;  // [rad/s]

  RunningMedian speed_{kWindow}, turn_{kWindow};
  Pose T_world_trusted_ = identity_pose();
  double timestamp_ = 0;
  bool trusted_ = false;
  bool follows_good_ = false;
};

APSO_NAMESPACE_END
