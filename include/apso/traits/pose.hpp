/// \file
/// Poses: specialise pose_traits, and every algorithm takes and returns your pose type.
///
/// A pose T_a_b maps points of frame b into frame a, x_a = R x_b + t. Only R and t cross the border; exponentials and
/// logarithms of other libraries are never asked for, since the order of a twist differs between them.
///
/// \code
/// template <>
/// struct apso::pose_traits<MyPose> {
///   using scalar = double;
///   static Eigen::Matrix3d rotation(const MyPose& T) { return T.q.toRotationMatrix(); }  // orthonormal, det +1
///   static Eigen::Vector3d translation(const MyPose& T) { return T.p; }                  // [m]
///   static MyPose make(const Eigen::Matrix3d& R, const Eigen::Vector3d& t) { return {Eigen::Quaterniond(R), t}; }
/// };
/// \endcode
#pragma once

#include <type_traits>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/traits/detail.hpp>

APSO_NAMESPACE_BEGIN

/// Specialise for your pose type. The second parameter is free for std::enable_if.
template <class T, class Enable = void>
struct pose_traits {};

/// Every isometry or affine transform of Eigen, whatever its scalar, mode and alignment; apso::Pose is one of them.
template <class Scalar, int Mode, int Options>
struct pose_traits<Eigen::Transform<Scalar, 3, Mode, Options>> {
  using scalar = Scalar;
  using pose = Eigen::Transform<Scalar, 3, Mode, Options>;
  using matrix = Eigen::Matrix<Scalar, 3, 3>;
  using vector = Eigen::Matrix<Scalar, 3, 1>;
  // plain loops, as in math/small_matrix.hpp: each block of a transform is a type of its own
  static matrix rotation(const pose& T) {
    matrix R;
    for (int k = 0; k < 9; ++k) R(k % 3, k / 3) = T(k % 3, k / 3);
    return R;
  }
  static vector translation(const pose& T) { return {T(0, 3), T(1, 3), T(2, 3)}; }
  static pose make(const matrix& R, const vector& t) {
    typename pose::MatrixType M;
    for (int k = 0; k < 9; ++k) M(k % 3, k / 3) = R(k % 3, k / 3);
    for (int i = 0; i < 3; ++i) M(i, 3) = t(i);
    if constexpr (Mode != Eigen::AffineCompact) {
      for (int j = 0; j < 4; ++j) M(3, j) = static_cast<Scalar>(j == 3);
    }
    return pose(M);
  }
};

/// A homogeneous 4x4 matrix of Eigen.
template <class Scalar, int Options>
struct pose_traits<Eigen::Matrix<Scalar, 4, 4, Options, 4, 4>> {
  using scalar = Scalar;
  using pose = Eigen::Matrix<Scalar, 4, 4, Options, 4, 4>;
  using matrix = Eigen::Matrix<Scalar, 3, 3>;
  using vector = Eigen::Matrix<Scalar, 3, 1>;
  static matrix rotation(const pose& T) { return T.template topLeftCorner<3, 3>(); }
  static vector translation(const pose& T) { return T.template topRightCorner<3, 1>(); }
  static pose make(const matrix& R, const vector& t) {
    pose T = pose::Identity();
    T.template topLeftCorner<3, 3>() = R;
    T.template topRightCorner<3, 1>() = t;
    return T;
  }
};

namespace detail {
template <class T>
using pose_scalar_t = typename pose_traits<T>::scalar;
template <class T, class = void>
struct pose_members {
  static constexpr bool scalar = false;
  static constexpr bool rotation = false;
  static constexpr bool translation = false;
  static constexpr bool make = false;
};
template <class T>
using pose_rotation_t = decltype(pose_traits<T>::rotation(std::declval<const T&>()));
template <class T>
using pose_translation_t = decltype(pose_traits<T>::translation(std::declval<const T&>()));
template <class T, class S>
using pose_make_t =
    decltype(pose_traits<T>::make(std::declval<const Eigen::Matrix<S, 3, 3>&>(), std::declval<const Eigen::Matrix<S, 3, 1>&>()));
// Eigen lets a vector be given where a matrix is wanted until the body is compiled, so swapped arguments are looked for.
template <class T>
using pose_make_address_t = decltype(&pose_traits<T>::make);
template <class F>
struct takes_vector_first : std::false_type {};
template <class R, class S, int O, class B>
struct takes_vector_first<R (*)(const Eigen::Matrix<S, 3, 1, O>&, B)> : std::true_type {};
template <class R, class S, int O, class B>
struct takes_vector_first<R (*)(Eigen::Matrix<S, 3, 1, O>, B)> : std::true_type {};
template <class T, class = void>
struct pose_make_swapped : std::false_type {};
template <class T>
struct pose_make_swapped<T, std::void_t<pose_make_address_t<T>>> : takes_vector_first<pose_make_address_t<T>> {};

template <class T>
struct pose_members<T, std::void_t<pose_scalar_t<T>>> {
  using S = pose_scalar_t<T>;
  static constexpr bool scalar = std::is_floating_point_v<S>;
  static constexpr bool rotation = detected_as_v<Eigen::Matrix<S, 3, 3>, pose_rotation_t, T>;
  static constexpr bool translation = detected_as_v<Eigen::Matrix<S, 3, 1>, pose_translation_t, T>;
  static constexpr bool make = detected_as_v<T, pose_make_t, T, S> && !pose_make_swapped<T>::value;
};
}  // namespace detail

/// True when T can be used as a pose.
template <class T>
inline constexpr bool is_pose_v = detail::pose_members<T>::scalar&& detail::pose_members<T>::rotation&&
    detail::pose_members<T>::translation&& detail::pose_members<T>::make;

/// Names every member of pose_traits<T> that is missing, in the compiler's message.
template <class T>
struct require_pose {
  static constexpr bool scalar = detail::pose_members<T>::scalar;
  static_assert(scalar, "apso: pose_traits<T> needs `using scalar = double;` (or float)");
  static_assert(!scalar || detail::pose_members<T>::rotation,
                "apso: pose_traits<T> needs `static Eigen::Matrix<scalar,3,3> rotation(const T& pose);`");
  static_assert(!scalar || detail::pose_members<T>::translation,
                "apso: pose_traits<T> needs `static Eigen::Matrix<scalar,3,1> translation(const T& pose);`");
  static_assert(!scalar || detail::pose_members<T>::make,
                "apso: pose_traits<T> needs `static T make(const Eigen::Matrix<scalar,3,3>& R, "
                "const Eigen::Matrix<scalar,3,1>& t);`");
};

/// Stands first in every function that takes a pose type of the user; see check_image.
template <class T>
constexpr require_pose<T> check_pose() {
  return {};
}

/// Your pose as apso's. The rotation is not normalised: call normalized() if yours drifts.
template <class PoseT>
[[nodiscard]] Pose to_pose(const PoseT& T_a_b) {
  check_pose<PoseT>();
  using S = typename pose_traits<PoseT>::scalar;
  const Eigen::Matrix<S, 3, 3> R = pose_traits<PoseT>::rotation(T_a_b);
  const Eigen::Matrix<S, 3, 1> t = pose_traits<PoseT>::translation(T_a_b);
  Eigen::Matrix3d R_double;
  for (int k = 0; k < 9; ++k) R_double(k / 3, k % 3) = static_cast<double>(R(k / 3, k % 3));
  return make_pose(R_double, {static_cast<double>(t(0)), static_cast<double>(t(1)), static_cast<double>(t(2))});
}

/// apso's pose as yours.
template <class PoseT>
[[nodiscard]] PoseT from_pose(const Pose& T_a_b) {
  check_pose<PoseT>();
  using S = typename pose_traits<PoseT>::scalar;
  Eigen::Matrix<S, 3, 3> R;
  for (int k = 0; k < 9; ++k) R(k / 3, k % 3) = static_cast<S>(T_a_b(k / 3, k % 3));
  const Eigen::Matrix<S, 3, 1> t(static_cast<S>(T_a_b(0, 3)), static_cast<S>(T_a_b(1, 3)), static_cast<S>(T_a_b(2, 3)));
  return pose_traits<PoseT>::make(R, t);
}

APSO_NAMESPACE_END
