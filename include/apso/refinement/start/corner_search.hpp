/// \file
/// Motions between two frames from matched corners, by RANSAC: where alignment may start when it finds nothing near the
/// initial guess.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/linear_congruential.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/refinement/start/corner_matching.hpp>

APSO_NAMESPACE_BEGIN

/// Estimates rigid motions between two frames by RANSAC (Fischler and Bolles, 1981): each hypothesis is the motion of three
/// matches that preserve their distances, scored by its inliers and refined on them. The second and third match are sampled
/// from those that preserve their distance to the first, so that a few right matches among many wrong ones are found.
/// Deterministic; keeps its buffers.
class CornerSearch {
 public:
  /// \param halvings of the full size at which corners are detected, about 160 x 120 pixels; those of the next finer level
  ///        are added if a mask leaves few
  /// \param T_current_reference receives motions, the one with the most inliers first, none twice; may stay empty
  void operator()(const FramePyramid& reference, const FramePyramid& current, int halvings, std::vector<Pose>& T_current_reference) {
    T_current_reference.clear();
    matches_.clear();
    const bool few = match_(reference.halved(halvings), current.halved(halvings), matches_) < kFewCorners;
    if (few && halvings > std::max(reference.finest(), current.finest()) &&
        current.halved(halvings - 1).camera.width <= FramePyramid::kCornerWidth) {
      match_(reference.halved(halvings - 1), current.halved(halvings - 1), matches_);
    }
    pack_matches();
    link_compatible();
    hypotheses_.clear();
    LinearCongruential random(1);
    inlier_.assign(all_.size(), 0.0F);
    pool_.clear();
    for (std::size_t i = 0; i < matches_.size(); ++i) pool_.push_back(i);
    sample_hypotheses(random);
    while (T_current_reference.size() < kMaxMotions && !hypotheses_.empty()) {
      const auto best = std::max_element(hypotheses_.begin(), hypotheses_.end(),
                                         [](const Hypothesis& a, const Hypothesis& b) { return a.inliers < b.inliers; });
      Pose T = best->T;
      for (int k = 0; k < 3; ++k) refine(T);
      T_current_reference.push_back(T);
      // hypotheses with mostly the same inliers are the same motion
      count_inliers(T, all_, &inlier_);
      hypotheses_.erase(std::remove_if(hypotheses_.begin(), hypotheses_.end(),
                                       [&](const Hypothesis& g) { return 2 * count_inliers(g.T, inlier_) > g.inliers; }),
                        hypotheses_.end());
      if (T_current_reference.size() == 1) {
        // nearly all triples are of the motion that most matches share; as many are sampled from the rest
        pool_.erase(std::remove_if(pool_.begin(), pool_.end(), [&](std::size_t i) { return inlier_[i] > 0; }), pool_.end());
        sample_hypotheses(random);
      }
    }
  }

  /// Motions with given rotations, their translation from one match each: a single right match will do. Of the matches that
  /// were found last.
  /// \param centre,radius of the translations of interest [m]
  /// \param min_distance of two translations of one rotation [m]
  /// \param T_current_reference receives them
  void with_rotations(const std::vector<Eigen::Matrix3d>& R_current_reference, const Eigen::Vector3d& centre, double radius,
                      double min_distance, std::vector<Pose>& T_current_reference) const {
    T_current_reference.clear();
    for (const Eigen::Matrix3d& R : R_current_reference) {
      const auto first = static_cast<std::ptrdiff_t>(T_current_reference.size());
      for (const CornerMatch& m : matches_) {
        const Eigen::Vector3d t = as_double(m.q) - R * as_double(m.p);
        const auto near = [&](const Pose& T) { return squared_norm(t - translation(T)) < min_distance * min_distance; };
        if (squared_norm(t - centre) > radius * radius ||
            std::any_of(T_current_reference.begin() + first, T_current_reference.end(), near)) {
          continue;
        }
        T_current_reference.push_back(make_pose(R, t));
      }
    }
  }

 private:
  static Eigen::Vector3d as_double(const Eigen::Vector3f& v) {
    return {static_cast<double>(v.x()), static_cast<double>(v.y()), static_cast<double>(v.z())};
  }

  static constexpr std::size_t kFewCorners = 100;  // corners of the reference
  static constexpr std::size_t kMinInliers = 4;
  static constexpr std::size_t kMaxHypotheses = 1000;
  static constexpr int kMaxTrials = 10000;
  static constexpr std::size_t kMaxMotions = 12;

  struct Hypothesis {
    Pose T;
    std::size_t inliers;
  };

  // Tolerances of an inlier, in depth [m] and across the ray as a tangent: noise and a little more, but less than what
  // moves between two frames.
  static float depth_tolerance(float z) { return 0.006F + 0.001F * z * z; }
  static float pixel_tolerance(const CornerMatch& m) { return 0.7F * m.pixel; }

  // The matches, kLanes of them at a time, side by side; what fills up the last ones is never an inlier.
  enum Field { kX, kY, kZ, kU, kV, kW, kInversePixelTolerance, kInverseDepthTolerance, kFields };
  void pack_matches() {
    const std::size_t groups = (matches_.size() + kLanes - 1) / kLanes;
    packed_.assign(groups * kFields * kLanes, 0.0F);
    all_.assign(groups * kLanes, 0.0F);
    for (std::size_t i = 0; i < groups * kLanes; ++i) {
      float* to = packed_.data() + i / kLanes * kFields * kLanes + i % kLanes;
      if (i >= matches_.size()) {
        to[kZ * kLanes] = 1;
        to[kW * kLanes] = 1e6F;
        to[kInverseDepthTolerance * kLanes] = 1;
        continue;
      }
      const CornerMatch& m = matches_[i];
      to[kX * kLanes] = m.p.x();
      to[kY * kLanes] = m.p.y();
      to[kZ * kLanes] = m.p.z();
      to[kU * kLanes] = m.q.x() / m.q.z();
      to[kV * kLanes] = m.q.y() / m.q.z();
      to[kW * kLanes] = m.q.z();
      to[kInversePixelTolerance * kLanes] = 1 / pixel_tolerance(m);
      to[kInverseDepthTolerance * kLanes] = 1 / depth_tolerance(m.q.z());
      all_[i] = 1;
    }
  }

  // How many matches of weight 1 are inliers of a motion, and which of all.
  std::size_t count_inliers(const Pose& T_current_reference, const std::vector<float>& weight, std::vector<float>* which = nullptr) const {
    const FloatPose T(T_current_reference);
    if (which != nullptr) which->resize(all_.size());
    Lanes n = 0.0F;
    for (std::size_t i = 0; i < all_.size(); i += kLanes) {
      const float* m = packed_.data() + i * kFields;
      const auto field = [&](Field f) { return Lanes::load(m + f * kLanes); };
      const Lanes x = field(kX), y = field(kY), z = field(kZ);
      const auto row = [&](int r) { return T.R[r][0] * x + T.R[r][1] * y + T.R[r][2] * z + T.t[r]; };
      const Lanes depth = row(2);
      // tangents, times the depth: nothing is divided by what may be 0
      const Lanes du = row(0) - field(kU) * depth;
      const Lanes dv = row(1) - field(kV) * depth;
      const Lanes dw = (depth - field(kW)) * field(kInverseDepthTolerance);
      const Lanes inverse_tolerance = field(kInversePixelTolerance);
      const Lanes sideways = (du * du + dv * dv) * inverse_tolerance * inverse_tolerance;
      const Mask inlier = (depth > Lanes(0.0F)) & (sideways < (1.0F - dw * dw) * depth * depth);
      const Lanes inliers = select(inlier, Lanes(1.0F), Lanes(0.0F));
      if (which != nullptr) inliers.store(which->data() + i);
      n += inliers * Lanes::load(weight.data() + i);
    }
    return static_cast<std::size_t>(n.sum());
  }

  static bool preserves_distance(const CornerMatch& a, const CornerMatch& b) {
    const float length = norm(a.p - b.p);
    const float tolerance = 2 * (depth_tolerance(a.q.z()) + depth_tolerance(b.q.z()));
    return length > 0.15F && std::abs(length - norm(a.q - b.q)) < tolerance;
  }

  // For each match, those it preserves its distance to.
  void link_compatible() {
    compatible_.clear();
    first_compatible_.clear();
    for (const CornerMatch& a : matches_) {
      first_compatible_.push_back(compatible_.size());
      for (std::size_t j = 0; j < matches_.size(); ++j) {
        if (preserves_distance(a, matches_[j])) compatible_.push_back(j);
      }
    }
    first_compatible_.push_back(compatible_.size());
  }

  // Adds hypotheses of three matches of the pool each.
  void sample_hypotheses(LinearCongruential& random) {
    if (pool_.size() < kMinInliers) return;
    const auto below = [&](std::size_t n) { return static_cast<std::size_t>((static_cast<std::uint64_t>(random()) * n) >> 32U); };
    const std::size_t enough = hypotheses_.size() + kMaxHypotheses;
    for (int trial = 0; trial < kMaxTrials && hypotheses_.size() < enough; ++trial) {
      const std::size_t a = pool_[below(pool_.size())];
      const std::size_t n = first_compatible_[a + 1] - first_compatible_[a];
      if (n < 2) continue;
      const std::size_t b = compatible_[first_compatible_[a] + below(n)];
      const std::size_t c = compatible_[first_compatible_[a] + below(n)];
      if (inlier_[b] > 0 || inlier_[c] > 0 || !preserves_distance(matches_[b], matches_[c])) continue;
      Pose T = identity_pose();
      if (!motion_from_three(matches_[a], matches_[b], matches_[c], T)) continue;
      const std::size_t inliers = count_inliers(T, all_);
      if (inliers >= kMinInliers) hypotheses_.push_back({T, inliers});
    }
  }

  // The motion that maps the frames spanned by three matches onto each other.
  [[nodiscard]] static bool motion_from_three(const CornerMatch& a, const CornerMatch& b, const CornerMatch& c, Pose& T) {
    Eigen::Matrix3d from, to;
    if (!orthonormal_axes(a.p, b.p, c.p, from) || !orthonormal_axes(a.q, b.q, c.q, to)) return false;
    Eigen::Matrix3d R;
    Eigen::Vector3d t;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R(i, j) = to(i, 0) * from(j, 0) + to(i, 1) * from(j, 1) + to(i, 2) * from(j, 2);
    }
    for (int i = 0; i < 3; ++i) {
      double p[3];
      for (int j = 0; j < 3; ++j) p[j] = static_cast<double>(a.p(j) + b.p(j) + c.p(j)) / 3;
      t(i) = static_cast<double>(a.q(i) + b.q(i) + c.q(i)) / 3 - (R(i, 0) * p[0] + R(i, 1) * p[1] + R(i, 2) * p[2]);
    }
    T = make_pose(R, t);
    return is_finite(T);
  }
  // Orthonormal axes in the columns: along a b, across it towards c, and perpendicular to both.
  [[nodiscard]] static bool orthonormal_axes(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                                             Eigen::Matrix3d& out) {
    Eigen::Vector3f x = b - a;
    x *= 1.0F / norm(x);
    Eigen::Vector3f z = cross(x, c - a);
    const float area = norm(z);
    if (!(area > 0.05F)) return false;  // nearly on one line
    z *= 1.0F / area;
    const Eigen::Vector3f y = cross(z, x);
    for (int i = 0; i < 3; ++i) {
      out(i, 0) = static_cast<double>(x(i));
      out(i, 1) = static_cast<double>(y(i));
      out(i, 2) = static_cast<double>(z(i));
    }
    return true;
  }

  // One Gauss-Newton step over the inliers: where the current image shows them, and how deep.
  void refine(Pose& T) {
    count_inliers(T, all_, &inlier_);
    const FloatPose f(T);
    Matrix6 H = zeros<Matrix6>();
    Twist b = zeros<Twist>();
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (!(inlier_[i] > 0)) continue;
      const CornerMatch& m = matches_[i];
      const Eigen::Vector3f y = f(m.p.x(), m.p.y(), m.p.z());
      const double x[3] = {static_cast<double>(y.x()), static_cast<double>(y.y()), static_cast<double>(y.z())};
      // d(T p) = v + omega x (T p)
      const double moved[3][6] = {{1, 0, 0, 0, x[2], -x[1]}, {0, 1, 0, -x[2], 0, x[0]}, {0, 0, 1, x[1], -x[0], 0}};
      for (int r = 0; r < 3; ++r) {
        const double inverse_sigma = 1 / static_cast<double>(r < 2 ? pixel_tolerance(m) : depth_tolerance(m.q.z()));
        const double tangent = x[r] / x[2];
        const double e = (r < 2 ? tangent - static_cast<double>(m.q(r) / m.q.z()) : x[2] - static_cast<double>(m.q.z())) * inverse_sigma;
        double J[6];
        for (int k = 0; k < 6; ++k) {
          J[k] = (r < 2 ? (moved[r][k] - tangent * moved[2][k]) / x[2] : moved[2][k]) * inverse_sigma;
        }
        for (int k = 0; k < 6; ++k) {
          for (int l = 0; l < 6; ++l) H(k, l) += J[k] * J[l];
          b(k) -= J[k] * e;
        }
      }
    }
    const Twist step = solve_symmetric(H, b);
    if (all_finite(step)) T = normalized(compose(se3_exp(step), T));
  }

  CornerMatcher match_;
  std::vector<CornerMatch> matches_;
  std::vector<float> packed_;
  std::vector<float> all_;     // 1 for each match, 0 for what fills up the last lanes
  std::vector<float> inlier_;  // 1 for each inlier of the last motion
  std::vector<std::size_t> compatible_, first_compatible_;
  std::vector<std::size_t> pool_;  // matches to sample from: no inliers of the first motion
  std::vector<Hypothesis> hypotheses_;
};

APSO_NAMESPACE_END
