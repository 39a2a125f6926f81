// expect: apso: pose_traits<T> needs `using scalar = double;`
#include <apso/traits/pose.hpp>

struct MyPose {};
template <>
struct apso::pose_traits<MyPose> {
#ifdef CONTROL
  using scalar = double;
#endif
  static Eigen::Matrix3d rotation(const MyPose&) { return Eigen::Matrix3d::Identity(); }
  static Eigen::Vector3d translation(const MyPose&) { return Eigen::Vector3d::Zero(); }
  static MyPose make(const Eigen::Matrix3d&, const Eigen::Vector3d&) { return {}; }
};

MyPose use(const MyPose& pose) { return apso::from_pose<MyPose>(apso::to_pose(pose)); }
