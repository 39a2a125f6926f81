/// \file
/// The default motion policy, which needs no network: what stands where past views saw free space has moved.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/geometry/background_registration.hpp>
#include <apso/observation/geometry/carried_log_odds.hpp>
#include <apso/observation/geometry/flow_residual.hpp>
#include <apso/observation/geometry/free_space.hpp>
#include <apso/observation/geometry/low_res_depth.hpp>
#include <apso/observation/geometry/small_frame.hpp>
#include <apso/observation/geometry/track_claims.hpp>
#include <apso/observation/geometry/track_history.hpp>
#include <apso/observation/geometry/view_memory.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/options.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

inline constexpr double kFlowResidual = 3.0;         ///< a track this far from its static prediction is moving [px]
inline constexpr float kMinimumMovingArea = 0.015F;  ///< regions that are smaller in the world are dropped [m^2]: a hand with its arm

struct GeometricMotionOptions {
  int width = kMotionWidth;   ///< width of the images that are worked on [px]; the frame is reduced by a whole factor
  DepthRange depth;           ///< depth that is used
  int references = 12;        ///< past views that are kept and compared with every frame
  double memory = 6.0;        ///< age at which a view is dropped [s]; what stands still that long is static again
  bool correct_prior = true;  ///< register the background first, to take the error out of the pose prior
  double threshold = 0.6;     ///< log-odds from which a pixel is dynamic; two frames that agree reach it
  int dilation = 4;           ///< the mask is widened by this [px]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("width", s.width, 16, 4096);
    v("depth", s.depth);
    v("references", s.references, 1, 1000);
    v("memory", s.memory, 0.0, 3600.0);
    v("correct_prior", s.correct_prior);
    v("threshold", s.threshold, 0.01, 4.0);
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
/// Per frame: observe() with a prior pose, use the mask, then remember() with the final pose. A frame that is remembered
/// under the timestamp of the last observed one is that frame.
class GeometricMotion : public PolicyOperators {
 public:
  using Options = GeometricMotionOptions;

  explicit GeometricMotion(const Pinhole& camera, const GeometricMotionOptions& options = {})
      : options_(checked(options)),
        reducer_(camera, options.width, options.depth),
        memory_(options.references, options.memory),
        history_(kFlowSpan) {
    rules_.min_area = kMinimumMovingArea;
    rules_.dilation = options.dilation;
  }

  /// Labels a frame. Without past views everything is unknown (probability 0).
  /// \param frame any frame; its depth is read once, its intensity not at all
  /// \param T_world_camera_prior predicted pose; errors of a few centimetres and about a degree are corrected
  /// \param tracks points followed from the previous frame; may be empty or `none`
  /// \param out probability 1 inside moving regions (widened), falling to 0 at their border
  void observe(const AnyFrame& frame, const AnyPose& T_world_camera_prior, const AnyTracks& tracks, DynamicMask& out) {
    const Pose& prior = T_world_camera_prior;
    expects(is_finite(prior), "GeometricMotion: pose is not finite");
    reducer_.depth(frame, depth_);
    const std::vector<PointTrack>& list = tracks.in(tracks_);
    const double dt = tick(frame.timestamp);
    memory_.forget(clock_.now());
    observed_ = true;
    refined_ = prior;
    evidence_.clear(small().width, small().height);
    if (memory_.views().empty()) {
      maker_.start(small().width, small().height);
      log_odds_.update(depth_, small(), refined_, [](int, int, float) { return 0.0F; });
    } else {
      history_.look_back(list);
      if (options_.correct_prior) correct_prior();
      for (const DepthReference& r : memory_.views()) {
        compare_with_view(depth_, small(), refined_, clock_.now(), r, votes_, evidence_);
      }
      claim_from_tracks();
      update_log_odds(std::max(1e-3, dt));
      label();
    }
    write(out);
    history_.keep(clock_.now(), refined_, depth_, list);
  }

  /// Takes a frame into the memory, once its pose is final.
  /// \param mask what was dynamic in it; usually that of observe(), possibly combined with others
  void remember(const AnyFrame& frame, const AnyPose& T_world_camera, const DynamicMask& mask) {
    const Pose& T = T_world_camera;
    expects(is_finite(T), "GeometricMotion: pose is not finite");
    expects(mask.probability.width() == reducer_.camera().width && mask.probability.height() == reducer_.camera().height,
            "GeometricMotion::remember: the mask has another size than the frame");
    if (observed_ && same_stamp(frame.timestamp)) {
      log_odds_.correct(T);
      history_.correct(T);
    } else {
      reducer_.depth(frame, depth_);
      if (!same_stamp(frame.timestamp)) tick(frame.timestamp);
      observed_ = false;
    }
    if (!memory_.wants(clock_.now())) return;
    DepthReference r = memory_.take();
    r.time = clock_.now();
    r.T_world_camera = T;
    r.depth = depth_;
    reduce_mask(mask.probability, r.dynamic);
    depth_limits(r.depth, r.limits);
    depth_normals(r.depth, small(), r.normals);
    memory_.keep(std::move(r));
  }

  /// Forgets everything.
  void reset() {
    memory_.clear();
    history_.clear();
    log_odds_.reset();
    observed_ = false;
    clock_ = {};
    stamp_ = 0;
  }

  /// Pose of the last observed frame after registration of the background; the prior where that failed.
  [[nodiscard]] Pose refined_prior() const { return refined_; }
  /// Past views that are kept.
  [[nodiscard]] std::size_t reference_count() const { return memory_.views().size(); }

 private:
  static constexpr double kFlowSpan = 0.15;   // tracks look back this long, if they live so long [s]
  static constexpr double kFlowShare = 0.15;  // a moving track is off by this share of the motion that was expected
  static constexpr int kFlowReach = 10;       // how far a track speaks for the surface it is on [small px]
  static constexpr int kFlowTracks = 3;       // so many moving tracks must agree on a surface

  static const Options& checked(const Options& options) {
    validate(options, "geometric_motion");
    return options;
  }
  [[nodiscard]] const Pinhole& small() const { return reducer_.small(); }
  [[nodiscard]] bool same_stamp(double stamp) const { return stamp == stamp_ || (std::isnan(stamp) && std::isnan(stamp_)); }
  double tick(double stamp) {
    stamp_ = stamp;
    return clock_.tick(stamp);
  }

  // Registers the background to a young, a middle-aged and an old view that still see the scene.
  void correct_prior() {
    const std::vector<DepthReference>& views = memory_.views();
    chosen_.clear();
    chosen_.push_back(&views.back());
    const double ages[2] = {0.5, 1.5};  // [s]
    for (int k = 1; k >= 0; --k) {
      const DepthReference* best = nullptr;
      double largest = 0.4;
      for (const DepthReference& r : views) {
        if (clock_.now() - r.time < ages[k] || std::find(chosen_.begin(), chosen_.end(), &r) != chosen_.end()) continue;
        const double overlap = view_overlap(depth_, small(), refined_, r);
        if (overlap > largest) {
          largest = overlap;
          best = &r;
        }
      }
      if (best != nullptr) chosen_.push_back(best);
    }
    const BackgroundRegistration found = register_background(depth_, small(), refined_, chosen_);
    // People who fill the view can outweigh the background in depth; the tracks say whose motion was found. They lose
    // little by a correction of the pose, and most of their support when the motion is another body's.
    const double before = support(refined_);
    if (support(found.T_world_camera) >= 0.7 * before) refined_ = found.T_world_camera;
  }

  // Tracks that agree with a pose of the camera.
  [[nodiscard]] double support(const Pose& T_world_camera) {
    history_.residuals(reducer_.camera(), T_world_camera, reducer_.factor(), flow_points_);
    return track_support(flow_points_, kFlowResidual);
  }

  void claim_from_tracks() {
    history_.residuals(reducer_.camera(), refined_, reducer_.factor(), flow_points_);
    mark_moving(kFlowResidual, kFlowShare, residuals_, flow_points_);
    claim_surfaces(flow_points_, depth_, reducer_.factor(), kFlowReach, rules_.depth_span, kFlowTracks, claims_, scratch_);
  }

  void update_log_odds(double dt) {
    constexpr float kKeepSeen = 0.75F;  // share of the past log-odds that is kept per frame where there is new evidence
    constexpr double kHold = 1.0;       // time constant of the past log-odds where there is none [s]
    constexpr float kFlow = 0.9F;       // log-odds that many moving tracks give a surface per frame; few give less
    constexpr float kAllTracks = 8;     // so many that agree are as sure as any number
    const auto keep_blind = static_cast<float>(std::exp(-dt / kHold));
    // one frame alone, whose pose may be wrong, cannot make a point dynamic
    const auto limit = 0.9F * static_cast<float>(options_.threshold);
    log_odds_.update(depth_, small(), refined_, [&](int x, int y, float past) {
      if (!(depth_(x, y) > 0)) return 0.0F;
      const float appeared = evidence_.appeared(x, y);
      // a track at rest counts as a view that saw the surface at rest
      const std::uint8_t claim = claims_(x, y);
      const float same = evidence_.same_static(x, y) + (claim == kClaimedStatic ? 1.0F : 0.0F);
      // a static surface must be confirmed by about three views to outweigh one view that saw through the point
      float now = std::clamp(1.2F * (appeared - 0.35F * same), -1.5F, limit);
      // several tracks that move can: then "the same surface" was seen only because the body slides along itself
      const bool moves = claim > kClaimedStatic;
      if (moves) {
        now = std::max(now, kFlow * std::min(1.0F, static_cast<float>(claim) / kAllTracks));
        past = std::max(past, 0.0F);
      }
      const float keep = appeared + same > 0 || moves ? kKeepSeen : keep_blind;
      return std::clamp(keep * past + now, -4.0F, 5.0F);
    });
  }

  void label() {
    maker_.start(small().width, small().height);
    Image<std::uint8_t>& seeds = maker_.seeds();
    Image<std::uint8_t>& may_join = maker_.may_join();
    const auto threshold = static_cast<float>(options_.threshold);
    for (std::size_t i = 0; i < seeds.size(); ++i) {
      const float l = log_odds_.values().data()[i];
      const bool valid = depth_.data()[i] > 0;
      seeds.data()[i] = valid && l > threshold ? 1 : 0;
      const bool moves = claims_.data()[i] > kClaimedStatic;
      may_join.data()[i] = valid && l > -0.5F && (moves || evidence_.same_static.data()[i] < 1.0F) ? 1 : 0;
    }
    maker_.grow(depth_, small(), rules_);
  }

  void write(DynamicMask& out) {
    known_.resize(small().width, small().height);
    for (std::size_t i = 0; i < known_.size(); ++i) {
      const bool seen = evidence_.appeared.data()[i] + evidence_.same_static.data()[i] + evidence_.same_dynamic.data()[i] > 0;
      known_.data()[i] = seen ? 1 : 0;
    }
    maker_.write(known_, reducer_.factor(), reducer_.camera().width, reducer_.camera().height, rules_.dilation, out);
  }

  // Small labels of a full mask, with the widening taken off again.
  void reduce_mask(const Image<float>& probability, Image<std::uint8_t>& out) {
    const int factor = reducer_.factor();
    out.resize(small().width, small().height);
    const int c = factor / 2;
    for (int y = 0; y < small().height; ++y) {
      const float* p = probability.row(y * factor + c);
      for (int x = 0; x < small().width; ++x) out(x, y) = p[x * factor + c] >= 0.5F ? 0 : 1;  // inverted
    }
    dilate(out, EvidenceMask::small_dilation(rules_.dilation, factor), dilation_scratch_);
    for (std::size_t i = 0; i < out.size(); ++i) out.data()[i] = out.data()[i] != 0 ? 0 : 1;
  }

  GeometricMotionOptions options_;
  FrameReducer reducer_;
  RegionRules rules_;
  ViewMemory memory_;
  TrackHistory history_;
  FrameClock clock_;
  double stamp_ = 0;       // of the frame that depth_ shows
  bool observed_ = false;  // depth_ is of the frame that was observed last, with its evidence

  Image<float> depth_;
  FreeSpaceEvidence evidence_;
  CarriedLogOdds log_odds_;
  EvidenceMask maker_;
  Image<float> votes_;
  Image<std::uint8_t> known_;
  Image<std::uint8_t> claims_;
  std::vector<const DepthReference*> chosen_;
  std::vector<FlowPoint> flow_points_;
  std::vector<PointTrack> tracks_;
  std::vector<float> residuals_;
  std::vector<std::uint8_t> dilation_scratch_;
  RegionScratch scratch_;

  Pose refined_ = identity_pose();
};

APSO_NAMESPACE_END
