/// \file
/// Sophus::SE3 as a pose.
#pragma once

#include <sophus/se3.hpp>

#include <apso/config.hpp>
#include <apso/traits/pose.hpp>

APSO_NAMESPACE_BEGIN

template <class Scalar, int Options>
struct pose_traits<Sophus::SE3<Scalar, Options>> {
  using scalar = Scalar;
  using pose = Sophus::SE3<Scalar, Options>;
  using matrix = Eigen::Matrix<Scalar, 3, 3>;
  using vector = Eigen::Matrix<Scalar, 3, 1>;
  static matrix rotation(const pose& T) { return T.rotationMatrix(); }
  static vector translation(const pose& T) { return T.translation(); }
  static pose make(const matrix& R, const vector& t) {
    // By the quaternion: the matrix constructor rejects rotations that are off by a few roundings.
    return pose(Eigen::Quaternion<Scalar>(R).normalized(), t);
  }
};

APSO_NAMESPACE_END
