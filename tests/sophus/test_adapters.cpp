#include <cmath>

#include <doctest/doctest.h>

#include <apso/sophus/adapters.hpp>
#include <apso/testing/conformance.hpp>

using namespace apso;

static_assert(is_pose_v<Sophus::SE3d> && is_pose_v<Sophus::SE3f> && is_pose_v<Sophus::SE3<double, Eigen::DontAlign>>);

TEST_CASE("poses of Sophus conform") {
  CHECK(testing::check_pose_type<Sophus::SE3d>([](const Sophus::SE3d& T, const Eigen::Vector3d& x) -> Eigen::Vector3d {
          return T * x;
        }).text() == "");
  CHECK(testing::check_pose_type<Sophus::SE3f>([](const Sophus::SE3f& T, const Eigen::Vector3d& x) -> Eigen::Vector3d {
          const Eigen::Vector3f y = T * Eigen::Vector3f(x.cast<float>());
          return y.cast<double>();
        }).text() == "");
  CHECK(testing::check_pose_type<Sophus::SE3<double, Eigen::DontAlign>>().text() == "");
}

TEST_CASE("a rotation that drifted by roundings is taken in, not refused") {
  Pose T = Pose::Identity();
  const Pose step = se3_exp((Twist() << 0.01, 0, 0, 0.003, -0.002, 0.001).finished());
  for (int i = 0; i < 100000; ++i) T = T * step;
  const Pose back = to_pose(from_pose<Sophus::SE3d>(T));
  CHECK((back.linear() * back.linear().transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-14);
  CHECK((back.translation() - T.translation()).norm() == 0);
}
