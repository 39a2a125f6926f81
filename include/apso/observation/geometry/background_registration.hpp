/// \file
/// Ego-motion from the static background: corrects the pose prior of a depth image against past views, so that the
/// search for moving things does not mistake a wrong prior for motion.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/observation/geometry/free_space.hpp>
#include <apso/status.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

struct BackgroundRegistration {
  Status status = Status::NotRun;
  Pose T_world_camera = identity_pose();  ///< the prior unless succeeded(status)
  int points = 0;                         ///< used in the last step
  double mean_cost_prior = 0;             ///< mean robust cost at the prior, [0,1]
  double mean_cost = 0;                   ///< ... and at the result
};

/// Point-to-plane registration by projective association (Chen & Medioni 1992; Rusinkiewicz & Levoy 2001) with
/// Tukey weights and the prior as a Gaussian, so that directions without structure stay at the prior.
inline BackgroundRegistration register_background(const Image<float>& depth, const Pinhole& camera, const Pose& T_world_camera_prior,
                                                  const std::vector<const DepthReference*>& references) {
  constexpr int kIterations = 5;              // Gauss-Newton steps; more change the pose by less than the noise
  constexpr int kStride = 3;                  // every third row and column of the small depth image
  constexpr float kGate = 0.15F;              // largest distance to the plane in the first step [m]; ends at a third of it
  constexpr double kSigmaTranslation = 0.03;  // standard deviation of the prior [m]: a frame at 1 m/s
  constexpr double kSigmaRotation = 0.015;    // standard deviation of the prior [rad]: a frame at 26 degrees per second
  constexpr int kIndependent = 200;           // the residuals count as this many independent ones (they are correlated)
  constexpr int kMinPoints = 150;             // fewer than this leave the prior as it is
  BackgroundRegistration result;
  result.T_world_camera = T_world_camera_prior;
  if (references.empty()) {
    result.status = Status::NoReference;
    return result;
  }
  const int w = depth.width();
  const int h = depth.height();
  const auto fx = static_cast<float>(camera.fx);
  const auto fy = static_cast<float>(camera.fy);
  const auto cx = static_cast<float>(camera.cx);
  const auto cy = static_cast<float>(camera.cy);
  Matrix6 prior = zeros<Matrix6>();
  for (int i = 0; i < 3; ++i) {
    prior(i, i) = 1.0 / (kSigmaTranslation * kSigmaTranslation);
    prior(i + 3, i + 3) = 1.0 / (kSigmaRotation * kSigmaRotation);
  }

  // the correction D moves points of the prior camera frame: T_world_camera = T_prior D
  Pose D = identity_pose();
  const auto accumulate = [&](const Pose& correction, float gate, Matrix6& H, Twist& b, double& cost, int& judged) {
    H = zeros<Matrix6>();
    b = zeros<Twist>();
    cost = 0;
    judged = 0;
    int n = 0;
    for (const DepthReference* reference : references) {
      const Pose T_r_prior = compose(inverse(reference->T_world_camera), T_world_camera_prior);
      const FloatPose prior_from_reference(inverse(T_r_prior));
      const FloatPose reference_from_camera(compose(T_r_prior, correction));
      const FloatPose prior_from_camera(correction);
      float Hr[6][6] = {};  // lower triangle
      float br[6] = {};
      for (int y = kStride / 2; y < h; y += kStride) {
        for (int x = kStride / 2; x < w; x += kStride) {
          const float z = depth(x, y);
          if (!(z > 0)) continue;
          const float px = (static_cast<float>(x) - cx) / fx * z;
          const float py = (static_cast<float>(y) - cy) / fy * z;
          const Eigen::Vector3f Y = reference_from_camera(px, py, z);
          if (!(Y.z() > 0.05F)) continue;
          const float u = fx * Y.x() / Y.z() + cx + 0.5F;
          const float v = fy * Y.y() / Y.z() + cy + 0.5F;
          if (!(u >= 0 && v >= 0 && u < static_cast<float>(w) && v < static_cast<float>(h))) continue;
          const int iu = static_cast<int>(u);
          const int iv = static_cast<int>(v);
          const auto i = static_cast<std::size_t>(iv) * static_cast<std::size_t>(w) + static_cast<std::size_t>(iu);
          const Eigen::Vector3f& n_r = reference->normals[i];
          if (reference->dynamic(iu, iv) != 0 || squared_norm(n_r) == 0) continue;
          const float zr = reference->depth(iu, iv);
          const Eigen::Vector3f q((static_cast<float>(iu) - cx) / fx * zr, (static_cast<float>(iv) - cy) / fy * zr, zr);
          const float r = dot(n_r, Y - q);
          ++judged;
          const float g = gate + 2.0F * depth_sigma(z);
          const float e = r / g;
          const float e2 = e * e;
          if (!(e2 < 1.0F)) {
            cost += 1.0;
            continue;
          }
          const float k = 1.0F - e2;
          cost += static_cast<double>(1.0F - k * k * k);
          const float sigma = 0.01F + depth_sigma(z);
          const float weight = k * k / (sigma * sigma);
          const Eigen::Vector3f a = prior_from_reference.rotate(n_r.x(), n_r.y(), n_r.z());
          const Eigen::Vector3f m = cross(prior_from_camera(px, py, z), a);
          add_row({a.x(), a.y(), a.z(), m.x(), m.y(), m.z()}, weight, r, Hr, br);
          ++n;
        }
      }
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) H(i, j) += static_cast<double>(i >= j ? Hr[i][j] : Hr[j][i]);
        b(i) += static_cast<double>(br[i]);
      }
    }
    if (judged > 0) cost /= judged;
    if (n > kIndependent) {
      const double s = static_cast<double>(kIndependent) / n;
      H *= s;
      b *= s;
    }
    return n;
  };

  Matrix6 H;
  Twist b;
  int judged = 0;
  constexpr float gate_end = kGate / 3;
  double cost = 0;
  for (int k = 0; k < kIterations; ++k) {
    const float s = static_cast<float>(k) / static_cast<float>(kIterations - 1);
    result.points = accumulate(D, kGate + s * (gate_end - kGate), H, b, cost, judged);
    if (result.points < kMinPoints) {
      result.status = Status::TooFewPixels;
      return result;
    }
    const Twist step = -solve_symmetric(H + prior, b + prior * se3_log(D));
    if (!all_finite(step)) {
      result.status = Status::SingularSystem;
      return result;
    }
    D = normalized(compose(se3_exp(step), D));
    if (translation_norm(step) < 2e-4 && rotation_norm(step) < 1e-4 && s > 0.5F) break;
  }
  int judged_prior = 0;
  accumulate(identity_pose(), gate_end, H, b, result.mean_cost_prior, judged_prior);
  result.points = accumulate(D, gate_end, H, b, result.mean_cost, judged);
  // a real correction makes more points agree; otherwise the prior stands
  if (!(result.mean_cost < result.mean_cost_prior) || judged < judged_prior / 2 || !is_finite(D)) {
    result.status = Status::Diverged;
    return result;
  }
  result.status = Status::Converged;
  result.T_world_camera = normalized(compose(T_world_camera_prior, D));
  return result;
}

APSO_NAMESPACE_END
