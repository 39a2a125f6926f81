/// \file
/// Velocity of a camera at the time of a frame, from its motion between the frames before and after, by direct alignment.
///
/// A hand shakes faster than frames come: the motion since the frame before is not the velocity at the frame, the one from the frame
/// before to the frame after nearly is. So it is known one frame late.
#pragma once

#include <array>
#include <optional>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/se3.hpp>
#include <apso/refinement/aligner.hpp>
#include <apso/refinement/confidence.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/traits/any.hpp>
#include <apso/traits/images/rolling_shutter.hpp>

APSO_NAMESPACE_BEGIN

/// Takes frames in the order of their time. No initial guess and no mask is needed; deterministic: what is said of a frame depends on it
/// and its two neighbours alone. Warm, it allocates nothing.
class CameraVelocity {
 public:
  /// Frames farther apart [s] tell no velocity.
  static constexpr double kLongestGap = 0.2;

  explicit CameraVelocity(const Pinhole& camera) : camera_(camera) { camera.validate(); }

  /// Forgets all frames: what comes next has no neighbour before it.
  void reset() {
    motion_ = {};
    begun_ = false;
  }

  /// The next frame, which is not referred to afterwards.
  void push(const AnyFrame& frame, const ExecutorRef& executor = SerialExecutor{}) {
    std::swap(before_, latest_);
    latest_.build(frame, camera_, {}, pyramid_options(), PyramidRole::Both, executor);
    motion_[0] = motion_[1];
    motion_[1].reset();
    if (!std::exchange(begun_, true)) return;
    const double time = latest_.timestamp() - before_.timestamp();
    if (!(time > 0 && time <= kLongestGap)) return;
    reference_.assign(1, {&before_, identity_pose(), 1.0});
    const AlignmentResult found = aligner_.align_near(reference_, latest_, identity_pose(), executor);
    if (!succeeded(found.status) || direct_confidence(found).c_dir < kTrusted) return;
    const Motion m{found.T_world_camera, time};
    const Twist v = velocity(m);
    const bool possible = translation_norm(v) <= RollingShutter::kFastest && rotation_norm(v) <= RollingShutter::kFastest;
    if (possible) motion_[1] = m;  // else the stamps are wrong
  }

  /// (v, w) of the frame before the latest in its own frame [m/s, rad/s], each part at most RollingShutter::kFastest long; that of one side
  /// where the other is not known.
  [[nodiscard]] std::optional<Twist> of_frame_before() const {
    if (!motion_[0]) return of_latest_frame();
    if (!motion_[1]) return velocity(*motion_[0]);
    return velocity({compose(motion_[0]->T_before_after, motion_[1]->T_before_after), motion_[0]->time + motion_[1]->time});
  }
  /// The same of the latest frame, from one side: the last frame of a recording has no other.
  [[nodiscard]] std::optional<Twist> of_latest_frame() const {
    return motion_[1] ? std::optional<Twist>(velocity(*motion_[1])) : std::nullopt;
  }

 private:
  static constexpr double kTrusted = 0.1;  // of c_dir: a velocity need not be exact to 2 cm, and iterations often run out on bent images
  // A quarter of the size is as good as half of it, and takes less time: an error of 2 mm moves a row by 1 mm at most.
  static PyramidOptions pyramid_options() {
    PyramidOptions options;
    options.finest = 2;
    options.max_pixels = 5000;
    return options;
  }
  struct Motion {
    Pose T_before_after;
    double time;  // [s]
  };
  [[nodiscard]] static Twist velocity(const Motion& m) { return Twist(se3_log(m.T_before_after) / m.time); }

  Pinhole camera_;
  FramePyramid before_, latest_;
  DirectAligner aligner_;
  std::array<std::optional<Motion>, 2> motion_;  // to the frame before, and from there to the latest
  std::vector<AlignmentReference> reference_;
  bool begun_ = false;
};

APSO_NAMESPACE_END
