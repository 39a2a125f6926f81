// Holds the keyframes of ORB-SLAM3's local bundle adjustment together by the motion that was measured between them. Included by
// Optimizer.cc; docs/integrate/orb_slam3.md says where it is called and what it is worth. C++11; nothing of apso is included here.
#pragma once

#include <map>

#include <Eigen/Core>
#include <sophus/se3.hpp>

// Direct alignment knows the motion from keyframe to keyframe better than features whose depth is taken for a disparity: without these
// edges the adjustment moves keyframes that were right. There is one for each two keyframes that follow each other among those given and
// that have the same chain of measurements (ApsoHook::Measured()); its variance grows with the number of keyframes between.
// Edge: g2o::EdgeSE3. Measurement: g2o::SE3Quat. The vertex of a keyframe has its mnId, as in LocalBundleAdjustment().
template <class Edge, class Measurement, class Optimizer, class KeyFrames>
void ApsoAddOdometryEdges(Optimizer& optimizer, const KeyFrames& local, const KeyFrames& fixed) {
  constexpr double kSigma = 0.001;  // of each component of the motion to the next keyframe [m, rad]
  typedef typename KeyFrames::value_type KeyFramePointer;
  std::map<unsigned long, KeyFramePointer> in_order;
  for (const KeyFramePointer& k : local) in_order[k->mnId] = k;
  for (const KeyFramePointer& k : fixed) in_order[k->mnId] = k;
  std::map<int, KeyFramePointer> latest;  // of each chain
  for (const auto& entry : in_order) {
    const KeyFramePointer k = entry.second;
    if (k->mnMeasured == 0) continue;
    KeyFramePointer& before = latest[k->mnMeasured];
    if (before) {
      const Sophus::SE3f T_k_before = k->mTcwMeasured * before->mTcwMeasured.inverse();
      const double variance = static_cast<double>(k->mnId - before->mnId) * kSigma * kSigma;
      Edge* edge = new Edge;
      edge->setVertex(0, optimizer.vertex(static_cast<int>(before->mnId)));
      edge->setVertex(1, optimizer.vertex(static_cast<int>(k->mnId)));
      edge->setMeasurement(Measurement(T_k_before.unit_quaternion().template cast<double>(), T_k_before.translation().template cast<double>()));
      edge->setInformation(Eigen::Matrix<double, 6, 6>::Identity() / variance);
      optimizer.addEdge(edge);
    }
    before = k;
  }
}
