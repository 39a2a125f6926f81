// Pairs of frames of a recording with ground truth.
#pragma once

#include <algorithm>
#include <optional>
#include <string>

#include <apso/evaluation/trajectory.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/opencv/rgbd_sequence.hpp>

#include "alignment_pairs.hpp"

namespace pairs {

/// The true pose at a time, between two poses no more than 0.1 s apart: positions along a straight line, directions by slerp.
inline std::optional<Pose> true_pose(const apso::Trajectory& truth, double t) {
  const auto after =
      std::lower_bound(truth.begin(), truth.end(), t, [](const apso::StampedPose& p, double stamp) { return p.timestamp < stamp; });
  if (after == truth.end()) return std::nullopt;
  if (after->timestamp == t) return after->T_world_body;
  if (after == truth.begin()) return std::nullopt;
  const apso::StampedPose& before = *(after - 1);
  const double gap = after->timestamp - before.timestamp;
  if (!(gap <= 0.1)) return std::nullopt;
  const double s = (t - before.timestamp) / gap;
  const Eigen::Quaterniond q = apso::slerp(apso::quaternion(before.T_world_body), apso::quaternion(after->T_world_body), s);
  return apso::make_pose(apso::rotation(apso::unit(q)),
                         (1.0 - s) * before.T_world_body.translation() + s * after->T_world_body.translation());
}

class RecordingPairs {
 public:
  RecordingPairs(const std::string& folder, const apso::opencv::CameraModel& camera, const std::string& truth_file)
      : sequence_(folder, camera), truth_(apso::read_trajectory(truth_file)) {}

  /// Calls f(pair) for pairs that many frames apart, `most` at most, evenly spaced. Frames without truth are left out.
  template <class F>
  void each(int step, int most, const F& f) const {
    const int all = sequence_.size() - step;
    for (int n = 0; n < std::min(most, all); ++n) {
      const int i = most < all ? n * (all - 1) / std::max(1, most - 1) : n;
      const apso::opencv::SequenceFrame a = sequence_.frame(i);
      const apso::opencv::SequenceFrame b = sequence_.frame(i + step);
      const std::optional<Pose> Ta = true_pose(truth_, a.timestamp);
      const std::optional<Pose> Tb = true_pose(truth_, b.timestamp);
      if (!a.ok() || !b.ok() || !Ta || !Tb) continue;
      Pair p;
      p.T_current_reference = apso::inverse(*Tb) * *Ta;
      p.step = step;
      take(a, p.reference);
      take(b, p.current);
      f(p);
    }
  }

 private:
  static void take(const apso::opencv::SequenceFrame& f, Image8& out) {
    out.intensity = f.intensity;
    out.depth = f.depth;
    out.grey.resize(f.gray.cols, f.gray.rows);
    out.probability.assign(f.gray.cols, f.gray.rows, 0.0F);
    for (int y = 0; y < f.gray.rows; ++y) std::copy(f.gray[y], f.gray[y] + f.gray.cols, out.grey.row(y));
  }

  apso::opencv::RgbdSequence sequence_;
  apso::Trajectory truth_;
};

}  // namespace pairs
