// Blur, spread and residual flow by their properties; calibration on made-up samples.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <apso/quality/assessor.hpp>
#include <apso/quality/calibration.hpp>
#include <apso/quality/explain.hpp>
#include <apso/quality/scores/sharpness.hpp>
#include <apso/quality/scores/spread.hpp>

#include "uniform.hpp"

using namespace apso;
using doctest::Approx;

namespace {
/// Rectangles of random grey values.
Image<float> rectangles(int width = 640, int height = 480) {
  Image<float> im(width, height, 0.5F);
  Uniform<float> random;
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
double sharpness(const Image<float>& im, const SharpnessMeasure& typical) {
  const SharpnessMeasure m = measure_sharpness(im);
  return m.valid ? sharpness_score(m, typical.ratio_x, typical.ratio_y).value() : -1;
}
}  // namespace

TEST_CASE("S_sharp falls with blur in any direction, and not with contrast or brightness") {
  const Image<float> im = rectangles();
  const SharpnessMeasure typical = measure_sharpness(im);
  REQUIRE(typical.valid);
  CHECK(sharpness(im, typical) == 1);
  for (const auto& way : {std::pair{1, 0}, std::pair{0, 1}, std::pair{1, 1}, std::pair{1, -1}}) {
    CAPTURE(way.first);
    CAPTURE(way.second);
    double last = 1.0001;
    for (const int n : {3, 9, 15, 25, 41}) {
      const double s = sharpness(blurred(im, n, way.first, way.second), typical);
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
    CHECK(sharpness(pale, typical) > 0.95);
    CHECK(sharpness(pale_and_blurred, typical) < 0.4);
  }
}

TEST_CASE("noise is not taken for sharpness, and what cannot be measured is not valid") {
  const Image<float> im = rectangles();
  const SharpnessMeasure typical = measure_sharpness(im);
  Image<float> noisy = blurred(im, 41, 1, 0);
  Uniform<float> random;
  for (std::size_t i = 0; i < noisy.size(); ++i) noisy.data()[i] += 0.008F * 3.46F * (random() - 0.5F);
  CHECK(sharpness(noisy, typical) < 0.45);
  CHECK_FALSE(measure_sharpness(Image<float>(640, 480, 0.3F)).valid);
  CHECK_FALSE(measure_sharpness(Image<float>(1, 1, 0.3F)).valid);
  CHECK_FALSE(measure_sharpness(none).valid);
  for (const float v : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e30F}) {
    Image<float> bad = im;
    bad(100, 100) = v;
    const SharpnessMeasure m = measure_sharpness(bad);
    CHECK_FALSE(m.valid);
    CHECK(m.ratio_x == 0);
    CHECK(m.ratio_y == 0);
  }
  // a typical value of nothing at all is replaced by the floor
  CHECK(sharpness_score(typical, 0, 0).value() == 1);
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
    o.get<Feature>().sharpness = enabled;
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
  Uniform<float> random;
  std::vector<Keypoint> even, clustered, scattered;
  for (int i = 0; i < 300; ++i) {
    even.push_back({16.F + 32.F * static_cast<float>(i % 20), 16.F + 32.F * static_cast<float>(i / 20), random(), 0, 0});
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
  std::vector<Keypoint> sorted = scattered;
  (void)covering_spread(sorted, 500, 640.0 * 480.0, 640, 480, kept);
  CHECK(std::is_sorted(sorted.begin(), sorted.end(), [](const Keypoint& a, const Keypoint& b) { return a.response > b.response; }));
  CHECK(covering({{5, 5, 1, 0, 0}}) == 0);
  CHECK(coverage_spread(even, 640, 480) > coverage_spread(clustered, 640, 480));
  CHECK(coverage_spread(clustered, 640, 480) < 0.1);
  CHECK(coverage_spread({}, 640, 480) == 0);
  CHECK(coverage_spread({{0, 0, 1, 0, 0}, {640, 480, 1, 0, 0}}, 640, 480) == 1);

  FeatureScratch scratch;
  for (const Uniformity u : {Uniformity::EntropyOccupancy, Uniformity::Participation, Uniformity::Coverage, Uniformity::Covering}) {
    FeatureOptions o;
    o.uniformity = u;
    const auto unif = [&](const std::vector<Keypoint>& p) {
      return feature_score(measure_features(p, none, 640, 480, o, scratch), 1, o).S_unif;
    };
    CHECK(unif(even) > unif(clustered));
    CHECK(unif(even) > 0.5);
    CHECK(unif({}) == 0);
  }
}

TEST_CASE("the residual flow leaves out the motion of the camera but not what moves by itself") {
  MotionScratch scratch;
  MotionChangeOptions o;
  o.flow = FlowKind::Residual;
  Uniform<float> random;
  std::vector<Correspondence> turn;
  for (int i = 0; i < 400; ++i) {
    const float x = 640 * random(), y = 480 * random();
    turn.push_back({x, y, x + 30 + 0.05F * y, y - 0.05F * x + 0.02F * y});  // shift, roll, zoom
  }
  CHECK(motion_change(turn, 400, 640, 480, o, 0.1, scratch).score.value() < 0.01);
  CHECK(motion_change(turn, 400, 640, 480, {}, 0.1, scratch).score.value() > 0.2);
  std::vector<Correspondence> mixed = turn;
  for (std::size_t i = 0; i < 120; ++i) mixed[i].x += 60;  // 30 % move otherwise
  const MotionMeasure clean = motion_change(mixed, 400, 640, 480, o, 0.1, scratch);
  CHECK(clean.score.value() > 0.1);
  for (const int n : {0, 1, 5}) {
    const std::vector<Correspondence> few(turn.begin(), turn.begin() + n);
    // too few to find the camera's motion: all of the flow counts
    const double raw = motion_change(few, 400, 640, 480, {}, 0.1, scratch).m_point;
    CHECK(motion_change(few, 400, 640, 480, o, 0.1, scratch).m_point == raw);
  }
  const float nan = std::numeric_limits<float>::quiet_NaN();
  mixed[7] = {nan, 1, 2, 3};
  mixed[8] = {1e30F, 1, -1e30F, 3};
  const MotionMeasure spoilt = motion_change(mixed, 400, 640, 480, o, 0.1, scratch);
  CHECK(spoilt.m_point == Approx(clean.m_point).epsilon(0.05).scale(0));
}

TEST_CASE("scales: 95 % of the calm frames get at most 0.3") {
  std::vector<CalibrationSample> calm;
  Uniform<float> random;
  for (int i = 0; i < 1000; ++i) {
    CalibrationSample s;
    const double flow = 0.05 * static_cast<double>(random());
    ScoreResult<MotionChange>& motion = s.assessment.result<MotionChange>();
    motion.value = Deviation(0.1);
    motion.measured.flow = flow;
    motion.measured.overlap = 1;
    ScoreResult<MotionChange>& step = s.assessment.step_scores.get<MotionChange>();
    step.value = Deviation(0.1);
    step.measured.flow = 0.1 * flow;
    if (i % 10 != 0) {  // else without depth
      s.assessment.result<DepthChange>().value = Deviation(0.1);
      s.assessment.result<DepthChange>().measured.mean = 0.2 * static_cast<double>(random());
      s.assessment.result<DepthChange>().measured.spread = std::nan("");  // never measured
    }
    calm.push_back(s);
  }
  CalibrationSample hard = calm.front();
  hard.assessment.result<MotionChange>().measured.flow = 99;
  hard.hard = true;
  calm.push_back(hard);
  AssessorOptions o;
  calibrate_scales(calm, o);
  int above = 0;
  for (CalibrationSample& s : calm) {
    revalue(s, o);
    above += !s.hard && s.assessment.get<MotionChange>()->value() > 0.3 + 1e-3;
  }
  CHECK(above == Approx(50).epsilon(0.1));  // the scale is rounded to four places
  CHECK(o.get<MotionChange>().scale_previous == Approx(0.1 * o.get<MotionChange>().scale).epsilon(0.01));
  CHECK(o.get<DepthChange>().scale_mean == Approx(0.19 / 0.3567).epsilon(0.02));
  CHECK(o.get<DepthChange>().scale_spread == DepthChangeOptions{}.scale_spread);
}

TEST_CASE("the threshold found by calibration is the one that the decision finds by itself") {
  DecisionOptions o;
  o.auto_calibrate = true;
  o.th_static = 0;
  o.boost_object = 0;
  DecisionThreshold rule(o);
  std::vector<double> S_final;
  Uniform<float> random;
  for (int i = 0; i < 300; ++i) {
    S_final.push_back(0.75 + 0.1 * static_cast<double>(random()));
    rule.remember(Quality(S_final.back()), true);
  }
  CHECK(rule.value() < 0.70);
  CHECK(rule.value() > 0.45);
  CHECK(rule.value() == calibrate_threshold(S_final));
}

TEST_CASE("a table of scores and measurements holds all that calibration needs") {
  const Image<float> depth(640, 480, 2.F);
  std::vector<PointTrack> tracks;
  for (int i = 0; i < 400; ++i)
    tracks.push_back({i, 16.F + 30.F * static_cast<float>(i % 20), 10.F + 20.F * static_cast<float>(i / 20), 0, 0, 5});
  SceneAssessor assessor({525, 525, 319.5, 239.5, 640, 480});
  std::vector<CalibrationSample> measured, read;
  double largest = 0;
  for (int n = 0; n < 40; ++n) {
    for (PointTrack& t : tracks) t.x += 0.1F * static_cast<float>(n % 5);
    AssessmentInput in;
    in.frame = {n / 30.0, {}, depth};
    in.tracks = &tracks;
    measured.push_back({assessor.assess(in), false});
    std::map<std::string, double> table;
    for_each_score(measured.back().assessment,
                   [&](const char* name, const auto& v, double, Better) { table[name] = v ? *v : std::nan(""); });
    for_each_measurement(measured.back().assessment, [&](const std::string& name, double v) { table[name] = v; });
    CalibrationSample s;
    read_scores(s.assessment, [&](const std::string& name) { return table.at(name); });
    CHECK(s.assessment.get<MotionChange>() == measured.back().assessment.get<MotionChange>());
    CHECK_FALSE(s.assessment.get<Feature>());
    if (s.assessment.get<MotionChange>()) {  // what was measured gives the score again
      const double again = MotionChange::revalue(measured.back().assessment.result<MotionChange>().measured, {}).value();
      CHECK(again == Approx(s.assessment.get<MotionChange>()->value()));
      largest = std::max(largest, again);
    }
    read.push_back(s);
  }
  CHECK(largest > 0.01);
  AssessorOptions a, b;
  calibrate_scales(measured, a);
  calibrate_scales(read, b);
  CHECK(a.get<MotionChange>().scale_previous != MotionChangeOptions{}.scale_previous);
  CHECK(a.get<MotionChange>().scale_previous == b.get<MotionChange>().scale_previous);
  CHECK(a.get<MotionChange>().scale == b.get<MotionChange>().scale);
  CHECK(a.get<DepthChange>().scale_mean == b.get<DepthChange>().scale_mean);
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

TEST_CASE("fitted weights lean on the score that tells hard frames apart, and stay weights") {
  std::vector<CalibrationSample> samples;
  Uniform<float> random;
  for (int i = 0; i < 400; ++i) {
    CalibrationSample s;
    s.hard = i % 4 == 0;
    s.assessment.result<Spatial>().value = Quality(static_cast<double>(random()));
    s.assessment.result<Feature>().value = Quality(static_cast<double>(random()));
    s.assessment.result<Depth>().value = Quality(s.hard ? 0.1 : 0.95);  // the only one that knows
    s.assessment.result<MotionChange>().value = Deviation(static_cast<double>(random()));
    s.assessment.result<DepthChange>().value = Deviation(s.hard ? 0.9 : 0.1);
    s.assessment.result<DetectionChange>().value = Deviation(static_cast<double>(random()));
    s.assessment.dynamic_ratio = 0.2;
    samples.push_back(s);
  }
  const AssessorOptions o;
  const auto w = fit_weights(samples, o.frame_weights, o.change_weights, o.decision);
  CHECK(w.loss < 0.7 * w.loss_before);
  CHECK(w.frame.get<Depth>() > o.frame_weights.get<Depth>());
  CHECK(w.change.get<DepthChange>() > o.change_weights.get<DepthChange>());
  double sum = 0;
  for (const double v : w.frame.values()) {
    CHECK(v >= 0.1 - 1e-9);
    sum += v;
  }
  CHECK(sum == Approx(1).epsilon(1e-9));
  sum = 0;
  for (const double v : w.change.values()) {
    CHECK(v >= 0.1 - 1e-9);
    sum += v;
  }
  CHECK(sum == Approx(1).epsilon(1e-9));
  for (CalibrationSample& s : samples) s.hard = false;
  const auto same = fit_weights(samples, o.frame_weights, o.change_weights, o.decision);  // nothing to learn from
  CHECK(same.frame.get<Depth>() == o.frame_weights.get<Depth>());
  CHECK(same.steps == 0);
}
