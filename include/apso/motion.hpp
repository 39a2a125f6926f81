/// \file
/// Front door: where does the image move? Everything of observation/, and nothing else.
///
/// The shortest complete use, with images, poses and tracks of your own types (docs/concepts says how they are read):
/// \code
///   #include <apso/motion.hpp>
///   apso::GeometricMotion motion(camera);                       // needs no network
///   apso::DynamicMask mask;
///   while (next(grey, depth, tracks)) {
///     const auto now = apso::frame(seconds, grey, apso::scaled(depth, 1 / 5000.F), camera);
///     motion.observe(now, T_world_camera_prior, tracks, mask);  // tracks: any range, or apso::none
///     // ... estimate T_world_camera from what lies outside of the mask: mask.probability(x, y) < 0.5 ...
///     motion.remember(now, T_world_camera, mask);
///   }
/// \endcode
/// No image is copied, and nothing of yours is kept after a call.
///
/// - Find motion from depth and tracks: GeometricMotion (the default), EpipolarMotion, MultiViewDepth, ClusterResidual,
///   ResidualMotion.
/// - Join two policies: `p | q` is dynamic where either says so, `p * q` where both do, `p & q` keeps the objects of p that
///   q sees move.
/// - Improve what a policy says: DepthRefinedMask, MaskPropagation, TemporalFilter.
/// - Choose at run time: `motion_by_name("geometric | residual", camera)`; AnyMotionPolicy holds any policy.
/// - Write your own: three functions in one struct, see observation/motion_policy.hpp.
/// - Take the masks or boxes of a network: mask_from_labels(), mask_from_detections().
/// - Get objects with identities: ObjectTracker.
/// - Ask how much moves: dynamic_ratio(), known_ratio(). Keep features when little is static: static_support(), soften().
///
/// Detectors that need OpenCV are in apso/opencv/detectors/.
#pragma once

#include <apso/observation/combined_policy.hpp>
#include <apso/observation/dynamic_mask.hpp>
#include <apso/observation/motion_by_name.hpp>
#include <apso/observation/motion_policy.hpp>
#include <apso/observation/objects/object_tracker.hpp>
#include <apso/observation/soft_weights.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/images/rows.hpp>
