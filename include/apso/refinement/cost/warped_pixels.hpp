/// \file
/// The first stage of a pass over a tile: some hundred pixels are warped, looked up and weighed by the noise model, and what they
/// give is laid down where the next stages find it in the first-level cache. Compiled once for each noise model, whatever the kernel.
#pragma once

#include <type_traits>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/refinement/cost/noise_model.hpp>
#include <apso/refinement/cost/residuals.hpp>
#include <apso/refinement/cost/scale/term_scales.hpp>

APSO_NAMESPACE_BEGIN

/// What warping gives for up to kBlocks blocks of a PixelList.
struct WarpedPixels {
  static constexpr int kBlocks = 8;
  static constexpr int kGroups = kBlocks * PixelList::kBlock / kLanes;
  struct Group {
    Lanes weight_intensity, weight_depth, lost;  ///< gamma, as in WarpedLanes
    Lanes inverse_intensity, inverse_depth;      ///< 1 / variance
    Lanes residual_intensity, residual_depth;
    Lanes I[3];     ///< photometric row; the depth row is in the list
    Lanes D[3];     ///< depth row of the current image, only if the warper gives it
    Lanes current;  ///< I_c(u)
  };
  Group groups[kGroups];
  Lanes s2[2 * kGroups];   ///< squared standardised residuals, of intensity and depth in turn; the kernel makes weights of them
  Lanes rho[2 * kGroups];  ///< their costs
};

/// What became of the pixels of all blocks so far, as minus the number in each lane.
struct WarpTally {
  IntLanes valid{}, valid_depth{}, out_of_view{}, occluded{}, disoccluded{}, masked{};

  [[nodiscard]] WarpCounts counts() const {
    const auto total = [](const IntLanes& n) {
      int sum = 0;
      for (int i = 0; i < kLanes; ++i) sum -= n[i];  // masks are -1
      return sum;
    };
    WarpCounts c;
    c.valid = total(valid);
    c.valid_depth = total(valid_depth);
    c.out_of_view = total(out_of_view);
    c.occluded = total(occluded);
    c.disoccluded = total(disoccluded);
    c.masked = total(masked);
    return c;
  }
};

/// Factors on the squared residuals that the kernel is asked about.
struct SquareFactors {
  Lanes intensity = 1.0F, depth = 1.0F;
  SquareFactors() = default;
  explicit SquareFactors(const TermScales& s)
      : intensity(s.inner_weight() / (s.scale_intensity * s.scale_intensity)), depth(1.0 / (s.scale_depth * s.scale_depth)) {}
};

/// A noise model of any type, by reference, and the stage it is compiled into. Must not outlive it.
class NoiseRef {
 public:
  NoiseRef() = default;  ///< of nothing yet
  template <class Noise, class = std::enable_if_t<!std::is_same_v<Noise, NoiseRef>>>
  explicit NoiseRef(const Noise& noise)
      : noise_(&noise),
        equations_([](const void* n, const Warper& w, const SquareFactors& f, const float* block, int blocks, WarpedPixels& out,
                      WarpTally& tally) { run<true>(*static_cast<const Noise*>(n), w, f, block, blocks, out, tally); }),
        cost_([](const void* n, const Warper& w, const SquareFactors& f, const float* block, int blocks, WarpedPixels& out,
                 WarpTally& tally) { run<false>(*static_cast<const Noise*>(n), w, f, block, blocks, out, tally); }) {
    check_noise_model<Noise>();
  }

  /// \param block the first of `blocks` <= WarpedPixels::kBlocks blocks one behind the other
  void operator()(const Warper& w, const SquareFactors& f, const float* block, int blocks, WarpedPixels& out, WarpTally& tally) const {
    equations_(noise_, w, f, block, blocks, out, tally);
  }
  /// Only what a cost is made of: s2, weights and lost.
  void cost(const Warper& w, const SquareFactors& f, const float* block, int blocks, WarpedPixels& out, WarpTally& tally) const {
    cost_(noise_, w, f, block, blocks, out, tally);
  }

 private:
  using Stage = void (*)(const void*, const Warper&, const SquareFactors&, const float*, int, WarpedPixels&, WarpTally&);

  template <bool kEquations, class Noise>
  APSO_FLATTEN static void run(const Noise& noise, const Warper& warper, const SquareFactors& factors, const float* block, int blocks,
                               WarpedPixels& out, WarpTally& tally) {
    IntLanes valid{}, valid_depth{}, out_of_view{}, occluded{}, disoccluded{}, masked{};
    WarpedPixels::Group* to = out.groups;
    Lanes* s2 = out.s2;
    for (const float* end = block + blocks * PixelList::kFields * PixelList::kBlock; block != end;
         block += PixelList::kFields * PixelList::kBlock) {
      PixelList::prefetch(block);
      for (int at = 0; at < PixelList::kBlock; at += kLanes, ++to, s2 += 2) {
        WarpedLanes o;
        warper.warp(noise, block, at, o);
        s2[0] = o.residual_intensity * o.residual_intensity * o.inverse_intensity * factors.intensity;
        s2[1] = o.residual_depth * o.residual_depth * o.inverse_depth * factors.depth;
        to->weight_intensity = o.weight_intensity;
        to->weight_depth = o.weight_depth;
        to->lost = o.lost;
        if constexpr (kEquations) {
          to->inverse_intensity = o.inverse_intensity;
          to->inverse_depth = o.inverse_depth;
          to->residual_intensity = o.residual_intensity;
          to->residual_depth = o.residual_depth;
          for (int i = 0; i < 3; ++i) to->I[i] = o.I[i];
          if (warper.rows_of_current()) {
            for (int i = 0; i < 3; ++i) to->D[i] = o.D[i];
          }
          to->current = o.current;
        }
        valid = valid + o.valid;
        valid_depth = valid_depth + o.valid_depth;
        out_of_view = out_of_view + o.out_of_view;
        occluded = occluded + o.occluded;
        disoccluded = disoccluded + o.disoccluded;
        masked = masked + o.masked;
      }
    }
    tally.valid = tally.valid + valid;
    tally.valid_depth = tally.valid_depth + valid_depth;
    tally.out_of_view = tally.out_of_view + out_of_view;
    tally.occluded = tally.occluded + occluded;
    tally.disoccluded = tally.disoccluded + disoccluded;
    tally.masked = tally.masked + masked;
  }

  const void* noise_ = nullptr;
  Stage equations_ = nullptr, cost_ = nullptr;
};

APSO_NAMESPACE_END
