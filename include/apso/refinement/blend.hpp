/// \file
/// Blending the feature pose T_f and the direct pose T_d, the paper's eq. (Optimized pose). The sum of two matrices
/// that the paper prints is not a rigid motion; here the poses are joined along the screw between them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/options.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

enum class BlendForm {
  ScrewLinear,          ///< T_d Exp(w Log(T_d^-1 T_f)); does not depend on which frame is called fixed
  Decoupled,            ///< rotation by slerp, translation linearly; depends on it
  InformationWeighted,  ///< the feature pose fills the directions that the images leave open
};
constexpr std::array<const char*, 3> enum_names(BlendForm) { return {"screw_linear", "decoupled", "information_weighted"}; }

struct BlendOptions {
  double mu = 2.0;                ///< how fast the weight of the feature pose falls with the change score
  BlendForm form = BlendForm::InformationWeighted;
  double gate_translation = 0.30; ///< poses farther apart are not blended: the direct one is taken if it is trusted
                                  ///< (c_dir > 0.5) and nearer to the prediction, else the feature pose [m]
  double gate_rotation = 20 * kDegree;  ///< the same for the rotation [rad]
  double sigma_translation = 0.15;                               ///< unit of distance to the prediction [m]
  double sigma_rotation = 10 * kDegree; ///< [rad]
  double feature_sigma_translation = 0.005; ///< of the feature pose when S_feature is 1, for InformationWeighted; it
                                            ///< grows with 1 / S_feature [m]
  double feature_sigma_rotation = 0.0025;   ///< the same for the rotation [rad]
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("mu", s.mu, 0.0, 100.0);
    v("form", s.form);
    v("gate_translation", s.gate_translation, 0.0, 1e6);
    v("gate_rotation", s.gate_rotation, 0.0, 4.0);
    v("sigma_translation", s.sigma_translation, 1e-9, 1e6);
    v("sigma_rotation", s.sigma_rotation, 1e-9, 1e6);
    v("feature_sigma_translation", s.feature_sigma_translation, 1e-9, 1e6);
    v("feature_sigma_rotation", s.feature_sigma_rotation, 1e-9, 1e6);
  }
};

/// Weight of the feature pose, w_diff = exp(-mu S_change), in [exp(-mu), 1].
[[nodiscard]] inline double difference_weight(double S_change, double mu) { return std::exp(-mu * clamp01(S_change)); }

/// The same after the direct pose has been judged: 1 - c_dir (1 - w_diff). Without confidence the feature pose stays.
[[nodiscard]] inline double effective_weight(double w_diff, double c_dir) {
  return 1.0 - clamp01(c_dir) * (1.0 - clamp01(w_diff));
}

/// Distance of two poses in units of (sigma_translation, sigma_rotation).
[[nodiscard]] inline double motion_distance(const Pose& a, const Pose& b, double sigma_translation, double sigma_rotation) {
  const Twist xi = se3_log(compose(inverse(a), b));
  const double t = translation_norm(xi) / sigma_translation;
  const double r = rotation_norm(xi) / sigma_rotation;
  return std::sqrt(t * t + r * r);
}

/// Blend of two poses; w = 1 gives T_feature and w = 0 gives T_direct, bit by bit.
/// \param direct_information of the increment (v, w) in the camera frame; used by InformationWeighted only
/// \param S_feature quality of the features, (0,1]; used by InformationWeighted only
[[nodiscard]] inline Pose blend_poses(const Pose& T_feature, const Pose& T_direct, double w,
                                      BlendForm form = BlendForm::ScrewLinear,
                                      const Matrix6& direct_information = zeros<Matrix6>(), const BlendOptions& o = {},
                                      double S_feature = 1) {
  if (w >= 1) return T_feature;
  if (!(w > 0)) return T_direct;
  if (form == BlendForm::ScrewLinear) return sclerp(T_direct, T_feature, w);
  if (form == BlendForm::Decoupled) {
    return make_pose(rotation(slerp(quaternion(T_direct), quaternion(T_feature), w)),
                     plus(times(1 - w, translation(T_direct)), times(w, translation(T_feature))));
  }
  // T_f = T_d Exp(xi); the increment d = -xi of T_c_w from the left has the given information, hence so has xi.
  const double quality = std::max(0.01, clamp01(S_feature));
  const Twist xi = se3_log(compose(inverse(T_direct), T_feature));
  Matrix6 A = times(1 - w, direct_information);
  Twist right;
  for (int i = 0; i < 6; ++i) {
    const double sigma = (i < 3 ? o.feature_sigma_translation : o.feature_sigma_rotation) / quality;
    const double information = w / (sigma * sigma);
    A(i, i) += information;
    right(i) = information * xi(i);
  }
  const Twist step = solve_symmetric(A, right);
  return all_finite(step) ? compose(T_direct, se3_exp(step)) : sclerp(T_direct, T_feature, w);
}

struct Blend {
  Pose T_world_camera = Pose::Identity();
  double w_diff = 1;   ///< weight of the feature pose from the change score
  double w_eff = 1;    ///< weight used
  bool gated = false;  ///< the poses were too far apart to be blended
};

/// Weights, gate and blend in one. With c_dir = 0 the result is the feature pose.
/// \param T_predicted motion prediction, decides between poses that are too far apart
[[nodiscard]] inline Blend blend_poses(const Pose& T_feature, const Pose& T_direct, const Pose& T_predicted,
                                       double S_change, double c_dir, const BlendOptions& o = {},
                                       const Matrix6& direct_information = zeros<Matrix6>(), double S_feature = 1) {
  Blend b;
  b.w_diff = difference_weight(S_change, o.mu);
  b.w_eff = effective_weight(b.w_diff, c_dir);
  b.T_world_camera = T_feature;
  if (b.w_eff >= 1) return b;
  const Twist xi = se3_log(compose(inverse(T_direct), T_feature));
  if (translation_norm(xi) > o.gate_translation || rotation_norm(xi) > o.gate_rotation) {
    b.gated = true;
    const bool direct = c_dir > 0.5 &&
                        motion_distance(T_direct, T_predicted, o.sigma_translation, o.sigma_rotation) <
                        motion_distance(T_feature, T_predicted, o.sigma_translation, o.sigma_rotation);
    b.w_eff = direct ? 0.0 : 1.0;
    b.T_world_camera = direct ? T_direct : T_feature;
    return b;
  }
  b.T_world_camera = blend_poses(T_feature, T_direct, b.w_eff, o.form, direct_information, o, S_feature);
  return b;
}

APSO_NAMESPACE_END
