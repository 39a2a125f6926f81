#include <cmath>

#include <doctest/doctest.h>

#include <apso/refinement/align.hpp>
#include <apso/refinement/cost/alignment_cost.hpp>
#include <apso/refinement/pyramid/pyramid.hpp>

#include "room.hpp"

using namespace apso;

namespace {
// An image that can be read pixel by pixel only.
struct Slow {
  Image<float> image;
};
}  // namespace
template <>
struct apso::image_traits<Slow> {
  using value_type = float;
  static int width(const Slow& s) { return s.image.width(); }
  static int height(const Slow& s) { return s.image.height(); }
  static float at(const Slow& s, int x, int y) { return s.image(x, y); }
};

namespace {
struct Focal {
  Pinhole p;
};
}  // namespace
template <>
struct apso::camera_traits<Focal> {
  static bool project(const Focal& c, const Eigen::Vector3d& X, Eigen::Vector2d& pixel) {
    pixel = c.p.project(X);
    return X.z() > 0;
  }
  static Eigen::Vector3d unproject(const Focal& c, const Eigen::Vector2d& u) { return c.p.unproject(u.x(), u.y(), 1); }
};

namespace {

PairOptions full_size() {
  PairOptions o;
  o.pyramid.finest = 0;
  return o;
}
double error_of(const PairAlignment<>& a, const Pose& truth = room::kTruth) {
  return room::translation_error(inverse(a.T_current_reference), truth);
}
}  // namespace

TEST_CASE("rows and single pixels give the same answer, and so does a camera type of the user's") {
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), {}, 1);
  const room::Frame c = room::render(room::kCamera, room::kTruth, {}, 2);
  const PairAlignment a = align(r.intensity, r.depth, c.intensity, c.depth, room::kCamera);
  const PairAlignment b = align(Slow{r.intensity}, Slow{r.depth}, Slow{c.intensity}, Slow{c.depth}, room::kCamera, Pose::Identity());
  REQUIRE(a.status == Status::Converged);
  CHECK((a.T_current_reference.matrix().array() == b.T_current_reference.matrix().array()).all());
  CHECK((a.detail.information.array() == b.detail.information.array()).all());
  const PairAlignment d = align(r.intensity, r.depth, c.intensity, c.depth, Focal{room::kCamera});
  CHECK((a.T_current_reference.matrix() - d.T_current_reference.matrix()).norm() < 1e-6);
}

TEST_CASE("a changed brightness is found and does not matter") {
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), {}, 1);
  room::Frame c = room::render(room::kCamera, room::kTruth, {}, 2);
  for (std::size_t i = 0; i < c.intensity.size(); ++i) c.intensity.data()[i] = 1.2F * c.intensity.data()[i] - .05F;
  PairOptions o = full_size();
  const PairAlignment with = align(r.intensity, r.depth, c.intensity, c.depth, room::kCamera, Pose::Identity(), o);
  o.alignment.illumination = false;
  const PairAlignment without = align(r.intensity, r.depth, c.intensity, c.depth, room::kCamera, Pose::Identity(), o);
  REQUIRE(succeeded(with.status));
  CHECK(static_cast<double>(with.detail.illumination.gain) == doctest::Approx(1.2).epsilon(.02));
  CHECK(static_cast<double>(with.detail.illumination.offset) == doctest::Approx(-.05).epsilon(.2).scale(0));
  CHECK(error_of(with) < .002);
  CHECK(error_of(with) < error_of(without));
}

TEST_CASE("the brightness of a few pixels is not believed") {
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), {}, 1);
  room::Frame c = room::render(room::kCamera, Pose::Identity(), {}, 2);
  for (std::size_t i = 0; i < c.intensity.size(); ++i) c.intensity.data()[i] *= 1.2F;
  const RobustKernel kernel;
  const NoiseModel noise;
  PyramidOptions full;
  full.finest = 0;
  FramePyramid current;
  current.build(c.view(), room::kCamera, {}, full);
  for (const int side : {8, 60}) {  // of the square that has depth: a border of two pixels is not compared, so that 16 are, and enough
    room::Frame part = r;
    part.depth.assign(room::kCamera.width, room::kCamera.height, 0.0F);
    for (int y = 100; y < 100 + side; ++y) {
      for (int x = 150; x < 150 + side; ++x) part.depth(x, y) = r.depth(x, y);
    }
    FramePyramid reference;
    reference.build(part.view(), room::kCamera, {}, full);
    AlignmentCost cost{AlignmentOptions{}};
    REQUIRE(cost.begin({{&reference, Pose::Identity(), 1}}, current, KernelRef(kernel), NoiseRef(noise), false));
    cost.enter(0);
    cost.estimate_scales(Pose::Identity(), AlignmentCost::kScaleSamples, 0, SerialExecutor{});
    cost.sum(Pose::Identity(), AlignmentCost::kAccepted, SerialExecutor{});
    CHECK(cost.counts().valid > 8);
    AlignmentResult result;
    cost.report_scales(result);
    CHECK(static_cast<double>(result.illumination.gain) == doctest::Approx(side == 8 ? 1.0 : 1.2).epsilon(side == 8 ? 1e-9 : .03));
  }
}

TEST_CASE("a moving body does not pull the pose when nobody says that it moves") {
  const room::Slab before{true, -.25, .45, 1.5};
  room::Slab after = before;
  after.x += .06;
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), before, 1);
  const room::Frame c = room::render(room::kCamera, room::kTruth, after, 2);
  CHECK(c.dynamic_share > .2);
  PairOptions o = full_size();
  const PairAlignment with = align(r.intensity, r.depth, c.intensity, c.depth, room::kCamera, Pose::Identity(), o);
  REQUIRE(succeeded(with.status));
  CHECK(error_of(with) < .004);
  CHECK(with.detail.static_share < .9);
  const room::Frame still = room::render(room::kCamera, room::kTruth, before, 2);
  const PairAlignment all = align(r.intensity, r.depth, still.intensity, still.depth, room::kCamera, Pose::Identity(), o);
  CHECK(all.detail.static_share > with.detail.static_share);
}

TEST_CASE("every policy aligns") {
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), {}, 1);
  const room::Frame c = room::render(room::kCamera, room::kTruth, {}, 2);
  const auto check = [&](const AlignmentOptions& alignment, double limit) {
    PairOptions o = full_size();
    o.alignment = alignment;
    const PairAlignment a = align(r.intensity, r.depth, c.intensity, c.depth, room::kCamera, Pose::Identity(), o);
    REQUIRE(succeeded(a.status));
    CHECK(error_of(a) < limit);
  };
  AlignmentOptions o;
  for (int kind = 0; kind <= static_cast<int>(KernelKind::AdaptiveBarron); ++kind) {
    CAPTURE(kind);
    o.kernel.kind = static_cast<KernelKind>(kind);
    check(o, .003);
  }
  o = {};
  o.graduated = true;
  check(o, .003);
  o = {};
  o.warp.esm = false;
  check(o, .003);
  for (const ScaleKind scale : {ScaleKind::StudentT, ScaleKind::MeanAbs}) {
    o = {};
    o.scale = scale;
    check(o, .003);
  }
  o = {};
  o.regions = false;
  o.prealign_rotation = false;
  check(o, .003);
  for (const ScaleCoupling coupling : {ScaleCoupling::Joint, ScaleCoupling::BivariateT}) {
    o = {};
    o.coupling = coupling;
    check(o, .003);
  }
  o = {};
  o.alpha_place = AlphaPlace::Inside;
  check(o, .003);
  check(static_fusion_alignment(), .02);
  check(paper_alignment(), .02);
}

namespace {
// As a user writes them.
struct OwnKernel {
  template <class T>
  T weight(const T& s2) const {
    return kernels::Cauchy{1.5}.weight(s2);
  }
  template <class T>
  T rho(const T& s2) const {
    return kernels::Cauchy{1.5}.rho(s2);
  }
};
struct OwnNoise {
  NoiseModel model;
  template <class T>
  T squared_weight_intensity(const NoiseInput<T>& p) const {
    return model.squared_weight_intensity(p);
  }
  template <class T>
  T squared_weight_depth(const NoiseInput<T>& p) const {
    return model.squared_weight_depth(p);
  }
};
}  // namespace

TEST_CASE("an aligner of a user's kernel and noise model gives what those of apso with the same formulas give") {
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), {}, 1);
  const room::Frame c = room::render(room::kCamera, room::kTruth, {}, 2);
  FramePyramid reference, current;
  reference.build(r.view(), room::kCamera, {}, full_size().pyramid, PyramidRole::Reference);
  current.build(c.view(), room::kCamera, {}, full_size().pyramid, PyramidRole::Current);
  AlignmentOptions options;
  options.kernel.k = 1.5;
  DirectAligner usual(options);
  BasicDirectAligner<OwnKernel, OwnNoise> own(options);
  BasicDirectAligner<OwnKernel, OwnNoise> moved(own);  // refers to nothing of the one it is a copy of
  const AlignmentResult a = usual.align({{&reference, Pose::Identity(), 1}}, current, {Pose::Identity()});
  REQUIRE(a.status == Status::Converged);
  for (BasicDirectAligner<OwnKernel, OwnNoise>* aligner : {&own, &moved}) {
    const AlignmentResult b = aligner->align({{&reference, Pose::Identity(), 1}}, current, {Pose::Identity()});
    CHECK((a.T_world_camera.matrix().array() == b.T_world_camera.matrix().array()).all());
    CHECK(a.cost == b.cost);
  }
}

TEST_CASE("the alpha that the residuals ask for is lower where bodies move") {
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), {}, 1);
  AlignmentOptions o;
  o.kernel.kind = KernelKind::AdaptiveBarron;
  const auto alpha = [&](const room::Slab& body) {
    const room::Frame c = room::render(room::kCamera, room::kTruth, body, 2);
    PairOptions pair = full_size();
    pair.alignment = o;
    const auto a = align(r.intensity, r.depth, c.intensity, c.depth, room::kCamera, Pose::Identity(), pair);
    CHECK(succeeded(a.status));
    return a.detail.kernel_alpha;
  };
  const double still = alpha({});
  const double moving = alpha({true, -.3, .4, 1.5});
  CHECK(still <= 2);
  CHECK(moving < still);
}

TEST_CASE("the way back must agree") {
  const room::Frame r = room::render(room::kCamera, Pose::Identity(), {}, 1);
  const room::Frame c = room::render(room::kCamera, room::kTruth, {}, 2);
  PairOptions o = full_size();
  o.backward = true;
  const PairAlignment a = align(r.intensity, r.depth, c.intensity, c.depth, room::kCamera, Pose::Identity(), o);
  CHECK(a.confidence > .5);
  CHECK(a.backward_translation < .005);
  CHECK(a.backward_translation > 0);
  const auto confidence_after = [&](const Pose& T_off, Status status) {
    PairAlignment<> forward = a;
    AlignmentResult back;
    back.status = status;
    back.T_world_camera = compose(T_off, inverse(a.detail.T_world_camera));
    detail::check_backward(back, forward);
    return forward.confidence;
  };
  CHECK(confidence_after(room::pose(.015, 0, 0, 0, .8, 0), Status::Converged) == a.confidence);
  CHECK(confidence_after(room::pose(.025, 0, 0, 0, 0, 0), Status::Converged) == 0);
  CHECK(confidence_after(room::pose(0, 0, 0, 0, 1.2, 0), Status::Converged) == 0);
  CHECK(confidence_after(Pose::Identity(), Status::NoOverlap) == 0);
}

TEST_CASE("nothing to see is never a success") {
  const room::Frame good = room::render(room::kCamera, Pose::Identity(), {}, 1);
  room::Frame blank = good, blind = good;
  for (std::size_t i = 0; i < blank.intensity.size(); ++i) {
    blank.intensity.data()[i] = .4F;  // a constant image, the depth is there
    blind.depth.data()[i] = 0;        // an image without any depth
  }
  const PairAlignment a = align(good.intensity, good.depth, blank.intensity, blank.depth, room::kCamera);
  CHECK((!succeeded(a.status) || a.confidence < .5));
  PairOptions by_depth;  // asked for, depth alone is enough where it determines the pose
  by_depth.alignment.depth_alone = true;
  const PairAlignment d = align(good.intensity, good.depth, blank.intensity, blank.depth, room::kCamera, Pose::Identity(), by_depth);
  REQUIRE(succeeded(d.status));
  CHECK(d.T_current_reference.translation().norm() < .002);
  CHECK_FALSE(succeeded(align(good.intensity, good.depth, blind.intensity, blind.depth, room::kCamera).status));
  CHECK_FALSE(succeeded(align(blind.intensity, blind.depth, good.intensity, good.depth, room::kCamera).status));
  Pinhole zero = room::kCamera;
  zero.fx = 0;
  CHECK_THROWS_AS((void)align(good.intensity, good.depth, good.intensity, good.depth, zero), contract_error);
  const Image<float> small(100, 100, 1.0F);
  CHECK_THROWS_AS((void)align(good.intensity, small, good.intensity, good.depth, room::kCamera), contract_error);
}

TEST_CASE("directions that are open, images that disagree and a vague pose lower the confidence") {
  AlignmentResult r;
  r.status = Status::Converged;
  r.median_depth = 2;
  r.correlation = 1;
  r.covariance.diagonal().setConstant(1e-12);
  CHECK(direct_confidence(r).c_dir == doctest::Approx(1));
  AlignmentResult worse = r;
  worse.status = Status::Degenerate;
  worse.degenerate_count = 1;  // the rest may be joined, but the pose as a whole is not known
  CHECK(direct_confidence(worse).c_dir == 0);
  CHECK(direct_confidence(worse).determined == direct_confidence(r).c_dir);
  worse = r;
  worse.correlation = .4;
  CHECK(direct_confidence(worse).c_dir == 0);
  worse = r;
  worse.status = Status::NoOverlap;
  CHECK(direct_confidence(worse).determined == 0);
  double last = 1;  // a direction that is vague is enough, and it is the worst that counts
  for (const double sigma : {.001, .003, .01, .03}) {
    worse = r;
    worse.covariance(1, 1) = sigma * sigma;
    const double c = direct_confidence(worse).c_dir;
    CHECK(c < last);
    worse.covariance(2, 2) = sigma * sigma / 2;
    CHECK(direct_confidence(worse).c_dir == doctest::Approx(c));
    last = c;
  }
  CHECK(last < .1);
  // one millimetre at one metre is as vague as two at two
  AlignmentResult near = r, far = r;
  near.median_depth = 1;
  near.covariance(0, 0) = 1e-6;
  far.covariance(0, 0) = 4e-6;
  CHECK(direct_confidence(near).c_dir == doctest::Approx(direct_confidence(far).c_dir));
}

TEST_CASE("the size of the residuals does not lower the confidence: blur and darkness raise it tenfold where the pose is right") {
  AlignmentResult r;
  r.status = Status::Converged;
  r.median_depth = 2;
  r.correlation = 1;
  r.covariance.diagonal().setConstant(1e-8);
  AlignmentResult dark = r;
  dark.scale_intensity = dark.scale_depth = 6.5;
  CHECK(direct_confidence(dark).c_dir == direct_confidence(r).c_dir);
}
