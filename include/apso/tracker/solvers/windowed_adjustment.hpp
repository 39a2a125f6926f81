/// \file
/// Bundle adjustment of the last keyframes and the landmarks they see.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/status.hpp>
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
    Eigen::Vector3d point = zeros<Eigen::Vector3d>();  ///< world frame [m]; refined
    int first = 0;                                     ///< its views are views[first] .. views[first + count - 1]
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
      if (!point_residual(camera, view.observation, transform(poses[static_cast<std::size_t>(view.pose)], points[i]), r)) {
        cost += 100 * limit;
        continue;
      }
      const double e2 = squared_norm(r);
      cost += e2 <= limit ? e2 : 2 * std::sqrt(limit * e2) - limit;
    }
  }
  return cost;
}

/// Derivatives of the residual of a view, and its weight.
struct ViewJacobians {
  double weight = 0;
  double residual[3];
  double pose[3][6];   // with respect to the twist of the pose
  double point[3][3];  // with respect to the world point
};
inline bool view_jacobians(const Pinhole& camera, const PointObservation& o, const Pose& T_camera_world, const Eigen::Vector3d& point,
                           ViewJacobians& out) {
  const Eigen::Vector3d p = transform(T_camera_world, point);
  Eigen::Vector3d r;
  Eigen::Matrix3d J;
  if (!point_residual(camera, o, p, r, &J)) return false;
  const double limit = chi2_limit(o);
  const double e2 = squared_norm(r);
  out.weight = o.weight * (e2 > limit ? std::sqrt(limit / e2) : 1.0);
  twist_jacobian(J, p, out.pose);
  for (int k = 0; k < 3; ++k) {
    out.residual[k] = r(k);
    for (int i = 0; i < 3; ++i)
      out.point[k][i] = J(k, 0) * T_camera_world(0, i) + J(k, 1) * T_camera_world(1, i) + J(k, 2) * T_camera_world(2, i);
  }
  return true;
}

/// Inverse of a symmetric positive definite 3 x 3 matrix by its cofactors.
inline void invert_symmetric(const double (&V)[3][3], double (&inverse)[3][3]) {
  const double c0 = V[1][1] * V[2][2] - V[1][2] * V[2][1];
  const double c1 = V[1][2] * V[2][0] - V[1][0] * V[2][2];
  const double c2 = V[1][0] * V[2][1] - V[1][1] * V[2][0];
  const double scale = 1.0 / (V[0][0] * c0 + V[0][1] * c1 + V[0][2] * c2);
  inverse[0][0] = c0 * scale;
  inverse[1][0] = inverse[0][1] = c1 * scale;
  inverse[2][0] = inverse[0][2] = c2 * scale;
  inverse[1][1] = (V[0][0] * V[2][2] - V[0][2] * V[2][0]) * scale;
  inverse[2][1] = inverse[1][2] = (V[0][1] * V[2][0] - V[0][0] * V[2][1]) * scale;
  inverse[2][2] = (V[0][0] * V[1][1] - V[0][1] * V[1][0]) * scale;
}

/// Normal equations of the poses that are not fixed, after the points were eliminated (Schur complement).
class ReducedEquations {
 public:
  /// \param views room for so many of poses that are not fixed
  explicit ReducedEquations(std::size_t views) {
    blocks_.reserve(views);
    eliminated_.reserve(views / 2);
  }
  void resize(int poses, std::size_t points) {
    n_ = 6 * static_cast<std::size_t>(poses);
    eliminated_.resize(points);
  }

  /// Gathers everything at the current poses and points.
  /// \param slot place of each pose among those that are not fixed, -1 = fixed
  void build(const Pinhole& camera, const AdjustmentProblem& problem, const std::vector<int>& slot, const std::vector<Pose>& poses,
             const std::vector<Eigen::Vector3d>& points, double lambda) {
    S_.assign(n_ * n_, 0.0);
    g_.assign(n_, 0.0);
    blocks_.clear();
    ViewJacobians view;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const AdjustmentProblem::Point& point = problem.points[i];
      double V[3][3] = {};
      Eliminated& e = eliminated_[i];
      e = Eliminated{};
      e.first = blocks_.size();
      for (int k = point.first; k < point.first + point.count; ++k) {
        const AdjustmentProblem::View& seen = problem.views[static_cast<std::size_t>(k)];
        const auto pose = static_cast<std::size_t>(seen.pose);
        if (!seen.observation.inlier || !view_jacobians(camera, seen.observation, poses[pose], points[i], view)) continue;
        for (int a = 0; a < 3; ++a) {
          for (int b = 0; b < 3; ++b) V[a][b] += view.weight * product(view.point, a, view.point, b);
          e.b[a] -= view.weight * times_residual(view.point, a, view.residual);
        }
        if (slot[pose] >= 0) add_pose(static_cast<std::size_t>(slot[pose]), view, lambda);
      }
      for (int a = 0; a < 3; ++a) V[a][a] = V[a][a] * (1 + lambda) + 1e-6;
      invert_symmetric(V, e.inverse);
      e.last = blocks_.size();
      eliminate(e);
    }
    for (std::size_t i = 0; i < n_; ++i) S_[i * n_ + i] += 1e-9;
  }

  /// Solves for the poses. \return false when the system is singular
  [[nodiscard]] bool solve() {
    if (!solve_definite(S_, g_)) return false;
    for (double x : g_) {
      if (!std::isfinite(x)) return false;
    }
    return true;
  }
  /// Step of the pose in a slot, after solve().
  [[nodiscard]] Twist pose_step(int slot) const {
    Twist step;
    for (int i = 0; i < 6; ++i) step(i) = g_[6 * static_cast<std::size_t>(slot) + static_cast<std::size_t>(i)];
    return step;
  }
  /// Step of a point, after solve().
  [[nodiscard]] Eigen::Vector3d point_step(std::size_t i) const {
    const Eliminated& e = eliminated_[i];
    double b[3] = {e.b[0], e.b[1], e.b[2]};
    for (std::size_t k = e.first; k < e.last; ++k) {
      const double* step = g_.data() + 6 * blocks_[k].slot;
      for (int c = 0; c < 3; ++c) {
        for (int r = 0; r < 6; ++r) b[c] -= blocks_[k].W[r][c] * step[r];
      }
    }
    Eigen::Vector3d d;
    for (int r = 0; r < 3; ++r) d(r) = e.inverse[r][0] * b[0] + e.inverse[r][1] * b[1] + e.inverse[r][2] * b[2];
    return d;
  }

 private:
  struct Block {  // what couples a pose with a point
    std::size_t slot;
    double W[6][3];
  };
  struct Eliminated {
    double inverse[3][3] = {};
    double b[3] = {};
    std::size_t first = 0;  // its blocks
    std::size_t last = 0;
  };

  template <int N, int M>
  [[nodiscard]] static double product(const double (&A)[3][N], int a, const double (&B)[3][M], int b) {
    return A[0][a] * B[0][b] + A[1][a] * B[1][b] + A[2][a] * B[2][b];
  }
  template <int N>
  [[nodiscard]] static double times_residual(const double (&A)[3][N], int a, const double (&r)[3]) {
    return A[0][a] * r[0] + A[1][a] * r[1] + A[2][a] * r[2];
  }

  void add_pose(std::size_t slot, const ViewJacobians& view, double lambda) {
    Block block;
    block.slot = slot;
    for (int i = 0; i < 6; ++i) {
      double* row = S_.data() + (6 * slot + static_cast<std::size_t>(i)) * n_ + 6 * slot;
      for (int j = 0; j <= i; ++j) row[j] += view.weight * product(view.pose, i, view.pose, j) * (i == j ? 1 + lambda : 1.0);
      g_[6 * slot + static_cast<std::size_t>(i)] -= view.weight * times_residual(view.pose, i, view.residual);
      for (int j = 0; j < 3; ++j) block.W[i][j] = view.weight * product(view.pose, i, view.point, j);
    }
    blocks_.push_back(block);
  }

  void eliminate(const Eliminated& e) {
    for (std::size_t a = e.first; a < e.last; ++a) {
      const Block& A = blocks_[a];
      double AV[6][3];
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 3; ++j) AV[i][j] = A.W[i][0] * e.inverse[0][j] + A.W[i][1] * e.inverse[1][j] + A.W[i][2] * e.inverse[2][j];
        g_[6 * A.slot + static_cast<std::size_t>(i)] -= AV[i][0] * e.b[0] + AV[i][1] * e.b[1] + AV[i][2] * e.b[2];
      }
      for (std::size_t c = e.first; c < e.last; ++c) {
        const Block& C = blocks_[c];
        if (C.slot > A.slot) continue;  // only the lower triangle is kept
        for (int i = 0; i < 6; ++i) {
          double* row = S_.data() + (6 * A.slot + static_cast<std::size_t>(i)) * n_ + 6 * C.slot;
          for (int j = 0; j < 6; ++j) row[j] -= AV[i][0] * C.W[j][0] + AV[i][1] * C.W[j][1] + AV[i][2] * C.W[j][2];
        }
      }
    }
  }

  std::size_t n_ = 0;
  std::vector<double> S_;  // n x n, lower triangle
  std::vector<double> g_;  // right side, then the solution
  std::vector<Eliminated> eliminated_;
  std::vector<Block> blocks_;
};
}  // namespace detail

/// What an adjustment works on, kept from one to the next: the busiest window of a long run takes no memory of its own.
struct AdjustmentBuffers {
  static constexpr std::size_t kViews = 4096;  ///< room for so many from the beginning; there is more when it is needed
  AdjustmentBuffers() : equations(kViews) {
    problem.views.reserve(kViews);
    problem.points.reserve(kViews / 2);  // a point that one view sees is not adjusted
    points.reserve(kViews / 2);
    new_points.reserve(kViews / 2);
  }
  /// The problem, empty.
  AdjustmentProblem& fresh() {
    problem.T_camera_world.clear();
    problem.fixed.clear();
    problem.points.clear();
    problem.views.clear();
    return problem;
  }
  AdjustmentProblem problem;
  detail::ReducedEquations equations;
  std::vector<int> slot;
  std::vector<Pose> poses, new_poses;
  std::vector<Eigen::Vector3d> points, new_points;
};

/// Levenberg-Marquardt with Huber weights; landmarks are eliminated by the Schur complement (Triggs et al. 2000).
/// Views with `inlier == false` are left out; on return outliers by the chi-square test are marked.
/// \param problem may be that of the buffers
inline AdjustmentResult adjust_window(const Pinhole& camera, AdjustmentProblem& problem, AdjustmentBuffers& buffers, int iterations = 5) {
  AdjustmentResult result;
  auto& [own, equations, slot, poses, new_poses, points, new_points] = buffers;
  (void)own;
  slot.assign(problem.T_camera_world.size(), -1);
  int n = 0;
  for (std::size_t i = 0; i < slot.size(); ++i)
    if (!problem.fixed[i]) slot[i] = n++;
  poses = problem.T_camera_world;
  points.clear();
  for (const AdjustmentProblem::Point& p : problem.points) points.push_back(p.point);
  double cost = detail::adjustment_cost(camera, problem, poses, points);
  result.cost_before = cost;
  double lambda = 1e-4;
  equations.resize(n, points.size());
  for (int iteration = 0; iteration < iterations; ++iteration) {
    equations.build(camera, problem, slot, poses, points, lambda);
    if (!equations.solve()) {
      result.status = Status::SingularSystem;
      break;
    }
    new_poses = poses;
    for (std::size_t i = 0; i < poses.size(); ++i)
      if (slot[i] >= 0) new_poses[i] = normalized(compose(se3_exp(equations.pose_step(slot[i])), poses[i]));
    new_points = points;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d d = equations.point_step(i);
      if (all_finite(d)) new_points[i] = points[i] + d;
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
  problem.T_camera_world.swap(poses);
  for (std::size_t i = 0; i < points.size(); ++i) {
    AdjustmentProblem::Point& point = problem.points[i];
    point.point = points[i];
    for (int k = point.first; k < point.first + point.count; ++k) {
      AdjustmentProblem::View& view = problem.views[static_cast<std::size_t>(k)];
      const Pose& T = problem.T_camera_world[static_cast<std::size_t>(view.pose)];
      Eigen::Vector3d r;
      view.observation.inlier =
          point_residual(camera, view.observation, transform(T, points[i]), r) && squared_norm(r) <= chi2_limit(view.observation);
    }
  }
  return result;
}

APSO_NAMESPACE_END
