/// \file
/// Keypoints: specialise keypoint_traits for your keypoint type.
///
/// \code
/// template <>
/// struct apso::keypoint_traits<MyCorner> {
///   static float x(const MyCorner& k) { return k.u; }              // [px]
///   static float y(const MyCorner& k) { return k.v; }              // [px]
///   static float response(const MyCorner& k) { return k.score; }   // >= 0
///   static float angle(const MyCorner& k);                         // optional, [deg]; else 0
///   static int octave(const MyCorner& k);                          // optional; else 0
/// };
/// \endcode
#pragma once

#include <type_traits>

#include <apso/config.hpp>
#include <apso/traits/detail.hpp>
#include <apso/types/keypoint.hpp>

APSO_NAMESPACE_BEGIN

/// Specialise for your keypoint type. The second parameter is free for std::enable_if.
template <class T, class Enable = void>
struct keypoint_traits {};

template <>
struct keypoint_traits<Keypoint> {
  static float x(const Keypoint& k) { return k.x; }
  static float y(const Keypoint& k) { return k.y; }
  static float response(const Keypoint& k) { return k.response; }
  static float angle(const Keypoint& k) { return k.angle; }
  static int octave(const Keypoint& k) { return k.octave; }
};

namespace detail {
template <class T>
using keypoint_x_t = decltype(keypoint_traits<T>::x(std::declval<const T&>()));
template <class T>
using keypoint_y_t = decltype(keypoint_traits<T>::y(std::declval<const T&>()));
template <class T>
using keypoint_response_t = decltype(keypoint_traits<T>::response(std::declval<const T&>()));
template <class T>
using keypoint_angle_t = decltype(keypoint_traits<T>::angle(std::declval<const T&>()));
template <class T>
using keypoint_octave_t = decltype(keypoint_traits<T>::octave(std::declval<const T&>()));
}  // namespace detail

/// True when T can be used as a keypoint.
template <class T>
inline constexpr bool is_keypoint_v = detail::detected_as_v<float, detail::keypoint_x_t, T>&&
    detail::detected_as_v<float, detail::keypoint_y_t, T>&& detail::detected_as_v<float, detail::keypoint_response_t, T>;

/// Names every member of keypoint_traits<T> that is missing, in the compiler's message.
template <class T>
struct require_keypoint {
  static_assert(detail::detected_as_v<float, detail::keypoint_x_t, T>,
                "apso: keypoint_traits<T> needs `static float x(const T& keypoint);`");
  static_assert(detail::detected_as_v<float, detail::keypoint_y_t, T>,
                "apso: keypoint_traits<T> needs `static float y(const T& keypoint);`");
  static_assert(detail::detected_as_v<float, detail::keypoint_response_t, T>,
                "apso: keypoint_traits<T> needs `static float response(const T& keypoint);`");
};

/// Stands first in every function that takes a keypoint type of the user; see check_image.
template <class T>
constexpr require_keypoint<T> check_keypoint() {
  return {};
}

/// Your keypoint as apso's.
template <class KeypointT>
[[nodiscard]] Keypoint to_keypoint(const KeypointT& keypoint) {
  check_keypoint<KeypointT>();
  using Traits = keypoint_traits<KeypointT>;
  Keypoint k;
  k.x = Traits::x(keypoint);
  k.y = Traits::y(keypoint);
  k.response = Traits::response(keypoint);
  if constexpr (detail::detected_as_v<float, detail::keypoint_angle_t, KeypointT>) k.angle = Traits::angle(keypoint);
  if constexpr (detail::detected_as_v<int, detail::keypoint_octave_t, KeypointT>) k.octave = Traits::octave(keypoint);
  return k;
}

APSO_NAMESPACE_END
