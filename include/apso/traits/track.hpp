/// \file
/// Point tracks: specialise track_traits for your track type.
///
/// \code
/// template <>
/// struct apso::track_traits<MyTrack> {
///   static std::int64_t id(const MyTrack& t) { return t.id; }           // the same for the life of the track, never reused
///   static float x(const MyTrack& t) { return t.now.u; }                // position in the current frame [px]
///   static float y(const MyTrack& t) { return t.now.v; }
///   static float previous_x(const MyTrack& t) { return t.before.u; }    // position in the previous frame [px]
///   static float previous_y(const MyTrack& t) { return t.before.v; }
///   static int age(const MyTrack& t) { return t.frames; }               // frames since it began; 0 = it begins here
/// };
/// \endcode
#pragma once

#include <cstdint>
#include <type_traits>
#include <vector>

#include <apso/config.hpp>
#include <apso/traits/detail.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// Specialise for your track type. The second parameter is free for std::enable_if.
template <class T, class Enable = void>
struct track_traits {};

template <>
struct track_traits<PointTrack> {
  static std::int64_t id(const PointTrack& t) { return t.id; }
  static float x(const PointTrack& t) { return t.x; }
  static float y(const PointTrack& t) { return t.y; }
  static float previous_x(const PointTrack& t) { return t.previous_x; }
  static float previous_y(const PointTrack& t) { return t.previous_y; }
  static int age(const PointTrack& t) { return t.age; }
};

namespace detail {
template <class T>
using track_id_t = decltype(track_traits<T>::id(std::declval<const T&>()));
template <class T>
using track_x_t = decltype(track_traits<T>::x(std::declval<const T&>()));
template <class T>
using track_y_t = decltype(track_traits<T>::y(std::declval<const T&>()));
template <class T>
using track_previous_x_t = decltype(track_traits<T>::previous_x(std::declval<const T&>()));
template <class T>
using track_previous_y_t = decltype(track_traits<T>::previous_y(std::declval<const T&>()));
template <class T>
using track_age_t = decltype(track_traits<T>::age(std::declval<const T&>()));
}  // namespace detail

/// True when T can be used as a point track.
template <class T>
inline constexpr bool is_track_v =
    detail::detected_as_v<std::int64_t, detail::track_id_t, T>&& detail::detected_as_v<float, detail::track_x_t, T>&&
        detail::detected_as_v<float, detail::track_y_t, T>&& detail::detected_as_v<float, detail::track_previous_x_t, T>&&
            detail::detected_as_v<float, detail::track_previous_y_t, T>&& detail::detected_as_v<int, detail::track_age_t, T>;

/// Names every member of track_traits<T> that is missing, in the compiler's message.
template <class T>
struct require_track {
  static_assert(detail::detected_as_v<std::int64_t, detail::track_id_t, T>,
                "apso: track_traits<T> needs `static std::int64_t id(const T& track);`");
  static_assert(detail::detected_as_v<float, detail::track_x_t, T>, "apso: track_traits<T> needs `static float x(const T& track);`");
  static_assert(detail::detected_as_v<float, detail::track_y_t, T>, "apso: track_traits<T> needs `static float y(const T& track);`");
  static_assert(detail::detected_as_v<float, detail::track_previous_x_t, T>,
                "apso: track_traits<T> needs `static float previous_x(const T& track);`");
  static_assert(detail::detected_as_v<float, detail::track_previous_y_t, T>,
                "apso: track_traits<T> needs `static float previous_y(const T& track);`");
  static_assert(detail::detected_as_v<int, detail::track_age_t, T>, "apso: track_traits<T> needs `static int age(const T& track);`");
};

/// Stands first in every function that takes a track type of the user; see check_image.
template <class T>
constexpr require_track<T> check_track() {
  return {};
}

/// Your track as apso's.
template <class TrackT>
[[nodiscard]] PointTrack to_track(const TrackT& track) {
  check_track<TrackT>();
  using Traits = track_traits<TrackT>;
  PointTrack t;
  t.id = Traits::id(track);
  t.x = Traits::x(track);
  t.y = Traits::y(track);
  t.previous_x = Traits::previous_x(track);
  t.previous_y = Traits::previous_y(track);
  t.age = Traits::age(track);
  return t;
}

APSO_NAMESPACE_END
