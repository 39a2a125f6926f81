#include <atomic>
#include <vector>

#include <doctest/doctest.h>

#include <apso/executor.hpp>
#include <apso/opencv/adapters.hpp>
#include <apso/opencv/parallel.hpp>
#include <apso/testing/conformance.hpp>

using namespace apso;

static_assert(is_image_v<cv::Mat_<float>> && has_row_v<cv::Mat_<float>>);
static_assert(!is_image_v<cv::Mat> && !is_image_v<cv::Mat_<cv::Vec3b>>);
static_assert(is_pose_v<cv::Affine3d> && is_pose_v<cv::Affine3f> && is_pose_v<cv::Matx44d>);
static_assert(is_keypoint_v<cv::KeyPoint>);

TEST_CASE("typed matrices and views of untyped ones are images, also when they are parts of larger ones") {
  cv::Mat_<std::uint16_t> whole(6, 9);
  for (int y = 0; y < whole.rows; ++y) {
    for (int x = 0; x < whole.cols; ++x) whole(y, x) = static_cast<std::uint16_t>(100 * y + x);
  }
  const cv::Mat_<std::uint16_t> part = whole(cv::Rect(2, 1, 5, 4));
  const auto expected = [](int x, int y) { return 100 * (y + 1) + x + 2; };
  CHECK(testing::check_image_type(part, expected).text() == "");
  CHECK(testing::check_image_type(opencv::as_image<std::uint16_t>(part), expected).text() == "");
  const cv::Mat back = opencv::as_mat(opencv::as_image<std::uint16_t>(part));
  CHECK(back.data == part.data);
  CHECK(cv::norm(back, part, cv::NORM_INF) == 0);
}

TEST_CASE("as_image refuses what it cannot be") {
  CHECK_THROWS_AS((void)opencv::as_image<float>(cv::Mat()), contract_error);
  CHECK_THROWS_AS((void)opencv::as_image<float>(cv::Mat(2, 2, CV_8U)), contract_error);
  CHECK_THROWS_AS((void)opencv::as_image<std::uint8_t>(cv::Mat(2, 2, CV_8UC3)), contract_error);
  CHECK(opencv::as_mat(ImageView<const float>()).empty());
}

TEST_CASE("poses of OpenCV conform") {
  CHECK(testing::check_pose_type<cv::Affine3d>([](const cv::Affine3d& T, const Eigen::Vector3d& x) {
          const cv::Vec3d y = T * cv::Vec3d(x.x(), x.y(), x.z());
          return Eigen::Vector3d(y[0], y[1], y[2]);
        }).text() == "");
  CHECK(testing::check_pose_type<cv::Affine3f>().text() == "");
  CHECK(testing::check_pose_type<cv::Matx44d>().text() == "");
  CHECK(testing::check_pose_type<cv::Matx44f>().text() == "");
}

TEST_CASE("keypoints of OpenCV are read; a missing angle becomes 0") {
  const Keypoint k = to_keypoint(cv::KeyPoint(1.5F, 2.5F, 31.0F, -1.0F, 7.0F, 2));
  CHECK(k.x == 1.5F);
  CHECK(k.y == 2.5F);
  CHECK(k.response == 7.0F);
  CHECK(k.angle == 0.0F);
  CHECK(k.octave == 2);
}

TEST_CASE("the parallel executor calls every part once") {
  for (const int n : {0, 1, 7, 1000}) {
    std::vector<std::atomic<int>> calls(static_cast<std::size_t>(n));
    opencv::ParallelExecutor()(n, [&](int i) { ++calls[static_cast<std::size_t>(i)]; });
    int wrong = 0;
    for (const auto& c : calls) wrong += c != 1;
    CHECK(wrong == 0);
  }
}
