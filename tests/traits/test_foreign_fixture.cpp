// The types of tests/foreign_types.hpp conform, and what their converters say of an image is what the library reads.
#include <cstddef>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <apso/testing/conformance.hpp>
#include <apso/traits/images/rows.hpp>
#include <apso/traits/ranges.hpp>

#include "../foreign_types.hpp"

using namespace apso;

namespace {
Image<float> ramp(float step) {
  Image<float> image(9, 5);
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 9; ++x) image(x, y) = step * static_cast<float>(9 * y + x);
  }
  return image;
}
// every pixel as rows() gives it
template <class I>
std::vector<float> read(I&& image) {
  std::vector<float> buffer;
  std::vector<float> all;
  auto lines = rows(std::forward<I>(image), buffer);
  for (int y = 0; y < lines.height(); ++y) {
    const float* line = lines(y);
    all.insert(all.end(), line, line + lines.width());
  }
  return all;
}
std::vector<float> read_native(const Image<float>& image) { return {image.data(), image.data() + image.size()}; }
}  // namespace

TEST_CASE("foreign images conform and are read as their converters say") {
  const Image<float> depth = ramp(0.25F);  // pixel (0,0) is 0: invalid
  const foreign::PaddedU16 padded = foreign::padded_u16(depth, 1 / 5000.0F);
  CHECK(testing::check_image_type(padded, [](int x, int y) { return 1250 * (9 * y + x); }).text() == "");
  CHECK(read(scaled(padded, 1 / 5000.0F)) == read_native(foreign::native(padded, 1 / 5000.0F)));

  const foreign::FloatMillimetres mm = foreign::float_millimetres(depth);
  CHECK(testing::check_image_type(mm, [](int x, int y) { return x + y == 0 ? -1 : 250 * (9 * y + x); }).text() == "");
  CHECK(read(scaled(mm, 0.001F)) == read_native(foreign::native(mm)));
  CHECK(read(mm)[0] == foreign::FloatMillimetres::kInvalid);

  const foreign::XyzCloud cloud = foreign::xyz_cloud(depth, 100, 4, 2);
  const std::vector<float> z = read(cloud);
  CHECK(z[0] != z[0]);
  for (std::size_t i = 1; i < z.size(); ++i) CHECK(z[i] == depth.data()[i]);

  const foreign::AtOnly grey = foreign::at_only(ramp(1.0F / 255));
  CHECK(testing::check_image_type(grey, [](int x, int y) { return 9 * y + x; }).text() == "");
  CHECK(read(as_intensity(grey)) == read_native(foreign::native(grey)));
}

TEST_CASE("rows of any width are converted to their ends") {  // in blocks of 32 and what is left
  for (const int width : {31, 32, 33, 64, 75}) {
    CAPTURE(width);
    foreign::PaddedU16 image;
    image.columns = width;
    image.lines = 3;
    image.stride = static_cast<std::size_t>(width) + 5;
    for (std::size_t i = 0; i < 3 * image.stride; ++i) image.buffer.push_back(static_cast<std::uint16_t>(7 * i + 1));
    const std::vector<float> all = read(scaled(image, 0.25F));  // exact
    REQUIRE(all.size() == static_cast<std::size_t>(3 * width));
    for (std::size_t i = 0; i < all.size(); ++i) {
      const std::size_t y = i / static_cast<std::size_t>(width), x = i % static_cast<std::size_t>(width);
      CHECK(all[i] == static_cast<float>(7 * (y * image.stride + x) + 1) / 4);
    }
  }
}

TEST_CASE("foreign poses conform") {
  CHECK(testing::check_pose_type<foreign::DualQuaternionPose>().text() == "");
  CHECK(testing::check_pose_type<foreign::RowMajor3x4Pose>().text() == "");
}

TEST_CASE("foreign lists are read as what they were made from") {
  const std::vector<Keypoint> keypoints{{1.5F, 2, 30, 0, 0}, {7, 3.25F, 11, 0, 0}};
  std::vector<Keypoint> read_keypoints;
  CHECK(as_keypoints(foreign::corners(keypoints), read_keypoints).size() == 2);
  CHECK(read_keypoints[1].x == 7);
  CHECK(read_keypoints[1].y == 3.25F);
  CHECK(read_keypoints[0].response == 30);

  const std::vector<PointTrack> tracks{{4, 3, 2, 2.5F, 2.25F, 3}, {9, 1, 1, 1, 1, 0}};
  std::vector<PointTrack> read_tracks;
  CHECK(as_tracks(foreign::features(tracks), read_tracks).size() == 2);
  CHECK(read_tracks[0].id == 4);
  CHECK(read_tracks[0].previous_x == 2.5F);
  CHECK(read_tracks[0].previous_y == 2.25F);
  CHECK(read_tracks[0].age == 3);
  CHECK(read_tracks[1].age == 0);

  std::vector<std::uint8_t> mask(45, 0);
  mask[11] = 1;
  Detection detection;
  detection.box = {1, 1, 3, 2};
  detection.score = 0.75F;
  detection.class_id = 2;
  detection.mask = {mask.data(), 9, 5};
  const std::vector<foreign::Box2d> boxes = foreign::boxes({detection});
  std::vector<Detection> read_boxes;
  CHECK(as_detections(boxes, read_boxes).size() == 1);
  CHECK(iou(read_boxes[0].box, detection.box) == 1);
  CHECK(read_boxes[0].score == 0.75F);
  CHECK(read_boxes[0].class_id == 2);
  CHECK(read_boxes[0].mask(2, 1) == 1);
  CHECK(read_boxes[0].mask(3, 1) == 0);
}
