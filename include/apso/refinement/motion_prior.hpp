/// \file
/// A feature pose joined with the prediction, where no direct pose speaks: the update of a Kalman filter.
#pragma once

#include <algorithm>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/statistics.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/refinement/blend.hpp>
#include <apso/traits/any.hpp>
#include <apso/traits/pose.hpp>

APSO_NAMESPACE_BEGIN

/// Errors of a prediction that is made worse than it was on trusted frames: where no direct pose is found, the motion of the features,
/// from which a prediction is made, is harder to tell as well (docs/quality.md).
inline constexpr double kPriorDoubt = 3;

/// Learns on trusted frames how far predictions are off, and joins the feature pose of another frame with its prediction, each by what it
/// knows of the translation. The uncertainty of the frame before adds to that of the prediction, so that a pose is held for a few frames
/// and no error of the motion is carried on for long: R. E. Kalman, A new approach to linear filtering and prediction problems, 1960,
/// with a state of one position. The rotation is left to the features, which tell it better than a prediction does (docs/quality.md).
/// Tell it of every frame by one of measured(), refined(), predicted(), lost() and join().
class MotionPrior {
 public:
  /// A frame that is trusted.
  void learn(const AnyPose& T_world_predicted, const AnyPose& T_world_camera) {
    error_.add(norm(translation(compose(inverse(T_world_predicted), T_world_camera))));
  }
  /// Whether join() may be called: enough predictions were seen to judge one, and this one does not go on from a guess.
  [[nodiscard]] bool ready() const { return known_ && error_.size() >= kMinSamples; }

  /// The latest pose was joined with a direct one: beside a feature pose it is exact.
  void refined() { know(zeros<Matrix6>()); }
  /// The latest pose is that of the features.
  /// \param information see FeaturePose::information
  void measured(const Matrix6& information) { know(inverted(detail::within_gate(detail::feature_information(information)))); }
  /// The latest pose is the prediction.
  void predicted() { covariance_ = of_prediction(); }
  /// The latest pose is a guess that nothing bears out.
  void lost() { known_ = false; }
  /// The most probable pose of both: information F of the feature pose, (C + Q)^-1 of the predicted position, with the covariance C of the
  /// position before and Q that of its motion, kPriorDoubt times the median error on the frames learned. This is the latest pose then.
  /// Needs ready(). The poses must be rigid motions.
  /// \param information see FeaturePose::information
  template <class PoseT>
  [[nodiscard]] PoseT join(const PoseT& T_world_feature, const PoseT& T_world_predicted, const Matrix6& information) {
    check_pose<PoseT>();
    const Matrix6 F = detail::feature_information(information);
    const Matrix6 D = inverted(of_prediction());  // nothing of the rotation
    Matrix6 both = zeros<Matrix6>();
    for (int i = 0; i < 6; ++i)
      for (int k = 0; k < 6; ++k) both(i, k) = F(i, k) + D(i, k);
    know(inverted(both));
    return from_pose<PoseT>(detail::join_by_information(to_pose(T_world_feature), to_pose(T_world_predicted), F, D, 1.0));
  }
  /// Forgets everything, as at construction.
  void reset() { *this = MotionPrior(); }

 private:
  // Of the latest pose the covariance of its position, the upper left block.
  void know(const Matrix6& covariance) {
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) covariance_(i, k) = covariance(i, k);
    known_ = true;
  }
  [[nodiscard]] Matrix6 of_prediction() {
    Matrix6 sum = covariance_;
    const double sigma = kPriorDoubt / kMedianOfNorm * std::max(kLeastError, error_.median());
    for (int i = 0; i < 3; ++i) sum(i, i) += sigma * sigma;
    return sum;
  }
  // Of a block of zeros the inverse is zero as well.
  static Matrix6 inverted(const Matrix6& A) { return solve_symmetric(A, identity<Matrix6>()); }

  static constexpr int kWindow = 300;  // trusted frames: 10 s of a 30 Hz camera
  static constexpr int kMinSamples = 5;
  static constexpr double kLeastError = 0.0005;  // [m]; of a camera at rest, so that it may start

  RunningMedian error_{kWindow};           // [m]
  Matrix6 covariance_ = zeros<Matrix6>();  // of the latest position, in the camera frame [m^2]; the rest is zero
  bool known_ = false;
};

APSO_NAMESPACE_END
