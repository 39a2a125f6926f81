/// \file
/// Front door: where did the camera go? Direct alignment of RGB-D frames, and nothing else.
///
/// Images are any type with image_traits, poses any with pose_traits (docs/concepts); no image is copied to be read. The
/// shortest complete use:
/// \code
///   #include <apso/align.hpp>
///   const auto first = apso::frame(t0, grey0, apso::scaled(depth0, 0.001F), camera);   // 16-bit millimetres, as they are
///   const auto second = apso::frame(t1, grey1, apso::scaled(depth1, 0.001F), camera);
///   const auto found = apso::align(first, second, Eigen::Isometry3d::Identity());      // the guess
///   if (apso::succeeded(found.status) && found.confidence > 0.5) use(found.T_current_reference);  // an Isometry3d
/// \endcode
///
/// | question                                      | answer                                                            |
/// |-----------------------------------------------|-------------------------------------------------------------------|
/// | one pair                                      | `align(reference, current, guess, options, executor)`             |
/// | is the way back the same?                     | `PairOptions::backward`                                           |
/// | many frames, several references, masks        | `FramePyramid` and `DirectAligner`: they reuse their memory       |
/// | every pixel instead of chosen ones            | `dense_alignment()`, with `pyramid.finest = 0`, `max_pixels = 0`  |
/// | how certain is it?                            | `detail.covariance`, `detail.degenerate_projector`, `confidence`  |
/// | several threads                               | an executor (executor.hpp); the result does not depend on it      |
///
/// A failure is a status below zero, and the pose is then the guess. Frames of different sizes or cameras are a
/// contract_error. T_current_reference maps points of the reference frame into the current one.
#pragma once

#include <apso/refinement/align.hpp>
#include <apso/refinement/aligner.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/traits/camera.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/pose.hpp>
