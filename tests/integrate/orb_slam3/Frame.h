// A test double: names, types and shapes of the members of ORB-SLAM3's Frame, KeyFrame, MapPoint and Map that an integration
// touches. It extracts nothing; the test fills it. Written for apso; not a line of it comes from ORB-SLAM3.
#pragma once

#include <cstddef>
#include <mutex>
#include <set>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <sophus/se3.hpp>

#define FRAME_GRID_ROWS 48
#define FRAME_GRID_COLS 64

namespace ORB_SLAM3 {

class KeyFrame {
 public:
  Sophus::SE3f GetPose() { return mTcw; }
  void SetPose(const Sophus::SE3f& Tcw) { mTcw = Tcw; }
  bool isBad() { return mbBad; }
  KeyFrame* GetParent() { return mpParent; }
  void ChangeParent(KeyFrame* pKF) {
    mpParent = pKF;
    pKF->mspChildrens.insert(this);
  }
  void SetFirstConnection(bool bFirst) { mbFirstConnection = bFirst; }
  // What UpdateConnections() does to the spanning tree once the keyframe shares map points with others.
  void Connect(KeyFrame* pKF) {
    if (mbFirstConnection) ChangeParent(pKF);
    mbFirstConnection = false;
  }
  long unsigned int mnId = 0;
  double mTimeStamp = 0;
  Sophus::SE3f mTcp;  // from the parent, once it is bad
  Sophus::SE3f mTcw;
  KeyFrame* mpParent = nullptr;
  std::set<KeyFrame*> mspChildrens;
  bool mbFirstConnection = true;
  bool mbBad = false;
  // [measured]
  Sophus::SE3f mTcwMeasured;  // +apso
  int mnMeasured = 0;         // +apso
  // [/measured]
};

class MapPoint {
 public:
  long unsigned int mnId = 0;
  long unsigned int mnLastFrameSeen = 0;
  Eigen::Vector3f GetWorldPos() { return mWorldPos; }
  bool isBad() { return mbBad; }
  void SetBadFlag() { mbBad = true; }
  Eigen::Vector3f mWorldPos;
  bool mbBad = false;
};

class Map {
 public:
  std::mutex mMutexMapUpdate;
};

class Atlas {
 public:
  Map* GetCurrentMap() { return &mMap; }

 private:
  Map mMap;
};

class Frame {
 public:
  void SetPose(const Sophus::SE3<float>& Tcw) {
    mTcw = Tcw;
    mbHasPose = true;
  }
  Sophus::SE3<float> GetPose() const { return mTcw; }
  bool isSet() const { return mbHasPose; }
  bool PosInGrid(const cv::KeyPoint& kp, int& posX, int& posY) {
    posX = static_cast<int>(kp.pt.x) * FRAME_GRID_COLS / mnMaxX;
    posY = static_cast<int>(kp.pt.y) * FRAME_GRID_ROWS / mnMaxY;
    return posX >= 0 && posX < FRAME_GRID_COLS && posY >= 0 && posY < FRAME_GRID_ROWS;
  }

  double mTimeStamp = 0;
  int N = 0;
  std::vector<cv::KeyPoint> mvKeys, mvKeysUn;
  std::vector<float> mvuRight, mvDepth;
  std::vector<float> mvScaleFactors;
  cv::Mat mDescriptors;
  std::vector<MapPoint*> mvpMapPoints;
  std::vector<bool> mvbOutlier;
  std::vector<std::size_t> mGrid[FRAME_GRID_COLS][FRAME_GRID_ROWS];
  KeyFrame* mpReferenceKF = nullptr;
  long unsigned int mnId = 0;
  int mnMaxX = 0, mnMaxY = 0;

 private:
  void AssignFeaturesToGrid() {
    for (std::size_t i = 0; i < mvKeysUn.size(); ++i) {
      int x = 0, y = 0;
      if (PosInGrid(mvKeysUn[i], x, y)) mGrid[x][y].push_back(i);
    }
  }
  friend class Tracking;  // of the double, which fills the frame

  Sophus::SE3<float> mTcw;
  bool mbHasPose = false;
};

}  // namespace ORB_SLAM3
