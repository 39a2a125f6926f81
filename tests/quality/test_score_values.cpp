// Scores of random frames against plain computations by their definitions, and what the options choose when nothing is set.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include <apso/quality/assessor.hpp>
#include <apso/quality/calibration.hpp>
#include <apso/quality/scores/camera_flow.hpp>
#include <apso/quality/scores/depth.hpp>
#include <apso/quality/scores/depth_change.hpp>
#include <apso/quality/scores/detection_change.hpp>
#include <apso/quality/scores/feature.hpp>
#include <apso/quality/scores/motion_change.hpp>
#include <apso/quality/scores/sharpness.hpp>
#include <apso/quality/scores/spatial.hpp>
#include <apso/quality/threshold.hpp>

using namespace apso;
using doctest::Approx;

namespace {
using Random = std::mt19937;
double uniform(Random& random, double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); }

Image<float> random_depth(Random& random, int width, int height, double holes) {
  Image<float> z(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      z(x, y) = uniform(random, 0, 1) < holes ? 0.F : static_cast<float>(2 + 0.01 * x + uniform(random, -0.02, 0.02));
  return z;
}
Image<float> random_mask(Random& random, int width, int height) {  // of coarse blocks, half of them dynamic
  Image<float> mask(width, height);
  std::vector<float> block(400);
  for (float& b : block) b = uniform(random, 0, 1) < 0.5 ? 0.2F : 0.8F;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) mask(x, y) = block[static_cast<std::size_t>(y / 9 * 20 + x / 11)];
  return mask;
}
Detection box(double x, double y, double w, double h, int class_id = 0) {
  Detection d;
  d.box = {static_cast<float>(x), static_cast<float>(y), static_cast<float>(w), static_cast<float>(h)};
  d.score = 0.9F;
  d.class_id = class_id;
  return d;
}
double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v.empty() ? 0 : v.size() % 2 ? v[v.size() / 2] : 0.5 * (v[v.size() / 2 - 1] + v[v.size() / 2]);
}
}  // namespace

TEST_CASE("depth change of random images is what its definition says, also with little in common") {
  Random random(1);
  const DepthChangeOptions o;
  for (const double holes : {0.0, 0.3, 0.7, 0.8}) {
    for (const bool masked : {false, true}) {
      const int width = 91, height = 62;  // no multiple of the stride
      const Image<float> a = random_depth(random, width, height, holes);
      Image<float> b = random_depth(random, width, height, holes);
      for (std::size_t i = 0; i < b.size(); i += 3) b.data()[i] *= 1.3F;
      for (std::size_t i = 0; i < b.size(); i += 7) b.data()[i] *= 2.5F;  // q is limited to 1
      const Image<float> mask = random_mask(random, width, height);
      DepthSamples r, c;
      sample_depth(a, none, r);
      if (masked) sample_depth(b, mask, c);
      else sample_depth(b, none, c);
      const DepthChangeMeasure m = depth_change(r, c, o);
      double sum = 0, sum_abs = 0, squares = 0;
      int common = 0, in_a = 0, in_b = 0;
      for (int y = 0; y < height; y += 4) {
        for (int x = 0; x < width; x += 4) {
          const bool of_a = a(x, y) > 0;
          const bool of_b = b(x, y) > 0 && b(x, y) <= DepthRange{}.max && !(masked && mask(x, y) >= 0.5F);
          in_a += of_a;
          in_b += of_b;
          if (!of_a || !of_b) continue;
          const double q = std::min(1.0, static_cast<double>(b(x, y)) / static_cast<double>(a(x, y)) - 1);
          ++common;
          sum += q;
          sum_abs += std::abs(q);
          squares += q * q;
        }
      }
      REQUIRE(common > 2);
      CHECK(r.valid == in_a);
      CHECK(c.valid == in_b);
      CHECK(m.common == common);
      CHECK(m.mean == Approx(sum_abs / common).epsilon(1e-5));
      CHECK(m.spread == Approx(std::sqrt(squares / common - sum * sum / common / common)).epsilon(1e-4));
      CHECK(m.overlap == Approx(std::min(1.0, common / (0.5 * std::min(in_a, in_b)))));
      if (holes > 0.6) CHECK(m.overlap < 0.95);
      CHECK(m.score.value() == Approx(1 - m.overlap * std::exp(-0.5 * (m.mean / o.scale_mean + m.spread / o.scale_spread))));
    }
  }
}

TEST_CASE("depth quality of random images is what its definition says, with either noise model") {
  Random random(2);
  for (const DepthNoise noise : {DepthNoise::Khoshelham, DepthNoise::Nguyen}) {
    for (const double holes : {0.0, 0.15, 0.3, 0.6}) {
      const int width = 83, height = 59;
      Image<float> z(width, height);
      for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
          z(x, y) = uniform(random, 0, 1) < holes ? 0.F : static_cast<float>(2.2 + (x / 20 % 2) + uniform(random, -0.05, 0.05));
      DepthQualityOptions o;
      o.noise = noise;
      const DepthScore s = depth_score(z, o);
      const auto sigma = [&](double depth) {
        return noise == DepthNoise::Nguyen ? 0.0012 + 0.0019 * (depth - 0.4) * (depth - 0.4) : std::max(0.001, 1.425e-3 * depth * depth);
      };
      int judged = 0, valid = 0, consistent = 0, smooth = 0, crosses = 0;
      for (int y = 8; y < height - 8; y += 4) {
        for (int x = 8; x < width - 8; x += 4) {
          ++judged;
          const double c = static_cast<double>(z(x, y));
          if (!(c > 0)) continue;
          ++valid;
          std::vector<double> near;
          int above = 0, below = 0;
          for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx)
              if (z(x + dx, y + dy) > 0) near.push_back(static_cast<double>(z(x + dx, y + dy)));
          for (const double v : near) {
            above += v > c + 3 * sigma(c);
            below += v < c - 3 * sigma(c);
          }
          const int n = static_cast<int>(near.size());
          consistent += n >= 6 && 2 * above <= n && 2 * below <= n;
          const double l = static_cast<double>(z(x - 1, y)), r = static_cast<double>(z(x + 1, y));
          const double u = static_cast<double>(z(x, y - 1)), d = static_cast<double>(z(x, y + 1));
          if (!(l > 0 && r > 0 && u > 0 && d > 0)) continue;
          ++crosses;
          const double limit = 3 * std::sqrt(6.0) * sigma(c) / (c * c);
          smooth += std::abs(1 / l + 1 / r - 2 / c) <= limit && std::abs(1 / u + 1 / d - 2 / c) <= limit;
        }
      }
      CAPTURE(holes);
      CHECK(s.judged == judged);
      CHECK(s.valid == valid);
      CHECK(s.S_cov == Approx(std::min(1.0, static_cast<double>(valid) / judged / 0.8)));
      CHECK(s.S_cons == Approx(static_cast<double>(consistent) / valid));
      CHECK(s.S_smo == Approx(crosses > 0 ? static_cast<double>(smooth) / crosses : 0.0));
      if (holes == 0.0) CHECK((s.S_cons > 0.1 && s.S_cons < 1 && s.S_smo > 0 && s.S_smo < 1));
    }
  }
}

TEST_CASE("motion change of random flows is what its definition says") {
  Random random(3);
  MotionScratch scratch;
  MotionChangeOptions o;
  o.flow = FlowKind::Raw;
  for (const int n : {1, 7, 40, 333}) {
    std::vector<Correspondence> matches;
    for (int i = 0; i < n; ++i) {
      const double x = uniform(random, 0, 320), y = uniform(random, 0, 240);
      matches.push_back({static_cast<float>(x), static_cast<float>(y), static_cast<float>(x + uniform(random, -20, 9)),
                         static_cast<float>(y + uniform(random, -5, 30))});
    }
    const int points = 3 * n;
    const MotionMeasure m = motion_change(matches, points, 320, 240, o, 0.07, scratch);
    std::vector<double> all;
    std::vector<std::vector<double>> cell(48);
    for (const Correspondence& c : matches) {
      const double flow = std::hypot(static_cast<double>(c.x) - static_cast<double>(c.reference_x),
                                     static_cast<double>(c.y) - static_cast<double>(c.reference_y)) /
                          400;
      all.push_back(flow);
      cell[static_cast<std::size_t>(static_cast<int>(c.reference_y / 40) * 8 + static_cast<int>(c.reference_x / 40))].push_back(flow);
    }
    std::sort(all.begin(), all.end());
    const auto cut = static_cast<std::size_t>(kFlowTrim * n);
    double sum = 0, medians = 0;
    for (std::size_t i = cut; i < all.size() - cut; ++i) sum += all[i];
    int cells = 0;
    for (const auto& c : cell)
      if (c.size() >= 3) medians += median(c), ++cells;
    CHECK(m.tracks == n);
    CHECK(m.cells == cells);
    CHECK(m.m_point == Approx(sum / static_cast<double>(all.size() - 2 * cut)).epsilon(1e-6));
    CHECK(m.m_grid == Approx(cells > 0 ? medians / cells : m.m_point).epsilon(1e-6));
    CHECK(m.overlap == Approx(std::min(1.0, n / (kFullTrackOverlap * points))));
    CHECK(m.score.value() == Approx(1 - m.overlap * std::exp(-0.5 * (m.m_point + m.m_grid) / 0.07)));
  }
}

TEST_CASE("objects found again are those of a search that takes the largest overlap first") {
  Random random(4);
  for (int round = 0; round < 60; ++round) {
    std::vector<Detection> a, b;
    for (int i = 0; i < round % 7; ++i)
      a.push_back(box(uniform(random, 0, 60), uniform(random, 0, 60), uniform(random, 20, 60), uniform(random, 20, 60), i % 2));
    for (int i = 0; i < (3 * round) % 8; ++i)
      b.push_back(box(uniform(random, 0, 60), uniform(random, 0, 60), uniform(random, 20, 60), uniform(random, 20, 60), i % 2));
    const DetectionMeasure m = detection_change(a, b);
    std::vector<bool> used_a(a.size()), used_b(b.size());
    int matched = 0;
    double sum = 0;
    for (;;) {
      double best = 0;
      std::size_t bi = 0, bj = 0;
      for (std::size_t i = 0; i < a.size(); ++i) {
        for (std::size_t j = 0; j < b.size(); ++j) {
          if (used_a[i] || used_b[j] || a[i].class_id != b[j].class_id) continue;
          const Box &p = a[i].box, &q = b[j].box;
          const double w = static_cast<double>(std::min(p.x + p.width, q.x + q.width) - std::max(p.x, q.x));
          const double h = static_cast<double>(std::min(p.y + p.height, q.y + q.height) - std::max(p.y, q.y));
          const double common = w > 0 && h > 0 ? w * h : 0;
          const double overlap = common / (static_cast<double>(p.width * p.height + q.width * q.height) - common);
          if (overlap > best) best = overlap, bi = i, bj = j;
        }
      }
      if (best < 0.1) break;
      used_a[bi] = used_b[bj] = true;
      ++matched;
      sum += best;
    }
    CHECK(m.matched == matched);
    CHECK(m.iou_sum == Approx(sum).epsilon(1e-5));
    const double larger = static_cast<double>(std::max(a.size(), b.size()));
    const double difference = std::abs(static_cast<double>(a.size()) - static_cast<double>(b.size()));
    CHECK(m.score.value() == Approx(larger > 0 ? 0.5 * (difference / larger + 1 - sum / larger) : 0).epsilon(1e-5));
  }
}

TEST_CASE("static keypoints are counted cell by cell, and masked cells do not take part") {
  Random random(5);
  for (const bool masked : {false, true}) {
    const int width = 200, height = 150;
    std::vector<Keypoint> points;
    for (int i = 0; i < 160; ++i)
      points.push_back({static_cast<float>(uniform(random, -20, 220)), static_cast<float>(uniform(random, -20, 170)),
                        static_cast<float>(uniform(random, 1, 60)), 0, 0});
    Image<float> mask = random_mask(random, width, height);
    FeatureScratch scratch;
    const FeatureMeasure m =
        masked ? measure_features(points, mask, width, height, {}, scratch) : measure_features(points, none, width, height, {}, scratch);
    std::vector<double> responses;
    std::vector<int> count(48), samples(48), still(48);
    int inside = 0;
    for (const Keypoint& k : points) {
      const long x = std::lround(k.x), y = std::lround(k.y);
      if (x < 0 || y < 0 || x >= width || y >= height) continue;
      ++inside;
      if (masked && mask(static_cast<int>(x), static_cast<int>(y)) >= 0.5F) continue;
      responses.push_back(static_cast<double>(k.response));
      ++count[static_cast<std::size_t>(y * 6 / height * 8 + x * 8 / width)];
    }
    int all_still = 0, all = 0;
    for (int y = 2; y < height; y += 4) {
      for (int x = 2; x < width; x += 4) {
        const auto g = static_cast<std::size_t>(y * 6 / height * 8 + x * 8 / width);
        const bool is_still = !masked || mask(x, y) < 0.5F;
        ++samples[g], ++all;
        still[g] += is_still;
        all_still += is_still;
      }
    }
    int valid = 0, occupied = 0, sum = 0;
    double squares = 0, entropy = 0;
    for (std::size_t g = 0; g < 48; ++g) {
      if (2 * still[g] < samples[g]) continue;
      ++valid;
      occupied += count[g] > 0;
      sum += count[g];
      squares += count[g] * count[g];
    }
    for (std::size_t g = 0; g < 48; ++g) {
      if (2 * still[g] < samples[g] || count[g] == 0) continue;
      entropy -= static_cast<double>(count[g]) / sum * std::log(static_cast<double>(count[g]) / sum);
    }
    CHECK(m.keypoints == inside);
    CHECK(m.static_keypoints == static_cast<int>(responses.size()));
    CHECK(m.median_response == Approx(median(responses)));
    CHECK(m.valid_cells == valid);
    CHECK(m.occupied_cells == occupied);
    CHECK(m.entropy == Approx(entropy / std::log(valid)));
    CHECK(m.occupancy == Approx(static_cast<double>(occupied) / valid));
    CHECK(m.participation == Approx(sum * static_cast<double>(sum) / (valid * squares)));
    if (masked) CHECK((valid > 10 && valid < 40));
    if (masked) CHECK(detail::find_static_cells(mask, width, height, scratch) == Approx(static_cast<double>(all_still) / all));
  }
}

TEST_CASE("spread by covering counts the static part of the image as all of it") {
  // a lattice on the left half; the right half is masked: perfectly spread, as on an image of half the size
  std::vector<Keypoint> points;
  for (int y = 0; y < 12; ++y)
    for (int x = 0; x < 8; ++x) points.push_back({20.F + 40.F * static_cast<float>(x), 20.F + 40.F * static_cast<float>(y), 30, 0, 0});
  Image<float> mask(640, 480, 0.F);
  for (int y = 0; y < 480; ++y)
    for (int x = 320; x < 640; ++x) mask(x, y) = 1.F;
  FeatureOptions o;
  o.uniformity = Uniformity::Covering;
  FeatureScratch scratch;
  CHECK(measure_features(points, mask, 640, 480, o, scratch).spread > 0.95);
  CHECK(measure_features(points, none, 640, 480, o, scratch).spread == Approx(std::sqrt(0.5)).epsilon(0.05));
  CHECK(feature_score(measure_features(points, mask, 640, 480, o, scratch), 30, o).S_unif > 0.95);
}

TEST_CASE("sharpness is the ratio of fine to coarse contrast, from the smallest image that has both") {
  Random random(6);
  for (const auto& [width, height] : {std::pair{65, 70}, std::pair{131, 97}}) {
    Image<float> im(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        im(x, y) = static_cast<float>(0.5 + 0.2 * std::sin(0.1 * x) * std::cos(0.13 * y) + uniform(random, -0.03, 0.03));
    const SharpnessMeasure m = measure_sharpness(im);
    REQUIRE(m.valid);
    double fx = 0, cx = 0, fy = 0, cy = 0;
    int n = 0;
    for (int y = 0; y + 32 < height; y += 4) {
      for (int x = 0; x < (width - 32) / 8 * 8; ++x) {
        const auto square = [&](int dx, int dy) {
          return std::pow(static_cast<double>(im(x + dx, y + dy)) - static_cast<double>(im(x, y)), 2);
        };
        fx += square(4, 0), cx += square(32, 0), fy += square(0, 4), cy += square(0, 32);
        ++n;
      }
    }
    const double noise = 2 * kImageNoise * kImageNoise;
    CHECK(m.ratio_x == Approx((fx / n - noise) / (cx / n - noise)).epsilon(1e-4));
    CHECK(m.ratio_y == Approx((fy / n - noise) / (cy / n - noise)).epsilon(1e-4));
  }
  const auto slope = [](int width, int height) {
    Image<float> im(width, height);
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) im(x, y) = 0.003F * static_cast<float>(x + y);
    return measure_sharpness(im).valid;
  };
  CHECK(slope(65, 65));
  CHECK_FALSE(slope(64, 200));
  CHECK_FALSE(slope(200, 64));
  // the worse direction counts, and a typical ratio below the least is none
  SharpnessMeasure m;
  m.ratio_x = 0.10;
  m.ratio_y = 0.02;
  CHECK(sharpness_score(m, 0.25, 0.20).value() == Approx(0.2));
  CHECK(sharpness_score(m, 0.50, 0.05).value() == Approx(0.4));
  CHECK(sharpness_score({0.004, 0.9, true}, 0.001, 0.001).value() == Approx(0.4));
}

TEST_CASE("background availability is the weighted share of pixels that no object covers") {
  Random random(7);
  std::vector<float> scratch;
  for (const auto& [width, height] : {std::pair{101, 77}, std::pair{160, 120}, std::pair{9, 90}}) {
    for (int round = 0; round < 8; ++round) {
      const Detection d =
          box(uniform(random, -20, 0.8 * width), uniform(random, -20, 0.8 * height), uniform(random, 5, width), uniform(random, 5, height));
      for (const double kappa : {0.5, std::numeric_limits<double>::infinity()}) {
        double hidden = 0, all = 0;
        for (int y = 0; y < height; ++y) {
          for (int x = 0; x < width; ++x) {
            const double dx = x + 0.5 - 0.5 * width, dy = y + 0.5 - 0.5 * height;
            const double w = std::exp(-(dx * dx + dy * dy) / (2 * kappa * kappa * 0.25 * (width * width + height * height)));
            const auto covered = [](double i, double low, double length) {
              return std::clamp(std::min(i + 1, low + length) - std::max(i, low), 0.0, 1.0);
            };
            all += w;
            hidden += w * covered(x, static_cast<double>(d.box.x), static_cast<double>(d.box.width)) *
                      covered(y, static_cast<double>(d.box.y), static_cast<double>(d.box.height));
          }
        }
        const double score = spatial_score({d}, width, height, {}, scratch, kappa)->value();
        CHECK(score == Approx(1 - hidden / all).epsilon(std::isinf(kappa) ? 1e-4 : 0.02));
      }
    }
  }
  // two objects that cover the same pixels hide no more than one
  const Detection d = box(16, 16, 48, 48);
  CHECK(spatial_score({d, d}, 160, 120)->value() == spatial_score({d}, 160, 120)->value());
  Detection fixed = box(0, 0, 160, 120);
  fixed.movable = false;
  CHECK(spatial_score({fixed, d}, 160, 120)->value() == spatial_score({d}, 160, 120)->value());
}

TEST_CASE("an object is seen best in the middle, whole, and neither small nor near") {
  SpatialOptions o;
  o.form = SpatialForm::ObjectObservability;
  const auto centred = [&](double share) {  // of a square image
    const double side = 200 * std::sqrt(share);
    return spatial_score({box(100 - side / 2, 100 - side / 2, side, side)}, 200, 200, o)->value();
  };
  CHECK(centred(0.001) == 0);
  CHECK(centred(0.011) == Approx(0.5).epsilon(1e-3));
  CHECK(centred(0.02) == Approx(1).epsilon(1e-3));
  CHECK(centred(0.35) == Approx(1).epsilon(1e-3));
  CHECK(centred(0.575) == Approx(0.5).epsilon(1e-3));
  CHECK(centred(0.8) == Approx(0).epsilon(1e-3));
  // 3 : 4 : 5, off by half of the half diagonal: a quarter less
  CHECK(spatial_score({box(320 + 160 - 30, 240 + 120 - 30, 60, 60)}, 640, 480, o)->value() ==
        Approx((60. * 60 / 640 / 480 - 0.002) / 0.018 * 0.75).epsilon(1e-4));
  // the mean of all that can move
  Detection fixed = box(0, 0, 1, 1);
  fixed.movable = false;
  CHECK(spatial_score({box(80, 80, 40, 40), box(500, 500, 5, 5), fixed}, 200, 200, o)->value() == Approx(0.5).epsilon(1e-3));
}

TEST_CASE("the affine flow of most points is not drawn away by the others, whichever way these move") {
  std::vector<Correspondence> matches;
  for (const bool along_x : {true, false}) {
    Random random(8);
    matches.clear();
    for (int i = 0; i < 200; ++i) {
      const double x = uniform(random, 0, 640), y = uniform(random, 0, 480);
      double u = x + 3 + 0.01 * x - 0.02 * y;
      double v = y - 2 + 0.015 * x + 0.005 * y;
      if (i % 5 == 0) (along_x ? u : v) += 40;
      matches.push_back({static_cast<float>(x), static_cast<float>(y), static_cast<float>(u), static_cast<float>(v)});
    }
    const Eigen::Matrix<double, 2, 3> A = affine_flow(matches);
    CHECK(A(0, 2) == Approx(3).epsilon(0.05));
    CHECK(A(1, 2) == Approx(-2).epsilon(0.05));
    CHECK(A(0, 0) == Approx(0.01).epsilon(0.05));
    CHECK(A(0, 1) == Approx(-0.02).epsilon(0.05));
    CHECK(A(1, 0) == Approx(0.015).epsilon(0.05));
    CHECK(A(1, 1) == Approx(0.005).epsilon(0.05));
  }
  matches.resize(5);
  CHECK(affine_flow(matches).isZero());
  matches.assign(6, {1, 2, 4, 6});  // one place: what it moves by
  const Eigen::Matrix<double, 2, 3> B = affine_flow(matches);
  CHECK(B(0, 0) * 1 + B(0, 1) * 2 + B(0, 2) == Approx(3).epsilon(1e-3));
}

namespace {
/// Frames of a small camera with 100 keypoints, 25 of them on a moving half of the image.
struct SmallScene {
  Pinhole camera{100, 100, 39.5, 29.5, 80, 60};
  Image<float> depth{80, 60, 2.F};
  Image<float> mask{80, 60, 0.F};
  std::vector<Keypoint> keypoints;
  std::vector<Detection> objects{3};
  double t = 0;
  SmallScene() {
    for (int i = 0; i < 100; ++i)
      keypoints.push_back({static_cast<float>((i < 25 ? 60 : 2) + i % 15), static_cast<float>(2 + i / 2), 30, 0, 0});
    for (int y = 0; y < 60; ++y)
      for (int x = 50; x < 80; ++x) mask(x, y) = 1.F;
    objects[0].motion_probability = 0.9F;
    for (Detection& d : objects) d.box = {50, 0, 30, 60};
  }
  AssessmentInput input() {
    AssessmentInput in;
    in.frame = {t += 0.1, {}, depth};
    in.dynamic_probability = mask;
    in.dynamic_ratio = 0.375;
    in.keypoints = &keypoints;
    in.objects = &objects;
    return in;
  }
};
double dynamic_ratio_by(DynamicRatio kind, const AssessmentInput& in, const Pinhole& camera) {
  AssessorOptions o;
  o.dynamic_ratio = kind;
  SceneAssessor assessor(camera, o);
  return assessor.assess(in).dynamic_ratio;
}
}  // namespace

TEST_CASE("the dynamic ratio is the share of the image, of the keypoints, the larger of both, or of the objects") {
  SmallScene s;
  const AssessmentInput in = s.input();
  CHECK(dynamic_ratio_by(DynamicRatio::MaskArea, in, s.camera) == Approx(0.375));
  CHECK(dynamic_ratio_by(DynamicRatio::Features, in, s.camera) == Approx(0.25));
  CHECK(dynamic_ratio_by(DynamicRatio::Max, in, s.camera) == Approx(0.375));
  CHECK(dynamic_ratio_by(DynamicRatio::Count, in, s.camera) == Approx(1. / 3));
  AssessmentInput other = in;
  other.dynamic_ratio = 0.1;
  CHECK(dynamic_ratio_by(DynamicRatio::Max, other, s.camera) == Approx(0.25));
  other.objects = nullptr;
  other.keypoints = nullptr;
  CHECK(dynamic_ratio_by(DynamicRatio::Count, other, s.camera) == 0);
  CHECK(dynamic_ratio_by(DynamicRatio::Features, other, s.camera) == 0);
}

TEST_CASE("what an assessment tells before anything was found") {
  const Assessment a;
  CHECK_FALSE(a.scenario_static);
  CHECK_FALSE(a.scenario_dynamic);
  CHECK_FALSE(a.scenario_objects);
  CHECK_FALSE(a.benchmark_updated);
  CHECK_FALSE(a.degraded);
  CHECK_FALSE(a.initialisation_failed);
  CHECK_FALSE(a.feature_pose_refused);
  const Decision d;
  CHECK_FALSE(d.scenario_static);
  CHECK_FALSE(d.scenario_dynamic);
  CHECK_FALSE(d.scenario_objects);
  CHECK_FALSE(d.good);
  SmallScene s;
  SceneAssessor assessor(s.camera);
  for (int i = 0; i < 3; ++i) {  // none of it is decided while the first reference is sought
    const Assessment& b = assessor.assess(s.input());
    CHECK_FALSE(b.scenario_static);
    CHECK_FALSE(b.scenario_dynamic);
    CHECK_FALSE(b.scenario_objects);
    CHECK(b.state == SceneState::Initialising);
    CHECK(b.W_base + b.W_change == Approx(1));
    CHECK(b.frame == i + 1);
  }
}

TEST_CASE("the threshold stays as set unless calibration is asked for, and then follows the last frames") {
  DecisionOptions o;
  const auto after = [](const DecisionOptions& options, int frames, double S) {
    DecisionThreshold t(options);
    for (int i = 0; i < frames; ++i) t.remember(Quality(S + (i % 2 ? 0.01 : -0.01)), true);
    return t.value();
  };
  CHECK(after(o, 400, 0.6) == o.th_differ);
  o.auto_calibrate = true;
  CHECK(after(o, 299, 0.6) == o.th_differ);
  CHECK(after(o, 300, 0.6) == Approx(0.6 - 4 * 1.4826 * 0.01).epsilon(0.03));
  CHECK(after(o, 300, 0.2) == kLowestThreshold);
  CHECK(after(o, 300, 0.98) == kHighestThreshold);
  DecisionThreshold t(o);
  for (int i = 0; i < 300; ++i) t.remember(Quality(0.2), true);
  CHECK(t.value() == kLowestThreshold);
  t.reset();
  CHECK(t.value() == o.th_differ);
}

TEST_CASE("the scale of flows is that of the baseline") {
  Pinhole camera{100, 100, 159.5, 119.5, 320, 240};
  MotionChange score;
  score.options.scale = 0.1;
  score.options.scale_previous = 0.02;
  score.options.flow = FlowKind::Raw;
  MotionChange::Memory before, now;
  before.present = now.present = true;
  for (int i = 0; i < 30; ++i) {
    before.points.push_back({i, 100.F + static_cast<float>(i), 100, 0});
    now.points.push_back({i, 108.F + static_cast<float>(i), 100, 0});  // 8 px of a diagonal of 400
  }
  using Context = ChangeContext<MotionChange::Memory>;
  CHECK(score(Context{before, now, camera, ChangeBaseline::Reference})->value() == Approx(1 - std::exp(-0.2)).epsilon(1e-4));
  CHECK(score(Context{before, now, camera, ChangeBaseline::Previous})->value() == Approx(1 - std::exp(-1.)).epsilon(1e-4));
  now.points.erase(now.points.begin(), now.points.begin() + 20);
  before.points.erase(before.points.begin() + 25, before.points.end());
  CHECK(score(Context{before, now, camera, ChangeBaseline::Reference}).has_value());
  CHECK(score.measured.tracks == 5);
  CHECK(score.measured.reference_points == 25);
  CHECK(MotionChange::reason(Deviation(0), score.measured) == "20 % of the reference's 25 points tracked");
  // either frame may lack what is compared
  for (MotionChange::Memory* lacking : {&before, &now}) {
    lacking->present = false;
    CHECK_FALSE(score(Context{before, now, camera, ChangeBaseline::Reference}).has_value());
    lacking->present = true;
  }
  score.options.flow = FlowKind::PosePredicted;
  for (MotionChange::Memory* posed : {&before, &now}) {
    posed->has_pose = true;
    CHECK_FALSE(score(Context{before, now, camera, ChangeBaseline::Reference}).has_value());
    posed->has_pose = false;
  }
}

TEST_CASE("a feature score without static keypoints knows no response") {
  FeatureMeasure m;
  m.median_response = 30;
  CHECK(feature_score(m, 40).S_resp == 0);
  m.static_keypoints = 1;
  CHECK(feature_score(m, 40).S_resp == Approx(0.75));
}

TEST_CASE("hard and other frames count the same in the loss of a calibration, however many there are") {
  std::vector<CalibrationSample> samples(7);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].hard = i < 2;
    samples[i].assessment.result<Depth>().value = Quality(i < 2 ? 0.65 : 0.75);
    samples[i].assessment.dynamic_ratio = 0.2;
  }
  const AssessorOptions o;
  const auto w = fit_weights(samples, o.frame_weights, o.change_weights, o.decision);
  CHECK(w.loss_before == Approx(2 * std::log1p(std::exp(-1.))).epsilon(1e-6));
  CHECK(w.steps == 0);  // no weight changes the only score there is
}

TEST_CASE("the threshold as printed begins at its first value and falls from the second frame on") {
  InitialisationOptions o;
  o.quality_threshold = QualityThreshold::Literal;
  AdaptiveThresholds t(o);
  t.next(1, -1);
  CHECK(t.quality() == o.quality);
  t.next(2, -1);
  CHECK(t.quality() == Approx(0.5 * 0.7 * std::log(15.)));
}

TEST_CASE("a search for a reference goes step by step") {
  InitialisationOptions o;
  o.frames = 4;
  o.frames_max = 12;
  o.quality = 0.7;
  o.quality_min = 0.3;
  Initialiser i(o);
  CHECK_FALSE(i.has_best());
  CHECK(i.offer(Quality(0.5)).new_best);
  CHECK_FALSE(i.offer(Quality(0.5)).new_best);
  CHECK_FALSE(i.offer(Quality(0.9), false).new_best);  // not usable
  CHECK(i.best().value() == 0.5);
  CHECK_FALSE(i.offer(Quality(0.4)).commit);  // the window closes, and 0.5 is too little
  CHECK(i.frames() == 4);
  int n = 4;
  for (Initialiser::Step s; n < 12; ++n) {
    s = i.offer(Quality(0.1));
    if (s.commit) {
      CHECK_FALSE(s.degraded);
      break;
    }
  }
  // th_s falls to 0.5 at n / 4 = exp(2 (1 - 0.5 / 0.7)) = 1.77: the eighth frame
  CHECK(n + 1 == 8);
  o.initial_frame = InitialFrame::FirstPassing;
  Initialiser first(o);
  CHECK_FALSE(first.offer(Quality(0.69)).commit);
  CHECK_FALSE(first.offer(Quality(0.9), false).commit);
  const Initialiser::Step passed = first.offer(Quality(0.71));
  CHECK(passed.commit);
  CHECK(passed.new_best);
  CHECK(first.best().value() == 0.71);
  o.initial_frame = InitialFrame::BestInWindow;
  Initialiser never(o);
  for (int k = 1; k <= 40; ++k) CHECK_FALSE(never.offer(Quality(0.9), false).commit);  // there is none to commit
}
