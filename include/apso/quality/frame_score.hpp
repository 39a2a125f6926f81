/// \file
/// S_total of the paper, the quality of one frame by itself (eq. quality_score_initial, eq. function_f). S_Initial
/// is the same function of another frame.
#pragma once

#include <array>

#include <apso/config.hpp>
#include <apso/quality/weighted_mean.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// Weights of the frame score. They sum to 1. The features carry most; depth enough that a frame without any is
/// noticed; confidence and position of objects little: they hardly tell which frames fail (docs/quality.md).
struct FrameWeights {
  double conf = 0.10;
  double spatial = 0.10;
  double feature = 0.50;
  double depth = 0.30;
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("conf", s.conf, 0.0, 1.0);
    v("spatial", s.spatial, 0.0, 1.0);
    v("feature", s.feature, 0.0, 1.0);
    v("depth", s.depth, 0.0, 1.0);
  }
};

/// S_total = f(S_conf, S_spatial, S_feature, S_depth; w); missing components leave their weight to the others.
[[nodiscard]] inline MaybeQuality frame_score(MaybeQuality S_conf, MaybeQuality S_spatial, MaybeQuality S_feature,
                                              MaybeQuality S_depth, const FrameWeights& w = {}) {
  return weighted_mean<Quality, 4>({S_conf, S_spatial, S_feature, S_depth}, {w.conf, w.spatial, w.feature, w.depth});
}

APSO_NAMESPACE_END
