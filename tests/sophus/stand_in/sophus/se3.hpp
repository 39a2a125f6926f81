// Not Sophus, but a type with the names and types of Sophus::SE3 that apso/sophus/adapters.hpp relies on, for machines
// where Sophus is not installed (Debian 12 has no package of it). Like Sophus, the matrix constructor refuses a rotation
// that is not orthonormal to its tolerance, so an adapter that used it would fail here as it fails there.
#pragma once

#include <cmath>
#include <stdexcept>

#include <Eigen/Geometry>

namespace Sophus {

template <class Scalar_, int Options = 0>
class SE3 {
 public:
  using Scalar = Scalar_;
  using Transformation = Eigen::Matrix<Scalar, 4, 4>;
  using Point = Eigen::Matrix<Scalar, 3, 1>;
  using RotationMatrix = Eigen::Matrix<Scalar, 3, 3>;

  SE3() = default;
  SE3(const Eigen::Quaternion<Scalar>& q, const Point& t) : q_(q.normalized()), t_(t) {}
  SE3(const RotationMatrix& R, const Point& t) : q_(R), t_(t) {
    const Scalar off = (R * R.transpose() - RotationMatrix::Identity()).norm();
    if (!(off < Eigen::NumTraits<Scalar>::epsilon())) throw std::invalid_argument("R is not orthogonal");
  }

  RotationMatrix rotationMatrix() const { return q_.toRotationMatrix(); }
  const Eigen::Quaternion<Scalar, Options>& unit_quaternion() const { return q_; }
  const Eigen::Matrix<Scalar, 3, 1, Options>& translation() const { return t_; }
  Eigen::Matrix<Scalar, 3, 1, Options>& translation() { return t_; }
  Transformation matrix() const {
    Transformation T = Transformation::Identity();
    T.template topLeftCorner<3, 3>() = rotationMatrix();
    T.template topRightCorner<3, 1>() = t_;
    return T;
  }
  SE3 inverse() const {
    const Eigen::Quaternion<Scalar> q = q_.conjugate();
    const Point t = t_;
    return SE3(q, Point(-(q * t)));
  }
  SE3 operator*(const SE3& o) const {
    const Eigen::Quaternion<Scalar> q = q_;
    const Point t = o.t_;
    return SE3(Eigen::Quaternion<Scalar>(q * Eigen::Quaternion<Scalar>(o.q_)), Point(q * t + Point(t_)));
  }
  Point operator*(const Point& x) const { return Eigen::Quaternion<Scalar>(q_) * x + Point(t_); }
  template <class Other>
  SE3<Other> cast() const {
    const Eigen::Quaternion<Scalar> q = q_;
    const Point t = t_;
    return SE3<Other>(q.template cast<Other>(), t.template cast<Other>());
  }

 private:
  Eigen::Quaternion<Scalar, Options> q_ = Eigen::Quaternion<Scalar, Options>(Scalar(1), Scalar(0), Scalar(0), Scalar(0));
  Eigen::Matrix<Scalar, 3, 1, Options> t_ = Eigen::Matrix<Scalar, 3, 1, Options>(Scalar(0), Scalar(0), Scalar(0));
};

using SE3d = SE3<double>;
using SE3f = SE3<float>;

}  // namespace Sophus
