// A test double: names, types and shapes of the members of ORB-SLAM3's Frame and MapPoint that an integration touches. It
// extracts nothing; the test fills it. Written for apso; not a line of it comes from ORB-SLAM3.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <sophus/se3.hpp>

#define FRAME_GRID_ROWS 48
#define FRAME_GRID_COLS 64

namespace ORB_SLAM3 {

class MapPoint {
 public:
  long unsigned int mnId = 0;
  Eigen::Vector3f GetWorldPos() const { return mWorldPos; }
  int Observations() const { return 3; }
  Eigen::Vector3f mWorldPos;
};

class Frame {
 public:
  void SetPose(const Sophus::SE3<float>& Tcw) {
    mTcw = Tcw;
    mbHasPose = true;
  }
  Sophus::SE3<float> GetPose() const { return mTcw; }
  bool isSet() const { return mbHasPose; }
  void AssignFeaturesToGrid(int width, int height) {
    for (std::size_t i = 0; i < mvKeysUn.size(); ++i) {
      const int c = static_cast<int>(mvKeysUn[i].pt.x) * FRAME_GRID_COLS / width;
      const int r = static_cast<int>(mvKeysUn[i].pt.y) * FRAME_GRID_ROWS / height;
      if (c >= 0 && c < FRAME_GRID_COLS && r >= 0 && r < FRAME_GRID_ROWS) mGrid[c][r].push_back(i);
    }
  }

  double mTimeStamp = 0;
  int N = 0;
  std::vector<cv::KeyPoint> mvKeys, mvKeysUn;
  std::vector<float> mvuRight, mvDepth;
  std::vector<MapPoint*> mvpMapPoints;
  std::vector<bool> mvbOutlier;
  std::vector<std::size_t> mGrid[FRAME_GRID_COLS][FRAME_GRID_ROWS];
  long unsigned int mnId = 0;

 private:
  Sophus::SE3<float> mTcw;
  bool mbHasPose = false;
};

}  // namespace ORB_SLAM3
