/// \file
/// What direct alignment is given besides its options, and what it answers.
#pragma once

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/refinement/cost/residuals.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/status.hpp>

APSO_NAMESPACE_BEGIN

/// A frame that the current one is aligned to.
struct AlignmentReference {
  const FramePyramid* pyramid = nullptr;  ///< prepared as reference
  Pose T_world_reference = identity_pose();
  double weight = 1;  ///< B_k, >= 0
};

struct AlignmentResult {
  Status status = Status::NotRun;
  Pose T_world_camera = identity_pose();            ///< the first candidate if the status is a failure
  Matrix6 information = zeros<Matrix6>();           ///< of the increment (v, w) in the camera frame, T_c_w <- Exp(d) T_c_w; 0 in open
                                                    ///< directions
  Matrix6 covariance = zeros<Matrix6>();            ///< its inverse on the directions that are determined [m^2, m rad, rad^2]
  Twist eigenvalues = zeros<Twist>();               ///< of the scaled matrix S of solver/pose_information.hpp, rising
  int degenerate_count = 0;                         ///< open directions: they kept the initial guess, or that from corners
  Matrix6 degenerate_projector = zeros<Matrix6>();  ///< onto those directions, for twists scaled by (1/l, 1), l = median_depth
  bool ambiguous = false;                           ///< another pose explains the images as well: a pattern that repeats
  Pose T_world_camera_other = identity_pose();      ///< that pose, where ambiguous
  double median_depth = 0;                          ///< l [m]
  double valid_share = 0;                           ///< valid ones of the pixels that are not masked, at the finest level
  double static_share = 1;                          ///< of the area, by the labels of the regions; 1 without labels
  double foreground = 0;                            ///< what is nearer was left out, since it moves [m]; 0: nothing was
  double correlation = 0;                           ///< of the intensities of both images, [-1,1]; 1 when there is nothing to compare
  double scale_intensity = 0;                       ///< final robust scale in units of the noise model; 0 = unset
  double scale_depth = 0;                           ///< the same for depth
  double kernel_alpha = 0;                          ///< of Barron's family, where the residuals chose it (KernelKind::AdaptiveBarron)
  double cost = 0;                                  ///< final mean robust cost
  WarpCounts counts;                                ///< at the finest level
  int iterations = 0;                               ///< outer iterations over all levels
  Illumination illumination;                        ///< of the current frame against the first reference
  int start_candidate = -1;                         ///< index of the candidate it began with; the number of candidates = pre-alignment
};

APSO_NAMESPACE_END
