// Properties of the motion policy on rooms whose truth is known.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <apso/observation/geometry/flow_residual.hpp>
#include <apso/observation/geometry/track_claims.hpp>
#include <apso/observation/policies/geometric_motion.hpp>

#include "scene.hpp"

namespace {
using namespace apso;
using observation_test::camera;
using observation_test::hand_held;
using observation_test::Scene;
using observation_test::Slab;

struct Score {
  double recall = 0, precision = 0, share = 0, iou = 0;
};
Score score(const DynamicMask& m, const Image<std::uint8_t>& truth) {
  double both = 0, mask = 0, real = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const bool a = m.probability.data()[i] >= 0.5F;
    const bool b = truth.data()[i] != 0;
    both += a && b ? 1 : 0;
    mask += a ? 1 : 0;
    real += b ? 1 : 0;
  }
  return {real > 0 ? both / real : 1, mask > 0 ? both / mask : 1, mask / static_cast<double>(truth.size()),
          both / std::max(1.0, mask + real - both)};
}

bool sane(const DynamicMask& m) {
  for (std::size_t i = 0; i < m.probability.size(); ++i) {
    const float p = m.probability.data()[i];
    if (!(p >= 0.0F && p <= 1.0F) || m.known.data()[i] > 1) return false;
  }
  return true;
}

GeometricMotionOptions undilated() {
  GeometricMotionOptions o;
  o.dilation = 0;
  return o;
}

Pose disturbed(const Pose& T, int k, double metres, double radians) {
  Twist n;
  n << metres * std::sin(1.0 + 3.1 * k), metres * std::sin(2.0 + 2.3 * k), metres * std::sin(3.0 + 1.7 * k),
      radians * std::sin(4.0 + 2.9 * k), radians * std::sin(5.0 + 1.3 * k), radians * std::sin(6.0 + 3.7 * k);
  return T * se3_exp(n);
}

TEST_CASE("without past views nothing is known and nothing is dynamic") {
  GeometricMotion motion(camera());
  Scene s;
  s.render(Pose::Identity(), Slab{});
  DynamicMask m;
  motion.observe(s.frame(0), Pose::Identity(), {}, m);
  CHECK(dynamic_ratio(m) == 0.0);
  CHECK(known_ratio(m) == 0.0);
}

TEST_CASE("a static scene stays static, with noise, with a wrong prior, at rest and in rotation") {
  for (int kind = 0; kind < 4; ++kind) {
    CAPTURE(kind);
    GeometricMotion motion(camera());
    Scene s;
    DynamicMask m;
    double worst = 0;
    for (int k = 0; k < 40; ++k) {
      const double t = k / 30.0;
      Pose T = kind == 0 ? Pose::Identity() : hand_held(3 * t);
      if (kind == 1) T.translation().setZero();  // rotation only
      s.render(T, Slab{});                       // the slab does not move: it is furniture
      motion.observe(s.frame(t), kind == 3 ? disturbed(T, k, 0.01, 0.005) : T, {}, m);
      motion.remember(s.frame(t), T, m);
      worst = std::max(worst, dynamic_ratio(m));
      CHECK(sane(m));
    }
    CHECK(worst < 0.01);
    CHECK(known_ratio(m) > 0.9);
  }
}

TEST_CASE("a moving slab is found, also with a wrong prior") {
  for (double error : {0.0, 1.0}) {
    CAPTURE(error);
    GeometricMotion motion(camera(), undilated());
    Scene s;
    DynamicMask m;
    double iou = 0;
    double recall = 0;
    int n = 0;
    for (int k = 0; k < 70; ++k) {
      const double t = k / 30.0;
      const Pose T = hand_held(t);
      Slab slab;
      slab.x = -1.4 + 0.8 * t;  // walks through the view at 0.8 m/s
      s.render(T, slab);
      motion.observe(s.frame(t), disturbed(T, k, 0.01 * error, 0.005 * error), {}, m);
      motion.remember(s.frame(t), T, m);
      if (k >= 30) {
        const Score q = score(m, s.truth);
        iou += q.iou;
        recall += q.recall;
        ++n;
      }
    }
    CHECK(iou / n > 0.7);
    CHECK(recall / n > 0.85);
  }
}

TEST_CASE("most of the view may move") {
  GeometricMotion motion(camera(), undilated());
  Scene s;
  DynamicMask m;
  double recall = 0;
  int n = 0;
  for (int k = 0; k < 60; ++k) {
    const double t = k / 30.0;
    const Pose T = hand_held(t);
    Slab slab;
    slab.z = 1.2;
    slab.width = 0.9;
    slab.x = -1.6 + 0.9 * t;
    s.render(T, slab);
    motion.observe(s.frame(t), T, {}, m);
    motion.remember(s.frame(t), T, m);
    if (score(m, s.truth).share > 0.4) {
      recall += score(m, s.truth).recall;
      ++n;
    }
  }
  REQUIRE(n > 5);
  CHECK(recall / n > 0.9);
}

TEST_CASE("what has stopped stays dynamic for a while and is then forgotten") {
  GeometricMotionOptions options = undilated();
  options.memory = 2.0;
  GeometricMotion motion(camera(), options);
  Scene s;
  DynamicMask m;
  double soon = -1;
  double late = -1;
  for (int k = 0; k < 210; ++k) {
    const double t = k / 30.0;
    Slab slab;
    slab.x = -1.4 + 0.8 * std::min(t, 1.6);
    s.render(Pose::Identity(), slab);
    motion.observe(s.frame(t), Pose::Identity(), {}, m);
    motion.remember(s.frame(t), Pose::Identity(), m);
    if (k == 63) soon = score(m, s.truth).recall;  // half a second after it stopped
    if (k == 209) late = score(m, s.truth).share;
  }
  CHECK(soon > 0.85);
  CHECK(late < 0.01);
}

TEST_CASE("the prior is corrected by the background") {
  GeometricMotion motion(camera());
  Scene s;
  DynamicMask m;
  double before = 0;
  double after = 0;
  for (int k = 0; k < 30; ++k) {
    const double t = k / 30.0;
    const Pose T = hand_held(t);
    Slab slab;
    slab.x = -1 + t;
    s.render(T, slab);
    const Pose prior = disturbed(T, k, 0.02, 0.01);
    motion.observe(s.frame(t), prior, {}, m);
    motion.remember(s.frame(t), T, m);
    if (k == 0) continue;
    before += rotation_angle(inverse(T) * prior);
    after += rotation_angle(inverse(T) * motion.refined_prior());
  }
  CHECK(after < 0.4 * before);
}

TEST_CASE("frames without depth are survived") {
  for (float hole : {0.0F, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1.0F}) {
    GeometricMotion motion(camera());
    Scene s;
    DynamicMask m;
    for (int k = 0; k < 8; ++k) {
      s.render(Pose::Identity(), std::nullopt);
      if (k % 3 == 1) {
        for (std::size_t i = 0; i < s.depth.size(); ++i) s.depth.data()[i] = hole;
      } else {
        for (int y = 50; y < 100; ++y)
          for (int x = 30; x < 130; ++x) s.depth(x, y) = hole;
      }
      const float nan = std::numeric_limits<float>::quiet_NaN();
      motion.observe(s.frame(k / 30.0), Pose::Identity(), {{1, nan, nan, nan, nan, 3}, {2, 1e9F, -1e9F, 5, 5, 2}}, m);
      motion.remember(s.frame(k / 30.0), Pose::Identity(), m);
      CHECK(sane(m));
      CHECK(is_finite(motion.refined_prior()));
      CHECK(dynamic_ratio(m) < 0.01);
    }
  }
}

TEST_CASE("two runs, and a run after reset, give the same bits") {
  const auto run = [](GeometricMotion& motion) {
    Scene s;
    DynamicMask m;
    std::vector<float> all;
    for (int k = 0; k < 20; ++k) {
      Slab slab;
      slab.x = -1 + 0.05 * k;
      s.render(hand_held(k / 30.0), slab);
      motion.observe(s.frame(k / 30.0), hand_held(k / 30.0), {}, m);
      motion.remember(s.frame(k / 30.0), motion.refined_prior(), m);
      all.insert(all.end(), m.probability.data(), m.probability.data() + m.probability.size());
    }
    return all;
  };
  GeometricMotion a(camera());
  GeometricMotion b(camera());
  const auto first = run(a);
  CHECK(first == run(b));
  a.reset();
  CHECK(a.reference_count() == 0);
  CHECK(first == run(a));
}

TEST_CASE("stamps that do not grow are taken as 30 frames per second") {
  GeometricMotion motion(camera());
  Scene s;
  DynamicMask m;
  for (int k = 0; k < 12; ++k) {
    s.render(Pose::Identity(), std::nullopt);
    motion.observe(s.frame(0), Pose::Identity(), {}, m);
    motion.remember(s.frame(0), Pose::Identity(), m);
  }
  CHECK(motion.reference_count() > 2);
}

TEST_CASE("a track that leaves its static prediction is a seed") {
  const Pinhole c = camera();
  Image<float> depth(80, 60, 2.0F);
  std::vector<PointTrack> tracks;
  for (int i = 0; i < 20; ++i) {
    const auto x = static_cast<float>(20 + 10 * i);
    tracks.push_back({i, x, 100, x, 100, 1});
  }
  tracks.push_back({99, 150, 60, 140, 60, 1});  // moves by 10 px
  tracks.push_back({100, 50, 60, 10, 60, 0});   // begins here: has no past
  std::vector<float> scratch;
  std::vector<FlowPoint> points;
  const auto moving = [&] { return std::count_if(points.begin(), points.end(), [](const FlowPoint& p) { return p.moving; }); };
  flow_residuals(tracks, c, Pose::Identity(), depth, 4, points);
  CHECK(points.size() == 21);
  mark_moving(3.0, 0.15, scratch, points);
  REQUIRE(moving() == 1);
  CHECK(points.back().moving);
  CHECK(points.back().x == 150);
  CHECK(points.back().dx == doctest::Approx(10));
  CHECK(points.back().residual == doctest::Approx(10));
  CHECK(points.back().inside);
  CHECK(track_support(points, 3.0) == doctest::Approx(20));
  // camera moves 0.1 m to the right: static points at 2 m move left by 260 * 0.1 / 2 = 13 px
  Pose T = Pose::Identity();
  T.translation().x() = -0.1;
  for (PointTrack& t : tracks) t.x = t.previous_x - 13;
  flow_residuals(tracks, c, T, depth, 4, points);
  mark_moving(3.0, 0.15, scratch, points);
  CHECK(moving() == 0);
  CHECK(points[0].expected == doctest::Approx(13));
  // 5 px are more than 3, but not more than half of the expected motion
  tracks[0].x += 5;
  flow_residuals(tracks, c, T, depth, 4, points);
  mark_moving(3.0, 0.5, scratch, points);
  CHECK(moving() == 0);
  mark_moving(3.0, 0.15, scratch, points);
  CHECK(moving() == 1);
}

TEST_CASE("a track on an edge is as static as its better half") {
  const Pinhole c = camera();
  Image<float> depth(80, 60, 4.0F);
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 40; ++x) depth(x, y) = 2.0F;  // a near surface that ends in the middle
  }
  Pose T = Pose::Identity();
  T.translation().x() = -0.1;
  // the corner of the near surface, seen where the depth is that of the far one: moves with the near one
  const std::vector<PointTrack> tracks{{1, 162 - 13, 100, 162, 100, 1}};
  std::vector<FlowPoint> points;
  flow_residuals(tracks, c, T, depth, 4, points);
  REQUIRE(points.size() == 1);
  CHECK(points[0].residual < 0.2F);
  CHECK_FALSE(points[0].inside);
}

TEST_CASE("surfaces go with the nearest track along them") {
  Image<float> depth(80, 60, 4.0F);
  for (int y = 20; y < 50; ++y) {
    for (int x = 30; x < 45; ++x) depth(x, y) = 2.0F;  // a body before a wall
  }
  const auto at = [](int x, int y, float dx, bool moving) {
    return FlowPoint{4.0F * static_cast<float>(x) + 1.5F, 4.0F * static_cast<float>(y) + 1.5F, dx, 0, std::abs(dx), 0, true, moving};
  };
  std::vector<FlowPoint> points{at(34, 25, 6, true), at(40, 30, 6, true), at(36, 40, 5, true)};
  for (int x = 4; x < 80; x += 8) points.push_back(at(x, 8, 0, false));
  Image<std::uint8_t> claims;
  RegionScratch scratch;
  claim_surfaces(points, depth, 4, 12, 0.4F, 3, claims, scratch);
  int body = 0;
  int wall = 0;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 80; ++x) (depth(x, y) < 3 ? body : wall) += claims(x, y) == 3 ? 1 : 0;
  }
  CHECK(body > 0.9 * 30 * 15);
  CHECK(wall == 0);
  CHECK(claims(4, 10) == kClaimedStatic);
  CHECK(claims(70, 55) == 0);  // out of reach
  SUBCASE("two tracks are not enough") {
    points.erase(points.begin());
    claim_surfaces(points, depth, 4, 12, 0.4F, 3, claims, scratch);
    CHECK(claims(36, 40) == 0);
  }
  SUBCASE("tracks that wander in all directions are not believed") {
    points[0].dx = -6;
    claim_surfaces(points, depth, 4, 12, 0.4F, 3, claims, scratch);
    CHECK(claims(36, 40) == 0);
  }
  SUBCASE("moving tracks on an edge say nothing") {
    points[0] = at(30, 25, 6, true);
    claim_surfaces(points, depth, 4, 12, 0.4F, 3, claims, scratch);
    CHECK(claims(36, 40) == 0);
  }
}

TEST_CASE("tracks find an object that has just begun to move, before it has left its place") {
  double recall[2] = {0, 0};
  for (int with = 0; with < 2; ++with) {
    GeometricMotion motion(camera(), undilated());
    Scene s;
    DynamicMask m;
    double worst = 0;
    for (int k = 0; k < 45; ++k) {
      const auto place = [](int i) { return i < 36 ? -0.3 : -0.3 + 0.3 * (i - 36) / 30.0; };  // rests, then 0.3 m/s
      Slab slab;
      slab.x = place(k);
      s.render(Pose::Identity(), slab);
      std::vector<PointTrack> tracks;
      for (int y = 20; with != 0 && y < 230; y += 10) {
        const auto fy = static_cast<float>(y);
        for (int x = 5; x < 320; x += 10) {  // background that is never covered
          const auto fx = static_cast<float>(x);
          if (x < 80 || x > 200) tracks.push_back({1000 * y + x, fx, fy, fx, fy, k});
        }
        for (int i = -2; i <= 2 && y > 40 && y < 220; ++i) {  // the slab at 2 m: 130 px per metre
          const auto x = static_cast<float>(159.5 + 130 * place(k) + 10 * i);
          const auto before = static_cast<float>(159.5 + 130 * place(k - 1) + 10 * i);
          tracks.push_back({1000 * y + 500 + i, x, fy, before, fy, k});
        }
      }
      motion.observe(s.frame(k / 30.0), Pose::Identity(), tracks, m);
      motion.remember(s.frame(k / 30.0), Pose::Identity(), m);
      if (k < 36) worst = std::max(worst, dynamic_ratio(m));
    }
    recall[with] = score(m, s.truth).recall;
    CHECK(worst < 0.01);
  }
  CHECK(recall[1] > 0.5);
  CHECK(recall[1] > recall[0] + 0.3);
}

TEST_CASE("wrong calls are refused") {
  GeometricMotionOptions o;
  o.references = 0;
  CHECK_THROWS_AS(GeometricMotion(camera(), o), contract_error);
  CHECK_THROWS_AS(GeometricMotion(Pinhole{}), contract_error);
  GeometricMotion motion(camera());
  Image<float> small(10, 10, 1.0F);
  DynamicMask m;
  CHECK_THROWS_AS(motion.observe(RgbdFrame{0, small, small}, Pose::Identity(), {}, m), contract_error);
  Scene s;
  s.render(Pose::Identity(), std::nullopt);
  set_unknown(3, 3, m);
  CHECK_THROWS_AS(motion.remember(s.frame(0), Pose::Identity(), m), contract_error);
  Pose nan = Pose::Identity();
  nan.translation().x() = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(motion.observe(s.frame(0), nan, {}, m), contract_error);
}

}  // namespace
