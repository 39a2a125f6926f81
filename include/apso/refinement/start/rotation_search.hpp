/// \file
/// Rotation-only pre-alignment of two small images.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/robust_scale.hpp>
#include <apso/math/sampling.hpp>
#include <apso/math/se3.hpp>
#include <apso/math/symmetric.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>

APSO_NAMESPACE_BEGIN

/// Photometric Gauss-Newton over the rotation alone, on the homography of the plane at infinity u = pi(R ray), so that no
/// depth is needed; Cauchy weights with the MAD scale (idea: ElasticFusion, Whelan et al., IJRR 2016).
class RotationSearch {
 public:
  /// \param reference,current the same level of both frames
  /// \param T_current_reference where to start; its translation is kept
  /// \return the iterate with the smallest residuals
  [[nodiscard]] Pose operator()(const PixelList& reference, const PyramidLevel& current, const Pose& T_current_reference, int iterations) {
    Pose T = T_current_reference;
    Pose best = T;
    double best_cost = std::numeric_limits<double>::infinity();
    for (int it = 0; it <= iterations; ++it) {
      const double cost = residuals(reference, current, T);
      if (cost < best_cost) {
        best_cost = cost;
        best = T;
      } else if (it > 2 && cost > 1.2 * best_cost) {
        break;
      }
      if (rows_.size() < 100 || it == iterations) break;
      const double scale = std::max(1e-3, mad_scale_in_place(samples_)) * 2.3849;
      const auto inv = static_cast<float>(1.0 / scale);
      Eigen::Matrix3d H = zeros<Eigen::Matrix3d>();  // lower triangle
      for (int i = 0; i < 3; ++i) H(i, i) = 1e-9;
      Eigen::Vector3d b(0, 0, 0);
      for (const auto& row : rows_) {
        const float s = row[3] * inv;
        const double w = static_cast<double>(row[4] / (1.0F + s * s));
        for (std::size_t i = 0; i < 3; ++i) {
          const double wj = w * static_cast<double>(row[i]);
          const auto r = static_cast<int>(i);
          for (std::size_t k = 0; k <= i; ++k) H(r, static_cast<int>(k)) += wj * static_cast<double>(row[k]);
          b(r) -= wj * static_cast<double>(row[3]);
        }
      }
      for (int i = 0; i < 3; ++i) H(i, i) *= 1.0 + 1e-4;
      const Eigen::Vector3d step = solve_symmetric(H, b);
      if (!all_finite(step)) break;
      const double length = norm(step);
      const Eigen::Matrix3d turn = rotation(so3_exp((length > 0.2 ? 0.2 / length : 1.0) * step));
      T = normalized(make_pose(turn * rotation(T), translation(T)));
      if (length < 1e-3) break;  // a fiftieth of a pixel of an image 20 wide
    }
    return best;
  }

 private:
  // Fills the rows {J, r, gamma} and returns the mean bounded residual.
  double residuals(const PixelList& list, const PyramidLevel& target, const Pose& T) {
    constexpr float kLostCost = 0.2F;  // cost of a lost pixel, and the largest of any
    const ImageView<const float> image = target.intensity.view();
    const Pinhole& cam = target.camera;
    const auto fx = static_cast<float>(cam.fx);
    const auto fy = static_cast<float>(cam.fy);
    const FloatPose turn(T);
    double total = 0;
    double weight = 0;
    rows_.clear();
    samples_.clear();
    for (int b = 0; b < list.blocks(); ++b) {
      for (int i = 0; i < PixelList::kBlock; ++i) {
        float gamma = list.at(b, PixelList::kGamma, i);
        if (!(gamma > 0)) continue;
        const float iz_reference = 1.0F / list.at(b, PixelList::kZ, i);
        const Eigen::Vector3f y =
            turn.rotate(list.at(b, PixelList::kX, i) * iz_reference, list.at(b, PixelList::kY, i) * iz_reference, 1.0F);
        weight += static_cast<double>(gamma);
        const float iz = 1.0F / std::max(y.z(), 0.1F);
        const double u = static_cast<double>(fx * y.x() * iz) + cam.cx;
        const double v = static_cast<double>(fy * y.y() * iz) + cam.cy;
        if (!(y.z() > 0.1F) || !can_sample(image, u, v)) {
          total += static_cast<double>(kLostCost * gamma);
          continue;
        }
        const Sample s = bilinear(image, u, v);
        if (!target.gamma.empty()) gamma *= target.gamma.row(static_cast<int>(std::lround(v)))[std::lround(u)];
        const float r = s.value - list.at(b, PixelList::kIntensity, i);
        total += static_cast<double>(std::min(std::abs(r), kLostCost) * gamma);
        if (!(gamma > 0)) continue;
        Eigen::Vector3f a(s.dx * fx * iz, s.dy * fy * iz, 0.0F);
        a.z() = -(a.x() * y.x() + a.y() * y.y()) * iz;
        const Eigen::Vector3f j = cross(y, a);
        rows_.push_back({j.x(), j.y(), j.z(), r, gamma});
        samples_.push_back(r);
      }
    }
    return weight > 0 ? total / weight : std::numeric_limits<double>::infinity();
  }

  std::vector<std::array<float, 5>> rows_;
  std::vector<float> samples_;
};

APSO_NAMESPACE_END
