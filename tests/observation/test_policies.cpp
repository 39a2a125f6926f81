// The motion policies beside the default one: each finds what moves in rooms whose truth is known, and nothing else.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <apso/observation/combined_policy.hpp>
#include <apso/observation/policies/cluster_residual.hpp>
#include <apso/observation/policies/epipolar_motion.hpp>
#include <apso/observation/policies/geometric_motion.hpp>
#include <apso/observation/policies/multiview_depth.hpp>
#include <apso/observation/policies/residual_motion.hpp>
#include <apso/testing/numeric_jacobian.hpp>

#include "scene.hpp"

namespace {
using namespace apso;
using observation_test::camera;
using observation_test::ExactTracks;
using observation_test::hand_held;
using observation_test::Scene;
using observation_test::Slab;

struct Outcome {
  double recall = 0;           // of the moving slab
  double false_positives = 0;  // share of the static pixels that are called dynamic
  double worst_share = 0;      // largest dynamic share of the image
  double known = 0;
};

enum class Camera { HandHeld, Resting, Turning };

/// Runs a policy with exact poses; the slab walks through the view or stands as furniture.
template <class Policy>
Outcome run(Policy& policy, bool moves, Camera kind = Camera::HandHeld, int frames = 50, double speed = 0.9) {
  Scene s;
  s.textured = true;
  ExactTracks tracker;
  DynamicMask m;
  Outcome o;
  double n = 0;
  for (int k = 0; k < frames; ++k) {
    const double t = k / 30.0;
    Pose T = kind == Camera::Resting ? Pose::Identity() : hand_held(kind == Camera::Turning ? 2.5 * t : t);
    if (kind == Camera::Turning) T.translation().setZero();
    Slab slab;
    slab.x = moves ? -1.2 + speed * t : -0.2;
    s.render(T, slab);
    policy.observe(s.frame(t), T, tracker.follow(s, T, slab), m);
    policy.remember(s.frame(t), T, m);
    REQUIRE(m.probability.width() == camera().width);
    double hit = 0, real = 0, wrong = 0, rest = 0;
    bool sane = true;
    for (std::size_t i = 0; i < s.truth.size(); ++i) {
      const float p = m.probability.data()[i];
      sane = sane && p >= 0.0F && p <= 1.0F && m.known.data()[i] <= 1;
      const bool dynamic = p >= 0.5F;
      const bool truth = moves && s.truth.data()[i] != 0;
      real += truth ? 1 : 0;
      rest += truth ? 0 : 1;
      hit += truth && dynamic ? 1 : 0;
      wrong += !truth && dynamic ? 1 : 0;
    }
    REQUIRE(sane);
    o.worst_share = std::max(o.worst_share, dynamic_ratio(m));
    if (k < frames / 2) continue;
    n += 1;
    o.recall += real > 0 ? hit / real : 0;
    o.false_positives += wrong / rest;
    o.known += known_ratio(m);
  }
  o.recall /= n;
  o.false_positives /= n;
  o.known /= n;
  return o;
}

TEST_CASE("every policy keeps the requirement of motion_policy.hpp") {
  CHECK(is_motion_policy_v<GeometricMotion>);
  CHECK(is_motion_policy_v<ResidualMotion>);
  CHECK(is_motion_policy_v<ClusterResidual>);
  CHECK(is_motion_policy_v<MultiViewDepth>);
  CHECK(is_motion_policy_v<EpipolarMotion>);
  CHECK(is_motion_policy_v<AnyMotionPolicy>);
  CHECK(is_motion_policy_v<CombinedPolicy<NoMotion, GeometricMotion>>);
  CHECK_FALSE(is_motion_policy_v<int>);
  CHECK_FALSE(is_motion_policy_v<Scene>);
}

TEST_CASE("residual: a walking slab stands out, a resting one does not") {
  ResidualMotionOptions options;
  options.dilation = 0;
  ResidualMotion policy(camera(), options);
  const Outcome o = run(policy, true);
  CHECK(o.recall > 0.6);
  CHECK(o.false_positives < 0.03);
  for (Camera kind : {Camera::HandHeld, Camera::Turning}) {
    policy.reset();
    const Outcome rest = run(policy, false, kind, 30);
    CHECK(rest.worst_share < 0.02);
    CHECK(rest.known > 0.7);
  }
}

TEST_CASE("cluster-residual: a walking slab gets clusters of its own that do not rest") {
  ClusterResidualOptions options;
  options.dilation = 0;
  ClusterResidual policy(camera(), options);
  const Outcome o = run(policy, true);
  CHECK(o.recall > 0.6);
  CHECK(o.false_positives < 0.1);  // the edges are those of the clusters
  for (Camera kind : {Camera::HandHeld, Camera::Turning}) {
    policy.reset();
    const Outcome rest = run(policy, false, kind, 30);
    CHECK(rest.worst_share < 0.02);
    CHECK(rest.known > 0.7);
  }
}

TEST_CASE("multiview-depth: what stands well in front of the background of key views has moved in") {
  MultiViewDepthOptions options;
  options.dilation = 0;
  MultiViewDepth policy(camera(), options);
  const Outcome o = run(policy, true);
  CHECK(policy.view_count() > 2);
  CHECK(o.recall > 0.7);
  CHECK(o.false_positives < 0.03);
  policy.reset();
  CHECK(policy.view_count() == 0);
  for (Camera kind : {Camera::HandHeld, Camera::Turning}) {
    policy.reset();
    CHECK(run(policy, false, kind, 30).worst_share < 0.01);
  }
}

TEST_CASE("epipolar: tracks that leave their lines mark their surface") {
  EpipolarMotionOptions options;
  options.dilation = 0;
  EpipolarMotion policy(camera(), options);
  const Outcome o = run(policy, true);
  CHECK(o.recall > 0.6);
  CHECK(o.false_positives < 0.05);
  policy.reset();
  CHECK(run(policy, false, Camera::HandHeld, 30).worst_share < 0.02);
}

TEST_CASE("epipolar: a camera that only turns has no epipolar lines, and is judged by prediction") {
  EpipolarMotionOptions options;
  options.dilation = 0;
  EpipolarMotion policy(camera(), options);
  CHECK(run(policy, false, Camera::Turning, 30).worst_share < 0.01);
  CHECK(policy.model() == EpipolarModel::Prediction);
  policy.reset();
  const Outcome o = run(policy, true, Camera::Turning);
  CHECK(policy.model() == EpipolarModel::Prediction);
  CHECK(o.recall > 0.6);
  CHECK(o.false_positives < 0.03);
  // a camera that moves by 0.5 m/s, past a wall at 3.5 m: 0.2 s give 7 px
  policy.reset();
  Scene s;
  ExactTracks tracker;
  DynamicMask m;
  for (int k = 0; k < 15; ++k) {
    Pose T = Pose::Identity();
    T.translation().x() = 0.5 * k / 30.0 - 0.1;
    s.render(T, std::nullopt);
    policy.observe(s.frame(k / 30.0), T, tracker.follow(s, T, std::nullopt), m);
    policy.remember(s.frame(k / 30.0), T, m);
  }
  CHECK(policy.model() == EpipolarModel::Lines);
  CHECK(dynamic_ratio(m) < 0.01);
}

/// Depth and intensity that are NaN or infinite now and then, and tracks that are nowhere.
template <class Policy>
void survives(Policy policy) {
  Scene s;
  s.textured = true;
  DynamicMask m;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (int k = 0; k < 14; ++k) {
    s.render(Pose::Identity(), Slab{});
    if (k % 4 == 2) {
      for (std::size_t i = 0; i < s.depth.size(); ++i) {
        s.depth.data()[i] = k == 2 ? nan : k == 6 ? 0.0F : std::numeric_limits<float>::infinity();
        s.intensity.data()[i] = nan;
      }
    }
    std::vector<PointTrack> tracks;
    for (int i = 0; i < 30; ++i) tracks.push_back({i, nan, 10, 10, nan, k});
    for (int i = 30; i < 60; ++i) tracks.push_back({i, 1e30F, -1e30F, 5, 5, k});
    for (int i = 60; i < 90; ++i) tracks.push_back({i, 50, 50, 50, 50, k});             // all at one place: no geometry
    policy.observe(s.frame(k % 3 == 0 ? 0.0 : k / 30.0), Pose::Identity(), tracks, m);  // stamps that go back
    policy.remember(s.frame(k / 30.0), Pose::Identity(), m);
    bool sane = true;
    for (std::size_t i = 0; i < m.probability.size(); ++i)
      sane = sane && m.probability.data()[i] >= 0.0F && m.probability.data()[i] <= 1.0F;
    CHECK(sane);
    CHECK(dynamic_ratio(m) < 0.02);
  }
}

TEST_CASE("no policy trips over broken frames, and none sees motion in them") {
  survives(ResidualMotion(camera()));
  survives(ClusterResidual(camera()));
  survives(MultiViewDepth(camera()));
  survives(EpipolarMotion(camera()));
}

TEST_CASE("epipolar: without tracks nothing is known") {
  EpipolarMotion policy(camera());
  Scene s;
  DynamicMask m;
  for (int k = 0; k < 10; ++k) {
    s.render(Pose::Identity(), Slab{});
    policy.observe(s.frame(k / 30.0), Pose::Identity(), {}, m);
    policy.remember(s.frame(k / 30.0), Pose::Identity(), m);
  }
  CHECK(policy.model() == EpipolarModel::None);
  CHECK(known_ratio(m) == 0.0);
}

TEST_CASE("the eight-point algorithm finds the lines of a known motion") {
  const Pinhole c = camera();
  Twist xi;
  xi << 0.3, -0.1, 0.2, 0.05, -0.1, 0.15;
  const Pose T = se3_exp(xi);
  std::vector<PointPair> pairs;
  std::vector<int> all;
  for (int i = 0; i < 30; ++i) {
    const Eigen::Vector3d X(std::sin(1.7 * i), std::sin(2.9 * i + 1), 2.5 + std::sin(4.1 * i));
    pairs.push_back({c.project(X), c.project(T * X)});
    all.push_back(i);
  }
  Eigen::Matrix3d F;
  REQUIRE(eight_point(pairs, all, F));
  CHECK(F.norm() == doctest::Approx(1.0));
  CHECK(std::abs(F.determinant()) < 1e-12);
  for (const PointPair& p : pairs) CHECK(epipolar_distance(F, p) < 1e-6);
  // the matrix of the true motion, up to scale: K^-T [t]x R K^-1
  Eigen::Matrix3d K;
  K << c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1;
  Eigen::Matrix3d truth = K.inverse().transpose() * skew(Eigen::Vector3d(T.translation())) * T.linear() * K.inverse();
  truth /= truth.norm();
  CHECK(std::min((F - truth).norm(), (F + truth).norm()) < 1e-6);
  CHECK_FALSE(eight_point(pairs, {0, 1, 2, 3, 4, 5, 6}, F));
  CHECK_FALSE(eight_point(std::vector<PointPair>(8, pairs[0]), {0, 1, 2, 3, 4, 5, 6, 7}, F));
}

SmallFrame small_frame(const Pose& T, double noise) {
  Scene s;
  s.textured = true;
  s.render(T, std::nullopt, noise);
  SmallFrame f;
  FrameReducer(camera(), camera().width / 2, DepthRange{}).frame(s.frame(0), f);
  f.T_world_camera = T;
  return f;
}

TEST_CASE("low-res alignment: derivatives of both residuals agree with differences") {
  const Pinhole c = reduced_camera(camera(), 2);
  const SmallFrame past = small_frame(Pose::Identity(), 0);
  Twist xi;
  xi << 0.03, -0.02, 0.04, 0.01, -0.015, 0.02;
  const SmallFrame current = small_frame(se3_exp(xi), 0);
  const Pose T = se3_exp(xi);
  const auto residuals = [&](int x, int y, const Twist& d, WarpedPixel& p) {
    const Pose moved = se3_exp(d) * T;
    return warp_pixel(current, x, y, past, c, FloatPose(moved), p);
  };
  int checked = 0;
  for (int y = 5; y < 115; y += 7) {
    for (int x = 5; x < 155; x += 9) {
      WarpedPixel p;
      if (!residuals(x, y, Twist::Zero(), p)) continue;
      Eigen::Matrix<float, 2, 6> J;
      J.row(0) << p.a_intensity.transpose(), p.Y.cross(p.a_intensity).transpose();
      J.row(1) << p.a_depth.transpose(), p.Y.cross(p.a_depth).transpose();
      // within one cell of the past image the sampler is bilinear; steps that leave the cell are left out
      const double h = 2e-4;
      bool inside = true;
      Eigen::Matrix<double, 2, 6> numeric;
      for (int k = 0; k < 6; ++k) {
        Twist d = Twist::Zero();
        d[k] = h;
        WarpedPixel plus, minus;
        inside = inside && residuals(x, y, d, plus) && residuals(x, y, -d, minus);
        if (!inside) break;
        const auto cell = [&](const WarpedPixel& q) {
          const Eigen::Vector2d u = c.project(q.Y.cast<double>());
          return Eigen::Vector2i(static_cast<int>(u.x()), static_cast<int>(u.y()));
        };
        inside = cell(plus) == cell(p) && cell(minus) == cell(p);
        if (!inside) break;
        numeric(0, k) = static_cast<double>(plus.r_intensity - minus.r_intensity) / (2 * h);
        numeric(1, k) = static_cast<double>(plus.r_depth - minus.r_depth) / (2 * h);
      }
      if (!inside) continue;
      ++checked;
      // float residuals of about 3 have an error of 3e-7; over 2h that is 1e-3
      CHECK((J.cast<double>() - numeric).norm() < 0.01 * std::max(1.0, numeric.norm()));
    }
  }
  CHECK(checked > 50);
}

TEST_CASE("low-res alignment: a wrong prior is corrected, and a mask keeps what moves out") {
  const Pinhole c = reduced_camera(camera(), 2);
  Twist xi;
  xi << 0.03, -0.02, 0.02, 0.01, -0.01, 0.012;
  const Pose T_past_current = se3_exp(xi);
  const SmallFrame past = small_frame(Pose::Identity(), 1.0);
  const SmallFrame current = small_frame(T_past_current, 1.0);
  std::vector<float> scratch;
  const LowResAlignment a = align_low_res(current, past, c, Pose::Identity(), nullptr, 8, scratch);
  REQUIRE(succeeded(a.status));
  const Pose error = inverse(T_past_current) * a.T_past_current;
  CHECK(error.translation().norm() < 0.005);
  CHECK(rotation_angle(error) < 0.002);
  const Image<float> nothing(c.width, c.height, 0.0F);
  const LowResAlignment none = align_low_res(current, past, c, Pose::Identity(), &nothing, 8, scratch);
  CHECK(none.status == Status::TooFewPixels);
  CHECK(none.T_past_current.isApprox(Pose::Identity()));
}

TEST_CASE("clusters cover the depth, stay within the asked number, and know their neighbours") {
  Scene s;
  s.render(Pose::Identity(), Slab{}, 0);
  Image<float> depth;
  const Pinhole c = reduced_camera(camera(), 2);
  BlockRows rows_of_blocks;
  reduce_depth(s.depth, 2, DepthRange{}, c.width, c.height, rows_of_blocks, depth);
  PointClusters k;
  cluster_points(depth, c, 6, 4, 4, k);
  REQUIRE(k.centre.size() == 24);
  int labelled = 0;
  bool all = true;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    all = all && (depth.data()[i] > 0) == (k.label.data()[i] != PointClusters::kNone);
    labelled += k.label.data()[i] != PointClusters::kNone ? 1 : 0;
  }
  CHECK(all);
  int sum = 0;
  int pairs = 0;
  for (std::size_t i = 0; i < 24; ++i) {
    sum += k.size[i];
    for (std::size_t j = 0; j < 24; ++j) {
      CHECK(k.neighbours[i * 24 + j] == k.neighbours[j * 24 + i]);
      pairs += k.neighbours[i * 24 + j];
    }
  }
  CHECK(sum == labelled);
  CHECK(pairs > 24);
}

TEST_CASE("probabilities of rest: closed form of two clusters, and neighbours pull together") {
  std::vector<float> b;
  const std::vector<std::uint8_t> apart{0, 0, 0, 0};
  const std::vector<std::uint8_t> together{0, 1, 1, 0};
  solve_rest({0.1F, -0.2F}, {0.5F, 0.5F}, apart, 0.5, 0.35, b);
  CHECK(b[0] == doctest::Approx(0.7));  // p + d / prior
  CHECK(b[1] == doctest::Approx(0.1));
  solve_rest({0.1F, -0.2F}, {0.5F, 0.5F}, together, 0.5, 0.35, b);
  // the sum of both is kept, the difference divided by 1 + 2 smooth / prior = 2.4
  CHECK(b[0] + b[1] == doctest::Approx(0.8));
  CHECK(b[0] - b[1] == doctest::Approx(0.6 / 2.4));
  solve_rest({1.0F, -1.0F}, {1.0F, 0.2F}, apart, 0.5, 0.35, b);
  CHECK(b[0] == 1.0F);
  CHECK(b[1] == 0.0F);
}

}  // namespace
