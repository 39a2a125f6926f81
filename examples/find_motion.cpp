// Find what moves in RGB-D frames, from depth alone. Eigen is all this file needs.
#include <cstdio>

#include <apso/motion.hpp>
#include <apso/testing/synthetic.hpp>

int main() {
  const apso::testing::SyntheticSequence sequence("walking_xyz");  // stands for your camera
  apso::testing::SyntheticFrame image;
  // [motion]
  apso::GeometricMotion motion(sequence.camera());
  apso::DynamicMask mask;
  for (int i = 0; i < 20; ++i) {
    sequence.render(i, image);
    const auto now = apso::frame(image.timestamp, image.intensity, image.depth, sequence.camera());
    motion.observe(now, image.T_world_camera, apso::none, mask);  // a guess of the pose; no tracks
    motion.remember(now, image.T_world_camera, mask);             // the final pose
  }
  std::printf("%.1f %% of the image moves\n", 100 * apso::dynamic_ratio(mask));
  // [/motion]
  apso::DynamicMask truth, both = mask;
  apso::mask_from_labels(image.instance, truth);  // any image of labels is a mask
  apso::combine(truth, apso::MaskCombination::Product, both);
  return apso::dynamic_ratio(both) > 0.7 * apso::dynamic_ratio(mask) ? 0 : 1;  // most of what is marked are people
}
