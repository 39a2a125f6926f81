// expect: apso: stamped_pose_traits<T> needs `static double timestamp(const T& entry);` in seconds
#include <apso/evaluate.hpp>

struct MyKeyframe {
  double t;
  apso::Pose T;
};
template <>
struct apso::stamped_pose_traits<MyKeyframe> {
#ifdef CONTROL
  static double timestamp(const MyKeyframe& k) { return k.t; }
#endif
  static apso::Pose pose(const MyKeyframe& k) { return k.T; }
};

double use(const std::vector<MyKeyframe>& truth, const std::vector<MyKeyframe>& estimate) {
  return apso::ate(truth, estimate).statistics.rmse;
}
