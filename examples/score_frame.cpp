// Step 1 of 3: how good is a frame? Scores the frames of an RGB-D recording and says why.
//
//   score_frame                      a synthetic recording of a room with walking people
//   score_frame INTENSITY DEPTH      one image pair (8 or 16 bit intensity, 16 bit depth with 5000 units per metre)
#include <cstdint>
#include <cstdio>
#include <vector>

#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>

#include <apso/apso.hpp>
#include <apso/opencv/adapters.hpp>
#include <apso/testing/synthetic.hpp>

namespace {
// The features are yours; here FAST corners of OpenCV, whose responses the defaults are made for.
std::vector<cv::KeyPoint> corners(const cv::Mat& grey) {
  std::vector<cv::KeyPoint> found;
  cv::FAST(grey, found, 20);
  cv::KeyPointsFilter::retainBest(found, 1000);
  return found;
}

void show(const apso::Assessment& a) {
  std::printf("frame %3d  S_total %.2f ", a.frame, a.S_total.value());
  apso::for_each_frame_score(a, [](const char* name, const auto& value, double, apso::Better) {
    if (value) std::printf("  %s %.2f", name, *value);
  });
  std::printf("  dynamic %.2f  %s\n", a.dynamic_ratio, apso::to_string(a.state));
}
}  // namespace

int main(int argc, char** argv) {
  if (argc == 3) {
    const cv::Mat grey = cv::imread(argv[1], cv::IMREAD_GRAYSCALE);
    const cv::Mat raw = cv::imread(argv[2], cv::IMREAD_UNCHANGED);
    if (grey.empty() || raw.type() != CV_16U || raw.size() != grey.size()) {
      std::fprintf(stderr, "score_frame: need two images of one size, the second with 16 bit depth\n");
      return 1;
    }
    // [score]
    const apso::Pinhole camera = apso::testing::freiburg3_camera(grey.cols, grey.rows);
    const auto intensity = apso::opencv::as_image<std::uint8_t>(grey);
    const auto depth = apso::scaled(apso::opencv::as_image<std::uint16_t>(raw), 1 / 5000.F);  // metres, without a copy
    const std::vector<cv::KeyPoint> keypoints = corners(grey);
    apso::SceneAssessor assessor(camera);
    const auto frame = apso::frame(0.0, intensity, depth, camera);
    show(assessor.assess(apso::assessment_input(frame, keypoints)));
    // [/score]
    return 0;
  }

  apso::testing::SyntheticOptions options;
  options.frames = 60;
  const apso::testing::SyntheticSequence sequence("walking_xyz", options);
  apso::SceneAssessor assessor(sequence.camera());
  apso::testing::SyntheticFrame frame;
  apso::Image<float> dynamic;  // [0,1]: here the truth, else the mask of a network or of apso::GeometricMotion
  for (int i = 0; i < sequence.size(); ++i) {
    sequence.render(i, frame);
    apso::testing::true_dynamic_probability(frame, dynamic);
    cv::Mat grey;
    apso::opencv::as_mat(frame.intensity.view()).convertTo(grey, CV_8U, 255.0);
    const std::vector<cv::KeyPoint> keypoints = corners(grey);
    const auto input = apso::assessment_input(frame.rgbd(), keypoints, apso::none, apso::none, dynamic);
    const apso::Assessment& assessment = assessor.assess(input);
    if (i % 6 == 5) show(assessment);  // the first 30 frames look for a reference
  }
  return 0;
}
