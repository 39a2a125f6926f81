/// \file
/// Front door: two estimates of one pose, which to take? The blend of a feature pose and a direct pose, and nothing else.
///
/// Poses are any type with pose_traits (docs/concepts): two of yours go in, one of yours comes out. The shortest complete use:
/// \code
///   #include <apso/blend.hpp>
///   const MyPose T = apso::blend(T_feature, T_direct, 0.7);   // 1 = T_feature, 0 = T_direct, along the screw between them
/// \endcode
///
/// | question                                             | answer                                                      |
/// |------------------------------------------------------|-------------------------------------------------------------|
/// | a weight is known                                    | `blend(T_feature, T_direct, w)`                             |
/// | each pose knows some directions better               | `blend(T_feature, T_direct, w, information_f, information_d)` |
/// | the weight of the paper, exp(-mu S_change)           | `difference_weight(S_change, mu)`                           |
/// | weights, confidence, and poses that are far apart    | `blend(T_feature, T_direct, T_predicted, BlendEvidence{...})` |
/// | the paper to the letter                              | `BlendOptions::weight = BlendWeight::Printed`               |
/// | no jump where GOOD becomes BAD                       | `BlendOptions::transition`                                  |
///
/// The poses are T_world_camera. Information belongs to increments (v, w) in the camera frame, metres and radians.
#pragma once

#include <apso/refinement/blend.hpp>
#include <apso/traits/pose.hpp>
