// A test double of what an integration touches of ORB-SLAM3's Optimizer and its g2o. It optimises nothing: it keeps the edges.
#pragma once

#include <cstddef>
#include <list>
#include <map>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "Frame.h"

namespace g2o {

class SE3Quat {
 public:
  SE3Quat() = default;
  SE3Quat(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation) : R(rotation.toRotationMatrix()), t(translation) {}
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
};

class VertexSE3Expmap {
 public:
  int id = 0;
};

class EdgeSE3 {
 public:
  EIGEN_MAKE_ALIGNED_OPERATOR_NEW
  void setVertex(std::size_t i, VertexSE3Expmap* v) { vertices[i] = v; }
  void setMeasurement(const SE3Quat& m) { measurement = m; }
  void setInformation(const Eigen::Matrix<double, 6, 6>& i) { information = i; }

  VertexSE3Expmap* vertices[2] = {nullptr, nullptr};
  SE3Quat measurement;
  Eigen::Matrix<double, 6, 6> information;
};

class SparseOptimizer {
 public:
  VertexSE3Expmap* vertex(int id) {
    const auto found = vertices.find(id);
    return found == vertices.end() ? nullptr : &found->second;
  }
  bool addEdge(EdgeSE3* e) {  // which it owns from now on
    edges.emplace_back(e);
    return true;
  }

  std::map<int, VertexSE3Expmap> vertices;
  std::vector<std::unique_ptr<EdgeSE3>> edges;
};

}  // namespace g2o

namespace ORB_SLAM3 {

class Optimizer {
 public:
  void static LocalBundleAdjustment(std::list<KeyFrame*> lLocalKeyFrames, std::list<KeyFrame*> lFixedCameras, g2o::SparseOptimizer& optimizer);
};

}  // namespace ORB_SLAM3
