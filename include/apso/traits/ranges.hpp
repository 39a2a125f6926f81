/// \file
/// Lists of keypoints, tracks and detections: any range that `for` can walk twice and whose elements have traits. `none`
/// stands for a list or a mask that the caller does not have; so does a null pointer to one, where that is known at run
/// time only.
#pragma once

#include <iterator>
#include <type_traits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/traits/detection.hpp>
#include <apso/traits/keypoint.hpp>
#include <apso/traits/track.hpp>

APSO_NAMESPACE_BEGIN

/// "I do not have that": in place of a list, a mask or a pose that is optional. A missing list is not an empty one: an
/// empty list of detections says that nothing was detected.
struct None {};
inline constexpr None none{};

template <class T>
inline constexpr bool is_none_v = std::is_same_v<std::decay_t<T>, None>;

namespace detail {
template <class Range>
using range_value_t = std::decay_t<decltype(*std::begin(std::declval<const Range&>()))>;

/// Where an optional argument is: its address, what it points to if it is a pointer, null for `none`.
template <class T>
[[nodiscard]] const std::remove_pointer_t<T>* given(const T& argument) {
  if constexpr (is_none_v<T>) {
    (void)argument;
    return nullptr;
  } else if constexpr (std::is_pointer_v<T>) {
    return argument;  // cppcheck-suppress CastIntegerToAddressAtReturn; it is a pointer here
  } else {
    return &argument;
  }
}
}  // namespace detail

/// `f(Keypoint)` for each keypoint of a range, in order; nothing for `none`.
template <class Range, class F>
void for_each_keypoint(const Range& range, F&& f) {
  if constexpr (!is_none_v<Range>) {
    check_keypoint<detail::range_value_t<Range>>();
    for (const auto& keypoint : range) f(to_keypoint(keypoint));
  }
}

/// `f(PointTrack)` for each track of a range, in order; nothing for `none`.
template <class Range, class F>
void for_each_track(const Range& range, F&& f) {
  if constexpr (!is_none_v<Range>) {
    check_track<detail::range_value_t<Range>>();
    for (const auto& track : range) f(to_track(track));
  }
}

/// `f(Detection)` for each detection of a range, in order; nothing for `none`.
template <class Range, class F>
void for_each_detection(const Range& range, F&& f) {
  if constexpr (!is_none_v<Range>) {
    check_detection<detail::range_value_t<Range>>();
    for (const auto& detection : range) f(to_detection(detection));
  }
}

/// A range as a vector of apso's type: the vector itself when it is one, else a copy in `buffer`. For algorithms that
/// need random access to their list; lists are short, images are never copied like this.
template <class Range>
[[nodiscard]] const std::vector<Keypoint>& as_keypoints(const Range& range, std::vector<Keypoint>& buffer) {
  if constexpr (std::is_same_v<Range, std::vector<Keypoint>>) {
    return range;
  } else {
    buffer.clear();
    for_each_keypoint(range, [&](const Keypoint& k) { buffer.push_back(k); });
    return buffer;
  }
}
/// See as_keypoints.
template <class Range>
[[nodiscard]] const std::vector<PointTrack>& as_tracks(const Range& range, std::vector<PointTrack>& buffer) {
  if constexpr (std::is_same_v<Range, std::vector<PointTrack>>) {
    return range;
  } else {
    buffer.clear();
    for_each_track(range, [&](const PointTrack& t) { buffer.push_back(t); });
    return buffer;
  }
}
/// See as_keypoints. Masks stay views of the caller's memory.
template <class Range>
[[nodiscard]] const std::vector<Detection>& as_detections(const Range& range, std::vector<Detection>& buffer) {
  if constexpr (std::is_same_v<Range, std::vector<Detection>>) {
    return range;
  } else {
    buffer.clear();
    for_each_detection(range, [&](const Detection& d) { buffer.push_back(d); });
    return buffer;
  }
}

APSO_NAMESPACE_END
