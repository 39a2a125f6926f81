/// \file
/// The requirements on user types, as C++20 concepts where the compiler knows them. They are exactly the predicates
/// is_image_v, is_pose_v, is_camera_v, is_keypoint_v, is_detection_v and is_track_v, which C++17 code uses.
#pragma once

#include <apso/config.hpp>
#include <apso/traits/camera.hpp>
#include <apso/traits/detection.hpp>
#include <apso/traits/image.hpp>
#include <apso/traits/keypoint.hpp>
#include <apso/traits/pose.hpp>
#include <apso/traits/track.hpp>

#if defined(__cpp_concepts) && __cpp_concepts >= 201907L
APSO_NAMESPACE_BEGIN

template <class T>
concept ImageType = is_image_v<T>;
template <class T>
concept PoseType = is_pose_v<T>;
template <class T>
concept CameraType = is_camera_v<T>;
template <class T>
concept KeypointType = is_keypoint_v<T>;
template <class T>
concept DetectionType = is_detection_v<T>;
template <class T>
concept TrackType = is_track_v<T>;

APSO_NAMESPACE_END
#endif
