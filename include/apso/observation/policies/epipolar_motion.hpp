/// \file
/// Motion from tracks that leave their epipolar line (the moving-consistency check of DS-SLAM, Yu et al., IROS 2018),
/// with a guard for pure rotation, where no epipolar line exists.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/geometry/carried_log_odds.hpp>
#include <apso/observation/geometry/epipolar_lines.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/options.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

inline constexpr double kEpipolarSpan = 0.2;  ///< tracks are compared with where they were this long ago [s]: a fast turn stays in view

struct EpipolarMotionOptions {
  DepthRange depth;     ///< depth that is used
  double moving = 2.5;  ///< a track this far from its line, or from its prediction, moves as likely as not [px]
  int dilation = 4;     ///< the mask is widened by this [px]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("depth", s.depth);
    v("moving", s.moving, 0.01, 100.0);
    v("dilation", s.dilation, 0, 200);
  }
};

/// How the last frame was judged.
enum class EpipolarModel {
  None,       ///< too few tracks
  Lines,      ///< by distance to epipolar lines
  Prediction  ///< the camera only turned or stood: by distance to the position predicted from pose and depth
};

/// Finds tracks that break the epipolar geometry of the camera's motion and grows them over their surfaces.
///
/// Blind to motion along the epipolar lines, as of somebody who walks ahead of a camera that moves forward, and to
/// everything without tracks: that is unknown. When the flow that is left without the rotation of the prior is small,
/// a fundamental matrix would fit anything; then tracks are compared with their prediction from depth and prior pose.
class EpipolarMotion : public PolicyOperators {
 public:
  using Options = EpipolarMotionOptions;

  explicit EpipolarMotion(const Pinhole& camera, const EpipolarMotionOptions& options = {})
      : options_(options), reducer_(camera, kMotionWidth, options.depth) {
    validate(options, "epipolar");
    rules_.dilation = options.dilation;
  }

  void observe(const AnyFrame& frame, const AnyPose& T_world_camera_prior, const AnyTracks& tracks, DynamicMask& out) {
    const Pose& prior = T_world_camera_prior;
    const Pinhole& small = reducer_.small();
    reducer_.depth(frame, depth_);
    const std::vector<PointTrack>& list = tracks.in(tracks_);
    const double dt = clock_.tick(frame.timestamp);
    probability_.assign(small.width, small.height, 0.0F);
    known_.assign(small.width, small.height, 0);
    model_ = EpipolarModel::None;
    const Snapshot* past = reference();
    if (past != nullptr) judge(list, *past, prior);
    filter_.update(depth_, small, prior, dt, probability_, known_);
    maker_.make(depth_, probability_, known_, small, reducer_.factor(), reducer_.camera().width, reducer_.camera().height, rules_, out);
    keep(list, prior);
  }
  void remember(const AnyFrame&, const AnyPose& T_world_camera, const DynamicMask&) {
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
  static constexpr std::size_t kMinPairs = 20;  // fewer tracks say nothing
  static constexpr std::size_t kMaximum = 32;   // frames that are kept at most
  static constexpr double kMinParallax = 3.0;   // below this median flow without the rotation there are no lines [px]
  static constexpr int kRadius = 10;            // a track speaks for the surface this far around it [px]

  struct TrackPoint {
    std::int64_t id;
    float x, y;  // [px]
    float z;     // [m], 0 without depth
  };
  struct Snapshot {
    double time = 0;
    Pose T_world_camera = identity_pose();
    std::vector<TrackPoint> points;  // sorted by id
  };

  [[nodiscard]] const Snapshot* reference() const {
    const Snapshot* best = history_.empty() ? nullptr : &history_.front();
    for (const Snapshot& s : history_) {
      if (clock_.now() - s.time >= kEpipolarSpan) best = &s;
    }
    return best;
  }
  [[nodiscard]] float depth_at(float x, float y) const {
    const int i = small_pixel(x, y, reducer_.factor(), depth_.width(), depth_.height());
    return i >= 0 ? depth_.data()[i] : 0.0F;
  }
  void keep(const std::vector<PointTrack>& tracks, const Pose& T_world_camera) {
    while (history_.size() > 1 && (history_.size() >= kMaximum || clock_.now() - history_[1].time >= kEpipolarSpan)) {
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
      const auto it =
          std::lower_bound(past.points.begin(), past.points.end(), t.id, [](const TrackPoint& p, std::int64_t id) { return p.id < id; });
      if (it == past.points.end() || it->id != t.id) continue;
      pairs_.push_back({{static_cast<double>(it->x), static_cast<double>(it->y)}, {static_cast<double>(t.x), static_cast<double>(t.y)}});
      past_depth_.push_back(it->z);
    }
    if (pairs_.size() < kMinPairs) return;

    const Pinhole& camera = reducer_.camera();
    const Pose T = compose(inverse(T_world_camera), past.T_world_camera);
    const Eigen::Matrix3d R = rotation(T);
    flow_.clear();
    for (const PointPair& p : pairs_) {
      const Eigen::Vector3d X = R * camera.unproject(p.past.x(), p.past.y(), 1.0);
      if (X.z() > 0.05) flow_.push_back(norm(p.current - camera.project(X)));
    }
    distance_.assign(pairs_.size(), -1.0);
    Eigen::Matrix3d F;
    if (upper_median(flow_) >= kMinParallax && lines_.find(pairs_, F)) {
      model_ = EpipolarModel::Lines;
      for (std::size_t i = 0; i < pairs_.size(); ++i) distance_[i] = epipolar_distance(F, pairs_[i]);
    } else {
      model_ = EpipolarModel::Prediction;
      for (std::size_t i = 0; i < pairs_.size(); ++i) {
        if (!(past_depth_[i] > 0)) continue;
        const Eigen::Vector3d X =
            transform(T, camera.unproject(pairs_[i].past.x(), pairs_[i].past.y(), static_cast<double>(past_depth_[i])));
        if (X.z() > 0.05) distance_[i] = norm(pairs_[i].current - camera.project(X));
      }
    }
    spread();
  }

  // Every track votes for the surface around it; the noise of a single track is smoothed by its neighbours.
  void spread() {
    const int w = depth_.width();
    const int h = depth_.height();
    const int factor = reducer_.factor();
    moves_.assign(w, h, 0.0F);
    votes_.assign(w, h, 0.0F);
    const int reach = std::max(1, kRadius / factor);
    const double m2 = options_.moving * options_.moving;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      if (distance_[k] < 0) continue;
      const double d2 = distance_[k] * distance_[k];
      const auto p = static_cast<float>(d2 / (d2 + m2));
      const Eigen::Vector2d& point = pairs_[k].current;
      const int pixel = small_pixel(static_cast<float>(point.x()), static_cast<float>(point.y()), factor, w, h);
      if (pixel < 0 || !(depth_.data()[pixel] > 0)) continue;
      const int x = pixel % w;
      const int y = pixel / w;
      const float z = depth_(x, y);
      for (int j = std::max(0, y - reach); j <= std::min(h - 1, y + reach); ++j) {
        for (int i = std::max(0, x - reach); i <= std::min(w - 1, x + reach); ++i) {
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

  EpipolarMotionOptions options_;
  FrameReducer reducer_;
  RegionRules rules_;
  FrameClock clock_;
  TemporalEvidence filter_;
  EvidenceMask maker_;
  EpipolarLines lines_;
  EpipolarModel model_ = EpipolarModel::None;
  std::vector<Snapshot> history_;  // oldest first
  std::vector<Snapshot> spare_;
  std::vector<PointPair> pairs_;
  std::vector<float> past_depth_;
  std::vector<double> flow_;
  std::vector<double> distance_;
  std::vector<PointTrack> tracks_;
  Image<float> depth_;
  Image<float> moves_;
  Image<float> votes_;
  Image<float> probability_;
  Image<std::uint8_t> known_;
};

APSO_NAMESPACE_END
