// Policies around policies: combinations, expressions, refinement by depth, propagation, smoothing in time.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <apso/observation/combined_policy.hpp>
#include <apso/observation/policies/depth_refined_mask.hpp>
#include <apso/observation/policies/interaction_rule.hpp>
#include <apso/observation/policies/mask_propagation.hpp>
#include <apso/observation/policies/temporal_filter.hpp>
#include <apso/observation/policy_expression.hpp>
#include <apso/observation/soft_weights.hpp>

#include "scene.hpp"

namespace {
using namespace apso;
using observation_test::camera;
using observation_test::ExactTracks;
using observation_test::Scene;
using observation_test::Slab;

/// Says what it is told to: a rectangle per call, or detections.
struct Told {
  std::vector<Box> boxes;  // one per call, the last repeats; an empty box = nothing
  std::vector<Detection> objects;
  float value = 1.0F;
  bool outside_known = true;
  int calls = 0;
  int remembered = 0;

  void observe(const AnyFrame& frame, const Pose&, const std::vector<PointTrack>&, DynamicMask& out) {
    out.probability.assign(frame.depth().width(), frame.depth().height(), 0.0F);
    out.known.assign(frame.depth().width(), frame.depth().height(), outside_known ? 1 : 0);
    if (!boxes.empty()) {
      const Box b = boxes[std::min(static_cast<std::size_t>(calls), boxes.size() - 1)];
      for (int y = static_cast<int>(b.y); y < static_cast<int>(b.y + b.height); ++y) {
        for (int x = static_cast<int>(b.x); x < static_cast<int>(b.x + b.width); ++x) {
          out.probability(x, y) = value;
          out.known(x, y) = 1;
        }
      }
    }
    ++calls;
  }
  void remember(const AnyFrame&, const Pose&, const DynamicMask&) { ++remembered; }
  void reset() { calls = remembered = 0; }
  [[nodiscard]] const std::vector<Detection>& detections() const { return objects; }
};

Told told(Box box, float value = 1.0F) {
  Told t;
  t.boxes = {box};
  t.value = value;
  return t;
}

DynamicMask once(AnyMotionPolicy policy) {
  static const Image<float> depth(320, 240, 2.0F);
  DynamicMask m;
  policy.observe(RgbdFrame{0, depth, depth}, Pose::Identity(), {}, m);
  return m;
}

AnyMotionPolicy by_letter(const std::string& name, std::optional<AnyMotionPolicy> inner) {
  if (inner) {
    if (name != "same") contract_violation(name + " takes no argument");
    return std::move(*inner);
  }
  if (name == "a") return told({100, 100, 40, 40});
  if (name == "b") return told({120, 100, 40, 40});
  if (name == "c") return told({136, 100, 40, 40});
  contract_violation("no policy is called " + name);
}

TEST_CASE("union, product and gate of two policies") {
  const auto a = told({100, 100, 40, 40}, 0.8F);
  const auto b = told({120, 100, 40, 40}, 0.5F);
  const DynamicMask u = once(CombinedPolicy<Told, Told>(a, b, PolicyCombination::Union));
  CHECK(u.probability(110, 120) == doctest::Approx(0.8));
  CHECK(u.probability(130, 120) == doctest::Approx(0.9));
  CHECK(u.probability(150, 120) == doctest::Approx(0.5));
  CHECK(u.probability(10, 10) == 0.0F);
  const DynamicMask p = once(CombinedPolicy<Told, Told>(a, b, PolicyCombination::Product));
  CHECK(p.probability(110, 120) == 0.0F);
  CHECK(p.probability(130, 120) == doctest::Approx(0.4));
  CHECK(p.probability(150, 120) == 0.0F);
  // the gate keeps the whole object of the first: half of it moves with 0.5, mean 0.25
  const DynamicMask g = once(CombinedPolicy<Told, Told>(a, b, PolicyCombination::Gate));
  CHECK(g.probability(110, 120) == doctest::Approx(0.8));
  CHECK(g.probability(150, 120) == 0.0F);
  const DynamicMask none = once(CombinedPolicy<Told, Told>(a, told({136, 100, 40, 40}, 0.5F), PolicyCombination::Gate));
  CHECK(dynamic_ratio(none) == 0.0);
}

TEST_CASE("the gate judges detections one by one, and leaves to the first what the second does not know") {
  Told people = told({0, 0, 0, 0});
  Detection left, right;
  left.box = {20, 40, 60, 120};
  right.box = {200, 40, 60, 120};
  people.objects = {left, right};
  people.boxes = {};
  struct Boxes {  // marks its detections
    Told t;
    void observe(const AnyFrame& f, const Pose&, const std::vector<PointTrack>&, DynamicMask& out) {
      for (Detection& d : t.objects) d.score = 1.0F;
      mask_from_detections(t.objects, f.depth().width(), f.depth().height(), false, out);
    }
    void remember(const AnyFrame&, const Pose&, const DynamicMask&) {}
    void reset() {}
    [[nodiscard]] const std::vector<Detection>& detections() const { return t.objects; }
  };
  const DynamicMask m = once(CombinedPolicy<Boxes, Told>({people}, told({200, 60, 60, 60}), PolicyCombination::Gate));
  CHECK(m.probability(50, 100) == 0.0F);
  CHECK(m.probability(230, 150) == 1.0F);
  Told blind = told({0, 0, 0, 0});
  blind.outside_known = false;
  const DynamicMask kept = once(CombinedPolicy<Boxes, Told>({people}, blind, PolicyCombination::Gate));
  CHECK(kept.probability(50, 100) == 1.0F);
  CHECK(kept.probability(230, 150) == 1.0F);
  CHECK(kept.known(150, 100) == 0);
}

TEST_CASE("expressions: precedence, brackets, arguments") {
  const auto at = [](const std::string& text) {
    const DynamicMask m = once(parse_policy(text, PolicyFactory(by_letter)));
    std::string seen;  // a|ab|ab c|bc|c : left to right over the three rectangles
    for (int x : {110, 130, 138, 150, 170}) seen += m.probability(x, 120) >= 0.5F ? '1' : '0';
    return seen;
  };
  CHECK(at("a") == "11100");
  CHECK(at("a+b") == "11110");
  CHECK(at(" a * b ") == "01100");
  CHECK(at("a*b+c") == "01111");
  CHECK(at("c+a*b") == "01111");
  CHECK(at("(a+b)*c") == "00110");
  CHECK(at("a*b*c") == "00100");
  CHECK(at("same(a+b)*c") == "00110");
  CHECK(at("b&a") == "01110");
  CHECK(at("a&c") == "00000");
  CHECK(policy_names("x + same(y & z)") == std::vector<std::string>{"x", "y", "z", "same"});
  for (const char* wrong : {"", "a+", "a b", "(a", "a)", "+a", "a(b)", "d", "same()", "a,b"}) {
    CAPTURE(wrong);
    CHECK_THROWS_AS((void)parse_policy(wrong, PolicyFactory(by_letter)), contract_error);
  }
  try {
    (void)parse_policy("a + (b", PolicyFactory(by_letter));
    CHECK(false);
  } catch (const contract_error& e) {
    CHECK(std::string(e.what()).find("character 7") != std::string::npos);
  }
}

double iou_of(const DynamicMask& m, const Image<std::uint8_t>& truth) {
  double both = 0, either = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const bool a = m.probability.data()[i] >= 0.5F;
    const bool b = truth.data()[i] != 0;
    both += a && b ? 1 : 0;
    either += a || b ? 1 : 0;
  }
  return either > 0 ? both / either : 1;
}

TEST_CASE("depth-refined-mask: a box becomes the surface it means, a shifted mask gets its borders back") {
  Scene s;
  Slab slab;
  slab.width = 0.5;
  s.render(Pose::Identity(), slab);
  int x0 = 400, x1 = 0, y0 = 400, y1 = 0;
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) {
      if (s.truth(x, y) == 0) continue;
      x0 = std::min(x0, x), x1 = std::max(x1, x + 1), y0 = std::min(y0, y), y1 = std::max(y1, y + 1);
    }
  }
  DepthRefinedMaskOptions options;
  options.dilation = 0;
  DynamicMask m;
  // a box that is loose by 30 % on each side
  Told box = told({0, 0, 0, 0});
  Detection d;
  const float mx = 0.3F * static_cast<float>(x1 - x0);
  d.box = {static_cast<float>(x0) - mx, static_cast<float>(y0), static_cast<float>(x1 - x0) + 2 * mx, static_cast<float>(y1 - y0)};
  d.score = 1.0F;
  box.objects = {d};
  box.boxes = {d.box};
  DepthRefinedMask<Told> refined(box, camera(), options);
  Told alone = box;
  alone.observe(s.frame(0), Pose::Identity(), {}, m);
  CHECK(iou_of(m, s.truth) < 0.66);
  refined.observe(s.frame(0), Pose::Identity(), {}, m);
  CHECK(iou_of(m, s.truth) > 0.85);
  // a mask that is off by a third of the slab
  Told shifted = told({static_cast<float>(x0) + mx, static_cast<float>(y0), static_cast<float>(x1 - x0), static_cast<float>(y1 - y0)});
  shifted.observe(s.frame(0), Pose::Identity(), {}, m);
  CHECK(iou_of(m, s.truth) < 0.6);
  options.window = 0.5;
  DepthRefinedMask<Told> moved(shifted, camera(), options);
  moved.observe(s.frame(0), Pose::Identity(), {}, m);
  CHECK(iou_of(m, s.truth) > 0.85);
  // without depth the inner policy has the last word
  Scene blind;
  blind.render(Pose::Identity(), slab);
  for (std::size_t i = 0; i < blind.depth.size(); ++i) blind.depth.data()[i] = 0;
  moved.observe(blind.frame(0), Pose::Identity(), {}, m);
  CHECK(m.probability((x0 + x1) / 2, (y0 + y1) / 2) == 1.0F);
}

TEST_CASE("the foreground of a histogram: nearest surface of enough pixels") {
  std::vector<float> z(70, 3.5F);
  for (int i = 0; i < 30; ++i) z.push_back(1.62F + 0.005F * static_cast<float>(i));
  z.push_back(0.5F);  // a speck
  float lo = 0, hi = 0;
  REQUIRE(foreground_range(z, 0.1, 0.2, lo, hi));
  CHECK(lo == doctest::Approx(1.6));
  CHECK(hi == doctest::Approx(1.8));
  REQUIRE(foreground_range(z, 0.1, 0.5, lo, hi));
  CHECK(lo == doctest::Approx(3.5));
  CHECK_FALSE(foreground_range({}, 0.1, 0.2, lo, hi));
}

TEST_CASE("mask-propagation: between two looks the mask walks with the slab") {
  Scene s;
  ExactTracks tracker;
  DynamicMask m;
  Told inner;
  inner.boxes.clear();
  MaskPropagationOptions options;
  options.every = 10;
  // the inner policy knows the truth of the frames it is asked for
  struct Truth {
    const Scene* scene = nullptr;
    int calls = 0;
    Detection d;
    std::vector<Detection> found;
    void observe(const AnyFrame&, const Pose&, const std::vector<PointTrack>&, DynamicMask& out) {
      mask_from_labels(scene->truth.view(), out);
      found = {d};
      ++calls;
    }
    void remember(const AnyFrame&, const Pose&, const DynamicMask&) {}
    void reset() {}
    [[nodiscard]] const std::vector<Detection>& detections() const { return found; }
  };
  Truth truth;
  truth.scene = &s;
  MaskPropagation<Truth> policy(truth, camera(), options);
  double carried = 0, frozen = 0, n = 0;
  DynamicMask last_look;
  for (int k = 0; k < 40; ++k) {
    Slab slab;
    slab.x = -0.6 + 1.0 * k / 30.0;
    slab.z = 2.0 - 0.3 * k / 30.0;
    s.render(Pose::Identity(), slab);
    policy.observe(s.frame(k / 30.0), Pose::Identity(), tracker.follow(s, Pose::Identity(), slab), m);
    policy.remember(s.frame(k / 30.0), Pose::Identity(), m);
    CHECK(policy.asked() == (k % 10 == 0));
    if (policy.asked()) last_look = m;
    if (k % 10 != 9) continue;
    carried += iou_of(m, s.truth);
    frozen += iou_of(last_look, s.truth);
    n += 1;
  }
  CHECK(frozen / n < 0.6);
  CHECK(carried / n > 0.85);
}

TEST_CASE("mask-propagation: boxes go along, and what was remembered is only what the inner policy saw") {
  Scene s;
  ExactTracks tracker;
  DynamicMask m;
  Told inner = told({120, 60, 70, 120});
  Detection d;
  d.box = {120, 60, 70, 120};
  inner.objects = {d};
  MaskPropagationOptions options;
  options.every = 100;
  MaskPropagation<Told> policy(inner, camera(), options);
  for (int k = 0; k < 16; ++k) {
    Slab slab;
    slab.x = 0.02 * k;  // 260 * 0.02 / 2 = 2.6 px per frame
    s.render(Pose::Identity(), slab);
    policy.observe(s.frame(k / 30.0), Pose::Identity(), tracker.follow(s, Pose::Identity(), slab), m);
    policy.remember(s.frame(k / 30.0), Pose::Identity(), m);
  }
  REQUIRE(policy.detections().size() == 1);
  CHECK(policy.detections()[0].box.x == doctest::Approx(120 + 15 * 2.6).epsilon(0.03));
  CHECK(policy.detections()[0].box.y == doctest::Approx(60).epsilon(0.03));
}

TEST_CASE("interaction: the object that a moving one touches moves with it, one behind it or apart from it does not") {
  // a person at 2 m is marked; a chair beside it at 2.1 m, a table seen beside it at 3 m, a box elsewhere at 2 m
  const Box person{100, 40, 60, 160}, chair{160, 120, 40, 80}, table{60, 120, 40, 80}, box{240, 120, 40, 80};
  Image<float> depth(320, 240, 4.0F);
  const auto fill = [&](const Box& b, float z) {
    for (int y = static_cast<int>(b.y); y < static_cast<int>(b.y + b.height); ++y) {
      for (int x = static_cast<int>(b.x); x < static_cast<int>(b.x + b.width); ++x) depth(x, y) = z;
    }
  };
  fill(person, 2.0F);
  fill(chair, 2.1F);
  fill(table, 3.0F);
  fill(box, 2.0F);
  Told inner = told(person);
  for (const Box& b : {person, chair, table, box}) {
    Detection d;
    d.box = b;
    inner.objects.push_back(d);
  }
  const Pinhole camera{300, 300, 160, 120, 320, 240};
  DynamicMask m;
  const auto observe = [&](const Told& told_by) {
    InteractionRule<Told> rule(told_by, camera);
    rule.observe(RgbdFrame{0, depth, depth}, Pose::Identity(), std::vector<PointTrack>{}, m);
  };
  observe(inner);
  CHECK(m.probability(130, 120) == 1.0F);
  CHECK(m.probability(180, 160) == 1.0F);
  CHECK(m.known(180, 160) == 1);
  CHECK(m.probability(80, 160) == 0.0F);
  CHECK(m.probability(260, 160) == 0.0F);
  CHECK(m.probability(10, 10) == 0.0F);
  // what the inner policy marks keeps its border to the pixel
  const Told plain = inner;
  inner = told({101, 41, 59, 150});
  inner.objects = plain.objects;
  observe(inner);
  CHECK(m.probability(180, 160) == 1.0F);
  CHECK(m.probability(100, 100) == 0.0F);
  CHECK(m.probability(101, 100) == 1.0F);
  CHECK(m.probability(130, 40) == 0.0F);
  CHECK(m.probability(130, 41) == 1.0F);
  inner = plain;
  // in a box without a mask, what lies behind the object stays
  inner.objects[1].box = {160, 120, 55, 80};
  observe(inner);
  CHECK(m.probability(180, 160) == 1.0F);
  CHECK(m.probability(208, 160) == 0.0F);
  // what cannot move does not, and without a moving surface nothing does
  inner.objects[1].movable = false;
  observe(inner);
  CHECK(m.probability(180, 160) == 0.0F);
  inner.objects[1].movable = true;
  inner.value = 0.0F;
  observe(inner);
  CHECK(dynamic_ratio(m) == 0.0);
}

TEST_CASE("temporal-filter: single frames are smoothed away, real changes come through") {
  Scene s;
  s.render(Pose::Identity(), Slab{});
  Told flicker = told({100, 60, 100, 100});
  flicker.boxes.clear();
  for (int k = 0; k < 60; ++k) {
    const bool drop = k % 4 == 3;  // every fourth look misses the object
    flicker.boxes.push_back(k >= 40 || drop ? Box{} : Box{100, 60, 100, 100});
  }
  TemporalFilter<Told> policy(flicker, camera());
  DynamicMask m;
  int toggles = 0;
  bool was = false;
  int off_after = -1;
  for (int k = 0; k < 60; ++k) {
    policy.observe(s.frame(k / 30.0), Pose::Identity(), {}, m);
    policy.remember(s.frame(k / 30.0), Pose::Identity(), m);
    const bool on = m.probability(150, 110) >= 0.5F;
    toggles += on != was ? 1 : 0;
    was = on;
    if (k >= 40 && !on && off_after < 0) off_after = k - 40;
    CHECK(m.probability(20, 20) < 0.5F);
  }
  CHECK(toggles == 2);  // on once, off once; the inner policy toggles 21 times
  CHECK(off_after >= 0);
  CHECK(off_after <= 5);  // and it does not stick
}

TEST_CASE("temporal-filter: evidence moves with its surface when the camera turns") {
  Scene s;
  TemporalFilter<Told> policy(
      [] {
        Told t;
        t.outside_known = false;
        t.boxes = {{140, 60, 40, 60}, {140, 60, 40, 60}, {140, 60, 40, 60}, {}};  // then it says nothing at all
        return t;
      }(),
      camera());
  DynamicMask m;
  Slab slab;
  slab.width = 0.3;
  for (int k = 0; k < 6; ++k) {
    Pose T = Pose::Identity();
    T.linear() = Eigen::AngleAxisd(0.02 * std::max(0, k - 2), Eigen::Vector3d::UnitY()).toRotationMatrix();
    s.render(T, slab);
    policy.observe(s.frame(k / 30.0), T, {}, m);
    policy.remember(s.frame(k / 30.0), T, m);
  }
  // turned by 0.06 rad to the right: the slab is 260 * 0.06 = 16 px further left
  CHECK(m.probability(144, 90) >= 0.5F);
  CHECK(m.probability(128, 90) >= 0.5F);
  CHECK(m.probability(176, 90) < 0.5F);
}

TEST_CASE("soft weights: only when the mask leaves too few keypoints or too small a share of them") {
  std::vector<Keypoint> keypoints;
  for (int i = 0; i < 1000; ++i) keypoints.push_back({static_cast<float>(i % 100), static_cast<float>(i / 100), 1, 0, 0});
  keypoints.push_back({-5, 3, 1, 0, 0});  // outside
  const auto columns = [&](int dynamic) {
    Image<float> p(100, 10, 0.0F);
    for (int y = 0; y < 10; ++y)
      for (int x = 0; x < dynamic; ++x) p(x, y) = 1.0F;
    return p;
  };
  const SoftWeightOptions options;
  Image<float> p = columns(80);
  CHECK(static_support(p, keypoints).points == 1000);
  CHECK(static_support(p, keypoints).static_points == 200);
  CHECK_FALSE(soften(keypoints, options, p));
  CHECK(p(0, 0) == 1.0F);
  p = columns(91);  // 90 points are enough, 9 % are not
  CHECK(soften(keypoints, options, p));
  CHECK(p(0, 0) == doctest::Approx(0.9));
  CHECK(p(95, 0) == 0.0F);
  keypoints.resize(100);  // one row
  p = columns(50);        // half of them, but only 50
  CHECK(soften(keypoints, options, p));
  Image<float> none;
  CHECK(static_support(none, keypoints).static_points == 100);
}

}  // namespace
