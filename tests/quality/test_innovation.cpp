// S_inn: feature poses that are off what was predicted.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <apso/quality/assessor.hpp>
#include <apso/quality/explain.hpp>

using namespace apso;
using doctest::Approx;

namespace {
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Pose at(double x) {
  Twist d = zeros<Twist>();
  d(0) = x;
  d(4) = x;  // turned too: only where the camera is counts
  return se3_exp(d);
}

/// A camera that stands still before a scene that is good in every respect. The pose lies `off` beside the predicted one.
class Stand {
 public:
  explicit Stand(const AssessorOptions& options = {}) : assessor_(camera_, options) {
    for (int y = 0; y < 24; ++y)
      for (int x = 0; x < 40; ++x)
        keypoints_.push_back({8.F + 16.F * static_cast<float>(x), 10.F + 20.F * static_cast<float>(y), 30, 0, 0});
  }
  const Assessment& frame(double off, bool predicted = true) {
    const Pose T_world_predicted = at(predicted_at_);
    const Pose T_world_camera = compose(T_world_predicted, at(off));
    return frame(&T_world_camera, predicted ? &T_world_predicted : nullptr);
  }
  const Assessment& frame(const Pose* T_world_camera, const Pose* T_world_predicted) {
    AssessmentInput in;
    in.frame = {++n_ / 30.0, intensity_, depth_};
    in.keypoints = &keypoints_;
    in.T_world_camera = T_world_camera;
    in.T_world_predicted = T_world_predicted;
    return assessor_.assess(in);
  }
  SceneAssessor& assessor() { return assessor_; }

 private:
  Pinhole camera_{525, 525, 319.5, 239.5, 640, 480};
  Image<float> intensity_{640, 480, 0.5F};
  Image<float> depth_{640, 480, 2.F};
  std::vector<Keypoint> keypoints_;
  double predicted_at_ = 1.3;  // the world may lie anywhere
  int n_ = 0;
  SceneAssessor assessor_;
};
}  // namespace

TEST_CASE("S_inn is 1 up to what is typical, a half at five times that, and falls from there") {
  CHECK(innovation_score(0.004, 0.01).value() == 1);
  CHECK(innovation_score(0.01, 0.01).value() == 1);
  CHECK(innovation_score(0.05, 0.01).value() == Approx(0.5));
  CHECK(innovation_score(5 * kLeastTypicalInnovation, 0).value() == Approx(0.5));  // a camera that stood still
  CHECK(innovation_score(kNaN, 0.01).value() == 1);
  CHECK(innovation_score(1e300, 0.01).value() == Approx(0));
  double before = 1;
  for (double innovation = 0.011; innovation < 0.2; innovation += 0.001) {
    const double now = innovation_score(innovation, 0.01).value();
    CHECK(now < before);
    before = now;
  }
}

TEST_CASE("what is typical is the median of the frames before, so that a camera that begins to move otherwise does not stay BAD") {
  InnovationMonitor monitor;
  (void)monitor.score(0.003);  // nothing is typical yet
  for (int i = 1; i < 300; ++i) CHECK(monitor.score(0.003).value() == 1);
  CHECK(monitor.score(kNaN).value() == 1);
  CHECK(monitor.score(0.015).value() == Approx(0.5));
  for (int i = 0; i < 151; ++i) (void)monitor.score(0.015);
  CHECK(monitor.score(0.015).value() == 1);
  monitor.reset();
  CHECK(monitor.score(5 * kLeastTypicalInnovation).value() == Approx(0.5));
}

TEST_CASE("a feature pose that is off the prediction makes a good frame BAD and is told; its images stay good") {
  Stand stand;
  for (int n = 0; n < 40; ++n) stand.frame(0.004);
  const Assessment usual = stand.frame(0.004);
  REQUIRE(usual.state == SceneState::Good);
  CHECK(usual.innovation == Approx(0.004));
  CHECK(usual.S_inn.value() == 1);
  CHECK(usual.good_scene);
  const Assessment jump = stand.frame(0.05);
  CHECK(jump.innovation == Approx(0.05));
  CHECK(jump.S_final->value() == Approx(usual.S_final->value() * jump.S_inn.value()).epsilon(1e-3));
  CHECK(jump.state == SceneState::Bad);
  CHECK(jump.good_scene);
  CHECK(explain(jump).find("the feature pose is 5.00 cm off the prediction (S_inn 0.1") != std::string::npos);
  CHECK(stand.frame(0.004).state == SceneState::Good);
  stand.assessor().reset();  // forgets what was typical
  CHECK(stand.frame(5 * kLeastTypicalInnovation).S_inn.value() == Approx(0.5));
}

TEST_CASE("where nothing was predicted, no pose was found, or as printed, S_inn says nothing") {
  AssessorOptions printed;
  printed.decision.innovation = false;
  CHECK_FALSE(paper_assessor_options().decision.innovation);
  const Pose T = at(0.3);
  Pose T_nan = T;
  T_nan(0, 3) = kNaN;
  const auto says_nothing = [](const Assessment& a) { return std::isnan(a.innovation) && a.S_inn.value() == 1; };
  Stand as_printed(printed);
  Stand stand;
  for (int n = 0; n < 40; ++n) {
    as_printed.frame(0.004);
    stand.frame(0.004);
  }
  CHECK(says_nothing(as_printed.frame(0.05)));
  CHECK(as_printed.assessor().assessment().state == SceneState::Good);
  CHECK(says_nothing(stand.frame(0.05, false)));
  CHECK(stand.assessor().assessment().state == SceneState::Good);
  CHECK(says_nothing(stand.frame(&T, &T_nan)));
  CHECK(says_nothing(stand.frame(nullptr, &T)));
  CHECK(says_nothing(stand.frame(&T_nan, &T)));
  const Assessment& refused = stand.assessor().assessment();
  CHECK_FALSE(refused.good_scene);  // there is no pose to build upon
}
