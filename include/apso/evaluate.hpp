/// \file
/// Front door: how good was it? Everything of evaluation/, and nothing else.
///
/// A trajectory is any range of entries with a stamp and a pose. Pairs of seconds and a pose of yours need no line; other
/// entries are explained by stamped_pose_traits, other poses by pose_traits. The shortest complete use:
/// \code
///   #include <apso/evaluate.hpp>
///   std::vector<std::pair<double, Eigen::Isometry3d>> truth, estimate;   // [s], T_world_camera
///   const auto ate = apso::ate(truth, estimate);          // after the best rigid motion
///   if (apso::succeeded(ate.status)) std::printf("ATE %.4f m\n", ate.statistics.rmse);
///   const auto rpe = apso::rpe(truth, estimate);          // over one second, no alignment
///   if (apso::succeeded(rpe.status)) std::printf("RPE %.4f m, %.3f deg\n", rpe.translation.rmse, rpe.rotation_deg.rmse);
/// \endcode
///
/// | question                                           | function                                                    |
/// |----------------------------------------------------|-------------------------------------------------------------|
/// | which poses belong together?                       | `associate(truth, estimate, rule)`: TUM or evo              |
/// | how far are the positions off?                     | `ate(truth, estimate)`; the alignment as a pose of your type |
/// | ... with a free scale, or about gravity only?      | `AteOptions::alignment`: Sim3, Yaw; `aligned(estimate, ate)` |
/// | how far does it drift per second, frame or metre?  | `rpe(truth, estimate, options)`: TUM script or paper        |
/// | stamps and poses in two lists                      | `trajectory(stamps, poses)`                                 |
/// | does a score predict failure?                      | `area_under_roc(events)`, `roc_curve`, `reliability`        |
/// | do two numbers go together?                        | `rank_correlation(x, y)`                                    |
///
/// Numbers agree with those of the scripts of the TUM RGB-D benchmark and of evo 1.x to the last digit that these print.
/// A trajectory with equal or falling stamps, or with a pose that is not finite, is a contract_error; too few pairs are a
/// status. Files are read by io/trajectory_file.hpp (TUM, KITTI, EuRoC).
#pragma once

#include <apso/evaluation/association.hpp>
#include <apso/evaluation/ate.hpp>
#include <apso/evaluation/decision_analysis.hpp>
#include <apso/evaluation/rpe.hpp>
#include <apso/evaluation/trajectory.hpp>
