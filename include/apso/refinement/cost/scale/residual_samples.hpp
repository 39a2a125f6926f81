/// \file
/// Residuals of some of the pixels of a level, and what is estimated from them: robust scales and Barron's alpha.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/kernels.hpp>
#include <apso/math/lanes/lane_functions.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/refinement/cost/illumination.hpp>
#include <apso/refinement/cost/kernel_loop.hpp>
#include <apso/refinement/cost/scale/term_scales.hpp>
#include <apso/refinement/cost/warped_pixels.hpp>

APSO_NAMESPACE_BEGIN

/// Residuals of one kind, in units of the noise, and their scale. Those of the image are spread as the pixels are that are aligned,
/// but what moves sets their median as soon as it fills half of the image, and a scale that lets it pass brings the pose to it. The
/// surface that is seen is the measure of the labels too: what moves is mostly near. It is taken where its scale is so much
/// smaller that something near does not agree.
struct SampledResiduals {
  std::vector<float> residuals;
  std::vector<float> surface;  ///< that each stands for, depth^2
  double scale = 0;            ///< of the residuals as they are

  void resize(std::size_t n) {
    residuals.resize(n);
    surface.resize(n);
  }
  void estimate(ScaleKind kind) {
    scratch_ = residuals;
    scale = robust_scale_in_place(kind, scratch_);
    pick_over_surface();
    gather(residuals, scratch_);
    scale_over_surface_ = robust_scale_in_place(kind, scratch_);
  }
  [[nodiscard]] bool crowded() const { return scale_over_surface_ < 0.67 * scale; }
  void spread_over_surface() {
    pick(residuals);
    scale = scale_over_surface_;
  }
  /// As many of the values, spread evenly over the surface.
  void pick(std::vector<float>& values) {
    gather(values, picked_values_);
    values.swap(picked_values_);
  }
  /// Room to work in.
  [[nodiscard]] std::vector<float>& scratch() { return scratch_; }

 private:
  // The middle of each of as many equal shares of the surface: which residual stands there.
  void pick_over_surface() {
    const std::size_t n = surface.size();
    double whole = 0;
    for (const float s : surface) whole += static_cast<double>(s);
    const double share = whole / static_cast<double>(n);
    picked_.resize(n);
    std::size_t k = 0;
    double until = -0.5 * share;  // of the share that is to be filled next
    for (std::size_t i = 0; i < n; ++i) {
      until += static_cast<double>(surface[i]);
      for (; until > 0 && k < n; until -= share) picked_[k++] = static_cast<std::uint32_t>(i);
    }
    picked_.resize(k);
  }
  void gather(const std::vector<float>& values, std::vector<float>& of_picked) const {
    of_picked.resize(picked_.size());
    for (std::size_t i = 0; i < picked_.size(); ++i) of_picked[i] = values[picked_[i]];
  }

  double scale_over_surface_ = 0;
  std::vector<std::uint32_t> picked_;
  std::vector<float> scratch_, picked_values_;
};

/// The samples of one reference. Keeps its buffers; the same for any executor.
class ResidualSamples {
 public:
  SampledResiduals intensity, depth;
  IntensityPairs pairs;                             ///< of the photometric residuals, in their order
  std::vector<float> joint_intensity, joint_depth;  ///< of the pixels with residuals of both kinds; only if asked for

  /// Takes about `most` pixels of the list.
  void take(const PixelList& list, const Warpers& warper, const NoiseRef& noise, int most, bool joint, const ExecutorRef& executor) {
    const int blocks = list.blocks();
    const int n = std::min(blocks, std::max(1, most / PixelList::kBlock));
    // each share of the work has room for all its pixels and one more
    const auto room = [&](int share) { return static_cast<std::size_t>(n * share / kShares * PixelList::kBlock + share); };
    for (std::vector<float>* v : {&intensity.residuals, &intensity.surface, &pairs.reference, &pairs.current, &pairs.inverse_sigma,
                                  &depth.residuals, &depth.surface, &joint_intensity, &joint_depth}) {
      v->resize(room(kShares));
    }
    std::size_t with_intensity[kShares], with_depth[kShares], with_both[kShares];
    executor(kShares, [&](int share) {
      WarpedPixels pixels;
      WarpCounts counts;
      std::size_t a = room(share);
      std::size_t b = a;
      std::size_t c = a;
      std::size_t k = 0;
      for (int i = n * share / kShares; i < n * (share + 1) / kShares; ++i) {
        const int at_block = static_cast<int>(static_cast<long long>(i) * blocks / n);
        while (list.tiles[k].end <= at_block) ++k;
        const float surface = list.tiles[k].depth * list.tiles[k].depth;
        const float* block = list.block(at_block);
        noise(warper, {}, block, 1, pixels, counts);
        const WarpedPixels::Block& o = pixels.blocks[0];
        for (int at = 0; at < PixelList::kBlock; at += kLanes) {
          const auto get = [at](const float(&of)[PixelList::kBlock]) { return Lanes::load(of + at); };
          const Lanes inverse_intensity = sqrt(get(o.inverse_intensity));
          const Lanes r_intensity = get(o.residual_intensity) * inverse_intensity;
          const Lanes r_depth = get(o.residual_depth) * sqrt(get(o.inverse_depth));
          for (int j = 0; j < kLanes; ++j) {  // each is written, and overwritten by the next unless it counts
            intensity.residuals[a] = r_intensity[j];
            intensity.surface[a] = surface;
            pairs.reference[a] = block[PixelList::kIntensity * PixelList::kBlock + at + j];
            pairs.current[a] = o.current[at + j];
            pairs.inverse_sigma[a] = inverse_intensity[j];
            depth.residuals[b] = r_depth[j];
            depth.surface[b] = surface;
            a += o.weight_intensity[at + j] > 0 ? 1 : 0;
            b += o.weight_depth[at + j] > 0 ? 1 : 0;
          }
          for (int j = 0; joint && j < kLanes; ++j) {
            joint_intensity[c] = r_intensity[j];
            joint_depth[c] = r_depth[j];
            c += o.weight_intensity[at + j] > 0 && o.weight_depth[at + j] > 0 ? 1 : 0;
          }
        }
      }
      with_intensity[share] = a - room(share);
      with_depth[share] = b - room(share);
      with_both[share] = c - room(share);
    });
    const auto close_up = [&](std::vector<float>& v, const std::size_t* counts) {
      std::size_t end = 0;
      for (int share = 0; share < kShares; ++share) {
        const auto first = v.begin() + static_cast<std::ptrdiff_t>(room(share));
        std::copy(first, first + static_cast<std::ptrdiff_t>(counts[share]), v.begin() + static_cast<std::ptrdiff_t>(end));
        end += counts[share];
      }
      v.resize(end);
    };
    for (std::vector<float>* v : {&intensity.residuals, &intensity.surface, &pairs.reference, &pairs.current, &pairs.inverse_sigma}) {
      close_up(*v, with_intensity);
    }
    for (std::vector<float>* v : {&depth.residuals, &depth.surface}) close_up(*v, with_depth);
    for (std::vector<float>* v : {&joint_intensity, &joint_depth}) close_up(*v, with_both);
  }

  /// Scales of both kinds, over the image or over the surface.
  void estimate(ScaleKind kind, const ExecutorRef& executor) {
    executor(2, [&](int task) { (task == 0 ? intensity : depth).estimate(kind); });
    if (!intensity.crowded() && !depth.crowded()) return;
    executor(2, [&](int task) { (task == 0 ? intensity : depth).spread_over_surface(); });
    for (std::vector<float>* v : {&pairs.reference, &pairs.current, &pairs.inverse_sigma}) intensity.pick(*v);
  }

  /// Robust scales of what was taken, after `estimate`.
  /// \param floor smallest scale
  /// \param s says of which residuals, and where alpha stands
  [[nodiscard]] TermScales scales(ScaleKind kind, double floor, TermScales s) {
    s.scale_intensity = std::max(floor, intensity.scale);
    s.scale_depth = std::max(floor, depth.scale);
    if (s.coupling == ScaleCoupling::Joint) {
      const auto factor = static_cast<float>(std::sqrt(s.inner_weight()));
      both_.clear();
      for (const float r : intensity.residuals) both_.push_back(factor * r);
      both_.insert(both_.end(), depth.residuals.begin(), depth.residuals.end());
      s.scale_intensity = s.scale_depth = std::max(floor, robust_scale_in_place(kind, both_));
    } else if (s.coupling == ScaleCoupling::BivariateT && !joint_depth.empty()) {
      const Eigen::Matrix2d sigma = bivariate_t_scale(joint_intensity, joint_depth);
      s.scale_depth = std::max(floor, std::sqrt(sigma(1, 1)));
      s.slope = sigma(0, 1) / (s.scale_depth * s.scale_depth);
      s.scale_intensity = std::max(floor, std::sqrt(std::max(0.0, sigma(0, 0) - s.slope * sigma(0, 1))));
    }
    return s;
  }

 private:
  static constexpr int kShares = 4;  // units of work
  std::vector<float> both_;
};

/// Finds the alpha of Barron's family that explains residuals best: minimises sum rho + n log Z(alpha) over alpha = -10, -9.9 ... 2,
/// with the partition function Z truncated at |s| <= 10 c (Chebrolu et al., RA-L 2021). Keeps its buffers.
class AdaptiveAlpha {
 public:
  /// \param s residuals in standard deviations
  /// \param c scale of the kernel
  /// \return alpha in [-10,2]; 0 without residuals
  [[nodiscard]] double operator()(const std::vector<float>& s, double c) {
    if (s.empty()) return 0;
    const auto largest = static_cast<float>(100 * c * c);
    squares_.assign((s.size() + kAtOnce - 1) / kAtOnce * kAtOnce, 0.0F);
    for (std::size_t i = 0; i < s.size(); ++i) squares_[i] = std::min(s[i] * s[i], largest);
    for (int i = 0; i <= 500; ++i) densities_[i] = static_cast<float>(c * c * i * i / 2500);  // s from 0 to 10 c
    double best = 0;
    double best_cost = std::numeric_limits<double>::infinity();
    for (int step = 0; step <= 120; ++step) {
      RobustKernel kernel{KernelKind::Barron, c, 0.1 * (step - 100)};
      double z = 0;
      each_rho(kernel, densities_, 501, [&](int i, double rho) { z += std::exp(-rho) * (i == 0 ? 1 : 2) * c / 50; });
      double cost = static_cast<double>(s.size()) * std::log(z);
      each_rho(kernel, squares_.data(), static_cast<int>(s.size()), [&](int, double rho) { cost += rho; });
      if (cost < best_cost) {
        best_cost = cost;
        best = kernel.alpha;
      }
    }
    return std::abs(best) < 1e-9 ? 0.0 : best;
  }

 private:
  static constexpr int kAtOnce = 128;

  // f(i, rho of s2[i]); s2 has room for a multiple of kAtOnce.
  template <class F>
  static void each_rho(const RobustKernel& kernel, const float* s2, int n, F&& f) {
    const KernelRef loop(kernel);
    float square[kAtOnce], rho[kAtOnce];
    for (int i = 0; i < n; i += kAtOnce) {
      std::copy_n(s2 + i, kAtOnce, square);
      loop(square, rho, kAtOnce);
      for (int k = i; k < std::min(n, i + kAtOnce); ++k) f(k, static_cast<double>(rho[k - i]));
    }
  }

  std::vector<float> squares_;
  float densities_[512] = {};
};

APSO_NAMESPACE_END
