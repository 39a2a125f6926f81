// expect: apso: a motion policy needs `void remember(const apso::AnyFrame& frame, const apso::Pose& T_world_camera, const
// apso::DynamicMask& mask);`
#include <apso/observation/combined_policy.hpp>
#include <apso/observation/policies/geometric_motion.hpp>

struct MyMotion {
  void observe(const apso::AnyFrame&, const apso::Pose&, const std::vector<apso::PointTrack>&, apso::DynamicMask&) {}
#ifdef CONTROL
  void remember(const apso::AnyFrame&, const apso::Pose&, const apso::DynamicMask&) {}
#endif
  void reset() {}
};

auto join(const apso::GeometricMotion& p) { return p | MyMotion{}; }
