// Pairs of frames of a recording with ground truth.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>

#include <Eigen/Dense>

#include <apso/evaluation/trajectory.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/math/se3.hpp>
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

/// Standard deviation of one axis of a true pose: what is left of each pose and the four before and behind it when a parabola is fitted.
struct TruthNoise {
  double position = 0;   ///< [m]
  double direction = 0;  ///< [rad]
};
inline TruthNoise truth_noise(const apso::Trajectory& truth) {
  constexpr int kHalf = 4;
  constexpr int kCount = 2 * kHalf + 1;
  Eigen::Matrix<double, kCount, 3> A;
  Eigen::Matrix<double, kCount, 6> y;
  Eigen::Matrix<double, 6, 1> squares = Eigen::Matrix<double, 6, 1>::Zero();
  int windows = 0;
  for (std::size_t i = kHalf; i + kHalf < truth.size(); ++i) {
    if (truth[i + kHalf].timestamp - truth[i - kHalf].timestamp > 0.5) continue;  // a parabola says little about a longer time
    const Pose inverse = apso::inverse(truth[i].T_world_body);
    for (int k = 0; k < kCount; ++k) {
      const apso::StampedPose& p = truth[i + static_cast<std::size_t>(k) - kHalf];
      const double t = p.timestamp - truth[i].timestamp;
      A.row(k) << 1, t, t * t;
      y.row(k) = apso::se3_log(apso::compose(inverse, p.T_world_body)).transpose();
    }
    squares += (y - A * A.colPivHouseholderQr().solve(y)).colwise().squaredNorm().transpose() / (kCount - 3);
    ++windows;
  }
  if (windows == 0) return {};
  squares /= windows;
  return {std::sqrt(squares.head<3>().mean()), std::sqrt(squares.tail<3>().mean())};
}

class RecordingPairs {
 public:
  /// \param offset added to the time of an image before the true pose is looked up [s]
  RecordingPairs(const std::string& folder, const apso::opencv::CameraModel& camera, const std::string& truth_file, double offset = 0)
      : sequence_(folder, camera), truth_(apso::read_trajectory(truth_file)), noise_(truth_noise(truth_)), offset_(offset) {}

  [[nodiscard]] const TruthNoise& noise() const { return noise_; }

  /// Calls f(pair) for pairs that many frames apart, `most` at most, evenly spaced. Frames without truth are left out.
  template <class F>
  void each(int step, int most, const F& f) const {
    const int all = sequence_.size() - step;
    for (int n = 0; n < std::min(most, all); ++n) {
      const int i = most < all ? n * (all - 1) / std::max(1, most - 1) : n;
      const apso::opencv::SequenceFrame a = sequence_.frame(i);
      const apso::opencv::SequenceFrame b = sequence_.frame(i + step);
      const std::optional<Pose> Ta = true_pose(truth_, a.timestamp + offset_);
      const std::optional<Pose> Tb = true_pose(truth_, b.timestamp + offset_);
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
  TruthNoise noise_;
  double offset_;
};

}  // namespace pairs
