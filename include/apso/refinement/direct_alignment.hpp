/// \file
/// Direct alignment of one frame to one or several references, the paper's eq. (direct optimization approach):
///
///     T = argmin sum_k B_k sum_p gamma_k(p) gamma_c(u) [ alpha^2 C(s_I) + C(s_D) ]
///
/// over the one pose of the current camera. T_c_k = T_c_w T_w_k, so one increment from the left serves all references.
/// Solved coarse to fine by iteratively reweighted least squares with Levenberg-Marquardt damping. Directions that the
/// images do not determine keep the initial guess (solution remapping, Zhang, Kaess, Singh, ICRA 2016).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/robust_kernel.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/se3.hpp>
#include <apso/options.hpp>
#include <apso/refinement/noise_model.hpp>
#include <apso/refinement/normal_equations.hpp>
#include <apso/refinement/pyramid.hpp>
#include <apso/refinement/residuals.hpp>
#include <apso/status.hpp>

APSO_NAMESPACE_BEGIN

/// One number per pyramid level, finest first; the last one holds for all coarser levels.
struct LevelSchedule {
  double finest = 0;
  double second = 0;
  double third = 0;
  double coarser = 0;
  [[nodiscard]] double at(int level) const {
    return level <= 0 ? finest : (level == 1 ? second : (level == 2 ? third : coarser));
  }
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("finest", s.finest, 0.0, 1e4);
    v("second", s.second, 0.0, 1e4);
    v("third", s.third, 0.0, 1e4);
    v("coarser", s.coarser, 0.0, 1e4);
  }
};

struct AlignmentOptions {
  RobustKernel kernel;                     ///< C of the cost
  bool graduated = false;                  ///< Tukey at the finest level, `kernel` before
  ScaleKind scale = ScaleKind::Mad;        ///< how the spread of the residuals is measured
  double scale_floor = 0.25;               ///< smallest scale, in units of the noise model
  int scale_samples = 4096;                ///< residuals looked at for the scale
  LevelSchedule alpha{4, 2, 1, 1};         ///< photometric against depth term: depth gives basin, intensity precision
  LevelSchedule iterations{8, 10, 15, 20}; ///< most outer iterations
  double stop_translation = 1e-5;          ///< an increment below both stops [m]
  double stop_rotation = 1e-5;             ///< [rad]
  double stop_relative_cost = 1e-4;        ///< a relative decrease below stops
  double damping = 1e-4;                   ///< start of the Levenberg-Marquardt factor; x10 on reject, /10 on accept
  int max_rejects = 5;                     ///< rejected steps in a row
  double degenerate_ratio = 1e-3;          ///< eigenvalue below this share of the largest is degenerate
  double degenerate_floor = 50;            ///< eigenvalue below is degenerate
  int min_pixels = 300;                    ///< fewer valid pixels fail
  double min_valid_share = 0.3;            ///< smaller share of valid pixels is NoOverlap
  bool prealign_rotation = true;           ///< photometric rotation-only search at the coarsest level
  int prealign_iterations = 15;
  bool check_against_guess = true;         ///< Diverged if the result explains the images worse than the guess
  bool per_reference_mean = false;         ///< divide each reference's term by its number of pixels
  double information_deflation = 0.01;     ///< neighbouring residuals are correlated: factor on the information
  double prior_sigma_translation = 0;      ///< motion prior towards the first candidate [m]; 0 = none
  double prior_sigma_rotation = 0;         ///< [rad]; 0 = none
  WarpOptions warp;
  NoiseOptions noise;

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("kernel", s.kernel);
    v("graduated", s.graduated);
    v("scale", s.scale);
    v("scale_floor", s.scale_floor, 1e-6, 100.0);
    v("scale_samples", s.scale_samples, 64, 100000000);
    v("alpha", s.alpha);
    v("iterations", s.iterations);
    v("stop_translation", s.stop_translation, 0.0, 1.0);
    v("stop_rotation", s.stop_rotation, 0.0, 1.0);
    v("stop_relative_cost", s.stop_relative_cost, 0.0, 1.0);
    v("damping", s.damping, 0.0, 1e3);
    v("max_rejects", s.max_rejects, 0, 20);
    v("degenerate_ratio", s.degenerate_ratio, 0.0, 1.0);
    v("degenerate_floor", s.degenerate_floor, 0.0, 1e12);
    v("min_pixels", s.min_pixels, 6, 100000000);
    v("min_valid_share", s.min_valid_share, 0.0, 1.0);
    v("prealign_rotation", s.prealign_rotation);
    v("prealign_iterations", s.prealign_iterations, 1, 1000);
    v("check_against_guess", s.check_against_guess);
    v("per_reference_mean", s.per_reference_mean);
    v("information_deflation", s.information_deflation, 1e-9, 1.0);
    v("prior_sigma_translation", s.prior_sigma_translation, 0.0, 1e6);
    v("prior_sigma_rotation", s.prior_sigma_rotation, 0.0, 1e6);
    v("warp", s.warp);
    v("noise", s.noise);
  }
};

/// The settings of StaticFusion (Scona et al., ICRA 2018) without its cluster weights, for comparison.
[[nodiscard]] inline AlignmentOptions static_fusion_alignment() {
  AlignmentOptions o;
  o.kernel.kind = KernelKind::Cauchy;
  o.kernel.k = 0.5;
  o.scale = ScaleKind::MeanAbs;
  o.scale_floor = 1e-6;
  o.alpha = {0.15, 0.15, 0.15, 0.15};
  o.noise.form = NoiseForm::StaticFusion;
  return o;
}

/// A frame that the current one is aligned to.
struct AlignmentReference {
  const FramePyramid* pyramid = nullptr;       ///< prepared as reference
  Pose T_world_reference = Pose::Identity();
  double weight = 1;                           ///< B_k, >= 0
};

struct AlignmentResult {
  Status status = Status::NotRun;
  Pose T_world_camera = Pose::Identity();      ///< the first candidate if the status is a failure
  Matrix6 information = Matrix6::Zero();       ///< of the increment (v, w) in the camera frame, T_c_w <- Exp(d) T_c_w
  Matrix6 covariance = Matrix6::Zero();        ///< its inverse on the directions that are determined [m^2, m rad, rad^2]
  Twist eigenvalues = Twist::Zero();           ///< of the scaled normal matrix, rising
  int degenerate_count = 0;                    ///< directions that kept the initial guess
  Matrix6 degenerate_projector = Matrix6::Zero(); ///< onto those directions, for twists scaled by (1/l, 1), l = median_depth
  double median_depth = 0;                     ///< l [m]
  double valid_share = 0;                      ///< valid of selected pixels at the finest level
  double scale_intensity = 0;                  ///< final robust scale in units of the noise model; 0 = unset
  double scale_depth = 0;                      ///< the same for depth
  double cost = 0;                             ///< final mean robust cost
  WarpCounts counts;                           ///< at the finest level
  int iterations = 0;                          ///< outer iterations over all levels
  int start_candidate = -1;                    ///< index of the candidate it began with; the number of candidates = pre-alignment
};

/// Aligns frames. Keeps its buffers, so that a second call of the same size allocates nothing. Deterministic.
class DirectAligner {
 public:
  explicit DirectAligner(const AlignmentOptions& options = {}) : options_(options) { validate(options_, "alignment"); }

  [[nodiscard]] const AlignmentOptions& options() const { return options_; }

  /// \param current prepared as current
  /// \param T_world_camera_candidates initial guesses, the most trusted first; the best is chosen by the cost at the
  ///        coarsest level. The first one is the initial guess that a failure and degenerate directions keep.
  template <class Executor = SerialExecutor>
  [[nodiscard]] AlignmentResult align(const std::vector<AlignmentReference>& references, const FramePyramid& current,
                                      const std::vector<Pose>& T_world_camera_candidates,
                                      const Executor& executor = {}) {
    AlignmentResult result;
    if (!begin(references, current, T_world_camera_candidates, result)) return result;
    const Pose T_guess = inverse(result.T_world_camera);
    const int coarsest = levels_ - 1;
    Pose T = choose_start(T_world_camera_candidates, result, executor);
    const Pose T_start = T;

    bool converged = false;
    for (int level = coarsest; level >= 0; --level) {
      const Status s = solve_level(level, T_guess, T, converged, result, executor);
      if (s == Status::TooFewPixels && level > 0) continue;  // a coarse level may be too small; finer ones have more
      if (!succeeded(s)) return fail(result, s);
    }
    finish(T_guess, T_start, T, converged, result, executor);
    return result;
  }

  /// Scales and counts of the residuals at a given pose, without optimising: how well the pose explains the frames.
  template <class Executor = SerialExecutor>
  [[nodiscard]] AlignmentResult evaluate(const std::vector<AlignmentReference>& references, const FramePyramid& current,
                                         const Pose& T_world_camera, const Executor& executor = {}) {
    AlignmentResult result;
    if (!begin(references, current, {T_world_camera}, result)) return result;
    warp(0, inverse(T_world_camera), accepted_, executor);
    result.counts = counts();
    result.valid_share = share(result.counts);
    if (result.counts.valid < options_.min_pixels) return fail(result, Status::TooFewPixels);
    if (result.valid_share < options_.min_valid_share) return fail(result, Status::NoOverlap);
    estimate_scales(0);
    report_scales(result);
    result.cost = cost(0, accepted_, executor).mean();
    result.status = Status::Converged;
    return result;
  }

 private:
  static constexpr int kPart = 4096;  // pixels of one unit of work

  struct Term {
    const FramePyramid* pyramid = nullptr;
    Pose T_world_reference = Pose::Identity();
    double weight = 1;
    TermScales scales;
    WarpedPixels accepted, trial;
    WarpCounts counts, trial_counts;
  };
  struct Part {
    int term = 0;
    int begin = 0;
    int end = 0;
    WarpCounts counts;
    CostSum cost;
    NormalEquations normal;
  };
  enum Buffer { accepted_, trial_ };

  static AlignmentResult& fail(AlignmentResult& r, Status s) {
    r.status = s;
    r.information.setZero();
    r.covariance.setZero();
    return r;
  }
  static double share(const WarpCounts& c) {
    return c.selected > 0 ? static_cast<double>(c.valid) / static_cast<double>(c.selected) : 0.0;
  }

  bool begin(const std::vector<AlignmentReference>& references, const FramePyramid& current,
             const std::vector<Pose>& candidates, AlignmentResult& result) {
    expects(!current.empty(), "DirectAligner: the current pyramid was not built");
    expects(!current.level(0).texture.empty(), "DirectAligner: the current pyramid was prepared as reference only");
    expects(!candidates.empty(), "DirectAligner: at least one candidate pose is needed");
    bool found = false;
    for (const Pose& c : candidates) {
      if (!found && is_finite(c)) {
        result.T_world_camera = c;
        found = true;
      }
    }
    if (!found) {
      result.status = Status::Diverged;
      return false;
    }
    current_ = &current;
    levels_ = current.size();
    terms_.resize(references.size());
    std::size_t n = 0;
    for (const AlignmentReference& r : references) {
      expects(r.pyramid != nullptr && !r.pyramid->empty(), "DirectAligner: a reference pyramid was not built");
      expects(r.pyramid->size() == current.size() &&
                  r.pyramid->level(0).camera.width == current.level(0).camera.width &&
                  r.pyramid->level(0).camera.height == current.level(0).camera.height,
              "DirectAligner: reference and current pyramid differ in levels or size");
      if (!(r.weight > 0) || !std::isfinite(r.weight) || !is_finite(r.T_world_reference)) continue;
      terms_[n].pyramid = r.pyramid;
      terms_[n].T_world_reference = r.T_world_reference;
      terms_[n].weight = r.weight;
      ++n;
    }
    terms_.resize(n);
    if (n == 0) {
      result.status = Status::NoReference;
      return false;
    }
    return true;
  }

  void make_parts(int level) {
    parts_.clear();
    for (std::size_t k = 0; k < terms_.size(); ++k) {
      const PixelList& list = terms_[k].pyramid->level(level).pixels;
      const int n = list.padded();
      terms_[k].accepted.resize(static_cast<std::size_t>(n));
      terms_[k].trial.resize(static_cast<std::size_t>(n));
      for (int b = 0; b < n; b += kPart) {
        Part p;
        p.term = static_cast<int>(k);
        p.begin = b;
        p.end = std::min(n, b + kPart);
        parts_.push_back(p);
      }
      terms_[k].scales.alpha = options_.alpha.at(level);
      terms_[k].scales.weight =
          options_.per_reference_mean ? terms_[k].weight * 2e4 / std::max(1, list.count) : terms_[k].weight;
    }
    part_level_ = level;
  }

  [[nodiscard]] RobustKernel kernel(int level) const {
    RobustKernel k = options_.kernel;
    if (options_.graduated && level == 0) {
      k.kind = KernelKind::Tukey;
      k.k = 0;
    }
    return k;
  }

  template <class Executor>
  void warp(int level, const Pose& T_camera_world, Buffer buffer, const Executor& executor) {
    if (part_level_ != level || buffer == accepted_) make_parts(level);
    const PyramidLevel& target = current_->level(level);
    const auto gate = static_cast<float>(std::pow(static_cast<double>(options_.warp.gate_growth), level));
    executor(static_cast<int>(parts_.size()), [&](int i) {
      Part& p = parts_[static_cast<std::size_t>(i)];
      Term& t = terms_[static_cast<std::size_t>(p.term)];
      p.counts = warp_pixels(t.pyramid->level(level).pixels, target, T_camera_world * t.T_world_reference, options_.warp,
                             options_.noise, gate, p.begin, p.end, buffer == accepted_ ? t.accepted : t.trial);
    });
    for (Term& t : terms_) (buffer == accepted_ ? t.counts : t.trial_counts) = WarpCounts{};
    for (const Part& p : parts_) {
      Term& t = terms_[static_cast<std::size_t>(p.term)];
      (buffer == accepted_ ? t.counts : t.trial_counts) += p.counts;
    }
  }
  void accept_trial() {
    for (Term& t : terms_) {
      std::swap(t.accepted, t.trial);
      std::swap(t.counts, t.trial_counts);
    }
  }
  [[nodiscard]] WarpCounts counts() const {
    WarpCounts c;
    for (const Term& t : terms_) c += t.counts;
    return c;
  }

  template <class Executor>
  [[nodiscard]] CostSum cost(int level, Buffer buffer, const Executor& executor) {
    kernel(level).template visit<float>([&](const auto& k) {
      executor(static_cast<int>(parts_.size()), [&](int i) {
        Part& p = parts_[static_cast<std::size_t>(i)];
        const Term& t = terms_[static_cast<std::size_t>(p.term)];
        p.cost = sum_cost(buffer == accepted_ ? t.accepted : t.trial, k, t.scales, p.begin, p.end);
      });
    });
    CostSum sum;
    for (const Part& p : parts_) sum += p.cost;
    return sum;
  }
  template <class Executor>
  [[nodiscard]] NormalEquations normal_equations(int level, const Executor& executor) {
    kernel(level).template visit<float>([&](const auto& k) {
      executor(static_cast<int>(parts_.size()), [&](int i) {
        Part& p = parts_[static_cast<std::size_t>(i)];
        const Term& t = terms_[static_cast<std::size_t>(p.term)];
        p.normal = sum_normal_equations(t.accepted, k, t.scales, p.begin, p.end);
      });
    });
    NormalEquations sum;
    for (const Part& p : parts_) sum += p.normal;
    return sum;
  }

  double scale_of(const std::vector<float>& s, const std::vector<float>& w, int valid) {
    samples_.clear();
    const auto step = static_cast<std::size_t>(std::max(1, valid / options_.scale_samples));
    std::size_t n = 0;
    for (std::size_t i = 0; i < s.size(); ++i) {
      if (w[i] > 0 && n++ % step == 0) samples_.push_back(s[i]);
    }
    return std::max(options_.scale_floor, robust_scale_in_place(options_.scale, samples_));
  }
  void estimate_scales(int) {
    for (Term& t : terms_) {
      t.scales.scale_intensity = scale_of(t.accepted.si, t.accepted.wi, t.counts.valid);
      t.scales.scale_depth = scale_of(t.accepted.sd, t.accepted.wd, t.counts.valid);
    }
  }
  // Geometric mean over the references, weighted by B_k N_k.
  void report_scales(AlignmentResult& r) const {
    double weight = 0;
    double i = 0;
    double d = 0;
    for (const Term& t : terms_) {
      const double w = t.weight * t.counts.valid;
      weight += w;
      i += w * std::log(t.scales.scale_intensity);
      d += w * std::log(t.scales.scale_depth);
    }
    r.scale_intensity = weight > 0 ? std::exp(i / weight) : 0.0;
    r.scale_depth = weight > 0 ? std::exp(d / weight) : 0.0;
  }

  // The candidate with the lowest cost at the coarsest level, all at the same scale.
  template <class Executor>
  Pose choose_start(const std::vector<Pose>& candidates, AlignmentResult& result, const Executor& executor) {
    const int level = levels_ - 1;
    double best = std::numeric_limits<double>::infinity();
    Pose T = inverse(result.T_world_camera);
    const auto consider = [&](const Pose& T_camera_world, int index) {
      warp(level, T_camera_world, accepted_, executor);
      for (Term& t : terms_) t.scales.scale_intensity = t.scales.scale_depth = 1.0;
      const CostSum c = cost(level, accepted_, executor);
      if (c.weight > 0 && c.mean() < best) {
        best = c.mean();
        T = T_camera_world;
        result.start_candidate = index;
      }
    };
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (is_finite(candidates[i])) consider(inverse(candidates[i]), static_cast<int>(i));
    }
    if (options_.prealign_rotation) {
      const Pose rotated = prealign_rotation(T);
      if (is_finite(rotated)) consider(rotated, static_cast<int>(candidates.size()));
    }
    return T;
  }

  // Photometric Gauss-Newton over the rotation on the homography of the plane at infinity, u = pi(R ray), against
  // the first reference at the coarsest level (idea: ElasticFusion, Whelan et al. 2016). Returns the best iterate.
  Pose prealign_rotation(const Pose& T_camera_world) {
    const Term& term = terms_.front();
    const int level = levels_ - 1;
    const PixelList& list = term.pyramid->level(level).pixels;
    const PyramidLevel& target = current_->level(level);
    const ImageView<const float> image = target.intensity.view();
    const Pinhole& cam = target.camera;
    constexpr int C = PyramidLevel::kChannels;
    Pose T = T_camera_world;
    Pose best = T;
    double best_cost = std::numeric_limits<double>::infinity();
    const std::size_t n = static_cast<std::size_t>(list.count);
    rows_.resize(n);
    for (int it = 0; it <= options_.prealign_iterations; ++it) {
      const Eigen::Matrix3f R = (T * term.T_world_reference).linear().cast<float>();
      double total = 0;
      double weight = 0;
      std::size_t m = 0;
      samples_.clear();
      for (std::size_t i = 0; i < n; ++i) {
        const Eigen::Vector3f y = R * Eigen::Vector3f(list.x[i] / list.z[i], list.y[i] / list.z[i], 1.0F);
        constexpr float kLost = 0.2F;  // cost of a lost pixel, and the largest of any
        weight += static_cast<double>(list.gamma[i]);
        if (!(y.z() > 0.1F)) {
          total += static_cast<double>(kLost * list.gamma[i]);
          continue;
        }
        const auto fx = static_cast<float>(cam.fx);
        const auto fy = static_cast<float>(cam.fy);
        const float u = fx * y.x() / y.z() + static_cast<float>(cam.cx);
        const float v = fy * y.y() / y.z() + static_cast<float>(cam.cy);
        if (!can_sample(image, static_cast<double>(u), static_cast<double>(v))) {
          total += static_cast<double>(kLost * list.gamma[i]);
          continue;
        }
        const Sample s = bilinear(image, static_cast<double>(u), static_cast<double>(v));
        const std::ptrdiff_t nearest =
            static_cast<std::ptrdiff_t>(std::lround(v)) * image.width + static_cast<std::ptrdiff_t>(std::lround(u));
        const float gamma = list.gamma[i] * target.texture[static_cast<std::size_t>(nearest * C + 3)];
        const float r = s.value - list.intensity[i];
        total += static_cast<double>(std::min(std::abs(r), kLost) * gamma);
        if (!(gamma > 0)) continue;
        const float iz = 1.0F / y.z();
        Eigen::Vector3f a(s.dx * fx * iz, s.dy * fy * iz, 0.0F);
        a.z() = -(a.x() * y.x() + a.y() * y.y()) * iz;
        const Eigen::Vector3f j = y.cross(a);
        rows_[m++] = {j.x(), j.y(), j.z(), r, gamma};
        samples_.push_back(r);
      }
      const double cost = weight > 0 ? total / weight : std::numeric_limits<double>::infinity();
      if (cost < best_cost) {
        best_cost = cost;
        best = T;
      } else if (it > 2 && cost > 1.2 * best_cost) {
        break;
      }
      if (m < 100 || it == options_.prealign_iterations) break;
      const double scale = std::max(1e-3, mad_scale_in_place(samples_)) * 2.3849;
      const auto inv = static_cast<float>(1.0 / scale);
      Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
      Eigen::Vector3d b = Eigen::Vector3d::Zero();
      for (std::size_t i = 0; i < m; ++i) {
        const auto& row = rows_[i];
        const Eigen::Vector3d j(static_cast<double>(row[0]), static_cast<double>(row[1]), static_cast<double>(row[2]));
        const float s = row[3] * inv;
        const double w = static_cast<double>(row[4] / (1.0F + s * s));
        H += w * j * j.transpose();
        b -= w * static_cast<double>(row[3]) * j;
      }
      H.diagonal() *= 1.0 + 1e-4;
      H.diagonal().array() += 1e-9;
      const Eigen::Vector3d step = H.ldlt().solve(b);
      if (!step.allFinite()) break;
      Twist xi = Twist::Zero();
      xi.tail<3>() = step.norm() > 0.2 ? Eigen::Vector3d(step * (0.2 / step.norm())) : step;
      T = normalized(se3_exp(xi) * T);
      if (step.norm() < 1e-4) {
        // one more look at the cost of this last iterate is not worth an iteration when it hardly moved
        break;
      }
    }
    return best;
  }

  [[nodiscard]] double typical_depth(int level) const {
    double sum = 0;
    double weight = 0;
    for (const Term& t : terms_) {
      const PyramidLevel& l = t.pyramid->level(level);
      sum += static_cast<double>(l.median_depth) * l.pixels.count;
      weight += l.pixels.count;
    }
    return weight > 0 && sum > 0 ? sum / weight : 1.0;
  }

  // Which directions the normal equations determine; P projects scaled twists onto the others.
  int degenerate(const Matrix6& H, double depth, Eigen::Matrix<double, 6, 6>& P, Twist* eigenvalues) const {
    Eigen::Matrix<double, 6, 1> D;
    D << depth, depth, depth, 1, 1, 1;
    const Eigen::Matrix<double, 6, 6> scaled = D.asDiagonal() * H * D.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(scaled);
    P.setZero();
    int count = 0;
    const double largest = eigen.eigenvalues()(5);
    for (int i = 0; i < 6; ++i) {
      const double value = eigen.eigenvalues()(i);
      if (value < options_.degenerate_ratio * largest || value < options_.degenerate_floor) {
        P += eigen.eigenvectors().col(i) * eigen.eigenvectors().col(i).transpose();
        ++count;
      }
    }
    if (eigenvalues != nullptr) *eigenvalues = eigen.eigenvalues();
    return count;
  }

  void add_prior(const Pose& T_guess, const Pose& T, NormalEquations& n) const {
    if (!(options_.prior_sigma_translation > 0) || !(options_.prior_sigma_rotation > 0)) return;
    const Twist e = se3_log(T_guess * inverse(T));
    Twist p;
    p.head<3>().setConstant(1.0 / (options_.prior_sigma_translation * options_.prior_sigma_translation));
    p.tail<3>().setConstant(1.0 / (options_.prior_sigma_rotation * options_.prior_sigma_rotation));
    p /= options_.information_deflation;
    n.H.diagonal() += p;
    n.b += p.cwiseProduct(e);
  }

  template <class Executor>
  Status solve_level(int level, const Pose& T_guess, Pose& T, bool& converged, AlignmentResult& result,
                     const Executor& executor) {
    using Vector6 = Eigen::Matrix<double, 6, 1>;
    using Mat6 = Eigen::Matrix<double, 6, 6>;
    converged = false;
    warp(level, T, accepted_, executor);
    WarpCounts c = counts();
    if (c.selected < options_.min_pixels) return Status::TooFewPixels;
    if (c.valid < options_.min_pixels) return level > 0 ? Status::TooFewPixels : Status::NoOverlap;
    const double depth = typical_depth(level);
    Vector6 D;
    D << depth, depth, depth, 1, 1, 1;
    double mu = options_.damping;
    const int most = static_cast<int>(options_.iterations.at(level));
    for (int it = 0; it < most && !converged; ++it) {
      ++result.iterations;
      estimate_scales(level);
      const double before = cost(level, accepted_, executor).mean();
      NormalEquations n = normal_equations(level, executor);
      if (!std::isfinite(before) || !n.H.allFinite() || !n.b.allFinite()) return Status::Diverged;
      add_prior(T_guess, T, n);
      Mat6 P;
      if (degenerate(n.H, depth, P, nullptr) == 6) return level > 0 ? Status::TooFewPixels : Status::SingularSystem;
      const Mat6 keep = Mat6::Identity() - P;
      const Mat6 scaled = D.asDiagonal() * n.H * D.asDiagonal();
      const Vector6 right = D.asDiagonal() * n.b;
      bool moved = false;
      for (int reject = 0; reject <= options_.max_rejects; ++reject) {
        // Solved within the determined directions only; the identity on the others keeps the system regular.
        Mat6 A = keep * scaled * keep + scaled(0, 0) * P + 1e-12 * scaled.trace() * Mat6::Identity();
        A.diagonal() += mu * scaled.diagonal();
        const Vector6 step = D.asDiagonal() * (keep * A.ldlt().solve(keep * right));
        if (!step.allFinite()) return Status::Diverged;
        const bool tiny = step.head<3>().cwiseAbs().maxCoeff() < options_.stop_translation &&
                          step.tail<3>().cwiseAbs().maxCoeff() < options_.stop_rotation;
        const Pose T_trial = normalized(se3_exp(step) * T);
        warp(level, T_trial, trial_, executor);
        const CostSum after = cost(level, trial_, executor);
        if (after.weight > 0 && after.mean() < before) {
          T = T_trial;
          accept_trial();
          moved = true;
          mu = std::max(1e-9, mu / 10);
          converged = tiny || before - after.mean() < options_.stop_relative_cost * before;
          break;
        }
        mu = std::max(1e-9, mu * 10);
        if (tiny) break;
      }
      if (!moved) converged = true;  // no step lowers the cost: a minimum
    }
    c = counts();
    if (c.valid < options_.min_pixels) return level > 0 ? Status::TooFewPixels : Status::NoOverlap;
    return Status::Converged;
  }

  template <class Executor>
  void finish(const Pose& T_guess, const Pose& T_start, Pose T, bool converged, AlignmentResult& r,
              const Executor& executor) {
    using Mat6 = Eigen::Matrix<double, 6, 6>;
    using Vector6 = Eigen::Matrix<double, 6, 1>;
    r.counts = counts();
    r.valid_share = share(r.counts);
    estimate_scales(0);
    report_scales(r);
    const CostSum final_cost = cost(0, accepted_, executor);
    r.cost = final_cost.mean();
    NormalEquations n = normal_equations(0, executor);
    if (!is_finite(T) || !std::isfinite(r.cost) || !n.H.allFinite()) {
      r.cost = 0;
      fail(r, Status::Diverged);
      return;
    }
    r.median_depth = typical_depth(0);
    Mat6 P;
    r.degenerate_count = degenerate(n.H, r.median_depth, P, &r.eigenvalues);
    r.degenerate_projector = P;
    if (r.valid_share < options_.min_valid_share) {
      fail(r, Status::NoOverlap);
      return;
    }
    if (r.degenerate_count == 6) {
      fail(r, Status::SingularSystem);
      return;
    }
    Vector6 D;
    D.head<3>().setConstant(r.median_depth);
    D.tail<3>().setOnes();
    if (r.degenerate_count > 0 && !T_start.isApprox(T_guess, 1e-12)) {
      // it did not start at the guess: bring the undetermined directions back to it
      const Vector6 e = D.cwiseInverse().asDiagonal() * Vector6(se3_log(T_guess * inverse(T)));
      const Vector6 back = D.asDiagonal() * (P * e);
      T = normalized(se3_exp(back) * T);
    }
    if (options_.check_against_guess) {
      warp(0, T_guess, trial_, executor);
      const CostSum guess_cost = cost(0, trial_, executor);
      if (guess_cost.weight > 0 && guess_cost.mean() < r.cost * (1 - 1e-9)) {
        fail(r, Status::Diverged);
        return;
      }
    }
    const Mat6 keep = Mat6::Identity() - P;
    const Mat6 scaled = D.asDiagonal() * n.H * D.asDiagonal();
    const double fill = scaled.trace() / 6;
    const Mat6 inverted = keep * (keep * scaled * keep + fill * P).ldlt().solve(Mat6::Identity()) * keep;
    const Mat6 covariance = D.asDiagonal() * inverted * D.asDiagonal();
    r.information = options_.information_deflation * n.H;
    r.covariance = 0.5 / options_.information_deflation * (covariance + covariance.transpose());
    r.T_world_camera = normalized(inverse(T));
    r.status = r.degenerate_count > 0 ? Status::Degenerate : (converged ? Status::Converged : Status::MaxIterations);
  }

  AlignmentOptions options_;
  const FramePyramid* current_ = nullptr;
  int levels_ = 0;
  int part_level_ = -1;
  std::vector<Term> terms_;
  std::vector<Part> parts_;
  std::vector<float> samples_;
  std::vector<std::array<float, 5>> rows_;
};

APSO_NAMESPACE_END
