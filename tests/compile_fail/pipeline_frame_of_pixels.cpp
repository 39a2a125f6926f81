// expect: apso: a frame is made by `apso::frame(timestamp, intensity, depth, camera)` from any images
#include <apso/pipeline/pipeline.hpp>

void use(apso::Pipeline& pipeline, const apso::Image<float>& grey, const apso::Image<float>& depth) {
#ifdef CONTROL
  pipeline.observe(apso::frame(0, grey, depth, pipeline.camera()), apso::Pose::Identity());
#else
  (void)depth;
  pipeline.observe(grey, apso::Pose::Identity());
#endif
}
