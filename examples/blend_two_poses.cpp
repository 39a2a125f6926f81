// Two estimates of one pose, joined as far as each can be trusted. Eigen is all this file needs.
#include <cstdio>

#include <Eigen/Geometry>

#include <apso/blend.hpp>

int main() {
  // [blend]
  const Eigen::Matrix4d T_direct = Eigen::Matrix4d::Identity();  // any pose type
  Eigen::Matrix4d T_feature = T_direct;
  T_feature(0, 3) = 0.10;  // they differ by 10 cm in x and in z
  T_feature(2, 3) = 0.10;
  const Eigen::Matrix4d half = apso::blend(T_feature, T_direct, 0.5);  // comes out as it went in

  // The images see a bare wall: the direct pose knows nothing of x and y.
  apso::Matrix6 feature = apso::Matrix6::Identity() * 1e4;  // 1 cm, 0.6 degrees
  apso::Matrix6 direct = apso::Matrix6::Identity() * 1e8;
  direct(0, 0) = direct(1, 1) = direct(5, 5) = 0;
  const Eigen::Matrix4d best = apso::blend(T_feature, T_direct, 0.5, feature, direct);
  std::printf("half way %.3f %.3f, by information %.3f %.3f\n", half(0, 3), half(2, 3), best(0, 3), best(2, 3));
  // [/blend]
  const bool right = half(0, 3) > 0.049 && half(0, 3) < 0.051 && best(0, 3) > 0.099 && best(2, 3) < 0.001;
  return right ? 0 : 1;
}
