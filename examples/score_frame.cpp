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
std::vector<apso::Keypoint> corners(const apso::ImageView<const float>& intensity) {
  cv::Mat grey;
  apso::opencv::as_mat(intensity).convertTo(grey, CV_8U, 255.0);
  std::vector<cv::KeyPoint> found;
  cv::FAST(grey, found, 20);
  cv::KeyPointsFilter::retainBest(found, 1000);
  std::vector<apso::Keypoint> keypoints;
  apso::copy_keypoints(found, keypoints);
  return keypoints;
}

void show(const apso::Assessment& a) {
  const auto print = [](const char* name, const apso::MaybeQuality& q) {
    if (q) std::printf("  %s %.2f", name, q->value());
  };
  std::printf("frame %3d  S_total %.2f ", a.frame, a.S_total.value());
  print("S_spatial", a.S_spatial);
  print("S_feature", a.S_feature);
  print("S_depth", a.S_depth);
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
    apso::Image<float> intensity;
    apso::Image<float> depth;
    apso::copy_to_float(apso::opencv::as_image<std::uint8_t>(grey), 1.0 / 255, intensity);
    apso::copy_to_float(apso::opencv::as_image<std::uint16_t>(raw), 1.0 / 5000, depth);
    const std::vector<apso::Keypoint> keypoints = corners(intensity);
    // [score]
    apso::SceneAssessor assessor(apso::testing::freiburg3_camera(grey.cols, grey.rows));
    apso::AssessmentInput input;
    input.frame = {0.0, intensity, depth};
    input.keypoints = &keypoints;
    show(assessor.assess(input));
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
    const std::vector<apso::Keypoint> keypoints = corners(frame.intensity);
    apso::AssessmentInput input;
    input.frame = frame.rgbd();
    input.dynamic_probability = dynamic;
    input.dynamic_ratio = apso::testing::dynamic_share(frame);
    input.keypoints = &keypoints;
    const apso::Assessment& assessment = assessor.assess(input);
    if (i % 6 == 5) show(assessment);  // the first 30 frames look for a reference
  }
  return 0;
}
