// expect: apso: pose_traits<T> needs `static Eigen::Matrix<scalar,3,1> translation(const T& pose);`
#include <apso/traits/pose.hpp>

struct MyPose {};
template <>
struct apso::pose_traits<MyPose> {
  using scalar = double;
  static Eigen::Matrix3d rotation(const MyPose&) { return Eigen::Matrix3d::Identity(); }
#ifdef CONTROL
  static Eigen::Vector3d translation(const MyPose&) { return Eigen::Vector3d::Zero(); }
#endif
  static MyPose make(const Eigen::Matrix3d&, const Eigen::Vector3d&) { return {}; }
};

MyPose use(const MyPose& pose) { return apso::from_pose<MyPose>(apso::to_pose(pose)); }
