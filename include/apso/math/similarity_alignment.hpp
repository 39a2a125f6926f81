/// \file
/// Least-squares motions with one freedom more or two less than a rigid one: with a scale, and with a turn about one axis only.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/rigid_alignment.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>

APSO_NAMESPACE_BEGIN

/// Axis of a coordinate system.
enum class Axis { X, Y, Z };
[[nodiscard]] constexpr std::array<const char*, 3> enum_names(Axis) { return {"x", "y", "z"}; }

namespace detail {
[[nodiscard]] inline Eigen::Vector3d mean_point(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d sum(0, 0, 0);
  for (const Eigen::Vector3d& p : points) sum += p;
  return 1.0 / static_cast<double>(points.size()) * sum;
}
}  // namespace detail

/// The similarity that lays points onto points: target = scale * R * source + t.
struct SimilarityAlignment {
  double scale = 1;                        ///< 1 where the points do not fix it (rank 0)
  Pose T_target_source = identity_pose();  ///< R and t
  int rank = 0;                            ///< as in HornAlignment
};

/// Least-squares similarity: minimises sum |s R source_i + t - target_i|^2. The rotation is that of align_horn, which does not depend on
/// the scale; the scale follows from it, S. Umeyama, IEEE TPAMI 1991, eq. (42).
/// \param target,source points of the same length [m], at least one
[[nodiscard]] inline SimilarityAlignment align_umeyama(const std::vector<Eigen::Vector3d>& target,
                                                       const std::vector<Eigen::Vector3d>& source) {
  const HornAlignment horn = align_horn(target, source);
  SimilarityAlignment result{1, horn.T_target_source, horn.rank};
  if (horn.rank == 0) return result;
  // The rigid motion lays the mean of the sources onto that of the targets; what is left around it is turned and scaled.
  const Eigen::Vector3d mean_target = detail::mean_point(target);
  const Eigen::Vector3d mean_source = detail::mean_point(source);
  const Eigen::Matrix3d R = rotation(horn.T_target_source);
  double together = 0;
  double spread = 0;
  for (std::size_t i = 0; i < target.size(); ++i) {
    const Eigen::Vector3d p = source[i] - mean_source;
    together += dot(target[i] - mean_target, R * p);
    spread += squared_norm(p);
  }
  const double scale = together / spread;
  if (!(scale > 0) || !std::isfinite(scale)) return result;
  result.scale = scale;
  result.T_target_source = make_pose(R, mean_target - scale * (R * mean_source));
  return result;
}

/// A rigid motion whose rotation leaves one axis where it is.
struct YawAlignment {
  Pose T_target_source = identity_pose();
  bool unique = false;  ///< false: the points do not fix the angle, which is then 0
};

/// Least-squares translation and turn about an axis that both worlds share, as gravity is for a camera with an inertial sensor: minimises
/// sum |R(angle) source_i + t - target_i|^2. In the plane across the axis the angle is that of the sum of the complex products of target
/// and conjugate source (the planar case of Horn, JOSA A 1987, section 4).
/// \param target,source points of the same length [m], at least one
[[nodiscard]] inline YawAlignment align_about_axis(const std::vector<Eigen::Vector3d>& target, const std::vector<Eigen::Vector3d>& source,
                                                   Axis axis) {
  expects(!target.empty() && target.size() == source.size(), "align_about_axis: need equally many points, at least one");
  const Eigen::Vector3d mean_target = detail::mean_point(target);
  const Eigen::Vector3d mean_source = detail::mean_point(source);
  expects(all_finite(mean_target) && all_finite(mean_source), "align_about_axis: points must be finite");
  const int k = static_cast<int>(axis);
  const int u = (k + 1) % 3;  // u, v, axis is right-handed
  const int v = (k + 2) % 3;
  double cosine = 0;
  double sine = 0;
  double size = 0;
  for (std::size_t i = 0; i < target.size(); ++i) {
    const Eigen::Vector3d q = target[i] - mean_target;
    const Eigen::Vector3d p = source[i] - mean_source;
    cosine += p(u) * q(u) + p(v) * q(v);
    sine += p(u) * q(v) - p(v) * q(u);
    size += norm(p) * norm(q);
  }
  expects(std::isfinite(size), "align_about_axis: points must be finite and not overflow when squared");
  YawAlignment result;
  const double length = std::hypot(cosine, sine);
  // Points that only differ by rounding have no direction: 1e-12 of the coordinates' own size, as in align_horn.
  const double rounding = 1e-12 * (norm(mean_target) + norm(mean_source));
  result.unique = length > 1e-12 * size && length > static_cast<double>(target.size()) * rounding * rounding;
  Eigen::Matrix3d R = identity<Eigen::Matrix3d>();
  if (result.unique) {
    R(u, u) = R(v, v) = cosine / length;
    R(v, u) = sine / length;
    R(u, v) = -sine / length;
  }
  result.T_target_source = make_pose(R, mean_target - R * mean_source);
  return result;
}

APSO_NAMESPACE_END
