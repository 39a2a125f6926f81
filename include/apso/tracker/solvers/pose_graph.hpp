/// \file
/// Poses that fit measured motions between them: a loop's error is spread over its edges (Lu & Milios, Autonomous Robots 1997).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/status.hpp>

APSO_NAMESPACE_BEGIN

/// A measured motion between two nodes. All are taken for equally exact.
struct PoseGraphEdge {
  int from = 0;
  int to = 0;
  Pose T_from_to = identity_pose();
};

struct PoseGraph {
  std::vector<Pose> T_world_node;
  std::vector<char> fixed;  ///< one of each connected piece at least
  std::vector<PoseGraphEdge> edges;
};

/// By how much an edge is missed: Log(T_from_to^-1 T_world_from^-1 T_world_to), translation first.
[[nodiscard]] inline Twist edge_residual(const PoseGraphEdge& edge, const Pose& T_world_from, const Pose& T_world_to) {
  return se3_log(compose(inverse(edge.T_from_to), compose(inverse(T_world_from), T_world_to)));
}

/// Its derivative by an increment of T_world_to from the left; that by one of T_world_from is the negative. The inverse of the right
/// Jacobian of SE(3) is its series up to the second order, I + ad(e)/2 + ad(e)^2/12; the next term is -ad(e)^4/720.
[[nodiscard]] inline Matrix6 edge_jacobian(const Twist& residual, const Pose& T_world_to) {
  const Eigen::Matrix3d V = skew({residual(0), residual(1), residual(2)});
  const Eigen::Matrix3d W = skew({residual(3), residual(4), residual(5)});
  Matrix6 ad = zeros<Matrix6>();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      ad(i, j) = ad(3 + i, 3 + j) = W(i, j);
      ad(i, 3 + j) = V(i, j);
    }
  }
  return (identity<Matrix6>() + 0.5 * ad + (1.0 / 12) * (ad * ad)) * adjoint_inverse(T_world_to);
}

namespace detail {

/// A radian counts as so many metres: what lies at this distance moves by as much.
inline constexpr double kArm = 2.0;

[[nodiscard]] inline Twist weighted(Twist e) {
  for (int i = 3; i < 6; ++i) e(i) *= kArm * kArm;
  return e;
}

/// The normal equations of a pose graph, solved by conjugate gradients with the blocks of the diagonal as preconditioner
/// (Golub & Van Loan, Matrix Computations, 11.5): the memory is that of the graph, however long the loop is.
class PoseGraphStep {
 public:
  /// The sum of squares at the poses of the graph.
  double linearise(const PoseGraph& graph) {
    const std::size_t n = graph.T_world_node.size();
    J_.clear();
    gradient_.assign(n, zeros<Twist>());
    diagonal_.assign(n, zeros<Matrix6>());
    double sum = 0;
    for (const PoseGraphEdge& edge : graph.edges) {
      const auto from = static_cast<std::size_t>(edge.from);
      const auto to = static_cast<std::size_t>(edge.to);
      const Twist e = edge_residual(edge, graph.T_world_node[from], graph.T_world_node[to]);
      const Matrix6 J = edge_jacobian(e, graph.T_world_node[to]);
      J_.push_back(J);
      sum += dot(e, weighted(e));
      const Twist g = transposed_times(J, weighted(e));
      gradient_[to] = gradient_[to] + g;
      gradient_[from] = gradient_[from] - g;
      Matrix6 WJ = J;
      for (int j = 0; j < 6; ++j)
        for (int i = 3; i < 6; ++i) WJ(i, j) *= kArm * kArm;
      const Matrix6 H = transposed_times(J, WJ);
      diagonal_[to] = diagonal_[to] + H;
      diagonal_[from] = diagonal_[from] + H;
    }
    return sum;
  }

  /// The increments, from the left; 0 for nodes that are fixed.
  const std::vector<Twist>& solve(const PoseGraph& graph) {
    constexpr double kSmall = 1e-16;  // of the first squared residual
    const std::size_t n = graph.T_world_node.size();
    x_.assign(n, zeros<Twist>());
    residual_.assign(n, zeros<Twist>());
    for (std::size_t i = 0; i < n; ++i)
      if (!graph.fixed[i]) residual_[i] = -1.0 * gradient_[i];
    precondition(graph);
    direction_ = preconditioned_;
    double rz = product(residual_, preconditioned_);
    const double first = rz;
    for (std::size_t iteration = 0; iteration < 6 * n && rz > kSmall * first; ++iteration) {
      multiply(graph);
      const double curvature = product(direction_, image_);
      if (!(curvature > 0)) break;
      const double step = rz / curvature;
      for (std::size_t i = 0; i < n; ++i) {
        x_[i] = x_[i] + step * direction_[i];
        residual_[i] = residual_[i] - step * image_[i];
      }
      precondition(graph);
      const double next = product(residual_, preconditioned_);
      for (std::size_t i = 0; i < n; ++i) direction_[i] = preconditioned_[i] + (next / rz) * direction_[i];
      rz = next;
    }
    return x_;
  }

 private:
  static double product(const std::vector<Twist>& a, const std::vector<Twist>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += dot(a[i], b[i]);
    return sum;
  }
  void precondition(const PoseGraph& graph) {
    preconditioned_.assign(residual_.size(), zeros<Twist>());
    for (std::size_t i = 0; i < residual_.size(); ++i)
      if (!graph.fixed[i]) preconditioned_[i] = solve_symmetric(diagonal_[i], residual_[i]);
  }
  void multiply(const PoseGraph& graph) {
    image_.assign(direction_.size(), zeros<Twist>());
    for (std::size_t k = 0; k < graph.edges.size(); ++k) {
      const auto from = static_cast<std::size_t>(graph.edges[k].from);
      const auto to = static_cast<std::size_t>(graph.edges[k].to);
      const Twist force = transposed_times(J_[k], weighted(J_[k] * (direction_[to] - direction_[from])));
      image_[to] = image_[to] + force;
      image_[from] = image_[from] - force;
    }
    for (std::size_t i = 0; i < image_.size(); ++i)
      if (graph.fixed[i]) image_[i] = zeros<Twist>();
  }

  std::vector<Matrix6> J_;
  std::vector<Matrix6> diagonal_;
  std::vector<Twist> gradient_, x_, residual_, preconditioned_, direction_, image_;
};

}  // namespace detail

/// Moves the nodes that are not fixed to where the edges are missed least, in the least-squares sense (Gauss-Newton). O(edges sqrt(n))
/// to O(edges n) an iteration for n nodes.
/// \param[in,out] graph unchanged unless that succeeds
inline Status optimise_pose_graph(PoseGraph& graph) {
  constexpr int kIterations = 20;
  constexpr double kDone = 1e-9;  // [m], [rad]
  detail::PoseGraphStep step;
  PoseGraph trial = graph;
  double cost = step.linearise(trial);
  Status status = Status::MaxIterations;
  for (int i = 0; i < kIterations && status == Status::MaxIterations; ++i) {
    double largest = 0;
    const std::vector<Twist>& x = step.solve(trial);
    const std::vector<Pose> before = trial.T_world_node;
    for (std::size_t k = 0; k < x.size(); ++k) {
      if (trial.fixed[k]) continue;
      trial.T_world_node[k] = normalized(compose(se3_exp(x[k]), trial.T_world_node[k]));
      largest = std::max({largest, translation_norm(x[k]), rotation_norm(x[k])});
    }
    const double now = step.linearise(trial);
    if (!std::isfinite(largest) || !std::isfinite(now)) return Status::Diverged;
    if (largest < kDone) status = Status::Converged;
    if (now > cost) {  // no descent from here: as good as it gets, or worse than linear
      trial.T_world_node = before;
      status = i > 0 || largest < kDone ? Status::Converged : Status::Diverged;
    }
    cost = now;
  }
  if (succeeded(status)) graph.T_world_node.swap(trial.T_world_node);
  return status;
}

APSO_NAMESPACE_END
