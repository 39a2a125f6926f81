// Aligns two views of a textured corner of a room, scores a frame and evaluates a trajectory, and prints every bit of it.
#ifdef SINGLE
#include "apso_single.hpp"
#else
#include <apso/apso.hpp>
#endif

#include <cmath>
#include <cstdio>
#include <vector>

namespace {
struct Views {
  apso::Image<float> intensity, depth;
};

// The plane z = 2 + 0.3 x, seen from `T_world_camera`, with waves painted on it.
Views render(const apso::Pinhole& camera, const apso::Pose& T_world_camera) {
  Views v{apso::Image<float>(camera.width, camera.height), apso::Image<float>(camera.width, camera.height)};
  const Eigen::Vector3d n(-0.3, 0, 1);
  const Eigen::Vector3d origin = T_world_camera.translation();
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = T_world_camera.linear() * camera.unproject(x, y, 1.0);
      const double z = (2.0 - n.dot(origin)) / n.dot(ray);
      const Eigen::Vector3d p = origin + z * ray;
      v.depth(x, y) = static_cast<float>(z);
      v.intensity(x, y) =
          static_cast<float>(0.5 + 0.2 * std::sin(9 * p.x()) * std::cos(7 * p.y()) + 0.2 * std::sin(23 * p.y() + 4 * p.x()));
    }
  }
  return v;
}

void print(const char* name, double value) { std::printf("%-12s %a\n", name, value); }
}  // namespace

int main() {
  apso::Pinhole camera;
  camera.fx = camera.fy = 140;
  camera.cx = 79.5;
  camera.cy = 59.5;
  camera.width = 160;
  camera.height = 120;
  apso::Twist xi;
  xi << 0.02, -0.01, 0.015, 0.004, -0.006, 0.003;
  const apso::Pose truth = apso::se3_exp(xi);
  const Views a = render(camera, apso::Pose::Identity());
  const Views b = render(camera, truth);

  const apso::PairAlignment aligned = apso::align(a.intensity, a.depth, b.intensity, b.depth, camera);
  const apso::Pose error = aligned.T_current_reference * truth;
  print("translation", aligned.T_current_reference.translation().norm());
  print("rotation", apso::rotation_angle(aligned.T_current_reference));
  print("confidence", aligned.confidence);

  apso::Pipeline pipeline(camera);
  std::vector<apso::Keypoint> keypoints;
  for (int i = 0; i < 300; ++i) keypoints.push_back({static_cast<float>(i * 37 % 160), static_cast<float>(i * 53 % 120), 50, 0, 0});
  const std::vector<apso::PointTrack> tracks;
  pipeline.observe({0.0, b.intensity, b.depth}, truth, tracks);
  pipeline.assess(keypoints, tracks, {truth, truth, true});
  const apso::FrameReport& report = pipeline.conclude();
  print("S_total", report.assessment.S_total.value());
  std::printf("%-12s %s\n", "state", apso::to_string(report.state));

  const bool ok = apso::succeeded(aligned.status) && error.translation().norm() < 1e-3;
  std::printf("%-12s %s\n", "aligned", ok ? "yes" : "no");
  return ok ? 0 : 1;
}
