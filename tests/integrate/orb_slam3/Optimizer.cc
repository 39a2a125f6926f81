#include "Optimizer.h"

// [edges_include]
#include "apso_odometry_edges.h"  // +apso
// [/edges_include]

namespace ORB_SLAM3 {

void Optimizer::LocalBundleAdjustment(std::list<KeyFrame*> lLocalKeyFrames, std::list<KeyFrame*> lFixedCameras,
                                      g2o::SparseOptimizer& optimizer) {
  for (const auto* list : {&lLocalKeyFrames, &lFixedCameras}) {
    for (const KeyFrame* pKFi : *list) {
      const int id = static_cast<int>(pKFi->mnId);
      optimizer.vertices[id].id = id;
    }
  }

  // [edges]
  ApsoAddOdometryEdges<g2o::EdgeSE3, g2o::SE3Quat>(optimizer, lLocalKeyFrames, lFixedCameras);  // +apso
  // [/edges]
}

}  // namespace ORB_SLAM3
