/// \file
/// What a motion policy is, how two become one, and a holder for policies that are chosen at run time.
///
/// A motion policy says where a frame moves. It has three members:
/// \code
///   void observe(const RgbdFrame& frame, const Pose& T_world_camera_prior, const std::vector<PointTrack>& tracks,
///                DynamicMask& out);   // before the pose is known
///   void remember(const RgbdFrame& frame, const Pose& T_world_camera, const DynamicMask& mask);  // once it is final
///   void reset();                     // forgets everything
/// \endcode
/// `out` gets the size of the frame; where a policy has no evidence it says "unknown" (DynamicMask::known = 0), never
/// "static". A policy that finds objects also has `const std::vector<Detection>& detections() const`, those of the last
/// frame observed; masks in them live until the next call of observe().
#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/evidence_mask.hpp>
#include <apso/observation/region_growing.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

namespace detail {
template <class P, class = void>
struct is_motion_policy : std::false_type {};
template <class P>
struct is_motion_policy<
    P, std::void_t<decltype(std::declval<P&>().observe(std::declval<const RgbdFrame&>(), std::declval<const Pose&>(),
                                                       std::declval<const std::vector<PointTrack>&>(),
                                                       std::declval<DynamicMask&>())),
                   decltype(std::declval<P&>().remember(std::declval<const RgbdFrame&>(), std::declval<const Pose&>(),
                                                        std::declval<const DynamicMask&>())),
                   decltype(std::declval<P&>().reset())>> : std::true_type {};
template <class P, class = void>
struct finds_objects : std::false_type {};
template <class P>
struct finds_objects<
    P, std::enable_if_t<std::is_convertible_v<decltype(std::declval<const P&>().detections()), const std::vector<Detection>&>>>
    : std::true_type {};
}  // namespace detail

/// True when P has the members of a motion policy.
template <class P>
inline constexpr bool is_motion_policy_v = detail::is_motion_policy<P>::value;

/// The objects a policy found in the last frame; none for a policy that finds no objects.
template <class P>
[[nodiscard]] const std::vector<Detection>& detections_of(const P& policy) {
  if constexpr (detail::finds_objects<P>::value) {
    return policy.detections();
  } else {
    static const std::vector<Detection> none;
    return none;
  }
}

/// How two policies become one.
enum class PolicyCombination {
  Union,    ///< dynamic when either says so
  Product,  ///< dynamic where both say so, pixel by pixel
  Gate      ///< what the first marks, object by object, where the second sees it move: "a person, and it moves"
};

/// Keeps of `semantic` the objects in which `motion` sees movement, as a whole; the rest becomes static.
///
/// The objects are the detections if there are any, otherwise the connected regions of the mask. An object moves when
/// the mean probability of `motion` over its known pixels is at least `share`; an object of which nothing is known keeps
/// what `semantic` says. Outside of all objects nothing is dynamic.
class SemanticGate {
 public:
  explicit SemanticGate(double share = 0.25, int step = 4) : share_(share), step_(step) {
    expects(share > 0 && share <= 1 && step > 0, "SemanticGate: share must be in (0,1] and step > 0");
  }

  /// \param mask the semantic mask; becomes the result
  void apply(const std::vector<Detection>& objects, const DynamicMask& motion, DynamicMask& mask) {
    const int w = mask.probability.width();
    const int h = mask.probability.height();
    expects(motion.probability.width() == w && motion.probability.height() == h, "SemanticGate: masks differ in size");
    const int sw = (w + step_ - 1) / step_;
    const int sh = (h + step_ - 1) / step_;
    const auto at = [&](int i, const auto& image) { return image(i % sw * step_, i / sw * step_); };
    keep_.assign(sw, sh, 0);
    const auto judge = [&](const auto& for_each_pixel) {
      double sum = 0;
      double n = 0;
      for_each_pixel([&](int i) {
        if (at(i, motion.known) == 0) return;
        sum += static_cast<double>(at(i, motion.probability));
        n += 1;
      });
      if (n > 0 && sum < share_ * n) return;
      for_each_pixel([&](int i) { keep_.data()[i] = 1; });
    };
    if (!objects.empty()) {
      for (const Detection& d : objects) {
        if (!d.movable) continue;
        judge([&](const auto& visit) {
          for (int i = 0; i < sw * sh; ++i) {
            const auto x = static_cast<float>(i % sw * step_);
            const auto y = static_cast<float>(i / sw * step_);
            const bool in = d.mask.empty() ? x >= d.box.x && y >= d.box.y && x < d.box.x + d.box.width && y < d.box.y + d.box.height
                                           : at(i, d.mask) != 0;
            if (in && at(i, mask.probability) > 0) visit(i);
          }
        });
      }
    } else {
      for_each_component(
          sw, sh, scratch_, [&](int i) { return at(i, mask.probability) > 0; }, [](int, int) { return true; },
          [&](const int* first, const int* last) {
            judge([&](const auto& visit) {
              for (const int* i = first; i != last; ++i) visit(*i);
            });
          });
    }
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        // a thin border that falls between the steps goes with its nearest step
        const int i = std::min((x + step_ / 2) / step_, sw - 1);
        const int j = std::min((y + step_ / 2) / step_, sh - 1);
        if (keep_(i, j) == 0) mask.probability(x, y) = 0;
        mask.known(x, y) = mask.known(x, y) != 0 || motion.known(x, y) != 0 ? 1 : 0;
      }
    }
  }

 private:
  double share_;
  int step_;
  Image<std::uint8_t> keep_;
  RegionScratch scratch_;
};

/// Two policies as one; itself a policy, so combinations nest.
template <class A, class B>
class CombinedPolicy {
  static_assert(is_motion_policy_v<A> && is_motion_policy_v<B>,
                "apso: a motion policy needs observe(frame, prior, tracks, mask), remember(frame, pose, mask), reset()");

 public:
  CombinedPolicy(A first, B second, PolicyCombination how)
      : first_(std::move(first)), second_(std::move(second)), how_(how) {}

  void observe(const RgbdFrame& frame, const Pose& T_world_camera_prior, const std::vector<PointTrack>& tracks,
               DynamicMask& out) {
    first_.observe(frame, T_world_camera_prior, tracks, out);
    second_.observe(frame, T_world_camera_prior, tracks, other_);
    detections_ = detections_of(first_);
    if (how_ == PolicyCombination::Gate) {
      gate_.apply(detections_, other_, out);
      return;
    }
    combine(other_, how_ == PolicyCombination::Union ? MaskCombination::Union : MaskCombination::Product, out);
    const std::vector<Detection>& more = detections_of(second_);
    detections_.insert(detections_.end(), more.begin(), more.end());
  }
  void remember(const RgbdFrame& frame, const Pose& T_world_camera, const DynamicMask& mask) {
    first_.remember(frame, T_world_camera, mask);
    second_.remember(frame, T_world_camera, mask);
  }
  void reset() {
    first_.reset();
    second_.reset();
    detections_.clear();
  }
  [[nodiscard]] const std::vector<Detection>& detections() const { return detections_; }

 private:
  A first_;
  B second_;
  PolicyCombination how_;
  SemanticGate gate_;
  DynamicMask other_;
  std::vector<Detection> detections_;
};

/// Sees nothing: everything is unknown.
class NoMotion {
 public:
  void observe(const RgbdFrame& frame, const Pose&, const std::vector<PointTrack>&, DynamicMask& out) {
    set_unknown(frame.depth.width, frame.depth.height, out);
  }
  void remember(const RgbdFrame&, const Pose&, const DynamicMask&) {}
  void reset() {}
};

/// Holds any motion policy; one indirect call per frame. Itself a policy. Movable, not copyable.
class AnyMotionPolicy {
 public:
  template <class P, std::enable_if_t<!std::is_same_v<std::decay_t<P>, AnyMotionPolicy>, int> = 0>
  AnyMotionPolicy(P policy) : held_(std::make_unique<Held<P>>(std::move(policy))) {  // NOLINT: conversion is intended
    static_assert(is_motion_policy_v<P>,
                  "apso: a motion policy needs observe(frame, prior, tracks, mask), remember(frame, pose, mask), reset()");
  }
  void observe(const RgbdFrame& frame, const Pose& T_world_camera_prior, const std::vector<PointTrack>& tracks,
               DynamicMask& out) {
    held_->observe(frame, T_world_camera_prior, tracks, out);
  }
  void remember(const RgbdFrame& frame, const Pose& T_world_camera, const DynamicMask& mask) {
    held_->remember(frame, T_world_camera, mask);
  }
  void reset() { held_->reset(); }
  [[nodiscard]] const std::vector<Detection>& detections() const { return held_->detections(); }

 private:
  struct Base {
    virtual ~Base() = default;
    virtual void observe(const RgbdFrame&, const Pose&, const std::vector<PointTrack>&, DynamicMask&) = 0;
    virtual void remember(const RgbdFrame&, const Pose&, const DynamicMask&) = 0;
    virtual void reset() = 0;
    [[nodiscard]] virtual const std::vector<Detection>& detections() const = 0;
  };
  template <class P>
  struct Held final : Base {
    explicit Held(P p) : policy(std::move(p)) {}
    void observe(const RgbdFrame& frame, const Pose& prior, const std::vector<PointTrack>& tracks,
                 DynamicMask& out) override {
      policy.observe(frame, prior, tracks, out);
    }
    void remember(const RgbdFrame& frame, const Pose& pose, const DynamicMask& mask) override {
      policy.remember(frame, pose, mask);
    }
    void reset() override { policy.reset(); }
    [[nodiscard]] const std::vector<Detection>& detections() const override { return detections_of(policy); }
    P policy;
  };
  std::unique_ptr<Base> held_;
};

APSO_NAMESPACE_END
