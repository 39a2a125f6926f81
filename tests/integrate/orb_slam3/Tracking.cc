#include "Tracking.h"

#include <cmath>

#include <opencv2/imgproc.hpp>

namespace ORB_SLAM3 {

Sophus::SE3f Tracking::GrabImageRGBD(const cv::Mat& imRGB, const cv::Mat& imD, const double& timestamp, std::string filename) {
  (void)filename;
  cv::cvtColor(imRGB, mImGray, cv::COLOR_RGB2GRAY);
  cv::Mat imDepth = imD;
  if (imDepth.type() != CV_32F) imDepth.convertTo(imDepth, CV_32F, mDepthMapFactor);
  BuildFrame(imDepth, timestamp);

  // [before]
  if (mnApsoBigChange != mpAtlas->GetLastBigChangeIdx()) {                                                // +apso
    mnApsoBigChange = mpAtlas->GetLastBigChangeIdx();                                                     // +apso
    mApso.Reset();                                                                                        // +apso
  }                                                                                                       // +apso
  const Sophus::SE3f TcwGuess = mbVelocity ? mVelocity * mLastFrame.GetPose() : mLastFrame.GetPose();     // +apso
  mApso.BeforeTracking(mImGray, imDepth, TcwGuess, mCurrentFrame);                                        // +apso
  // [/before]

  Track();
  return mCurrentFrame.GetPose();
}

void Tracking::Track() {
  bool bOK = true;
  if (mState == NO_IMAGES_YET) mState = NOT_INITIALIZED;
  bOK = TrackLocalMap();

  // [after]
  bOK = mApso.AfterTracking(mCurrentFrame, bOK);  // +apso
  // [/after]

  mState = bOK ? OK : (mState == OK ? RECENTLY_LOST : mState);
  if (bOK) {
    if (mLastFrame.isSet() && mCurrentFrame.isSet()) {
      const Sophus::SE3f LastTwc = mLastFrame.GetPose().inverse();
      mVelocity = mCurrentFrame.GetPose() * LastTwc;
      mbVelocity = true;
    } else {
      mbVelocity = false;
    }
    if (NeedNewKeyFrame()) CreateNewKeyFrame();
  }
  mLastFrame = mCurrentFrame;
}

// [keyframe]
bool Tracking::NeedNewKeyFrame() {
  if (!mApso.KeyframeAllowed()) return false;  // +apso
  // ...
  // [/keyframe]
  return true;  // the double would take every frame
}

// Played by the test: map points appear where the true pose puts them, and the pose is what the test says was estimated.
bool Tracking::TrackLocalMap() {
  if (mbPlayedOK) mCurrentFrame.SetPose(mPlayedPose);
  for (std::size_t i = 0; i < mCurrentFrame.mvKeysUn.size(); ++i) {
    bool found = false;  // matching looks into the grid, so hidden keypoints are not matched
    for (const auto& column : mCurrentFrame.mGrid) {
      for (const auto& cell : column) {
        for (const std::size_t j : cell) found = found || j == i;
      }
    }
    if (!found) {
      mCurrentFrame.mvpMapPoints[i] = nullptr;
      ++mnHidden;
    }
  }
  return mbPlayedOK;
}

void Tracking::BuildFrame(const cv::Mat& imDepth, double timestamp) {
  const Sophus::SE3f Twc = mPlayedPose.inverse();
  if (mMap.empty()) {  // the map of the first frame: a grid of points with depth
    for (int y = 4; y < mHeight; y += 8) {
      for (int x = 4; x < mWidth; x += 8) {
        const float z = imDepth.at<float>(y, x);
        if (!(z > 0.3F) || z > 6) continue;
        MapPoint p;
        p.mnId = mMap.size() + 100;
        p.mWorldPos = Twc * Eigen::Vector3f((static_cast<float>(x) - mCx) / mFx * z, (static_cast<float>(y) - mCy) / mFy * z, z);
        mMap.push_back(p);
      }
    }
  }
  Frame F;
  F.mTimeStamp = timestamp;
  F.mnId = mLastFrame.mnId + 1;
  for (MapPoint& p : mMap) {
    const Eigen::Vector3f X = mPlayedPose * p.mWorldPos;
    const float u = mFx * X.x() / X.z() + mCx;
    const float v = mFy * X.y() / X.z() + mCy;
    if (!(X.z() > 0.3F) || u < 1 || v < 1 || u > static_cast<float>(mWidth - 2) || v > static_cast<float>(mHeight - 2)) continue;
    F.mvKeysUn.emplace_back(u, v, 31.0F, 0.0F, mPlayedResponse, 0);
    F.mvDepth.push_back(X.z());
    F.mvuRight.push_back(u - 40 / X.z());
    F.mvpMapPoints.push_back(&p);
    F.mvbOutlier.push_back(false);
  }
  F.mvKeys = F.mvKeysUn;
  F.N = static_cast<int>(F.mvKeys.size());
  F.AssignFeaturesToGrid(mWidth, mHeight);
  mCurrentFrame = F;
}

}  // namespace ORB_SLAM3
