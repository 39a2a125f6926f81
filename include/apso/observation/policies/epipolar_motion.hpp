/// \file
/// Motion from tracks that leave their epipolar line (the moving-consistency check of DS-SLAM, Yu et al., IROS 2018),
/// with a guard for pure rotation, where no epipolar line exists.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/linear_congruential.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/policies/temporal_filter.hpp>
#include <apso/options.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// A point in two images.
struct PointPair {
  Eigen::Vector2d past;     ///< [px]
  Eigen::Vector2d current;  ///< [px]
};

/// Distance of the current point to the epipolar line F past [px]; 0 where the line is not defined.
[[nodiscard]] inline double epipolar_distance(const Eigen::Matrix3d& F, const PointPair& p) {
  const Eigen::Vector3d line = times(F, Eigen::Vector3d(p.past.x(), p.past.y(), 1.0));
  const double n = std::sqrt(line.x() * line.x() + line.y() * line.y());
  return n > 1e-12 ? std::abs(line.x() * p.current.x() + line.y() * p.current.y() + line.z()) / n : 0.0;
}

/// Fundamental matrix of eight or more pairs by the normalised eight-point algorithm (Hartley, PAMI 1997):
/// current^T F past = 0, rank 2, Frobenius norm 1. False when the pairs do not determine it.
[[nodiscard]] inline bool eight_point(const std::vector<PointPair>& pairs, const std::vector<int>& chosen, Eigen::Matrix3d& F) {
  if (chosen.size() < 8) return false;
  const auto point = [&](int i, int image) -> const Eigen::Vector2d& {
    const PointPair& p = pairs[static_cast<std::size_t>(i)];
    return image == 0 ? p.past : p.current;
  };
  const auto n = static_cast<double>(chosen.size());
  Eigen::Matrix3d N[2];  // what makes the points of an image centred and of mean distance sqrt(2)
  for (int k = 0; k < 2; ++k) {
    double x = 0;
    double y = 0;
    for (int i : chosen) {
      x += point(i, k).x() / n;
      y += point(i, k).y() / n;
    }
    double spread = 0;
    for (int i : chosen) {
      const double dx = point(i, k).x() - x;
      const double dy = point(i, k).y() - y;
      spread += std::sqrt(dx * dx + dy * dy);
    }
    if (!(spread > 1e-9)) return false;
    const double s = std::sqrt(2.0) * n / spread;
    N[k] = zeros<Eigen::Matrix3d>();
    N[k](0, 0) = N[k](1, 1) = s;
    N[k](0, 2) = -s * x;
    N[k](1, 2) = -s * y;
    N[k](2, 2) = 1;
  }
  double A[9][9] = {};  // lower triangle
  for (int i : chosen) {
    const Eigen::Vector3d a = times(N[0], Eigen::Vector3d(point(i, 0).x(), point(i, 0).y(), 1.0));
    const Eigen::Vector3d b = times(N[1], Eigen::Vector3d(point(i, 1).x(), point(i, 1).y(), 1.0));
    double row[9];
    for (int k = 0; k < 9; ++k) row[k] = b(k / 3) * a(k % 3);
    for (int k = 0; k < 9; ++k) {
      for (int l = 0; l <= k; ++l) A[k][l] += row[k] * row[l];
    }
  }
  double values[9];
  double vectors[9][9];
  eigen_symmetric(A, values, vectors);
  if (!(values[1] > 1e-12 * values[8])) return false;
  Eigen::Matrix3d M;
  for (int k = 0; k < 9; ++k) M(k / 3, k % 3) = vectors[k][0];
  // the nearest matrix of rank 2 lacks the direction v of the smallest singular value: M - M v v^T
  double squared[3][3];
  double squares[3];
  double directions[3][3];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) squared[r][c] = M(0, r) * M(0, c) + M(1, r) * M(1, c) + M(2, r) * M(2, c);
  }
  eigen_symmetric(squared, squares, directions);
  for (int r = 0; r < 3; ++r) {
    double along = 0;
    for (int c = 0; c < 3; ++c) along += M(r, c) * directions[c][0];
    for (int c = 0; c < 3; ++c) M(r, c) -= along * directions[c][0];
  }
  F = times(transposed_times(N[1], M), N[0]);
  double sum = 0;
  for (int k = 0; k < 9; ++k) sum += F(k / 3, k % 3) * F(k / 3, k % 3);
  if (!(sum > 0) || !std::isfinite(sum)) return false;
  F = times(1.0 / std::sqrt(sum), F);
  return true;
}

struct EpipolarMotionOptions {
  int width = 160;             ///< width of the depth that regions grow on [px]
  DepthRange depth;            ///< depth that is used
  double span = 0.2;           ///< tracks are compared with where they were this long ago [s]
  double inlier = 1.0;         ///< a pair this close to its line agrees with the motion of the camera [px]
  double moving = 2.5;         ///< a track this far from its line, or from its prediction, moves [px]
  double least_parallax = 3.0; ///< below this median flow, after the rotation is taken out, there are no lines [px]
  int trials = 120;            ///< of the random search
  unsigned seed = 1;           ///< of the random search
  int min_pairs = 20;          ///< fewer tracks say nothing
  int radius = 10;             ///< a track speaks for the surface this far around it [px]
  TemporalFilterOptions filter;
  EvidenceMaskOptions mask;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("width", s.width, 16, 4096);
    v("depth", s.depth);
    v("span", s.span, 0.0, 10.0);
    v("inlier", s.inlier, 0.01, 100.0);
    v("moving", s.moving, 0.01, 100.0);
    v("least_parallax", s.least_parallax, 0.0, 1000.0);
    v("trials", s.trials, 1, 100000);
    v("seed", s.seed, 0U, 4294967295U);
    v("min_pairs", s.min_pairs, 8, 100000);
    v("radius", s.radius, 1, 200);
    v("filter", s.filter);
    v("mask", s.mask);
  }
};

/// How the last frame was judged.
enum class EpipolarModel {
  None,        ///< too few tracks
  Lines,       ///< by distance to epipolar lines
  Prediction   ///< the camera only turned or stood: by distance to the position predicted from pose and depth
};

/// Finds tracks that break the epipolar geometry of the camera's motion and grows them over their surfaces.
///
/// Blind to motion along the epipolar lines, as of somebody who walks ahead of a camera that moves forward, and to
/// everything without tracks: that is unknown. When the flow that is left without the rotation of the prior is small,
/// a fundamental matrix would fit anything; then tracks are compared with their prediction from depth and prior pose.
class EpipolarMotion {
 public:
  explicit EpipolarMotion(const Pinhole& camera, const EpipolarMotionOptions& options = {})
      : camera_(camera), options_(options), filter_(options.filter) {
    camera.validate();
    validate(options, "epipolar");
    factor_ = reduction_factor(camera, options.width);
    small_ = reduced_camera(camera, factor_);
  }

  void observe(const RgbdFrame& frame, const Pose& T_world_camera_prior, const std::vector<PointTrack>& tracks,
               DynamicMask& out) {
    expects(frame.depth.width == camera_.width && frame.depth.height == camera_.height,
            "EpipolarMotion: the depth image does not have the size of the camera");
    const double dt = clock_.tick(frame.timestamp);
    reduce_depth(frame.depth, factor_, options_.depth, small_.width, small_.height, depth_);
    probability_.assign(small_.width, small_.height, 0.0F);
    known_.assign(small_.width, small_.height, 0);
    model_ = EpipolarModel::None;
    const Snapshot* past = reference();
    if (past != nullptr) judge(tracks, *past, T_world_camera_prior);
    filter_.update(depth_, small_, T_world_camera_prior, dt, probability_, known_);
    maker_.make(depth_, probability_, known_, small_, factor_, camera_.width, camera_.height, options_.mask, out);
    keep(tracks, T_world_camera_prior);
  }
  void remember(const RgbdFrame&, const Pose& T_world_camera, const DynamicMask&) {
    if (history_.empty()) return;
    history_.back().T_world_camera = T_world_camera;
    filter_.correct(T_world_camera);
  }
  void reset() {
    history_.clear();
    filter_.reset();
    clock_ = {};
    model_ = EpipolarModel::None;
  }
  [[nodiscard]] EpipolarModel model() const { return model_; }

 private:
  struct TrackPoint {
    std::int64_t id;
    float x, y;  // [px]
    float z;     // [m], 0 without depth
  };
  struct Snapshot {
    double time = 0;
    Pose T_world_camera = Pose::Identity();
    std::vector<TrackPoint> points;  // sorted by id
  };

  [[nodiscard]] const Snapshot* reference() const {
    const Snapshot* best = history_.empty() ? nullptr : &history_.front();
    for (const Snapshot& s : history_) {
      if (clock_.now() - s.time >= options_.span) best = &s;
    }
    return best;
  }
  [[nodiscard]] float depth_at(float x, float y) const {
    const float u = (x + 0.5F) / static_cast<float>(factor_);
    const float v = (y + 0.5F) / static_cast<float>(factor_);
    const bool inside = u >= 0 && v >= 0 && u < static_cast<float>(small_.width) && v < static_cast<float>(small_.height);
    return inside ? depth_(static_cast<int>(u), static_cast<int>(v)) : 0.0F;
  }
  void keep(const std::vector<PointTrack>& tracks, const Pose& T_world_camera) {
    while (history_.size() > 1 && (history_.size() >= 32 || clock_.now() - history_[1].time >= options_.span)) {
      spare_.push_back(std::move(history_.front()));  // its buffer is used again
      history_.erase(history_.begin());
    }
    Snapshot s;
    if (!spare_.empty()) {
      s = std::move(spare_.back());
      spare_.pop_back();
    }
    s.time = clock_.now();
    s.T_world_camera = T_world_camera;
    s.points.clear();
    for (const PointTrack& t : tracks) {
      if (std::isfinite(t.x) && std::isfinite(t.y)) s.points.push_back({t.id, t.x, t.y, depth_at(t.x, t.y)});
    }
    std::sort(s.points.begin(), s.points.end(), [](const TrackPoint& a, const TrackPoint& b) { return a.id < b.id; });
    history_.push_back(std::move(s));
  }

  void judge(const std::vector<PointTrack>& tracks, const Snapshot& past, const Pose& T_world_camera) {
    pairs_.clear();
    past_depth_.clear();
    for (const PointTrack& t : tracks) {
      if (!std::isfinite(t.x) || !std::isfinite(t.y)) continue;
      const auto it = std::lower_bound(past.points.begin(), past.points.end(), t.id,
                                       [](const TrackPoint& p, std::int64_t id) { return p.id < id; });
      if (it == past.points.end() || it->id != t.id) continue;
      pairs_.push_back({{static_cast<double>(it->x), static_cast<double>(it->y)},
                        {static_cast<double>(t.x), static_cast<double>(t.y)}});
      past_depth_.push_back(it->z);
    }
    if (static_cast<int>(pairs_.size()) < options_.min_pairs) return;

    const Pose T = compose(inverse(T_world_camera), past.T_world_camera);
    const Eigen::Matrix3d R = rotation(T);
    flow_.clear();
    for (const PointPair& p : pairs_) {
      const Eigen::Vector3d X = times(R, camera_.unproject(p.past.x(), p.past.y(), 1.0));
      if (X.z() > 0.05) flow_.push_back(norm(minus(p.current, camera_.project(X))));
    }
    distance_.assign(pairs_.size(), -1.0);
    Eigen::Matrix3d F;
    if (upper_median(flow_) >= options_.least_parallax && find_lines(F)) {
      model_ = EpipolarModel::Lines;
      for (std::size_t i = 0; i < pairs_.size(); ++i) distance_[i] = epipolar_distance(F, pairs_[i]);
    } else {
      model_ = EpipolarModel::Prediction;
      for (std::size_t i = 0; i < pairs_.size(); ++i) {
        if (!(past_depth_[i] > 0)) continue;
        const Eigen::Vector3d X = transform(T, camera_.unproject(pairs_[i].past.x(), pairs_[i].past.y(), static_cast<double>(past_depth_[i])));
        if (X.z() > 0.05) distance_[i] = norm(minus(pairs_[i].current, camera_.project(X)));
      }
    }
    spread();
  }

  // Random samples of eight, the most inliers win, then all of them once more.
  [[nodiscard]] bool find_lines(Eigen::Matrix3d& F) {
    LinearCongruential random(options_.seed * 2654435761U + 1U);
    const auto count = static_cast<std::uint32_t>(pairs_.size());
    std::size_t most = 0;
    Eigen::Matrix3d candidate;
    for (int trial = 0; trial < options_.trials; ++trial) {
      sample_.clear();
      while (sample_.size() < 8) {
        const int i = static_cast<int>((random() >> 8) % count);
        if (std::find(sample_.begin(), sample_.end(), i) == sample_.end()) sample_.push_back(i);
      }
      if (!eight_point(pairs_, sample_, candidate)) continue;
      std::size_t n = 0;
      for (const PointPair& p : pairs_) n += epipolar_distance(candidate, p) <= options_.inlier ? 1U : 0U;
      if (n > most) {
        most = n;
        F = candidate;
      }
    }
    if (most < 16) return false;
    for (int again = 0; again < 2; ++again) {
      sample_.clear();
      for (std::size_t i = 0; i < pairs_.size(); ++i) {
        if (epipolar_distance(F, pairs_[i]) <= options_.inlier) sample_.push_back(static_cast<int>(i));
      }
      if (!eight_point(pairs_, sample_, candidate)) break;
      F = candidate;
    }
    return true;
  }

  // Every track votes for the surface around it; the noise of a single track is smoothed by its neighbours.
  void spread() {
    moves_.assign(small_.width, small_.height, 0.0F);
    votes_.assign(small_.width, small_.height, 0.0F);
    const int reach = std::max(1, options_.radius / factor_);
    const double m2 = options_.moving * options_.moving;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      if (distance_[k] < 0) continue;
      const double d2 = distance_[k] * distance_[k];
      const auto p = static_cast<float>(d2 / (d2 + m2));
      const auto x = static_cast<int>((pairs_[k].current.x() + 0.5) / factor_);
      const auto y = static_cast<int>((pairs_[k].current.y() + 0.5) / factor_);
      if (x < 0 || y < 0 || x >= small_.width || y >= small_.height || !(depth_(x, y) > 0)) continue;
      const float z = depth_(x, y);
      for (int j = std::max(0, y - reach); j <= std::min(small_.height - 1, y + reach); ++j) {
        for (int i = std::max(0, x - reach); i <= std::min(small_.width - 1, x + reach); ++i) {
          if (!(std::abs(depth_(i, j) - z) <= same_surface(z))) continue;
          moves_(i, j) += p;
          votes_(i, j) += 1.0F;
        }
      }
    }
    for (std::size_t i = 0; i < votes_.size(); ++i) {
      if (!(votes_.data()[i] > 0)) continue;
      known_.data()[i] = 1;
      probability_.data()[i] = moves_.data()[i] / votes_.data()[i];
    }
  }

  Pinhole camera_;
  Pinhole small_;
  EpipolarMotionOptions options_;
  int factor_ = 1;
  FrameClock clock_;
  TemporalEvidence filter_;
  EvidenceMask maker_;
  EpipolarModel model_ = EpipolarModel::None;
  std::vector<Snapshot> history_;  // oldest first
  std::vector<Snapshot> spare_;
  std::vector<PointPair> pairs_;
  std::vector<float> past_depth_;
  std::vector<double> flow_;
  std::vector<double> distance_;
  std::vector<int> sample_;
  Image<float> depth_;
  Image<float> moves_;
  Image<float> votes_;
  Image<float> probability_;
  Image<std::uint8_t> known_;
};

APSO_NAMESPACE_END
