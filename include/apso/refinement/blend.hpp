/// \file
/// Blending the feature pose and the direct pose, the paper's eq. (17), for poses of any type: what comes in comes out.
///
/// The sum of two pose matrices that the paper prints cannot be computed as a pose: it is not a rigid motion (determinant of
/// its rotation 0.99 at 10 degrees, 0.5 at 90). Here the poses are joined along the screw between them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/options.hpp>
#include <apso/refinement/memory/motion_distance.hpp>
#include <apso/traits/pose.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

enum class BlendForm {
  ScrewLinear,          ///< T_d Exp(w Log(T_d^-1 T_f)); does not depend on which frame is called fixed
  Decoupled,            ///< rotation by slerp, translation linearly; depends on it
  InformationWeighted,  ///< the most probable pose of both, each with the information it has about each direction
};
constexpr std::array<const char*, 3> enum_names(BlendForm) { return {"screw_linear", "decoupled", "information_weighted"}; }

enum class BlendWeight {
  Confidence,  ///< S_final and c_dir for InformationWeighted, else w = 1 - c_dir (1 - w_diff): as far as each can be trusted
  Printed,     ///< w = w_diff, as the paper prints: a failed direct pose counts like a good one, and poses that are far
               ///< apart are averaged
};
constexpr std::array<const char*, 2> enum_names(BlendWeight) { return {"confidence", "printed"}; }

struct BlendOptions {
  double mu = 2.0;                                  ///< of w_diff = exp(-mu S_change); the paper gives no value
  BlendForm form = BlendForm::InformationWeighted;  ///< docs/quality.md has the ablation; the others average by w_diff
  BlendWeight weight = BlendWeight::Confidence;
  double transition = 0;  ///< S_final below th_differ over which the direct pose gains its weight, so that the output does
                          ///< not jump where GOOD becomes BAD; typical 0.05; 0 = at once, as the paper has it
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("mu", s.mu, 0.0, 100.0);
    v("form", s.form);
    v("weight", s.weight);
    v("transition", s.transition, 0.0, 1.0);
  }
};

/// Poses farther apart than two units of motion_distance() are two answers, not one with noise: they are not averaged.
inline constexpr double kBlendGateTranslation = 2 * kMotionSigmaTranslation;  ///< [m]
inline constexpr double kBlendGateRotation = 2 * kMotionSigmaRotation;        ///< [rad]
/// A joined pose so many times as far from one of both poses as they are from each other lies outside of both: what they are said to
/// know contradicts each other.
inline constexpr double kBlendOutside = 1.2;
/// Standard deviation of a feature pose whose tracker does not tell its information: what apso_track reaches on static
/// recordings.
inline constexpr double kFeatureSigmaTranslation = 0.005;  ///< [m]
inline constexpr double kFeatureSigmaRotation = 0.0025;    ///< [rad]
/// What is believed of the information that a feature tracker tells. Its errors are taken for independent there, but
/// landmarks are seen again and again from nearly the same place, and err alike.
inline constexpr double kFeatureInformationShare = 0.3;

/// Weight of the feature pose, w_diff = exp(-mu S_change), in [exp(-mu), 1]. NaN counts as S_change = 1.
[[nodiscard]] inline double difference_weight(double S_change, double mu) { return std::exp(-mu * Deviation(S_change).value()); }

/// The same after the direct pose has been judged: 1 - c_dir (1 - w_diff). Without confidence (0 or NaN) the feature pose stays.
[[nodiscard]] inline double effective_weight(double w_diff, double c_dir) { return 1.0 - clamp01(c_dir) * (1.0 - clamp01(w_diff)); }

namespace detail {
// The one pose to take when the other is NaN or otherwise no rigid motion; null when both can be blended.
[[nodiscard]] inline const Pose* only_usable(const Pose& T_feature, const Pose& T_direct) {
  const bool feature = is_rigid(T_feature);
  const bool direct = is_rigid(T_direct);
  expects(feature || direct, "blend: neither pose is a finite rigid motion");
  return feature && direct ? nullptr : (feature ? &T_feature : &T_direct);
}
// Weight of the feature pose, 0 or 1 where nothing is to be blended: then a pose is returned as it came. NaN counts as 0.
[[nodiscard]] inline double usable_weight(const Pose& T_feature, const Pose& T_direct, double w) {
  if (const Pose* only = only_usable(T_feature, T_direct)) return only == &T_feature ? 1.0 : 0.0;
  return clamp01(w);
}

[[nodiscard]] inline Pose blend_poses(const Pose& T_feature, const Pose& T_direct, double w, BlendForm form) {
  expects(form != BlendForm::InformationWeighted, "blend: InformationWeighted needs the information of both poses");
  if (form == BlendForm::ScrewLinear) return sclerp(T_direct, T_feature, w);
  return make_pose(rotation(slerp(quaternion(T_direct), quaternion(T_feature), w)),
                   (1 - w) * translation(T_direct) + w * translation(T_feature));
}

// Maximum of two Gaussians around the poses, of information F and D. In `share`, if asked for: how much of the way from the
// direct to the feature position is made, between 0 and 1, which stand for poses that are taken as they are.
[[nodiscard]] inline Pose join_by_information(const Pose& T_feature, const Pose& T_direct, const Matrix6& F, const Matrix6& D,
                                              double fallback, double* share = nullptr) {
  // T_f = T_d Exp(xi); the increment d = -xi of T_c_w from the left has the given information, hence so has xi.
  const Twist xi = se3_log(compose(inverse(T_direct), T_feature));
  Matrix6 A;
  Twist right = zeros<Twist>();
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k) {
      A(i, k) = F(i, k) + D(i, k);
      right(i) += F(i, k) * xi(k);
    }
  }
  const Twist step = solve_symmetric(A, right);
  Pose joined = compose(T_direct, se3_exp(step));
  if (!is_rigid(joined)) return sclerp(T_direct, T_feature, fallback);
  if (share != nullptr && translation_norm(xi) > 0) {
    *share = std::clamp(translation_norm(step) / translation_norm(xi), 1e-12, 1 - 1e-12);
  }
  return joined;
}

// What is known by a feature pose: what its tracker tells, as far as that is believed; a fixed one if it tells nothing, or
// what no information can be: NaN, or an element beyond what its diagonal allows.
[[nodiscard]] inline Matrix6 feature_information(const Matrix6& told) {
  Matrix6 information = zeros<Matrix6>();
  bool known = true;
  for (int i = 0; i < 6; ++i) {
    known = known && told(i, i) > 0;
    for (int k = 0; k < 6; ++k) {
      known = known && std::isfinite(told(i, k)) && std::abs(told(i, k)) <= 1.000001 * std::sqrt(told(i, i)) * std::sqrt(told(k, k));
      information(i, k) = kFeatureInformationShare * told(i, k);
    }
  }
  if (known) return information;
  information = zeros<Matrix6>();
  for (int i = 0; i < 6; ++i) {
    const double sigma = i < 3 ? kFeatureSigmaTranslation : kFeatureSigmaRotation;
    information(i, i) = 1 / (sigma * sigma);
  }
  return information;
}

// What is left open is known to the gate, so that it can be inverted.
[[nodiscard]] inline Matrix6 within_gate(const Matrix6& information) {
  Matrix6 known = information;
  for (int i = 0; i < 6; ++i) {
    const double gate = i < 3 ? kBlendGateTranslation : kBlendGateRotation;
    known(i, i) += 1 / (gate * gate);
  }
  return known;
}

[[nodiscard]] inline Matrix6 scaled_information(double factor, const Matrix6& information) {
  Matrix6 scaled = zeros<Matrix6>();
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < 6; ++k) scaled(i, k) = factor * information(i, k);
  return scaled;
}
}  // namespace detail

/// Blend of two poses; w = 1 gives T_feature and w = 0 gives T_direct, bit by bit. A pose that is no rigid motion (is_rigid(), e.g.
/// NaN) is not used: the result is then the other one. Throws contract_error when both are none. A NaN w counts as 0.
/// \param form ScrewLinear or Decoupled
template <class PoseT>
[[nodiscard]] PoseT blend(const PoseT& T_feature, const PoseT& T_direct, double w, BlendForm form = BlendForm::ScrewLinear) {
  check_pose<PoseT>();
  const Pose F = to_pose(T_feature);
  const Pose D = to_pose(T_direct);
  w = detail::usable_weight(F, D, w);
  if (w >= 1) return T_feature;
  if (!(w > 0)) return T_direct;
  return from_pose<PoseT>(detail::blend_poses(F, D, w, form));
}

/// Blend of two poses T_world_camera by their information: xi = Log(T_d^-1 T_f), step = (w F + (1 - w) D)^-1 w F xi,
/// T = T_d Exp(step). Poses that are no rigid motion and a NaN w as above; information that is not finite: screw-linear by w.
/// \param feature_information,direct_information F and D, of increments (v, w) in the camera frame [1/m^2, 1/rad^2]; 0 in
///        directions about which a pose knows nothing
template <class PoseT>
[[nodiscard]] PoseT blend(const PoseT& T_feature, const PoseT& T_direct, double w, const Matrix6& feature_information,
                          const Matrix6& direct_information) {
  check_pose<PoseT>();
  const Pose T_f = to_pose(T_feature);
  const Pose T_d = to_pose(T_direct);
  w = detail::usable_weight(T_f, T_d, w);
  if (w >= 1) return T_feature;
  if (!(w > 0)) return T_direct;
  return from_pose<PoseT>(detail::join_by_information(T_f, T_d, detail::scaled_information(w, feature_information),
                                                      detail::scaled_information(1 - w, direct_information), w));
}

/// What is known of two poses besides themselves.
struct BlendEvidence {
  double S_change = 0;  ///< change score, [0,1]
  double c_dir = 1;     ///< confidence in the direct pose, [0,1]
  double S_final = 1;   ///< trust in the frame, [0,1]; this and the two below are used by InformationWeighted only
  Matrix6 direct_information = zeros<Matrix6>();                     ///< of the increment (v, w) in the camera frame [1/m^2, 1/rad^2]
  Matrix6 feature_information = zeros<Matrix6>();                    ///< the same; zero = the tracker does not tell
  double below_threshold = std::numeric_limits<double>::infinity();  ///< th_differ - S_final; for BlendOptions::transition
};

template <class PoseT = Pose>
struct Blended {
  PoseT T_world_camera = from_pose<PoseT>(identity_pose());
  double w_diff = 1;   ///< weight of the feature pose from the change score
  double w_eff = 1;    ///< weight used; for InformationWeighted the share of the way to the feature position that was made
  bool gated = false;  ///< the poses were too far apart to be blended, or one was no rigid motion
};

namespace detail {
[[nodiscard]] inline Blended<Pose> blend_judged(const Pose& T_feature, const Pose& T_direct, const Pose& T_predicted,
                                                const BlendEvidence& e, const BlendOptions& o) {
  Blended<Pose> b;
  b.w_diff = difference_weight(e.S_change, o.mu);
  if (const Pose* only = only_usable(T_feature, T_direct)) {
    b.w_eff = only == &T_feature ? 1.0 : 0.0;
    b.T_world_camera = *only;
    b.gated = true;
    return b;
  }
  const bool joined = o.form == BlendForm::InformationWeighted;
  const bool printed = o.weight == BlendWeight::Printed;
  b.w_eff = printed ? b.w_diff : (joined ? 1 - clamp01(e.c_dir) : effective_weight(b.w_diff, e.c_dir));
  if (o.transition > 0) {
    const double g = clamp01(e.below_threshold / o.transition);
    b.w_eff = 1 - g * g * (3 - 2 * g) * (1 - b.w_eff);
  }
  b.T_world_camera = T_feature;
  if (b.w_eff >= 1) return b;
  const Twist xi = se3_log(compose(inverse(T_direct), T_feature));
  b.gated = !printed && (translation_norm(xi) > kBlendGateTranslation || rotation_norm(xi) > kBlendGateRotation);
  if (b.gated) {
    const bool direct = e.c_dir > 0.5 && motion_distance(T_direct, T_predicted) < motion_distance(T_feature, T_predicted);
    b.w_eff = direct ? 0.0 : 1.0;
    b.T_world_camera = direct ? T_direct : T_feature;
  } else if (joined) {
    const double trust = printed ? b.w_diff : clamp01(e.S_final);
    const Matrix6 F = scaled_information(trust, feature_information(e.feature_information));
    const Matrix6 D = scaled_information(1 - b.w_eff, e.direct_information);
    b.T_world_camera = join_by_information(T_feature, T_direct, F, D, b.w_eff, &b.w_eff);
    const double to_feature = motion_distance(b.T_world_camera, T_feature);
    const double to_direct = motion_distance(b.T_world_camera, T_direct);
    const bool outside = std::max(to_feature, to_direct) > kBlendOutside * motion_distance(T_feature, T_direct);
    if (outside && e.below_threshold > 0) {  // of a frame that is trusted neither is doubted
      b.w_eff = to_feature < to_direct ? 1.0 : 0.0;
      b.T_world_camera = to_feature < to_direct ? T_feature : T_direct;
    }
  } else if (!(b.w_eff > 0)) {
    b.T_world_camera = T_direct;
  } else {
    b.T_world_camera = blend_poses(T_feature, T_direct, b.w_eff, o.form);
  }
  return b;
}
}  // namespace detail

/// Weights, gate and blend in one. InformationWeighted weighs each pose by its information and by how far it is trusted,
/// S_final F against c_dir D; the other forms average by w_diff = exp(-mu S_change). With c_dir = 0 the result is the feature
/// pose. Of two poses that are too far apart the direct one is taken if it is trusted (c_dir > 0.5) and nearer to the
/// prediction, else the feature pose. Where the joined pose of a BAD frame lies outside of both, the nearer one of them is taken. A
/// pose that is no rigid motion (is_rigid(), e.g. NaN) is not used: the result is then the other one, and contract_error when both
/// are none. Of the evidence NaN counts as the worst, and information that is not finite as not told.
/// \param T_predicted motion prediction, decides between poses that are too far apart; not finite: for the feature pose
template <class PoseT>
[[nodiscard]] Blended<PoseT> blend(const PoseT& T_feature, const PoseT& T_direct, const PoseT& T_predicted, const BlendEvidence& evidence,
                                   const BlendOptions& options = {}) {
  check_pose<PoseT>();
  const Blended<Pose> b = detail::blend_judged(to_pose(T_feature), to_pose(T_direct), to_pose(T_predicted), evidence, options);
  return {b.w_eff >= 1 ? T_feature : (b.w_eff > 0 ? from_pose<PoseT>(b.T_world_camera) : T_direct), b.w_diff, b.w_eff, b.gated};
}

APSO_NAMESPACE_END
