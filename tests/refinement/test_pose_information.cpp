// What an alignment says of its own exactness, on scenes of which it is known what they leave open.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <random>

#include <Eigen/QR>

#include <apso/align.hpp>
#include <apso/testing/synthetic.hpp>

namespace {
using namespace apso;

using Brightness = std::function<double(double x, double y)>;  // at a place of the wall [m]

const Eigen::Vector3d kNormal = Eigen::Vector3d(0.2, -0.15, -1).normalized();
const Eigen::Vector3d kRight = Eigen::Vector3d(1, 0, 0.2).normalized();
const Eigen::Vector3d kDown = kNormal.cross(kRight).normalized();

struct Views {
  Image<float> reference_intensity, reference_depth, intensity, depth;
};

// A wall two metres away, tilted about both axes, seen twice. The depth is rounded to steps of 1/8 pixel of disparity, as that
// of a structured-light camera, which is no noise that the alignment has a model of.
Views look_at_wall(const Pinhole& camera, const Brightness& brightness, const Pose& T_reference_current, unsigned seed, double grey_sigma) {
  Views v;
  std::mt19937 rng(seed);
  std::normal_distribution<double> gauss;
  const auto shoot = [&](const Pose& T_world_camera, Image<float>& intensity, Image<float>& depth) {
    intensity.resize(camera.width, camera.height);
    depth.resize(camera.width, camera.height);
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        double grey = 0;
        double z = 0;
        for (int k = 0; k < 9; ++k) {  // rays per pixel; the last is its middle
          const int place = (k + 5) % 9;
          const Eigen::Vector3d ray = T_world_camera.linear() * camera.unproject(x + (place % 3 - 1) / 3.0, y + (place / 3 - 1) / 3.0, 1.0);
          z = kNormal.dot(Eigen::Vector3d(0, 0, 2) - T_world_camera.translation()) / kNormal.dot(ray);
          const Eigen::Vector3d p = T_world_camera.translation() + z * ray - Eigen::Vector3d(0, 0, 2);
          grey += brightness(kRight.dot(p), kDown.dot(p)) / 9;
        }
        intensity(x, y) = static_cast<float>(grey + grey_sigma / 255 * gauss(rng));
        const double disparity = camera.fx * 0.15 / z;
        depth(x, y) = static_cast<float>(camera.fx * 0.15 / (std::round(8 * (disparity + 0.15 * gauss(rng))) / 8));
      }
    }
  };
  shoot(Pose::Identity(), v.reference_intensity, v.reference_depth);
  shoot(T_reference_current, v.intensity, v.depth);
  return v;
}

const Pinhole kHalfVga{262.5, 262.5, 159.5, 119.5, 320, 240};

PairAlignment<> align_views(const Views& v) { return align(v.reference_intensity, v.reference_depth, v.intensity, v.depth, kHalfVga); }

// Squares of random brightness.
double patches(double x, double y) {
  const auto i = static_cast<std::uint32_t>(static_cast<std::int32_t>(std::floor(x / 0.06)));
  const auto j = static_cast<std::uint32_t>(static_cast<std::int32_t>(std::floor(y / 0.06)));
  std::uint32_t h = i * 73856093U ^ j * 19349663U;
  h = (h ^ (h >> 16)) * 0x7feb352dU;
  h = (h ^ (h >> 15)) * 0x846ca68bU;
  return 0.1 + 0.8 * static_cast<double>((h ^ (h >> 16)) & 0xffffU) / 65535.0;
}
double stripes(double x, double) { return patches(x, 0.01); }
double checkerboard(double x, double y) {
  return (static_cast<int>(std::floor(x / 0.1)) + static_cast<int>(std::floor(y / 0.1))) % 2 == 0 ? 0.2 : 0.75;
}
// Equal windows, with or without different curtains.
double facade(double x, double y) {
  const double a = x / 0.45 - std::floor(x / 0.45), b = y / 0.5 - std::floor(y / 0.5);
  if (a < 0.2 || a > 0.8 || b < 0.2 || b > 0.75) return 0.45;
  return a < 0.25 || a > 0.75 || b < 0.25 || b > 0.7 || std::abs(a - 0.5) < 0.03 ? 0.85 : 0.2;
}
double curtains(double x, double y) {
  const double grey = facade(x, y);
  const double drawn = patches(0.06 * std::floor(x / 0.45), 0.06 * std::floor(y / 0.5));  // one random number for each window
  return grey < 0.3 && y / 0.5 - std::floor(y / 0.5) < 0.2 + 0.5 * drawn ? 0.65 : grey;
}
double notice(double x, double y) { return std::abs(x - 0.1) < 0.2 && std::abs(y) < 0.15 ? patches(x, y) : checkerboard(x, y); }

const Pose kMotion = [] {
  Twist xi;
  xi << 0.02, 0.03, -0.01, 0.006, -0.004, 0.005;
  return se3_exp(xi);
}();
}  // namespace

TEST_CASE("a wall with stripes leaves the direction along them open, and says so, whatever the noise across them looks like") {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const PairAlignment<> r = align_views(look_at_wall(kHalfVga, stripes, kMotion, seed, 3));
    REQUIRE(r.status == Status::Degenerate);
    CHECK(r.detail.degenerate_count == 1);
    Twist along = zeros<Twist>();  // the stripes, in the current camera
    along.head<3>() = kMotion.linear().transpose() * kDown;
    const Eigen::Matrix<double, 6, 6> P = r.detail.degenerate_projector;
    CHECK((P * along).norm() > 0.95);
    CHECK((r.detail.information * along).norm() < 0.05 * r.detail.information(0, 0));
    CHECK(r.confidence == 0);
    CHECK(direct_confidence(r.detail).determined > 0.5);
    // what is open keeps the guess; what is not is found
    const Eigen::Vector3d found = r.detail.T_world_camera.translation();
    const Eigen::Vector3d error = found - kMotion.translation();
    CHECK(std::abs(kDown.dot(found)) < 0.005);
    CHECK((error - kDown.dot(error) * kDown).norm() < 0.002);
  }
}

TEST_CASE("a bare wall leaves three directions open") {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const PairAlignment<> r = align_views(look_at_wall(
        kHalfVga, [](double, double) { return 0.5; }, kMotion, seed, 3));
    CHECK(r.detail.degenerate_count >= 3);
    CHECK(r.confidence == 0);
  }
}

TEST_CASE("errors on a textured wall are as large as the covariance says") {
  double sum = 0;
  constexpr int kSeeds = 12;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const PairAlignment<> r = align_views(look_at_wall(kHalfVga, patches, kMotion, seed, 3));
    REQUIRE(r.status == Status::Converged);
    CHECK(r.confidence > 0.8);
    const Twist e = se3_log(compose(inverse(kMotion), r.detail.T_world_camera));
    const double normalised = (e.transpose() * r.detail.information * e).value() / 6;
    CHECK(normalised < 5);  // chi-square of 6 degrees of freedom exceeds 5 times its mean once in ten thousand
    sum += normalised / kSeeds;
    const Eigen::Matrix<double, 6, 6> product = r.detail.covariance * r.detail.information;
    CHECK((product - Eigen::Matrix<double, 6, 6>::Identity()).cwiseAbs().maxCoeff() < 1e-4);
  }
  CHECK(sum > 0.2);
  CHECK(sum < 2);
}

TEST_CASE("a pattern that repeats has several answers, and the result says so, however near the guess was") {
  for (const Brightness& pattern : {Brightness(checkerboard), Brightness(facade)}) {
    for (const double size : {0.1, 1.0}) {
      const Pose motion = se3_exp(size * se3_log(kMotion));
      const PairAlignment<> r = align_views(look_at_wall(kHalfVga, pattern, motion, 1, 3));
      REQUIRE(succeeded(r.status));
      CHECK(r.detail.ambiguous);
      CHECK(r.confidence < 0.5);
      CHECK(direct_confidence(r.detail).determined < 0.5);
      // the other answer is another place of the pattern, along the wall
      const Eigen::Vector3d apart = translation(r.detail.T_world_camera_other) - translation(r.detail.T_world_camera);
      CHECK(apart.norm() > 0.13);
      CHECK(std::abs(kNormal.dot(apart)) < 0.02);
      CHECK(rotation_angle(compose(inverse(r.detail.T_world_camera_other), r.detail.T_world_camera)) < 0.01);
    }
  }
}

TEST_CASE("patterns are found in images that are higher than wide") {
  const Pinhole portrait{262.5, 262.5, 119.5, 159.5, 240, 320};
  for (const Brightness& pattern : {Brightness(checkerboard), Brightness(facade)}) {
    const Views v = look_at_wall(portrait, pattern, kMotion, 1, 3);
    const PairAlignment<> r = align(v.reference_intensity, v.reference_depth, v.intensity, v.depth, portrait);
    REQUIRE(succeeded(r.status));
    CHECK(r.detail.ambiguous);
  }
}

TEST_CASE("who knows the pose is not told of others, and what tells one place of a pattern from another is seen") {
  const Views v = look_at_wall(kHalfVga, checkerboard, kMotion, 1, 3);
  FramePyramid reference, current;
  reference.build({0.0, v.reference_intensity, v.reference_depth}, kHalfVga);
  current.build({0.0, v.intensity, v.depth}, kHalfVga);
  DirectAligner aligner;
  const AlignmentResult near = aligner.align_near({{&reference, Pose::Identity(), 1}}, current, kMotion);
  CHECK_FALSE(near.ambiguous);
  CHECK(direct_confidence(near).c_dir > 0.8);
  for (const Brightness& pattern : {Brightness(notice), Brightness(curtains), Brightness(patches)}) {
    const PairAlignment<> r = align_views(look_at_wall(kHalfVga, pattern, kMotion, 1, 3));
    CHECK_FALSE(r.detail.ambiguous);
    CHECK(r.confidence > 0.8);
    CHECK((translation(r.detail.T_world_camera) - translation(kMotion)).norm() < 0.01);
  }
}

TEST_CASE("the scatter of right sides is the covariance of their sum, also where neighbours err alike") {
  constexpr int kRows = 15, kColumns = 20, kRuns = 400;  // tiles of a grid, whose cells are of about 2.5 x 2.5
  for (const bool alike : {false, true}) {
    CAPTURE(alike);
    std::mt19937 rng(alike ? 5 : 6);
    std::normal_distribution<double> gauss;
    Matrix6 sums = Matrix6::Zero(), told = Matrix6::Zero();
    for (int run = 0; run < kRuns; ++run) {
      ImageCells cells;
      Twist sum = Twist::Zero(), common[ImageCells::kRows][ImageCells::kColumns];
      for (auto& row : common) {
        for (Twist& c : row) {
          for (int i = 0; i < 6; ++i) c(i) = gauss(rng) * (i + 1);
        }
      }
      for (int y = 0; y < kRows; ++y) {
        for (int x = 0; x < kColumns; ++x) {
          const int r = y * ImageCells::kRows / kRows, c = x * ImageCells::kColumns / kColumns;
          Twist b;
          for (int i = 0; i < 6; ++i) b(i) = gauss(rng) * (i + 1);
          if (alike) b += common[r][c];
          sum += b;
          cells.add(r, c, b);
        }
      }
      sums += sum * sum.transpose() / kRuns;
      told += cells.scatter() / kRuns;
    }
    // what is told errs to the safe side by 48 / 41, so that Hotelling's T^2 has the mean 6
    for (int i = 0; i < 6; ++i) CHECK(told(i, i) == doctest::Approx(48.0 / 41 * sums(i, i)).epsilon(0.2));
  }
}

TEST_CASE("the scatter of few right sides is finite") {
  CHECK(ImageCells{}.scatter().isZero());
  for (const int count : {1, 3, 9}) {
    ImageCells cells;
    for (int n = 0; n < count; ++n) cells.add(n % ImageCells::kRows, n % ImageCells::kColumns, Twist::Unit(n % 6) * 1e3);
    CHECK(cells.scatter().allFinite());
  }
}

TEST_CASE("the last step adds to the covariance of the directions that are known, and the information stays its inverse") {
  std::mt19937 rng(100);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const bool open : {false, true}) {
    CAPTURE(open);
    const Matrix6 Q = Eigen::HouseholderQR<Matrix6>(Matrix6::NullaryExpr([&] { return uniform(rng); })).householderQ();
    Twist values;
    values << (open ? 1.0 : 1e4), 2e4, 5e4, 1e5, 3e5, 1e6;
    const Matrix6 S = Q * values.asDiagonal() * Q.transpose();
    PoseInformation known(S, S, 0.3 * S, [](const Twist&) { return 0.0; });
    REQUIRE(known.open_count == (open ? 1 : 0));
    const PoseInformation before = known;
    Twist step;
    for (int i = 0; i < 6; ++i) step(i) = 0.01 * uniform(rng);
    known.add_last_step(step);
    const Twist error = PoseInformation::kUnfinished * step;
    const Matrix6 keep = Matrix6::Identity() - before.open;
    const Matrix6 expected = before.covariance + keep * error * error.transpose() * keep;
    CHECK((known.covariance - expected).norm() < 1e-9 * expected.norm());
    CHECK((known.information * known.covariance - keep).norm() < 1e-6);
    CHECK((known.open - before.open).norm() == 0);
    CHECK(eigen_symmetric(known.covariance).values(5) > 2 * eigen_symmetric(before.covariance).values(5));
  }
}

TEST_CASE("more noise of the image makes a pose less certain") {
  double sigma[2] = {0, 0};
  for (unsigned seed = 1; seed <= 3; ++seed) {
    for (const int noisy : {0, 1}) {
      const PairAlignment<> r = align_views(look_at_wall(kHalfVga, patches, kMotion, seed, noisy != 0 ? 15 : 3));
      REQUIRE(succeeded(r.status));
      sigma[noisy] += std::sqrt(r.detail.covariance.topLeftCorner(3, 3).trace());
    }
  }
  CHECK(sigma[1] > 1.5 * sigma[0]);
}

TEST_CASE("the same furniture with other pictures on the walls is another place: never called good") {
  for (unsigned seed = 100; seed < 116; ++seed) {
    CAPTURE(seed);
    testing::SyntheticOptions o;
    o.width = 320;
    o.height = 240;
    o.people = 0;
    o.seed = seed;
    const testing::SyntheticSequence here("static_xyz", o);
    o.seed = seed + 100;
    const testing::SyntheticSequence there("static_xyz", o);
    testing::SyntheticFrame a, b;
    here.render(0, a);
    there.render(0, b);
    PyramidOptions pyramid;
    pyramid.finest = 0;
    FramePyramid reference, current;
    reference.build(a.rgbd(), here.camera(), {}, pyramid, PyramidRole::Reference);
    current.build(b.rgbd(), here.camera(), {}, pyramid, PyramidRole::Current);
    DirectAligner aligner;
    CHECK(direct_confidence(aligner.align({{&reference, Pose::Identity(), 1.0}}, current, {Pose::Identity()})).c_dir < 0.5);
  }
}
