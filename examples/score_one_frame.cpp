// How good is one RGB-D frame, and why? Eigen is all this file needs.
#include <cstdio>
#include <vector>

#include <apso/score.hpp>
#include <apso/testing/synthetic.hpp>

int main() {
  const apso::testing::SyntheticSequence sequence("walking_xyz");  // stands for your camera
  apso::testing::SyntheticFrame image;
  sequence.render(0, image);
  std::vector<apso::Keypoint> corners;  // of any type with keypoint_traits, from any detector
  for (int i = 0; i < 600; ++i) corners.push_back({static_cast<float>(i % 30 * 21), static_cast<float>(i / 30 * 23), 30, 0, 0});
  // [score]
  apso::SceneAssessor assessor(sequence.camera());
  const auto frame = apso::frame(image.timestamp, image.intensity, image.depth, sequence.camera());
  const auto good = assessor.assess(apso::assessment_input(frame, corners));  // no tracks, objects or mask
  corners.resize(20);                                                         // all in the first row
  const auto poor = assessor.assess(apso::assessment_input(frame, corners));
  std::printf("S_feature %.2f, then %.2f\n%s\n", good.get<apso::Feature>()->value(), poor.get<apso::Feature>()->value(),
              apso::explain(poor).c_str());
  // [/score]
  return poor.S_total < good.S_total && poor.get<apso::Depth>() == good.get<apso::Depth>() ? 0 : 1;
}
