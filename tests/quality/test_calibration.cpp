// Blur, spread and residual flow by their properties; calibration on made-up samples.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <apso/quality/assessor.hpp>
#include <apso/quality/calibration.hpp>
#include <apso/quality/explain.hpp>
#include <apso/quality/scores/sharpness.hpp>
#include <apso/quality/scores/spread.hpp>

using namespace apso;
using doctest::Approx;

namespace {
/// Uniform numbers in [0,1), the same everywhere.
struct Lcg {
  std::uint32_t state = 1;
  float operator()() {
    state = state * 1664525U + 1013904223U;
    return static_cast<float>(state >> 8U) / 16777216.F;
  }
};

/// Rectangles of random grey values.
Image<float> rectangles(int width = 640, int height = 480) {
  Image<float> im(width, height, 0.5F);
  Lcg random;
  for (int i = 0; i < 250; ++i) {
    const int x0 = static_cast<int>(random() * static_cast<float>(width));
    const int y0 = static_cast<int>(random() * static_cast<float>(height));
    const int w = 8 + static_cast<int>(random() * 80.F);
    const int h = 8 + static_cast<int>(random() * 80.F);
    const float g = random();
    for (int y = y0; y < std::min(height, y0 + h); ++y)
      for (int x = x0; x < std::min(width, x0 + w); ++x) im(x, y) = g;
  }
  return im;
}
/// Mean of n pixels along (dx, dy).
Image<float> blurred(const Image<float>& im, int n, int dx, int dy) {
  Image<float> out(im.width(), im.height());
  for (int y = 0; y < im.height(); ++y) {
    for (int x = 0; x < im.width(); ++x) {
      float s = 0;
      for (int k = 0; k < n; ++k) {
        const int u = std::clamp(x + dx * (k - n / 2), 0, im.width() - 1);
        const int v = std::clamp(y + dy * (k - n / 2), 0, im.height() - 1);
        s += im(u, v);
      }
      out(x, y) = s / static_cast<float>(n);
    }
  }
  return out;
}
double sharpness(const Image<float>& im, const SharpnessMeasure& usual) {
  const SharpnessMeasure m = measure_sharpness(im);
  return m.valid ? sharpness_score(m, usual.ratio_x, usual.ratio_y).value() : -1;
}
}  // namespace

TEST_CASE("S_sharp falls with blur in any direction, and not with contrast or brightness") {
  const Image<float> im = rectangles();
  const SharpnessMeasure usual = measure_sharpness(im);
  REQUIRE(usual.valid);
  CHECK(sharpness(im, usual) == 1);
  for (const auto& way : {std::pair{1, 0}, std::pair{0, 1}, std::pair{1, 1}, std::pair{1, -1}}) {
    CAPTURE(way.first);
    CAPTURE(way.second);
    double last = 1.0001;
    for (const int n : {3, 9, 15, 25, 41}) {
      const double s = sharpness(blurred(im, n, way.first, way.second), usual);
      CHECK(s <= last);
      last = s;
      if (n == 3) CHECK(s == 1);
      if (n == 41) CHECK(s < 0.4);
    }
  }
  for (const float contrast : {0.5F, 0.2F}) {
    Image<float> pale = im;
    Image<float> pale_and_blurred = blurred(im, 41, 1, 0);
    for (std::size_t i = 0; i < pale.size(); ++i) pale.data()[i] = 0.3F + contrast * (im.data()[i] - 0.5F);
    for (std::size_t i = 0; i < pale.size(); ++i) {
      pale_and_blurred.data()[i] = 0.3F + contrast * (pale_and_blurred.data()[i] - 0.5F);
    }
    CHECK(sharpness(pale, usual) > 0.95);
    CHECK(sharpness(pale_and_blurred, usual) < 0.4);
  }
}

TEST_CASE("noise is not taken for sharpness, and what cannot be measured is not valid") {
  const Image<float> im = rectangles();
  const SharpnessMeasure usual = measure_sharpness(im);
  Image<float> noisy = blurred(im, 41, 1, 0);
  Lcg random;
  for (std::size_t i = 0; i < noisy.size(); ++i) noisy.data()[i] += 0.008F * 3.46F * (random() - 0.5F);
  CHECK(sharpness(noisy, usual) < 0.45);
  CHECK_FALSE(measure_sharpness(Image<float>(640, 480, 0.3F)).valid);
  CHECK_FALSE(measure_sharpness(Image<float>(1, 1, 0.3F)).valid);
  CHECK_FALSE(measure_sharpness({}).valid);
  for (const float v : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e30F}) {
    Image<float> bad = im;
    bad(100, 100) = v;
    const SharpnessMeasure m = measure_sharpness(bad);
    const double s = sharpness_score(m, usual.ratio_x, usual.ratio_y).value();
    CHECK((s >= 0 && s <= 1));
    CHECK(std::isfinite(m.ratio_x));
  }
  // a usual value of nothing at all is replaced by the floor
  CHECK(sharpness_score(usual, 0, 0).value() == 1);
}

TEST_CASE("the assessor finds heavy blur BAD although keypoints and tracks look fine, and says why") {
  const Image<float> sharp = rectangles();
  const Image<float> blur = blurred(sharp, 41, 1, 0);
  const Image<float> depth(640, 480, 2.F);
  std::vector<Keypoint> keypoints;
  std::vector<PointTrack> tracks;
  for (int i = 0; i < 960; ++i) {
    const float u = 8.F + 16.F * static_cast<float>(i % 40);
    const float v = 10.F + 20.F * static_cast<float>(i / 40);
    keypoints.push_back({u, v, 30, 0, 0});
    tracks.push_back({i, u, v, u, v, 5});
  }
  const auto states = [&](bool enabled) {
    AssessorOptions o;
    o.sharpness.enabled = enabled;
    SceneAssessor assessor({525, 525, 319.5, 239.5, 640, 480}, o);
    double t = 0;
    AssessmentInput in;
    in.keypoints = &keypoints;
    in.tracks = &tracks;
    std::string out;
    for (int n = 0; n < 60; ++n) {
      const bool spoilt = n == 50 || n == 51;
      in.frame = {t += 1.0 / 30, spoilt ? blur.view() : sharp.view(), depth.view()};
      const Assessment& a = assessor.assess(in);
      if (n < 40) continue;
      out += to_string(a.state)[0];
      if (spoilt && enabled) CHECK(explain(a).find("blurred") != std::string::npos);
    }
    return out;
  };
  CHECK(states(true) == "GGGGGGGGGGBBGGGGGGGG");
  CHECK(states(false) == "GGGGGGGGGGGGGGGGGGGG");
}

TEST_CASE("measures of spread: range, order, resolution") {
  Lcg random;
  std::vector<Keypoint> even, clustered, scattered;
  for (int i = 0; i < 300; ++i) {
    even.push_back(
        {16.F + 32.F * static_cast<float>(i % 20), 16.F + 32.F * static_cast<float>(i / 20), random(), 0, 0});
    scattered.push_back({640 * random(), 480 * random(), random(), 0, 0});
    clustered.push_back({300 + 20 * random(), 200 + 20 * random(), random(), 0, 0});
  }
  std::vector<int> kept;
  const auto covering = [&](std::vector<Keypoint> p, float scale = 1) {
    for (Keypoint& k : p) k.x *= scale, k.y *= scale;
    const int w = static_cast<int>(640 * scale), h = static_cast<int>(480 * scale);
    return covering_spread(p, 500, static_cast<double>(w) * h, w, h, kept);
  };
  CHECK(covering(even) > 0.97);
  CHECK(covering(clustered) < 0.1);
  CHECK(covering(even) > covering(scattered));
  CHECK(covering(scattered) > covering(clustered));
  CHECK(covering(scattered, 2) == Approx(covering(scattered)).epsilon(0.1));
  CHECK(covering({}) == 0);
  CHECK(covering({{5, 5, 1, 0, 0}}) == 0);
  CHECK(coverage_spread(even, 640, 480) > coverage_spread(clustered, 640, 480));
  CHECK(coverage_spread(clustered, 640, 480) < 0.1);
  CHECK(coverage_spread({}, 640, 480) == 0);
  CHECK(coverage_spread({{0, 0, 1, 0, 0}, {640, 480, 1, 0, 0}}, 640, 480) == 1);

  FeatureScratch scratch;
  for (const Uniformity u :
       {Uniformity::EntropyOccupancy, Uniformity::Participation, Uniformity::Coverage, Uniformity::Covering}) {
    FeatureOptions o;
    o.uniformity = u;
    const auto unif = [&](const std::vector<Keypoint>& p) {
      return feature_score(measure_features(p, {}, 640, 480, o, scratch), 1, o).S_unif;
    };
    CHECK(unif(even) > unif(clustered));
    CHECK((unif(even) <= 1 && unif(clustered) >= 0));
    CHECK(unif({}) == 0);
  }
}

TEST_CASE("the residual flow leaves out the motion of the camera but not what moves by itself") {
  MotionScratch scratch;
  MotionChangeOptions o;
  o.flow = FlowKind::Residual;
  Lcg random;
  std::vector<Correspondence> turn;
  for (int i = 0; i < 400; ++i) {
    const float x = 640 * random(), y = 480 * random();
    turn.push_back({x, y, x + 30 + 0.05F * y, y - 0.05F * x + 0.02F * y});  // shift, roll, zoom
  }
  CHECK(motion_change(turn, 400, 640, 480, o, 0.1, scratch).score.value() < 0.01);
  CHECK(motion_change(turn, 400, 640, 480, {}, 0.1, scratch).score.value() > 0.2);
  std::vector<Correspondence> mixed = turn;
  for (std::size_t i = 0; i < 120; ++i) mixed[i].x += 60;  // 30 % move otherwise
  CHECK(motion_change(mixed, 400, 640, 480, o, 0.1, scratch).score.value() > 0.1);
  for (const int n : {0, 1, 5}) {
    const std::vector<Correspondence> few(turn.begin(), turn.begin() + n);
    const double s = motion_change(few, 400, 640, 480, o, 0.1, scratch).score.value();
    CHECK((s >= 0 && s <= 1));
  }
  const float nan = std::numeric_limits<float>::quiet_NaN();
  mixed[7] = {nan, 1, 2, 3};
  mixed[8] = {1e30F, 1, -1e30F, 3};
  const double s = motion_change(mixed, 400, 640, 480, o, 0.1, scratch).score.value();
  CHECK((s >= 0 && s <= 1));
}

TEST_CASE("scales: 95 % of the calm frames get at most 0.3") {
  std::vector<CalibrationSample> calm;
  Lcg random;
  for (int i = 0; i < 1000; ++i) {
    CalibrationSample s;
    s.flow = 0.05 * static_cast<double>(random());
    s.step_flow = 0.1 * s.flow;
    s.depth_mean = 0.2 * static_cast<double>(random());
    if (i % 10 == 0) s.depth_mean = std::nan("");
    calm.push_back(s);
  }
  CalibrationSample hard;
  hard.flow = 99;
  hard.hard = true;
  calm.push_back(hard);
  const CalibratedScales c = calibrate_scales(calm);
  int above = 0;
  for (const auto& s : calm) above += !s.hard && motion_deviation(s.flow, s.flow, 1, c.motion).value() > 0.3 + 1e-9;
  CHECK(above == 50);
  CHECK(c.motion_previous == Approx(0.1 * c.motion));
  CHECK(c.depth_mean == Approx(0.19 / 0.3567).epsilon(0.02));
  CHECK(c.depth_spread == 0);  // never measured
}

TEST_CASE("th_differ by rule") {
  std::vector<double> s;
  for (int i = 0; i < 101; ++i) s.push_back(0.8 + 0.001 * (i - 50));  // MAD 0.025
  s.push_back(std::nan(""));
  CHECK(calibrate_threshold(s, 0, 1) == Approx(0.8 - 4 * 1.4826 * 0.025));
  CHECK(calibrate_threshold(s) == Approx(0.8 - 4 * 1.4826 * 0.025));
  CHECK(calibrate_threshold({0.95, 0.95, 0.95}) == 0.70);
  CHECK(calibrate_threshold({0.1, 0.1, 0.1}) == 0.45);
  CHECK(calibrate_threshold({}) == 0.70);
}

TEST_CASE("fitted weights lean on the component that tells hard frames apart, and stay weights") {
  std::vector<CalibrationSample> samples;
  Lcg random;
  for (int i = 0; i < 400; ++i) {
    CalibrationSample s;
    s.hard = i % 4 == 0;
    s.S_spatial = Quality(static_cast<double>(random()));
    s.S_feature = Quality(static_cast<double>(random()));
    s.S_depth = Quality(s.hard ? 0.1 : 0.95);  // the only one that knows
    s.S_mc = Deviation(static_cast<double>(random()));
    s.S_dc = Deviation(s.hard ? 0.9 : 0.1);
    s.S_dec = Deviation(static_cast<double>(random()));
    s.dynamic_ratio = 0.2;
    samples.push_back(s);
  }
  const DecisionOptions o;
  const FittedWeights w = fit_weights(samples, {}, {}, o);
  CHECK(w.loss < 0.7 * w.loss_before);
  CHECK(w.frame.depth > FrameWeights{}.depth);
  CHECK(w.change.depth > ChangeWeights{}.depth);
  CHECK(w.frame.conf + w.frame.spatial + w.frame.feature + w.frame.depth == Approx(1).epsilon(1e-9));
  CHECK(w.change.motion + w.change.depth + w.change.detection == Approx(1).epsilon(1e-9));
  for (const double v : {w.frame.conf, w.frame.spatial, w.frame.feature, w.frame.depth, w.change.motion, w.change.depth,
                         w.change.detection}) {
    CHECK(v >= 0.1 - 1e-9);
  }
  for (CalibrationSample& s : samples) s.hard = false;
  const FittedWeights same = fit_weights(samples, {}, {}, o);  // nothing to learn from
  CHECK(same.frame.depth == FrameWeights{}.depth);
  CHECK(same.steps == 0);
}
