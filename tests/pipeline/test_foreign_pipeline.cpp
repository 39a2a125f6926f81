// The pipeline on types that no code of apso has seen: the same result as on native ones, and nothing of theirs kept.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <limits>
#include <list>
#include <vector>

#include <apso/pipeline/pipeline.hpp>
#include <apso/testing/synthetic.hpp>
#include <apso/traits/frame.hpp>

#include "../foreign_types.hpp"
#include "quick_start.hpp"

using namespace apso;

namespace {

constexpr float kUnit = 1 / 5000.0F;  // of 16-bit depth [m]

testing::SyntheticOptions small_world() {
  testing::SyntheticOptions o;
  o.width = 320;
  o.height = 240;
  o.people = 1;
  o.frames = 60;
  return o;
}
// What a host holds of a frame; the native one is what the foreign one says.
struct HeldFrame {
  explicit HeldFrame(int i) : sequence("walking_xyz", small_world()) {
    sequence.render(i, frame);
    for (std::size_t k = 0; k < frame.depth.size(); ++k) {
      float& z = frame.depth.data()[k];
      if (!(z > 0)) z = 0;
    }
    grey = foreign::at_only(frame.intensity);
    raw = foreign::padded_u16(frame.depth, kUnit);
    frame.intensity = foreign::native(grey);
    frame.depth = foreign::native(raw, kUnit);
    for (int y = 5; y < 240; y += 10) {
      for (int x = 5; x < 320; x += 10) keypoints.push_back({static_cast<float>(x), static_cast<float>(y), i == 12 ? 0.0F : 30.0F, 0, 0});
    }
    for (int k = 0; k < 40; ++k) {
      const auto x = static_cast<float>(7 * k + 3);
      tracks.push_back({k, x, 120, x - 1, 119.5F, i});
    }
    Detection d;
    d.box = {100, 60, 50, 120};
    d.score = 0.75F;
    silhouette.assign(320, 240, 0);
    for (int y = 60; y < 180; ++y) {
      for (int x = 100; x < 150; ++x) silhouette(x, y) = 1;
    }
    d.mask = silhouette.view();
    detections.push_back(d);
    boxes = foreign::boxes(detections);
    pose = sequence.T_world_camera(i);
    if (i == 12) pose.translation().x() += 0.02;
  }
  testing::SyntheticSequence sequence;
  testing::SyntheticFrame frame;
  foreign::AtOnly grey{0, 0};
  foreign::PaddedU16 raw;
  std::vector<Keypoint> keypoints;
  std::vector<PointTrack> tracks;
  Image<std::uint8_t> silhouette;
  std::vector<Detection> detections;
  std::vector<foreign::Box2d> boxes;
  Pose pose = Pose::Identity();
};

void check_equal(const FrameReport& a, const BasicFrameReport<foreign::DualQuaternionPose>& b) {
  CHECK(a.state == b.state);
  CHECK(a.refined == b.refined);
  CHECK(a.keyframe_allowed == b.keyframe_allowed);
  CHECK(a.assessment.S_total.value() == b.assessment.S_total.value());
  CHECK(a.assessment.good_scene == b.assessment.good_scene);
  CHECK(std::isnan(a.assessment.innovation) == std::isnan(b.assessment.innovation));
  if (!std::isnan(a.assessment.innovation))
    CHECK(a.assessment.innovation == doctest::Approx(b.assessment.innovation).epsilon(1e-9).scale(1));
  CHECK(a.assessment.dynamic_ratio == doctest::Approx(b.assessment.dynamic_ratio).epsilon(1e-9));
  CHECK((a.T_world_camera.matrix() - to_pose(b.T_world_camera).matrix()).cwiseAbs().maxCoeff() < 1e-9);
  CHECK((a.T_world_feature.matrix() - to_pose(b.T_world_feature).matrix()).cwiseAbs().maxCoeff() < 1e-12);
}

}  // namespace

TEST_CASE("foreign images, poses, keypoints, tracks and detections give what native ones give") {
  const Pinhole camera = testing::SyntheticSequence("walking_xyz", small_world()).camera();
  Pipeline native(camera, quick_start());
  BasicPipeline<foreign::DualQuaternionPose> pipeline(camera, quick_start());
  bool refined = false;
  for (int i = 0; i < 14; ++i) {
    const HeldFrame host(i);
    const auto T = from_pose<foreign::DualQuaternionPose>(host.pose);
    const Observation& a = native.observe(host.frame.rgbd(), host.pose, host.tracks, host.detections);
    const Observation& b = pipeline.observe(frame(host.frame.timestamp, host.grey, scaled(host.raw, kUnit), camera), T,
                                            foreign::features(host.tracks), host.boxes);
    CHECK(a.dynamic_ratio == doctest::Approx(b.dynamic_ratio).epsilon(1e-9));
    CHECK(a.objects.size() == b.objects.size());
    Pose T_predicted = host.pose;
    T_predicted.translation().y() += i == 13 ? 0.05 : 0.001;
    native.assess(host.keypoints, host.tracks, {host.pose, T_predicted, true});
    pipeline.assess(foreign::corners(host.keypoints), foreign::features(host.tracks),
                    {T, from_pose<foreign::DualQuaternionPose>(T_predicted), true});
    check_equal(native.conclude(), pipeline.conclude());
    CHECK((pipeline.report().assessment.S_inn.value() < 1) == (i == 13));
    refined = refined || native.report().refined;
  }
  CHECK(refined);  // the third module had its part
}

TEST_CASE("float millimetres and a point cloud are depth, rows of twelve floats are a pose") {
  const HeldFrame host(3);
  const Pinhole camera = host.sequence.camera();
  const auto mm = foreign::float_millimetres(host.frame.depth);
  const auto cloud = foreign::xyz_cloud(host.frame.depth, 300, 160, 120);
  const auto T = from_pose<foreign::RowMajor3x4Pose>(host.pose);
  BasicPipeline<foreign::RowMajor3x4Pose> a(camera);
  BasicPipeline<foreign::RowMajor3x4Pose> b(camera);
  Pipeline c(camera);
  a.observe(frame(0, host.grey, scaled(mm, 0.001F), camera), T);
  b.observe(frame(0, host.grey, cloud, camera), T);
  const Image<float> metres = foreign::native(mm);
  c.observe({0, host.frame.intensity, metres}, host.pose);
  const double S = c.assess(host.keypoints, none, {host.pose, host.pose, true}).S_total.value();
  CHECK(a.assess(host.keypoints, none, {T, T, true}).S_total.value() == S);
  CHECK(b.assess(host.keypoints, none, {T, T, true}).S_total.value() == doctest::Approx(S).epsilon(1e-4));  // mm are rounded
  const Pose T_out = to_pose(a.conclude().T_world_camera);
  CHECK((T_out.matrix() - host.pose.matrix()).cwiseAbs().maxCoeff() < 1e-6);
}

TEST_CASE("a pose of the host's that is no pose makes the frame BAD, whatever its type") {
  const Pinhole camera = testing::SyntheticSequence("walking_xyz", small_world()).camera();
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 0.0F}) {
    BasicPipeline<foreign::RowMajor3x4Pose> pipeline(camera, quick_start());
    for (int i = 0; i < 9; ++i) {
      const HeldFrame host(i);
      auto T = from_pose<foreign::RowMajor3x4Pose>(host.pose);
      const auto prior = T;
      const bool broken = i == 8;
      if (broken) T.m[5] = bad;  // in the rotation: 0 leaves a matrix that is no rotation
      pipeline.observe(frame(host.frame.timestamp, host.grey, scaled(host.raw, kUnit), camera), prior, foreign::features(host.tracks));
      pipeline.assess(foreign::corners(host.keypoints), foreign::features(host.tracks), {T, prior, true});
      const auto& report = pipeline.conclude();
      CHECK((report.assessment.state == SceneState::Bad) == broken);
      if (broken) CHECK(report.state != SceneState::Good);
      CHECK(is_rigid(to_pose(report.T_world_camera)));
    }
  }
}

TEST_CASE("nothing of the host's is read after a call has returned") {
  const Pinhole camera = testing::SyntheticSequence("walking_xyz", small_world()).camera();
  PipelineOptions options = quick_start();
  options.motion = false;  // so that the detections and their masks make the mask
  Pipeline a(camera, options);
  Pipeline b(camera, options);
  for (int i = 0; i < 14; ++i) {
    const HeldFrame kept(i);
    a.observe(kept.frame.rgbd(), kept.pose, kept.tracks, kept.detections);
    a.assess(kept.keypoints, kept.tracks, {kept.pose, kept.pose, true});
    {
      HeldFrame gone(i);
      b.observe(gone.frame.rgbd(), gone.pose, gone.tracks, gone.detections);
      const float nan = std::numeric_limits<float>::quiet_NaN();
      gone.frame.intensity.assign(320, 240, nan);
      gone.frame.depth.assign(320, 240, nan);
      gone.silhouette.assign(320, 240, 255);
      gone.tracks.assign(gone.tracks.size(), PointTrack{});
    }
    {
      HeldFrame gone(i);
      b.assess(gone.keypoints, gone.tracks, {gone.pose, gone.pose, true});
      gone.keypoints.assign(gone.keypoints.size(), Keypoint{});
    }
    const FrameReport& x = a.conclude();
    const FrameReport& y = b.conclude();
    CHECK(x.state == y.state);
    CHECK(x.assessment.S_total.value() == y.assessment.S_total.value());
    CHECK(x.assessment.dynamic_ratio == y.assessment.dynamic_ratio);
    CHECK(x.T_world_camera.matrix() == y.T_world_camera.matrix());
    CHECK(b.observation().objects.size() == a.observation().objects.size());
    for (std::size_t k = 0; k < b.observation().objects.size(); ++k) {
      const ImageView<const std::uint8_t> mask = b.observation().objects[k].mask;
      if (!mask.empty()) CHECK(mask(0, 0) == 0);
    }
  }
}

TEST_CASE("a mask is an image of labels, of probabilities, or a DynamicMask; a null pointer is none") {
  const HeldFrame host(0);
  const Pinhole camera = host.sequence.camera();
  PipelineOptions options;
  options.motion = false;
  Pipeline pipeline(camera, options);
  const auto ratio = [&](const auto& mask) { return pipeline.observe(host.frame.rgbd(), host.pose, none, none, mask).dynamic_ratio; };
  Image<std::uint16_t> labels(320, 240, 0);
  Image<float> probability(320, 240, 0.0F);
  DynamicMask mask;
  set_unknown(320, 240, mask);
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 160; ++x) {
      labels(x, y) = 7;
      probability(x, y) = 0.5F;
      mask.probability(x, y) = mask.known(x, y) = 1;
    }
    for (int x = 160; x < 200; ++x) probability(x, y) = std::nanf("");
  }
  CHECK(ratio(labels) == doctest::Approx(0.5));
  CHECK(ratio(probability) == doctest::Approx(0.25));
  CHECK(pipeline.observation().mask.known(170, 3) == 0);
  CHECK(pipeline.observation().mask.known(210, 3) == 1);
  CHECK(ratio(mask) == doctest::Approx(0.5));
  CHECK(ratio(&labels) == doctest::Approx(0.5));
  CHECK(pipeline.observation().informative);
  const Image<std::uint16_t>* nothing = nullptr;
  CHECK(ratio(nothing) == 0);
  CHECK_FALSE(pipeline.observation().informative);
}

namespace {
// A host's own policy: the left half moves.
struct LeftHalf {
  std::array<int, 3>* calls;
  void observe(const AnyFrame& frame, const Pose&, const std::vector<PointTrack>&, DynamicMask& out) {
    ++(*calls)[0];
    const int w = frame.depth().width();
    const int h = frame.depth().height();
    out.probability.assign(w, h, 0.0F);
    out.known.assign(w, h, 1);
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w / 2; ++x) out.probability(x, y) = 1;
    }
  }
  void remember(const AnyFrame&, const Pose&, const DynamicMask&) { ++(*calls)[1]; }
  void reset() { ++(*calls)[2]; }
};
}  // namespace

TEST_CASE("a motion policy of the host's takes the place of the default one") {
  const HeldFrame host(0);
  std::array<int, 3> calls{};
  BasicPipeline<Pose, LeftHalf> pipeline(host.sequence.camera(), LeftHalf{&calls});
  CHECK(pipeline.observe(host.frame.rgbd(), host.pose).dynamic_ratio == doctest::Approx(0.5));
  pipeline.assess(host.keypoints, none, {host.pose, host.pose, true});
  pipeline.conclude();
  pipeline.reset();
  CHECK(calls == std::array<int, 3>{1, 1, 1});
}

namespace {
// A score, a kernel and a policy of the host's, together.
struct AlwaysHalf {
  static constexpr const char* name = "S_half";
  static constexpr double default_weight = 1;
  using Value = Quality;
  MaybeQuality operator()(const FrameContext&) const { return Quality(0.5); }
};
struct L2 {
  template <class T>
  T weight(const T&) const {
    return T(1);
  }
  template <class T>
  T rho(const T& s2) const {
    return T(0.5) * s2;
  }
};
using OwnAssessor = BasicAssessor<ScoreList<Feature, AlwaysHalf>, PaperChangeScores>;
using OwnRefiner = BasicRefiner<BasicDirectAligner<L2>>;
}  // namespace

TEST_CASE("scores and a kernel of the host's take part in the pipeline") {
  const Pinhole camera = testing::SyntheticSequence("walking_xyz", small_world()).camera();
  using Own = BasicPipeline<Pose, GeometricMotion, OwnAssessor, OwnRefiner>;
  Own::Options options;
  options.assessor.initialisation.frames = 5;
  Own pipeline(camera, options);
  for (int i = 0; i < 13; ++i) {
    const HeldFrame host(i);
    pipeline.observe(host.frame.rgbd(), host.pose, host.tracks, host.detections);
    const auto& assessment = pipeline.assess(host.keypoints, host.tracks, {host.pose, host.pose, true});
    CHECK(assessment.get<AlwaysHalf>()->value() == 0.5);
    pipeline.conclude();
  }
  CHECK(pipeline.report().state == SceneState::Bad);
  CHECK(succeeded(pipeline.report().refinement.status));
}
