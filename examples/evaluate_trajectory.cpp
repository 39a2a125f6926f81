// Evaluate a trajectory of your own types. Eigen is all this file needs.
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <apso/evaluate.hpp>

int main() {
  // [evaluate]
  std::vector<std::pair<double, Eigen::Isometry3d>> truth;  // seconds, T_world_camera
  std::vector<std::pair<double, Eigen::Isometry3d>> estimate;
  const Eigen::Isometry3d T_other_world = Eigen::Translation3d(5, 0, 1) * Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ());
  for (int i = 0; i < 200; ++i) {
    const double t = 0.1 * i;
    truth.emplace_back(t, Eigen::Translation3d(std::cos(t), std::sin(t), 0.1 * t));
    const Eigen::Translation3d error(0.01 * std::sin(3 * t), 0, 0);  // up to a centimetre
    estimate.emplace_back(t + 0.001, T_other_world * error * truth.back().second);
  }
  const auto ate = apso::ate(truth, estimate);  // aligned: the estimate may have a world frame of its own
  const auto rpe = apso::rpe(truth, estimate);  // over one second
  std::printf("ATE %.4f m over %zu pairs, RPE %.4f m/s\n", ate.statistics.rmse, ate.pairs.size(), rpe.translation.rmse);
  const double turned = Eigen::AngleAxisd(ate.T_groundtruth_estimate.linear()).angle();  // the alignment, as your type
  // [/evaluate]
  return apso::succeeded(ate.status) && ate.statistics.rmse < 0.01 && std::abs(turned - 0.5) < 0.01 ? 0 : 1;
}
