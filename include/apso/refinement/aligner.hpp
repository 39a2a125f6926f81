/// \file
/// Direct alignment of one frame to one or several references, the paper's eqs. (15) and (16):
///
///     T = argmin sum_k B_k sum_p gamma_k(p) gamma_c(u) [ alpha^2 C(s_I) + C(s_D) ],  s_I = w_I r_I, s_D = w_D r_D
///
/// over the one pose of the current camera. T_c_k = T_c_w T_w_k, so one increment from the left serves all references.
/// Solved coarse to fine (solver/level_solver.hpp). Directions that the images do not determine keep the initial guess
/// (solver/degeneracy.hpp).
#pragma once

#include <type_traits>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/executor.hpp>
#include <apso/math/kernels.hpp>
#include <apso/refinement/alignment_options.hpp>
#include <apso/refinement/alignment_result.hpp>
#include <apso/refinement/cost/kernel_loop.hpp>
#include <apso/refinement/cost/noise_model.hpp>
#include <apso/refinement/cost/warped_pixels.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>
#include <apso/refinement/solver/aligner_core.hpp>

APSO_NAMESPACE_BEGIN

/// Aligns frames. Keeps its buffers, so that a second call of the same size allocates nothing. Deterministic.
/// \tparam Kernel C of the cost: RobustKernel, which is chosen at run time, or a struct like those in math/kernels.hpp
/// \tparam Noise the weights w_I and w_D: NoiseModel, or a struct like it (cost/noise_model.hpp)
template <class Kernel = RobustKernel, class Noise = NoiseModel>
class BasicDirectAligner {
  static_assert((check_kernel<Kernel>(), check_noise_model<Noise>(), true), "");

 public:
  /// Kernel and noise model as the options say where they are of apso, else as they are by default.
  explicit BasicDirectAligner(const AlignmentOptions& options = {}) : BasicDirectAligner(options, kernel_of(options), noise_of(options)) {}
  explicit BasicDirectAligner(const AlignmentOptions& options, Kernel kernel)
      : BasicDirectAligner(options, std::move(kernel), noise_of(options)) {}
  BasicDirectAligner(const AlignmentOptions& options, Kernel kernel, Noise noise)
      : core_(options), kernel_(std::move(kernel)), noise_(std::move(noise)) {}

  [[nodiscard]] const AlignmentOptions& options() const { return core_.options(); }
  [[nodiscard]] const Kernel& kernel() const { return kernel_; }
  [[nodiscard]] const Noise& noise() const { return noise_; }

  /// \param current prepared as current
  /// \param T_world_camera_candidates initial guesses, the most trusted first; the best is chosen by the cost at the
  ///        coarsest level. The first one is the initial guess that a failure and degenerate directions keep.
  /// \param executor the result does not depend on its threads
  [[nodiscard]] AlignmentResult align(const std::vector<AlignmentReference>& references, const FramePyramid& current,
                                      const std::vector<Pose>& T_world_camera_candidates, const ExecutorRef& executor = SerialExecutor{}) {
    prepare();
    return core_.align(references, current, T_world_camera_candidates, executor);
  }

  /// Descends from a pose that is known to be within some pixels of the truth, such as that of a tracker that is not lost. No
  /// other start is tried: several times faster than align() where much moves, but it does not come back from elsewhere.
  [[nodiscard]] AlignmentResult align_near(const std::vector<AlignmentReference>& references, const FramePyramid& current,
                                           const Pose& T_world_camera, const ExecutorRef& executor = SerialExecutor{}) {
    prepare();
    return core_.align_near(references, current, T_world_camera, executor);
  }

  /// Scales and counts of the residuals at a given pose, without optimising: how well the pose explains the frames.
  [[nodiscard]] AlignmentResult evaluate(const std::vector<AlignmentReference>& references, const FramePyramid& current,
                                         const Pose& T_world_camera, const ExecutorRef& executor = SerialExecutor{}) {
    prepare();
    return core_.evaluate(references, current, T_world_camera, executor);
  }

 private:
  static Kernel kernel_of(const AlignmentOptions& options) {
    if constexpr (std::is_same_v<Kernel, RobustKernel>) return options.kernel;
    else return Kernel{};
  }
  static Noise noise_of(const AlignmentOptions& options) {
    if constexpr (std::is_same_v<Noise, NoiseModel>) return NoiseModel(options.noise);
    else return Noise{};
  }
  // At each call, so that an aligner can be copied and moved.
  void prepare() {
    bool adaptive = false;
    if constexpr (std::is_same_v<Kernel, RobustKernel>) adaptive = kernel_.kind == KernelKind::AdaptiveBarron;
    core_.use(KernelRef(kernel_), NoiseRef(noise_), adaptive);
  }

  AlignerCore core_;
  Kernel kernel_;
  Noise noise_;
};

/// The kernel and the noise model of the options.
using DirectAligner = BasicDirectAligner<>;

APSO_NAMESPACE_END
