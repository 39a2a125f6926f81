#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include <apso/testing/synthetic.hpp>

using namespace apso;
using namespace apso::testing;

namespace {

SyntheticOptions small(int people = 2) {
  SyntheticOptions o;
  o.width = 320;
  o.height = 240;
  o.people = people;
  return o;
}

template <class T>
bool same(const Image<T>& a, const Image<T>& b) {
  return a.width() == b.width() && a.height() == b.height() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}
bool same(const SyntheticFrame& a, const SyntheticFrame& b) {
  return a.timestamp == b.timestamp && same(a.rgb, b.rgb) && same(a.intensity, b.intensity) && same(a.depth, b.depth) &&
         same(a.instance, b.instance) && a.T_world_camera.matrix() == b.T_world_camera.matrix();
}

double degrees(double radians) { return radians * 180 / kPi; }

/// Largest and mean angular speed [deg/s] and mean speed [m/s] of a recording.
struct Profile {
  double fastest_turn = 0, mean_turn = 0, mean_speed = 0, largest_turn = 0, reach = 0;
};
Profile profile(const SyntheticSequence& s) {
  Profile p;
  const Pose first = s.T_world_camera(0);
  for (int i = 0; i + 1 < s.size(); ++i) {
    const Pose step = inverse(s.T_world_camera(i)) * s.T_world_camera(i + 1);
    const double dt = s.timestamp(i + 1) - s.timestamp(i);
    const double turn = degrees(rotation_angle(step)) / dt;
    p.fastest_turn = std::max(p.fastest_turn, turn);
    p.mean_turn += turn / (s.size() - 1);
    p.mean_speed += step.translation().norm() / dt / (s.size() - 1);
    const Pose total = inverse(first) * s.T_world_camera(i + 1);
    p.largest_turn = std::max(p.largest_turn, degrees(rotation_angle(total)));
    p.reach = std::max(p.reach, total.translation().norm());
  }
  return p;
}

}  // namespace

TEST_CASE("a frame depends on nothing but name, options and number") {
  const SyntheticSequence a("walking_rpy", small());
  const SyntheticSequence b("walking_rpy", small());
  SyntheticFrame f3, f90, again;
  a.render(3, f3);
  a.render(90, f90);
  b.render(90, again);
  CHECK(same(f90, again));
  b.render(3, again);  // backwards, into used images
  CHECK(same(f3, again));
  CHECK_FALSE(same(f3, f90));
}

TEST_CASE("another seed makes another recording") {
  SyntheticOptions o = small(0);
  const SyntheticSequence a("static_static", o);
  o.seed = 2;
  const SyntheticSequence b("static_static", o);
  SyntheticFrame fa, fb;
  a.render(0, fa);
  b.render(0, fb);
  CHECK_FALSE(same(fa.rgb, fb.rgb));
  CHECK(fa.T_world_camera.matrix() != fb.T_world_camera.matrix());
}

TEST_CASE("names and options are checked") {
  for (const std::string& name : SyntheticSequence::names()) CHECK_NOTHROW(SyntheticSequence(name, small(0)));
  try {
    SyntheticSequence("walking_xzy", small());
    FAIL("an unknown name was taken");
  } catch (const contract_error& e) {
    for (const std::string& name : SyntheticSequence::names()) CHECK(std::string(e.what()).find(name) != std::string::npos);
  }
  SyntheticOptions o = small();
  o.people = 4;
  CHECK_THROWS_AS(SyntheticSequence("walking_xyz", o), contract_error);
  const SyntheticSequence s("static_xyz", small());
  SyntheticFrame f;
  CHECK_THROWS_AS(s.render(-1, f), contract_error);
  CHECK_THROWS_AS(s.render(s.size(), f), contract_error);
}

TEST_CASE("stress recordings are hard where they say so, and as calm as static_xyz elsewhere") {
  SyntheticOptions o = small();
  o.exposure_drift = false;
  const SyntheticSequence calm("static_xyz", o);
  SyntheticFrame f, g;
  const auto mean = [](const Image<float>& im) {
    double s = 0;
    for (std::size_t i = 0; i < im.size(); ++i) s += static_cast<double>(im.data()[i]);
    return s / static_cast<double>(im.size());
  };
  const auto energy = [](const Image<float>& im) {  // of horizontal and vertical differences
    double s = 0;
    for (int y = 1; y < im.height(); ++y) {
      for (int x = 1; x < im.width(); ++x) {
        const double dx = static_cast<double>(im(x, y) - im(x - 1, y));
        const double dy = static_cast<double>(im(x, y) - im(x, y - 1));
        s += dx * dx + dy * dy;
      }
    }
    return s;
  };
  for (const std::string kind : {"ceiling", "roll", "crowd", "dark", "flash", "dropout"}) {
    CAPTURE(kind);
    const SyntheticSequence s("stress_" + kind, o);
    int labelled = 0;
    int first = -1;
    for (int i = 0; i < s.size(); ++i) {
      const bool hard = s.stress(i) != Stress::None;
      if (hard) CHECK(to_string(s.stress(i)) == kind);
      labelled += hard;
      if (hard && first < 0) first = i;
    }
    CHECK(labelled > 30);
    CHECK(labelled < 180);
    REQUIRE(first > 45);  // time to begin in peace
    calm.render(20, g);
    s.render(20, f);
    CHECK(f.stress == Stress::None);
    CHECK(same(f.instance, g.instance));
    CHECK(f.T_world_camera.matrix() == g.T_world_camera.matrix());
    for (const int i : {first + (kind == "ceiling" ? 16 : 2), first + (kind == "ceiling" ? 17 : 3)}) {
      calm.render(i, g);
      s.render(i, f);
      REQUIRE(f.stress == s.stress(i));
      if (kind == "ceiling") CHECK(energy(f.intensity) < 0.05 * energy(g.intensity));
      if (kind == "roll") CHECK(energy(f.intensity) < 0.35 * energy(g.intensity));
      if (kind == "crowd") CHECK((dynamic_share(f) > 0.6 && dynamic_share(f) < 0.95));
      if (kind == "dark") CHECK(mean(f.intensity) < 0.15 * mean(g.intensity));
      if (kind == "flash") CHECK(mean(f.intensity) > 0.9);
      if (kind == "dropout") CHECK(mean(f.depth) == 0);
    }
  }
  o.frames = 540;
  const SyntheticSequence all("stress_all", o);
  std::vector<int> seen(enum_names(Stress{}).size(), 0);
  for (int i = 0; i < all.size(); ++i) ++seen[static_cast<std::size_t>(all.stress(i))];
  for (const int n : seen) CHECK(n > 8);
}

TEST_CASE("sizes, ranges and the camera") {
  const SyntheticSequence s("walking_xyz", small());
  SyntheticFrame f;
  s.render(7, f);
  CHECK(f.rgb.width() == 3 * 320);
  CHECK(f.depth.height() == 240);
  CHECK(f.timestamp == doctest::Approx(7 / 30.0));
  const Eigen::Matrix3d r = f.T_world_camera.linear();
  CHECK((r * r.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-12);
  bool good = true;
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) {
      const float i = (0.299F * static_cast<float>(f.rgb(3 * x, y)) + 0.587F * static_cast<float>(f.rgb(3 * x + 1, y)) +
                       0.114F * static_cast<float>(f.rgb(3 * x + 2, y))) /
                      255.0F;
      good = good && std::abs(i - f.intensity(x, y)) < 1e-5F && f.intensity(x, y) >= 0 && f.intensity(x, y) <= 1.0001F;
      good = good && f.depth(x, y) >= 0 && f.depth(x, y) < 9 && f.instance(x, y) <= 2;
    }
  }
  CHECK(good);
  // freiburg3 at full size; a pixel at half size covers 2x2 pixels
  const Pinhole full = freiburg3_camera();
  CHECK(full.fx == doctest::Approx(535.4));
  CHECK(full.cy == doctest::Approx(247.6));
  CHECK(s.camera().cx == doctest::Approx(full.halved().cx));
  CHECK(s.camera().fy == doctest::Approx(full.halved().fy));
}

TEST_CASE("exact frames agree when warped by the exact poses") {
  for (const char* name : {"walking_xyz", "walking_halfsphere", "walking_rpy", "walking_static", "walking_360"}) {
    CAPTURE(name);
    SyntheticOptions o = small();
    o.noise = o.blur = o.exposure_drift = false;
    const SyntheticSequence s(name, o);
    SyntheticFrame a, b;
    s.render(20, a);
    s.render(26, b);
    const Pinhole& camera = s.camera();
    const Pose T_b_a = inverse(b.T_world_camera) * a.T_world_camera;
    int inside = 0, compared = 0, agree = 0;
    double difference = 0;
    for (int y = 2; y < camera.height - 2; ++y) {
      for (int x = 2; x < camera.width - 2; ++x) {
        if (a.instance(x, y) != 0) continue;
        const Eigen::Vector3d at_a = camera.unproject(x, y, static_cast<double>(a.depth(x, y)));
        const Eigen::Vector3d p = T_b_a * at_a;
        if (p.z() < 0.2) continue;
        const Eigen::Vector2d u = camera.project(p);
        if (!camera.contains(u.x(), u.y(), 2)) continue;
        ++inside;
        const int x0 = static_cast<int>(u.x());
        const int y0 = static_cast<int>(u.y());
        const double fx = u.x() - x0;
        const double fy = u.y() - y0;
        // on planes the inverse depth is linear in the pixel: away from edges its bilinear value is exact
        double inverse_depth = 0, grey = 0, lowest = 1e9, highest = 0, dark = 1, bright = 0;
        bool moving = false;
        for (int j = -1; j <= 2; ++j) {
          for (int i = -1; i <= 2; ++i) {
            const double iz = 1.0 / static_cast<double>(b.depth(x0 + i, y0 + j));
            lowest = std::min(lowest, iz);
            highest = std::max(highest, iz);
            moving = moving || b.instance(x0 + i, y0 + j) != 0;
            const double g = static_cast<double>(b.intensity(x0 + i, y0 + j));
            dark = std::min(dark, g);
            bright = std::max(bright, g);
            if (i < 0 || i > 1 || j < 0 || j > 1) continue;
            const double w = (i == 0 ? 1 - fx : fx) * (j == 0 ? 1 - fy : fy);
            inverse_depth += w * iz;
            grey += w * g;
          }
        }
        // no edge near: the 4x4 block is one plane (its inverse depth is affine) and p is not hidden
        const auto iz = [&](int i, int j) { return 1.0 / static_cast<double>(b.depth(x0 + i, y0 + j)); };
        const double bend = std::abs(iz(-1, -1) + iz(2, 2) - iz(-1, 2) - iz(2, -1)) + std::abs(iz(-1, 0) + iz(2, 0) - iz(0, 0) - iz(1, 0)) +
                            std::abs(iz(0, -1) + iz(0, 2) - iz(0, 0) - iz(0, 1));
        if (moving || bend > 2e-5 || highest - lowest > 0.02) continue;
        if (std::abs(1 / inverse_depth - p.z()) > 0.05) continue;  // hidden in b behind something
        ++compared;
        if (std::abs(1 / inverse_depth - p.z()) < 1e-3) ++agree;
        // half a pixel of texture may differ between the two samplings
        difference += std::max(0.0, std::abs(grey - static_cast<double>(a.intensity(x, y))) - 0.25 * (bright - dark));
      }
    }
    CHECK(compared > inside / 2);
    CHECK(agree > 0.999 * compared);
    CHECK(difference / compared < 0.01);
  }
}

TEST_CASE("static recordings hold nobody, nor does people = 0") {
  SyntheticFrame f;
  for (const char* name : {"static_xyz", "static_rpy", "static_halfsphere", "static_static", "static_360"}) {
    const SyntheticSequence s(name, small(2));
    CHECK(s.people() == 0);
    for (int i = 0; i < s.size(); i += 60) {
      s.render(i, f);
      CHECK(dynamic_share(f) == 0);
    }
  }
  const SyntheticSequence s("walking_xyz", small(0));
  s.render(50, f);
  CHECK(dynamic_share(f) == 0);
}

TEST_CASE("how much of the view people cover") {
  SyntheticFrame f;
  SUBCASE("two: 10 to 40 % on average") {
    const SyntheticSequence s("walking_xyz", small(2));
    double mean = 0;
    for (int i = 0; i < s.size(); i += 10) {
      s.render(i, f);
      mean += dynamic_share(f) * 10 / s.size();
    }
    CHECK(mean > 0.10);
    CHECK(mean < 0.40);
  }
  SUBCASE("three: half the view and more at times") {
    const SyntheticSequence s("walking_xyz", small(3));
    double largest = 0;
    bool seen[4] = {};
    for (int i = 0; i < s.size(); i += 5) {
      s.render(i, f);
      largest = std::max(largest, dynamic_share(f));
      for (std::size_t k = 0; k < f.instance.size(); ++k) seen[f.instance.data()[k]] = true;
    }
    CHECK(largest > 0.45);
    CHECK(largest < 0.8);
    CHECK((seen[0] && seen[1] && seen[2] && seen[3]));
  }
}

TEST_CASE("the mask is where the image changes when the camera's own motion is taken out") {
  SyntheticOptions o = small(2);
  o.noise = o.blur = o.exposure_drift = false;
  const SyntheticSequence with("walking_static", o);
  o.people = 0;
  const SyntheticSequence without("walking_static", o);  // the same room, path and seed
  SyntheticFrame a, b;
  int wrong = 0;
  for (int i = 0; i < 120; i += 40) {
    with.render(i, a);
    without.render(i, b);
    for (std::size_t k = 0; k < a.depth.size(); ++k) {
      const bool nearer = a.depth.data()[k] < b.depth.data()[k] - 1e-6F;
      wrong += nearer != (a.instance.data()[k] != 0) ? 1 : 0;
    }
    Image<float> mask;
    true_dynamic_probability(a, mask);
    double sum = 0;
    for (std::size_t k = 0; k < mask.size(); ++k) sum += static_cast<double>(mask.data()[k]);
    CHECK(sum / static_cast<double>(mask.size()) == doctest::Approx(dynamic_share(a)));
  }
  CHECK(wrong == 0);
}

TEST_CASE("people of rising_* sit still for two seconds, then rise and walk") {
  for (const unsigned seed : {1U, 2U, 3U}) {
    CAPTURE(seed);
    SyntheticOptions o = small(2);
    o.noise = o.blur = o.exposure_drift = false;
    o.seed = seed;
    const SyntheticSequence s("rising_static", o);
    const double seconds_to_frames = 30;
    const auto seated = static_cast<int>(kSittingTime * seconds_to_frames);
    const auto standing = static_cast<int>((kSittingTime + Walker::kRising) * seconds_to_frames);
    const auto top = [](const Image<std::uint8_t>& instance) {  // row of the highest head, as a share of the height
      std::size_t k = 0;
      while (k < instance.size() && instance.data()[k] == 0) ++k;
      return static_cast<double>(k) / static_cast<double>(instance.size());
    };
    const auto overlap = [](const SyntheticFrame& a, const SyntheticFrame& b) {
      double both = 0;
      double any = 0;
      for (std::size_t k = 0; k < a.instance.size(); ++k) {
        const bool in_a = a.instance.data()[k] != 0;
        const bool in_b = b.instance.data()[k] != 0;
        both += in_a && in_b ? 1 : 0;
        any += in_a || in_b ? 1 : 0;
      }
      return both / any;
    };
    SyntheticFrame first, f;
    s.render(0, first);
    CHECK(dynamic_share(first) > 0.03);
    s.render(seated - 1, f);
    CHECK(overlap(first, f) > 0.9);  // the camera trembles and nobody sits quite still
    const double low = top(f.instance);
    s.render(standing, f);
    CHECK(top(f.instance) < low - 0.15);  // 0.42 m at less than 2.2 m are a fifth of the height of the image
    CHECK(overlap(first, f) < 0.75);
    double least = 1;
    for (int i = standing; i < s.size(); i += 10) {
      s.render(i, f);
      least = std::min(least, overlap(first, f));
    }
    CHECK(least < 0.4);
  }
}

TEST_CASE("cameras move as their names say") {
  for (const unsigned seed : {1U, 2U, 3U}) {
    CAPTURE(seed);
    SyntheticOptions o = small(0);
    o.frames = 540;
    o.seed = seed;
    const Profile held = profile(SyntheticSequence("static_static", o));
    CHECK(held.reach < 0.02);
    CHECK(held.reach > 0.001);
    CHECK(held.largest_turn < 2);
    const Profile xyz = profile(SyntheticSequence("static_xyz", o));
    CHECK(xyz.largest_turn < 6);
    CHECK(xyz.mean_speed > 0.12);
    CHECK(xyz.mean_speed < 0.4);
    CHECK(xyz.reach > 0.25);
    CHECK(xyz.reach < 0.6);
    const Profile half = profile(SyntheticSequence("static_halfsphere", o));
    CHECK(half.largest_turn > 30);
    CHECK(half.mean_speed > 0.1);
    CHECK(half.mean_speed < 0.4);
    CHECK(half.reach <= 1.05);  // no further apart than the diameter
    const Profile rpy = profile(SyntheticSequence("static_rpy", o));
    CHECK(rpy.fastest_turn > 40);
    CHECK(rpy.fastest_turn < 100);
    CHECK(rpy.reach < 0.15);
  }
}

TEST_CASE("rpy looks at the ceiling") {
  SyntheticOptions o = small(0);
  const SyntheticSequence s("static_rpy", o);
  double highest = 0;
  for (int i = 0; i < s.size(); ++i) highest = std::max(highest, -s.T_world_camera(i).linear()(1, 2));
  CHECK(highest > std::sin(25 * kPi / 180));
}

TEST_CASE("the noise of the depth is that of the sensor, and about 0") {
  SyntheticOptions o = small(0);
  const SyntheticSequence noisy("static_static", o);
  o.noise = false;
  const SyntheticSequence exact("static_static", o);
  SyntheticFrame a, b;
  double sum = 0, sum2 = 0;
  int n = 0, holes = 0;
  for (int i = 0; i < 60; i += 6) {
    noisy.render(i, a);
    exact.render(i, b);
    for (std::size_t k = 0; k < a.depth.size(); ++k) {
      if (a.depth.data()[k] == 0) {
        ++holes;
        continue;
      }
      const double e = static_cast<double>((a.depth.data()[k] - b.depth.data()[k]) / depth_sigma(b.depth.data()[k]));
      sum += e;
      sum2 += e * e;
      ++n;
    }
  }
  CHECK(std::abs(sum / n) < 0.1);
  CHECK(std::sqrt(sum2 / n) > 0.85);
  CHECK(std::sqrt(sum2 / n) < 1.15);
  CHECK(holes > 0.003 * (n + holes));
  CHECK(holes < 0.2 * (n + holes));
}

TEST_CASE("the disparity sensor has another noise: rounded disparities, edges that tear, the same picture") {
  SyntheticOptions o = small(0);
  const SyntheticSequence first("static_static", o);
  o.sensor = DepthSensor::Disparity;
  const SyntheticSequence other("static_static", o);
  o.noise = false;
  const SyntheticSequence exact("static_static", o);
  const DisparitySensor sensor;
  const double product = other.camera().fx * sensor.baseline;
  SyntheticFrame a, b, c;
  first.render(3, a);
  other.render(3, b);
  exact.render(3, c);
  CHECK(std::equal(a.rgb.data(), a.rgb.data() + a.rgb.size(), b.rgb.data()));
  double sum = 0, sum2 = 0;
  int n = 0, torn = 0;
  for (int y = 1; y + 1 < b.depth.height(); ++y) {
    for (int x = 1; x + 1 < b.depth.width(); ++x) {
      const double z = static_cast<double>(b.depth(x, y));
      const double truth = static_cast<double>(c.depth(x, y));
      if (truth > sensor.farthest) CHECK(z == 0);
      if (!(z > 0)) continue;
      const double eighths = 8 * product / z;
      CHECK(std::abs(eighths - std::round(eighths)) < 1e-3);
      const double e = product / z - product / truth;
      const bool other_surface = std::abs(z - truth) > 0.2 * truth;
      torn += other_surface ? 1 : 0;
      if (other_surface) continue;
      sum += e;
      sum2 += e * e;
      ++n;
    }
  }
  REQUIRE(n > 1000);
  CHECK(std::abs(sum / n) < 0.05);
  CHECK(std::sqrt(sum2 / n) > sensor.disparity_sigma);
  CHECK(std::sqrt(sum2 / n) < 5 * sensor.disparity_sigma);  // slanted surfaces add what the place errs by
  CHECK(torn > 0);
  CHECK(torn < 0.1 * n);
}

TEST_CASE("blur smooths fast frames and leaves slow ones alone") {
  // energy of the gradient; its absolute sum would not do, as blur keeps the height of an edge
  const auto roughness = [](const SyntheticFrame& f) {
    double sum = 0;
    for (int y = 1; y < f.intensity.height(); ++y) {
      for (int x = 1; x < f.intensity.width(); ++x) {
        const auto dx = static_cast<double>(f.intensity(x, y) - f.intensity(x - 1, y));
        const auto dy = static_cast<double>(f.intensity(x, y) - f.intensity(x, y - 1));
        sum += dx * dx + dy * dy;
      }
    }
    return sum;
  };
  SyntheticOptions o;
  o.people = 0;
  o.noise = o.exposure_drift = false;
  o.blur = true;
  const SyntheticSequence blurred("static_rpy", o), still("static_static", o);
  o.blur = false;
  const SyntheticSequence sharp("static_rpy", o), still_sharp("static_static", o);
  int fast = 0;
  double speed = 0;
  for (int i = 1; i + 1 < sharp.size(); ++i) {
    const double turn = rotation_angle(inverse(sharp.T_world_camera(i - 1)) * sharp.T_world_camera(i + 1));
    if (turn > speed) {
      speed = turn;
      fast = i;
    }
  }
  SyntheticFrame a, b;
  blurred.render(fast, a);
  sharp.render(fast, b);
  CHECK(roughness(a) < 0.85 * roughness(b));
  still.render(0, a);
  still_sharp.render(0, b);
  CHECK(same(a.rgb, b.rgb));
}

TEST_CASE("exposure drift changes the brightness slowly and not by much") {
  SyntheticOptions o = small(0);
  o.noise = o.blur = false;
  const SyntheticSequence drifting("static_static", o);
  o.exposure_drift = false;
  const SyntheticSequence steady("static_static", o);
  SyntheticFrame a, b;
  double lowest = 10, highest = 0, before = 0;
  for (int i = 0; i < 300; i += 10) {
    drifting.render(i, a);
    steady.render(i, b);
    double sum_a = 0, sum_b = 0;
    for (std::size_t k = 0; k < a.intensity.size(); ++k) {
      if (b.intensity.data()[k] > 0.85F) continue;  // may saturate
      sum_a += static_cast<double>(a.intensity.data()[k]);
      sum_b += static_cast<double>(b.intensity.data()[k]);
    }
    const double gain = sum_a / sum_b;
    if (i > 0) CHECK(std::abs(gain - before) < 0.05);
    before = gain;
    lowest = std::min(lowest, gain);
    highest = std::max(highest, gain);
  }
  CHECK(lowest > 0.88);
  CHECK(highest < 1.12);
  CHECK(highest - lowest > 0.05);
}
