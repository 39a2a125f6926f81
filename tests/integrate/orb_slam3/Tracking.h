// A test double of ORB-SLAM3's Tracking: the order of its calls and the names of its members, with a tracker that is played
// by the test. The lines that an integration adds end with "// +apso"; docs/integrate/orb_slam3.md quotes them.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "Frame.h"
// [include]
#ifdef APSO_HOST_IS_CXX14
#include "apso_hook_14.hpp"  // the fork stays at C++11 or C++14
#else
#include "apso_hook.hpp"  // +apso  the fork is built as C++17
#endif
// [/include]

namespace ORB_SLAM3 {

class Atlas {
 public:
  int GetLastBigChangeIdx() const { return mnBigChangeIdx; }
  int mnBigChangeIdx = 0;
};

class Tracking {
 public:
  enum eTrackingState { NO_IMAGES_YET = 0, NOT_INITIALIZED = 1, OK = 2, RECENTLY_LOST = 3, LOST = 4 };

  Tracking(float fx, float fy, float cx, float cy, int width, int height)
      : mWidth(width),
        mHeight(height),
        mFx(fx),
        mFy(fy),
        mCx(cx),
        mCy(cy),
        // [construct]
        mApso(fx, fy, cx, cy, width, height)  // +apso
                                              // [/construct]
  {}

  Sophus::SE3f GrabImageRGBD(const cv::Mat& imRGB, const cv::Mat& imD, const double& timestamp, std::string filename);
  void Track();

  // ORB-SLAM3's names
  eTrackingState mState = NO_IMAGES_YET;
  Frame mCurrentFrame, mLastFrame;
  cv::Mat mImGray;
  Sophus::SE3f mVelocity;
  bool mbVelocity = false;
  float mDepthMapFactor = 1.0F / 5000;
  Atlas* mpAtlas = &mAtlas;

  // played by the test: what the tracker finds in this frame
  Sophus::SE3f mPlayedPose;
  bool mbPlayedOK = true;
  float mPlayedResponse = 30;
  std::vector<MapPoint> mMap;
  int mnKeyFrames = 0;
  int mnHidden = 0;

  int mWidth, mHeight;
  float mFx, mFy, mCx, mCy;
  // [member]
  ApsoHook mApso;           // +apso
  int mnApsoBigChange = 0;  // +apso
                            // [/member]

 private:
  bool TrackLocalMap();
  bool NeedNewKeyFrame();
  void CreateNewKeyFrame() { ++mnKeyFrames; }
  void BuildFrame(const cv::Mat& imDepth, double timestamp);

  Atlas mAtlas;
};

}  // namespace ORB_SLAM3
