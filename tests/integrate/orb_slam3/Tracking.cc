#include "Tracking.h"

#include <cmath>
#include <mutex>

#include <opencv2/imgproc.hpp>

// [include]
#include "apso_hook.h"  // +apso
// [/include]

using std::mutex;
using std::unique_lock;

namespace ORB_SLAM3 {

Tracking::Tracking(const Eigen::Matrix3f& K, int width, int height) : mWidth(width), mHeight(height) {
  mK_ = K;  // the loaders of the real one set it in the body as well
  // [construct]
  mpApso.reset(new ApsoHook(mK_(0, 0), mK_(1, 1), mK_(0, 2), mK_(1, 2)));  // +apso
  // [/construct]
}
Tracking::~Tracking() {}

Sophus::SE3f Tracking::GrabImageRGBD(const cv::Mat& imRGB, const cv::Mat& imD, const double& timestamp, std::string filename) {
  (void)filename;
  cv::cvtColor(imRGB, mImGray, cv::COLOR_RGB2GRAY);
  cv::Mat imDepth = imD;
  if (imDepth.type() != CV_32F) imDepth.convertTo(imDepth, CV_32F, mDepthMapFactor);

  // [begin]
  {                                                                      // +apso
    unique_lock<mutex> lock(mpAtlas->GetCurrentMap()->mMutexMapUpdate);  // +apso
    mpApso->BeginFrame(mImGray, imDepth, timestamp);                     // +apso
  }                                                                      // +apso
  // [/begin]
  BuildFrame(imDepth, timestamp);  // mCurrentFrame = Frame(...)
  // [hide]
  mpApso->HideMoving(mCurrentFrame);                             // +apso
  mpApso->Settle(mLastFrame, mVelocity, &mlRelativeFramePoses);  // +apso
  // [/hide]

  Track();
  return mCurrentFrame.GetPose();
}

void Tracking::Track() {
  unique_lock<mutex> lock(mpAtlas->GetCurrentMap()->mMutexMapUpdate);
  bool bOK = true;
  KeepLast();
  if (mState == NO_IMAGES_YET) mState = NOT_INITIALIZED;
  if (mState == NOT_INITIALIZED) {
    StereoInitialization();
  } else {
    bOK = TrackLocalMap();

    // [after]
    bOK = mpApso->AfterTracking(mCurrentFrame, bOK, mvpLocalMapPoints);                                             // +apso
    if (mpApso->Repaired()) {                                                                                       // +apso
      SearchLocalPoints();                                                                                          // +apso
      mpApso->AfterRetry(mCurrentFrame, ApsoHook::Matches(mCurrentFrame) >= 20 && TrackLocalMap());                 // +apso
    }                                                                                                               // +apso
    // [/after]

    mState = bOK ? OK : (mState == OK ? RECENTLY_LOST : mState);
    mbVelocity = bOK && mLastFrame.isSet() && mCurrentFrame.isSet();
    if (mbVelocity) {
      const Sophus::SE3f LastTwc = mLastFrame.GetPose().inverse();
      mVelocity = mCurrentFrame.GetPose() * LastTwc;
    }
    if (bOK && NeedNewKeyFrame()) CreateNewKeyFrame();
  }
  if (bOK) {
    // [relative]
    Sophus::SE3f Tcr_ = mpApso->FromReference(mCurrentFrame);  // +apso
    // [/relative]
    mlRelativeFramePoses.push_back(Tcr_);
  }
  mLastFrame = mCurrentFrame;
}

// [keyframe]
bool Tracking::NeedNewKeyFrame() {
  if (!mpApso->KeyframeAllowed()) return false;  // +apso
  if (mpApso->KeyframeNeeded()) return true;     // +apso
  // ...
  // [/keyframe]
  return mbPlayedKeyframe;
}

// [reset]
void Tracking::Reset() {
  mpApso->Reset();  // +apso
  // ...
  // [/reset]
  mMap.clear();
  mState = NO_IMAGES_YET;
}
void Tracking::ResetActiveMap() {
  mpApso->Reset();  // +apso
  mMap.clear();
  mState = NO_IMAGES_YET;
}
void Tracking::CreateMapInAtlas() {
  mpApso->Reset();  // +apso
  mMap.clear();
  mState = NO_IMAGES_YET;
}

void Tracking::KeepLast() {
  mPoseLast = mLastFrame.GetPose();
  mVelocityLast = mVelocity;
  if (!mlRelativeFramePoses.empty()) mRelativeLast = mlRelativeFramePoses.back();
  mbRefinedLast = mpApso->Report().refined != 0;
}

KeyFrame* Tracking::KeyFrameOfCurrentFrame() {
  mKeyFrames.emplace_back();
  KeyFrame* pKF = &mKeyFrames.back();
  pKF->mnId = mKeyFrames.size() - 1;
  pKF->mTimeStamp = mCurrentFrame.mTimeStamp;
  pKF->SetPose(mCurrentFrame.GetPose());
  return pKF;
}

void Tracking::StereoInitialization() {
  mCurrentFrame.SetPose(mPlayedPose);
  KeyFrame* pKFini = KeyFrameOfCurrentFrame();
  mpReferenceKF = pKFini;
  mCurrentFrame.mpReferenceKF = pKFini;

  // [initialised]
  mpApso->AfterInitialization(mCurrentFrame, *pKFini, mvpLocalMapPoints);  // +apso
  mState = OK;
  // [/initialised]
}

void Tracking::CreateNewKeyFrame() {
  // [settle]
  mpApso->Settle(mCurrentFrame, mVelocity);  // +apso
  // [/settle]
  KeyFrame* pKF = KeyFrameOfCurrentFrame();  // new KeyFrame(...)
  // [keyframe_made]
  mpApso->Measured(*pKF);  // +apso
  // [/keyframe_made]
  mpReferenceKF = pKF;
  mCurrentFrame.mpReferenceKF = mpReferenceKF;
}

// Played by the test: map points appear where the true pose puts them, and the pose is what the test says was estimated.
bool Tracking::TrackLocalMap() {
  const bool retried = !mbPlayedOK && mCurrentFrame.isSet();
  mCurrentFrame.mpReferenceKF = mpReferenceKF;
  if (mbPlayedOK || (retried && mbPlayedRetry)) mCurrentFrame.SetPose(mPlayedPose);
  for (std::size_t i = 0; i < mCurrentFrame.mvbOutlier.size(); ++i) {
    mCurrentFrame.mvbOutlier[i] = static_cast<int>(i) >= mnPlayedMatches;
  }
  return mbPlayedOK || (retried && mbPlayedRetry);
}

void Tracking::SearchLocalPoints() {
  ++mnRetries;
  const float off = (mCurrentFrame.GetPose() * mPlayedPose.inverse()).translation().norm();
  if (!mbPlayedRetry || off > 0.03F) return;
  for (std::size_t i = 0; i < mCurrentFrame.mvKeysUn.size() && i < mvpLocalMapPoints.size(); ++i) {
    if (mvpLocalMapPoints[i]->mnLastFrameSeen != mCurrentFrame.mnId) mCurrentFrame.mvpMapPoints[i] = mvpLocalMapPoints[i];
  }
}

void Tracking::BuildFrame(const cv::Mat& imDepth, double timestamp) {
  const float fx = mK_(0, 0);
  const float fy = mK_(1, 1);
  const float cx = mK_(0, 2);
  const float cy = mK_(1, 2);
  const Sophus::SE3f Twc = mPlayedPose.inverse();
  if (mMap.empty()) {  // the map of the first frame: a grid of points with depth
    mvpLocalMapPoints.clear();
    for (int y = 4; y < mHeight; y += 8) {
      for (int x = 4; x < mWidth; x += 8) {
        const float z = imDepth.at<float>(y, x);
        if (!(z > 0.3F) || z > 6) continue;
        MapPoint p;
        p.mnId = mMap.size() + 100;
        p.mWorldPos = Twc * Eigen::Vector3f((static_cast<float>(x) - cx) / fx * z, (static_cast<float>(y) - cy) / fy * z, z);
        mMap.push_back(p);
        mvpLocalMapPoints.push_back(&mMap.back());
      }
    }
  }
  Frame F;
  F.mTimeStamp = timestamp;
  F.mnId = mLastFrame.mnId + 1;
  F.mvScaleFactors = {1.0F};
  F.mnMaxX = mWidth;
  F.mnMaxY = mHeight;
  for (MapPoint& p : mMap) {
    if (p.isBad() || static_cast<int>(F.mvKeysUn.size()) >= mnPlayedKeypoints) continue;
    const Eigen::Vector3f X = mPlayedPose * p.mWorldPos;
    const float u = fx * X.x() / X.z() + cx;
    const float v = fy * X.y() / X.z() + cy;
    if (!(X.z() > 0.3F) || u < 1 || v < 1 || u > static_cast<float>(mWidth - 2) || v > static_cast<float>(mHeight - 2)) continue;
    F.mvKeysUn.emplace_back(u, v, 31.0F, 0.0F, mPlayedResponse, 0);
    F.mvDepth.push_back(X.z());
    F.mvuRight.push_back(u - 40 / X.z());
    F.mvpMapPoints.push_back(&p);
    F.mvbOutlier.push_back(false);
    p.mnLastFrameSeen = F.mnId;
  }
  F.mvKeys = F.mvKeysUn;
  F.N = static_cast<int>(F.mvKeys.size());
  F.mDescriptors.create(F.N, 32, CV_8U);
  for (int i = 0; i < F.N; ++i) {  // each says which point it is of
    F.mDescriptors.row(i).setTo(0);
    F.mDescriptors.at<int>(i, 0) = static_cast<int>(F.mvpMapPoints[static_cast<std::size_t>(i)]->mnId);
  }
  F.AssignFeaturesToGrid();
  mnBuilt = F.N;
  mCurrentFrame = F;
}

}  // namespace ORB_SLAM3
