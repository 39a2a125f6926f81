// The printed forms of equations (1) to (11), and S_mc without the camera's own motion.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <apso/math/se3.hpp>
#include <apso/quality/assessor.hpp>

#include "uniform.hpp"

using namespace apso;
using doctest::Approx;

namespace {
const Pinhole kCamera{525, 525, 319.5, 239.5, 640, 480};

Pose moved(double angle, const Eigen::Vector3d& t) {
  Twist xi = Twist::Zero();
  xi(4) = angle;
  Pose T = se3_exp(xi);
  for (int i = 0; i < 3; ++i) T(i, 3) = t(i);
  return T;
}

/// Points of a room seen from two poses.
struct TwoViews {
  std::vector<Correspondence> matches;
  std::vector<PointTrack> before, after;
  Image<float> depth{640, 480, 0.F};
  TwoViews(const Pose& T_current_reference, double spread_of_depth) {
    Uniform<double> random;
    for (int i = 0; i < 600; ++i) {
      const int u = 20 + static_cast<int>(600 * random()), v = 20 + static_cast<int>(440 * random());
      if (depth(u, v) != 0) continue;
      depth(u, v) = static_cast<float>(2 + spread_of_depth * random());
      const Eigen::Vector3d p = transform(T_current_reference, kCamera.unproject(u, v, static_cast<double>(depth(u, v))));
      const Eigen::Vector2d seen = kCamera.project(p);
      const auto x = static_cast<float>(seen.x()), y = static_cast<float>(seen.y());
      if (!kCamera.contains(seen.x(), seen.y())) continue;
      matches.push_back({static_cast<float>(u), static_cast<float>(v), x, y});
      before.push_back({i, static_cast<float>(u), static_cast<float>(v), static_cast<float>(u), static_cast<float>(v), 1});
      after.push_back({i, x, y, static_cast<float>(u), static_cast<float>(v), 2});
    }
  }
};
double flow_left(const std::vector<Correspondence>& matches, FlowKind kind) {
  MotionScratch scratch;
  MotionChangeOptions o;
  o.flow = kind;
  return 800 * motion_change(matches, static_cast<int>(matches.size()), 640, 480, o, 0.1, scratch).m_point;  // [px]
}
}  // namespace

TEST_CASE("a homography explains the flow of a turning camera exactly, an affine flow does not") {
  const TwoViews views(moved(0.2, Eigen::Vector3d::Zero()), 3.0);
  CHECK(flow_left(views.matches, FlowKind::Raw) > 50);
  CHECK(flow_left(views.matches, FlowKind::Residual) > 0.5);
  CHECK(flow_left(views.matches, FlowKind::Homography) < 0.01);
  std::vector<Correspondence> mixed = views.matches;
  for (std::size_t i = 0; i < mixed.size(); i += 3) mixed[i].x += 40;  // a third moves by itself
  CHECK(flow_left(mixed, FlowKind::Homography) > 8);
  const std::vector<Correspondence> few(views.matches.begin(), views.matches.begin() + 11);
  CHECK(flow_left(few, FlowKind::Homography) == flow_left(few, FlowKind::Raw));
  mixed = views.matches;
  mixed[3].x = std::numeric_limits<float>::quiet_NaN();
  mixed[4].reference_y = std::numeric_limits<float>::infinity();
  CHECK(flow_left(mixed, FlowKind::Homography) < 0.01);
}

TEST_CASE("a homography is the most probable one: errors count in pixels, wherever they are") {
  Homography truth;
  truth.scale = 2.0 / (640 + 480);
  truth.cx = 320;
  truth.cy = 240;
  const double h[8] = {1.1, .05, .1, -.03, .95, .05, .5, -.4};  // the scale differs by a factor of 3 over the image
  std::copy(h, h + 8, truth.h);
  Uniform<double> random;
  std::vector<Correspondence> matches;
  for (int i = 0; i < 200; ++i) {
    const double u = 640 * random(), v = 480 * random();
    const PlanarFlow f = truth.flow(u, v);
    matches.push_back({static_cast<float>(u), static_cast<float>(v), static_cast<float>(u + f.x + 3 * random() - 1.5),
                       static_cast<float>(v + f.y + 3 * random() - 1.5)});
  }
  const Homography fit = fit_homography(matches, 640, 480);
  // sum of log(1 + e^2 / (2 px)^2), by Gauss-Newton with numeric derivatives
  Homography best = truth;
  const auto error = [&](const Homography& H, const Correspondence& m) {
    const PlanarFlow f = H.flow(static_cast<double>(m.reference_x), static_cast<double>(m.reference_y));
    return Eigen::Vector2d(static_cast<double>(m.reference_x - m.x) + f.x, static_cast<double>(m.reference_y - m.y) + f.y);
  };
  for (int round = 0; round < 20; ++round) {
    Eigen::Matrix<double, 8, 8> A = Eigen::Matrix<double, 8, 8>::Zero();
    Eigen::Matrix<double, 8, 1> b = Eigen::Matrix<double, 8, 1>::Zero();
    for (const Correspondence& m : matches) {
      const Eigen::Vector2d e = error(best, m);
      Eigen::Matrix<double, 2, 8> J;
      for (int k = 0; k < 8; ++k) {
        Homography moved = best;
        moved.h[k] += 1e-6;
        J.col(k) = (error(moved, m) - e) / 1e-6;
      }
      A += J.transpose() * J / (1 + e.squaredNorm() / 4);
      b += J.transpose() * e / (1 + e.squaredNorm() / 4);
    }
    const Eigen::Matrix<double, 8, 1> step = A.ldlt().solve(b);
    for (int k = 0; k < 8; ++k) best.h[k] -= step(k);
  }
  double off = 0;
  for (const Correspondence& m : matches) off += (error(fit, m) - error(best, m)).squaredNorm() / static_cast<double>(matches.size());
  CHECK(std::sqrt(off) < .02);  // [px]
}

TEST_CASE("two poses and the depth explain the flow of a static room, and only that") {
  const Pose T_current_reference = moved(0.05, {0.1, 0, -0.05});
  const TwoViews views(T_current_reference, 3.0);
  const auto score = [&](FlowKind kind, const Pose* before, const Pose* after, std::vector<PointTrack> tracks) {
    MotionChange change;
    change.options.flow = kind;
    FrameContext frame;
    frame.camera = kCamera;
    frame.depth = views.depth;
    frame.tracks = &views.before;
    frame.T_world_camera = before;
    MotionChange::Memory reference, current;
    change.remember(frame, reference);
    frame.tracks = &tracks;
    frame.T_world_camera = after;
    change.remember(frame, current);
    const MaybeDeviation s = change(ChangeContext<MotionChange::Memory>{reference, current, kCamera, ChangeBaseline::Reference});
    return s ? s->value() : -1.0;
  };
  const Pose T_reference = moved(0.3, {1, 2, 3});  // somewhere in the world
  const Pose T_current = compose(T_reference, inverse(T_current_reference));
  CHECK(score(FlowKind::PosePredicted, &T_reference, &T_current, views.after) < 0.001);
  CHECK(score(FlowKind::Raw, &T_reference, &T_current, views.after) > 0.2);
  CHECK(score(FlowKind::Homography, &T_reference, &T_current, views.after) > 0.01);  // parallax remains
  CHECK(score(FlowKind::PosePredicted, &T_reference, &T_reference, views.after) > 0.2);
  CHECK(score(FlowKind::PosePredicted, nullptr, &T_current, views.after) == -1);  // missing without a pose
  std::vector<PointTrack> walking = views.after;
  for (std::size_t i = 0; i < walking.size(); i += 2) walking[i].x += 60;
  CHECK(score(FlowKind::PosePredicted, &T_reference, &T_current, walking) > 0.15);
}

TEST_CASE("all printed forms together") {
  const AssessorOptions o = paper_assessor_options();
  CHECK(o.decision.polarity == ChangePolarity::Literal);
  CHECK(o.benchmark.half_life == std::numeric_limits<double>::infinity());
  SceneAssessor paper(kCamera, o);
  SceneAssessor shipped(kCamera);
  const Image<float> depth(640, 480, 2.F);
  std::vector<Keypoint> keypoints;
  std::vector<PointTrack> tracks;
  std::vector<Detection> objects(2);
  objects[0].box = {10, 10, 50, 50};
  objects[0].score = 0.9F;
  objects[0].motion_probability = 1;
  objects[1] = objects[0];
  objects[1].box.x = 300;
  objects[1].motion_probability = 0;
  for (int i = 0; i < 960; ++i) {
    const float u = 8.F + 16.F * static_cast<float>(i % 40), v = 10.F + 20.F * static_cast<float>(i / 40);
    keypoints.push_back({u, v, 30, 0, 0});
    tracks.push_back({i, u, v, u, v, 5});
  }
  AssessmentInput in;
  in.keypoints = &keypoints;
  in.tracks = &tracks;
  in.objects = &objects;
  double t = 0;
  const auto next = [&] {
    in.frame = {t += 1.0 / 30, {}, depth};
    shipped.assess(in);
    return paper.assess(in);
  };
  for (int n = 0; n < 40; ++n) next();
  // (8): half of the objects move, so W_base is gone after two frames of decision and stays there
  CHECK(paper.assessment().dynamic_ratio == 0.5);
  CHECK(paper.assessment().W_base == 0);
  // (6): with S_change = 0 and all weight on it, the frame that equals its reference is BAD
  CHECK(paper.assessment().S_change->value() == Approx(0));
  CHECK(paper.assessment().state == SceneState::Bad);
  CHECK(shipped.assessment().state == SceneState::Good);
  // (2): S_conf counts as 0 without objects instead of leaving its weight to the others
  objects.clear();
  const Assessment a = next();
  CHECK(a.get<Confidence>()->value() == 0);
  CHECK_FALSE(shipped.assessment().get<Confidence>());
  CHECK(a.S_total.value() < shipped.assessment().S_total.value());
}
