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
#include <apso/observation/geometry/background_registration.hpp>
#include <apso/observation/geometry/carried_log_odds.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/geometry/flow_residual.hpp>
#include <apso/observation/geometry/free_space.hpp>
#include <apso/observation/geometry/low_res_depth.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/geometry/track_claims.hpp>
#include <apso/observation/geometry/track_history.hpp>
#include <apso/options.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/frame.hpp>
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
      : camera_(camera), options_(options), history_(options.flow_span) {
    camera.validate();
    validate(options, "geometric_motion");
    factor_ = reduction_factor(camera, options.width);
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
    const double dt = tick(frame.timestamp);
    forget();
    reduce_depth(frame.depth, factor_, options_.depth, small_.width, small_.height, depth_);
    observed_ = frame.depth.data;
    refined_ = T_world_camera_prior;
    registration_ = BackgroundRegistration{};
    registration_.T_world_camera = T_world_camera_prior;
    evidence_.clear(small_.width, small_.height);
    if (references_.empty()) {
      mask_.assign(small_.width, small_.height, 0);
      log_odds_.update(depth_, small_, refined_, [](int, int, float) { return 0.0F; });
    } else {
      history_.look_back(tracks);
      if (options_.correct_prior) correct_prior();
      for (const DepthReference& r : references_) {
        compare_with_view(depth_, small_, refined_, clock_.now(), r, options_.free_space, votes_, evidence_);
      }
      claim_from_tracks();
      update_log_odds(std::max(1e-3, dt));
      label();
    }
    write(frame.depth.width, frame.depth.height, out);
    history_.keep(clock_.now(), refined_, depth_, tracks);
  }

  /// Takes a frame into the memory, once its pose is final.
  /// \param mask what was dynamic in it; usually that of observe(), possibly combined with others
  void remember(const RgbdFrame& frame, const Pose& T_world_camera, const DynamicMask& mask) {
    check(frame, T_world_camera);
    expects(mask.probability.width() == frame.depth.width && mask.probability.height() == frame.depth.height,
            "GeometricMotion::remember: the mask has another size than the frame");
    const bool same = frame.timestamp == stamp_ && frame.depth.data == observed_;
    if (!same) {
      if (frame.timestamp != stamp_) tick(frame.timestamp);
      reduce_depth(frame.depth, factor_, options_.depth, small_.width, small_.height, depth_);
    } else {
      log_odds_.correct(T_world_camera);
      history_.correct(T_world_camera);
    }
    if (!references_.empty() && clock_.now() - references_.back().time < options_.interval) return;
    DepthReference r;
    if (!pool_.empty()) {
      r = std::move(pool_.back());
      pool_.pop_back();
    }
    r.time = clock_.now();
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
    log_odds_.reset();
    observed_ = nullptr;
    clock_ = {};
    stamp_ = 0;
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

  double tick(double stamp) {
    stamp_ = stamp;
    return clock_.tick(stamp);
  }

  void drop(std::size_t i) {
    pool_.push_back(std::move(references_[i]));
    references_.erase(references_.begin() + static_cast<std::ptrdiff_t>(i));
  }
  void forget() {
    while (!references_.empty() && clock_.now() - references_.front().time > options_.memory) drop(0);
  }
  // The kept views are spread over the logarithm of their age: dense lately, sparse long ago.
  [[nodiscard]] std::size_t least_useful() const {
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 1; i + 1 < references_.size(); ++i) {
      const double gap = references_[i + 1].time - references_[i - 1].time;
      const double value = gap / (clock_.now() - references_[i].time + 1e-3);
      if (value < least) {
        least = value;
        best = i;
      }
    }
    return best;
  }

  // Share of a grid of current points that falls into the view of a reference.
  [[nodiscard]] double overlap(const DepthReference& r) const {
    const Pose T = compose(inverse(r.T_world_camera), refined_);
    int n = 0;
    int inside = 0;
    for (int y = small_.height / 12; y < small_.height; y += std::max(1, small_.height / 6)) {
      for (int x = small_.width / 16; x < small_.width; x += std::max(1, small_.width / 8)) {
        if (!(depth_(x, y) > 0)) continue;
        ++n;
        const Eigen::Vector3d p = transform(T, small_.unproject(x, y, static_cast<double>(depth_(x, y))));
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
        if (clock_.now() - r.time < ages[k] || std::find(chosen_.begin(), chosen_.end(), &r) != chosen_.end()) continue;
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
    history_.residuals(camera_, T_world_camera, factor_, flow_points_);
    return track_support(flow_points_, options_.flow_residual);
  }

  void claim_from_tracks() {
    history_.residuals(camera_, refined_, factor_, flow_points_);
    mark_moving(options_.flow_residual, options_.flow_share, residuals_, flow_points_);
    claim_surfaces(flow_points_, depth_, factor_, options_.flow_reach, static_cast<float>(options_.depth_span),
                   options_.flow_tracks, claims_, scratch_);
  }

  void update_log_odds(double dt) {
    const auto keep_evidence = static_cast<float>(options_.persistence);
    const auto keep_blind = static_cast<float>(std::exp(-dt / options_.hold));
    const auto flow_evidence = static_cast<float>(options_.flow_evidence);
    constexpr float all_tracks = 8;  // so many that agree are as sure as any number
    // one frame alone, whose pose may be wrong, cannot make a point dynamic
    const auto most = 0.9F * static_cast<float>(options_.threshold);
    log_odds_.update(depth_, small_, refined_, [&](int x, int y, float past) {
      if (!(depth_(x, y) > 0)) return 0.0F;
      const float appeared = evidence_.appeared(x, y);
      // a track at rest counts as a view that saw the surface at rest
      const std::uint8_t claim = claims_(x, y);
      const float same = evidence_.same_static(x, y) + (claim == kClaimedStatic ? 1.0F : 0.0F);
      // a static surface must be confirmed by about three views to outweigh one view that saw through the point
      float now = std::clamp(1.2F * (appeared - 0.35F * same), -1.5F, most);
      // several tracks that move can: then "the same surface" was seen only because the body slides along itself
      const bool moves = claim > kClaimedStatic;
      if (moves) {
        now = std::max(now, flow_evidence * std::min(1.0F, static_cast<float>(claim) / all_tracks));
        past = std::max(past, 0.0F);
      }
      const float keep = appeared + same > 0 || moves ? keep_evidence : keep_blind;
      return std::clamp(keep * past + now, -4.0F, 5.0F);
    });
  }

  void label() {
    const int w = small_.width;
    const int h = small_.height;
    mask_.resize(w, h);
    may_join_.resize(w, h);
    const auto threshold = static_cast<float>(options_.threshold);
    for (std::size_t i = 0; i < mask_.size(); ++i) {
      const float l = log_odds_.values().data()[i];
      const bool valid = depth_.data()[i] > 0;
      mask_.data()[i] = valid && l > threshold ? 1 : 0;
      const bool moves = claims_.data()[i] > kClaimedStatic;
      may_join_.data()[i] = valid && l > -0.5F && (moves || evidence_.same_static.data()[i] < 1.0F) ? 1 : 0;
    }
    const auto area = static_cast<float>(1.0 / (small_.fx * small_.fy));
    open_2x2(mask_, opened_);
    remove_small(depth_, area, options_.min_pixels, static_cast<float>(options_.min_area), mask_, scratch_);
    grow_region(depth_, may_join_, options_.reach, static_cast<float>(options_.depth_span), mask_, scratch_);
    fill_depth_holes(depth_, mask_, scratch_);
  }

  void write(int width, int height, DynamicMask& out) {
    wide_ = mask_;
    dilate(wide_, (options_.dilation + factor_ / 2) / factor_, dilation_scratch_);
    probability_.resize(small_.width, small_.height);
    known_.resize(small_.width, small_.height);
    for (std::size_t i = 0; i < wide_.size(); ++i) {
      const bool seen = evidence_.appeared.data()[i] + evidence_.same_static.data()[i] + evidence_.same_dynamic.data()[i] > 0;
      probability_.data()[i] = static_cast<float>(wide_.data()[i]);
      known_.data()[i] = seen || wide_.data()[i] != 0 ? 1 : 0;
    }
    enlarge_(probability_, known_, factor_, width, height, out);
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

  Pinhole camera_;
  Pinhole small_;
  GeometricMotionOptions options_;
  int factor_ = 1;

  std::vector<DepthReference> references_;  // oldest first
  std::vector<DepthReference> pool_;        // buffers to use again
  std::vector<const DepthReference*> chosen_;
  FrameClock clock_;
  double stamp_ = 0;  // of the frame that depth_ shows
  const float* observed_ = nullptr;

  Image<float> depth_;
  FreeSpaceEvidence evidence_;
  CarriedLogOdds log_odds_;
  TrackHistory history_;
  Image<float> votes_;
  Image<std::uint8_t> mask_;
  Image<std::uint8_t> may_join_;
  Image<std::uint8_t> opened_;
  Image<std::uint8_t> wide_;
  Image<float> probability_;
  Image<std::uint8_t> known_;
  MaskEnlarger enlarge_;
  RegionScratch scratch_;
  std::vector<std::uint8_t> dilation_scratch_;
  std::vector<float> residuals_;
  std::vector<FlowPoint> flow_points_;
  Image<std::uint8_t> claims_;

  Pose refined_ = Pose::Identity();
  BackgroundRegistration registration_;
};

APSO_NAMESPACE_END
