// Rectification against the analytic model of the lens: what a pixel of the rectified image shows is known in closed form.
#include <cmath>
#include <cstdint>
#include <string>

#include <doctest/doctest.h>

#include <apso/io/camera_model.hpp>
#include <apso/testing/conformance.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/images/rectifier.hpp>

#include "../foreign_types.hpp"

using namespace apso;

namespace {

// A smooth scene on the plane z = 1, in [0,1].
double shade(double x, double y) { return 0.5 + 0.3 * std::sin(6 * x + 1) * std::cos(5 * y) + 0.2 * x; }
// ... and its depth: a checker of two planes.
float plane(double x, double y) {
  return (static_cast<int>(std::floor(8 * x)) + static_cast<int>(std::floor(8 * y))) % 2 == 0 ? 1.0F : 2.0F;
}

// What a camera sees of both.
template <class CameraT>
void render(const CameraT& camera, Image<float>& grey, Image<float>& depth) {
  grey.resize(640, 480);
  depth.resize(640, 480);
  for (int y = 0; y < 480; ++y) {
    for (int x = 0; x < 640; ++x) {
      const Eigen::Vector3d ray = camera_traits<CameraT>::unproject(camera, Eigen::Vector2d(x, y));
      grey(x, y) = static_cast<float>(shade(ray.x(), ray.y()));
      depth(x, y) = plane(ray.x(), ray.y());
    }
  }
}

// Kannala & Brandt, one coefficient: a type of a host's, with another model of distortion.
struct Fisheye {
  double f, cx, cy, k;
};

}  // namespace

template <>
struct apso::camera_traits<Fisheye> {
  static bool project(const Fisheye& c, const Eigen::Vector3d& X, Eigen::Vector2d& pixel) {
    const double r = std::hypot(X.x(), X.y());
    if (!(X.z() > 0)) return false;
    const double theta = std::atan2(r, X.z());
    const double scale = r > 0 ? theta * (1 + c.k * theta * theta) / r : 1 / X.z();
    pixel = Eigen::Vector2d(c.f * scale * X.x() + c.cx, c.f * scale * X.y() + c.cy);
    return true;
  }
  static Eigen::Vector3d unproject(const Fisheye& c, const Eigen::Vector2d& pixel) {
    const Eigen::Vector2d m((pixel.x() - c.cx) / c.f, (pixel.y() - c.cy) / c.f);
    const double d = m.norm();
    double theta = d;
    for (int i = 0; i < 20; ++i) theta -= (theta * (1 + c.k * theta * theta) - d) / (1 + 3 * c.k * theta * theta);
    const double scale = d > 0 ? std::tan(theta) / d : 1.0;
    return {m.x() * scale, m.y() * scale, 1};
  }
};

TEST_CASE("the cameras of the public data sets conform") {
  for (const char* name : {"tum-fr1", "tum-fr2", "tum-fr3", "bonn", "icl-nuim"}) {
    CAPTURE(name);
    CHECK(testing::check_camera_type(camera_by_name(name), 640, 480).text() == "");
  }
  CHECK(testing::check_camera_type(Fisheye{400, 320, 240, -0.05}, 640, 480).text() == "");
}

TEST_CASE("a lens that turns back shows nothing beyond") {
  CameraModel c = camera_by_name("tum-fr3");
  c.k1 = -0.3;  // d/dr (r + k1 r^3) = 0 at r = 1.05
  Eigen::Vector2d p;
  CHECK(camera_traits<CameraModel>::project(c, Eigen::Vector3d(1.0, 0, 1), p));
  CHECK_FALSE(camera_traits<CameraModel>::project(c, Eigen::Vector3d(1.1, 0, 1), p));
  CHECK_FALSE(camera_traits<CameraModel>::project(c, Eigen::Vector3d(0, 0, -1), p));
}

TEST_CASE("rectified images are those of the pinhole") {
  const auto check = [](const auto& camera, double fx, double fy, double cx, double cy) {
    Image<float> grey, depth, flat, flat_depth;
    render(camera, grey, depth);
    const Rectifier rectifier(camera, 640, 480);
    const Pinhole& p = rectifier.pinhole();
    CHECK(p.fx == doctest::Approx(fx).epsilon(1e-6));
    CHECK(p.fy == doctest::Approx(fy).epsilon(1e-6));
    CHECK(p.cx == doctest::Approx(cx).epsilon(1e-6));
    CHECK(p.cy == doctest::Approx(cy).epsilon(1e-6));
    rectifier.intensity(grey, flat);
    rectifier.depth(depth, flat_depth);
    int seen = 0, wrong_depth = 0, compared = 0;
    double worst = 0;
    for (int y = 0; y < 480; ++y) {
      for (int x = 0; x < 640; ++x) {
        if (flat_depth(x, y) == 0) {
          CHECK(flat(x, y) == 0);
          continue;
        }
        ++seen;
        const Eigen::Vector3d ray = p.unproject(x, y, 1);
        worst = std::max(worst, std::abs(static_cast<double>(flat(x, y)) - shade(ray.x(), ray.y())));
        // away from the steps, where half a pixel decides
        const double margin = 8 * 1.0 / p.fx;
        const auto inside = [&](double v) { return std::abs(8 * v - std::round(8 * v)) > margin; };
        if (!inside(ray.x()) || !inside(ray.y())) continue;
        ++compared;
        wrong_depth += flat_depth(x, y) != plane(ray.x(), ray.y());
      }
    }
    CHECK(seen > 250000);
    CHECK(compared > 200000);
    CHECK(worst < 2e-4);  // of bilinear interpolation: curvature / 8 per pixel^2
    CHECK(wrong_depth == 0);
  };
  const CameraModel fr1 = camera_by_name("tum-fr1");
  check(fr1, 517.3, 516.5, 318.6, 255.3);
  check(Fisheye{400, 320, 240, -0.05}, 400, 400, 320, 240);
}

TEST_CASE("a pinhole is left as it is, to the last bit") {
  const CameraModel camera = camera_by_name("tum-fr3");
  Image<float> grey, depth, same, same_depth;
  render(camera, grey, depth);
  const Rectifier rectifier(camera, 640, 480, camera.pinhole);
  rectifier.intensity(grey, same);
  rectifier.depth(depth, same_depth);
  int different = 0;
  for (std::size_t i = 0; i < grey.size(); ++i) {
    different += same.data()[i] != grey.data()[i];
    different += same_depth.data()[i] != depth.data()[i];
  }
  CHECK(different == 0);
}

TEST_CASE("images of foreign types are rectified where they lie") {
  const CameraModel camera = camera_by_name("tum-fr1");
  Image<float> grey, depth, a, b;
  render(camera, grey, depth);
  const foreign::AtOnly foreign_grey = foreign::at_only(grey);
  const foreign::PaddedU16 raw = foreign::padded_u16(depth, 1 / 5000.0F);
  const Rectifier rectifier(camera, 640, 480);
  const auto equal = [&] { return std::equal(a.data(), a.data() + a.size(), b.data()); };
  rectifier.intensity(foreign_grey, a);
  rectifier.intensity(foreign::native(foreign_grey), b);
  CHECK(equal());
  rectifier.depth(scaled(raw, 1 / 5000.0F), a);
  rectifier.depth(foreign::native(raw, 1 / 5000.0F), b);
  CHECK(equal());
  Image<std::uint8_t> labels(640, 480, 7), flat;
  rectifier.nearest(labels, flat);
  CHECK(flat(320, 240) == 7);
  CHECK_THROWS_AS(rectifier.intensity(Image<float>(320, 240), a), contract_error);
}

TEST_CASE("a distorted camera is refused with the name of what helps") {
  const Image<float> image(640, 480, 1.0F);
  std::string message;
  try {
    (void)frame(0, image, image, camera_by_name("tum-fr1"));
  } catch (const contract_error& e) {
    message = e.what();
  }
  CHECK(message.find("apso::Rectifier") != std::string::npos);
  CHECK_NOTHROW((void)frame(0, image, image, camera_by_name("tum-fr3")));
}
