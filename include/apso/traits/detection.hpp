/// \file
/// Detections: specialise detection_traits for the output of your object detector.
///
/// \code
/// template <>
/// struct apso::detection_traits<MyObject> {
///   static apso::Box box(const MyObject& o) { return {o.left, o.top, o.w, o.h}; }  // [px]
///   static float score(const MyObject& o) { return o.confidence; }                 // [0,1]
///   static int class_id(const MyObject& o) { return o.label; }
///   static bool movable(const MyObject& o);                                // optional; else true
///   static float motion_probability(const MyObject& o);                    // optional, [0,1]; else not known
///   static int track_id(const MyObject& o);                                // optional; else none
///   static apso::ImageView<const std::uint8_t> mask(const MyObject& o);    // optional; else only the box
/// };
/// \endcode
#pragma once

#include <cstdint>
#include <type_traits>

#include <apso/config.hpp>
#include <apso/traits/detail.hpp>
#include <apso/types/detection.hpp>

APSO_NAMESPACE_BEGIN

/// Specialise for your detection type. The second parameter is free for std::enable_if.
template <class T, class Enable = void>
struct detection_traits {};

template <>
struct detection_traits<Detection> {
  static Box box(const Detection& d) { return d.box; }
  static float score(const Detection& d) { return d.score; }
  static int class_id(const Detection& d) { return d.class_id; }
  static bool movable(const Detection& d) { return d.movable; }
  static float motion_probability(const Detection& d) { return d.motion_probability; }
  static int track_id(const Detection& d) { return d.track_id; }
  static ImageView<const std::uint8_t> mask(const Detection& d) { return d.mask; }
};

namespace detail {
template <class T>
using detection_box_t = decltype(detection_traits<T>::box(std::declval<const T&>()));
template <class T>
using detection_score_t = decltype(detection_traits<T>::score(std::declval<const T&>()));
template <class T>
using detection_class_t = decltype(detection_traits<T>::class_id(std::declval<const T&>()));
template <class T>
using detection_movable_t = decltype(detection_traits<T>::movable(std::declval<const T&>()));
template <class T>
using detection_motion_t = decltype(detection_traits<T>::motion_probability(std::declval<const T&>()));
template <class T>
using detection_track_t = decltype(detection_traits<T>::track_id(std::declval<const T&>()));
template <class T>
using detection_mask_t = decltype(detection_traits<T>::mask(std::declval<const T&>()));
}  // namespace detail

/// True when T can be used as a detection.
template <class T>
inline constexpr bool is_detection_v = detail::detected_as_v<Box, detail::detection_box_t, T>&&
    detail::detected_as_v<float, detail::detection_score_t, T>&& detail::detected_as_v<int, detail::detection_class_t, T>;

/// Names every member of detection_traits<T> that is missing, in the compiler's message.
template <class T>
struct require_detection {
  static_assert(detail::detected_as_v<Box, detail::detection_box_t, T>,
                "apso: detection_traits<T> needs `static apso::Box box(const T& detection);`");
  static_assert(detail::detected_as_v<float, detail::detection_score_t, T>,
                "apso: detection_traits<T> needs `static float score(const T& detection);`");
  static_assert(detail::detected_as_v<int, detail::detection_class_t, T>,
                "apso: detection_traits<T> needs `static int class_id(const T& detection);`");
};

/// Stands first in every function that takes a detection type of the user; see check_image.
template <class T>
constexpr require_detection<T> check_detection() {
  return {};
}

/// Your detection as apso's.
template <class DetectionT>
[[nodiscard]] Detection to_detection(const DetectionT& detection) {
  check_detection<DetectionT>();
  using Traits = detection_traits<DetectionT>;
  Detection d;
  d.box = Traits::box(detection);
  d.score = Traits::score(detection);
  d.class_id = Traits::class_id(detection);
  if constexpr (detail::detected_as_v<bool, detail::detection_movable_t, DetectionT>) {
    d.movable = Traits::movable(detection);
  }
  if constexpr (detail::detected_as_v<float, detail::detection_motion_t, DetectionT>) {
    d.motion_probability = Traits::motion_probability(detection);
  }
  if constexpr (detail::detected_as_v<int, detail::detection_track_t, DetectionT>) {
    d.track_id = Traits::track_id(detection);
  }
  if constexpr (detail::detected_as_v<ImageView<const std::uint8_t>, detail::detection_mask_t, DetectionT>) {
    d.mask = Traits::mask(detection);
  }
  return d;
}

APSO_NAMESPACE_END
