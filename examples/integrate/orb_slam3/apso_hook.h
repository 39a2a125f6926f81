// apso inside the tracking thread of ORB-SLAM3 (RGB-D). docs/integrate/orb_slam3.md says where it is called. C++11; nothing of
// apso is included here, see apso_bridge.h. Included by Tracking.cc alone.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <deque>
#include <future>
#include <limits>
#include <list>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>
#include <sophus/se3.hpp>

#include "apso_bridge.h"

struct ApsoHookOptions {
  int refine = APSO_REFINE_EVERY;  // which frames direct alignment refines: APSO_REFINE_NONE, _BAD or _EVERY
  bool own_thread = true;          // what moves is found beside the extraction of ORB features, and GOOD frames are refined beside what
                                   // the host does until it needs their pose again (Settle())
  int corners = 400;               // so many are followed for that; 0: by depth alone
  bool drop_moved = true;          // map points that lie on something that begins to move are taken out of the map
  double inverse_depth_sigma = 0;  // of a depth, with what its neighbours share [1/m]: 0.012 for a Kinect or an Xtion; 0: not known
};

class ApsoHook {
 public:
  // [px], of the rectified camera
  ApsoHook(double fx, double fy, double cx, double cy, const ApsoHookOptions& options = ApsoHookOptions())
      : fx_(fx), fy_(fy), cx_(cx), cy_(cy), options_(options), bridge_(nullptr), report_(), predicted_(), previous_() {}
  ~ApsoHook() {
    if (observing_.valid()) observing_.wait();
    apso_bridge_destroy(bridge_);
  }
  ApsoHook(const ApsoHook&) = delete;
  ApsoHook& operator=(const ApsoHook&) = delete;

  // Before the Frame is made; what moves is then found while its features are extracted. The map must not change meanwhile
  // (hold mMutexMapUpdate).
  // grey: 8-bit, rectified. depth: float, metres, registered to grey. mask: what the host itself knows to move, 8-bit, or empty.
  void BeginFrame(const cv::Mat& grey, const cv::Mat& depth, double timestamp, const cv::Mat& mask = cv::Mat()) {
    if (grey.type() != CV_8UC1 || depth.type() != CV_32FC1 || depth.size() != grey.size()) {
      throw std::invalid_argument("ApsoHook: expected an 8-bit grey image and a float depth image of its size");
    }
    if (!mask.empty() && (mask.type() != CV_8UC1 || mask.size() != grey.size())) {
      throw std::invalid_argument("ApsoHook: expected an 8-bit mask of the size of the image");
    }
    Create(grey.cols, grey.rows);
    Wait();
    previous_grey_ = grey_;
    grey_ = grey;
    depth_ = depth;
    mask_ = mask;
    timestamp_ = timestamp;
    FollowMap();
    has_previous_ = last_ok_ && !records_.empty();
    has_before_ = moving_on_ && records_.size() > 1;
    bool known = false;
    last_ = records_.empty() ? Sophus::SE3f() : records_.back().pose(records_.back(), &known);
    if (has_before_) before_ = records_[records_.size() - 2].pose(records_[records_.size() - 2], &known);
    if (options_.own_thread) {
      observing_ = std::async(std::launch::async, [this] { Observe(); });
    } else {
      Observe();
    }
  }

  // After the Frame is made: takes the keypoints on what moves out of it, so that no matching and no map point sees them.
  template <class Frame>
  void HideMoving(Frame& frame) {
    const cv::Mat mask = Mask();
    NewCorners(frame.mvKeysUn);
    std::vector<bool> keep(frame.mvKeysUn.size());
    for (std::size_t i = 0; i < keep.size(); ++i) {
      const int x = std::min(std::max(cvRound(frame.mvKeysUn[i].pt.x), 0), mask.cols - 1);
      const int y = std::min(std::max(cvRound(frame.mvKeysUn[i].pt.y), 0), mask.rows - 1);
      keep[i] = mask.at<unsigned char>(y, x) == 0;
    }
    if (std::find(keep.begin(), keep.end(), false) == keep.end()) return;
    Select(keep, frame.mvKeys);
    Select(keep, frame.mvKeysUn);
    Select(keep, frame.mvDepth);
    Select(keep, frame.mvuRight);
    Select(keep, frame.mvpMapPoints);
    Select(keep, frame.mvbOutlier);
    cv::Mat descriptors(static_cast<int>(frame.mvKeysUn.size()), frame.mDescriptors.cols, frame.mDescriptors.type());
    int row = 0;
    for (std::size_t i = 0; i < keep.size(); ++i) {
      if (keep[i]) frame.mDescriptors.row(static_cast<int>(i)).copyTo(descriptors.row(row++));
    }
    frame.mDescriptors = descriptors;
    frame.N = row;
    for (auto& column : frame.mGrid) {
      for (auto& cell : column) cell.clear();
    }
    for (std::size_t i = 0; i < frame.mvKeysUn.size(); ++i) {
      int x;
      int y;
      if (frame.PosInGrid(frame.mvKeysUn[i], x, y)) frame.mGrid[x][y].push_back(i);
    }
  }

  // In Track(), after TrackLocalMap(): judges the frame, repairs its pose if it is BAD, and takes map points that have begun to
  // move out of the map. Returns whether the frame has a pose to go on with; that of a GOOD one is refined until Settle().
  // local: mvpLocalMapPoints
  template <class Frame, class MapPoint>
  bool AfterTracking(Frame& frame, bool ok, const std::vector<MapPoint*>& local) {
    keypoints_.clear();
    int matches = 0;
    for (std::size_t i = 0; i < frame.mvKeysUn.size(); ++i) {
      const cv::KeyPoint& k = frame.mvKeysUn[i];
      const bool matched = ok && frame.mvpMapPoints[i] && !frame.mvbOutlier[i];
      matches += matched ? 1 : 0;
      keypoints_.push_back({k.pt.x, k.pt.y, k.response, k.angle < 0 ? 0.0F : k.angle, k.octave, frame.mvDepth[i],
                            frame.mvScaleFactors[static_cast<std::size_t>(k.octave)], -1, {0, 0, 0}});
      if (!matched) continue;
      const Eigen::Vector3f p = frame.mvpMapPoints[i]->GetWorldPos();
      keypoints_.back().point_id = static_cast<long long>(frame.mvpMapPoints[i]->mnId);
      std::copy(p.data(), p.data() + 3, keypoints_.back().point);
    }
    // A few matches, or fewer than there are corners, that contradict the corners are on something that moves, or wrong.
    const bool outnumbered = followed_count_ > 0 && matches < std::max(int{kFewMatches}, followed_count_);
    if (ok && outnumbered && !Near(frame.GetPose(), ReadInverse(predicted_))) ok = false;
    // A few matches that no corners confirm, after frames whose pose did not come from the map: a place that is found again, or one like
    // it. More come in the next frames if it is the place.
    const bool unconfirmed = ok && !by_map_ && followed_count_ == 0 && matches < kFewMatches && frames_unconfirmed_ < kFramesUnconfirmed;
    frames_unconfirmed_ = unconfirmed ? frames_unconfirmed_ + 1 : 0;
    if (unconfirmed) ok = false;
    by_map_ = ok;
    // Where the map fails, the corners that were followed tell a pose, for a while: errors add up. Alignment is joined with it.
    const bool corners = !ok && followed_count_ > 0 && frames_on_corners_ < kFramesOnCorners;
    double T[12] = {};
    if (ok) {
      given_ = frame.GetPose();
      WriteInverse(given_, T);
    }
    const auto by = ok ? APSO_BY_MAP : corners ? APSO_BY_TRACKS : APSO_BY_NOTHING;
    Check(apso_bridge_conclude(bridge_, keypoints_.data(), static_cast<int>(keypoints_.size()), T, by, &report_));
    if (report_.refined) frame.SetPose(ReadInverse(report_.T_world_camera));
    by_corners_ = corners && !report_.refined;
    repaired_ = !ok && (report_.refined || by_corners_);
    if (by_corners_) {
      std::copy(predicted_, predicted_ + 12, report_.T_world_camera);
      frame.SetPose(ReadInverse(predicted_));
      report_.pose_ok = 1;
    }
    if (!repaired_) alone_ = 0;
    frames_on_corners_ = corners ? frames_on_corners_ + 1 : 0;
    if (!ok && !report_.refined) ++chain_;
    if (repaired_) {  // the matches that failed; the points are searched again
      Forget(frame);
      for (MapPoint* point : local) {
        if (point) point->mnLastFrameSeen = std::numeric_limits<decltype(point->mnLastFrameSeen)>::max();
      }
    }
    if (options_.drop_moved && ok && report_.keyframe_allowed) DropMoved(frame, local);
    // A host that makes no keyframe while its view changes is lost soon: where matches become few, the pose of a BAD frame that
    // the corners confirm is good enough.
    if (ok && !report_.keyframe_allowed && Holds(frame) && matches < kEnoughMatches && followed_count_ > 0 &&
        Near(frame.GetPose(), ReadInverse(predicted_))) {
      report_.keyframe_allowed = 1;
    }
    Record(frame, report_.pose_ok != 0);
    return report_.pose_ok != 0;
  }

  // Gives the frame that was tracked last its refined pose, and waits for that where it has to: before a keyframe is made of it, and
  // before the next one is tracked. What else was computed from its pose follows.
  // velocity: mVelocity. relative: mlRelativeFramePoses, once the frame is in it
  template <class Frame>
  void Settle(Frame& frame, Sophus::SE3f& velocity, std::list<Sophus::SE3f>* relative = nullptr) {
    Wait();
    FinishRefinement();
    if (!step_) return;
    frame.SetPose(refining_ * frame.GetPose());
    velocity = refining_ * velocity;
    if (relative && !relative->empty()) relative->back() = refining_ * relative->back();
    step_ = false;
  }

  // At the end of StereoInitialization(), which makes a map of the frame and its first keyframe: the next frames are aligned to it.
  template <class Frame, class KeyFrame, class MapPoint>
  void AfterInitialization(Frame& frame, KeyFrame& keyframe, const std::vector<MapPoint*>& local) {
    AfterTracking(frame, true, local);
    Measured(keyframe);
  }

  // The features have failed and the direct pose has been set: time to look for the map points again, from there.
  bool Repaired() const { return repaired_; }
  // How many keypoints have a map point.
  template <class Frame>
  static int Matches(const Frame& frame) {
    int n = 0;
    for (const auto* point : frame.mvpMapPoints) n += point ? 1 : 0;
    return n;
  }
  // After that search. ok: TrackLocalMap() has found a pose
  template <class Frame>
  void AfterRetry(Frame& frame, bool ok) {
    const Sophus::SE3f T_direct = ReadInverse(report_.T_world_camera);
    int inliers = 0;
    for (std::size_t i = 0; i < frame.mvpMapPoints.size(); ++i) inliers += frame.mvpMapPoints[i] && !frame.mvbOutlier[i] ? 1 : 0;
    // an alignment, or tracks, and a bundle of points that mean the same place: fewer points will do than alone
    const bool agree = (ok || inliers >= kMatchesThatAgree) && Near(frame.GetPose(), T_direct);
    const bool sure = report_.confidence >= kSureConfidence;
    if (!agree) Forget(frame);
    if (!agree || (sure && inliers < kFewMatches)) frame.SetPose(T_direct);  // the more exact one, where points are few
    alone_ = agree ? 0 : alone_ + 1;
    by_map_ = agree;
    const bool needed = options_.refine == APSO_REFINE_EVERY && alone_ >= kFramesAlone && sure;
    report_.keyframe_allowed = Holds(frame) && (needed || (agree && (sure || by_corners_))) ? 1 : 0;
    if (agree) frames_on_corners_ = 0;
    if (!records_.empty()) records_.pop_back();
    Record(frame, true);
  }

  // First line of NeedNewKeyFrame(): the map must not learn from a BAD frame.
  bool KeyframeAllowed() const { return report_.keyframe_allowed != 0; }
  // The line after it: direct alignment alone has carried some frames, and the map has nothing to be found by where the camera is now.
  bool KeyframeNeeded() const { return KeyframeAllowed() && alone_ >= kFramesAlone; }
  // In CreateNewKeyFrame(): the pose that the frame was given. Between two keyframes of the same chain the motion was measured.
  template <class KeyFrame>
  void Measured(KeyFrame& keyframe) {
    keyframe.mTcwMeasured = keyframe.GetPose();
    keyframe.mnMeasured = chain_;
    if (!KeyframeNeeded() || records_.empty()) return;
    // Shares no map point with another one: in the spanning tree it hangs on the last, and stays there. With two parents it could be its
    // own ancestor, and the global bundle adjustment goes down that tree without end.
    KeyFrame* before = static_cast<KeyFrame*>(records_.back().reference);
    while (before && before->isBad()) before = before->GetParent();
    if (before && before != &keyframe) {
      keyframe.ChangeParent(before);
      keyframe.SetFirstConnection(false);
    }
    alone_ = 0;
  }
  // In Track(), where the way from the reference keyframe to the frame is kept for the trajectory: by what was measured since a
  // recent keyframe was made, and not since the adjustment has moved it.
  template <class Frame>
  Sophus::SE3f FromReference(const Frame& frame) const {
    const auto reference = frame.mpReferenceKF;
    const bool measured = reference->mnMeasured == chain_ && timestamp_ - reference->mTimeStamp < kMeasured;
    return frame.GetPose() * (measured ? reference->mTcwMeasured : reference->GetPose()).inverse();
  }
  // When the map begins anew. Loops, merged maps and bundle adjustment need no call: poses are followed by their keyframes.
  void Reset() {
    Wait();
    if (bridge_) apso_bridge_reset(bridge_);
    records_.clear();
    moved_.clear();
    frames_on_corners_ = 0;
    frames_unconfirmed_ = 0;
    by_map_ = true;
    alone_ = 0;
    ++chain_;
    report_ = ApsoBridgeReport();
    report_.keyframe_allowed = 1;
    step_ = false;
  }

  // 255 where something moves, else 0, of the frame that was begun; valid until the next one, empty before the first. For a dense
  // map, a path planner ...
  cv::Mat Mask() {
    Wait();
    const unsigned char* mask = bridge_ ? apso_bridge_mask(bridge_) : nullptr;
    return mask ? cv::Mat(depth_.rows, depth_.cols, CV_8UC1, const_cast<unsigned char*>(mask)) : cv::Mat();
  }
  // Of the frame that was tracked last; once the next one is begun, or after Settle(), with its refined pose.
  const ApsoBridgeReport& Report() {
    Wait();
    return report_;
  }
  ApsoBridgeTimes Times() { return bridge_ ? apso_bridge_times(bridge_) : ApsoBridgeTimes(); }
  double Waited() const { return waited_; }  // how long the host has waited for the mask of the frame [ms]
  int Dropped() const { return dropped_; }   // map points so far

 private:
  static constexpr double kSureConfidence = 0.75;  // as in apso's pipeline
  static constexpr int kFramesOnCorners = 15;      // in a row, as in apso's tracker
  static constexpr int kFramesUnconfirmed = 5;     // in a row: a map with few points has its way then
  static constexpr int kFramesAlone = 5;           // with a direct pose and no match, in a row, before a keyframe is made of one
  static constexpr int kFewMatches = 100;          // as many close points as ORB-SLAM3 wants to track
  static constexpr int kEnoughMatches = 300;       // with so many the map can do without a keyframe
  static constexpr int kKeyframeKeypoints = 500;   // of a keyframe of a BAD frame, as ORB-SLAM3 asks of the first of a map
  static constexpr int kMatchesThatAgree = 15;     // half of what ORB-SLAM3 asks of points alone
  static constexpr float kRoundTrip = 1;           // largest distance after going there and back [px]
  static constexpr int kGone = 3;                  // frames by which a point must have been seen gone more often than present
  static constexpr double kMeasured = 2;           // how long what was measured since a keyframe is more exact than the map [s]
  static constexpr double kRecorded = 20;          // how long the way back to the keyframe of a pose is kept [s]

  // A pose as ORB-SLAM3 keeps it: relative to a keyframe, which moves with the map.
  struct Recorded {
    double timestamp;
    void* reference;
    Sophus::SE3f (*pose)(const Recorded&, bool*);
    Sophus::SE3f T_camera_reference;
    Sophus::SE3f T_camera_world;  // when it was set
  };

  // A keyframe of few keypoints is moved about by the bundle adjustment.
  template <class Frame>
  static bool Holds(const Frame& frame) {
    return static_cast<int>(frame.mvKeysUn.size()) >= kKeyframeKeypoints;
  }
  static bool Near(const Sophus::SE3f& a, const Sophus::SE3f& b) {
    const Sophus::SE3f apart = a * b.inverse();
    return apart.translation().norm() < 0.05F && Eigen::AngleAxisf(apart.rotationMatrix()).angle() < 0.05F;
  }
  void Observe() {
    FollowCorners();
    if (FinishRefinement()) last_ = refining_ * last_;
    // constant velocity; the last pose that was set where there is none
    WriteInverse(has_before_ ? last_ * before_.inverse() * last_ : last_, predicted_);
    WriteInverse(last_, previous_);
    Check(apso_bridge_observe(bridge_, timestamp_, grey_.data, static_cast<int>(grey_.step), depth_.ptr<float>(),
                              static_cast<int>(depth_.step), predicted_, has_previous_ ? previous_ : nullptr, tracks_.data(),
                              static_cast<int>(tracks_.size()), mask_.data, static_cast<int>(mask_.step)));
    followed_count_ = apso_bridge_expected(bridge_, predicted_);
  }
  void Wait() {
    if (!observing_.valid()) return;
    const auto start = std::chrono::steady_clock::now();
    observing_.get();
    waited_ = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  }
  // Corners from frame to frame, by Lucas and Kanade, there and back: one that has slipped looks like something that moves.
  void FollowCorners() {
    const cv::Size window(15, 15);
    constexpr int kLevels = 3;
    pyramid_.swap(previous_pyramid_);
    cv::buildOpticalFlowPyramid(grey_, pyramid_, window, kLevels);
    std::size_t n = 0;
    if (!corners_.empty() && previous_grey_.size() == grey_.size()) {
      const cv::TermCriteria stop(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 20, 0.03);
      cv::calcOpticalFlowPyrLK(previous_pyramid_, pyramid_, corners_, followed_, found_, error_, window, kLevels, stop);
      back_ = corners_;  // one that has not slipped is there already: no pyramid is needed
      cv::calcOpticalFlowPyrLK(pyramid_, previous_pyramid_, followed_, back_, found_back_, error_, window, 0, stop,
                               cv::OPTFLOW_USE_INITIAL_FLOW);
      for (std::size_t i = 0; i < corners_.size(); ++i) {
        const cv::Point2f& p = followed_[i];
        const cv::Point2f slip = back_[i] - corners_[i];
        if (!found_[i] || !found_back_[i] || !(slip.dot(slip) <= kRoundTrip * kRoundTrip) || !Inside(p)) continue;
        tracks_[n] = {tracks_[i].id, p.x, p.y, corners_[i].x, corners_[i].y, tracks_[i].age + 1};
        corners_[n++] = p;
      }
    }
    tracks_.resize(n);
    corners_.resize(n);
  }
  bool Inside(const cv::Point2f& p) const {
    return p.x >= 1 && p.y >= 1 && p.x < static_cast<float>(grey_.cols - 2) && p.y < static_cast<float>(grey_.rows - 2);
  }
  // Those that were lost are replaced by keypoints of the host where there are none.
  void NewCorners(const std::vector<cv::KeyPoint>& keypoints) {
    const int cell = 16;  // [px]
    cv::Mat taken(grey_.rows / cell + 1, grey_.cols / cell + 1, CV_8U, cv::Scalar(0));
    const auto at = [&](const cv::Point2f& p) -> unsigned char& {
      return taken.at<unsigned char>(static_cast<int>(p.y) / cell, static_cast<int>(p.x) / cell);
    };
    for (const cv::Point2f& p : corners_) at(p) = 1;
    for (const cv::KeyPoint& k : keypoints) {
      if (static_cast<int>(corners_.size()) >= options_.corners) break;
      if (k.octave > 2 || !Inside(k.pt)) continue;
      if (at(k.pt) != 0) continue;
      at(k.pt) = 1;
      corners_.push_back(k.pt);
      tracks_.push_back({next_track_++, k.pt.x, k.pt.y, k.pt.x, k.pt.y, 0});
    }
  }

  template <class KeyFrame>
  static Sophus::SE3f PoseNow(const Recorded& r, bool* known) {
    KeyFrame* reference = static_cast<KeyFrame*>(r.reference);
    Sophus::SE3f T = r.T_camera_reference;
    while (reference && reference->isBad()) {  // culled: on along the spanning tree
      T = T * reference->mTcp;
      reference = reference->GetParent();
    }
    *known = reference != nullptr;
    return reference ? T * reference->GetPose() : T;
  }
  template <class KeyFrame>
  void Keep(KeyFrame* reference, const Sophus::SE3f& Tcw) {
    records_.push_back({timestamp_, reference, &ApsoHook::PoseNow<KeyFrame>, Tcw * reference->GetPose().inverse(), Tcw});
  }
  template <class Frame>
  void Record(const Frame& frame, bool ok) {
    while (!records_.empty() && timestamp_ - records_.front().timestamp > kRecorded) records_.pop_front();
    moving_on_ = ok && !records_.empty() && last_ok_;
    last_ok_ = ok;
    if (ok && frame.mpReferenceKF) Keep(frame.mpReferenceKF, frame.GetPose());
  }
  static int PoseOf(void* self, double timestamp, double* T_world_camera) {
    const std::deque<Recorded>& records = static_cast<ApsoHook*>(self)->records_;
    const auto r = std::lower_bound(records.begin(), records.end(), timestamp, [](const Recorded& a, double t) { return a.timestamp < t; });
    if (r == records.end() || r->timestamp != timestamp) return 0;
    bool known = false;
    const Sophus::SE3f Tcw = r->pose(*r, &known);
    if (known) WriteInverse(Tcw, T_world_camera);
    return known ? 1 : 0;
  }
  // A loop or a merge moves the map, and apso's memory with it. The small steps of a local bundle adjustment do not: they are less
  // exact than the poses that apso remembers, which the features join in every frame.
  void FollowMap() {
    if (records_.empty()) return;
    bool known = false;
    const Sophus::SE3f Tcw = records_.back().pose(records_.back(), &known);
    if (!known || Near(Tcw, records_.back().T_camera_world)) return;
    FinishRefinement();
    Check(apso_bridge_correct(bridge_, &ApsoHook::PoseOf, this));
    records_.back().T_camera_world = records_.back().pose(records_.back(), &known);
    ++chain_;
  }
  // Takes over what the refinement of the last frame, which has gone on beside the host, has found. Whether its pose is another one now.
  bool FinishRefinement() {
    if (!report_.unsettled) return false;
    Check(apso_bridge_settle(bridge_, &report_));
    step_ = report_.refined != 0;
    if (!step_) return false;
    refining_ = ReadInverse(report_.T_world_camera) * given_.inverse();
    if (!records_.empty()) {
      records_.back().T_camera_reference = refining_ * records_.back().T_camera_reference;
      records_.back().T_camera_world = refining_ * records_.back().T_camera_world;
    }
    return true;
  }

  template <class Frame, class MapPoint>
  void DropMoved(Frame& frame, const std::vector<MapPoint*>& local) {
    points_.clear();
    asked_.clear();
    for (std::size_t i = 0; i < local.size(); ++i) {
      if (!local[i] || local[i]->isBad()) continue;
      const Eigen::Vector3f p = local[i]->GetWorldPos();
      points_.insert(points_.end(), p.data(), p.data() + 3);
      asked_.push_back(i);
    }
    presence_.resize(asked_.size());
    double T[12];
    WriteInverse(frame.GetPose(), T);
    Check(apso_bridge_presence(bridge_, T, points_.data(), static_cast<int>(asked_.size()), presence_.data()));
    if (moved_.size() > 100000) moved_.clear();
    for (std::size_t k = 0; k < asked_.size(); ++k) {
      MapPoint* point = local[asked_[k]];
      // Only what was seen on something that moves can have left: an unsure pose makes other points look gone.
      if (presence_[k] == APSO_POINT_MOVING) moved_.emplace(point->mnId, 0);
      const auto moved = moved_.find(point->mnId);
      if (moved == moved_.end()) continue;
      if (presence_[k] == APSO_POINT_PRESENT) {
        if (--moved->second < 0) moved_.erase(moved);
      } else if (presence_[k] == APSO_POINT_GONE && ++moved->second >= kGone) {
        moved_.erase(moved);
        point->SetBadFlag();
        ++dropped_;
      }
    }
    for (auto& point : frame.mvpMapPoints) {
      if (point && point->isBad()) point = nullptr;
    }
  }
  template <class Frame>
  static void Forget(Frame& frame) {
    std::fill(frame.mvpMapPoints.begin(), frame.mvpMapPoints.end(), nullptr);
    std::fill(frame.mvbOutlier.begin(), frame.mvbOutlier.end(), false);
  }
  template <class T>
  static void Select(const std::vector<bool>& keep, std::vector<T>& list) {
    std::size_t n = 0;
    for (std::size_t i = 0; i < keep.size(); ++i) {
      if (keep[i]) list[n++] = list[i];
    }
    list.resize(n);
  }

  static void WriteInverse(const Sophus::SE3f& Tcw, double* T) {
    const Eigen::Matrix3f R = Tcw.rotationMatrix().transpose();
    const Eigen::Vector3f t = -(R * Tcw.translation());
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) T[4 * i + j] = static_cast<double>(R(i, j));
      T[4 * i + 3] = static_cast<double>(t(i));
    }
  }
  static Sophus::SE3f ReadInverse(const double* T) {
    Eigen::Matrix3f R;
    Eigen::Vector3f t;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R(i, j) = static_cast<float>(T[4 * i + j]);
      t(i) = static_cast<float>(T[4 * i + 3]);
    }
    return Sophus::SE3f(Eigen::Quaternionf(R).normalized(), t).inverse();
  }
  void Create(int width, int height) {
    if (bridge_) return;
    const ApsoBridgeOptions options = {options_.refine, options_.own_thread ? 1 : 0, options_.inverse_depth_sigma};
    bridge_ = apso_bridge_create(fx_, fy_, cx_, cy_, width, height, &options);
    if (!bridge_)
      throw std::invalid_argument(
          "ApsoHook: fx and fy must be positive, the image at least 16 x 16, refine one of APSO_REFINE_*, inverse_depth_sigma 0 or in "
          "[1e-6, 1] 1/m");
    report_.keyframe_allowed = 1;
  }
  void Check(int failed) const {
    if (failed != 0) throw std::runtime_error(std::string("ApsoHook: ") + apso_bridge_error(bridge_));
  }

  double fx_, fy_, cx_, cy_;
  ApsoHookOptions options_;
  ApsoBridge* bridge_;
  ApsoBridgeReport report_;
  Sophus::SE3f given_, refining_;  // the pose of the features, and the step from it to the refined one
  bool step_ = false;              // which the host has still to take
  cv::Mat grey_, previous_grey_, depth_, mask_;  // of the frame that was begun, and of the one before
  double predicted_[12], previous_[12];
  Sophus::SE3f last_, before_;  // poses of the last two frames
  bool has_before_ = false;
  bool has_previous_ = false;
  std::future<void> observing_;
  double waited_ = 0;
  std::vector<cv::Mat> pyramid_, previous_pyramid_;
  std::vector<cv::Point2f> corners_, followed_, back_;
  std::vector<ApsoBridgeTrack> tracks_;  // of corners_
  std::vector<unsigned char> found_, found_back_;
  std::vector<float> error_;
  long long next_track_ = 0;
  double timestamp_ = 0;
  bool repaired_ = false;
  bool by_corners_ = false;  // the pose is that of the corners
  int followed_count_ = 0;   // corners that agree with predicted_
  int frames_on_corners_ = 0;
  bool by_map_ = true;  // the pose of the last frame came from the map
  int frames_unconfirmed_ = 0;
  int alone_ = 0;  // frames in a row that the direct pose, or corners, have carried without the map
  int chain_ = 1;  // of measurements; the next begins where there was no pose, and where the map was moved
  bool last_ok_ = false;
  bool moving_on_ = false;
  std::deque<Recorded> records_;  // oldest first
  std::vector<ApsoBridgeKeypoint> keypoints_;
  std::unordered_map<unsigned long, int> moved_;  // by MapPoint::mnId: frames seen gone more often than present, since it moved
  std::vector<float> points_;
  std::vector<std::size_t> asked_;
  std::vector<unsigned char> presence_;
  int dropped_ = 0;
};
