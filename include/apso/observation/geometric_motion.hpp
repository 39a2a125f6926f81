/// \file
/// The dynamic policy that needs no network: what stands where past views saw free space has moved.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/background_registration.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/flow_residual.hpp>
#include <apso/observation/free_space.hpp>
#include <apso/observation/low_res_depth.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/observation/track_claims.hpp>
#include <apso/options.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/rgbd_frame.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

struct GeometricMotionOptions {
  int width = 160;                ///< width of the images that are worked on [px]; the frame is reduced by a whole factor
  DepthRange depth;               ///< depth that is used
  int references = 12;            ///< past views that are kept
  double interval = 0.08;         ///< shortest time between two kept views [s]
  double memory = 6.0;            ///< age at which a view is dropped [s]; what stands still that long is static again
  FreeSpaceOptions free_space;
  bool correct_prior = true;      ///< register the background first, to take the error out of the pose prior
  BackgroundRegistrationOptions registration;
  double flow_residual = 3.0;     ///< a track this far from its static prediction is moving [px]
  double flow_share = 0.15;       ///< ... and further than this share of the motion that was expected
  double flow_span = 0.15;        ///< ... and looks back this long, for tracks that live so long [s]
  int flow_reach = 10;            ///< how far a track speaks for the surface it is on [small px]
  int flow_tracks = 3;            ///< so many moving tracks must agree on a surface
  double flow_evidence = 0.9;     ///< log-odds that many of them give it per frame; few give less
  double persistence = 0.75;      ///< share of the past log-odds that is kept per frame where there is new evidence
  double hold = 1.0;              ///< time constant of the past log-odds where there is no new evidence [s]
  double threshold = 0.6;         ///< log-odds from which a pixel is dynamic; two frames that agree reach it
  int reach = 12;                 ///< how far a region grows over unknown pixels [small px]
  double depth_span = 0.4;        ///< ... and over which depth difference to its seed [m]
  int min_pixels = 24;            ///< smaller regions are dropped [small px]
  double min_area = 0.015;        ///< regions that are smaller in the world are dropped [m^2]
  int dilation = 4;               ///< the mask is widened by this [px]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("width", s.width, 16, 4096);
    v("depth", s.depth);
    v("references", s.references, 1, 1000);
    v("interval", s.interval, 0.0, 60.0);
    v("memory", s.memory, 0.0, 3600.0);
    v("free_space", s.free_space);
    v("correct_prior", s.correct_prior);
    v("registration", s.registration);
    v("flow_residual", s.flow_residual, 0.1, 1000.0);
    v("flow_share", s.flow_share, 0.0, 10.0);
    v("flow_span", s.flow_span, 0.0, 10.0);
    v("flow_reach", s.flow_reach, 0, 254);
    v("flow_tracks", s.flow_tracks, 2, 255);
    v("flow_evidence", s.flow_evidence, 0.0, 4.0);
    v("persistence", s.persistence, 0.0, 0.99);
    v("hold", s.hold, 1e-3, 60.0);
    v("threshold", s.threshold, 0.01, 4.0);
    v("reach", s.reach, 0, 254);
    v("depth_span", s.depth_span, 0.0, 10.0);
    v("min_pixels", s.min_pixels, 1, 1000000);
    v("min_area", s.min_area, 0.0, 100.0);
    v("dilation", s.dilation, 0, 200);
  }
};

/// Finds moving regions of RGB-D frames from multi-view depth and sparse tracks, at low resolution.
///
/// Every past view has seen that the space in front of its surfaces was free. A point of the current frame in such
/// space has come since then. Views of different age are kept, so fast movers are found by young views, slow ones by
/// old views. A point behind a past surface was hidden and says nothing. It works with a resting or purely rotating
/// camera as well, because it compares depth and not flow.
///
/// Per frame: observe() with a prior pose, use the mask, then remember() with the final pose.
class GeometricMotion {
 public:
  explicit GeometricMotion(const Pinhole& camera, const GeometricMotionOptions& options = {})
      : camera_(camera), options_(options) {
    camera.validate();
    validate(options, "geometric_motion");
    factor_ = std::max(1, static_cast<int>(std::lround(static_cast<double>(camera.width) / options.width)));
    small_ = reduced_camera(camera, factor_);
    references_.reserve(static_cast<std::size_t>(options.references) + 1);
  }

  /// Labels a frame. Without past views everything is unknown (probability 0).
  /// \param T_world_camera_prior predicted pose; errors of a few centimetres and about a degree are corrected
  /// \param tracks points followed from the previous frame; may be empty
  /// \param out probability 1 inside moving regions (widened), falling to 0 at their border
  void observe(const RgbdFrame& frame, const Pose& T_world_camera_prior, const std::vector<PointTrack>& tracks,
               DynamicMask& out) {
    check(frame, T_world_camera_prior);
    const double last = time_;
    tick(frame.timestamp, true);
    forget();
    reduce_depth(frame.depth, factor_, options_.depth, small_.width, small_.height, depth_);
    observed_ = frame.depth.data;
    refined_ = T_world_camera_prior;
    registration_ = BackgroundRegistration{};
    registration_.T_world_camera = T_world_camera_prior;
    evidence_.clear(small_.width, small_.height);
    if (references_.empty()) {
      mask_.assign(small_.width, small_.height, 0);
      log_odds_.assign(small_.width, small_.height, 0.0F);
    } else {
      look_back(tracks);
      if (options_.correct_prior) correct_prior();
      for (const DepthReference& r : references_) {
        compare_with_view(depth_, small_, refined_, time_, r, options_.free_space, votes_, evidence_);
      }
      claim_from_tracks();
      update_log_odds(std::max(1e-3, time_ - last));
      label();
    }
    write(frame.depth.width, frame.depth.height, out);
    keep_tracks(tracks);
    previous_depth_ = depth_;
    previous_log_odds_ = log_odds_;
    previous_pose_ = refined_;
    has_previous_ = true;
  }

  /// Takes a frame into the memory, once its pose is final.
  /// \param mask what was dynamic in it; usually that of observe(), possibly combined with others
  void remember(const RgbdFrame& frame, const Pose& T_world_camera, const DynamicMask& mask) {
    check(frame, T_world_camera);
    expects(mask.probability.width() == frame.depth.width && mask.probability.height() == frame.depth.height,
            "GeometricMotion::remember: the mask has another size than the frame");
    const bool same = frame.timestamp == stamp_ && frame.depth.data == observed_;
    if (!same) {
      tick(frame.timestamp, false);
      reduce_depth(frame.depth, factor_, options_.depth, small_.width, small_.height, depth_);
    } else {
      previous_pose_ = T_world_camera;
      if (!history_.empty()) history_.back().T_world_camera = T_world_camera;
    }
    if (!references_.empty() && time_ - references_.back().time < options_.interval) return;
    DepthReference r;
    if (!pool_.empty()) {
      r = std::move(pool_.back());
      pool_.pop_back();
    }
    r.time = time_;
    r.T_world_camera = T_world_camera;
    r.depth = depth_;
    reduce_mask(mask.probability, r.dynamic);
    depth_limits(r.depth, r.limits);
    depth_normals(r.depth, small_, r.normals);
    references_.push_back(std::move(r));
    if (references_.size() > static_cast<std::size_t>(options_.references)) drop(least_useful());
  }

  /// Forgets everything.
  void reset() {
    while (!references_.empty()) drop(0);
    history_.clear();
    has_previous_ = false;
    observed_ = nullptr;
    time_ = stamp_ = 0;
    started_ = false;
  }

  /// Pose of the last observed frame after registration of the background; the prior where that failed.
  [[nodiscard]] Pose refined_prior() const { return refined_; }
  /// How that registration ended.
  [[nodiscard]] const BackgroundRegistration& registration() const { return registration_; }
  /// Small images of the last observed frame: depth, evidence, labels before they are widened.
  [[nodiscard]] const Image<float>& depth() const { return depth_; }
  [[nodiscard]] const FreeSpaceEvidence& evidence() const { return evidence_; }
  [[nodiscard]] const Image<std::uint8_t>& labels() const { return mask_; }
  [[nodiscard]] std::size_t reference_count() const { return references_.size(); }

 private:
  void check(const RgbdFrame& frame, const Pose& pose) const {
    expects(frame.depth.width == camera_.width && frame.depth.height == camera_.height && !frame.depth.empty(),
            "GeometricMotion: the depth image does not have the size of the camera");
    expects(is_finite(pose), "GeometricMotion: pose is not finite");
  }

  // Time in seconds that always grows, also for data without usable stamps (then 30 frames per second).
  void tick(double stamp, bool observing) {
    const bool usable = std::isfinite(stamp) && (!started_ || stamp > stamp_);
    if (!started_) {
      time_ = usable ? stamp : 0;
    } else if (usable) {
      time_ = std::max(time_ + 1e-4, time_ + (stamp - stamp_));
    } else if (observing || stamp != stamp_) {
      time_ += 1.0 / 30.0;
    }
    if (std::isfinite(stamp)) stamp_ = stamp;
    started_ = true;
  }

  void drop(std::size_t i) {
    pool_.push_back(std::move(references_[i]));
    references_.erase(references_.begin() + static_cast<std::ptrdiff_t>(i));
  }
  void forget() {
    while (!references_.empty() && time_ - references_.front().time > options_.memory) drop(0);
  }
  // The kept views are spread over the logarithm of their age: dense lately, sparse long ago.
  [[nodiscard]] std::size_t least_useful() const {
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 1; i + 1 < references_.size(); ++i) {
      const double gap = references_[i + 1].time - references_[i - 1].time;
      const double value = gap / (time_ - references_[i].time + 1e-3);
      if (value < least) {
        least = value;
        best = i;
      }
    }
    return best;
  }

  // Share of a grid of current points that falls into the view of a reference.
  [[nodiscard]] double overlap(const DepthReference& r) const {
    const Pose T = inverse(r.T_world_camera) * refined_;
    int n = 0;
    int inside = 0;
    for (int y = small_.height / 12; y < small_.height; y += std::max(1, small_.height / 6)) {
      for (int x = small_.width / 16; x < small_.width; x += std::max(1, small_.width / 8)) {
        if (!(depth_(x, y) > 0)) continue;
        ++n;
        const Eigen::Vector3d p = T * small_.unproject(x, y, static_cast<double>(depth_(x, y)));
        if (p.z() > 0.05) {
          const Eigen::Vector2d u = small_.project(p);
          inside += small_.contains(u.x(), u.y()) ? 1 : 0;
        }
      }
    }
    return n > 0 ? static_cast<double>(inside) / n : 0.0;
  }

  // A young, a middle-aged and an old view that still see the scene.
  void correct_prior() {
    chosen_.clear();
    chosen_.push_back(&references_.back());
    const double ages[2] = {0.5, 1.5};
    for (int k = 1; k >= 0; --k) {
      const DepthReference* best = nullptr;
      double most = 0.4;
      for (const DepthReference& r : references_) {
        if (time_ - r.time < ages[k] || std::find(chosen_.begin(), chosen_.end(), &r) != chosen_.end()) continue;
        const double o = overlap(r);
        if (o > most) {
          most = o;
          best = &r;
        }
      }
      if (best != nullptr) chosen_.push_back(best);
    }
    registration_ = register_background(depth_, small_, refined_, chosen_, options_.registration);
    // People who fill the view can outweigh the background in depth; the tracks say whose motion was found. They lose
    // little by a correction of the pose, and most of their support when the motion is another body's.
    const double before = support(refined_);
    if (support(registration_.T_world_camera) >= 0.7 * before) {
      refined_ = registration_.T_world_camera;
    } else {
      registration_.status = Status::Diverged;
      registration_.T_world_camera = refined_;
    }
  }

  // Tracks that agree with a pose of the camera.
  [[nodiscard]] double support(const Pose& T_world_camera) {
    if (history_.empty()) return 0;
    const TrackSnapshot& past = history_.front();
    flow_residuals(spans_, camera_, inverse(T_world_camera) * past.T_world_camera, past.depth, factor_, flow_points_);
    return track_support(flow_points_, options_.flow_residual);
  }

  void update_log_odds(double dt) {
    const int w = small_.width;
    const int h = small_.height;
    log_odds_.resize(w, h);
    const auto keep_evidence = static_cast<float>(options_.persistence);
    const auto flow_evidence = static_cast<float>(options_.flow_evidence);
    constexpr float all_tracks = 8;  // so many that agree are as sure as any number
    const auto keep_blind = static_cast<float>(std::exp(-dt / options_.hold));
    const Pose T = inverse(previous_pose_) * refined_;
    const Eigen::Matrix3f R = T.linear().cast<float>();
    const Eigen::Vector3f t = T.translation().cast<float>();
    const auto fx = static_cast<float>(small_.fx);
    const auto fy = static_cast<float>(small_.fy);
    const auto cx = static_cast<float>(small_.cx);
    const auto cy = static_cast<float>(small_.cy);
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        const float z = depth_(x, y);
        float past = 0;
        if (has_previous_ && z > 0) {
          const Eigen::Vector3f ray((static_cast<float>(x) - cx) / fx, (static_cast<float>(y) - cy) / fy, 1.0F);
          const Eigen::Vector3f p = z * (R * ray) + t;
          if (p.z() > 0.05F) {
            const float u = fx * p.x() / p.z() + cx + 0.5F;
            const float v = fy * p.y() / p.z() + cy + 0.5F;
            if (u >= 0 && v >= 0 && u < static_cast<float>(w) && v < static_cast<float>(h)) {
              const int iu = static_cast<int>(u);
              const int iv = static_cast<int>(v);
              if (std::abs(previous_depth_(iu, iv) - p.z()) < 0.1F + 3.0F * depth_sigma(z)) {
                past = previous_log_odds_(iu, iv);
              }
            }
          }
        }
        const float appeared = evidence_.appeared(x, y);
        // a track at rest counts as a view that saw the surface at rest
        const std::uint8_t claim = claims_(x, y);
        const float same = evidence_.same_static(x, y) + (claim == kClaimedStatic ? 1.0F : 0.0F);
        // a static surface must be confirmed by about three views to outweigh one view that saw through the point
        // and one frame alone, whose pose may be wrong, cannot make a point dynamic
        float now = std::clamp(1.2F * (appeared - 0.35F * same), -1.5F, 0.9F * static_cast<float>(options_.threshold));
        // several tracks that move can: then "the same surface" was seen only because the body slides along itself
        const bool moves = claim > kClaimedStatic;
        if (moves) now = std::max(now, flow_evidence * std::min(1.0F, static_cast<float>(claim) / all_tracks));
        const float keep = appeared + same > 0 || moves ? keep_evidence : keep_blind;
        const float before = moves ? std::max(past, 0.0F) : past;
        log_odds_(x, y) = z > 0 ? std::clamp(keep * before + now, -4.0F, 5.0F) : 0.0F;
      }
    }
  }

  // Tracks are compared with where they were some frames ago: the motion of a walking person adds up, noise does not.
  void look_back(const std::vector<PointTrack>& tracks) {
    spans_.clear();
    if (history_.empty()) return;
    const TrackSnapshot& past = history_.front();
    for (const PointTrack& t : tracks) {
      const auto it = std::lower_bound(past.points.begin(), past.points.end(), t.id,
                                       [](const TrackPoint& p, std::int64_t id) { return p.id < id; });
      if (it == past.points.end() || it->id != t.id) continue;
      PointTrack span = t;
      span.previous_x = it->x;
      span.previous_y = it->y;
      span.age = 1;
      spans_.push_back(span);
    }
  }

  void claim_from_tracks() {
    claims_.assign(small_.width, small_.height, 0);
    if (history_.empty()) return;
    const TrackSnapshot& past = history_.front();
    flow_residuals(spans_, camera_, inverse(refined_) * past.T_world_camera, past.depth, factor_, flow_points_);
    mark_moving(options_.flow_residual, options_.flow_share, residuals_, flow_points_);
    claim_surfaces(flow_points_, depth_, factor_, options_.flow_reach, static_cast<float>(options_.depth_span),
                   options_.flow_tracks, claims_, scratch_);
  }

  void keep_tracks(const std::vector<PointTrack>& tracks) {
    TrackSnapshot s;
    while (!history_.empty() &&
           (history_.size() >= kMostSnapshots || time_ - history_.front().time > options_.flow_span)) {
      s = std::move(history_.front());  // its buffers are used again
      history_.erase(history_.begin());
    }
    s.time = time_;
    s.T_world_camera = refined_;
    s.depth = depth_;
    s.points.clear();
    for (const PointTrack& t : tracks) s.points.push_back({t.id, t.x, t.y});
    std::sort(s.points.begin(), s.points.end(), [](const TrackPoint& a, const TrackPoint& b) { return a.id < b.id; });
    history_.push_back(std::move(s));
  }

  void label() {
    const int w = small_.width;
    const int h = small_.height;
    mask_.resize(w, h);
    may_join_.resize(w, h);
    const auto threshold = static_cast<float>(options_.threshold);
    for (std::size_t i = 0; i < mask_.size(); ++i) {
      const float l = log_odds_.data()[i];
      const bool valid = depth_.data()[i] > 0;
      mask_.data()[i] = valid && l > threshold ? 1 : 0;
      const bool moves = claims_.data()[i] > kClaimedStatic;
      may_join_.data()[i] = valid && l > -0.5F && (moves || evidence_.same_static.data()[i] < 1.0F) ? 1 : 0;
    }
    const auto area = static_cast<float>(1.0 / (small_.fx * small_.fy));
    open_2x2(mask_, opened_);
    remove_small(depth_, area, options_.min_pixels, static_cast<float>(options_.min_area), mask_, scratch_);
    grow_region(depth_, may_join_, options_.reach, static_cast<float>(options_.depth_span), mask_, scratch_);
    fill_depth_holes(depth_, 0, mask_, scratch_);
  }

  void write(int width, int height, DynamicMask& out) {
    const int w = small_.width;
    const int h = small_.height;
    wide_ = mask_;
    dilate(wide_, (options_.dilation + factor_ / 2) / factor_, dilation_scratch_);
    out.probability.resize(width, height);
    out.known.resize(width, height);
    columns_.resize(static_cast<std::size_t>(width));
    shares_.resize(static_cast<std::size_t>(width));
    nearest_.resize(static_cast<std::size_t>(width));
    const float scale = 1.0F / static_cast<float>(factor_);
    for (int x = 0; x < width; ++x) {
      const float s = std::clamp((static_cast<float>(x) + 0.5F) * scale - 0.5F, 0.0F, static_cast<float>(w - 1));
      const int i = std::min(static_cast<int>(s), std::max(0, w - 2));
      columns_[static_cast<std::size_t>(x)] = i;
      shares_[static_cast<std::size_t>(x)] = s - static_cast<float>(i);
      nearest_[static_cast<std::size_t>(x)] = std::min(x / factor_, w - 1);
    }
    line_.assign(static_cast<std::size_t>(w) + 1, 0.0F);
    seen_.assign(static_cast<std::size_t>(w), 0);
    int seen_row = -1;
    for (int y = 0; y < height; ++y) {
      const float s = std::clamp((static_cast<float>(y) + 0.5F) * scale - 0.5F, 0.0F, static_cast<float>(h - 1));
      const int j = std::min(static_cast<int>(s), std::max(0, h - 2));
      const float share = s - static_cast<float>(j);
      const std::uint8_t* a = wide_.row(j);
      const std::uint8_t* b = wide_.row(std::min(j + 1, h - 1));
      for (int x = 0; x < w; ++x) {
        line_[static_cast<std::size_t>(x)] =
            static_cast<float>(a[x]) + share * (static_cast<float>(b[x]) - static_cast<float>(a[x]));
      }
      line_[static_cast<std::size_t>(w)] = line_[static_cast<std::size_t>(w) - 1];
      float* p = out.probability.row(y);
      for (int x = 0; x < width; ++x) {
        const auto X = static_cast<std::size_t>(x);
        const auto i = static_cast<std::size_t>(columns_[X]);
        p[x] = line_[i] + shares_[X] * (line_[i + 1] - line_[i]);
      }
      const int row = std::min(y / factor_, h - 1);
      if (row != seen_row) {
        seen_row = row;
        for (int x = 0; x < w; ++x) {
          const bool e = evidence_.appeared(x, row) + evidence_.same_static(x, row) + evidence_.same_dynamic(x, row) > 0;
          seen_[static_cast<std::size_t>(x)] = e || wide_(x, row) != 0 ? 1 : 0;
        }
      }
      std::uint8_t* k = out.known.row(y);
      for (int x = 0; x < width; ++x) {
        k[x] = seen_[static_cast<std::size_t>(nearest_[static_cast<std::size_t>(x)])];
      }
    }
  }

  // Small labels of a full mask, with the widening taken off again.
  void reduce_mask(const Image<float>& probability, Image<std::uint8_t>& out) {
    out.resize(small_.width, small_.height);
    const int c = factor_ / 2;
    for (int y = 0; y < small_.height; ++y) {
      const float* p = probability.row(y * factor_ + c);
      for (int x = 0; x < small_.width; ++x) out(x, y) = p[x * factor_ + c] >= 0.5F ? 0 : 1;  // inverted
    }
    dilate(out, (options_.dilation + factor_ / 2) / factor_, dilation_scratch_);
    for (std::size_t i = 0; i < out.size(); ++i) out.data()[i] = out.data()[i] != 0 ? 0 : 1;
  }

  struct TrackPoint {
    std::int64_t id;
    float x;
    float y;
  };
  struct TrackSnapshot {
    double time = 0;
    Pose T_world_camera = Pose::Identity();
    Image<float> depth;
    std::vector<TrackPoint> points;  // sorted by id
  };
  static constexpr std::size_t kMostSnapshots = 8;

  Pinhole camera_;
  Pinhole small_;
  GeometricMotionOptions options_;
  int factor_ = 1;

  std::vector<DepthReference> references_;  // oldest first
  std::vector<DepthReference> pool_;        // buffers to use again
  std::vector<const DepthReference*> chosen_;
  bool started_ = false;
  double time_ = 0;
  double stamp_ = 0;
  const float* observed_ = nullptr;

  Image<float> depth_;
  FreeSpaceEvidence evidence_;
  Image<float> votes_;
  Image<float> log_odds_;
  Image<std::uint8_t> mask_;
  Image<std::uint8_t> may_join_;
  Image<std::uint8_t> opened_;
  Image<std::uint8_t> wide_;
  RegionScratch scratch_;
  std::vector<std::uint8_t> dilation_scratch_;
  std::vector<float> residuals_;
  std::vector<FlowPoint> flow_points_;
  Image<std::uint8_t> claims_;
  std::vector<PointTrack> spans_;
  std::vector<TrackSnapshot> history_;  // oldest first
  std::vector<int> columns_;
  std::vector<int> nearest_;
  std::vector<float> shares_;
  std::vector<float> line_;
  std::vector<std::uint8_t> seen_;

  Pose refined_ = Pose::Identity();
  BackgroundRegistration registration_;
  bool has_previous_ = false;
  Image<float> previous_depth_;
  Image<float> previous_log_odds_;
  Pose previous_pose_ = Pose::Identity();
};

APSO_NAMESPACE_END
