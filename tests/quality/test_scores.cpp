// Scores of one frame: values computed by hand, ranges, monotonicity.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

#include <apso/quality/assessor_options.hpp>
#include <apso/quality/decision.hpp>
#include <apso/quality/scores/confidence.hpp>
#include <apso/quality/scores/depth.hpp>
#include <apso/quality/scores/depth_change.hpp>
#include <apso/quality/scores/detection_change.hpp>
#include <apso/quality/scores/feature.hpp>
#include <apso/quality/scores/motion_change.hpp>
#include <apso/quality/scores/spatial.hpp>
#include <apso/quality/threshold.hpp>
#include <apso/quality/weighted_mean.hpp>

using namespace apso;
using doctest::Approx;

// Mixing up the two kinds of score does not compile.
static_assert(!std::is_convertible_v<Quality, Deviation> && !std::is_convertible_v<Deviation, Quality>);
static_assert(!std::is_constructible_v<Quality, Deviation> && !std::is_constructible_v<Deviation, Quality>);
static_assert(!std::is_convertible_v<double, Quality> && !std::is_convertible_v<Quality, double>);
static_assert(!std::is_invocable_v<decltype(combine_final), Quality, MaybeQuality, double, ChangePolarity>);

namespace {
constexpr float kFloatNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

Detection object(float x, float y, float w, float h, float score = 0.9F, int class_id = 0) {
  Detection d;
  d.box = {x, y, w, h};
  d.score = score;
  d.class_id = class_id;
  return d;
}
/// Depth of a plane n . X = 1 seen by a 525 px camera: 1/z is linear in the pixel.
Image<float> plane(double a, double b, double c) {
  Image<float> z(640, 480);
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) {
      z(x, y) = static_cast<float>(1.0 / (a * (x - 319.5) / 525 + b * (y - 239.5) / 525 + c));
    }
  }
  return z;
}
FeatureMeasure spread(const std::vector<int>& counts) {
  FeatureMeasure m;
  measure_uniformity(counts, std::vector<int>(counts.size(), 1), m);
  return m;
}
}  // namespace

TEST_CASE("weighted mean leaves out what is missing") {
  const auto f = weighted_mean<Quality, 4>({std::nullopt, Quality(1), Quality(.5), Quality(.8)}, {.2, .2, .4, .2});
  REQUIRE(f);
  CHECK(f->value() == Approx(.7).epsilon(1e-12));
  CHECK_FALSE(weighted_mean<Quality, 2>({std::nullopt, std::nullopt}, {.5, .5}));
  CHECK_FALSE(weighted_mean<Quality, 2>({std::nullopt, Quality(1)}, {1, 0}));
  CHECK_THROWS_AS((void)(weighted_mean<Quality, 2>({Quality(1), Quality(1)}, {.5, .6})), contract_error);
  CHECK_THROWS_AS((void)(weighted_mean<Quality, 2>({Quality(1), Quality(1)}, {1.5, -.5})), contract_error);
  // no objects: (.1 + .55 * .95 + .2) / .85
  const auto total = weighted_mean<Quality, 4>({std::nullopt, Quality(1), Quality(.95), Quality(1)}, {.15, .10, .55, .20});
  CHECK(total->value() == Approx(.96765).epsilon(1e-5));
}

TEST_CASE("S_conf") {
  const std::vector<Detection> two{object(0, 0, 10, 10, .9F), object(20, 0, 30, 10, .5F)};
  ConfidenceOptions o;
  CHECK(confidence_score(two, 640, 480, o)->value() == Approx(.7));
  o.aggregation = ConfidenceAggregation::AreaWeighted;  // areas 100 and 300
  CHECK(confidence_score(two, 640, 480, o)->value() == Approx(.6));
  o.aggregation = ConfidenceAggregation::Min;
  CHECK(confidence_score(two, 640, 480, o)->value() == Approx(.5));
  o.aggregation = ConfidenceAggregation::GeometricMean;
  CHECK(confidence_score(two, 640, 480, o)->value() == Approx(std::sqrt(.45)));
  o.aggregation = ConfidenceAggregation::NoisyOr;
  CHECK(confidence_score(two, 640, 480, o)->value() == Approx(.95));
  CHECK_FALSE(confidence_score({}, 640, 480));
  o.without_objects = WithoutObjects::Neutral;
  CHECK(confidence_score({}, 640, 480, o)->value() == .5);
  CHECK_FALSE(confidence_score({object(0, 0, 1, 1, kFloatNaN)}, 640, 480));
  CHECK(confidence_score({object(0, 0, 1, 1, 7.F)}, 640, 480)->value() == 1.0);
  Detection wall = object(0, 0, 9, 9);
  wall.movable = false;
  CHECK_FALSE(confidence_score({wall}, 640, 480));
}

TEST_CASE("S_spatial, background availability") {
  CHECK(spatial_score({}, 640, 480)->value() == 1.0);
  CHECK(spatial_score({object(0, 0, 640, 480)}, 640, 480)->value() == Approx(0).epsilon(1e-6));
  CHECK(spatial_score({object(320, 0, 320, 480)}, 640, 480)->value() == Approx(.5).epsilon(1e-6));
  // a mask counts instead of the box
  Image<std::uint8_t> mask(640, 480, 0);
  for (int y = 0; y < 480; ++y)
    for (int x = 320; x < 640; ++x) mask(x, y) = 1;
  Detection d = object(0, 0, 640, 480);
  d.mask = mask.view();
  CHECK(spatial_score({d}, 640, 480)->value() == Approx(.5).epsilon(1e-6));
  // uniform weight: the plain share of the area; a size that the blocks do not divide
  std::vector<float> scratch;
  const double uniform = std::numeric_limits<double>::infinity();
  CHECK(spatial_score({object(0, 0, 101, 25)}, 101, 100, {}, scratch, uniform)->value() == Approx(.75).epsilon(1e-6));
  // centred objects hide more than those in a corner
  CHECK(spatial_score({object(270, 190, 100, 100)}, 640, 480)->value() < spatial_score({object(0, 0, 100, 100)}, 640, 480)->value());
  // removing an object never lowers the score
  std::vector<Detection> objects;
  double last = 1;
  for (int i = 0; i < 20; ++i) {
    objects.push_back(object(static_cast<float>(i * 67 % 500), static_cast<float>(i * 41 % 400), 90, 130));
    const double s = spatial_score(objects, 640, 480)->value();
    CHECK(s <= last);
    last = s;
  }
  for (const Detection& bad : {object(kFloatNaN, 0, 5, 5), object(-kInf, kFloatNaN, kInf, 3), object(5, 5, -3, -3)}) {
    CHECK(spatial_score({bad}, 640, 480)->value() == 1.0);  // hides nothing
    SpatialOptions o;
    o.form = SpatialForm::ObjectObservability;
    CHECK(spatial_score({bad}, 640, 480, o)->value() == 0.0);  // and cannot be observed
  }
  CHECK(spatial_score({object(0, 0, kInf, kInf)}, 640, 480)->value() == Approx(0));  // hides everything
}

TEST_CASE("S_spatial, object observability") {
  SpatialOptions o;
  o.form = SpatialForm::ObjectObservability;
  CHECK_FALSE(spatial_score({}, 640, 480, o));
  // 10 % of the image, in its centre, all visible: size = 1, e = 0, t = 1
  CHECK(spatial_score({object(240, 144, 160, 192)}, 640, 480, o)->value() == Approx(1).epsilon(1e-9));
  // the same moved so that half of it is outside: its centre lies on the left edge, e = 320/400
  CHECK(spatial_score({object(-80, 144, 160, 192)}, 640, 480, o)->value() == Approx(.5 * (1 - .5 * .8)).epsilon(1e-9));
}

TEST_CASE("uniformity of 48 cells") {
  std::vector<int> one(48, 0);
  one[7] = 33;
  FeatureMeasure m = spread(one);
  CHECK(m.entropy == Approx(0));
  CHECK(m.occupancy == Approx(1. / 48));
  CHECK(m.participation == Approx(1. / 48));
  m = spread(std::vector<int>(48, 10));
  CHECK(m.entropy == Approx(1));
  CHECK(m.occupancy == Approx(1));
  CHECK(m.participation == Approx(1));
  std::vector<int> two(48, 0);
  two[0] = two[40] = 5;
  m = spread(two);
  CHECK(m.entropy == Approx(.17905).epsilon(1e-4));
  CHECK(m.occupancy == Approx(1. / 24));
  CHECK(m.participation == Approx(1. / 24));
  CHECK(spread(std::vector<int>(48, 0)).entropy == 0);
}

TEST_CASE("S_feature of fifty evenly spread weak keypoints") {
  FeatureMeasure m;
  m.static_keypoints = 50;
  m.median_response = 20;
  m.entropy = m.occupancy = m.participation = 1;
  FeatureOptions o;
  CHECK(feature_score(m, 40, o).score.value() == Approx(.22361).epsilon(1e-4));
  o.form = FeatureForm::Gated;
  CHECK(feature_score(m, 40, o).score.value() == Approx(.25298).epsilon(1e-4));
  o.form = FeatureForm::Linear;
  CHECK(feature_score(m, 40, o).score.value() == Approx(.58));
  o.response = ResponseScale::HalfSaturation;  // 20 / (20 + 20)
  CHECK(feature_score(m, 1, o).S_resp == Approx(.5));
  o.response = ResponseScale::Relative;  // the floor of 12 holds against a blurred past
  m.median_response = 6;
  CHECK(feature_score(m, 1, o).S_resp == Approx(.5));
}

TEST_CASE("keypoints on dynamic pixels do not count, and their cells neither") {
  std::vector<Keypoint> points;
  for (int y = 0; y < 6; ++y)
    for (int x = 0; x < 8; ++x)
      for (int k = 0; k < 10; ++k) points.push_back({static_cast<float>(80 * x + 8 + 6 * k), static_cast<float>(80 * y + 40), 30, 0, 0});
  FeatureOptions o;
  FeatureScratch scratch;
  const FeatureMeasure all = measure_features(points, none, 640, 480, o, scratch);
  CHECK(all.static_keypoints == 480);
  CHECK(all.valid_cells == 48);
  CHECK(all.entropy == Approx(1));
  CHECK(all.median_response == 30);
  Image<float> mask(640, 480, 0.F);
  for (int y = 0; y < 480; ++y)
    for (int x = 0; x < 320; ++x) mask(x, y) = 1.F;
  const FeatureMeasure half = measure_features(points, mask, 640, 480, o, scratch);
  CHECK(half.keypoints == 480);
  CHECK(half.static_keypoints == 240);
  CHECK(half.valid_cells == 24);
  CHECK(half.occupancy == Approx(1));  // the masked half is not counted as empty
  CHECK(half.entropy == Approx(1));
  const FeatureMeasure nothing = measure_features(points, Image<float>(640, 480, kFloatNaN), 640, 480, o, scratch);
  CHECK(nothing.static_keypoints == 0);
  CHECK(feature_score(nothing, 20, o).score.value() == 0);
  const FeatureMeasure bad = measure_features({{kFloatNaN, 3, 5, 0, 0}, {3, 3, kFloatNaN, 0, 0}, {5, kInf, 1, 0, 0}, {9, 9, -4, 0, 0}},
                                              none, 640, 480, o, scratch);
  CHECK(bad.keypoints == 2);
  CHECK(bad.median_response == 0);
  CHECK(feature_score(bad, static_cast<double>(kFloatNaN), o).score.value() == 0);
}

TEST_CASE("S_feature falls with fewer, weaker and more crowded keypoints, in every form") {
  for (const FeatureForm form : {FeatureForm::Geometric, FeatureForm::Gated, FeatureForm::Linear}) {
    FeatureOptions o;
    o.form = form;
    FeatureMeasure m;
    m.entropy = m.occupancy = m.participation = 1;
    double last = 2;
    for (int n = 500; n >= 0; n -= 50) {
      m.static_keypoints = n;
      m.median_response = .06 * n;
      const double s = feature_score(m, 30, o).score.value();
      CHECK(s < last);
      last = s;
    }
  }
}

TEST_CASE("S_depth") {
  for (const Image<float>& z : {plane(0, 0, .5), plane(.5, 0, .6), plane(-.4, .7, .8), plane(0, -.9, 1)}) {
    const DepthScore s = depth_score(z);
    CHECK(s.S_smo == 1.0);  // the second difference of 1/z is 0 on every plane
    CHECK(s.score.value() == Approx(.5 * s.S_cov + .25 * s.S_cons + .25));
    CHECK(s.S_cov > .5);
  }
  CHECK(depth_score(plane(0, 0, .5)).score.value() == 1.0);
  Image<float> alone(64, 48, 0.F);  // no pixel has a neighbour
  for (int y = kDepthBorder; y < 48; y += kDepthStride) {
    for (int x = kDepthBorder; x < 64; x += kDepthStride) alone(x, y) = 2.F;
  }
  const DepthScore single = depth_score(alone);
  CHECK(single.valid > 0);
  CHECK(single.S_cons == 0);
  CHECK(single.S_smo == 0);
  CHECK(single.score.value() == Approx(.5 * single.S_cov));
  for (const float bad : {0.F, kFloatNaN, kInf, -1.F, 99.F}) CHECK(depth_score(Image<float>(640, 480, bad)).score.value() == 0.0);
  CHECK(depth_score(Image<float>(5, 5, 1.F)).score.value() == 0.0);
  // every second pixel column missing: half of them are covered
  Image<float> left = plane(0, 0, .5);
  for (int y = 0; y < 480; ++y)
    for (int x = 0; x < 320; ++x) left(x, y) = 0;
  CHECK(depth_score(left).S_cov == Approx(.5 / .8).epsilon(.02));
  // flying pixels: each judged pixel a metre before its neighbours
  Image<float> spikes(640, 480, 2.F);
  for (int y = 8; y < 480; y += 4)
    for (int x = 8; x < 640; x += 4) spikes(x, y) = 1.F;
  const DepthScore s = depth_score(spikes);
  CHECK(s.S_cov == 1.0);
  CHECK(s.S_cons == 0.0);
  CHECK(s.S_smo == 0.0);
  CHECK(s.score.value() == Approx(.5));
  DepthQualityOptions nguyen;
  nguyen.noise = DepthNoise::Nguyen;
  CHECK(depth_score(plane(0, 0, .5), nguyen).score.value() == 1.0);
}

TEST_CASE("S_mc") {
  CHECK(motion_deviation(0, 0, 1, .1).value() == 0);
  CHECK(motion_deviation(.1, .1, 1, .1).value() == Approx(1 - std::exp(-1.)));
  MotionScratch scratch;
  const MotionChangeOptions o;
  std::vector<Correspondence> still;
  std::vector<Correspondence> moved;  // by s_m = .1 diagonals = 80 px
  for (int i = 0; i < 400; ++i) {
    const float x = static_cast<float>(i % 20) * 27.F;
    const float y = static_cast<float>(i / 20) * 24.F;  // NOLINT
    still.push_back({x, y, x, y});
    moved.push_back({x, y, x + 80.F, y});
  }
  CHECK(motion_change(still, 400, 640, 480, o, .1, scratch).score.value() == 0);
  const MotionMeasure m = motion_change(moved, 400, 640, 480, o, .1, scratch);
  CHECK(m.m_point == Approx(.1));
  CHECK(m.m_grid == Approx(.1));
  CHECK(m.score.value() == Approx(.63212).epsilon(1e-4));
  CHECK(motion_change(still, 1600, 640, 480, o, .1, scratch).score.value() == Approx(.5));  // a quarter is left: rho = .5
  CHECK(motion_change({}, 400, 640, 480, o, .1, scratch).score.value() == 1);
  CHECK(motion_change({{kFloatNaN, 0, 0, 0}, {0, 0, kInf, 0}}, 2, 640, 480, o, .1, scratch).score.value() == 1);
  // no valid cell: the mean of the points stands in
  const MotionMeasure few = motion_change({{0, 0, 80, 0}, {600, 400, 520, 400}}, 2, 640, 480, o, .1, scratch);
  CHECK(few.cells == 0);
  CHECK(few.score.value() == Approx(.63212).epsilon(1e-4));
  // one cell moves, the others stand still: the medians of the cells average to 1/2 of two cells
  std::vector<Correspondence> two;
  for (int i = 0; i < 3; ++i) two.push_back({10.F + static_cast<float>(i), 10, 90.F + static_cast<float>(i), 10});
  for (int i = 0; i < 5; ++i) two.push_back({500, 400.F + static_cast<float>(i), 500, 400.F + static_cast<float>(i)});
  const MotionMeasure mixed = motion_change(two, 8, 640, 480, o, .1, scratch);
  CHECK(mixed.cells == 2);
  CHECK(mixed.m_grid == Approx(.05));
  double last = -1;
  for (float d = 0; d < 300; d += 20) {  // more flow, more deviation
    for (auto& c : moved) c.x = c.reference_x + d;
    const double v = motion_change(moved, 400, 640, 480, o, .1, scratch).score.value();
    CHECK(v > last);
    last = v;
  }
}

TEST_CASE("S_dc") {
  DepthChangeOptions o;
  o.scale_mean = .15;
  o.scale_spread = .25;
  CHECK(depth_deviation(.15, .25, 1, o).value() == Approx(.63212).epsilon(1e-4));
  DepthSamples a;
  DepthSamples b;
  sample_depth(Image<float>(64, 48, 2.F), none, a);
  CHECK(a.valid == 16 * 12);
  CHECK(depth_change(a, a, o).score.value() == 0);
  sample_depth(Image<float>(64, 48, 2.6F), none, b);  // mean .3 = 2 s_mu, no spread
  CHECK(depth_change(a, b, o).mean == Approx(.3).epsilon(1e-5));
  CHECK(depth_change(a, b, o).spread == Approx(0).epsilon(1e-3));
  CHECK(depth_change(a, b, o).score.value() == Approx(1 - std::exp(-1.)).epsilon(1e-3));
  Image<float> mixed(64, 48, 2.F);  // half the rows +50 %, half -50 %: mean .5, spread .5
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) mixed(x, y) = y < 24 ? 3.F : 1.F;
  sample_depth(mixed, none, b);
  CHECK(depth_change(a, b, o).mean == Approx(.5));
  CHECK(depth_change(a, b, o).spread == Approx(.5));
  sample_depth(Image<float>(64, 48, kFloatNaN), none, b);
  CHECK(b.present);
  CHECK(depth_change(a, b, o).score.value() == 1);
  sample_depth(Image<float>(64, 48, 2.F), Image<float>(64, 48, 1.F), b);  // all dynamic
  CHECK(b.valid == 0);
  sample_depth(none, none, b);
  CHECK_FALSE(b.present);
}

TEST_CASE("S_dec") {
  CHECK(detection_change({}, {}).score.value() == 0);
  DetectionChange change;
  for (const bool before : {true, false}) {
    for (const bool now : {true, false}) {  // that no detector was asked is not that it found nothing
      DetectionChange::Memory reference, current;
      reference.present = before;
      current.present = now;
      CHECK(change({reference, current, Pinhole{525, 525, 319.5, 239.5, 640, 480}}).has_value() == (before && now));
    }
  }
  // 10x10 boxes with IoU .8 and .6: 80/100 inside the larger, 60/100 inside the larger; the third has no partner
  const std::vector<Detection> ref{object(0, 0, 10, 10), object(100, 0, 10, 10)};
  const std::vector<Detection> cur{object(0, 0, 10, 8), object(100, 0, 6, 10), object(300, 300, 9, 9)};
  CHECK(detection_change(ref, cur).score.value() == Approx(.43333).epsilon(1e-4));
  CHECK(detection_change(ref, {}).score.value() == 1);
  std::vector<Detection> other = ref;
  for (auto& d : other) d.class_id = 5;
  CHECK(detection_change(ref, other).score.value() == Approx(.5));  // another class never matches
  std::vector<Detection> r = ref;
  std::vector<Detection> c = cur;
  double last = detection_change(r, c).score.value();
  for (int i = 0; i < 8; ++i) {  // one more identical object in both frames never raises it
    const Detection same = object(30.F * static_cast<float>(i), 2, 25, 40);
    r.push_back(same);
    c.push_back(same);
    const double s = detection_change(r, c).score.value();
    CHECK(s <= last);
    last = s;
  }
  // boxes that are not finite match nothing
  CHECK(detection_change({object(kFloatNaN, kFloatNaN, kInf, 1)}, {object(0, 0, kInf, kInf)}).score.value() == .5);
}

TEST_CASE("the calibrated scale maps the 95th percentile to 0.3") {
  std::vector<double> raw;
  for (int i = 1; i <= 100; ++i) raw.push_back(.001 * i);
  const double s = calibrate_change_scale(raw);
  CHECK(1 - std::exp(-.095 / s) == Approx(.3));
  CHECK(calibrate_change_scale({}) == 0);
}

TEST_CASE("boost, weights, S_final") {
  CHECK(boost(Quality(.4), .15).value() == Approx(.49));
  CHECK(boost(boost(Quality(.4), .15), .05).value() == Approx(.5155));
  CHECK(boost(boost(Quality(.4), .05), .15).value() == Approx(.5155));
  CHECK(base_weight(.7, .2, 1) == Approx(.5));
  CHECK(base_weight(.7, .9, 1) == 0);
  CHECK(combine_final(Quality(.7), Deviation(.6), .5).value() == Approx(.55));
  CHECK(combine_final(Quality(.7), Deviation(.6), .5, ChangePolarity::Literal).value() == Approx(.65));
  CHECK(combine_final(Quality(.7), std::nullopt, .5).value() == Approx(.7));
  SceneDecision d;
  const Decision normal = d.decide(Quality(.7), Quality(.5), std::nullopt, Deviation(.6), .2);
  CHECK(normal.W_base == Approx(.5));
  CHECK(normal.S_final.value() == Approx(.55));
  CHECK_FALSE(normal.good);
  const Decision dynamic = d.decide(Quality(.7), Quality(.5), std::nullopt, Deviation(.6), .4);
  CHECK(dynamic.scenario_dynamic);
  CHECK(dynamic.W_base == Approx(.2));
  CHECK(d.decide(Quality(.7), Quality(.5), std::nullopt, Deviation(0), .2).W_base == Approx(.5));  // no memory of it
  const Decision boosted = d.decide(Quality(.7), Quality(.7), Quality(.8), std::nullopt, .05);
  CHECK(boosted.scenario_static);
  CHECK(boosted.scenario_objects);
  CHECK(boosted.S_final.value() == Approx(1 - .3 * .85 * .95));
  CHECK(std::isfinite(d.decide(Quality(.7), {}, {}, Deviation(.5), std::nan("")).S_final.value()));
  DecisionOptions o;
  o.base_weight = BaseWeight::Cumulative;  // gone after four frames
  SceneDecision literal(o);
  for (int i = 0; i < 4; ++i) (void)literal.decide(Quality(.7), {}, {}, {}, .2);
  CHECK(literal.decide(Quality(.7), {}, {}, {}, 0).W_base == 0);
  o.th_static = .5;
  CHECK_THROWS_AS((void)SceneDecision(o), contract_error);
}

TEST_CASE("th_s in closed form") {
  const InitialisationOptions o;
  const double expected[][2] = {{29, .7}, {31, .6885}, {45, .5581}, {60, .4574}, {62, .45}, {150, .45}};
  for (const auto& e : expected) CHECK(quality_threshold(e[0], o) == Approx(e[1]).epsilon(1e-4));
  InitialisationOptions low;
  low.quality = .5;
  low.quality_min = .3;
  const double lower[][2] = {{31, .4918}, {45, .3986}, {60, .3267}, {67, .3}};
  for (const auto& e : lower) CHECK(quality_threshold(e[0], low) == Approx(e[1]).epsilon(1e-3));
}

TEST_CASE("the recursions as printed") {
  InitialisationOptions o;
  CHECK(next_frame_threshold(30, 31, o) == Approx(31.0169).epsilon(1e-5));
  double th_f = 30;
  for (int n = 31; n <= 150; ++n) th_f = next_frame_threshold(th_f, n, o);
  CHECK(th_f == Approx(150));
  o.frame_threshold = FrameThreshold::Geometric;
  CHECK(next_frame_threshold(30, 31, o) == 45);
  InitialisationOptions l;
  l.quality = .5;
  l.quality_min = .3;
  l.decay = 1;
  double th_s = .5;
  th_f = 30;
  for (int n = 2; n <= 40; ++n) {
    th_f = next_frame_threshold(th_f, n, l);
    th_s = literal_quality_threshold(th_s, th_f, n, l);
    if (n == 2) CHECK(th_s == Approx(1.354).epsilon(1e-3));
    if (n == 5) CHECK(th_s == Approx(11.26).epsilon(1e-3));
    if (n == 11) CHECK(th_s == Approx(46.24).epsilon(1e-3));
    if (n == 20) CHECK(th_s == Approx(.632).epsilon(2e-3));
    if (n >= 29) CHECK(th_s == Approx(.3));
  }
}
