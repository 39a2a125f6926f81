// A test double of ORB-SLAM3's Tracking: the order of its calls and the names of its members, with a tracker that is played
// by the test. The lines that an integration adds end with "// +apso"; docs/integrate/orb_slam3.md quotes them.
#pragma once

#include <deque>
#include <list>
#include <memory>
#include <string>
#include <vector>

#include "Frame.h"
// [forward]
class ApsoHook;  // +apso
// [/forward]

namespace ORB_SLAM3 {

class Tracking {
 public:
  enum eTrackingState { NO_IMAGES_YET = 0, NOT_INITIALIZED = 1, OK = 2, RECENTLY_LOST = 3, LOST = 4 };

  Tracking(const Eigen::Matrix3f& K, int width, int height);
  ~Tracking();

  Sophus::SE3f GrabImageRGBD(const cv::Mat& imRGB, const cv::Mat& imD, const double& timestamp, std::string filename);
  void Track();
  void KeepLast();
  void Reset();
  void ResetActiveMap();
  void CreateMapInAtlas();

  // ORB-SLAM3's names
  eTrackingState mState = NO_IMAGES_YET;
  Frame mCurrentFrame, mLastFrame;
  cv::Mat mImGray;
  Eigen::Matrix3f mK_;
  Sophus::SE3f mVelocity;
  bool mbVelocity = false;
  float mDepthMapFactor = 1.0F / 5000;
  Atlas* mpAtlas = &mAtlas;
  KeyFrame* mpReferenceKF = nullptr;
  std::vector<MapPoint*> mvpLocalMapPoints;
  std::list<Sophus::SE3f> mlRelativeFramePoses;

  // played by the test: what the tracker finds in this frame
  Sophus::SE3f mPlayedPose;
  bool mbPlayedOK = true;
  float mPlayedResponse = 30;
  int mnPlayedMatches = 1 << 30;  // so many inliers at most
  int mnPlayedKeypoints = 1 << 30;
  bool mbPlayedKeyframe = true;   // it wants a keyframe of each frame that may be one
  bool mbPlayedRetry = false;     // the features are found when they are looked for near the true pose
  std::deque<MapPoint> mMap;
  std::deque<KeyFrame> mKeyFrames;
  int mnBuilt = 0;  // keypoints of the frame before any is taken out
  int mnRetries = 0;
  // what had become of the frame before when this one was tracked
  Sophus::SE3f mPoseLast, mVelocityLast, mRelativeLast;
  bool mbRefinedLast = false;

  int mWidth, mHeight;
  // [member]
  std::unique_ptr<ApsoHook> mpApso;  // +apso
                                     // [/member]

 private:
  bool TrackLocalMap();
  void SearchLocalPoints();
  bool NeedNewKeyFrame();
  void StereoInitialization();
  void CreateNewKeyFrame();
  KeyFrame* KeyFrameOfCurrentFrame();
  void BuildFrame(const cv::Mat& imDepth, double timestamp);

  Atlas mAtlas;
};

}  // namespace ORB_SLAM3
