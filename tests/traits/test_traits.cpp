#include <array>
#include <cmath>

#include <doctest/doctest.h>

#include <apso/testing/conformance.hpp>
#include <apso/traits/concepts.hpp>

#include "test_types.hpp"

using namespace apso;

// The predicates say yes and no where they must.
static_assert(is_image_v<ImageView<const float>> && is_image_v<Image<std::uint8_t>> && has_row_v<Image<float>>);
static_assert(is_image_v<user::ColumnMajorImage> && !has_row_v<user::ColumnMajorImage>);
static_assert(is_image_v<user::PaddedImage> && has_row_v<user::PaddedImage>);
static_assert(!is_image_v<user::Nothing> && !is_image_v<int> && !is_image_v<user::Corner>);
static_assert(is_pose_v<Pose> && is_pose_v<Eigen::Isometry3f> && is_pose_v<Eigen::Matrix4d>);
static_assert(is_pose_v<user::InversePose> && !is_pose_v<user::Nothing> && !is_pose_v<Eigen::Matrix3d>);
static_assert(is_camera_v<Pinhole> && is_camera_v<user::Camera> && !is_camera_v<user::Nothing>);
static_assert(is_keypoint_v<Keypoint> && is_keypoint_v<user::Corner> && !is_keypoint_v<user::Nothing>);
static_assert(is_detection_v<Detection> && is_detection_v<user::Object> && !is_detection_v<user::Corner>);
#if defined(__cpp_concepts) && __cpp_concepts >= 201907L
static_assert(ImageType<Image<float>> && !ImageType<user::Nothing>);
static_assert(PoseType<Pose> && CameraType<Pinhole> && KeypointType<Keypoint> && DetectionType<Detection>);
#endif

namespace {
int pixel_value(int x, int y) { return 100 * y + x; }

user::ColumnMajorImage column_major(int width, int height) {
  user::ColumnMajorImage m;
  m.rows = height;
  m.cols = width;
  for (int x = 0; x < width; ++x) {
    for (int y = 0; y < height; ++y) m.values.push_back(static_cast<std::uint16_t>(pixel_value(x, y)));
  }
  return m;
}
user::PaddedImage padded(int width, int height) {
  user::PaddedImage m;
  m.w = width;
  m.h = height;
  m.pitch = width + 3;
  m.values.assign(static_cast<std::size_t>(m.pitch * height), -1.0F);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) m.values[static_cast<std::size_t>(y * m.pitch + x)] = static_cast<float>(pixel_value(x, y));
  }
  return m;
}
}  // namespace

TEST_CASE("user images conform, and a swap of x and y is found") {
  CHECK(testing::check_image_type(column_major(5, 3), pixel_value).text() == "");
  CHECK(testing::check_image_type(padded(5, 3), pixel_value).text() == "");
  CHECK_FALSE(testing::check_image_type(column_major(5, 3), [](int x, int y) { return pixel_value(y, x); }).passed());
  CHECK_FALSE(testing::check_image_type(user::PaddedImage{}).passed());
}

TEST_CASE("copy_to_float reads the same numbers by row and by at") {
  Image<float> a;
  Image<float> b;
  copy_to_float(column_major(7, 4), 0.5, a);
  copy_to_float(padded(7, 4), 0.5, b);
  REQUIRE(a.width() == 7);
  REQUIRE(a.height() == 4);
  REQUIRE(b.size() == a.size());
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 7; ++x) {
      CHECK(a(x, y) == 0.5F * static_cast<float>(pixel_value(x, y)));
      CHECK(b(x, y) == a(x, y));
    }
  }
}

TEST_CASE("views with a stride are images") {
  std::array<std::uint8_t, 12> pixels{};
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::uint8_t>(i);
  const ImageView<const std::uint8_t> left(pixels.data(), 2, 3, 4);
  CHECK(testing::check_image_type(left, [](int x, int y) { return 4 * y + x; }).text() == "");
  const ImageView<std::uint8_t> writable(pixels.data(), 2, 3, 4);
  CHECK(testing::check_image_type(writable, [](int x, int y) { return 4 * y + x; }).text() == "");
}

TEST_CASE("poses of every kind survive the way in and out") {
  CHECK(testing::check_pose_type<Pose>([](const Pose& T, const Eigen::Vector3d& x) { return T * x; }).text() == "");
  CHECK(testing::check_pose_type<Eigen::Isometry3d>().text() == "");
  CHECK(testing::check_pose_type<Eigen::Isometry3f>().text() == "");
  CHECK(testing::check_pose_type<Eigen::Affine3d>().text() == "");
  CHECK(testing::check_pose_type<Eigen::Matrix4d>().text() == "");
  CHECK(testing::check_pose_type<Eigen::Matrix<float, 4, 4, Eigen::RowMajor>>().text() == "");
  const auto apply = [](const user::InversePose& T, const Eigen::Vector3d& x) -> Eigen::Vector3d {
    return (T.q_b_a.conjugate() * (x.cast<float>() - T.t_b_a)).cast<double>();
  };
  CHECK(testing::check_pose_type<user::InversePose>(apply).text() == "");
}

TEST_CASE("mistakes in pose traits are found") {
  CHECK_FALSE(testing::check_pose_type<user::TransposedPose>().passed());
  const auto inverse_apply = [](const Pose& T, const Eigen::Vector3d& x) -> Eigen::Vector3d { return T.inverse() * x; };
  CHECK_FALSE(testing::check_pose_type<Pose>(inverse_apply).passed());
}

TEST_CASE("cameras conform; a distorted one is no pinhole") {
  const Pinhole p{535.4, 539.2, 320.1, 247.6, 640, 480};
  CHECK(testing::check_camera_type(p, 640, 480).text() == "");
  CHECK(testing::check_camera_type(user::Camera{}, 640, 480).text() == "");
  CHECK_FALSE(testing::check_camera_type(user::Camera{500, 0.1}, 640, 480).passed());

  const Pinhole same = to_pinhole(p, 640, 480);
  CHECK(same.fx == doctest::Approx(p.fx).epsilon(1e-12));
  CHECK(same.fy == doctest::Approx(p.fy).epsilon(1e-12));
  CHECK(same.cx == doctest::Approx(p.cx).epsilon(1e-12));
  CHECK(same.cy == doctest::Approx(p.cy).epsilon(1e-12));
  CHECK(same.width == 640);
  CHECK(to_pinhole(user::Camera{}, 640, 480).fx == doctest::Approx(500));
  CHECK_THROWS_AS((void)to_pinhole(user::Camera{500, 0.1}, 640, 480), contract_error);
}

TEST_CASE("keypoints and detections: optional members have their documented fallback") {
  const Keypoint k = to_keypoint(user::Corner{3, 4, 0.5F});
  CHECK(k.x == 3);
  CHECK(k.y == 4);
  CHECK(k.response == 0.5F);
  CHECK(k.angle == 0);
  CHECK(k.octave == 0);

  const Detection d = to_detection(user::Object{10, 20, 40, 60, 0.75F, 2, false});
  CHECK(d.box.width == 30);
  CHECK(d.box.height == 40);
  CHECK(d.score == 0.75F);
  CHECK(d.class_id == 2);
  CHECK_FALSE(d.movable);
  CHECK(std::isnan(d.motion_probability));
  CHECK(d.track_id == -1);
  CHECK(d.mask.empty());
}
