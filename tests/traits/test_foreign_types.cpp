// Foreign types through the conformance checks: those that work directly, and the recipes of docs/integrate/types.md.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include <doctest/doctest.h>

#include <apso/testing/conformance.hpp>
#include <apso/traits/concepts.hpp>
#include <apso/traits/images/byte_image.hpp>
#include <apso/traits/images/eigen_image.hpp>

#include "../../examples/integrate/types/recipes.hpp"

using namespace apso;
using testing::check_image_type;
using testing::check_pose_type;

namespace {
constexpr int W = 7;
constexpr int H = 4;
int value(int x, int y) { return 10 * y + x; }

template <class M>
void fill(M&& m) {
  for (int y = 0; y < H; ++y) {
    for (int x = 0; x < W; ++x) m(y, x) = static_cast<typename std::decay_t<M>::Scalar>(value(x, y));
  }
}
using RowMajorArray = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using DepthMatrix = Eigen::Matrix<std::uint16_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
template <class A, class B>
using sum_t = decltype(std::declval<const A&>() + std::declval<const B&>());
}  // namespace

static_assert(is_image_v<Eigen::ArrayXXf> && !has_row_v<Eigen::ArrayXXf>, "column-major: no rows");
static_assert(is_image_v<RowMajorArray> && has_row_v<RowMajorArray> && has_row_v<DepthMatrix>);
static_assert(!has_row_v<Eigen::Map<RowMajorArray, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>>);
static_assert(!is_image_v<sum_t<RowMajorArray, RowMajorArray>>, "an expression is no image: it has no memory");
static_assert(!is_image_v<std::vector<float>> && !is_image_v<Eigen::Isometry3d>);
static_assert(is_image_v<ByteImage<std::uint16_t>> && !has_row_v<ByteImage<std::uint16_t>>);
static_assert(!is_pose_v<Eigen::Quaterniond> && !is_pose_v<Eigen::Vector3d> && !is_pose_v<Eigen::Affine2d>);
#if defined(__cpp_concepts) && __cpp_concepts >= 201907L
static_assert(ImageType<RowMajorArray> && PoseType<host::SE3Quat> && KeypointType<host::Corner>);
static_assert(!PoseType<Eigen::Quaterniond> && DetectionType<host::RelativeBox>);
#endif

TEST_CASE("Eigen's arrays, matrices, maps and references are images") {
  Eigen::ArrayXXf columns(H, W);
  fill(columns);
  CHECK(check_image_type(columns, value).text() == "");
  RowMajorArray rows(H, W);
  fill(rows);
  CHECK(check_image_type(rows, value).text() == "");
  DepthMatrix depth(H, W);
  fill(depth);
  CHECK(check_image_type(depth, value).text() == "");

  std::vector<float> padded(static_cast<std::size_t>(H * 10), -1.0F);
  Eigen::Map<RowMajorArray, 0, Eigen::OuterStride<>> map(padded.data(), H, W, Eigen::OuterStride<>(10));
  fill(map);
  CHECK(check_image_type(map, value).text() == "");
  const Eigen::Map<const RowMajorArray, 0, Eigen::OuterStride<>> read_only(padded.data(), H, W, Eigen::OuterStride<>(10));
  CHECK(check_image_type(read_only, value).text() == "");
  const Eigen::Ref<const RowMajorArray, 0, Eigen::OuterStride<>> reference(map);
  CHECK(check_image_type(reference, value).text() == "");
  // a pixel in two: the inner stride forbids row pointers, and at() still finds every pixel
  std::vector<float> interleaved(static_cast<std::size_t>(H * 2 * W), -1.0F);
  using Strides = Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>;
  Eigen::Map<RowMajorArray, 0, Strides> channel(interleaved.data(), H, W, Strides(2 * W, 2));
  fill(channel);
  CHECK(check_image_type(channel, value).text() == "");
}

TEST_CASE("a pointer with a stride is an image, a depth in millimetres becomes metres") {
  std::vector<std::uint16_t> pixels(static_cast<std::size_t>(H * 9), 0);
  for (int y = 0; y < H; ++y) {
    for (int x = 0; x < W; ++x) pixels[static_cast<std::size_t>(9 * y + x)] = static_cast<std::uint16_t>(1000 * value(x, y));
  }
  const ImageView<const std::uint16_t> view(pixels.data(), W, H, 9);
  CHECK(check_image_type(view, [](int x, int y) { return 1000 * value(x, y); }).text() == "");
  Image<float> metres;
  copy_to_float(view, 0.001, metres);
  for (int y = 0; y < H; ++y) {
    for (int x = 0; x < W; ++x) CHECK(metres(x, y) == doctest::Approx(value(x, y)).epsilon(1e-6));
  }
}

TEST_CASE("images kept in vectors conform") {
  host::VectorImage flat{W, H, {}};
  host::NestedImage nested;
  std::vector<const float*> rows;
  host::RgbImage grey{W, H, {}};
  for (int y = 0; y < H; ++y) {
    nested.emplace_back();
    for (int x = 0; x < W; ++x) {
      flat.pixels.push_back(static_cast<std::uint16_t>(value(x, y)));
      nested.back().push_back(static_cast<float>(value(x, y)));
      for (int c = 0; c < 3; ++c) grey.rgb.push_back(static_cast<std::uint8_t>(value(x, y)));
    }
  }
  for (const auto& row : nested) rows.push_back(row.data());
  CHECK(check_image_type(flat, value).text() == "");
  CHECK(check_image_type(nested, value).text() == "");
  CHECK(check_image_type(host::PointerRows{rows.data(), W, H}, value).text() == "");
  CHECK(check_image_type(grey).text() == "");
  // equal channels give their common value
  CHECK(image_traits<host::RgbImage>::at(grey, 3, 2) == doctest::Approx(value(3, 2) / 255.0).epsilon(1e-6));
}

TEST_CASE("byte buffers as in messages conform: padded, unaligned, either byte order, one channel of several") {
  const int one = 1;
  const bool little = *reinterpret_cast<const char*>(&one) == 1;
  for (const bool big : {false, true}) {
    for (const std::size_t offset : {0U, 1U}) {  // 1: no pixel is aligned
      const std::size_t step = 2 * W + 3;
      std::vector<std::uint8_t> bytes(offset + step * H, 0xEE);
      for (int y = 0; y < H; ++y) {
        for (int x = 0; x < W; ++x) {
          const int v = 300 * value(x, y);
          std::uint8_t* p = bytes.data() + offset + step * static_cast<std::size_t>(y) + 2 * static_cast<std::size_t>(x);
          p[big ? 0 : 1] = static_cast<std::uint8_t>(v >> 8);
          p[big ? 1 : 0] = static_cast<std::uint8_t>(v & 0xFF);
        }
      }
      const ByteImage<std::uint16_t> image =
          byte_image<std::uint16_t>(bytes.data() + offset, bytes.size() - offset, W, H, step, 2, big == little);
      CHECK(check_image_type(image, [](int x, int y) { return 300 * value(x, y); }).text() == "");
    }
  }
  std::vector<std::uint8_t> rgba(4 * W * H);
  for (std::size_t i = 0; i < rgba.size(); ++i) rgba[i] = static_cast<std::uint8_t>(i);
  const auto green = byte_image<std::uint8_t>(rgba.data() + 1, rgba.size() - 1, W, H, 4 * W, 4);
  CHECK(check_image_type(green, [](int x, int y) { return 4 * (W * y + x) + 1; }).text() == "");
}

TEST_CASE("a byte buffer that is too small for its image is refused") {
  std::vector<std::uint8_t> bytes(2 * W * H);
  CHECK_NOTHROW((void)byte_image<std::uint16_t>(bytes.data(), bytes.size(), W, H, 2 * W));
  CHECK_THROWS_AS((void)byte_image<std::uint16_t>(bytes.data(), bytes.size() - 1, W, H, 2 * W), contract_error);
  CHECK_THROWS_AS((void)byte_image<std::uint16_t>(bytes.data(), bytes.size(), W, H, 2 * W - 1), contract_error);
  CHECK_THROWS_AS((void)byte_image<std::uint16_t>(bytes.data(), bytes.size(), W, H + 1, 2 * W), contract_error);
  CHECK_THROWS_AS((void)byte_image<std::uint16_t>(bytes.data(), bytes.size(), W, H, ~std::size_t{0} / 2), contract_error);
  CHECK_THROWS_AS((void)byte_image<std::uint16_t>(bytes.data(), bytes.size(), 0, H, 2 * W), contract_error);
  CHECK_THROWS_AS((void)byte_image<std::uint16_t>(nullptr, bytes.size(), W, H, 2 * W), contract_error);
  CHECK_THROWS_AS((void)byte_image<std::uint16_t>(bytes.data(), bytes.size(), W, H, 2 * W, 1), contract_error);
}

TEST_CASE("poses of other systems conform") {
  const auto by_eigen = [](const auto& T, const Eigen::Vector3d& x) -> Eigen::Vector3d {
    using S = typename std::decay_t<decltype(T)>::Scalar;
    const Eigen::Matrix<S, 3, 1> y = T * x.cast<S>();
    return y.template cast<double>();
  };
  CHECK(check_pose_type<Eigen::Isometry3d>(by_eigen).text() == "");
  CHECK(check_pose_type<Eigen::Isometry3f>(by_eigen).text() == "");
  CHECK(check_pose_type<Eigen::Affine3d>(by_eigen).text() == "");
  CHECK(check_pose_type<Eigen::Transform<double, 3, Eigen::Isometry, Eigen::DontAlign>>(by_eigen).text() == "");
  CHECK(check_pose_type<Eigen::Matrix4d>([](const Eigen::Matrix4d& T, const Eigen::Vector3d& x) -> Eigen::Vector3d {
          return (T * x.homogeneous()).head<3>();
        }).text() == "");
  CHECK(check_pose_type<Eigen::Matrix4f>().text() == "");
  CHECK(check_pose_type<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>().text() == "");
  CHECK(check_pose_type<host::SE3Quat>([](const host::SE3Quat& T, const Eigen::Vector3d& x) { return T.map(x); }).text() == "");
  CHECK(check_pose_type<host::QuaternionPose>().text() == "");
  CHECK(check_pose_type<host::RowMajor16>([](const host::RowMajor16& T, const Eigen::Vector3d& x) -> Eigen::Vector3d {
          Eigen::Vector3d y;
          for (std::size_t i = 0; i < 3; ++i) {
            y(static_cast<int>(i)) = T[4 * i] * x.x() + T[4 * i + 1] * x.y() + T[4 * i + 2] * x.z() + T[4 * i + 3];
          }
          return y;
        }).text() == "");
  CHECK(check_pose_type<host::TrackedPose>([](const host::TrackedPose& T, const Eigen::Vector3d& x) -> Eigen::Vector3d {
          return (T.Rcw.transpose() * (x.cast<float>() - T.tcw)).cast<double>();
        }).text() == "");
}

TEST_CASE("a pose type that stores the inverse is detected if it is used directly") {
  const auto stored = [](const host::TrackedPose& T, const Eigen::Vector3d& x) -> Eigen::Vector3d {
    return (T.Rcw * x.cast<float>() + T.tcw).cast<double>();
  };
  CHECK_FALSE(check_pose_type<host::TrackedPose>(stored).passed());
}

TEST_CASE("keypoints and detections conform, and mistakes in them are found") {
  const host::Corner corner{3.5, 4.25, 7.0F, -1.57079633F};
  CHECK(testing::check_keypoint_type(corner, {3.5F, 4.25F, 7.0F, to_keypoint(corner).angle, 0}).text() == "");
  CHECK(to_keypoint(corner).angle == doctest::Approx(270).epsilon(1e-5));
  CHECK_FALSE(testing::check_keypoint_type(corner, {4.25F, 3.5F, 7.0F, 270.0F, 0}).passed());
  CHECK_FALSE(testing::check_keypoint_type(Keypoint{1, 2, -1, 0, 0}, {1, 2, -1, 0, 0}).passed());
  CHECK_FALSE(testing::check_keypoint_type(Keypoint{1, 2, 1, 400, 0}, {1, 2, 1, 400, 0}).passed());

  const host::RelativeBox box{0.5F, 0.25F, 0.25F, 0.5F, 0.75F, 3, 640, 480};
  CHECK(testing::check_detection_type(box, {240, 0, 160, 240}).text() == "");
  CHECK_FALSE(testing::check_detection_type(box, {320, 120, 160, 240}).passed());
  CHECK_FALSE(testing::check_detection_type(host::RelativeBox{0.5F, 0.5F, 1, 1, 75.0F, 3, 640, 480}, {0, 0, 640, 480}).passed());
}
