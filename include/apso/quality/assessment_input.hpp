/// \file
/// What is known about a frame when it is assessed, of any types.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/traits/any.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/images/rows.hpp>
#include <apso/traits/ranges.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/keypoint.hpp>
#include <apso/types/track.hpp>

APSO_NAMESPACE_BEGIN

/// A frame in the types of the library. Nothing is kept beyond the call.
struct AssessmentInput {
  RgbdFrame frame;                                   ///< without intensity blur is not seen, without depth S_depth and
                                                     ///< S_dc are missing
  ImageView<const float> dynamic_probability{};      ///< [0,1], of the frame's size; empty = everything static
  const std::vector<Keypoint>* keypoints = nullptr;  ///< null: S_feature is missing
  const std::vector<PointTrack>* tracks = nullptr;   ///< null: S_mc is missing
  const std::vector<Detection>* objects = nullptr;   ///< null: S_dec is missing; else as an empty list
  double dynamic_ratio = 0;                          ///< [0,1]; NaN counts as 1
  bool feature_tracking_ok = true;                   ///< did the feature tracker find a pose?
  const Pose* T_world_camera = nullptr;              ///< that pose, if known: one that is not rigid (is_rigid(), e.g. NaN) counts as
                                                     ///< none found; FlowKind::PosePredicted asks for it
  int matches = -1;                                  ///< points of the map that agree with that pose; -1 = not known
  const Pose* T_world_predicted = nullptr;           ///< what was expected before the features were matched with the map: by the motion of
                                                     ///< tracks, by other sensors or by constant velocity; null, or one that is not
                                                     ///< rigid: S_inn is 1
};

/// A frame in types of yours. Made by assessment_input().
template <class FrameT, class Keypoints, class Tracks, class Objects, class Mask>
struct ForeignAssessmentInput {
  FrameT frame;
  Keypoints keypoints;
  Tracks tracks;
  Objects objects;
  Mask dynamic_probability;
  std::optional<double> dynamic_ratio{};    ///< [0,1]; by default the mean of the dynamic probability
  bool feature_tracking_ok = true;          ///< did the feature tracker find a pose?
  const Pose* T_world_camera = nullptr;     ///< that pose, as in AssessmentInput
  int matches = -1;                         ///< points of the map that agree with that pose; -1 = not known
  const Pose* T_world_predicted = nullptr;  ///< what was expected, as in AssessmentInput
};

/// What SceneAssessor::assess takes; `none` for what you do not have. Named lists and images must outlive the result,
/// temporaries are taken along.
/// \param frame     made by frame(), or an RgbdFrame
/// \param keypoints range of keypoints; none: S_feature is missing
/// \param tracks    range of tracks; none: S_mc is missing
/// \param objects   range of detections; none: S_dec is missing, which an empty range is not
/// \param dynamic_probability any image in [0,1] of the frame's size; none: everything is static
template <class FrameT, class K = const None&, class T = const None&, class D = const None&, class M = const None&>
[[nodiscard]] auto assessment_input(const FrameT& frame, K&& keypoints = none, T&& tracks = none, D&& objects = none,
                                    M&& dynamic_probability = none) {
  check_frame<FrameT>();
  using Input = ForeignAssessmentInput<FrameT, detail::held_t<K>, detail::held_t<T>, detail::held_t<D>, detail::held_t<M>>;
  return Input{frame, detail::held_t<K>(std::forward<K>(keypoints)), detail::held_t<T>(std::forward<T>(tracks)),
               detail::held_t<D>(std::forward<D>(objects)), detail::held_t<M>(std::forward<M>(dynamic_probability))};
}

/// Mean of an image, e.g. the dynamic ratio of a map of dynamic probabilities; 0 for none.
/// \param scratch working memory for rows that are not floats
[[nodiscard]] inline double mean_of(const AnyImage& image, std::vector<float>& scratch) {
  if (image.empty()) return 0;
  auto image_row = rows(image, scratch);
  double sum = 0;
  for (int y = 0; y < image.height(); ++y) {
    const float* row = image_row(y);
    double of_row = 0;
    for (int x = 0; x < image.width(); ++x) of_row += static_cast<double>(row[x]);
    sum += of_row;
  }
  return sum / (static_cast<double>(image.width()) * image.height());
}

APSO_NAMESPACE_END
