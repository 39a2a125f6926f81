// Step 2 of 3: how did the camera move between two frames? Aligns them directly, without features.
//
//   align_pair                                    two synthetic frames, with the truth to compare
//   align_pair GREY_1 DEPTH_1 GREY_2 DEPTH_2      four images (8 bit, 16 bit depth with 5000 units per metre)
#include <cstdint>
#include <cstdio>

#include <opencv2/imgcodecs.hpp>

#include <apso/apso.hpp>
#include <apso/opencv/adapters.hpp>
#include <apso/testing/synthetic.hpp>

namespace {
constexpr double kDegrees = 57.29577951308232;

void show(const char* name, const apso::Pose& T) {
  const Eigen::Vector3d t = T.translation();
  std::printf("%-10s x %+.4f  y %+.4f  z %+.4f m   turned by %.3f deg\n", name, t.x(), t.y(), t.z(), kDegrees * apso::rotation_angle(T));
}
void show(const apso::PairAlignment<>& result) {
  std::printf("%s after %d iterations, confidence %.2f\n", apso::to_string(result.status), result.detail.iterations, result.confidence);
  show("estimated", result.T_current_reference);
}

int align_files(char** names) {
  cv::Mat images[4];
  for (int i = 0; i < 4; ++i) {
    images[i] = cv::imread(names[i], i % 2 == 0 ? cv::IMREAD_GRAYSCALE : cv::IMREAD_UNCHANGED);
    if (images[i].empty() || images[i].type() != (i % 2 == 0 ? CV_8U : CV_16U) || images[i].size() != images[0].size()) {
      std::fprintf(stderr, "align_pair: cannot use %s\n", names[i]);
      return 1;
    }
  }
  const apso::Pinhole camera = apso::testing::freiburg3_camera(images[0].cols, images[0].rows);
  const auto frame = [&](double seconds, const cv::Mat& grey, const cv::Mat& depth) {
    return apso::frame(seconds, apso::opencv::as_image<std::uint8_t>(grey),
                       apso::scaled(apso::opencv::as_image<std::uint16_t>(depth), 1 / 5000.F), camera);
  };
  show(apso::align(frame(0, images[0], images[1]), frame(1, images[2], images[3])));
  return 0;
}
}  // namespace

int main(int argc, char** argv) {
  if (argc == 5) return align_files(argv + 1);

  const apso::testing::SyntheticSequence sequence("static_xyz");
  apso::testing::SyntheticFrame reference;
  apso::testing::SyntheticFrame current;
  sequence.render(20, reference);
  sequence.render(25, current);

  const auto result = apso::align(apso::frame(0, reference.intensity, reference.depth, sequence.camera()),
                                  apso::frame(1, current.intensity, current.depth, sequence.camera()));

  const apso::Pose truth = apso::inverse(current.T_world_camera) * reference.T_world_camera;
  show("true", truth);
  show(result);
  const double error = (result.T_current_reference.translation() - truth.translation()).norm();
  std::printf("error      %.4f m\n", error);
  return apso::succeeded(result.status) && error < 0.02 ? 0 : 1;
}
