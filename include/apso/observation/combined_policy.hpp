/// \file
/// Two motion policies as one, and a holder for a policy that is chosen at run time.
///
/// \code
/// auto motion = GeometricMotion(camera) | MyMotion{};       // dynamic where either says so
/// AnyMotionPolicy chosen = GeometricMotion(camera);         // any policy under one type
/// \endcode
#pragma once

#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/observation/semantic_gate.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// Two policies as one; itself a policy, so combinations nest. Built by `p | q`, `p * q`, `p & q` as well.
template <class A, class B>
class CombinedPolicy : public PolicyOperators {
 public:
  CombinedPolicy(A first, B second, PolicyCombination how) : first_(std::move(first)), second_(std::move(second)), how_(how) {
    check_motion_policy<A>();
    check_motion_policy<B>();
  }

  void observe(const AnyFrame& frame, const AnyPose& T_world_camera_prior, const AnyTracks& tracks, DynamicMask& out) {
    const Pose& prior = T_world_camera_prior;
    const std::vector<PointTrack>& list = tracks.in(tracks_);
    first_.observe(frame, prior, list, out);
    second_.observe(frame, prior, list, other_);
    detections_ = detections_of(first_);
    if (how_ == PolicyCombination::Gate) {
      gate_.apply(detections_, other_, out);
      return;
    }
    combine(other_, how_ == PolicyCombination::Union ? MaskCombination::Union : MaskCombination::Product, out);
    const std::vector<Detection>& more = detections_of(second_);
    detections_.insert(detections_.end(), more.begin(), more.end());
  }
  void remember(const AnyFrame& frame, const AnyPose& T_world_camera, const DynamicMask& mask) {
    const Pose& T = T_world_camera;
    first_.remember(frame, T, mask);
    second_.remember(frame, T, mask);
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
  std::vector<PointTrack> tracks_;
  std::vector<Detection> detections_;
};

/// Holds any motion policy; one indirect call per frame. Itself a policy. Movable, not copyable.
class AnyMotionPolicy : public PolicyOperators {
 public:
  using Options = NoOptions;  ///< the options are those of the policy that is held

  template <class P, std::enable_if_t<!std::is_same_v<std::decay_t<P>, AnyMotionPolicy>, int> = 0>
  AnyMotionPolicy(P policy) : held_(hold(std::move(policy))) {}  // NOLINT: conversion is intended
  void observe(const AnyFrame& frame, const AnyPose& T_world_camera_prior, const AnyTracks& tracks, DynamicMask& out) {
    held_->observe(frame, T_world_camera_prior, tracks.in(tracks_), out);
  }
  void remember(const AnyFrame& frame, const AnyPose& T_world_camera, const DynamicMask& mask) {
    held_->remember(frame, T_world_camera, mask);
  }
  void reset() { held_->reset(); }
  [[nodiscard]] const std::vector<Detection>& detections() const { return held_->detections(); }

 private:
  struct Base {
    virtual ~Base() = default;
    virtual void observe(const AnyFrame&, const Pose&, const std::vector<PointTrack>&, DynamicMask&) = 0;
    virtual void remember(const AnyFrame&, const Pose&, const DynamicMask&) = 0;
    virtual void reset() = 0;
    [[nodiscard]] virtual const std::vector<Detection>& detections() const = 0;
  };
  template <class P>
  struct Held final : Base {
    explicit Held(P p) : policy(std::move(p)) {}
    void observe(const AnyFrame& frame, const Pose& prior, const std::vector<PointTrack>& tracks, DynamicMask& out) override {
      policy.observe(frame, prior, tracks, out);
    }
    void remember(const AnyFrame& frame, const Pose& pose, const DynamicMask& mask) override { policy.remember(frame, pose, mask); }
    void reset() override { policy.reset(); }
    [[nodiscard]] const std::vector<Detection>& detections() const override { return detections_of(policy); }
    P policy;
  };
  template <class P>
  [[nodiscard]] static std::unique_ptr<Base> hold(P policy) {
    check_motion_policy<P>();
    return std::make_unique<Held<P>>(std::move(policy));
  }
  std::unique_ptr<Base> held_;
  std::vector<PointTrack> tracks_;
};

APSO_NAMESPACE_END
