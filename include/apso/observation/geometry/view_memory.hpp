/// \file
/// The past views a depth image is compared with: spread over the logarithm of their age, dense lately, sparse long ago.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/observation/geometry/free_space.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Keeps past views. Buffers are used again.
class ViewMemory {
 public:
  static constexpr double kInterval = 0.08;  ///< shortest time between two kept views [s]; closer ones show the same

  /// \param views  how many are kept
  /// \param memory age at which a view is dropped [s]
  ViewMemory(int views, double memory) : limit_(static_cast<std::size_t>(views)), memory_(memory) { views_.reserve(limit_ + 1); }

  /// Oldest first.
  [[nodiscard]] const std::vector<DepthReference>& views() const { return views_; }
  /// Whether a view of this time would be kept.
  [[nodiscard]] bool wants(double now) const { return views_.empty() || now - views_.back().time >= kInterval; }
  /// A view to fill, with buffers of one that was dropped.
  [[nodiscard]] DepthReference take() {
    DepthReference r;
    if (!spare_.empty()) {
      r = std::move(spare_.back());
      spare_.pop_back();
    }
    return r;
  }
  /// Keeps a view, the youngest so far.
  void keep(DepthReference view) {
    const double now = view.time;
    views_.push_back(std::move(view));
    if (views_.size() > limit_) drop(least_useful(now));
  }
  /// Drops what is too old at time `now`.
  void forget(double now) {
    while (!views_.empty() && now - views_.front().time > memory_) drop(0);
  }
  void clear() {
    while (!views_.empty()) drop(0);
  }

 private:
  void drop(std::size_t i) {
    spare_.push_back(std::move(views_[i]));
    views_.erase(views_.begin() + static_cast<std::ptrdiff_t>(i));
  }
  [[nodiscard]] std::size_t least_useful(double now) const {
    std::size_t worst = 0;
    double smallest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 1; i + 1 < views_.size(); ++i) {
      const double gap = views_[i + 1].time - views_[i - 1].time;
      const double value = gap / (now - views_[i].time + 1e-3);
      if (value < smallest) {
        smallest = value;
        worst = i;
      }
    }
    return worst;
  }

  std::size_t limit_;
  double memory_;
  std::vector<DepthReference> views_;  // oldest first
  std::vector<DepthReference> spare_;
};

/// Share of a coarse grid of points of a depth image that falls into the view of a reference, [0,1].
[[nodiscard]] inline double view_overlap(const Image<float>& depth, const Pinhole& camera, const Pose& T_world_camera,
                                         const DepthReference& reference) {
  const Pose T = compose(inverse(reference.T_world_camera), T_world_camera);
  int n = 0;
  int inside = 0;
  for (int y = camera.height / 12; y < camera.height; y += std::max(1, camera.height / 6)) {
    for (int x = camera.width / 16; x < camera.width; x += std::max(1, camera.width / 8)) {
      if (!(depth(x, y) > 0)) continue;
      ++n;
      const Eigen::Vector3d p = transform(T, camera.unproject(x, y, static_cast<double>(depth(x, y))));
      if (p.z() > 0.05) {
        const Eigen::Vector2d u = camera.project(p);
        inside += camera.contains(u.x(), u.y()) ? 1 : 0;
      }
    }
  }
  return n > 0 ? static_cast<double>(inside) / n : 0.0;
}

APSO_NAMESPACE_END
