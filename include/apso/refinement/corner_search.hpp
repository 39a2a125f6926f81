/// \file
/// Motions between two frames guessed from corners that look alike: where a descent on the images may start when it
/// found nothing near the initial guess.
#pragma once

#include <algorithm>
#include <array>
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
#include <apso/refinement/plane.hpp>
#include <apso/refinement/pyramid.hpp>

APSO_NAMESPACE_BEGIN

/// Places of one level of a frame: points, and what they look like.
struct CornerSet {
  static constexpr int kSide = 8;                ///< of a patch [px]
  static constexpr int kPatch = kSide * kSide;
  std::vector<Eigen::Vector3f> points;           ///< in the camera [m]
  std::vector<float> patches;                    ///< mean 0, length 1; kLanes of them at a time, pixel by pixel, the rest 0
  [[nodiscard]] std::size_t size() const { return points.size(); }
};

/// Guesses rigid motions between two frames. Corners of the reference (Shi and Tomasi, CVPR 1994), one per cell so that they
/// cover the view, are looked for at every place of the current image that has texture in two directions: the best corner of a
/// cell is too often the best of no cell in the other image. They are matched where each is the other's best by normalised
/// correlation; motions through three matches each that keep their distances are judged by how many other matches they bring
/// together (RANSAC, Fischler and Bolles, 1981), and each is refined on those. Deterministic; keeps its buffers.
class CornerSearch {
 public:
  /// \param halvings of the full size at which corners are looked for, about 160 x 120 pixels; those of the next finer level
  ///        are added if a mask leaves few
  /// \param T_current_reference receives guesses, the one with the most matches first, none twice; may stay empty
  void operator()(const FramePyramid& reference, const FramePyramid& current, int halvings,
                  std::vector<Pose>& T_current_reference) {
    T_current_reference.clear();
    matches_.clear();
    const bool few = match(reference.halved(halvings), current.halved(halvings)) < kFew;
    if (few && halvings > std::max(reference.finest(), current.finest()) &&
        current.halved(halvings - 1).camera.width <= FramePyramid::kCornerWidth) {
      match(reference.halved(halvings - 1), current.halved(halvings - 1));
    }
    guesses_.clear();
    LinearCongruential random(1);
    pool_ = matches_;
    draw(random);
    for (int i = 0; i < kGuesses && !guesses_.empty(); ++i) {
      const auto best = std::max_element(guesses_.begin(), guesses_.end(),
                                         [](const Guess& a, const Guess& b) { return a.inliers < b.inliers; });
      Pose T = best->T;
      for (int k = 0; k < 3; ++k) refine(T);
      T_current_reference.push_back(T);
      const FloatPose f(T);
      if (i == 0) {  // nearly all triples are of the motion that most matches share; as many are drawn from the rest
        pool_.erase(std::remove_if(pool_.begin(), pool_.end(), [&](const Match& m) { return agrees(f, m); }), pool_.end());
        draw(random);
      }
      // what brings together the same points is the same guess
      taken_.clear();
      for (const Match& m : matches_) taken_.push_back(agrees(f, m) ? 1 : 0);
      guesses_.erase(std::remove_if(guesses_.begin(), guesses_.end(), [&](const Guess& g) { return 2 * shared(g.T) > g.inliers; }),
                     guesses_.end());
    }
  }

 private:
  static constexpr std::size_t kLeast = 4;  // matches that a guess brings together
  static constexpr std::size_t kFew = 100;  // corners of the reference
  static constexpr std::size_t kWanted = 200;  // the same; with fewer the cells are smaller
  static constexpr int kTrials = 50000;     // a tenth of the matches may be right
  static constexpr std::size_t kEnough = 1000;  // motions to choose from
  static constexpr int kGuesses = 6;
  static constexpr int kCell = 8;           // [px]
  static constexpr int kCellFew = 4;        // of the smaller ones
  static constexpr float kAlike = 0.65F;     // least correlation of a match
  struct Match {
    Eigen::Vector3f p, q;  // in the reference, in the current camera [m]
    float tolerance;       // [m]
  };

  struct Guess {
    Pose T;
    std::size_t inliers;
  };

  // The best corner of each cell, or all its pixels that could be one.
  enum class Take { Best, All };
  static void describe(const PyramidLevel& level, Take take, int cell, CornerSet& out) {
    constexpr int kMargin = CornerSet::kSide / 2;
    const int w = level.intensity.width();
    const int h = level.intensity.height();
    out.points.clear();
    out.patches.clear();
    for (int y0 = kMargin; y0 + cell <= h - kMargin; y0 += cell) {
      for (int x0 = kMargin; x0 + cell <= w - kMargin; x0 += cell) {
        float best = kWeakest;
        int bx = 0;
        int by = 0;
        for (int y = y0; y < y0 + cell; ++y) {
          for (int x = x0; x < x0 + cell; ++x) {
            if (!(level.depth.row(y)[x] > 0)) continue;
            const float s = cornerness(level.intensity, x, y);
            if (take == Take::All && s > kWeakest) add(level, x, y, out);
            if (s > best) {
              best = s;
              bx = x;
              by = y;
            }
          }
        }
        if (take == Take::Best && best > kWeakest) add(level, bx, by, out);
      }
    }
  }

  // Smaller eigenvalue of the structure tensor over 3 x 3 pixels [1/px^2].
  static float cornerness(const Plane& image, int x, int y) {
    float xx = 0;
    float xy = 0;
    float yy = 0;
    for (int v = y - 1; v <= y + 1; ++v) {
      const float* r = image.row(v);
      const float* above = image.row(v - 1);
      const float* below = image.row(v + 1);
      for (int u = x - 1; u <= x + 1; ++u) {
        const float gx = 0.5F * (r[u + 1] - r[u - 1]);
        const float gy = 0.5F * (below[u] - above[u]);
        xx += gx * gx;
        xy += gx * gy;
        yy += gy * gy;
      }
    }
    return 0.5F * (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy));
  }
  static constexpr float kWeakest = 1e-3F;  // cornerness of nine pixels with gradients of 1 % of the brightness

  static void add(const PyramidLevel& level, int x, int y, CornerSet& out) {
    constexpr int kHalf = CornerSet::kSide / 2;
    float patch[CornerSet::kPatch];
    bool seen[CornerSet::kPatch];
    float sum = 0;
    int n = 0;
    for (int i = 0; i < CornerSet::kPatch; ++i) {
      const int u = x - kHalf + i % CornerSet::kSide;
      const int v = y - kHalf + i / CornerSet::kSide;
      seen[i] = level.gamma.empty() || level.gamma.row(v)[u] > 0;
      patch[i] = level.intensity.row(v)[u];
      if (!seen[i]) continue;
      sum += patch[i];
      ++n;
    }
    if (4 * n < 3 * CornerSet::kPatch) return;
    const float mean = sum / static_cast<float>(n);
    float squares = 0;
    for (int i = 0; i < CornerSet::kPatch; ++i) {
      patch[i] = seen[i] ? patch[i] - mean : 0.0F;
      squares += patch[i] * patch[i];
    }
    const float scale = squares > 0 ? 1.0F / std::sqrt(squares) : 0.0F;
    for (float& v : patch) v *= scale;
    const float z = level.depth.row(y)[x];
    const std::size_t lane = out.size() % kLanes;
    if (lane == 0) out.patches.resize(out.patches.size() + CornerSet::kPatch * kLanes, 0.0F);
    float* to = out.patches.data() + out.patches.size() - CornerSet::kPatch * kLanes + lane;
    for (int i = 0; i < CornerSet::kPatch; ++i) to[i * kLanes] = patch[i];
    out.points.push_back({(static_cast<float>(x) - static_cast<float>(level.camera.cx)) / static_cast<float>(level.camera.fx) * z,
                          (static_cast<float>(y) - static_cast<float>(level.camera.cy)) / static_cast<float>(level.camera.fy) * z, z});
  }

  // Looks for the corners of the reference, those of smaller cells if they are few, at all places of the current image.
  // \return corners of usual cells
  std::size_t match(const PyramidLevel& reference, const PyramidLevel& current) {
    describe(reference, Take::Best, kCell, reference_);
    const std::size_t usual = reference_.size();
    if (usual < kWanted) describe(reference, Take::Best, kCellFew, reference_);
    describe(current, Take::All, kCell, current_);
    match();
    return usual;
  }

  // Adds the pairs of which each is the other's best.
  void match() {
    constexpr int kAtOnce = 4;  // of the reference, beside kLanes of the current image
    const std::size_t n = reference_.size();
    const std::size_t groups = (current_.size() + kLanes - 1) / kLanes;
    best_of_current_.assign(groups * kLanes, kAlike);
    partner_of_current_.assign(groups * kLanes, -1.0F);
    partner_of_reference_.assign(n, -1.0F);
    for (std::size_t first = 0; first < n; first += kAtOnce) {
      const int count = static_cast<int>(std::min<std::size_t>(kAtOnce, n - first));
      float a[CornerSet::kPatch][kAtOnce] = {};
      for (int r = 0; r < count; ++r) {
        const std::size_t i = first + static_cast<std::size_t>(r);
        const float* from = reference_.patches.data() + i / kLanes * CornerSet::kPatch * kLanes + i % kLanes;
        for (int k = 0; k < CornerSet::kPatch; ++k) a[k][r] = from[k * kLanes];
      }
      Lanes best[kAtOnce], group[kAtOnce];
      std::fill(best, best + kAtOnce, Lanes(kAlike));
      std::fill(group, group + kAtOnce, Lanes(-1.0F));
      for (std::size_t g = 0; g < groups; ++g) {
        const float* b = current_.patches.data() + g * CornerSet::kPatch * kLanes;
        Lanes c[kAtOnce];
        std::fill(c, c + kAtOnce, Lanes(0.0F));
        for (int k = 0; k < CornerSet::kPatch; ++k) {
          const Lanes v = Lanes::load(b + k * kLanes);
          for (int r = 0; r < kAtOnce; ++r) c[r] += v * a[k][r];
        }
        Lanes most = Lanes::load(best_of_current_.data() + g * kLanes);
        Lanes partner = Lanes::load(partner_of_current_.data() + g * kLanes);
        for (int r = 0; r < kAtOnce; ++r) {
          const Mask nearer = c[r] > most;
          most = select(nearer, c[r], most);
          partner = select(nearer, Lanes(static_cast<float>(first) + static_cast<float>(r)), partner);
          const Mask better = c[r] > best[r];
          best[r] = select(better, c[r], best[r]);
          group[r] = select(better, Lanes(static_cast<float>(g)), group[r]);
        }
        most.store(best_of_current_.data() + g * kLanes);
        partner.store(partner_of_current_.data() + g * kLanes);
      }
      for (int r = 0; r < count; ++r) {  // the first of equal ones
        float most = kAlike;
        float& at = partner_of_reference_[first + static_cast<std::size_t>(r)];
        for (int lane = 0; lane < kLanes; ++lane) {
          const float j = group[r][lane] * kLanes + static_cast<float>(lane);
          if (group[r][lane] < 0 || best[r][lane] < most || (best[r][lane] == most && at >= 0 && j > at)) continue;
          most = best[r][lane];
          at = j;
        }
      }
    }
    for (std::size_t i = 0; i < n; ++i) {
      if (partner_of_reference_[i] < 0) continue;
      const auto j = static_cast<std::size_t>(partner_of_reference_[i]);
      if (partner_of_current_[j] != static_cast<float>(i)) continue;
      const Eigen::Vector3f& p = reference_.points[i];
      const Eigen::Vector3f& q = current_.points[j];
      // about a pixel; more would let what moves a little pass for what does not
      matches_.push_back({p, q, 0.0075F + 0.006F * std::max(p.z(), q.z())});
    }
  }

  // Adds motions through three matches of the pool each.
  void draw(LinearCongruential& random) {
    if (pool_.size() < kLeast) return;
    const auto any = [&]() -> const Match& { return pool_[static_cast<std::size_t>((static_cast<std::uint64_t>(random()) * pool_.size()) >> 32U)]; };
    const std::size_t enough = guesses_.size() + kEnough;
    for (int trial = 0; trial < kTrials && guesses_.size() < enough; ++trial) {
      const Match& a = any();
      const Match& b = any();
      const Match& c = any();
      Pose T;
      if (!through(a, b, c, T)) continue;
      const std::size_t n = inliers(T);
      if (n >= kLeast) guesses_.push_back({T, n});
    }
  }

  // The motion that maps the frames spanned by three matches onto each other.
  [[nodiscard]] static bool through(const Match& a, const Match& b, const Match& c, Pose& T) {
    const auto kept = [](const Match& s, const Match& t) {
      const Eigen::Vector3f d = minus(s.p, t.p);
      const Eigen::Vector3f e = minus(s.q, t.q);
      const float length = norm(d);
      return length > 0.15F && std::abs(length - norm(e)) < s.tolerance + t.tolerance;
    };
    if (!kept(a, b) || !kept(b, c) || !kept(a, c)) return false;
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
  [[nodiscard]] static bool span(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c, Eigen::Matrix3d& out) {
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

  [[nodiscard]] static bool agrees(const FloatPose& T, const Match& m) {
    return squared_norm(Eigen::Vector3f(minus(T(m.p.x(), m.p.y(), m.p.z()), m.q))) < m.tolerance * m.tolerance;
  }
  [[nodiscard]] std::size_t inliers(const Pose& T) const {
    const FloatPose f(T);
    std::size_t n = 0;
    for (const Match& m : matches_) n += agrees(f, m) ? 1 : 0;
    return n;
  }

  [[nodiscard]] std::size_t shared(const Pose& T) const {
    const FloatPose f(T);
    std::size_t n = 0;
    for (std::size_t i = 0; i < matches_.size(); ++i) n += taken_[i] != 0 && agrees(f, matches_[i]) ? 1 : 0;
    return n;
  }

  // One Gauss-Newton step of sum |T p - q|^2 / tolerance^2 over the matches that agree.
  void refine(Pose& T) const {
    const FloatPose f(T);
    Matrix6 H = zeros<Matrix6>();
    Twist b = zeros<Twist>();
    for (const Match& m : matches_) {
      if (!agrees(f, m)) continue;
      const Eigen::Vector3f y = f(m.p.x(), m.p.y(), m.p.z());
      const double w = 1.0 / static_cast<double>(m.tolerance * m.tolerance);
      // d(T p) = v + omega x y
      const double X[3] = {static_cast<double>(y.x()), static_cast<double>(y.y()), static_cast<double>(y.z())};
      const double J[3][6] = {{1, 0, 0, 0, X[2], -X[1]}, {0, 1, 0, -X[2], 0, X[0]}, {0, 0, 1, X[1], -X[0], 0}};
      for (int r = 0; r < 3; ++r) {
        const double e = static_cast<double>(y(r) - m.q(r));
        for (int i = 0; i < 6; ++i) {
          for (int j = 0; j < 6; ++j) H(i, j) += w * J[r][i] * J[r][j];
          b(i) -= w * J[r][i] * e;
        }
      }
    }
    const Twist step = solve_symmetric(H, b);
    if (all_finite(step)) T = normalized(compose(se3_exp(step), T));
  }

  CornerSet reference_, current_;
  // Correlations, and numbers of patches; floats hold them, exactly as far as there are pixels.
  std::vector<float> best_of_current_, partner_of_current_, partner_of_reference_;
  std::vector<Match> matches_, pool_;
  std::vector<Guess> guesses_;
  std::vector<char> taken_;  // whether the last guess brings a match together
};

APSO_NAMESPACE_END
