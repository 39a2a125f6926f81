// Which parts of an image does an alignment not believe? Aligns two frames without any mask and paints what the found
// motion does not explain red: usually what has moved.
//
//   residual_weights GREY_1 DEPTH_1 GREY_2 DEPTH_2 PICTURE     images of 8 bit, and of 16 bit with 5000 units per metre
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/align.hpp>
#include <apso/observation/geometry/low_res_alignment.hpp>
#include <apso/opencv/adapters.hpp>
#include <apso/testing/synthetic.hpp>

namespace {
constexpr int kFactor = 2;  // the picture has half the size

apso::SmallFrame small_frame(const cv::Mat& grey, const cv::Mat& depth, const apso::Pinhole& camera) {
  const auto metres = apso::scaled(apso::opencv::as_image<std::uint16_t>(depth), 1.0F / 5000);
  apso::SmallFrame out;
  apso::FrameReducer reducer(camera, camera.width / kFactor, apso::DepthRange{});
  reducer.frame(apso::frame(0, apso::opencv::as_image<std::uint8_t>(grey), metres, camera), out);
  return out;
}

/// Weight of the Cauchy kernel for the residuals of intensity and depth together, (0,1].
double weight(const apso::WarpedPixel& p) {
  const double i = static_cast<double>(p.r_intensity / p.sigma_intensity);
  const double d = static_cast<double>(p.r_depth / p.sigma_depth);
  return 1 / (1 + 0.5 * (i * i + d * d) / (2.3849 * 2.3849));
}
}  // namespace

int main(int argc, char** argv) {
  if (argc != 6) {
    std::fprintf(stderr, "usage: residual_weights GREY_1 DEPTH_1 GREY_2 DEPTH_2 PICTURE\n");
    return 2;
  }
  cv::Mat images[4];
  for (int i = 0; i < 4; ++i) {
    images[i] = cv::imread(argv[i + 1], i % 2 == 0 ? cv::IMREAD_GRAYSCALE : cv::IMREAD_UNCHANGED);
    if (images[i].empty() || images[i].type() != (i % 2 == 0 ? CV_8U : CV_16U) || images[i].size() != images[0].size()) {
      std::fprintf(stderr, "residual_weights: cannot use %s: expected %s image of the size of the first\n", argv[i + 1],
                   i % 2 == 0 ? "an" : "a 16-bit");
      return 1;
    }
  }
  const apso::Pinhole camera = apso::testing::freiburg3_camera(images[0].cols, images[0].rows);
  const auto frame = [&](double seconds, const cv::Mat& grey, const cv::Mat& depth) {
    return apso::frame(seconds, apso::opencv::as_image<std::uint8_t>(grey),
                       apso::scaled(apso::opencv::as_image<std::uint16_t>(depth), 1 / 5000.F), camera);
  };
  const auto found = apso::align(frame(0, images[0], images[1]), frame(1, images[2], images[3]));
  std::printf("%s, confidence %.2f, %.0f %% of the view is taken as static\n", apso::to_string(found.status), found.confidence,
              100 * found.detail.static_share);

  const apso::Pinhole half = apso::reduced_camera(camera, kFactor);
  const apso::SmallFrame past = small_frame(images[0], images[1], camera);
  const apso::SmallFrame current = small_frame(images[2], images[3], camera);
  const apso::FloatPose warp(apso::inverse(found.T_current_reference));
  cv::Mat picture(half.height, half.width, CV_8UC3);
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      apso::WarpedPixel p;
      const double grey = 255 * static_cast<double>(current.intensity(x, y));
      const bool seen = apso::warp_pixel(current, x, y, past, half, warp, p);
      const double w = seen ? weight(p) : 1;  // where nothing is compared the picture stays grey
      const auto dim = cv::saturate_cast<std::uint8_t>(grey * w);
      picture.at<cv::Vec3b>(y, x) = {dim, dim, cv::saturate_cast<std::uint8_t>(grey + (255 - grey) * (1 - w))};
    }
  }
  if (!cv::imwrite(argv[5], picture)) {
    std::fprintf(stderr, "residual_weights: cannot write %s\n", argv[5]);
    return 1;
  }
  return 0;
}
