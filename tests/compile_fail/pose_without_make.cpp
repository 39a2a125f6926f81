// expect: apso: pose_traits<T> needs `static T make(const Eigen::Matrix<scalar,3,3>& R, const Eigen::Matrix<scalar,3,1>& t);`
#include <apso/traits/pose.hpp>

struct MyPose {};
template <>
struct apso::pose_traits<MyPose> {
  using scalar = double;
  static Eigen::Matrix3d rotation(const MyPose&) { return Eigen::Matrix3d::Identity(); }
  static Eigen::Vector3d translation(const MyPose&) { return Eigen::Vector3d::Zero(); }
#ifdef CONTROL
  static MyPose make(const Eigen::Matrix3d&, const Eigen::Vector3d&) { return {}; }
#endif
};

MyPose use(const MyPose& pose) { return apso::from_pose<MyPose>(apso::to_pose(pose)); }
