// Compiled as C++17 whatever the host is. See apso_bridge.h.
#include "apso_bridge.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <string>
#include <unordered_map>
#include <vector>

#include <apso/pipeline/pipeline.hpp>
#include <apso/traits/frame.hpp>

struct ApsoBridge {
  explicit ApsoBridge(const apso::Pinhole& c) : camera(c), pipeline(c, options()) {}
  // GOOD frames keep the pose of ORB-SLAM3, whose map and bundle adjustment are its own.
  static apso::PipelineOptions options() {
    apso::PipelineOptions o;
    o.refine = apso::RefinedFrames::BadOnly;
    return o;
  }
  apso::Pinhole camera;
  apso::Pipeline pipeline;
  apso::Pose T_world_predicted = apso::Pose::Identity();
  std::vector<apso::Keypoint> keypoints;
  std::vector<apso::PointTrack> tracks;
  std::unordered_map<long long, apso::PointTrack> seen;  // by point_id, of the last frame
  std::int64_t next_track = 0;
  std::string error;
};

namespace {
apso::Pose pose(const double* m) {
  apso::Pose T = apso::Pose::Identity();
  for (int i = 0; i < 12; ++i) T.matrix()(i / 4, i % 4) = m[i];
  return T;
}
void write(const apso::Pose& T, double* m) {
  for (int i = 0; i < 12; ++i) m[i] = T.matrix()(i / 4, i % 4);
}
// No exception may cross the line.
template <class F>
int guarded(ApsoBridge& b, F&& f) {
  try {
    b.error.clear();
    f();
    return 0;
  } catch (const std::exception& e) {
    b.error = e.what();
    return 1;
  }
}
}  // namespace

extern "C" {

ApsoBridge* apso_bridge_create(double fx, double fy, double cx, double cy, int width, int height) {
  try {
    return new ApsoBridge(apso::Pinhole{fx, fy, cx, cy, width, height});
  } catch (const std::exception&) {
    return nullptr;
  }
}
void apso_bridge_destroy(ApsoBridge* b) { delete b; }
void apso_bridge_reset(ApsoBridge* b) {
  b->pipeline.reset();
  b->seen.clear();
}
const char* apso_bridge_error(const ApsoBridge* b) { return b->error.c_str(); }

int apso_bridge_observe(ApsoBridge* b, double timestamp, const unsigned char* grey, int grey_step, const float* depth_metres,
                        int depth_step, const double* T_world_camera_prior) {
  return guarded(*b, [&] {
    const int w = b->camera.width;
    const int h = b->camera.height;
    apso::expects(grey && depth_metres && T_world_camera_prior, "apso_bridge_observe: a pointer is null");
    apso::expects(grey_step >= w && depth_step >= 4 * w && depth_step % 4 == 0, "apso_bridge_observe: a step does not fit the width");
    b->T_world_predicted = pose(T_world_camera_prior);
    b->pipeline.observe(apso::frame(timestamp, apso::ImageView<const unsigned char>(grey, w, h, grey_step),
                                    apso::ImageView<const float>(depth_metres, w, h, depth_step / 4), b->camera),
                        b->T_world_predicted);
  });
}

int apso_bridge_moves(const ApsoBridge* b, float x, float y) {
  const apso::Image<float>& p = b->pipeline.observation().mask.probability;
  if (p.empty() || !std::isfinite(x) || !std::isfinite(y)) return 0;
  const float column = std::clamp(x, 0.0F, static_cast<float>(p.width() - 1));
  const float line = std::clamp(y, 0.0F, static_cast<float>(p.height() - 1));
  return p(static_cast<int>(std::lround(column)), static_cast<int>(std::lround(line))) > 0.5F ? 1 : 0;
}

int apso_bridge_conclude(ApsoBridge* b, const ApsoBridgeKeypoint* keypoints, int count, const double* T_world_camera_tracked,
                         int tracking_ok, ApsoBridgeReport* report) {
  return guarded(*b, [&] {
    apso::expects(report && (keypoints || count == 0) && count >= 0, "apso_bridge_conclude: a pointer is null");
    b->keypoints.clear();
    b->tracks.clear();
    std::unordered_map<long long, apso::PointTrack> now;
    for (int i = 0; i < count; ++i) {
      const ApsoBridgeKeypoint& k = keypoints[i];
      b->keypoints.push_back({k.x, k.y, k.response, k.angle, k.octave});
      if (k.point_id < 0) continue;
      apso::PointTrack t{b->next_track, k.x, k.y, k.x, k.y, 0};  // a point seen in consecutive frames is a track
      const auto before = b->seen.find(k.point_id);
      if (before != b->seen.end()) {
        t = {before->second.id, k.x, k.y, before->second.x, before->second.y, before->second.age + 1};
      } else {
        ++b->next_track;
      }
      if (now.emplace(k.point_id, t).second) b->tracks.push_back(t);
    }
    b->seen.swap(now);
    const apso::Pose T_world_feature = tracking_ok ? pose(T_world_camera_tracked) : b->T_world_predicted;
    b->pipeline.assess(b->keypoints, b->tracks, {T_world_feature, b->T_world_predicted, tracking_ok != 0});
    const apso::FrameReport& r = b->pipeline.conclude();
    write(r.T_world_camera, report->T_world_camera);
    report->pose_ok = tracking_ok || r.refined ? 1 : 0;
    report->refined = r.refined ? 1 : 0;
    report->keyframe_allowed = r.keyframe_allowed ? 1 : 0;
    report->state = apso::to_string(r.state);
  });
}

}  // extern "C"
