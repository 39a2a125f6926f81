// Compiled as C++17 whatever the host is. See apso_bridge.h.
#include "apso_bridge.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <future>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include <apso/observation/point_presence.hpp>
#include <apso/observation/policies/geometric_motion.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/tracker/landmark_tracker_options.hpp>
#include <apso/tracker/solvers/pose_optimisation.hpp>
#include <apso/tracker/track_motion.hpp>
#include <apso/traits/frame.hpp>

namespace {

// Another motion policy goes here (docs/extend/motion_policy.md).
using Motion = apso::GeometricMotion;
using Pipeline = apso::BasicPipeline<apso::Pose, Motion>;

class Stopwatch {
 public:
  [[nodiscard]] double ms() const { return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count(); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

apso::Pose pose(const double* m) {
  apso::Pose T = apso::Pose::Identity();
  for (int i = 0; i < 12; ++i) T.matrix()(i / 4, i % 4) = m[i];
  return apso::is_rigid(T) ? apso::normalized(T) : T;
}
void write(const apso::Pose& T, double* m) {
  for (int i = 0; i < 12; ++i) m[i] = T.matrix()(i / 4, i % 4);
}

}  // namespace

struct ApsoBridge {
  ApsoBridge(const apso::Pinhole& c, const ApsoBridgeOptions& o)
      : own_thread(o.own_thread != 0),
        depth_sigma(o.inverse_depth_sigma > 0 ? o.inverse_depth_sigma : apso::kInverseDepthSigma),
        camera(c),
        pipeline(c, pipeline_options(o)) {}
  ~ApsoBridge() {
    if (pending.valid()) pending.wait();
  }
  static apso::PipelineOptions pipeline_options(const ApsoBridgeOptions& o) {
    apso::expects(o.refine >= APSO_REFINE_NONE && o.refine <= APSO_REFINE_EVERY, "ApsoBridgeOptions: refine is none of APSO_REFINE_*");
    apso::expects(o.inverse_depth_sigma == 0 || (o.inverse_depth_sigma >= 1e-6 && o.inverse_depth_sigma <= 1),
                  "ApsoBridgeOptions: inverse_depth_sigma must be 0 (not known) or in [1e-6, 1] 1/m");
    apso::PipelineOptions options;
    options.refine = o.refine == APSO_REFINE_EVERY ? apso::RefinedFrames::Every
                     : o.refine == APSO_REFINE_BAD ? apso::RefinedFrames::BadOnly
                                                   : apso::RefinedFrames::None;
    // not take_depth_noise(): with one stored reference this hook has not been measured in its host
    options.refiner.follow_features = apso::follow_for_depth(o.inverse_depth_sigma);
    options.assessor.decision.innovation = false;  // the hook holds the host's pose against the corners itself
    return options;
  }
  /// Refines and remembers the frame.
  ApsoBridgeReport conclude(bool tracking_ok) {
    const auto& r = pipeline.conclude();
    const bool moved = r.refined || (tracking_ok && r.source == apso::PoseSource::Filtered);
    ApsoBridgeReport out = {{},
                            r.refined ? r.refinement.c_dir : 0.0,
                            tracking_ok || r.refined ? 1 : 0,
                            moved ? 1 : 0,
                            r.keyframe_allowed ? 1 : 0,
                            0,
                            apso::to_string(r.state)};
    write(r.T_world_camera, out.T_world_camera);
    return out;
  }
  /// What runs beside the host is done, and has not failed.
  void join() {
    if (pending.valid()) pending.get();
  }
  void follow(const double* T_world_camera_previous);
  void list_matches(const ApsoBridgeKeypoint* list, int count);
  void add_bodies();
  [[nodiscard]] apso::Matrix6 information(const ApsoBridgeKeypoint* list, int count, const apso::Pose& T_world_feature);

  bool own_thread;
  double depth_sigma;  // [1/m]
  apso::Pinhole camera;
  Pipeline pipeline;
  std::future<void> pending;
  apso::ImageView<const float> depth;
  apso::Image<unsigned char> mask;
  apso::Pose T_world_predicted = apso::Pose::Identity();
  apso::TrackMotion motion;  // since the frame before, by the tracks
  int followed = 0;          // tracks that agree with T_world_predicted
  std::vector<apso::Keypoint> keypoints;
  std::vector<apso::PointObservation> observations;
  std::vector<apso::PointTrack> tracks;
  std::unordered_map<long long, apso::PointTrack> seen;  // by point_id, of the last frame
  std::unordered_map<long long, apso::PointTrack> now;
  std::int64_t next_track = 0;
  std::uint64_t frames = 0;
  ApsoBridgeReport report{};  // of the last frame; to be read after join()
  ApsoBridgeTimes times{};
  std::string error;
};

// A prior that is off by more than a few centimetres makes walls look as if they moved: the motion of most tracks is a better one.
void ApsoBridge::follow(const double* T_world_camera_previous) {
  const apso::LandmarkTrackerOptions standard;
  motion.begin(tracks, depth, standard.depth, static_cast<float>(depth_sigma));
  motion.weigh(pipeline.observation().mask.probability, standard.dynamic_threshold);  // that of the frame before is close enough
  followed = 0;
  if (T_world_camera_previous == nullptr) return;
  apso::Pose T = T_world_predicted;
  const int n = motion.find_pose(camera, pose(T_world_camera_previous), T_world_predicted, standard.seed + frames++, T);
  if (n < apso::kMinimumTrackInliers) return;
  T_world_predicted = T;
  followed = n;
}

// Bodies that the tracks show to move join the mask: the policy is sure of them some frames later.
void ApsoBridge::add_bodies() {
  if (followed == 0 || !motion.bodies().any()) return;
  constexpr int kBlock = 4;  // [px]
  for (int y = 0; y < mask.height(); y += kBlock) {
    for (int x = 0; x < mask.width(); x += kBlock) {
      const double z = static_cast<double>(depth(x, y));
      if (!(z > 0)) continue;
      if (!motion.bodies().moves(apso::transform(T_world_predicted, camera.unproject(x, y, z)))) continue;
      for (int v = y; v < std::min(y + kBlock, mask.height()); ++v) {
        std::fill_n(mask.row(v) + x, std::min(kBlock, mask.width() - x), static_cast<unsigned char>(255));
      }
    }
  }
}

// How well the pose of the host is known by its matches.
apso::Matrix6 ApsoBridge::information(const ApsoBridgeKeypoint* list, int count, const apso::Pose& T_world_feature) {
  observations.clear();
  for (int i = 0; i < count; ++i) {
    const ApsoBridgeKeypoint& k = list[i];
    if (k.point_id < 0) continue;
    apso::PointObservation o;
    for (int a = 0; a < 3; ++a) o.point(a) = static_cast<double>(k.point[a]);
    o.u = static_cast<double>(k.x);
    o.v = static_cast<double>(k.y);
    o.inverse_depth = k.depth > 0 ? 1 / static_cast<double>(k.depth) : 0.0;
    o.sigma = static_cast<double>(k.sigma);
    o.inverse_depth_sigma = depth_sigma;
    observations.push_back(o);
  }
  return apso::pose_information(camera, observations, T_world_feature);
}

void ApsoBridge::list_matches(const ApsoBridgeKeypoint* list, int count) {
  keypoints.clear();
  tracks.clear();
  now.clear();
  for (int i = 0; i < count; ++i) {
    const ApsoBridgeKeypoint& k = list[i];
    keypoints.push_back({k.x, k.y, k.response, k.angle, k.octave});
    if (k.point_id < 0) continue;
    apso::PointTrack t{next_track, k.x, k.y, k.x, k.y, 0};  // a point seen in consecutive frames is a track
    const auto before = seen.find(k.point_id);
    if (before != seen.end()) {
      t = {before->second.id, k.x, k.y, before->second.x, before->second.y, before->second.age + 1};
    } else {
      ++next_track;
    }
    if (now.emplace(k.point_id, t).second) tracks.push_back(t);
  }
  seen.swap(now);
}

namespace {
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

ApsoBridge* apso_bridge_create(double fx, double fy, double cx, double cy, int width, int height, const ApsoBridgeOptions* options) {
  try {
    const ApsoBridgeOptions standard{APSO_REFINE_EVERY, 1, 0};
    return new ApsoBridge(apso::Pinhole{fx, fy, cx, cy, width, height}, options != nullptr ? *options : standard);
  } catch (const std::exception&) {
    return nullptr;
  }
}
void apso_bridge_destroy(ApsoBridge* b) { delete b; }
void apso_bridge_reset(ApsoBridge* b) {
  guarded(*b, [&] { b->join(); });
  b->pipeline.reset();
  b->seen.clear();
}
const char* apso_bridge_error(const ApsoBridge* b) { return b->error.c_str(); }

int apso_bridge_observe(ApsoBridge* b, double timestamp, const unsigned char* grey, int grey_step, const float* depth_metres,
                        int depth_step, const double* T_world_camera_prior, const double* T_world_camera_previous,
                        const ApsoBridgeTrack* tracks, int count, const unsigned char* mask, int mask_step) {
  return guarded(*b, [&] {
    const int w = b->camera.width;
    const int h = b->camera.height;
    apso::expects(grey && depth_metres && T_world_camera_prior && (tracks || count == 0) && count >= 0,
                  "apso_bridge_observe: a pointer is null");
    apso::expects(grey_step >= w && depth_step >= 4 * w && depth_step % 4 == 0 && (mask == nullptr || mask_step >= w),
                  "apso_bridge_observe: a step does not fit the width");
    const Stopwatch watch;
    b->join();
    b->depth = {depth_metres, w, h, depth_step / 4};
    b->T_world_predicted = pose(T_world_camera_prior);
    b->tracks.clear();
    for (int i = 0; i < count; ++i) {
      const ApsoBridgeTrack& t = tracks[i];
      b->tracks.push_back({t.id, t.x, t.y, t.previous_x, t.previous_y, t.age});
    }
    b->follow(T_world_camera_previous);
    const auto frame = apso::frame(timestamp, apso::ImageView<const unsigned char>(grey, w, h, grey_step), b->depth, b->camera);
    const apso::ImageView<const unsigned char> given(mask, w, h, mask_step);
    const apso::Observation& seen =
        b->pipeline.observe(frame, b->T_world_predicted, b->tracks, apso::none, mask != nullptr ? &given : nullptr);
    b->mask.resize(w, h);
    for (std::size_t i = 0; i < b->mask.size(); ++i) b->mask.data()[i] = seen.mask.probability.data()[i] > 0.5F ? 255 : 0;
    b->add_bodies();
    b->times.observed = watch.ms();
  });
}

int apso_bridge_expected(const ApsoBridge* b, double* T_world_camera) {
  write(b->T_world_predicted, T_world_camera);
  return b->followed;
}
const unsigned char* apso_bridge_mask(const ApsoBridge* b) { return b->mask.empty() ? nullptr : b->mask.data(); }

int apso_bridge_conclude(ApsoBridge* b, const ApsoBridgeKeypoint* keypoints, int count, const double* T_world_camera_tracked, int found_by,
                         ApsoBridgeReport* report) {
  return guarded(*b, [&] {
    apso::expects(report && (keypoints || count == 0) && count >= 0, "apso_bridge_conclude: a pointer is null");
    apso::expects(found_by == APSO_BY_NOTHING || found_by == APSO_BY_MAP || found_by == APSO_BY_TRACKS,
                  "apso_bridge_conclude: found_by is none of APSO_BY_*");
    const Stopwatch watch;
    b->join();
    b->times.settled = 0;
    b->list_matches(keypoints, count);
    const bool tracking_ok = found_by == APSO_BY_MAP;
    const apso::Pose T_world_feature = tracking_ok ? pose(T_world_camera_tracked) : b->T_world_predicted;
    const bool tracks_ok = found_by == APSO_BY_TRACKS && b->followed > 0;
    apso::FeaturePose<> feature{T_world_feature, b->T_world_predicted, tracking_ok || tracks_ok};
    if (tracking_ok) {
      feature.information = b->information(keypoints, count, T_world_feature);
    } else {
      feature.matches = 0;  // of the map
    }
    const apso::Assessment& a = b->pipeline.assess(b->keypoints, b->tracks, feature);
    const bool later = b->own_thread && tracking_ok && a.state != apso::SceneState::Bad && apso::is_rigid(T_world_feature);
    if (later) {  // the host goes on with the pose of its features, which is right
      const bool refines = b->pipeline.options().refine == apso::RefinedFrames::Every;
      b->report = {{}, 0, 1, 0, 1, refines ? 1 : 0, apso::to_string(a.state)};
      write(T_world_feature, b->report.T_world_camera);
      *report = b->report;
      b->pending = std::async(std::launch::async, [b] {
        const Stopwatch beside;
        b->report = b->conclude(true);
        b->times.settled = beside.ms();
      });
    } else {
      *report = b->report = b->conclude(tracking_ok);
    }
    b->times.concluded = watch.ms();
  });
}

int apso_bridge_settle(ApsoBridge* b, ApsoBridgeReport* report) {
  return guarded(*b, [&] {
    apso::expects(report != nullptr, "apso_bridge_settle: a pointer is null");
    b->join();
    *report = b->report;
  });
}

int apso_bridge_presence(ApsoBridge* b, const double* T_world_camera, const float* points, int count, unsigned char* presence) {
  return guarded(*b, [&] {
    apso::expects(T_world_camera && (count == 0 || (points && presence)) && count >= 0, "apso_bridge_presence: a pointer is null");
    apso::expects(!b->depth.empty(), "apso_bridge_presence: call apso_bridge_observe() for the frame first");
    const apso::Pose T = pose(T_world_camera);
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d p(points[3 * i], points[3 * i + 1], points[3 * i + 2]);
      presence[i] = static_cast<unsigned char>(apso::point_presence(p, T, b->camera, b->depth, b->mask));
    }
  });
}

int apso_bridge_correct(ApsoBridge* b, ApsoBridgePoseOf pose_of, void* context) {
  return guarded(*b, [&] {
    apso::expects(pose_of != nullptr, "apso_bridge_correct: a pointer is null");
    b->join();
    b->pipeline.correct([&](double timestamp, const apso::Pose& T) -> std::optional<apso::Pose> {
      double m[12];
      write(T, m);
      if (pose_of(context, timestamp, m) == 0) return std::nullopt;
      return pose(m);
    });
  });
}

ApsoBridgeTimes apso_bridge_times(ApsoBridge* b) {
  guarded(*b, [&] { b->join(); });
  return b->times;
}

}  // extern "C"
