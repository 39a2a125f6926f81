/// \file
/// Where the camera is by its motion so far, for directions that the images leave open: a Kalman filter of constant velocity.
#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/statistics.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/refinement/blend.hpp>
#include <apso/traits/any.hpp>
#include <apso/traits/pose.hpp>

APSO_NAMESPACE_BEGIN

/// Accelerations, as a multiple of the median one of the frames learned, that the filter reckons with (docs/refinement.md).
inline constexpr double kAccelerationDoubt = 1.5;

/// A wall that fills the view tells little of the way along it. What seems to tell it are features on people before the wall, or few that
/// are far away; but the camera has mass. The state is its position and its velocity. A white acceleration, whose size is learned on
/// trusted frames, makes both less known from frame to frame, and a pose measures the position with what is known of each direction: R. E.
/// Kalman, A new approach to linear filtering and prediction problems, 1960. The rotation follows the position by what the images say of
/// both together. Each frame is one begin(), then one of measured(), join(), predicted() and lost(). Frames without a direct pose are the
/// business of MotionPrior, which goes by the prediction of the host.
class ConstantVelocity {
 public:
  /// Frames farther apart [s], or not in the order of their time, are not one motion: the filter starts anew.
  static constexpr double kLongestGap = 0.5;

  /// A frame of this time [s].
  void begin(double timestamp) {
    const double dt = timestamp - timestamp_;
    timestamp_ = timestamp;
    known_ = known_ && dt > 0 && dt <= kLongestGap;
    if (!known_) return;
    dt_ = dt;
    const double a = kAccelerationDoubt / kMedianOfNorm * std::max(kLeastError / (dt * dt), acceleration_.median());
    const double q = a * a * dt;  // of a white acceleration [m^2/s^3]
    position_ += dt * velocity_;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) xx_(i, k) += dt * (xv_(i, k) + xv_(k, i)) + dt * dt * vv_(i, k);
    xv_ += dt * vv_;
    for (int i = 0; i < 3; ++i) {
      xx_(i, i) += q * dt * dt * dt / 3;
      xv_(i, i) += q * dt * dt / 2;
      vv_(i, i) += q * dt;
    }
  }
  /// Whether join() may be called: the frames before were measured, and enough were learned from.
  [[nodiscard]] bool ready() const { return known_ && acceleration_.size() >= kMinSamples; }
  /// Where the camera is expected, while ready() [m]; of no use after the frame was measured.
  [[nodiscard]] const Eigen::Vector3d& position() const { return position_; }

  /// The pose of the frame is taken as it is.
  /// \param information what is known of it, for the increment d of T_camera_world <- Exp(d) T_camera_world, translation first
  ///        [1/m^2, 1/rad^2]; 0 in directions of which nothing is known
  /// \param trusted it is exact in all directions: accelerations are learned from it
  void measured(const AnyPose& T_world_camera, const Matrix6& information, bool trusted = false) {
    const Pose& T = T_world_camera;
    const Eigen::Vector3d measured = translation(T);
    const Matrix6 covariance = solve_symmetric(detail::within_gate(information), identity<Matrix6>());
    Eigen::Matrix3d in_camera;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) in_camera(i, k) = covariance(i, k);
    const Eigen::Matrix3d R = seen_from(inverse(T), in_camera);
    if (!std::isfinite(norm(measured)) || !std::isfinite(trace(R))) return lost();
    if (!known_) {
      position_ = measured;
      velocity_ = zeros<Eigen::Vector3d>();
      xx_ = R;
      xv_ = zeros<Eigen::Matrix3d>();
      vv_ = kFastest * kFastest * identity<Eigen::Matrix3d>();
      known_ = true;
      return;
    }
    const Eigen::Vector3d off = measured - position_;
    if (trusted) acceleration_.add(norm(off) / (dt_ * dt_));
    const Eigen::Matrix3d S = xx_ + R;
    const Eigen::Matrix3d x_gain = solve_symmetric(S, xx_);  // transposed, and so is the next
    const Eigen::Matrix3d v_gain = solve_symmetric(S, xv_);
    position_ += transposed_times(x_gain, off);
    velocity_ += transposed_times(v_gain, off);
    vv_ = symmetric_part(vv_ - transposed_times(v_gain, xv_));
    xv_ = xv_ - transposed_times(x_gain, xv_);
    xx_ = symmetric_part(xx_ - transposed_times(x_gain, xx_));
  }
  /// The most probable pose by its own information and by the expected position. Needs ready(). The pose must be a rigid motion.
  /// \param information as for measured()
  template <class PoseT>
  [[nodiscard]] PoseT join(const PoseT& T_world_camera, const Matrix6& information) {
    check_pose<PoseT>();
    const Pose T = to_pose(T_world_camera);
    const Pose T_expected = make_pose(rotation(T), position_);
    const Eigen::Matrix3d expected = solve_symmetric(seen_from(T, xx_), identity<Eigen::Matrix3d>());
    Matrix6 D = zeros<Matrix6>();  // nothing of the rotation
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) D(i, k) = expected(i, k);
    measured(T, information);
    return from_pose<PoseT>(detail::join_by_information(T, T_expected, information, D, 1.0));
  }
  /// The pose of the frame is a prediction.
  void predicted(const AnyPose& T_world_camera) {
    const Pose& T = T_world_camera;
    if (known_) position_ = translation(T);
  }
  /// The pose of the frame is a guess that nothing bears out.
  void lost() { known_ = false; }
  /// Forgets everything, as at construction.
  void reset() { *this = ConstantVelocity(); }

 private:
  /// A covariance in the axes of the camera.
  static Eigen::Matrix3d seen_from(const Pose& T_world_camera, const Eigen::Matrix3d& C) {
    const Eigen::Matrix3d R = rotation(T_world_camera);
    return symmetric_part(Eigen::Matrix3d(transposed_times(R, C * R)));
  }
  static double trace(const Eigen::Matrix3d& A) { return A(0, 0) + A(1, 1) + A(2, 2); }

  static constexpr int kWindow = 300;  // trusted frames: 10 s of a 30 Hz camera
  static constexpr int kMinSamples = 5;
  static constexpr double kLeastError = 0.0005;  // of a prediction [m], so that a camera at rest may start
  static constexpr double kFastest = 1;          // standard deviation of a velocity of which nothing is known [m/s]

  RunningMedian acceleration_{kWindow};                                  // [m/s^2]
  Eigen::Vector3d position_ = zeros<Eigen::Vector3d>();                  // in the world [m]
  Eigen::Vector3d velocity_ = zeros<Eigen::Vector3d>();                  // [m/s]
  Eigen::Matrix3d xx_ = zeros<Eigen::Matrix3d>(), xv_ = xx_, vv_ = xx_;  // covariance of both
  double timestamp_ = 0;                                                 // [s]
  double dt_ = 0;                                                        // since the frame before [s]
  bool known_ = false;
};

APSO_NAMESPACE_END
