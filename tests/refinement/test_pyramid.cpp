#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <doctest/doctest.h>

#include <apso/refinement/pyramid/pyramid.hpp>

#include "room.hpp"

using namespace apso;

namespace {
room::Frame flat(const Pinhole& cam, float intensity, float depth) {
  room::Frame f;
  f.intensity.assign(cam.width, cam.height, intensity);
  f.depth.assign(cam.width, cam.height, depth);
  return f;
}

// f(pixel list, block, lane, column, row) for each pixel with depth.
template <class F>
void for_pixels(const PyramidLevel& level, F&& f) {
  const PixelList& list = level.pixels;
  for (int b = 0; b < list.blocks(); ++b) {
    for (int i = 0; i < PixelList::kBlock; ++i) {
      const auto z = static_cast<double>(list.at(b, PixelList::kZ, i));
      if (!(z > 0)) continue;
      const double x = level.camera.fx * static_cast<double>(list.at(b, PixelList::kX, i)) / z + level.camera.cx;
      const double y = level.camera.fy * static_cast<double>(list.at(b, PixelList::kY, i)) / z + level.camera.cy;
      f(list, b, i, static_cast<int>(std::lround(x)), static_cast<int>(std::lround(y)));
    }
  }
}
}  // namespace

TEST_CASE("gradients of white noise are as large as gradient_noise says") {
  const Pinhole cam = room::camera(640);
  room::Frame f = flat(cam, .5F, 2);
  constexpr double kNoise = .02;
  std::mt19937 rng(7);
  std::normal_distribution<double> normal(0, kNoise);
  for (int i = 0; i < cam.width * cam.height; ++i) f.intensity.data()[i] += static_cast<float>(normal(rng));
  for (const int finest : {0, 1, 2}) {
    PyramidOptions o;
    o.finest = finest;
    o.max_pixels = o.max_coarse_pixels = 0;
    o.sensor_noise = 0;  // keep all
    FramePyramid p;
    p.build(f.view(), cam, {}, o);
    for (int l = 0; l < 4; ++l) {
      double sum = 0;
      int n = 0;
      for_pixels(p.level(l), [&](const PixelList& list, int b, int i, int, int) {
        sum += static_cast<double>(list.at(b, PixelList::kGradient2, i));
        ++n;
      });
      CAPTURE(finest);
      CAPTURE(l);
      const double measured = std::sqrt(sum / n) / kNoise;
      CHECK(std::abs(measured / static_cast<double>(gradient_noise(finest + l, l == 0)) - 1) < .15);
    }
  }
}

TEST_CASE("the finest level is aligned smoothed, the others as they are halved") {
  const Pinhole cam = room::camera(160);
  room::Frame f = flat(cam, 0, 2);
  f.intensity(80, 60) = 1;
  PyramidOptions o;
  o.finest = 0;
  FramePyramid p;
  p.build(f.view(), cam, {}, o);
  const auto read = [&](int level, int x, int y) {
    const PyramidLevel& l = p.level(level);
    return l.texture[2 * static_cast<std::size_t>(y * l.camera.width + x)];
  };
  const float taps[3] = {.25F, .5F, .25F};
  float sum = 0;
  for (int y = 58; y <= 62; ++y) {
    for (int x = 78; x <= 82; ++x) {
      const bool near = std::abs(x - 80) < 2 && std::abs(y - 60) < 2;
      CHECK(read(0, x, y) == doctest::Approx(near ? taps[x - 79] * taps[y - 59] : 0.0F));
      sum += read(0, x, y);
    }
  }
  CHECK(sum == doctest::Approx(1));
  CHECK(p.level(0).intensity.row(60)[80] == 1.0F);
  CHECK(read(1, 40, 30) == doctest::Approx(.375 * .375));
  CHECK(read(1, 40, 30) == p.level(1).intensity.row(30)[40]);
}

TEST_CASE("levels are the same whether the first is kept or only passed through") {
  for (const int width : {640, 162}) {
    Pinhole cam = room::camera(width);
    cam.width -= 1;  // odd: the last column and row stand for nothing
    cam.height -= width == 640 ? 1 : 0;
    const room::Frame f = room::render(cam, Pose::Identity(), {}, 1);
    const std::vector<float> nothing(static_cast<std::size_t>(cam.width * cam.height), 0.0F);
    for (const int finest : {1, 2}) {
      PyramidOptions o;
      o.finest = finest;
      FramePyramid passed, kept;
      passed.build(f.view(), cam, {}, o);
      kept.build(f.view(), cam, ImageView<const float>(nothing.data(), cam.width, cam.height), o);
      REQUIRE(passed.size() == kept.size());
      for (int l = 0; l < kept.size(); ++l) {
        CHECK(passed.level(l).texture == kept.level(l).texture);
        CHECK(passed.level(l).pixels.data == kept.level(l).pixels.data);
        CHECK(passed.level(l).pixels.count > 100);
      }
    }
  }
}

TEST_CASE("where all pixels are taken each has its own point and gradients, and none at the border or without depth or weight is there") {
  const Pinhole cam = room::camera(160);
  room::Frame f = room::render(cam, Pose::Identity(), {}, 3);
  std::mt19937 rng(5);
  std::vector<float> probability(static_cast<std::size_t>(cam.width * cam.height), 0.0F);
  for (std::size_t i = 0; i < probability.size(); ++i) {
    if (rng() % 40 == 0) f.depth.data()[i] = 0;
    if (rng() % 40 == 0) probability[i] = 1;
  }
  PyramidOptions o;
  o.finest = 0;
  o.max_pixels = 0;
  o.sensor_noise = 0;  // keep all gradients
  FramePyramid p;
  p.build(f.view(), cam, ImageView<const float>(probability.data(), cam.width, cam.height), o);
  const PyramidLevel& level = p.level(0);
  int expected = 0;
  for (int y = 2; y < cam.height - 2; ++y) {
    for (int x = 2; x < cam.width - 2; ++x) expected += level.depth.row(y)[x] > 0 && level.gamma.row(y)[x] > 0 ? 1 : 0;
  }
  int found = 0;
  int different = 0;
  for_pixels(level, [&](const PixelList& list, int b, int i, int x, int y) {
    ++found;
    const float* z = level.depth.row(y) + x;
    const float* t = level.texture.data() + 2 * (y * cam.width + x);
    const float zx = 0.5F * (z[1] - z[-1]);
    const float zy = 0.5F * (level.depth.row(y + 1)[x] - level.depth.row(y - 1)[x]);
    const float gx = 0.5F * (t[2] - t[-2]);
    const float gy = 0.5F * (t[2 * cam.width] - t[-2 * cam.width]);
    const auto is = [&](PixelList::Field field, float value) { return std::abs(list.at(b, field, i) - value) <= 1e-5F * std::abs(value); };
    const bool intensity = list.at(b, PixelList::kGradient2, i) < 0 || is(PixelList::kGradient2, gx * gx + gy * gy);
    const bool depth = list.at(b, PixelList::kDepthGradient2, i) < 0 || is(PixelList::kDepthGradient2, zx * zx + zy * zy);
    different += is(PixelList::kZ, *z) && is(PixelList::kIntensity, *t) && is(PixelList::kGamma, 1) && intensity && depth ? 0 : 1;
  });
  CHECK(found == expected);
  CHECK(found > 10000);
  CHECK(different == 0);
}

TEST_CASE("a frame that is mostly masked has a level more, and no fewer pixels to align") {
  const Pinhole cam = room::camera(640);
  room::Frame f = room::render(cam, Pose::Identity(), {}, 1);
  f.probability.assign(cam.width, cam.height, 0.0F);
  const auto mask = [&](int columns) {
    for (int y = 0; y < cam.height; ++y) std::fill(&f.probability(0, y), &f.probability(0, y) + columns, 1.0F);
    return f.probability.view();
  };
  PyramidOptions o;
  FramePyramid whole, p;
  whole.build(f.view(), cam, {}, o);
  p.build(f.view(), cam, mask(250), o);  // 39 %
  CHECK(p.finest() == 1);
  CHECK(p.size() == whole.size());
  p.build(f.view(), cam, mask(400), o);
  CHECK(p.finest() == 0);
  CHECK(p.nominal_finest() == 1);
  REQUIRE(p.size() == whole.size() + 1);
  CHECK(p.level(0).camera.width == 640);
  CHECK(p.level(1).camera.width == 320);
  CHECK(p.level(0).pixels.count > 20000);  // one of 2 x 2, as at the usual finest level
  CHECK(p.level(0).texture.size() == 2 * 640 * 480);
  o.finer_level_mask_share = 1;
  p.build(f.view(), cam, f.probability.view(), o);
  CHECK(p.finest() == 1);
  o.finer_level_mask_share = 0;
  o.finest = 0;  // there is none finer
  p.build(f.view(), cam, f.probability.view(), o);
  CHECK(p.finest() == 0);
}

TEST_CASE("what is masked does not mix into what is not, at any level") {
  const Pinhole cam = room::camera(160);
  room::Frame f = flat(cam, .3F, 2);
  std::vector<float> probability(static_cast<std::size_t>(cam.width * cam.height), 0.0F);
  for (int y = 0; y < cam.height; ++y) {
    for (int x = 71; x < cam.width; ++x) {
      f.intensity(x, y) = .9F;
      probability[static_cast<std::size_t>(y * cam.width + x)] = 1;
    }
  }
  PyramidOptions o;
  o.finest = 0;
  o.sensor_noise = 0;
  FramePyramid p;
  p.build(f.view(), cam, ImageView<const float>(probability.data(), cam.width, cam.height), o);
  CHECK(p.masked());
  for (int l = 0; l < p.size(); ++l) {
    int n = 0;
    for_pixels(p.level(l), [&](const PixelList& list, int b, int i, int, int) {
      CHECK(list.at(b, PixelList::kIntensity, i) == doctest::Approx(.3).epsilon(1e-5));
      ++n;
    });
    CHECK(n > 0);
  }
}

TEST_CASE("an intensity that is no number has no weight and does not mix into others, where nothing is masked") {
  const Pinhole cam = room::camera(160);
  room::Frame f = flat(cam, .3F, 2);
  f.intensity(80, 60) = std::nanf("");
  PyramidOptions o;
  o.finest = 0;
  o.sensor_noise = 0;
  FramePyramid p;
  p.build(f.view(), cam, {}, o);
  CHECK_FALSE(p.masked());
  for (int l = 0; l < p.size(); ++l) {
    int n = 0;
    for_pixels(p.level(l), [&](const PixelList& list, int b, int i, int x, int y) {
      CHECK(list.at(b, PixelList::kIntensity, i) == doctest::Approx(.3).epsilon(1e-5));
      if (l == 0) CHECK((x != 80 || y != 60));
      ++n;
    });
    CHECK(n > 0);
  }
}

TEST_CASE("a tile knows the mean depth of its pixels") {
  const Pinhole cam = room::camera(160);
  room::Frame f = flat(cam, .3F, 2);
  for (int y = 0; y < cam.height; ++y) {
    for (int x = 0; x < cam.width; ++x) f.depth(x, y) = 2 + .01F * static_cast<float>(x);
  }
  PyramidOptions o;
  o.finest = 0;
  o.max_pixels = 0;
  FramePyramid p;
  p.build(f.view(), cam, {}, o);
  const PixelList& list = p.level(0).pixels;
  int seen = 0;
  for (std::size_t k = 0; k < list.tiles.size(); ++k) {
    if (list.tiles[k].count == 0) continue;
    const int first = static_cast<int>(k) % list.columns * list.tile_side;  // two columns at the border of the image are left out
    const int from = std::max(first, 2), to = std::min(first + list.tile_side, cam.width - 2);
    CHECK(list.tiles[k].depth == doctest::Approx(2 + .01 * (.5 * (from + to - 1))).epsilon(1e-5));
    ++seen;
  }
  CHECK(seen > 100);
}

TEST_CASE("behind an edge and beside a hole the intensity is not compared; on the edge of what is in front it is") {
  const Pinhole cam = room::camera(160);
  room::Frame f = flat(cam, .2F, 3);
  for (int y = 0; y < cam.height; ++y) {
    for (int x = 0; x < cam.width; ++x) {
      f.intensity(x, y) = .2F + .004F * static_cast<float>(x);  // texture everywhere
      if (x >= 40 && x < 80) f.depth(x, y) = 1.5F;              // something in front
      if (x >= 120 && x < 124) f.depth(x, y) = 0;
    }
  }
  PyramidOptions o;
  o.finest = 0;
  o.levels = 1;
  o.max_pixels = 0;
  o.sensor_noise = 0;
  FramePyramid p;
  p.build(f.view(), cam, {}, o);
  int seen[3] = {0, 0, 0};
  for_pixels(p.level(0), [&](const PixelList& list, int b, int i, int x, int y) {
    if (y < 4 || y >= cam.height - 4 || x < 4 || x >= cam.width - 4) return;
    const bool behind = (x >= 38 && x < 40) || (x >= 80 && x < 82);
    const bool beside = (x >= 118 && x < 120) || (x >= 124 && x < 126);
    CAPTURE(x);
    const bool compared = list.at(b, PixelList::kGradient2, i) >= 0;
    CHECK(compared == !(behind || beside));
    CHECK((list.at(b, PixelList::kI0, i) != 0.0F) == compared);
    ++seen[behind ? 0 : (beside ? 1 : 2)];
  });
  CHECK(seen[0] > 300);
  CHECK(seen[1] > 300);
  CHECK(seen[2] > 10000);
}
