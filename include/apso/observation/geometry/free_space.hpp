/// \file
/// What past views say about a point seen now: a past view saw through the place where the point is (so the point
/// has come since), saw the same surface there, or could not see it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/geometry/low_res_depth.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// One past view at low resolution.
struct DepthReference {
  double time = 0;  ///< [s]
  Pose T_world_camera = identity_pose();
  Image<float> depth;                    ///< [m], 0 invalid
  Image<std::uint8_t> dynamic;           ///< 1 = was dynamic then
  DepthLimits limits;                    ///< of depth
  std::vector<Eigen::Vector3f> normals;  ///< of depth, camera frame; zero = none
};

/// Evidence per low-resolution pixel, summed over past views.
struct FreeSpaceEvidence {
  Image<float> appeared;      ///< views that saw through the point, weighted
  Image<float> same_static;   ///< views that saw a static surface there, weighted
  Image<float> same_dynamic;  ///< views that saw a surface there which was dynamic then, weighted
  void clear(int width, int height) {
    appeared.assign(width, height, 0.0F);
    same_static.assign(width, height, 0.0F);
    same_dynamic.assign(width, height, 0.0F);
  }
};

/// Adds what one past view says about the current depth.
///
/// A wrong pose puts as many points behind static surfaces as in front of them, a moving object does not: it hides
/// what is behind it. So the trust in a view falls with the share of points behind its static surfaces.
/// \param T_world_camera pose of the current view
/// \param votes scratch, resized to the image
inline void compare_with_view(const Image<float>& depth, const Pinhole& camera, const Pose& T_world_camera, double time,
                              const DepthReference& reference, Image<float>& votes, FreeSpaceEvidence& evidence) {
  enum : int { kSameStatic = -1, kSameDynamic = -2 };
  // What separates "the same surface" from "in front of it"; what it does on walking and static sequences is measured with
  // apso_motion (docs/observation.md).
  constexpr float kTolerance = 0.07F;   // smallest depth difference that counts [m]
  constexpr float kSigmas = 3.5F;       // ... in standard deviations of the difference of two depths
  constexpr float kDrift = 0.01F;       // slack for the error between the two poses, per second between the views [m/s]
  constexpr float kDriftLimit = 0.05F;  // largest such slack [m]
  // Age from which a view proves fully that a surface rests [s]; a walking body still overlaps itself in younger views.
  constexpr float kSettle = 0.6F;
  const int w = depth.width();
  const int h = depth.height();
  votes.resize(w, h);
  const FloatPose T(compose(inverse(reference.T_world_camera), T_world_camera));
  const auto fx = static_cast<float>(camera.fx);
  const auto fy = static_cast<float>(camera.fy);
  const auto cx = static_cast<float>(camera.cx);
  const auto cy = static_cast<float>(camera.cy);
  const float age = static_cast<float>(std::abs(time - reference.time));
  const float slack = std::min(kDriftLimit, kDrift * age);

  int same = 0;    // points that agree with a static surface of the past view
  int behind = 0;  // points behind such a surface
  const float ifx = 1.0F / fx;
  const auto width = static_cast<float>(w);
  const auto height = static_cast<float>(h);
  // Where a run of pixels lies in the past view, without a branch so that it is computed side by side; then what is there.
  constexpr int kRun = 32;
  float pz[kRun];
  int at[kRun];  // pixel of the past view, -1 none
  for (int y = 0; y < h; ++y) {
    const Eigen::Vector3f row = T.rotate(-cx * ifx, (static_cast<float>(y) - cy) / fy, 1.0F);
    for (int start = 0; start < w; start += kRun) {
      const int n = std::min(kRun, w - start);
      const float* z = depth.row(y) + start;
      float* vote = votes.row(y) + start;
      for (int k = 0; k < n; ++k) {
        const float along = static_cast<float>(start + k) * ifx;
        const float px = z[k] * (along * T.R[0][0] + row.x()) + T.t[0];
        const float py = z[k] * (along * T.R[1][0] + row.y()) + T.t[1];
        pz[k] = z[k] * (along * T.R[2][0] + row.z()) + T.t[2];
        const float iz = 1.0F / pz[k];
        const float u = fx * px * iz + cx + 0.5F;
        const float v = fy * py * iz + cy + 0.5F;
        const bool seen = (z[k] > 0) & (pz[k] > 0.05F) & (u >= 0) & (v >= 0) & (u < width) & (v < height);
        const int iu = static_cast<int>(std::min(std::max(0.0F, u), width - 1));  // also of NaN a number
        const int iv = static_cast<int>(std::min(std::max(0.0F, v), height - 1));
        at[k] = seen ? iv * w + iu : -1;
      }
      for (int k = 0; k < n; ++k) {
        vote[k] = 0;
        if (at[k] < 0) continue;
        const auto i = static_cast<std::size_t>(at[k]);
        const float nearest = reference.limits.nearest.data()[i];
        if (!(nearest > 0)) continue;
        // both depths have about this noise where the answer is close
        const float tau = std::max(kTolerance, kSigmas * 1.41421356F * depth_sigma(std::max(pz[k], nearest))) + slack;
        const bool was_dynamic = reference.dynamic.data()[i] != 0;
        if (pz[k] < nearest - tau) {
          vote[k] = 0.5F + 0.5F * std::min(1.0F, (nearest - tau - pz[k]) / tau);
        } else if (pz[k] <= reference.limits.farthest.data()[i] + tau) {
          vote[k] = was_dynamic ? static_cast<float>(kSameDynamic) : static_cast<float>(kSameStatic);
          same += was_dynamic ? 0 : 1;
        } else {
          behind += was_dynamic ? 0 : 1;
        }
      }
    }
  }
  const double judged = same + behind;
  const double wrong = judged > 0 ? behind / judged : 0.0;
  const auto weight = static_cast<float>(std::clamp((0.6 - wrong) / 0.3, 0.0, 1.0));  // the trust in the view
  const float settled = std::clamp(age / kSettle, 0.1F, 1.0F);
  if (weight > 0) {
    for (std::size_t i = 0; i < votes.size(); ++i) {
      const float v = votes.data()[i];
      if (v > 0) {
        evidence.appeared.data()[i] += weight * v;
      } else if (v == static_cast<float>(kSameStatic)) {
        evidence.same_static.data()[i] += weight * settled;
      } else if (v == static_cast<float>(kSameDynamic)) {
        evidence.same_dynamic.data()[i] += weight;
      }
    }
  }
}

APSO_NAMESPACE_END
