/// \file
/// Bundle adjustment of the last keyframes and the landmarks they see.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/tracker/solvers/pose_optimisation.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Poses, points and observations of a small bundle adjustment.
struct AdjustmentProblem {
  struct View {
    int pose = 0;                  ///< index into T_camera_world
    PointObservation observation;  ///< its `point` is not used
  };
  struct Point {
    Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< world frame [m]; refined
    int first = 0;                                    ///< its views are views[first] .. views[first + count - 1]
    int count = 0;
  };
  std::vector<Pose> T_camera_world;  ///< refined, unless fixed
  std::vector<char> fixed;           ///< for each pose
  std::vector<Point> points;
  std::vector<View> views;
};

struct AdjustmentResult {
  Status status = Status::NotRun;
  double cost_before = 0;
  double cost_after = 0;
  int iterations = 0;
};

namespace detail {
inline double adjustment_cost(const Pinhole& camera, const AdjustmentProblem& problem, const std::vector<Pose>& poses,
                              const std::vector<Eigen::Vector3d>& points) {
  double cost = 0;
  Eigen::Vector3d r;
  for (std::size_t i = 0; i < problem.points.size(); ++i) {
    const AdjustmentProblem::Point& point = problem.points[i];
    for (int k = point.first; k < point.first + point.count; ++k) {
      const AdjustmentProblem::View& view = problem.views[static_cast<std::size_t>(k)];
      if (!view.observation.inlier) continue;
      const double limit = chi2_limit(view.observation);
      if (!point_residual(camera, view.observation, poses[static_cast<std::size_t>(view.pose)] * points[i], r)) {
        cost += 100 * limit;
        continue;
      }
      const double e2 = r.squaredNorm();
      cost += e2 <= limit ? e2 : 2 * std::sqrt(limit * e2) - limit;
    }
  }
  return cost;
}
}  // namespace detail

/// Levenberg-Marquardt with Huber weights; landmarks are eliminated by the Schur complement (Triggs et al. 2000).
/// Views with `inlier == false` are left out; on return outliers by the chi-square test are marked.
inline AdjustmentResult adjust(const Pinhole& camera, AdjustmentProblem& problem, int iterations = 5) {
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  using Matrix63 = Eigen::Matrix<double, 6, 3>;
  AdjustmentResult result;
  std::vector<int> slot(problem.T_camera_world.size(), -1);
  int n = 0;
  for (std::size_t i = 0; i < slot.size(); ++i)
    if (!problem.fixed[i]) slot[i] = n++;
  std::vector<Eigen::Vector3d> points(problem.points.size());
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = problem.points[i].point;
  std::vector<Pose> poses = problem.T_camera_world;
  double cost = detail::adjustment_cost(camera, problem, poses, points);
  result.cost_before = cost;
  double lambda = 1e-4;
  struct Elimination {
    Eigen::Matrix3d inverse;
    Eigen::Vector3d b;
    int first_block = 0;
    int blocks = 0;
  };
  std::vector<Elimination> eliminated(points.size());
  std::vector<std::pair<int, Matrix63>> blocks;
  blocks.reserve(problem.views.size());
  for (int iteration = 0; iteration < iterations; ++iteration) {
    Eigen::MatrixXd S = Eigen::MatrixXd::Zero(6 * n, 6 * n);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(6 * n);
    blocks.clear();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const AdjustmentProblem::Point& point = problem.points[i];
      Eigen::Matrix3d V = Eigen::Matrix3d::Zero();
      Eigen::Vector3d b = Eigen::Vector3d::Zero();
      const int first = static_cast<int>(blocks.size());
      for (int k = point.first; k < point.first + point.count; ++k) {
        const AdjustmentProblem::View& view = problem.views[static_cast<std::size_t>(k)];
        if (!view.observation.inlier) continue;
        const Pose& T = poses[static_cast<std::size_t>(view.pose)];
        const Eigen::Vector3d p = T * points[i];
        Eigen::Vector3d r;
        Eigen::Matrix3d J = Eigen::Matrix3d::Zero();
        if (!point_residual(camera, view.observation, p, r, &J)) continue;
        const double limit = chi2_limit(view.observation);
        const double e2 = r.squaredNorm();
        const double w = view.observation.weight * (e2 > limit ? std::sqrt(limit / e2) : 1.0);
        const Eigen::Matrix3d Jp = J * T.linear();
        V.noalias() += w * Jp.transpose() * Jp;
        b.noalias() -= w * Jp.transpose() * r;
        const int s = slot[static_cast<std::size_t>(view.pose)];
        if (s < 0) continue;
        const Eigen::Matrix<double, 3, 6> Jt = J * point_twist_jacobian(p);
        Matrix6d U = w * Jt.transpose() * Jt;
        U.diagonal() *= 1 + lambda;
        S.block<6, 6>(6 * s, 6 * s) += U;
        g.segment<6>(6 * s) -= w * Jt.transpose() * r;
        blocks.emplace_back(s, Matrix63(w * Jt.transpose() * Jp));
      }
      V.diagonal() *= 1 + lambda;
      V.diagonal().array() += 1e-6;
      Elimination& e = eliminated[i];
      e.inverse = V.inverse();
      e.b = b;
      e.first_block = first;
      e.blocks = static_cast<int>(blocks.size()) - first;
      for (int a = 0; a < e.blocks; ++a) {
        const auto& A = blocks[static_cast<std::size_t>(first + a)];
        const Matrix63 AV = A.second * e.inverse;
        g.segment<6>(6 * A.first) -= AV * b;
        for (int c = a; c < e.blocks; ++c) {
          const auto& C = blocks[static_cast<std::size_t>(first + c)];
          const Matrix6d block = AV * C.second.transpose();
          S.block<6, 6>(6 * A.first, 6 * C.first) -= block;
          if (c != a) S.block<6, 6>(6 * C.first, 6 * A.first) -= block.transpose();
        }
      }
    }
    S.diagonal().array() += 1e-9;
    const Eigen::LDLT<Eigen::MatrixXd> ldlt(S);
    const Eigen::VectorXd step = ldlt.solve(g);
    if (ldlt.info() != Eigen::Success || !step.allFinite()) {
      result.status = Status::SingularSystem;
      break;
    }
    std::vector<Pose> new_poses = poses;
    for (std::size_t i = 0; i < poses.size(); ++i)
      if (slot[i] >= 0) new_poses[i] = normalized(se3_exp(Twist(step.segment<6>(6 * slot[i]))) * poses[i]);
    std::vector<Eigen::Vector3d> new_points = points;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Elimination& e = eliminated[i];
      Eigen::Vector3d b = e.b;
      for (int a = 0; a < e.blocks; ++a) {
        const auto& A = blocks[static_cast<std::size_t>(e.first_block + a)];
        b -= A.second.transpose() * step.segment<6>(6 * A.first);
      }
      const Eigen::Vector3d d = e.inverse * b;
      if (d.allFinite()) new_points[i] += d;
    }
    const double new_cost = detail::adjustment_cost(camera, problem, new_poses, new_points);
    ++result.iterations;
    if (new_cost < cost) {
      const double gain = cost - new_cost;
      poses.swap(new_poses);
      points.swap(new_points);
      cost = new_cost;
      lambda = std::max(1e-8, lambda * 0.1);
      result.status = Status::Converged;
      if (gain < 1e-4 * cost) break;
    } else {
      lambda *= 10;
      if (lambda > 1e3) break;
    }
  }
  result.cost_after = cost;
  if (!succeeded(result.status)) return result;
  problem.T_camera_world = std::move(poses);
  for (std::size_t i = 0; i < points.size(); ++i) {
    AdjustmentProblem::Point& point = problem.points[i];
    point.point = points[i];
    for (int k = point.first; k < point.first + point.count; ++k) {
      AdjustmentProblem::View& view = problem.views[static_cast<std::size_t>(k)];
      Eigen::Vector3d r;
      view.observation.inlier =
          point_residual(camera, view.observation, problem.T_camera_world[static_cast<std::size_t>(view.pose)] * points[i],
                         r) &&
          r.squaredNorm() <= chi2_limit(view.observation);
    }
  }
  return result;
}

APSO_NAMESPACE_END
