// expect: apso: a motion policy needs `void observe(const apso::AnyFrame& frame, const apso::Pose& T_world_camera_prior, const
// std::vector<apso::PointTrack>& tracks, apso::DynamicMask& out);`
#include <apso/observation/combined_policy.hpp>

struct MyMotion {
#ifdef CONTROL
  void observe(const apso::AnyFrame&, const apso::Pose&, const std::vector<apso::PointTrack>&, apso::DynamicMask&) {}
#endif
  void remember(const apso::AnyFrame&, const apso::Pose&, const apso::DynamicMask&) {}
  void reset() {}
};

apso::AnyMotionPolicy held() { return MyMotion{}; }
