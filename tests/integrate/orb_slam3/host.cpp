// Runs the test double of ORB-SLAM3 with the integration lines in it. Compiled as C++14, as a fork may be.
#include "host.h"

static_assert(__cplusplus < 201703L, "this file has to be compiled as C++14");

#include <cmath>

#include "Optimizer.cc"
#include "Tracking.cc"

namespace {
using ORB_SLAM3::Frame;
using ORB_SLAM3::Tracking;

bool consistent(Frame& f) {
  const std::size_t n = f.mvKeysUn.size();
  if (f.N != static_cast<int>(n) || f.mvKeys.size() != n || f.mvDepth.size() != n || f.mvuRight.size() != n || f.mvpMapPoints.size() != n ||
      f.mvbOutlier.size() != n || f.mDescriptors.rows != f.N) {
    return false;
  }
  std::vector<int> in_grid(n, 0);
  for (int x = 0; x < FRAME_GRID_COLS; ++x) {
    for (int y = 0; y < FRAME_GRID_ROWS; ++y) {
      for (const std::size_t i : f.mGrid[x][y]) {
        int cx = 0;
        int cy = 0;
        if (i >= n || !f.PosInGrid(f.mvKeysUn[i], cx, cy) || cx != x || cy != y) return false;
        ++in_grid[i];
      }
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (in_grid[i] != 1 || f.mvKeys[i].pt != f.mvKeysUn[i].pt) return false;
    const int id = f.mDescriptors.at<int>(static_cast<int>(i), 0);
    if (f.mvpMapPoints[i] && static_cast<int>(f.mvpMapPoints[i]->mnId) != id) return false;
  }
  return true;
}
int on_mask(const Frame& f, const cv::Mat& mask) {
  int n = 0;
  for (const cv::KeyPoint& k : f.mvKeysUn) n += mask.at<unsigned char>(cvRound(k.pt.y), cvRound(k.pt.x)) != 0 ? 1 : 0;
  return n;
}
// What a back end does: the same map, elsewhere.
void move_map(Tracking& t, float shift, Sophus::SE3f& moved) {
  const Sophus::SE3f T(Eigen::Quaternionf::Identity(), Eigen::Vector3f(shift, 0, 0));
  for (ORB_SLAM3::KeyFrame& k : t.mKeyFrames) k.SetPose(k.GetPose() * T.inverse());
  for (ORB_SLAM3::MapPoint& p : t.mMap) p.mWorldPos = T * p.mWorldPos;
  moved = T * moved;
}
void write(const Sophus::SE3f& T, float* rows) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rows[4 * i + j] = T.rotationMatrix()(i, j);
    rows[4 * i + 3] = T.translation()(i);
  }
}
void list_edges(Tracking& t, const std::vector<int>& frame_of, HostMap* map) {
  std::list<ORB_SLAM3::KeyFrame*> local;
  std::list<ORB_SLAM3::KeyFrame*> fixed;
  for (ORB_SLAM3::KeyFrame& k : t.mKeyFrames) {
    if (k.mnId % 5 != 4) (k.mnId % 2 == 0 ? fixed : local).push_front(&k);
  }
  g2o::SparseOptimizer optimizer;
  ORB_SLAM3::Optimizer::LocalBundleAdjustment(local, fixed, optimizer);
  map->edges_count = 0;
  for (const auto& edge : optimizer.edges) {
    if (map->edges_count == map->edges_room) break;
    HostEdge& e = map->edges[map->edges_count++];
    for (int i = 0; i < 2; ++i) {
      e.keyframes[i] = edge->vertices[i]->id;
      e.frames[i] = frame_of[static_cast<std::size_t>(edge->vertices[i]->id)];
    }
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) e.measured[4 * i + j] = static_cast<float>(edge->measurement.R(i, j));
      e.measured[4 * i + 3] = static_cast<float>(edge->measurement.t(i));
    }
    e.sigma = 1 / std::sqrt(edge->information(0, 0));
  }
}
}  // namespace

void run_host(const PlayedFrame* frames, int count, float f, float cx, float cy, int width, int height, HostResult* out, HostMap* map,
              const HostOptions& chosen) {
  Eigen::Matrix3f K = Eigen::Matrix3f::Identity();
  K(0, 0) = K(1, 1) = f;
  K(0, 2) = cx;
  K(1, 2) = cy;
  Tracking tracking(K, width, height);
  ApsoHookOptions options;
  if (chosen.refine != options.refine || chosen.own_thread == 0 || chosen.inverse_depth_sigma > 0) {
    options.refine = chosen.refine;
    options.own_thread = chosen.own_thread != 0;
    options.inverse_depth_sigma = chosen.inverse_depth_sigma;
    tracking.mpApso.reset(new ApsoHook(f, f, cx, cy, options));
  }
  map->silent = tracking.mpApso->Mask().empty() && tracking.mpApso->Times().observed == 0 ? 1 : 0;
  Sophus::SE3f T_map;
  int hidden = 0;
  std::vector<int> frame_of;  // of each keyframe
  const auto keep = [&](const Sophus::SE3f& T_map_then, HostResult& last) {
    write(tracking.mPoseLast * T_map_then, last.pose);
    write(tracking.mVelocityLast, last.velocity);
    write(tracking.mRelativeLast, last.relative);
    last.refined = tracking.mbRefinedLast ? 1 : 0;
  };
  for (int k = 0; k < count; ++k) {
    const PlayedFrame& p = frames[k];
    if (p.new_map) tracking.CreateMapInAtlas();
    const Sophus::SE3f T_map_before = T_map;
    if (p.map_shift != 0) move_map(tracking, p.map_shift, T_map);
    if (p.adjusted != 0) {
      ORB_SLAM3::KeyFrame& newest = tracking.mKeyFrames.back();
      newest.SetPose(newest.GetPose() * Sophus::SE3f(Eigen::Quaternionf::Identity(), Eigen::Vector3f(-p.adjusted, 0, 0)));
    }
    Eigen::Matrix3f R;
    Eigen::Vector3f t;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R(i, j) = p.pose[4 * i + j];
      t(i) = p.pose[4 * i + 3];
    }
    tracking.mPlayedPose = Sophus::SE3f(Eigen::Quaternionf(R).normalized(), t) * T_map.inverse();
    tracking.mPlayedResponse = p.response;
    tracking.mbPlayedOK = p.ok != 0;
    tracking.mbPlayedKeyframe = p.no_keyframe == 0;
    tracking.mbPlayedRetry = p.retry != 0;
    tracking.mnPlayedMatches = p.matches > 0 ? p.matches : 1 << 30;
    tracking.mnPlayedKeypoints = p.keypoints > 0 ? p.keypoints : 1 << 30;
    const cv::Mat rgb(height, width, CV_8UC3, const_cast<unsigned char*>(p.rgb));
    const cv::Mat depth(height, width, CV_32F, const_cast<float*>(p.depth));
    write(tracking.GrabImageRGBD(rgb, depth, p.timestamp, "") * T_map, out[k].returned);
    if (k > 0) keep(T_map_before, out[k - 1]);
    hidden += tracking.mnBuilt - tracking.mCurrentFrame.N;
    frame_of.resize(tracking.mKeyFrames.size(), k);
    out[k].reference = frame_of[static_cast<std::size_t>(tracking.mpReferenceKF->mnId)];
    ORB_SLAM3::KeyFrame* parent = tracking.mKeyFrames.back().GetParent();
    out[k].parent = parent ? frame_of[static_cast<std::size_t>(parent->mnId)] : -1;
    out[k].keyframes = static_cast<int>(tracking.mKeyFrames.size());
    out[k].hidden = hidden;
    out[k].consistent = consistent(tracking.mCurrentFrame) ? 1 : 0;
    out[k].on_mask = on_mask(tracking.mCurrentFrame, tracking.mpApso->Mask());
    out[k].tracking = tracking.mState == Tracking::OK;
    out[k].retries = tracking.mnRetries;
    out[k].dropped = tracking.mpApso->Dropped();
    out[k].observed_ms = k % 8 == 0 ? tracking.mpApso->Times().observed : 0;  // it waits for what goes on beside the host
  }
  tracking.mpApso->Settle(tracking.mLastFrame, tracking.mVelocity, &tracking.mlRelativeFramePoses);
  tracking.KeepLast();
  keep(T_map, out[count - 1]);
  map->points_count = 0;
  for (ORB_SLAM3::MapPoint& p : tracking.mMap) {
    if (map->points_count == map->points_room) break;
    const Eigen::Vector3f x = T_map.inverse() * p.GetWorldPos();
    map->points[map->points_count++] = {{x.x(), x.y(), x.z()}, p.isBad() ? 1 : 0};
  }
  list_edges(tracking, frame_of, map);
  for (std::size_t i = 1; i + 1 < tracking.mKeyFrames.size(); ++i) tracking.mKeyFrames[i].Connect(&tracking.mKeyFrames[i + 1]);
  map->two_parents = 0;
  for (ORB_SLAM3::KeyFrame& child : tracking.mKeyFrames) {
    std::size_t parents = 0;
    for (const ORB_SLAM3::KeyFrame& k : tracking.mKeyFrames) parents += k.mspChildrens.count(&child);
    map->two_parents += parents > 1 ? 1 : 0;
  }
}
