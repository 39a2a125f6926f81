// expect: apso: a motion policy needs observe(frame, T_world_camera_prior, tracks, mask), remember(frame, T_world_camera, mask) and reset()
#include <apso/pipeline/pipeline.hpp>

struct MyPolicy {
  void observe(const apso::RgbdFrame&, const apso::Pose&, const std::vector<apso::PointTrack>&, apso::DynamicMask&) {}
#ifdef CONTROL
  void remember(const apso::RgbdFrame&, const apso::Pose&, const apso::DynamicMask&) {}
#endif
  void reset() {}
};

void use(apso::BasicPipeline<apso::Pose, MyPolicy>& pipeline) { pipeline.reset(); }
