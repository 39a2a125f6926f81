/// \file
/// The first stage of a pass over a tile: some hundred pixels are warped, looked up and weighed by the noise model, and what they
/// give is laid down where the next stages find it in the first-level cache. Compiled once for each noise model, whatever the kernel.
#pragma once

#include <type_traits>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>
#include <apso/refinement/cost/noise_model.hpp>
#include <apso/refinement/cost/residuals.hpp>
#include <apso/refinement/cost/scale/term_scales.hpp>

APSO_NAMESPACE_BEGIN

/// What warping gives for up to kBlocks blocks of a PixelList; one number for each pixel.
struct WarpedPixels {
  static constexpr int kBlocks = 8;
  static constexpr int kPixels = PixelList::kBlock;  ///< of a block
  static constexpr int kLine = 64;                   ///< bytes of a line of the cache: lanes that lie in two of them cost twice
  struct alignas(kLine) Block {
    float weight_intensity[kPixels], weight_depth[kPixels], lost[kPixels];  ///< gamma, as in WarpedLanes
    float inverse_intensity[kPixels], inverse_depth[kPixels];               ///< 1 / variance
    float residual_intensity[kPixels], residual_depth[kPixels];
    float I[3][kPixels];     ///< photometric row; the depth row is in the list
    float D[3][kPixels];     ///< depth row of the current image, only if the warper gives it
    float current[kPixels];  ///< I_c(u)
  };
  struct alignas(kLine) Pair {
    float intensity[kPixels], depth[kPixels];
  };
  Block blocks[kBlocks];
  Pair s2[kBlocks];   ///< squared standardised residuals; the kernel makes weights of them
  Pair rho[kBlocks];  ///< their costs
};

/// Factors on the squared residuals that the kernel is asked about.
struct SquareFactors {
  float intensity = 1, depth = 1;
  SquareFactors() = default;
  explicit SquareFactors(const TermScales& s)
      : intensity(static_cast<float>(s.inner_weight() / (s.scale_intensity * s.scale_intensity))),
        depth(static_cast<float>(1.0 / (s.scale_depth * s.scale_depth))) {}
};

/// A noise model of any type, by reference, and the stage it is compiled into. Must not outlive it.
class NoiseRef {
 public:
  NoiseRef() = default;  ///< of nothing yet
  template <class Noise, class = std::enable_if_t<!std::is_same_v<Noise, NoiseRef>>>
  explicit NoiseRef(const Noise& noise) : noise_(&noise), equations_(&stage<true, Noise>), cost_(&stage<false, Noise>) {
    check_noise_model<Noise>();
  }

  /// \param block the first of `blocks` <= WarpedPixels::kBlocks blocks one behind the other
  /// \param counts gets what became of the pixels added, but for `selected`
  void operator()(const Warpers& w, const SquareFactors& f, const float* block, int blocks, WarpedPixels& out, WarpCounts& counts) const {
    equations_(noise_, w, f, block, blocks, out, counts);
  }
  /// Only what a cost is made of: s2, weights and lost.
  void cost(const Warpers& w, const SquareFactors& f, const float* block, int blocks, WarpedPixels& out, WarpCounts& counts) const {
    cost_(noise_, w, f, block, blocks, out, counts);
  }

 private:
  using Stage = void (*)(const void*, const Warpers&, const SquareFactors&, const float*, int, WarpedPixels&, WarpCounts&);

  template <bool kEquations, class Noise>
  static void stage(const void* noise, const Warpers& warper, const SquareFactors& factors, const float* block, int blocks,
                    WarpedPixels& out, WarpCounts& counts) {
    in_widest_lanes([&, noise, block, blocks](auto lanes) {
      run<kEquations, lanes>(*static_cast<const Noise*>(noise), warper.with<lanes>(), factors, block, blocks, out, counts);
    });
  }

  template <bool kEquations, int n, class Noise>
  APSO_INLINE static void run(const Noise& noise, const BasicWarper<n>& warper, const SquareFactors& factors, const float* block,
                              int blocks, WarpedPixels& out, WarpCounts& counts) {
    using L = BasicLanes<n>;
    const L factor_intensity = factors.intensity;
    const L factor_depth = factors.depth;
    BasicIntLanes<n> valid{}, valid_depth{}, out_of_view{}, occluded{}, disoccluded{}, masked{};
    for (int b = 0; b < blocks; ++b, block += PixelList::kFields * PixelList::kBlock) {
      PixelList::prefetch(block);
      WarpedPixels::Block& to = out.blocks[b];
      WarpedPixels::Pair& s2 = out.s2[b];
      for (int at = 0; at < PixelList::kBlock; at += n) {
        BasicWarpedLanes<n> o;
        warper.warp(noise, block, at, o);
        (o.residual_intensity * o.residual_intensity * o.inverse_intensity * factor_intensity).store(s2.intensity + at);
        (o.residual_depth * o.residual_depth * o.inverse_depth * factor_depth).store(s2.depth + at);
        o.weight_intensity.store(to.weight_intensity + at);
        o.weight_depth.store(to.weight_depth + at);
        o.lost.store(to.lost + at);
        if constexpr (kEquations) {
          o.inverse_intensity.store(to.inverse_intensity + at);
          o.inverse_depth.store(to.inverse_depth + at);
          o.residual_intensity.store(to.residual_intensity + at);
          o.residual_depth.store(to.residual_depth + at);
          for (int i = 0; i < 3; ++i) o.I[i].store(to.I[i] + at);
          if (warper.rows_of_current()) {
            for (int i = 0; i < 3; ++i) o.D[i].store(to.D[i] + at);
          }
          o.current.store(to.current + at);
        }
        valid = valid + o.valid;
        valid_depth = valid_depth + o.valid_depth;
        out_of_view = out_of_view + o.out_of_view;
        occluded = occluded + o.occluded;
        disoccluded = disoccluded + o.disoccluded;
        masked = masked + o.masked;
      }
    }
    const auto total = [](const BasicIntLanes<n>& masks) {
      int sum = 0;
      for (int i = 0; i < n; ++i) sum -= masks[i];  // each is -1
      return sum;
    };
    counts.valid += total(valid);
    counts.valid_depth += total(valid_depth);
    counts.out_of_view += total(out_of_view);
    counts.occluded += total(occluded);
    counts.disoccluded += total(disoccluded);
    counts.masked += total(masked);
  }

  const void* noise_ = nullptr;
  Stage equations_ = nullptr, cost_ = nullptr;
};

APSO_NAMESPACE_END
