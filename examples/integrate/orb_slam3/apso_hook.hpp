// apso inside the tracking thread of ORB-SLAM3 (RGB-D), for a fork that is built as C++17.
// docs/integrate/orb_slam3.md says where it is called; nothing else of the fork changes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include <opencv2/core.hpp>

#include <apso/opencv/adapters.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/sophus/adapters.hpp>
#include <apso/traits/frame.hpp>

class ApsoHook {
 public:
  using Pipeline = apso::BasicPipeline<Sophus::SE3f>;

  ApsoHook(float fx, float fy, float cx, float cy, int width, int height, const apso::PipelineOptions& options = Options())
      : pipeline_(pinhole(fx, fy, cx, cy, width, height), options) {}

  /// GOOD frames keep the pose of ORB-SLAM3, whose map and bundle adjustment are its own.
  static apso::PipelineOptions Options() {
    apso::PipelineOptions options;
    options.refine = apso::RefinedFrames::BadOnly;
    return options;
  }

  /// In GrabImageRGBD, between the construction of mCurrentFrame and Track(): finds what moves and hides the keypoints
  /// there from matching (mGrid) and from the map (mvDepth).
  /// \param grey    8-bit, rectified
  /// \param depth   32-bit float, metres, registered to grey
  /// \param Tcw     best guess of the pose, e.g. mVelocity * mLastFrame.GetPose()
  template <class Frame>
  void BeforeTracking(const cv::Mat& grey, const cv::Mat& depth, const Sophus::SE3f& Tcw, Frame& frame) {
    T_world_predicted_ = Tcw.inverse();
    const auto images = apso::frame(frame.mTimeStamp, apso::opencv::as_image<unsigned char>(grey), apso::opencv::as_image<float>(depth),
                                    pipeline_.camera());
    const apso::Observation& seen = pipeline_.observe(images, T_world_predicted_);
    const apso::Image<float>& p = seen.mask.probability;
    moving_.assign(frame.mvKeysUn.size(), false);
    for (std::size_t i = 0; i < moving_.size(); ++i) {
      const int x = std::clamp(cvRound(frame.mvKeysUn[i].pt.x), 0, p.width() - 1);
      const int y = std::clamp(cvRound(frame.mvKeysUn[i].pt.y), 0, p.height() - 1);
      moving_[i] = p(x, y) > 0.5F;
      if (moving_[i]) frame.mvDepth[i] = frame.mvuRight[i] = -1;
    }
    for (auto& column : frame.mGrid) {
      for (auto& cell : column) {
        cell.erase(std::remove_if(cell.begin(), cell.end(), [this](std::size_t i) { return moving_[i]; }), cell.end());
      }
    }
  }

  /// In Track(), after TrackLocalMap(): judges the frame and repairs its pose if it is BAD.
  /// \return whether the frame has a pose to go on with
  template <class Frame>
  bool AfterTracking(Frame& frame, bool ok) {
    tracks_.clear();
    std::unordered_map<unsigned long, apso::PointTrack> now;
    for (std::size_t i = 0; i < frame.mvKeysUn.size(); ++i) {
      const auto* point = frame.mvpMapPoints[i];
      if (!point || frame.mvbOutlier[i]) continue;
      // A map point seen in consecutive frames is a track.
      apso::PointTrack t{next_track_, frame.mvKeysUn[i].pt.x, frame.mvKeysUn[i].pt.y, frame.mvKeysUn[i].pt.x, frame.mvKeysUn[i].pt.y, 0};
      const auto before = seen_.find(point->mnId);
      if (before != seen_.end()) {
        t.id = before->second.id;
        t.previous_x = before->second.x;
        t.previous_y = before->second.y;
        t.age = before->second.age + 1;
      } else {
        ++next_track_;
      }
      if (now.emplace(point->mnId, t).second) tracks_.push_back(t);
    }
    seen_.swap(now);
    const Sophus::SE3f T_world_feature = ok ? frame.GetPose().inverse() : T_world_predicted_;
    pipeline_.assess(frame.mvKeysUn, tracks_, {T_world_feature, T_world_predicted_, ok});
    const Pipeline::Report& report = pipeline_.conclude();
    if (report.refined) frame.SetPose(report.T_world_camera.inverse());
    return ok || report.refined;
  }

  /// First line of NeedNewKeyFrame(): the map must not learn from a BAD frame.
  bool KeyframeAllowed() const { return pipeline_.report().keyframe_allowed; }
  /// When the map has moved as a whole (loop closed, maps merged) or begins anew.
  void Reset() {
    pipeline_.reset();
    seen_.clear();
  }
  const Pipeline::Report& Report() const { return pipeline_.report(); }

 private:
  static apso::Pinhole pinhole(double fx, double fy, double cx, double cy, int width, int height) {
    return {fx, fy, cx, cy, width, height};
  }

  Pipeline pipeline_;
  Sophus::SE3f T_world_predicted_;
  std::vector<bool> moving_;
  std::vector<apso::PointTrack> tracks_;
  std::unordered_map<unsigned long, apso::PointTrack> seen_;  // by MapPoint::mnId, of the last frame
  std::int64_t next_track_ = 0;
};
