// Motion policies, masks and the object tracker on types that no code of apso has seen: the same result as on native ones,
// no image copied, nothing of the caller's kept.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <apso/observation/combined_policy.hpp>
#include <apso/observation/motion_by_name.hpp>
#include <apso/observation/objects/object_tracker.hpp>
#include <apso/observation/point_presence.hpp>
#include <apso/observation/soft_weights.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/ranges.hpp>

#include "../counting_allocator.hpp"
#include "../foreign_types.hpp"
#include "scene.hpp"

namespace {
using namespace apso;
using observation_test::camera;
using observation_test::ExactTracks;
using observation_test::hand_held;
using observation_test::Scene;
using observation_test::Slab;

constexpr float kUnit = 1 / 5000.0F;  // of 16-bit depth [m]

/// One frame in both worlds: what the foreign types say, and apso's own types that say the same.
struct Both {
  Both(const Scene& scene, int k)
      : time(k / 30.0),
        grey(foreign::at_only(scene.intensity)),
        raw(foreign::padded_u16(scene.depth, kUnit)),
        millimetres(foreign::float_millimetres(scene.depth)),
        cloud(foreign::xyz_cloud(scene.depth, 260, 159.5F, 119.5F)),
        intensity(foreign::native(grey)),
        depth(k % 3 == 0   ? foreign::native(raw, kUnit)
              : k % 3 == 1 ? foreign::native(millimetres)
                           : scene.depth) {}
  [[nodiscard]] RgbdFrame native() const { return {time, intensity.view(), depth.view()}; }
  /// Calls f with a frame of foreign images; their types take turns.
  template <class F>
  void foreign_frame(int k, F&& f) const {
    if (k % 3 == 0) f(frame(time, grey, scaled(raw, kUnit), camera()));
    if (k % 3 == 1) f(frame(time, grey, scaled(millimetres, 0.001F), camera()));
    if (k % 3 == 2) f(frame(time, grey, cloud, camera()));
  }
  double time;
  foreign::AtOnly grey;
  foreign::PaddedU16 raw;
  foreign::FloatMillimetres millimetres;
  foreign::XyzCloud cloud;
  Image<float> intensity;
  Image<float> depth;
};

bool equal(const DynamicMask& a, const DynamicMask& b) {
  return a.probability.size() == b.probability.size() && a.known.size() == b.known.size() &&
         std::equal(a.probability.data(), a.probability.data() + a.probability.size(), b.probability.data()) &&
         std::equal(a.known.data(), a.known.data() + a.known.size(), b.known.data());
}

/// Both policies are in the same state; one gets native types, the other foreign ones.
template <class Policy>
void same_on_foreign_types(Policy native, Policy foreign_policy) {
  Scene s;
  s.textured = true;
  ExactTracks tracker;
  DynamicMask a;
  DynamicMask b;
  bool moved = false;
  for (int k = 0; k < 18; ++k) {
    Slab slab;
    slab.x = -0.6 + 0.04 * k;
    const auto T_foreign = from_pose<foreign::DualQuaternionPose>(hand_held(k / 30.0));
    s.render(to_pose(T_foreign), slab);
    std::optional<Both> both(std::in_place, s, k);
    const std::list<foreign::Feature> features = foreign::features(tracker.follow(s, to_pose(T_foreign), slab));
    std::vector<PointTrack> tracks;
    (void)as_tracks(features, tracks);
    native.observe(both->native(), to_pose(T_foreign), tracks, a);
    std::size_t before = counting::bytes;
    both->foreign_frame(k, [&](const auto& f) { foreign_policy.observe(f, T_foreign, features, b); });
    std::size_t bytes = counting::bytes - before;
    REQUIRE(equal(a, b));
    moved = moved || dynamic_ratio(a) > 0;
    native.remember(both->native(), to_pose(T_foreign), a);
    both.emplace(s, k);  // the images of observe() are gone: the frame is another object now
    before = counting::bytes;
    both->foreign_frame(k, [&](const auto& f) { foreign_policy.remember(f, T_foreign, b); });
    bytes += counting::bytes - before;
    // warm, a policy allocates less than the smallest copy of an image, 8 bit grey, would take
    if (k >= 14) CHECK(bytes < static_cast<std::size_t>(camera().width) * static_cast<std::size_t>(camera().height));
  }
  CHECK(moved);
}

// With a memory that is full before the frames are over: from then on it uses its buffers again.
GeometricMotionOptions few_views() {
  GeometricMotionOptions o;
  o.references = 3;
  return o;
}
GeometricMotion geometric(const Pinhole& c) { return GeometricMotion(c, few_views()); }

TEST_CASE("every policy gives the same on foreign frames, poses and tracks, and copies no image") {
  const Pinhole c = camera();
  same_on_foreign_types(geometric(c), geometric(c));
  same_on_foreign_types(EpipolarMotion(c), EpipolarMotion(c));
  same_on_foreign_types(MultiViewDepth(c), MultiViewDepth(c));
  same_on_foreign_types(ClusterResidual(c), ClusterResidual(c));
  same_on_foreign_types(ResidualMotion(c), ResidualMotion(c));
}

/// Finds an object where the slab moves.
struct WithObject {
  GeometricMotion motion;
  std::vector<Detection> objects = std::vector<Detection>(1);
  explicit WithObject(const Pinhole& c) : motion(geometric(c)) {
    objects[0].box = {0, 0, static_cast<float>(c.width), static_cast<float>(c.height)};
  }
  void observe(const AnyFrame& frame, const AnyPose& T_prior, const AnyTracks& tracks, DynamicMask& out) {
    motion.observe(frame, T_prior, tracks, out);
  }
  void remember(const AnyFrame& frame, const AnyPose& T, const DynamicMask& mask) { motion.remember(frame, T, mask); }
  void reset() { motion.reset(); }
  [[nodiscard]] const std::vector<Detection>& detections() const { return objects; }
};

TEST_CASE("so do policies around policies, combinations, and policies held behind one type") {
  const Pinhole c = camera();
  MotionOptions few;
  few.geometric = few_views();
  const auto refined = [&] { return DepthRefinedMask<GeometricMotion>(geometric(c), c); };
  const auto carried = [&] {
    MaskPropagationOptions options;
    options.every = 2;
    return MaskPropagation<MultiViewDepth>(MultiViewDepth(c), c, options);
  };
  const auto smooth = [&] { return TemporalFilter<GeometricMotion>(geometric(c), c); };
  same_on_foreign_types(refined(), refined());
  same_on_foreign_types(carried(), carried());
  same_on_foreign_types(smooth(), smooth());
  const auto touching = [&] { return InteractionRule<WithObject>(WithObject(c), c); };
  same_on_foreign_types(touching(), touching());
  same_on_foreign_types(geometric(c) | ResidualMotion(c), geometric(c) | ResidualMotion(c));
  same_on_foreign_types(geometric(c) * MultiViewDepth(c), geometric(c) * MultiViewDepth(c));
  same_on_foreign_types(geometric(c) & EpipolarMotion(c), geometric(c) & EpipolarMotion(c));
  same_on_foreign_types(motion_by_name("geometric | residual", c, few), motion_by_name("geometric + residual", c, few));
}

TEST_CASE("operators and CombinedPolicy are the same, whatever is joined") {
  const Pinhole c = camera();
  const auto marks = [&](auto policy) {
    Scene s;
    DynamicMask m;
    for (int k = 0; k < 10; ++k) {
      Slab slab;
      slab.x = -0.6 + 0.05 * k;
      s.render(Pose::Identity(), slab);
      policy.observe(s.frame(k / 30.0), Pose::Identity(), none, m);
      policy.remember(s.frame(k / 30.0), Pose::Identity(), m);
    }
    return m;
  };
  using Two = CombinedPolicy<GeometricMotion, MultiViewDepth>;
  const auto g = [&] { return GeometricMotion(c); };
  const auto v = [&] { return MultiViewDepth(c); };
  CHECK(equal(marks(g() | v()), marks(Two(g(), v(), PolicyCombination::Union))));
  CHECK(equal(marks(g() * v()), marks(Two(g(), v(), PolicyCombination::Product))));
  CHECK(equal(marks(g() & v()), marks(Two(g(), v(), PolicyCombination::Gate))));
  CHECK(equal(marks(g() | v() * g()),
              marks(CombinedPolicy<GeometricMotion, CombinedPolicy<MultiViewDepth, GeometricMotion>>(
                  g(), CombinedPolicy<MultiViewDepth, GeometricMotion>(v(), g(), PolicyCombination::Product), PolicyCombination::Union))));
  CHECK_FALSE(equal(marks(g() | v()), marks(g() * v())));
}

TEST_CASE("a frame is known by its timestamp, not by where its images lie") {
  // the second remember() shows another frame in the same memory: it must be read, not taken for the observed one
  Scene s;
  DynamicMask m;
  GeometricMotion one_buffer(camera());
  GeometricMotion two_buffers(camera());
  Scene other;
  for (int k = 0; k < 8; ++k) {
    Slab slab;
    slab.x = -0.6 + 0.05 * k;
    s.render(Pose::Identity(), slab);
    one_buffer.observe(s.frame(0.2 * k), Pose::Identity(), none, m);
    two_buffers.observe(s.frame(0.2 * k), Pose::Identity(), none, m);
    slab.x += 0.3;
    other.render(Pose::Identity(), slab);
    two_buffers.remember(other.frame(0.2 * k + 0.1), Pose::Identity(), m);
    s.depth = other.depth;
    one_buffer.remember(s.frame(0.2 * k + 0.1), Pose::Identity(), m);
  }
  s.render(Pose::Identity(), Slab{});
  DynamicMask a;
  DynamicMask b;
  one_buffer.observe(s.frame(2.0), Pose::Identity(), none, a);
  two_buffers.observe(s.frame(2.0), Pose::Identity(), none, b);
  CHECK(equal(a, b));
  CHECK(one_buffer.reference_count() == two_buffers.reference_count());
}

TEST_CASE("a frame without a usable stamp is remembered once, as the one that was observed") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  GeometricMotion stamped(camera());
  GeometricMotion blank(camera());
  Scene s;
  DynamicMask m;
  for (int k = 0; k < 12; ++k) {
    s.render(Pose::Identity(), std::nullopt);
    stamped.observe(s.frame(k / 30.0), Pose::Identity(), none, m);
    stamped.remember(s.frame(k / 30.0), Pose::Identity(), m);
    blank.observe(s.frame(nan), Pose::Identity(), none, m);
    blank.remember(s.frame(nan), Pose::Identity(), m);
  }
  CHECK(blank.reference_count() == stamped.reference_count());  // the clock of both ran 30 frames per second
}

TEST_CASE("masks from labels and detections of any type") {
  Scene s;
  s.render(Pose::Identity(), Slab{});
  Image<float> labels(320, 240, 0.0F);
  for (std::size_t i = 0; i < labels.size(); ++i) labels.data()[i] = static_cast<float>(s.truth.data()[i]);
  DynamicMask expected;
  mask_from_labels(s.truth, expected);
  CHECK(dynamic_ratio(expected) > 0.05);
  DynamicMask m;
  mask_from_labels(foreign::at_only(labels), m);
  CHECK(equal(m, expected));
  mask_from_labels(foreign::padded_u16(labels, 1.0F), m);
  CHECK(equal(m, expected));
  mask_from_labels(labels, m);
  CHECK(equal(m, expected));
  labels(3, 3) = std::numeric_limits<float>::quiet_NaN();
  mask_from_labels(labels, m);
  CHECK(equal(m, expected));

  Detection d;
  d.box = {30, 40, 50, 60};
  d.score = 0.75F;
  Detection with_mask = d;
  with_mask.mask = s.truth.view();
  with_mask.score = 0.5F;
  mask_from_detections({d, with_mask}, 320, 240, false, expected);
  mask_from_detections(foreign::boxes({d, with_mask}), 320, 240, false, m);
  CHECK(equal(m, expected));
  mask_from_detections(none, 320, 240, false, m);
  CHECK(known_ratio(m) == 0.0);
}

TEST_CASE("masks from any image: integers are labels, floats are probabilities, NaN is unknown") {
  Image<float> p(320, 240, 0.25F);
  p(0, 0) = 2.0F;
  p(1, 0) = -1.0F;
  p(2, 0) = std::numeric_limits<float>::quiet_NaN();
  DynamicMask m;
  mask_from_image(p, m);
  CHECK(m.probability(0, 0) == 1.0F);
  CHECK(m.probability(1, 0) == 0.0F);
  CHECK(m.probability(2, 0) == 0.0F);
  CHECK(m.known(1, 0) == 1);
  CHECK(m.known(2, 0) == 0);
  CHECK(m.probability(9, 9) == 0.25F);
  const foreign::PaddedU16 percent = foreign::padded_u16(Image<float>(320, 240, 0.25F), 0.01F);
  mask_from_image(scaled(percent, 0.01F), m);
  CHECK(m.probability(9, 9) == doctest::Approx(0.25));
  mask_from_image(percent, m);  // whole numbers are labels
  CHECK(m.probability(9, 9) == 1.0F);
}

TEST_CASE("ratio and support of probabilities of any type") {
  Image<float> p(320, 240, 0.0F);
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 160; ++x) p(x, y) = 1.0F;
  const foreign::PaddedU16 raw = foreign::padded_u16(p, 1.0F / 65535);
  CHECK(dynamic_ratio(scaled(raw, 1.0F / 65535)) == doctest::Approx(0.5));
  std::vector<Keypoint> keypoints;
  for (int i = 0; i < 300; ++i) keypoints.push_back({static_cast<float>(i) + 0.25F, 100, 1, 0, 0});
  const StaticSupport native = static_support(p, keypoints);
  const StaticSupport other = static_support(scaled(raw, 1.0F / 65535), foreign::corners(keypoints));
  CHECK(native.points == 300);
  CHECK(other.points == 300);
  CHECK(other.static_points == native.static_points);
  CHECK(static_support(none, foreign::corners(keypoints)).static_points == 300);
}

TEST_CASE("objects: the same on foreign depth, detections and tracks") {
  Scene s;
  ExactTracks tracker;
  ObjectTracker native;
  ObjectTracker other;
  for (int k = 0; k < 12; ++k) {
    Slab slab;
    slab.x = -0.6 + 0.05 * k;
    s.render(Pose::Identity(), slab);
    const Both both(s, k);
    DynamicMask m;
    mask_from_labels(s.truth, m);
    Detection d;
    d.box = {static_cast<float>(20 + k), 30, 40, 60};
    d.score = 0.5F;
    d.class_id = 3;
    const std::vector<foreign::Box2d> boxes = foreign::boxes({d});
    std::vector<Detection> detections;
    (void)as_detections(boxes, detections);
    const std::list<foreign::Feature> features = foreign::features(tracker.follow(s, Pose::Identity(), slab));
    std::vector<PointTrack> tracks;
    (void)as_tracks(features, tracks);
    const std::vector<Detection> a = native.update(m, both.depth, detections, tracks);
    const std::size_t before = counting::bytes;
    std::vector<Detection> b;
    both.foreign_frame(k, [&](const auto& f) { b = other.update(m, f.depth(), boxes, features); });
    if (k >= 8) CHECK(counting::bytes - before < 320 * 240);
    REQUIRE(a.size() == 2);
    REQUIRE(b.size() == 2);
    for (std::size_t i = 0; i < 2; ++i) {
      CHECK(a[i].track_id == b[i].track_id);
      CHECK(a[i].box.x == b[i].box.x);
      CHECK(a[i].box.width == b[i].box.width);
      CHECK(a[i].class_id == b[i].class_id);
      CHECK(a[i].motion_probability == b[i].motion_probability);
    }
  }
}

TEST_CASE("a point of the map is present, gone, on what moves or unknown, the same on foreign types") {
  Scene then;
  Scene now;
  Slab slab;
  slab.x = -0.4;
  const Pose T_then = hand_held(0.3);
  then.render(T_then, slab);
  slab.x = 0.2;  // 0.6 m on: more than its width
  const Pose T_now = hand_held(0.9);
  now.render(T_now, slab);
  Image<float> moves(camera().width, camera().height, 0.0F);
  for (std::size_t i = 0; i < moves.size(); ++i) moves.data()[i] = now.truth.data()[i] != 0 ? 1.0F : 0.0F;
  const Both both(now, 0);
  const auto T_foreign = from_pose<foreign::DualQuaternionPose>(T_now);
  int counts[2][4] = {};  // of points on the wall, and on the slab as it stood
  int masked[4] = {};     // of points on the slab as it stands now, when the mask is given
  const auto look = [&](const Eigen::Vector3d& p, const AnyImage& mask) {
    const PointPresence seen = point_presence(p, to_pose(T_foreign), camera(), both.depth, mask);
    CHECK(point_presence(p, T_foreign, camera(), scaled(both.raw, kUnit), mask) == seen);
    return static_cast<std::size_t>(seen);
  };
  for (int y = 4; y < camera().height; y += 8) {
    for (int x = 4; x < camera().width; x += 8) {
      const double z = static_cast<double>(then.depth(x, y));
      const Eigen::Vector3d p = T_then * camera().unproject(x, y, z);
      ++counts[then.truth(x, y)][look(p, Image<float>())];
      if (now.truth(x, y) == 0) continue;
      const Eigen::Vector3d q = T_now * camera().unproject(x, y, static_cast<double>(now.depth(x, y)));
      ++masked[look(q, moves)];
      CHECK(look(q, Image<float>()) != static_cast<std::size_t>(PointPresence::Gone));
    }
  }
  const auto gone = static_cast<std::size_t>(PointPresence::Gone);
  const auto present = static_cast<std::size_t>(PointPresence::Present);
  const auto moving = static_cast<std::size_t>(PointPresence::Moving);
  CHECK(counts[0][gone] == 0);
  CHECK(counts[0][present] > 600);  // of 1200; the rest is out of sight, hidden by the slab or at an edge
  CHECK(counts[1][gone] > 3 * (counts[1][present] + counts[1][0]));
  CHECK(masked[moving] > 100);  // what moves is no proof that the point has gone, and none that it rests
  CHECK(masked[gone] + masked[present] == 0);
  // When the mask shows a body that has begun to move, the body lies beside its points: they are told by what moves close by.
  const Image<float> near(camera().width, camera().height, 2.2F);
  Image<float> beside(camera().width, camera().height, 0.0F);
  const Eigen::Vector2d u = camera().project(Eigen::Vector3d(0, 0, 2));
  beside(static_cast<int>(std::lround(u.x())) + 12, static_cast<int>(std::lround(u.y()))) = 1;
  CHECK(point_presence({0, 0, 2}, Pose::Identity(), camera(), near, beside) == PointPresence::Moving);
  CHECK(point_presence({0, 0, 2}, Pose::Identity(), camera(), Image<float>(camera().width, camera().height, 2.4F), beside) ==
        PointPresence::Gone);
  CHECK(point_presence({0, 0, 2}, Pose::Identity(), camera(), near, Image<float>()) == PointPresence::Gone);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(point_presence({0, 0, -1}, Pose::Identity(), camera(), both.depth, moves) == PointPresence::Unknown);
  CHECK(point_presence({9, 0, 1}, Pose::Identity(), camera(), both.depth, moves) == PointPresence::Unknown);
  CHECK(point_presence({nan, 0, 2}, Pose::Identity(), camera(), both.depth, moves) == PointPresence::Unknown);
}

}  // namespace
