/// \file
/// What a score may look at: the frame, and for a score of change what was remembered of another frame.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// From this dynamic probability on a pixel counts as dynamic. A NaN counts as dynamic too.
inline constexpr float kDynamicThreshold = 0.5F;

/// True when the pixel nearest to (x, y) lies in an image of width x height and is static. An empty map calls
/// everything static.
[[nodiscard]] inline bool is_static_point(const AnyImage& dynamic_probability, int width, int height, float x, float y) {
  if (!(x > -0.5F && y > -0.5F && x < static_cast<float>(width) - 0.5F && y < static_cast<float>(height) - 0.5F)) {
    return false;  // outside, or NaN
  }
  if (dynamic_probability.empty()) return true;
  return dynamic_probability.at(static_cast<int>(std::lround(x)), static_cast<int>(std::lround(y))) < kDynamicThreshold;
}

/// A frame as the scores see it. Refers to the caller's images and lists, which a score must not keep.
struct FrameContext {
  double timestamp = 0;  ///< [s]
  Pinhole camera;
  AnyImage intensity;                                ///< [0,1]; empty = none
  AnyImage depth;                                    ///< [m]; empty = none
  AnyImage dynamic_probability;                      ///< [0,1]; empty = everything is static
  DepthRange depth_range;                            ///< depths that may be used, see depth_valid()
  const std::vector<Keypoint>* keypoints = nullptr;  ///< null = none were given
  const std::vector<PointTrack>* tracks = nullptr;   ///< null = none were given
  const std::vector<Detection>* objects = nullptr;   ///< null = none were given; empty = nothing was detected
  const Pose* T_world_camera = nullptr;              ///< pose of the feature tracker; null = not known
  int matches = -1;                                  ///< of the feature tracker that agree with its pose; -1 = not known
  bool initialising = false;                         ///< there is no reference frame yet

  [[nodiscard]] int width() const { return camera.width; }    ///< [px]
  [[nodiscard]] int height() const { return camera.height; }  ///< [px]
  [[nodiscard]] bool is_static(float x, float y) const { return is_static_point(dynamic_probability, width(), height(), x, y); }
  /// The objects; an empty list when none were given.
  [[nodiscard]] const std::vector<Detection>& object_list() const {
    static const std::vector<Detection> nothing;
    return objects != nullptr ? *objects : nothing;
  }
};

/// What the current frame is compared with.
enum class ChangeBaseline {
  Reference,  ///< the benchmark frame
  Previous    ///< the frame before
};
constexpr std::array<const char*, 2> enum_names(ChangeBaseline) { return {"reference", "previous"}; }

/// Two frames as a score of change sees them.
/// \tparam Memory what the score remembers of a frame
template <class Memory>
struct ChangeContext {
  const Memory& reference;
  const Memory& current;
  const Pinhole& camera;
  ChangeBaseline baseline = ChangeBaseline::Reference;  ///< which frame the reference is
};

APSO_NAMESPACE_END
