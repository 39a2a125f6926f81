// expect: apso: pose_traits<T> needs `static T make(const Eigen::Matrix<scalar,3,3>& R, const Eigen::Matrix<scalar,3,1>& t);`
#include <apso/traits/pose.hpp>

struct MyPose {};
template <>
struct apso::pose_traits<MyPose> {
  using scalar = float;
  static Eigen::Matrix3f rotation(const MyPose&) { return Eigen::Matrix3f::Identity(); }
  static Eigen::Vector3f translation(const MyPose&) { return Eigen::Vector3f::Zero(); }
#ifdef CONTROL
  static MyPose make(const Eigen::Matrix3f&, const Eigen::Vector3f&) { return {}; }
#else
  static MyPose make(const Eigen::Vector3f&, const Eigen::Matrix3f&) { return {}; }
#endif
};

MyPose use(const MyPose& pose) { return apso::from_pose<MyPose>(apso::to_pose(pose)); }
