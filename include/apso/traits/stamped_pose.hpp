/// \file
/// Entries of a trajectory: specialise stamped_pose_traits for yours. A std::pair of seconds and any pose works directly.
///
/// \code
/// template <>
/// struct apso::stamped_pose_traits<MyKeyframe> {
///   static double timestamp(const MyKeyframe& k) { return 1e-9 * k.nanoseconds; }  // [s]
///   static MyPose pose(const MyKeyframe& k) { return k.T_world_camera; }           // T_world_body, a type with pose_traits
/// };
/// \endcode
#pragma once

#include <type_traits>
#include <utility>

#include <apso/config.hpp>
#include <apso/traits/detail.hpp>
#include <apso/traits/pose.hpp>

APSO_NAMESPACE_BEGIN

/// Specialise for the entries of your trajectories. The second parameter is free for std::enable_if.
template <class T, class Enable = void>
struct stamped_pose_traits {};

template <class Seconds, class PoseT>
struct stamped_pose_traits<std::pair<Seconds, PoseT>, std::enable_if_t<std::is_arithmetic_v<std::remove_const_t<Seconds>>>> {
  static double timestamp(const std::pair<Seconds, PoseT>& p) { return static_cast<double>(p.first); }
  static const PoseT& pose(const std::pair<Seconds, PoseT>& p) { return p.second; }
};

namespace detail {
template <class T>
using stamped_time_t = decltype(stamped_pose_traits<T>::timestamp(std::declval<const T&>()));
template <class T>
using stamped_pose_call_t = std::decay_t<decltype(stamped_pose_traits<T>::pose(std::declval<const T&>()))>;
template <class T, class = void>
struct stamped_pose_is_pose : std::false_type {};
template <class T>
struct stamped_pose_is_pose<T, std::void_t<stamped_pose_call_t<T>>> : std::bool_constant<is_pose_v<stamped_pose_call_t<T>>> {};
}  // namespace detail

/// True when T can be an entry of a trajectory.
template <class T>
inline constexpr bool is_stamped_pose_v = detail::detected_as_v<double, detail::stamped_time_t, T>&& detail::stamped_pose_is_pose<T>::value;

/// Names every member of stamped_pose_traits<T> that is missing, in the compiler's message.
template <class T>
struct require_stamped_pose {
  static_assert(detail::detected_as_v<double, detail::stamped_time_t, T>,
                "apso: stamped_pose_traits<T> needs `static double timestamp(const T& entry);` in seconds "
                "(T is an entry of a trajectory)");
  static_assert(detail::stamped_pose_is_pose<T>::value,
                "apso: stamped_pose_traits<T> needs `static PoseT pose(const T& entry);` with a PoseT that has pose_traits "
                "(T is an entry of a trajectory)");
};

/// Stands first in every function that takes a trajectory of the user; see check_image.
template <class T>
constexpr require_stamped_pose<T> check_stamped_pose() {
  return {};
}

APSO_NAMESPACE_END
