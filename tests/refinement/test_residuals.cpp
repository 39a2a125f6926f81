#include <algorithm>
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include <apso/refinement/cost/scale/residual_samples.hpp>
#include <apso/refinement/cost/tile_summer.hpp>

#include "room.hpp"

using namespace apso;

namespace {
const Pinhole kTinyCamera{100, 110, 31.5, 23.5, 64, 48};

// Intensity and depth linear in the pixel: bilinear reading and central differences of the grid are both exact.
double intensity_at(const Eigen::Vector2d& u) { return .2 + .004 * u.x() + .003 * u.y(); }
double depth_at(const Eigen::Vector2d& u) { return 2 + .005 * u.x() - .004 * u.y(); }

room::Frame linear_frame() {
  room::Frame f;
  f.intensity.resize(kTinyCamera.width, kTinyCamera.height);
  f.depth.resize(kTinyCamera.width, kTinyCamera.height);
  for (int y = 0; y < kTinyCamera.height; ++y) {
    for (int x = 0; x < kTinyCamera.width; ++x) {
      f.intensity(x, y) = static_cast<float>(intensity_at({x, y}));
      f.depth(x, y) = static_cast<float>(depth_at({x, y}));
    }
  }
  return f;
}
PyramidOptions one_level() {
  PyramidOptions o;
  o.finest = 0;
  o.levels = 1;
  o.sensor_noise = 0;  // exact images: any gradient is one
  return o;
}
// A noise model as a user writes it.
struct ConstantNoise {
  template <class T>
  T squared_weight_intensity(const NoiseInput<T>&) const {
    return T(1 / (.02 * .02));
  }
  template <class T>
  T squared_weight_depth(const NoiseInput<T>&) const {
    return T(1 / (.01 * .01));
  }
};
double lane(const Lanes& l, int i) { return static_cast<double>(l[i]); }

// All pixels of a list, one by one.
template <class F>
void for_pixels(const PixelList& list, const Warper& warp, F&& f, const NoiseModel& noise = {}) {
  for (int b = 0; b < list.blocks(); ++b) {
    for (int at = 0; at < PixelList::kBlock; at += kLanes) {
      WarpedLanes o;
      warp.warp(noise, list.block(b), at, o);
      for (int i = 0; i < kLanes; ++i) {
        if (o.selected[i] != 0) f(o, i);
      }
    }
  }
}
}  // namespace

TEST_CASE("the noise models weigh by their formulas") {
  NoiseOptions o;
  const double sigma = static_cast<double>(o.sigma_intensity);
  const NoiseInput<double> p{.1, 9e-4, 2.5, 2.4, 3.0, -4.0, 2.0, 100.0, 110.0};
  const NoiseModel sensor(o);
  CHECK(1 / sensor.squared_weight_intensity(p) == doctest::Approx(2 * sigma * sigma + 9e-4 * .09).epsilon(1e-6));
  const double a = 1.425e-3 * 2.5 * 2.5, b = 1.425e-3 * 2.4 * 2.4;
  CHECK(1 / sensor.squared_weight_depth(p) == doctest::Approx(a * a + b * b + 9e-4 * .09).epsilon(1e-6));
  o.form = NoiseForm::StaticFusion;
  const NoiseModel fusion(o);
  const double slopes = .1 + 3.0 * 2 / 100 + 4.0 * 2 / 110;
  CHECK(1 / fusion.squared_weight_intensity(p) == doctest::Approx(1 + 10 * slopes).epsilon(1e-6));
  CHECK(.01 / fusion.squared_weight_depth(p) == doctest::Approx(.01 + 200 * slopes).epsilon(1e-6));
}

TEST_CASE("derivatives of both residuals equal central differences") {
  FramePyramid p;
  p.build(linear_frame().view(), kTinyCamera, {}, one_level());
  for (const bool esm : {false, true}) {
    WarpOptions options;
    options.esm = esm;
    const Warper warp(p.level(0), Pose::Identity(), {}, options, 1.0F, 1.0F);
    int checked = 0;
    for_pixels(p.level(0).pixels, warp, [&](const WarpedLanes& o, int i) {
      if (!(o.weight_depth[i] > 0) || checked++ % 37 != 0) return;
      const Eigen::Vector3d X(lane(o.X[0], i), lane(o.X[1], i), lane(o.X[2], i));
      const Eigen::Vector3d a(lane(o.I[0], i), lane(o.I[1], i), lane(o.I[2], i));
      const Eigen::Vector3d d(lane(o.D[0], i), lane(o.D[1], i), lane(o.D[2], i));
      Twist ji, jd, ni, nd, gi, gd;
      ji << a, X.cross(a);
      jd << d, X.cross(d);
      const Eigen::Matrix<double, 2, 3> Jp = kTinyCamera.project_jacobian(X);  // the same formula in double
      const Eigen::Vector3d ea = Jp.transpose() * Eigen::Vector2d(.004, .003);
      const Eigen::Vector3d ed = Jp.transpose() * Eigen::Vector2d(.005, -.004) - Eigen::Vector3d::UnitZ();
      gi << ea, X.cross(ea);
      gd << ed, X.cross(ed);
      for (int k = 0; k < 6; ++k) {
        Twist e = Twist::Zero();
        e(k) = 1e-5;
        const Eigen::Vector3d plus = se3_exp(e) * X;
        const Eigen::Vector3d minus = se3_exp(-e) * X;
        ni(k) = (intensity_at(kTinyCamera.project(plus)) - intensity_at(kTinyCamera.project(minus))) / 2e-5;
        nd(k) = (depth_at(kTinyCamera.project(plus)) - plus.z() - depth_at(kTinyCamera.project(minus)) + minus.z()) / 2e-5;
      }
      CHECK((gi - ni).norm() < 1e-6 * ni.norm());  // the formula
      CHECK((gd - nd).norm() < 1e-6 * nd.norm());
      CHECK((ji - ni).norm() < 1e-3 * ni.norm());  // what the float loop makes of it
      CHECK((jd - nd).norm() < 1e-3 * nd.norm());
    });
    CHECK(checked > 500);
  }
}

TEST_CASE("samples for the scales are of all of the image: where there is room for all pixels, these are all") {
  const room::Frame f = linear_frame();
  FramePyramid pyramid;
  pyramid.build(f.view(), kTinyCamera, {}, one_level());
  const PixelList& list = pyramid.level(0).pixels;
  const Warper warp(pyramid.level(0), room::pose(.02, -.01, .03, 1, -2, 3), {}, {}, 1.0F, 1.0F);
  const NoiseModel noise;
  std::size_t both[2] = {};
  for_pixels(list, warp, [&](const WarpedLanes& o, int i) {
    both[0] += o.weight_intensity[i] > 0 ? 1 : 0;
    both[1] += o.weight_depth[i] > 0 ? 1 : 0;
  });
  CHECK(both[0] > 1000);
  ResidualSamples samples;
  samples.take(list, warp, NoiseRef(noise), 2 * kTinyCamera.width * kTinyCamera.height, false, SerialExecutor{});
  CHECK(samples.intensity.residuals.size() == both[0]);
  CHECK(samples.depth.residuals.size() == both[1]);
}

TEST_CASE("with esm, the mean of the gradients of both images is used, turned into the reference") {
  // the current image has another gradient than the reference, and the camera has turned by a quarter
  room::Frame f = linear_frame();
  FramePyramid reference, current;
  reference.build(f.view(), kTinyCamera, {}, one_level());
  for (int y = 0; y < kTinyCamera.height; ++y) {
    for (int x = 0; x < kTinyCamera.width; ++x) f.intensity(x, y) = .5F + .006F * static_cast<float>(x) - .002F * static_cast<float>(y);
  }
  current.build(f.view(), kTinyCamera, {}, one_level());
  const Pose T = room::pose(.02, -.01, .03, 1, -2, 30);
  WarpOptions options;
  options.gate = 0;
  options.esm = true;
  const Warper warp(current.level(0), T, {}, options, 1.0F, 1.0F);
  int checked = 0;
  for_pixels(reference.level(0).pixels, warp, [&](const WarpedLanes& o, int i) {
    if (o.valid[i] == 0 || checked++ % 37 != 0) return;
    const Eigen::Vector3d X(lane(o.X[0], i), lane(o.X[1], i), lane(o.X[2], i));
    const Eigen::Vector3d Y = T * X;
    const Eigen::Vector3d mean = .5 * (kTinyCamera.project_jacobian(X).transpose() * Eigen::Vector2d(.004, .003) +
                                       T.linear().transpose() * kTinyCamera.project_jacobian(Y).transpose() * Eigen::Vector2d(.006, -.002));
    const Eigen::Vector3d a(lane(o.I[0], i), lane(o.I[1], i), lane(o.I[2], i));
    CHECK((a - mean).norm() < 1e-3 * mean.norm());
  });
  CHECK(checked > 300);
}

TEST_CASE("the fused pass sums what a plain loop in double sums, for every kernel and both noise models") {
  const Pinhole cam = room::camera(160);
  PyramidOptions po = one_level();
  po.max_pixels = 3000;
  FramePyramid reference, current;
  const room::Frame r = room::render(cam, Pose::Identity(), {}, 1);
  const room::Frame c = room::render(cam, room::pose(.01, 0, .01, .3, .4, 0), {true, -.3, .4, 1.4}, 2);
  reference.build(r.view(), cam, {}, po);
  current.build(c.view(), cam, c.probability, po);  // with weights in the current frame
  const Pose T = inverse(room::pose(.012, .001, .008, .25, .5, .1));
  const PixelList& list = reference.level(0).pixels;
  CHECK(list.count > 1500);
  CHECK(list.count <= 3000);
  TermScales scales;
  scales.scale_intensity = 1.7;
  scales.scale_depth = .6;
  scales.alpha = 2;
  for (const AlphaPlace place : {AlphaPlace::Outside, AlphaPlace::Inside})
    for (const NoiseForm form : {NoiseForm::Sensor, NoiseForm::StaticFusion}) {
      scales.place = place;
      for (int kind = 0; kind <= static_cast<int>(KernelKind::AdaptiveBarron); ++kind) {
        RobustKernel kernel;
        kernel.kind = static_cast<KernelKind>(kind);
        NoiseOptions noise_options;
        noise_options.form = form;
        const NoiseModel noise(noise_options);
        const Warper warp(current.level(0), T, {1.02F, -.01F}, {}, 1.0F, 1.0F);
        TileSummer summer(warp, NoiseRef(noise), KernelRef(kernel), scales), cost_alone(warp, NoiseRef(noise), KernelRef(kernel), scales);
        NormalEquations sum, plain;
        double cost = 0, weight = 0, plain_cost = 0, plain_weight = 0;
        int plain_valid = 0;
        for (const PixelList::Tile& tile : list.tiles) {
          TileSums s;
          summer(list, tile, s);
          sum += s.equations();
          cost += static_cast<double>(s.cost);
          weight += static_cast<double>(s.weight);
          TileSums alone{};
          cost_alone.cost(list, tile, alone);
          CHECK(alone.cost == doctest::Approx(s.cost).epsilon(1e-5));
          CHECK(alone.weight == doctest::Approx(s.weight).epsilon(1e-5));
          CHECK(alone.lost == doctest::Approx(s.lost).epsilon(1e-5));
        }
        CHECK(cost_alone.counts().valid == summer.counts().valid);
        CHECK(cost_alone.counts().selected == summer.counts().selected);
        for_pixels(
            list, warp,
            [&](const WarpedLanes& o, int i) {
              const Eigen::Vector3d X(lane(o.X[0], i), lane(o.X[1], i), lane(o.X[2], i));
              const bool inside = place == AlphaPlace::Inside;
              const double a2 = inside ? 1 : scales.alpha * scales.alpha;
              const double lost = lane(o.lost, i);
              plain_cost += lost * (inside ? kernel.rho(3) + kernel.rho(3 * scales.alpha) : (1 + a2) * kernel.rho(3));
              plain_weight += lost * (1 + a2);
              plain_valid += o.valid[i] != 0 ? 1 : 0;
              for (const bool photometric : {true, false}) {
                const Eigen::Vector3d a = photometric ? Eigen::Vector3d(lane(o.I[0], i), lane(o.I[1], i), lane(o.I[2], i))
                                                      : Eigen::Vector3d(lane(o.D[0], i), lane(o.D[1], i), lane(o.D[2], i));
                const double residual = lane(photometric ? o.residual_intensity : o.residual_depth, i);
                const double gamma = lane(photometric ? o.weight_intensity : o.weight_depth, i) * (photometric ? a2 : 1);
                const double scale = photometric ? scales.scale_intensity : scales.scale_depth;
                const double g = std::sqrt(lane(photometric ? o.inverse_intensity : o.inverse_depth, i)) / scale *
                                 (photometric && inside ? scales.alpha : 1);
                Twist J;
                J << a, X.cross(a);
                const double q = gamma * kernel.weight(g * residual) * g * g;
                plain.H += q * J * J.transpose();
                plain.b -= q * residual * J;
                plain_cost += gamma * kernel.rho(g * residual);
                plain_weight += gamma;
              }
            },
            noise);
        CAPTURE(kind);
        const WarpCounts counts = summer.counts();
        CHECK(counts.valid == plain_valid);
        CHECK(counts.selected == list.count);
        CHECK(counts.valid + counts.out_of_view + counts.occluded + counts.disoccluded + counts.masked == counts.selected);
        CHECK(counts.masked > 0);
        CHECK(cost == doctest::Approx(plain_cost).epsilon(1e-4));
        CHECK(weight == doctest::Approx(plain_weight).epsilon(1e-4));
        CHECK((sum.H - plain.H).norm() < 1e-4 * plain.H.norm());
        CHECK((sum.b - plain.b).norm() < 1e-3 * plain.b.norm());
      }
    }
}

TEST_CASE("the right side of the equations is the slope of the cost, wherever alpha stands and with the kernel of a pair") {
  FramePyramid reference, current;
  room::Frame f = linear_frame();
  reference.build(f.view(), kTinyCamera, {}, one_level());
  for (std::size_t i = 0; i < f.intensity.size(); ++i) f.intensity.data()[i] += .02F;  // residuals of their own size
  current.build(f.view(), kTinyCamera, {}, one_level());
  const PixelList& list = reference.level(0).pixels;
  const Pose T0 = room::pose(.001, -.0004, .002, .02, -.03, .01);  // the derivatives are those of aligned images
  const ConstantNoise noise;
  WarpOptions options;
  options.esm = false;
  options.gate = 0;
  const RobustKernel cauchy;
  const kernels::BivariateT pair;
  TermScales outside{1.3, .8, 2.0, AlphaPlace::Outside, ScaleCoupling::Separate, 0};
  TermScales inside{1.3, .8, .6, AlphaPlace::Inside, ScaleCoupling::Joint, 0};
  TermScales joint{1.1, .9, 1.0, AlphaPlace::Outside, ScaleCoupling::BivariateT, .4};
  for (const TermScales& scales : {outside, inside, joint}) {
    const bool bivariate = scales.coupling == ScaleCoupling::BivariateT;
    const auto sums = [&](const Pose& T, double& cost) {
      const Warper warp(current.level(0), T, {}, options, 1.0F, 1.0F);
      TileSummer summer(warp, NoiseRef(noise), bivariate ? KernelRef(pair) : KernelRef(cauchy), scales);
      NormalEquations n;
      cost = 0;
      for (int row = 1; row + 1 < list.rows; ++row) {  // what is at the border leaves the image
        for (int column = 1; column + 1 < list.columns; ++column) {
          TileSums s;
          summer(list, list.tiles[static_cast<std::size_t>(row * list.columns + column)], s);
          n += s.equations();
          cost += static_cast<double>(s.cost) / (bivariate ? 2 : 1);  // counted for both residuals
        }
      }
      CHECK(summer.counts().out_of_view == 0);
      return n;
    };
    double at = 0;
    const NormalEquations n = sums(T0, at);
    CHECK(at > 100);
    for (int k = 0; k < 6; ++k) {
      const double h = 2e-3;
      Twist e = Twist::Zero();
      e(k) = h;
      double up = 0, down = 0;
      (void)sums(T0 * se3_exp(e), up);
      (void)sums(T0 * se3_exp(-e), down);
      CAPTURE(k);
      CHECK(std::abs((up - down) / (2 * h) + n.b(k)) < .01 * n.b.norm());
    }
  }
}

TEST_CASE("equations for an increment on the right, moved to the left") {
  NormalEquations n;
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Random();
  n.H = A * A.transpose();
  n.b = Eigen::Matrix<double, 6, 1>::Random();
  const Pose T = room::pose(.3, -.2, .5, 20, -30, 40);
  const NormalEquations left = moved_to_left(n, T);
  for (int k = 0; k < 6; ++k) {
    Twist d = Twist::Zero();
    d(k) = .01;
    const Twist e = se3_log(T * se3_exp(d) * inverse(T));  // T Exp(d) = Exp(e) T
    CHECK(left.b.dot(e) == doctest::Approx(n.b.dot(d)).epsilon(1e-9));
    CHECK(e.dot(left.H * e) == doctest::Approx(d.dot(n.H * d)).epsilon(1e-9));
  }
}

TEST_CASE("a point in front of or behind the surface is gated, and the gate grows with the level") {
  const Pinhole cam = room::camera(160);
  room::Frame f = room::render(cam, Pose::Identity());
  FramePyramid p;
  p.build(f.view(), cam, {}, one_level());
  const auto count = [&](double dz, float factor) {
    Pose T = Pose::Identity();
    T.translation().z() = dz;
    const Warper warp(p.level(0), T, {}, {}, factor, 1.0F);
    const NoiseModel noise;
    const RobustKernel kernel;
    TileSummer summer(warp, NoiseRef(noise), KernelRef(kernel), {});
    TileSums s;
    for (const PixelList::Tile& t : p.level(0).pixels.tiles) summer(p.level(0).pixels, t, s);
    return summer.counts();
  };
  CHECK(count(.02, 1).valid > .9 * count(0, 1).valid);
  CHECK(count(.3, 1).occluded > .8 * count(0, 1).valid);
  CHECK(count(-.3, 1).disoccluded > .8 * count(0, 1).valid);
  CHECK(count(.3, 5).valid > .8 * count(0, 1).valid);
}
