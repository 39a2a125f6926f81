// The three modules in their order, with a feature tracker that is played by the truth.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <apso/pipeline/paper_options.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/quality/explain.hpp>
#include <apso/testing/synthetic.hpp>

#include "quick_start.hpp"

using namespace apso;

namespace {

testing::SyntheticOptions small_world(int people) {
  testing::SyntheticOptions o;
  o.width = 320;
  o.height = 240;
  o.people = people;
  o.frames = 60;
  return o;
}

/// A refiner of one's own: between the features and the prediction.
struct Halfway {
  struct Options {
    template <class Self, class V>
    static void fields(Self&, V&&) {}
  };
  struct Input : RefinementInput<> {};
  struct Result {
    Status status = Status::NotRun;
    Pose T_world_camera = Pose::Identity(), T_world_direct = Pose::Identity();
    bool refined = false;
    double c_dir = 0, w_eff = 1;
  };
  Halfway(const Pinhole&, const Options&) {}
  Result refine(const Input& in, const SerialExecutor& = {}) {
    const Pose T = sclerp(in.T_world_feature, in.T_world_predicted, 0.5);
    return {Status::Converged, T, in.T_world_predicted, true, 1.0, 0.5};
  }
  void remember(const RgbdFrame&, const ImageView<const float>&, const Pose&, const SerialExecutor&, const FlowGrid&) {}
  void reset() {}
  [[nodiscard]] const Options& options() const { return options_; }
  Options options_;
};

/// A host whose keypoints form a grid and whose tracks follow the true motion of the static scene.
class Host {
 public:
  Host(const std::string& name, int people, const PipelineOptions& options = {})
      : sequence_(name, small_world(people)), pipeline_(sequence_.camera(), options) {}

  const FrameReport& step(int i, const Pose& T_error = Pose::Identity(), bool ok = true, float response = 30,
                          const Pose* T_world_feature = nullptr, const Matrix6& information = Matrix6::Zero()) {
    sequence_.render(i, frame_);
    if (blank) {
      frame_.depth = Image<float>(320, 240, 0.F);
      frame_.intensity = Image<float>(320, 240, 0.5F);
    }
    if (bare_wall) {
      frame_.depth = Image<float>(320, 240, 2.F);
      frame_.intensity = Image<float>(320, 240, 0.5F);
      for (int y = 0; y < 240; ++y) {
        for (int x = 0; x < 320; ++x) {
          if (x % 32 < patches && y % 32 < 16) frame_.intensity(x, y) = 0.8F;
        }
      }
    }
    const Pose T_true = truth(i);
    keypoints_.clear();
    for (int y = 5; y < 240; y += 10) {
      for (int x = 5; x < 320; x += 10) keypoints_.push_back({static_cast<float>(x), static_cast<float>(y), response, 0, 0});
    }
    RgbdFrame images = frame_.rgbd();
    images.timestamp += clock;
    pipeline_.observe(images, T_true * T_error);
    const Pose T_feature = T_world_feature != nullptr ? *T_world_feature : T_true * T_error;
    pipeline_.assess(keypoints_, tracks_, {T_feature, T_true * T_error, ok, information});
    return pipeline_.conclude();
  }
  double clock = 0;  // added to the stamps [s]
  int patches = 0;   // width of what is painted on the bare wall [px]
  [[nodiscard]] Pose truth(int i) const { return T_map_ * sequence_.T_world_camera(i); }
  [[nodiscard]] Pose truth_at(double timestamp) const { return truth(static_cast<int>(std::lround((timestamp - clock) * 30))); }
  /// The map of the host is turned and shifted as a whole, as when maps are joined.
  void move_map(const Pose& T) { T_map_ = T * T_map_; }
  Pipeline& pipeline() { return pipeline_; }
  bool blank = false;      ///< the frames show nothing from now on
  bool bare_wall = false;  ///< ... or a wall without any texture, along which the camera may be anywhere

 private:
  testing::SyntheticSequence sequence_;
  testing::SyntheticFrame frame_;
  Pose T_map_ = Pose::Identity();
  Pipeline pipeline_;
  std::vector<Keypoint> keypoints_;
  std::vector<PointTrack> tracks_;
};

}  // namespace

TEST_CASE("a feature pose that is no pose is never GOOD, whatever runs, and nothing of it comes out") {
  const double kNaN = std::numeric_limits<double>::quiet_NaN();
  for (const bool motion : {false, true}) {
    for (const RefinedFrames refine : {RefinedFrames::Every, RefinedFrames::BadOnly, RefinedFrames::None}) {
      PipelineOptions o = quick_start();
      o.motion = motion;
      o.refine = refine;
      Host host("static_xyz", 0, o);
      int i = 0;
      for (; i < 7; ++i) host.step(i);
      REQUIRE(host.pipeline().report().state == SceneState::Good);
      int element = 0;  // (0,0) and (1,1) of the rotation, z of the translation
      for (const double bad : {kNaN, 1e308, std::numeric_limits<double>::infinity(), kNaN}) {
        Pose T_broken = Pose::Identity();
        T_broken(element, element == 2 ? 3 : element) = bad;
        element = (element + 1) % 3;
        CAPTURE(element);
        CAPTURE(bad);
        const FrameReport& r = host.step(i, Pose::Identity(), true, 30, &T_broken);
        CHECK(r.state == (r.refined ? SceneState::Bad : SceneState::Lost));  // without any measurement the pose is a guess
        CHECK(r.assessment.state == SceneState::Bad);
        CHECK(explain(r.assessment).find("not finite or no rigid motion") != std::string::npos);
        CHECK(is_rigid(r.T_world_camera));
        CHECK(is_rigid(r.T_world_feature));
        CHECK(r.keyframe_allowed == (r.refined && refine == RefinedFrames::Every));  // as for any frame without features
        CHECK((inverse(host.truth(i)) * r.T_world_camera).translation().norm() < 0.005);
      }
      ++i;
      CHECK(host.step(i).state == SceneState::Good);
    }
  }
}

TEST_CASE("information of a feature pose that is not finite counts as not told") {
  Host a("static_xyz", 0, quick_start()), b("static_xyz", 0, quick_start());
  Matrix6 nan = Matrix6::Identity();
  nan(3, 1) = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i < 12; ++i) {
    const FrameReport& x = a.step(i);
    const FrameReport& y = b.step(i, Pose::Identity(), true, 30, nullptr, nan);
    CHECK(x.state == y.state);
    CHECK(x.T_world_camera.matrix() == y.T_world_camera.matrix());
  }
}

TEST_CASE("stamps that stand still or jump back cost no frame") {
  Host host("static_xyz", 0, quick_start());
  for (int i = 0; i < 12; ++i) host.step(i);
  const auto fine = [&](int i) {
    CAPTURE(i);
    const FrameReport& r = host.step(i);
    CHECK(r.state == SceneState::Good);
    CHECK((inverse(host.truth(i)) * r.T_world_camera).translation().norm() < 0.005);
  };
  for (const int i : {12, 12, 12, 14, 13, 16, 15, 17}) fine(i);  // doubled, and in another order
  host.clock = -100;
  for (int i = 18; i < 24; ++i) fine(i);
  host.clock = 1e6;
  for (int i = 24; i < 30; ++i) fine(i);
}

TEST_CASE("a frame passes the states in their order") {
  PipelineOptions options = quick_start();
  options.refine = RefinedFrames::BadOnly;
  Host host("static_static", 0, options);
  bool was_initialising = false;
  for (int i = 0; i < 10; ++i) {
    const FrameReport& r = host.step(i);
    was_initialising = was_initialising || r.state == SceneState::Initialising;
    CHECK(is_finite(r.T_world_camera));
    CHECK(r.state != SceneState::Lost);
    if (r.state == SceneState::Initialising) CHECK_FALSE(r.refined);
    // a frame that is not refined keeps the pose of the features
    if (!r.refined) CHECK((r.T_world_camera.matrix() - host.truth(i).matrix()).norm() < 1e-9);
  }
  CHECK(was_initialising);
  CHECK(host.pipeline().report().state != SceneState::Initialising);
}

TEST_CASE("a frame without features is BAD, makes no keyframe, and its wrong pose is repaired from references") {
  Host host("static_xyz", 0, quick_start());
  for (int i = 0; i < 12; ++i) host.step(i);
  Twist off = Twist::Zero();
  off << 0.02, -0.01, 0.01, 0.005, 0.01, -0.005;
  const FrameReport& r = host.step(12, se3_exp(off), true, 0.0F);
  REQUIRE(r.state == SceneState::Bad);
  REQUIRE(r.refined);
  CHECK_FALSE(r.keyframe_allowed);
  const double before = (inverse(host.truth(12)) * r.T_world_feature).translation().norm();
  const double direct = (inverse(host.truth(12)) * r.refinement.T_world_direct).translation().norm();
  const double after = (inverse(host.truth(12)) * r.T_world_camera).translation().norm();
  CHECK(before > 0.02);
  CHECK(direct < 0.25 * before);
  CHECK(after < before);
}

TEST_CASE("a map that is moved takes the memory along") {
  Twist turn, off;
  turn << 0.5, -1, 2, 0.3, -0.7, 0.2;  // as large as a loop that is closed
  off << 0.02, -0.01, 0.01, 0.005, 0.01, -0.005;
  for (const bool all : {true, false}) {  // the host knows all frames, or the latest only
    CAPTURE(all);
    Host still("walking_xyz", 2, quick_start());
    Host moved("walking_xyz", 2, quick_start());
    const auto pose_now = [&](double timestamp, const Pose& T) -> std::optional<Pose> {
      if (!all && timestamp < moved.pipeline().report().timestamp) return std::nullopt;
      return se3_exp(turn) * T;
    };
    for (int i = 0; i < 20; ++i) {
      if (i == 12 || i == 15) {
        moved.move_map(se3_exp(turn));
        moved.pipeline().correct(pose_now);
      }
      const bool bad = i == 14 || i == 18;
      const Pose T_error = bad ? se3_exp(off) : Pose::Identity();
      const FrameReport& a = still.step(i, T_error, true, bad ? 0.0F : 30.0F);
      const FrameReport& b = moved.step(i, T_error, true, bad ? 0.0F : 30.0F);
      CHECK(a.state == b.state);
      CHECK(a.refined == b.refined);
      if (bad) CHECK(b.refined);
      const Pose T_a = inverse(still.truth(i)) * a.T_world_camera;
      const Pose T_b = inverse(moved.truth(i)) * b.T_world_camera;
      CHECK((T_a.matrix() - T_b.matrix()).norm() < 1e-6);
      const Pose D_a = inverse(still.truth(i)) * a.refinement.T_world_direct;
      const Pose D_b = inverse(moved.truth(i)) * b.refinement.T_world_direct;
      if (b.refined) CHECK((D_a.matrix() - D_b.matrix()).norm() < 1e-6);
      const auto share = [](const Host& host) { return const_cast<Host&>(host).pipeline().observation().dynamic_ratio; };
      CHECK(share(still) == doctest::Approx(share(moved)).epsilon(1e-3));
    }
  }
}

TEST_CASE("poses that bundle adjustment has corrected make the direct pose better") {
  PipelineOptions o = quick_start();
  o.refine = RefinedFrames::BadOnly;
  Host plain("static_xyz", 0, o);
  Host corrected("static_xyz", 0, o);
  const auto drift = [](int i) {  // 4 mm per frame, which the back end finds out about afterwards
    Twist d = Twist::Zero();
    d[0] = 0.004 * (i - 12);
    return se3_exp(d);
  };
  for (Host* host : {&plain, &corrected}) {
    for (int i = 0; i < 12; ++i) host->step(i, drift(i));
  }
  corrected.pipeline().correct([&](double timestamp, const Pose&) -> std::optional<Pose> { return corrected.truth_at(timestamp); });
  const auto error = [](Host& host) {
    const FrameReport& r = host.step(12, Pose::Identity(), false, 0.0F);
    REQUIRE(r.refined);
    return (inverse(host.truth(12)) * r.T_world_direct).translation().norm();
  };
  const double without = error(plain);
  const double with = error(corrected);
  CHECK(without > 0.008);
  CHECK(with < 0.004);
}

TEST_CASE("a correction that is no pose is refused, and changes nothing") {
  Host host("static_xyz", 0, quick_start());
  Host untouched("static_xyz", 0, quick_start());
  host.pipeline().correct([](double, const Pose& T) -> std::optional<Pose> { return T; });  // nothing is remembered yet
  for (int i = 0; i < 12; ++i) {
    host.step(i);
    untouched.step(i);
  }
  int asked = 0;
  CHECK_THROWS_AS(host.pipeline().correct([&](double, const Pose& T) -> std::optional<Pose> {
    Pose moved = T;
    moved(0, 3) += 1;
    if (++asked == 3) moved(0, 0) = std::numeric_limits<double>::quiet_NaN();
    return moved;
  }),
                  contract_error);
  CHECK(asked == 3);
  CHECK(host.step(12, Pose::Identity(), true, 0.0F).T_world_camera.matrix() ==
        untouched.step(12, Pose::Identity(), true, 0.0F).T_world_camera.matrix());
}

TEST_CASE("wrong poses before do not make the way back look too fast") {
  Host host("static_xyz", 0, quick_start());
  for (int i = 0; i < 12; ++i) host.step(i);
  Twist off = Twist::Zero();
  off.head<3>() << 0.15, 0, 0;  // 4.5 m/s, from one frame to the next
  for (int i = 12; i < 15; ++i) {
    const FrameReport& r = host.step(i, se3_exp(off), true, 0.0F);
    REQUIRE(r.state == SceneState::Bad);
    CHECK_FALSE(r.refinement.too_fast);
    CHECK((inverse(host.truth(i)) * r.T_world_camera).translation().norm() < 0.1 * off.head<3>().norm());
  }
}

TEST_CASE("a jump that no camera makes is not believed") {
  PipelineOptions o = quick_start();
  o.refiner.velocity_gate = 0.001;
  Host host("static_xyz", 0, o);
  for (int i = 0; i < 12; ++i) host.step(i);
  const FrameReport& r = host.step(12, Pose::Identity(), true, 0.0F);
  REQUIRE(r.state == SceneState::Bad);
  CHECK(r.refinement.too_fast);
  CHECK_FALSE(r.refined);
}

TEST_CASE(
    "a feature pose of a BAD frame that contradicts the prediction, and that nothing confirms, gives way to it; a guess after it is none") {
  Host host("static_xyz", 0, quick_start());
  int i = 0;
  for (; i < 12; ++i) host.step(i);
  host.blank = true;
  Pose T_wrong = host.truth(i);
  T_wrong(0, 3) += 0.2;
  const FrameReport& first = host.step(i, Pose::Identity(), true, 0.0F, &T_wrong);
  REQUIRE_FALSE(first.refined);
  CHECK(first.state == SceneState::Bad);
  CHECK(first.source == PoseSource::Prediction);
  CHECK((inverse(host.truth(i)) * first.T_world_camera).translation().norm() < 1e-9);
  CHECK_FALSE(first.keyframe_allowed);
  // another place, far from both: nothing has been measured for two frames
  ++i;
  T_wrong = host.truth(i);
  T_wrong(1, 3) += 0.4;
  CHECK(host.step(i, Pose::Identity(), true, 0.0F, &T_wrong).state == SceneState::Lost);
  // near the prediction it is believed
  ++i;
  const Pose T_right = host.truth(i);
  const FrameReport& near = host.step(i, Pose::Identity(), true, 0.0F, &T_right);
  CHECK(near.state == SceneState::Bad);
  CHECK(near.source == PoseSource::Features);
}

TEST_CASE("a BAD frame without a direct pose is held by the prediction, unless only the paper's switch is asked for") {
  for (const RefinedFrames refine : {RefinedFrames::Every, RefinedFrames::BadOnly, RefinedFrames::None}) {
    CAPTURE(static_cast<int>(refine));
    PipelineOptions o = quick_start();
    o.refine = refine;
    Host host("static_xyz", 0, o);
    const Matrix6 information = Matrix6::Identity() / (0.01 * 0.01);  // 1 cm, 0.6 degrees
    int i = 0;
    for (; i < 12; ++i) host.step(i);
    host.blank = true;
    for (int k = 0; k < 4; ++k, ++i) {  // off to one side and to the other
      CAPTURE(k);
      Pose T_shaken = host.truth(i);
      T_shaken(0, 3) += k % 2 == 0 ? 0.03 : -0.03;
      const FrameReport& r = host.step(i, Pose::Identity(), true, 0.0F, &T_shaken, information);
      REQUIRE(r.state == SceneState::Bad);
      REQUIRE_FALSE(r.refined);
      const bool filtered = refine == RefinedFrames::Every;
      CHECK(r.source == (filtered ? PoseSource::Filtered : PoseSource::Features));
      const double off = (inverse(host.truth(i)) * r.T_world_camera).translation().norm();
      CHECK((filtered ? off < 0.015 : std::abs(off - 0.03) < 1e-6));
      CHECK((inverse(T_shaken) * r.T_world_feature).translation().norm() < 1e-9);
      CHECK_FALSE(r.keyframe_allowed);
    }
  }
}

TEST_CASE("along a wall a feature pose that jumps is held by the motion so far, unless only the paper's switch is asked for") {
  for (const RefinedFrames refine : {RefinedFrames::Every, RefinedFrames::BadOnly}) {
    for (const double jump : {0.03, -0.03}) {
      CAPTURE(static_cast<int>(refine));
      CAPTURE(jump);
      PipelineOptions o = quick_start();
      o.refine = refine;
      Host host("static_static", 0, o);
      host.bare_wall = true;
      host.patches = 16;
      int i = 0;
      for (; i < 12; ++i) host.step(i);
      host.patches = 0;
      Pose T_jumped = host.truth(i);
      T_jumped = compose(T_jumped, make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(jump, 0, 0)));
      const Matrix6 information = Matrix6::Identity() / (0.01 * 0.01);  // 1 cm, 0.6 degrees
      const FrameReport& r = host.step(i, Pose::Identity(), true, 0.0F, &T_jumped, information);
      REQUIRE(r.state == SceneState::Bad);
      REQUIRE(r.refinement.status == Status::Degenerate);
      REQUIRE(r.source == PoseSource::Joined);
      const auto off = [&](const Pose& T) { return (inverse(host.truth(i)) * T).translation().norm(); };
      CHECK(off(r.refinement.T_world_camera) > 0.025);
      CHECK((refine == RefinedFrames::Every ? off(r.T_world_camera) < 0.01 : off(r.T_world_camera) > 0.025));
    }
  }
}

TEST_CASE("a refiner of one's own need not tell what its alignment knows of each direction") {
  testing::SyntheticSequence sequence("static_xyz", small_world(0));
  BasicPipeline<Pose, GeometricMotion, SceneAssessor, Halfway> pipeline(sequence.camera());
  testing::SyntheticFrame frame;
  for (int i = 0; i < 8; ++i) {
    sequence.render(i, frame);
    const Pose T = frame.T_world_camera;
    pipeline.observe(frame.rgbd(), T);
    pipeline.assess(none, none, {T * make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.02, 0, 0)), T, true});
    const auto& r = pipeline.conclude();
    CHECK(r.source == PoseSource::Joined);
    CHECK((inverse(T) * r.T_world_camera).translation().norm() == doctest::Approx(0.01).epsilon(1e-6));
  }
}

TEST_CASE("an alignment that leaves open where a feature pose lies does not confirm it") {
  PipelineOptions o = quick_start();
  o.refiner.velocity_gate = 0.001;  // no direct pose is believed
  Host host("static_static", 0, o);
  host.bare_wall = true;
  int i = 0;
  for (; i < 12; ++i) host.step(i);
  Pose T_wrong = host.truth(i);
  T_wrong = compose(T_wrong, make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.2, 0, 0)));  // along the wall
  const FrameReport& r = host.step(i, Pose::Identity(), true, 0.0F, &T_wrong);
  REQUIRE(r.state == SceneState::Bad);
  REQUIRE(r.refinement.status == Status::Degenerate);
  REQUIRE_FALSE(r.refined);
  CHECK((inverse(T_wrong) * r.refinement.T_world_direct).translation().norm() < 0.05);  // it has stayed where it began
  CHECK(r.source == PoseSource::Prediction);
  CHECK((inverse(host.truth(i)) * r.T_world_camera).translation().norm() < 1e-9);
}

TEST_CASE("a direct pose with an open direction takes the place of a feature pose only if the frame before was measured") {
  for (const bool lost : {false, true}) {
    CAPTURE(lost);
    Host host("static_static", 0, quick_start());
    host.bare_wall = true;
    int i = 0;
    for (; i < 12; ++i) host.step(i);
    if (lost)
      REQUIRE(host.step(i++, make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.5, 0, 0)), false, 0.0F).state == SceneState::Lost);
    Pose T_wrong = host.truth(i);
    T_wrong = compose(T_wrong, make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, 0, 0.35)));  // nearer to the wall than it is
    const FrameReport& r = host.step(i, Pose::Identity(), true, 0.0F, &T_wrong);
    REQUIRE(r.refinement.status == Status::Degenerate);
    REQUIRE(r.refinement.refined);
    REQUIRE(r.refinement.w_eff == 0);
    CHECK(r.refined == !lost);
    CHECK(r.source == (lost ? PoseSource::Prediction : PoseSource::Direct));
    CHECK(r.state == (lost ? SceneState::Lost : SceneState::Bad));
  }
}

TEST_CASE("a camera that is found again far from where it was lost is believed once a second pose goes on from the first") {
  Host host("static_static", 0, quick_start());
  int i = 0;
  for (; i < 12; ++i) host.step(i);
  host.blank = true;
  const Pose T_lost = make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.5, 0, 0));
  CHECK(host.step(i++, T_lost, false, 0.0F).state == SceneState::Lost);
  for (const SceneState expected : {SceneState::Lost, SceneState::Bad}) {
    const Pose T_found = host.truth(i);
    const FrameReport& r = host.step(i, T_lost, true, 0.0F, &T_found);
    CHECK(r.state == expected);
    CHECK(r.source == (expected == SceneState::Bad ? PoseSource::Features : PoseSource::Prediction));
    ++i;
  }
}

TEST_CASE("a frame without features and without refinement is LOST") {
  PipelineOptions o = quick_start();
  o.refine = RefinedFrames::None;
  Host host("static_xyz", 0, o);
  for (int i = 0; i < 12; ++i) host.step(i);
  CHECK(host.step(12, Pose::Identity(), false, 0.0F).state == SceneState::Lost);
}

TEST_CASE("GOOD frames with noisy poses become more exact; as in the paper they keep theirs") {
  const auto errors = [](RefinedFrames refine) {
    PipelineOptions o = quick_start();
    o.refine = refine;
    Host host("static_xyz", 0, o);
    double before = 0, after = 0;
    int good = 0;
    for (int i = 0; i < 40; ++i) {
      Twist off = Twist::Zero();  // 5 mm and 0.15 degrees, another direction each time
      for (int k = 0; k < 6; ++k) off(k) = (k < 3 ? 0.005 : 0.0026) * std::sin(2.4 * i + 1.7 * k);
      const bool initialising = i < 8;
      const FrameReport& r = host.step(i, initialising ? Pose::Identity() : se3_exp(off));
      if (initialising || r.state != SceneState::Good) continue;
      ++good;
      before += (inverse(host.truth(i)) * r.T_world_feature).translation().norm();
      after += (inverse(host.truth(i)) * r.T_world_camera).translation().norm();
      CHECK(r.refined == (refine == RefinedFrames::Every));
      CHECK(r.keyframe_allowed);
    }
    REQUIRE(good > 20);
    Twist off = Twist::Zero();
    off(0) = 0.02;
    const FrameReport& bad = host.step(40, se3_exp(off), true, 0.0F);
    REQUIRE(bad.state == SceneState::Bad);
    CHECK(bad.refined == (refine != RefinedFrames::None));
    CHECK_FALSE(bad.keyframe_allowed);
    return after / before;
  };
  CHECK(errors(RefinedFrames::Every) < 0.4);
  CHECK(errors(RefinedFrames::BadOnly) == doctest::Approx(1));
  CHECK(errors(RefinedFrames::None) == doctest::Approx(1));
}

TEST_CASE("a frame without a feature pose takes the direct pose, and the map may grow from it") {
  for (const RefinedFrames refine : {RefinedFrames::Every, RefinedFrames::BadOnly}) {
    PipelineOptions o = quick_start();
    o.refine = refine;
    Host host("static_xyz", 0, o);
    for (int i = 0; i < 12; ++i) host.step(i);
    Twist off = Twist::Zero();
    off << 0.02, -0.01, 0.01, 0.005, 0.01, -0.005;
    const FrameReport& r = host.step(12, se3_exp(off), false, 0.0F);
    REQUIRE(r.refined);
    REQUIRE(r.refinement.c_dir > kSureConfidence);
    CHECK(r.state == SceneState::Bad);
    CHECK(r.keyframe_allowed == (refine == RefinedFrames::Every));
    CHECK((inverse(host.truth(12)) * r.T_world_camera).translation().norm() < 0.005);
  }
}

TEST_CASE("a feature pose that jumps in good images is BAD and put right, and the map may grow from the frame") {
  for (const RefinedFrames refine : {RefinedFrames::Every, RefinedFrames::BadOnly}) {
    PipelineOptions o = quick_start();
    o.refine = refine;
    Host host("static_xyz", 0, o);
    int i = 0;
    for (; i < 12; ++i) host.step(i);
    REQUIRE(host.pipeline().report().state == SceneState::Good);
    Pose T_wrong = host.truth(i);
    T_wrong(1, 3) += 0.1;
    const FrameReport& r = host.step(i, Pose::Identity(), true, 30, &T_wrong);
    CHECK(r.assessment.innovation == doctest::Approx(0.1).epsilon(1e-6));
    CHECK(r.state == SceneState::Bad);
    CHECK(r.refined);
    CHECK((inverse(host.truth(i)) * r.T_world_camera).translation().norm() < 0.01);
    CHECK(r.keyframe_allowed);
    ++i;
    CHECK(host.step(i).state == SceneState::Good);
  }
}

TEST_CASE("a prediction that goes on from a guess says nothing about the feature pose") {
  Host host("static_xyz", 0, quick_start());
  int i = 0;
  for (; i < 12; ++i) host.step(i);
  host.blank = true;
  const Pose T_far = make_pose(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.5, 0, 0));
  REQUIRE(host.step(i++, T_far, false, 0.0F).source == PoseSource::Prediction);
  const Pose T_found = host.truth(i);
  const FrameReport& r = host.step(i, T_far, true, 30, &T_found);
  CHECK(std::isnan(r.assessment.innovation));
  CHECK(r.assessment.S_inn.value() == 1);
}

TEST_CASE("a mask from outside is taken as it is when no motion policy runs") {
  PipelineOptions o;
  o.motion = false;
  const testing::SyntheticSequence sequence("static_static", small_world(0));
  testing::SyntheticFrame frame;
  sequence.render(0, frame);
  Pipeline pipeline(sequence.camera(), o);
  Image<std::uint8_t> mask(320, 240, 0);
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 80; ++x) mask(x, y) = 255;
  }
  const Observation& seen = pipeline.observe(frame.rgbd(), Pose::Identity(), none, none, mask);
  CHECK(seen.dynamic_ratio == doctest::Approx(0.25));
  CHECK(seen.informative);
  CHECK_FALSE(pipeline.observe(frame.rgbd(), Pose::Identity()).informative);
}

TEST_CASE("two pipelines fed the same say the same, and reset() forgets") {
  Host a("walking_xyz", 2), b("walking_xyz", 2);
  for (int i = 0; i < 8; ++i) {
    const FrameReport& x = a.step(i);
    const FrameReport& y = b.step(i);
    CHECK(x.T_world_camera.matrix() == y.T_world_camera.matrix());
    CHECK(x.assessment.S_total.value() == y.assessment.S_total.value());
    CHECK(x.assessment.dynamic_ratio == y.assessment.dynamic_ratio);
  }
  a.pipeline().reset();
  CHECK(a.step(0).assessment.frame == 1);
}

TEST_CASE("wrong calls are refused") {
  const Pinhole camera{300, 300, 160, 120, 320, 240};
  Pipeline pipeline(camera);
  const Image<float> good(320, 240, 0.5F), wrong(100, 100, 0.5F);
  const Pose I = Pose::Identity();
  Pose nan = I;
  nan.translation().x() = std::nan("");
  const std::vector<Keypoint> keypoints;
  CHECK_THROWS_AS(pipeline.observe({0, wrong, good}, I), contract_error);
  CHECK_THROWS_AS(pipeline.observe({0, good, wrong}, I), contract_error);
  CHECK_THROWS_AS(pipeline.observe({std::nan(""), good, good}, I), contract_error);
  CHECK_THROWS_AS(pipeline.observe({0, good, good}, nan), contract_error);
  CHECK_THROWS_AS(pipeline.observe({0, good, good}, I, none, none, wrong), contract_error);
  Pinhole other = camera;
  other.fx = 301;
  CHECK_THROWS_AS(pipeline.observe(frame(0, good, good, other), I), contract_error);
  // the three calls in their order, each once per frame
  CHECK_THROWS_AS(pipeline.assess(keypoints, none, {I, I, true}), contract_error);
  CHECK_THROWS_AS(pipeline.conclude(), contract_error);
  pipeline.observe({0, good, good}, I);
  CHECK_THROWS_AS(pipeline.conclude(), contract_error);
  CHECK_THROWS_AS(pipeline.assess(keypoints, none, {I, nan, false}), contract_error);
  pipeline.assess(keypoints, none, {nan, I, false});  // nobody looks at a pose that was not found
  CHECK_THROWS_AS(pipeline.assess(keypoints, none, {I, I, true}), contract_error);
  CHECK(is_finite(pipeline.conclude().T_world_feature));
  CHECK_THROWS_AS(pipeline.conclude(), contract_error);
  CHECK_THROWS_AS(pipeline.observe({0, good, wrong}, I), contract_error);
  CHECK_THROWS_AS(pipeline.assess(keypoints, none, {I, I, true}), contract_error);  // not of the frame that was refused
  PipelineOptions o;
  o.assessor.decision.th_differ = 2;
  CHECK_THROWS_AS(Pipeline(camera, o), contract_error);
}

TEST_CASE("the paper as one setting: valid, unlike the defaults in every module, and it runs to the end") {
  PipelineOptions paper = paper_options();
  const PipelineOptions defaults;
  CHECK(paper.assessor.decision.polarity != defaults.assessor.decision.polarity);      // (6)
  CHECK(paper.assessor.benchmark.hand_over != defaults.assessor.benchmark.hand_over);  // (10)
  CHECK(paper.refine != defaults.refine);
  CHECK(paper.refiner.memory.previous != defaults.refiner.memory.previous);
  CHECK(paper.refiner.memory.form != defaults.refiner.memory.form);                        // (12)
  CHECK(paper.refiner.alignment.illumination != defaults.refiner.alignment.illumination);  // (13)
  CHECK(paper.refiner.alignment.alpha_place != defaults.refiner.alignment.alpha_place);    // (15)
  CHECK(paper.refiner.memory.decay_form != defaults.refiner.memory.decay_form);            // (16)
  CHECK(paper.refiner.blend.weight != defaults.refiner.blend.weight);                      // (17)
  CHECK_NOTHROW(validate(paper, "paper"));
  paper.assessor.initialisation.frames = 5;
  Host host("static_xyz", 0, paper);
  for (int i = 0; i < 12; ++i) host.step(i);
  Twist off = Twist::Zero();
  off.head<3>() << 0.02, -0.01, 0.01;
  const FrameReport& r = host.step(12, se3_exp(off), true, 0.0F);
  CHECK(r.state != SceneState::Initialising);
  CHECK(is_finite(r.T_world_camera));
}

TEST_CASE("a camera is refused when the pipeline is made, or never") {
  int refused = 0;
  int run = 0;
  for (const int finest : {0, 1, 2}) {
    for (const RefinedFrames refine : {RefinedFrames::Every, RefinedFrames::None}) {
      for (const int width : {1, 2, 3, 7, 8, 15, 16, 31, 32, 40}) {
        for (const int height : {1, 2, 7, 8, 15, 16, 31, 32, 40}) {
          CAPTURE(finest);
          CAPTURE(width);
          CAPTURE(height);
          PipelineOptions o = quick_start();
          o.refine = refine;
          o.refiner.pyramid.finest = finest;
          o.assessor.initialisation.frames = 1;
          const Pinhole camera{40, 40, width / 2.0, height / 2.0, width, height};
          std::string error;
          try {
            Pipeline pipeline(camera, o);
            Image<float> grey(width, height, 0.5F), depth(width, height, 2.0F);
            for (int x = 0; x < width; ++x) grey(x, height / 2) = 0.02F * static_cast<float>(x % 40);
            for (int i = 0; i < 4; ++i) {
              pipeline.observe({0.1 * i, grey, depth}, Pose::Identity());
              pipeline.assess(none, none, {Pose::Identity(), Pose::Identity(), i < 3});
              CHECK(is_rigid(pipeline.conclude().T_world_camera));
            }
            ++run;
          } catch (const contract_error& e) {
            error = e.what();
          }
          // halved `finest` times, both sides must be left with 8 pixels
          const bool small = width < 8 * (1 << finest) || height < 8 * (1 << finest);
          CHECK(error.empty() == !(small && refine != RefinedFrames::None));
          if (error.empty()) continue;
          ++refused;
          const std::string least = std::to_string(8 * (1 << finest));
          CHECK(error.find("Pipeline: the camera has " + std::to_string(width) + " x " + std::to_string(height) + " pixels") !=
                std::string::npos);
          CHECK(error.find("at least " + least + " x " + least) != std::string::npos);
        }
      }
    }
  }
  CHECK(refused > 100);
  CHECK(run > 100);
}

TEST_CASE("a camera beyond any that is built is refused with the range") {
  const Pinhole good{300, 300, 160, 120, 320, 240};
  const auto refused = [&](const auto& change) {
    Pinhole camera = good;
    change(camera);
    try {
      camera.validate();
    } catch (const contract_error&) {
      CHECK_THROWS_AS(Pipeline{camera}, contract_error);
      return true;
    }
    return false;
  };
  for (const double bad : {0.0, -300.0, 1e-300, 1e300, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    CHECK(refused([&](Pinhole& c) { c.fx = bad; }));
    CHECK(refused([&](Pinhole& c) { c.fy = bad; }));
  }
  for (const double bad : {1e300, -1e300, std::numeric_limits<double>::quiet_NaN()}) {
    CHECK(refused([&](Pinhole& c) { c.cx = bad; }));
    CHECK(refused([&](Pinhole& c) { c.cy = bad; }));
  }
  CHECK(refused([](Pinhole& c) { c.width = 100000; }));
  CHECK(refused([](Pinhole& c) { c.width = c.height = 20000; }));
  CHECK(refused([](Pinhole& c) { c.height = 0; }));
  CHECK_FALSE(refused([](Pinhole& c) { c.width = c.height = 10000; }));
  CHECK_FALSE(refused([](Pinhole& c) { c.fx = 1e6; }));
}
