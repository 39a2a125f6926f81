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
#include <apso/observation/free_space.hpp>
#include <apso/status.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

struct BackgroundRegistrationOptions {
  int iterations = 5;              ///< Gauss-Newton steps
  int stride = 3;                  ///< use every stride-th row and column of the small depth image
  double gate = 0.15;              ///< largest distance to the plane in the first step [m]; ends at a third of it
  double sigma_translation = 0.03; ///< standard deviation of the prior [m]
  double sigma_rotation = 0.015;   ///< standard deviation of the prior [rad]
  int independent = 200;           ///< the residuals count as this many independent ones (they are correlated)
  int min_points = 150;            ///< fewer than this leave the prior as it is
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("iterations", s.iterations, 0, 100);
    v("stride", s.stride, 1, 64);
    v("gate", s.gate, 1e-3, 10.0);
    v("sigma_translation", s.sigma_translation, 1e-6, 100.0);
    v("sigma_rotation", s.sigma_rotation, 1e-6, 10.0);
    v("independent", s.independent, 1, 1000000);
    v("min_points", s.min_points, 1, 1000000);
  }
};

struct BackgroundRegistration {
  Status status = Status::NotRun;
  Pose T_world_camera = Pose::Identity();  ///< the prior unless succeeded(status)
  int points = 0;                          ///< used in the last step
  double mean_cost_prior = 0;              ///< mean robust cost at the prior, [0,1]
  double mean_cost = 0;                    ///< ... and at the result
};

/// Point-to-plane registration by projective association (Chen & Medioni 1992; Rusinkiewicz & Levoy 2001) with
/// Tukey weights and the prior as a Gaussian, so that directions without structure stay at the prior.
inline BackgroundRegistration register_background(const Image<float>& depth, const Pinhole& camera,
                                                  const Pose& T_world_camera_prior,
                                                  const std::vector<const DepthReference*>& references,
                                                  const BackgroundRegistrationOptions& options) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix66 = Eigen::Matrix<double, 6, 6>;
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
  Matrix66 prior = Matrix66::Zero();
  for (int i = 0; i < 3; ++i) {
    prior(i, i) = 1.0 / (options.sigma_translation * options.sigma_translation);
    prior(i + 3, i + 3) = 1.0 / (options.sigma_rotation * options.sigma_rotation);
  }

  // the correction D moves points of the prior camera frame: T_world_camera = T_prior D
  Pose D = Pose::Identity();
  const auto accumulate = [&](const Pose& correction, float gate, Matrix66& H, Vector6& b, double& cost, int& judged) {
    H.setZero();
    b.setZero();
    cost = 0;
    judged = 0;
    int n = 0;
    for (const DepthReference* reference : references) {
      const Pose T_r_prior = inverse(reference->T_world_camera) * T_world_camera_prior;
      const Eigen::Matrix3f Rp = T_r_prior.linear().cast<float>();
      const Pose T_r_c = T_r_prior * correction;
      const Eigen::Matrix3f R = T_r_c.linear().cast<float>();
      const Eigen::Vector3f t = T_r_c.translation().cast<float>();
      const Eigen::Matrix3f Rc = correction.linear().cast<float>();
      const Eigen::Vector3f tc = correction.translation().cast<float>();
      Eigen::Matrix<float, 6, 6> Hr = Eigen::Matrix<float, 6, 6>::Zero();
      Eigen::Matrix<float, 6, 1> br = Eigen::Matrix<float, 6, 1>::Zero();
      for (int y = options.stride / 2; y < h; y += options.stride) {
        for (int x = options.stride / 2; x < w; x += options.stride) {
          const float z = depth(x, y);
          if (!(z > 0)) continue;
          const Eigen::Vector3f X((static_cast<float>(x) - cx) / fx * z, (static_cast<float>(y) - cy) / fy * z, z);
          const Eigen::Vector3f Y = R * X + t;
          if (!(Y.z() > 0.05F)) continue;
          const float u = fx * Y.x() / Y.z() + cx + 0.5F;
          const float v = fy * Y.y() / Y.z() + cy + 0.5F;
          if (!(u >= 0 && v >= 0 && u < static_cast<float>(w) && v < static_cast<float>(h))) continue;
          const int iu = static_cast<int>(u);
          const int iv = static_cast<int>(v);
          const auto i = static_cast<std::size_t>(iv) * static_cast<std::size_t>(w) + static_cast<std::size_t>(iu);
          const Eigen::Vector3f& n_r = reference->normals[i];
          if (reference->dynamic(iu, iv) != 0 || n_r.isZero()) continue;
          const float zr = reference->depth(iu, iv);
          const Eigen::Vector3f q((static_cast<float>(iu) - cx) / fx * zr, (static_cast<float>(iv) - cy) / fy * zr,
                                  zr);
          const float r = n_r.dot(Y - q);
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
          const Eigen::Vector3f n0 = Rp.transpose() * n_r;
          const Eigen::Vector3f Xc = Rc * X + tc;
          Eigen::Matrix<float, 6, 1> J;
          J.head<3>() = n0;
          J.tail<3>() = Xc.cross(n0);
          Hr.selfadjointView<Eigen::Lower>().rankUpdate(J, weight);
          br += (weight * r) * J;
          ++n;
        }
      }
      H += Eigen::Matrix<float, 6, 6>(Hr.selfadjointView<Eigen::Lower>()).cast<double>();
      b += br.cast<double>();
    }
    if (judged > 0) cost /= judged;
    if (n > options.independent) {
      const double s = static_cast<double>(options.independent) / n;
      H *= s;
      b *= s;
    }
    return n;
  };

  Matrix66 H;
  Vector6 b;
  int judged = 0;
  const auto gate0 = static_cast<float>(options.gate);
  const float gate_end = gate0 / 3;
  double cost = 0;
  for (int k = 0; k < options.iterations; ++k) {
    const float s = options.iterations > 1 ? static_cast<float>(k) / static_cast<float>(options.iterations - 1) : 1.0F;
    result.points = accumulate(D, gate0 + s * (gate_end - gate0), H, b, cost, judged);
    if (result.points < options.min_points) {
      result.status = Status::TooFewPixels;
      return result;
    }
    const Vector6 xi = se3_log(D);
    const Vector6 step = -solve_symmetric(Matrix66(H + prior), Vector6(b + prior * xi));
    if (!step.allFinite()) {
      result.status = Status::SingularSystem;
      return result;
    }
    D = normalized(se3_exp(Twist(step)) * D);
    if (step.head<3>().norm() < 2e-4 && step.tail<3>().norm() < 1e-4 && s > 0.5F) break;
  }
  int judged_prior = 0;
  accumulate(Pose::Identity(), gate_end, H, b, result.mean_cost_prior, judged_prior);
  result.points = accumulate(D, gate_end, H, b, result.mean_cost, judged);
  // a real correction makes more points agree; otherwise the prior stands
  if (!(result.mean_cost < result.mean_cost_prior) || judged < judged_prior / 2 || !is_finite(D)) {
    result.status = Status::Diverged;
    return result;
  }
  result.status = Status::Converged;
  result.T_world_camera = normalized(T_world_camera_prior * D);
  return result;
}

APSO_NAMESPACE_END
