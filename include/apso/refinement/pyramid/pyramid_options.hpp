/// \file
/// Settings of the image pyramid.
#pragma once

#include <apso/config.hpp>
#include <apso/types/frame.hpp>

APSO_NAMESPACE_BEGIN

/// Smallest width and height of an image that is aligned [px]; a smaller one is no image any more.
inline constexpr int kMinAlignedSize = 8;

struct PyramidOptions {
  int levels = 6;                       ///< resolutions, counted from the full one (level 0)
  int finest = 1;                       ///< finest level used; 1 = half resolution
  float finer_level_mask_share = 0.4F;  ///< a frame of which a larger share may be dynamic gets one finer level, so that
                                        ///< as many other pixels are left to choose from; 1 = never (docs/benchmarks.md)
  int max_pixels = 20000;               ///< aligned at the finest level; 0 = all. Four times as many at the finer level of a
                                        ///< masked frame
  int max_coarse_pixels = 5000;         ///< aligned at each coarser level, which only have to get near; 0 = all
  float sensor_noise = 1;               ///< of a gradient that counts, as a multiple of what a structured-light camera has: 4 grey
                                        ///< values of 255, and depth_sigma; 0 = images without noise
  float gamma_potential = 0.1F;         ///< weight of a pixel that may be dynamic: its probability is 0.3 to 0.7
  DepthRange depth;                     ///< depth that is used [m]

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("levels", s.levels, 1, 8);
    v("finest", s.finest, 0, 7);
    v("finer_level_mask_share", s.finer_level_mask_share, 0.0F, 1.0F);
    v("max_pixels", s.max_pixels, 0, 100000000);
    v("max_coarse_pixels", s.max_coarse_pixels, 0, 100000000);
    v("sensor_noise", s.sensor_noise, 0.0F, 1000.0F);
    v("gamma_potential", s.gamma_potential, 0.0F, 1.0F);
    v("depth", s.depth);
  }
};

/// Weights of pixels in the cost, gamma of the paper's eq. (16), by their dynamic probability. The paper gives the order of
/// the weights only.
inline constexpr float kGammaStatic = 1.0F;           ///< of a pixel that is not dynamic
inline constexpr float kGammaDynamic = 0.0F;          ///< of a dynamic pixel
inline constexpr float kPotentialProbability = 0.3F;  ///< dynamic probability from which a pixel may be dynamic
inline constexpr float kConfirmedProbability = 0.7F;  ///< dynamic probability from which a pixel is dynamic

APSO_NAMESPACE_END
