/// \file
/// Motions between two frames guessed from corners that look alike: where a descent on the images may start when it
/// found nothing near the initial guess.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/lanes.hpp>
#include <apso/math/linear_congruential.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/refinement/start/corner_matching.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>

APSO_NAMESPACE_BEGIN

/// Guesses rigid motions between two frames: those through three matches of corners each that keep their distances,
/// judged by how many other matches they bring together (RANSAC, Fischler and Bolles, 1981), each refined on those. The
/// second and third match are drawn from those that keep their distance to the first, so that a few right ones among
/// many wrong ones are found. Deterministic; keeps its buffers.
class CornerSearch {
 public:
  /// \param halvings of the full size at which corners are looked for, about 160 x 120 pixels; those of the next finer
  /// level
  ///        are added if a mask leaves few
  /// \param T_current_reference receives guesses, the one with the most matches first, none twice; may stay empty
  void operator()(const FramePyramid& reference, const FramePyramid& current, int halvings,
                  std::vector<Pose>& T_current_reference) {
    T_current_reference.clear();
    matches_.clear();
    const bool few = match_(reference.halved(halvings), current.halved(halvings), matches_) < kFew;
    if (few && halvings > std::max(reference.finest(), current.finest()) &&
        current.halved(halvings - 1).camera.width <= FramePyramid::kCornerWidth) {
      match_(reference.halved(halvings - 1), current.halved(halvings - 1), matches_);
    }
    lay_out();
    connect();
    guesses_.clear();
    LinearCongruential random(1);
    taken_.assign(all_.size(), 0.0F);
    pool_.clear();
    for (std::size_t i = 0; i < matches_.size(); ++i) pool_.push_back(i);
    draw(random);
    while (T_current_reference.size() < kGuesses && !guesses_.empty()) {
      const auto best = std::max_element(guesses_.begin(), guesses_.end(),
                                         [](const Guess& a, const Guess& b) { return a.inliers < b.inliers; });
      Pose T = best->T;
      for (int k = 0; k < 3; ++k) refine(T);
      T_current_reference.push_back(T);
      // what brings together the same points is the same guess
      count_agreeing(T, all_, &taken_);
      guesses_.erase(std::remove_if(guesses_.begin(), guesses_.end(),
                                    [&](const Guess& g) { return 2 * count_agreeing(g.T, taken_) > g.inliers; }),
                     guesses_.end());
      if (T_current_reference.size() == 1) {
        // nearly all triples are of the motion that most matches share; as many are drawn from the rest
        pool_.erase(std::remove_if(pool_.begin(), pool_.end(), [&](std::size_t i) { return taken_[i] > 0; }),
                    pool_.end());
        draw(random);
      }
    }
  }

  /// Motions of given rotations that bring together the two corners of one match each: a single right match will do.
  /// Of the matches that were found last.
  /// \param around,reach middle and radius of the translations of interest [m]
  /// \param apart least distance of two translations of one rotation [m]
  /// \param T_current_reference receives them
  void with_rotations(const std::vector<Eigen::Matrix3d>& R_current_reference, const Eigen::Vector3d& around, double reach,
                      double apart, std::vector<Pose>& T_current_reference) const {
    T_current_reference.clear();
    for (const Eigen::Matrix3d& R : R_current_reference) {
      const auto first = static_cast<std::ptrdiff_t>(T_current_reference.size());
      for (const CornerMatch& m : matches_) {
        const Eigen::Vector3d t = minus(as_double(m.q), times(R, as_double(m.p)));
        const auto near = [&](const Pose& T) { return squared_norm(minus(t, translation(T))) < apart * apart; };
        if (squared_norm(minus(t, around)) > reach * reach ||
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

  static constexpr std::size_t kFew = 100;      // corners of the reference
  static constexpr std::size_t kLeast = 4;      // matches that a guess brings together
  static constexpr std::size_t kEnough = 1000;  // motions to choose from
  static constexpr int kTrials = 10000;
  static constexpr std::size_t kGuesses = 12;

  struct Guess {
    Pose T;
    std::size_t inliers;
  };

  // Largest distances in depth [m] of what a motion brings together, and across the ray as a tangent: noise, and a
  // little more, but less than what moves between two frames.
  static float along(float z) { return 0.006F + 0.001F * z * z; }
  static float across(const CornerMatch& m) { return 0.7F * m.pixel; }

  // What the matches ask of a motion, kLanes of them at a time, side by side; what fills up the last is beyond reach.
  enum Field { kX, kY, kZ, kU, kV, kW, kInverseAcross, kInverseAlong, kFields };
  void lay_out() {
    const std::size_t groups = (matches_.size() + kLanes - 1) / kLanes;
    laid_out_.assign(groups * kFields * kLanes, 0.0F);
    all_.assign(groups * kLanes, 0.0F);
    for (std::size_t i = 0; i < groups * kLanes; ++i) {
      float* to = laid_out_.data() + i / kLanes * kFields * kLanes + i % kLanes;
      if (i >= matches_.size()) {
        to[kZ * kLanes] = 1;
        to[kW * kLanes] = 1e6F;
        to[kInverseAlong * kLanes] = 1;
        continue;
      }
      const CornerMatch& m = matches_[i];
      to[kX * kLanes] = m.p.x();
      to[kY * kLanes] = m.p.y();
      to[kZ * kLanes] = m.p.z();
      to[kU * kLanes] = m.q.x() / m.q.z();
      to[kV * kLanes] = m.q.y() / m.q.z();
      to[kW * kLanes] = m.q.z();
      to[kInverseAcross * kLanes] = 1 / across(m);
      to[kInverseAlong * kLanes] = 1 / along(m.q.z());
      all_[i] = 1;
    }
  }

  // How many matches of weight 1 a motion brings together, and which of all.
  std::size_t count_agreeing(const Pose& T_current_reference, const std::vector<float>& weight,
                             std::vector<float>* which = nullptr) const {
    const FloatPose T(T_current_reference);
    if (which != nullptr) which->resize(all_.size());
    Lanes n = 0.0F;
    for (std::size_t i = 0; i < all_.size(); i += kLanes) {
      const float* m = laid_out_.data() + i * kFields;
      const auto field = [&](Field f) { return Lanes::load(m + f * kLanes); };
      const Lanes x = field(kX), y = field(kY), z = field(kZ);
      const auto row = [&](int r) { return T.R[r][0] * x + T.R[r][1] * y + T.R[r][2] * z + T.t[r]; };
      const Lanes depth = row(2);
      // tangents, times the depth: nothing is divided by what may be 0
      const Lanes du = row(0) - field(kU) * depth;
      const Lanes dv = row(1) - field(kV) * depth;
      const Lanes dw = (depth - field(kW)) * field(kInverseAlong);
      const Lanes inverse_across = field(kInverseAcross);
      const Lanes sideways = (du * du + dv * dv) * inverse_across * inverse_across;
      const Mask agrees = (depth > Lanes(0.0F)) & (sideways < (1.0F - dw * dw) * depth * depth);
      const Lanes agreeing = select(agrees, Lanes(1.0F), Lanes(0.0F));
      if (which != nullptr) agreeing.store(which->data() + i);
      n += agreeing * Lanes::load(weight.data() + i);
    }
    return static_cast<std::size_t>(n.sum());
  }

  static bool keep_distance(const CornerMatch& a, const CornerMatch& b) {
    const float length = norm(minus(a.p, b.p));
    const float tolerance = 2 * (along(a.q.z()) + along(b.q.z()));
    return length > 0.15F && std::abs(length - norm(minus(a.q, b.q))) < tolerance;
  }

  // For each match, those it keeps its distance to.
  void connect() {
    beside_.clear();
    first_beside_.clear();
    for (const CornerMatch& a : matches_) {
      first_beside_.push_back(beside_.size());
      for (std::size_t j = 0; j < matches_.size(); ++j) {
        if (keep_distance(a, matches_[j])) beside_.push_back(j);
      }
    }
    first_beside_.push_back(beside_.size());
  }

  // Adds motions through three matches of the pool each.
  void draw(LinearCongruential& random) {
    if (pool_.size() < kLeast) return;
    const auto below = [&](std::size_t n) {
      return static_cast<std::size_t>((static_cast<std::uint64_t>(random()) * n) >> 32U);
    };
    const std::size_t enough = guesses_.size() + kEnough;
    for (int trial = 0; trial < kTrials && guesses_.size() < enough; ++trial) {
      const std::size_t a = pool_[below(pool_.size())];
      const std::size_t n = first_beside_[a + 1] - first_beside_[a];
      if (n < 2) continue;
      const std::size_t b = beside_[first_beside_[a] + below(n)];
      const std::size_t c = beside_[first_beside_[a] + below(n)];
      if (taken_[b] > 0 || taken_[c] > 0 || !keep_distance(matches_[b], matches_[c])) continue;
      Pose T;
      if (!through(matches_[a], matches_[b], matches_[c], T)) continue;
      const std::size_t inliers = count_agreeing(T, all_);
      if (inliers >= kLeast) guesses_.push_back({T, inliers});
    }
  }

  // The motion that maps the frames spanned by three matches onto each other.
  [[nodiscard]] static bool through(const CornerMatch& a, const CornerMatch& b, const CornerMatch& c, Pose& T) {
    Eigen::Matrix3d from, to;
    if (!span(a.p, b.p, c.p, from) || !span(a.q, b.q, c.q, to)) return false;
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
  [[nodiscard]] static bool span(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                                 Eigen::Matrix3d& out) {
    Eigen::Vector3f x = minus(b, a);
    x = times(1.0F / norm(x), x);
    Eigen::Vector3f z = cross(x, minus(c, a));
    const float area = norm(z);
    if (!(area > 0.05F)) return false;  // nearly on one line
    z = times(1.0F / area, z);
    const Eigen::Vector3f y = cross(z, x);
    for (int i = 0; i < 3; ++i) {
      out(i, 0) = static_cast<double>(x(i));
      out(i, 1) = static_cast<double>(y(i));
      out(i, 2) = static_cast<double>(z(i));
    }
    return true;
  }

  // One Gauss-Newton step over the matches that agree: where the current image shows them, and how deep.
  void refine(Pose& T) {
    count_agreeing(T, all_, &taken_);
    const FloatPose f(T);
    Matrix6 H = zeros<Matrix6>();
    Twist b = zeros<Twist>();
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (!(taken_[i] > 0)) continue;
      const CornerMatch& m = matches_[i];
      const Eigen::Vector3f y = f(m.p.x(), m.p.y(), m.p.z());
      const double x[3] = {static_cast<double>(y.x()), static_cast<double>(y.y()), static_cast<double>(y.z())};
      // d(T p) = v + omega x (T p)
      const double moved[3][6] = {{1, 0, 0, 0, x[2], -x[1]}, {0, 1, 0, -x[2], 0, x[0]}, {0, 0, 1, x[1], -x[0], 0}};
      for (int r = 0; r < 3; ++r) {
        const double inverse_sigma = 1 / static_cast<double>(r < 2 ? across(m) : along(m.q.z()));
        const double tangent = x[r] / x[2];
        const double e =
            (r < 2 ? tangent - static_cast<double>(m.q(r) / m.q.z()) : x[2] - static_cast<double>(m.q.z())) *
            inverse_sigma;
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
  std::vector<float> laid_out_;
  std::vector<float> all_;    // 1 for each match, 0 for what fills up the last lanes
  std::vector<float> taken_;  // 1 for each match that the last motion looked at brings together
  std::vector<std::size_t> beside_, first_beside_;
  std::vector<std::size_t> pool_;  // matches to draw from: those that are not taken
  std::vector<Guess> guesses_;
};

APSO_NAMESPACE_END
