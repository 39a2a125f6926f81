// expect: apso: a motion policy needs `void remember(const apso::AnyFrame& frame, const apso::Pose& T_world_camera, const
// apso::DynamicMask& mask);`
#include <apso/pipeline/pipeline.hpp>

struct MyPolicy {
  void observe(const apso::AnyFrame&, const apso::Pose&, const std::vector<apso::PointTrack>&, apso::DynamicMask&) {}
#ifdef CONTROL
  void remember(const apso::AnyFrame&, const apso::Pose&, const apso::DynamicMask&) {}
#endif
  void reset() {}
};

void use(apso::BasicPipeline<apso::Pose, MyPolicy>& pipeline) { pipeline.reset(); }
