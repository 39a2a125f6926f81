/// \file
/// Velocity of a camera at the time of a frame, from its motion between the frames before and after, by direct alignment.
///
/// A hand shakes faster than frames come: the motion since the frame before is not the velocity at the frame, the one from the frame
/// before to the frame after nearly is. So it is known one frame late.
#pragma once

#include <array>
#include <cstddef>
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

APSO_NAMESPACE_BEGIN

/// Takes frames in the order of their time. No initial guess and no mask is needed; deterministic: what is said of a frame depends on it
/// and its two neighbours alone. Warm, it allocates nothing.
class CameraVelocity {
 public:
  /// Frames farther apart [s] tell no velocity.
  static constexpr double kLongestGap = 0.2;

  explicit CameraVelocity(const Pinhole& camera) : camera_(camera) { camera.validate(); }

  /// Forgets all frames: what comes next has no neighbour before it.
  void reset() { motion_ = {}, frames_ = 0; }

  /// The next frame, which is not referred to afterwards.
  void push(const AnyFrame& frame, const ExecutorRef& executor = SerialExecutor{}) {
    std::swap(before_, latest_);
    latest_.build(frame, camera_, {}, pyramid_options(), PyramidRole::Both, executor);
    motion_[0] = motion_[1];
    motion_[1].reset();
    ++frames_;
    if (frames_ < 2) return;
    const double time = latest_.timestamp() - before_.timestamp();
    if (!(time > 0 && time <= kLongestGap)) return;
    const AlignmentResult found = aligner_.align_near({{&before_, identity_pose(), 1.0}}, latest_, identity_pose(), executor);
    if (!succeeded(found.status) || direct_confidence(found).c_dir < kTrusted) return;
    motion_[1] = Motion{found.T_world_camera, time};
  }

  /// (v, w) of the frame before the latest in its own frame [m/s, rad/s]; that of one side where the other is not known.
  [[nodiscard]] std::optional<Twist> of_frame_before() const {
    if (!motion_[0] || !motion_[1]) return one_sided(motion_[0] ? motion_[0] : motion_[1]);
    return Twist(se3_log(compose(motion_[0]->T_before_after, motion_[1]->T_before_after)) / (motion_[0]->time + motion_[1]->time));
  }
  /// The same of the latest frame, from one side: the last frame of a recording has no other.
  [[nodiscard]] std::optional<Twist> of_latest_frame() const { return one_sided(motion_[1]); }

 private:
  static constexpr double kTrusted = 0.3;  // of c_dir, which is halved where the iterations ran out: exact enough for a velocity
  // A quarter of the size is as good as half of it: it costs a third of the time, and errors of 2 mm move a row by 1 mm.
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
  [[nodiscard]] static std::optional<Twist> one_sided(const std::optional<Motion>& m) {
    if (!m) return std::nullopt;
    return Twist(se3_log(m->T_before_after) / m->time);
  }

  Pinhole camera_;
  FramePyramid before_, latest_;
  DirectAligner aligner_;
  std::array<std::optional<Motion>, 2> motion_;  // to the frame before, and from there to the latest
  long frames_ = 0;
};

APSO_NAMESPACE_END
