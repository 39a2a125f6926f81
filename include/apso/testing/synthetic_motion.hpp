/// \file
/// The camera of the synthetic room, on the kinds of path of the TUM freiburg3 and 360 recordings: functions of time, so
/// frames can be rendered in any order.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/se3.hpp>
#include <apso/testing/synthetic_texture.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

/// Kind of camera path.
enum class CameraMotion {
  Static,      ///< held still: a few millimetres, a few tenths of a degree
  Xyz,         ///< back and forth along one axis after the other, +-0.35 m, fixed orientation
  Halfsphere,  ///< on a half sphere of 1 m diameter, looking at its centre
  Rpy,         ///< fast rotation about one axis after the other at a fixed position; sees the ceiling
  Turn         ///< round and round on a circle of 0.8 m diameter, looking outwards: a turn takes 11 s
};

/// The path of a hand-held camera, a smooth function of time.
class CameraPath {
 public:
  CameraPath(CameraMotion motion, std::uint64_t seed) : motion_(motion) {
    Random rng(seed ^ 0x43616D65ULL);
    for (Tremor& t : tremor_) {
      for (std::size_t k = 0; k < 3; ++k) {
        t.frequency[k] = rng.uniform(0.25, 0.6) * std::pow(2.2, static_cast<double>(k));
        t.phase[k] = rng.uniform(0, 2 * kPi);
      }
    }
    first_axis_ = rng.below(3);
    direction_ = rng.uniform() < 0.5 ? -1.0 : 1.0;
    phase_ = rng.uniform(0, 2 * kPi);
  }

  /// Pose of the camera at time t [s]; camera: x right, y down, z forward.
  [[nodiscard]] Pose operator()(double t) const {
    Eigen::Vector3d p(0.003 * tremor(0, t), 0.003 * tremor(1, t), 0.003 * tremor(2, t));
    Eigen::Vector3d roll_pitch_yaw(tremor(3, t), tremor(4, t), tremor(5, t));
    roll_pitch_yaw *= 0.25 * kDegree;
    Eigen::Matrix3d looks = Eigen::Matrix3d::Identity();
    switch (motion_) {
      case CameraMotion::Static:
        break;
      case CameraMotion::Xyz: {
        const double period = 5.6;
        const Swing s = swing(t, period);
        const double amplitude = s.axis == 1 ? 0.28 : 0.35;
        p[s.axis] += amplitude * direction_ * s.value;
        p += Eigen::Vector3d(0.03 * tremor(6, t), 0.02 * tremor(7, t), 0.03 * tremor(8, t));
        roll_pitch_yaw *= 4;
        break;
      }
      case CameraMotion::Halfsphere: {
        const double azimuth = 0.85 * std::sin(2 * kPi * t / 7.5 + phase_);
        const double elevation = 0.3 + 0.42 * std::sin(2 * kPi * t / 11.0 + 1.7 * phase_);
        const double radius = 0.5;
        const Eigen::Vector3d centre(0, 0.12, 0.35);
        const Eigen::Vector3d back(-std::sin(azimuth) * std::cos(elevation), -std::sin(elevation),
                                   -std::cos(azimuth) * std::cos(elevation));
        p += centre + radius * back;
        // looks at the centre; of the slope down only a part, as one who wants to see the room
        looks = rotation(azimuth, -0.55 * elevation, 0);
        roll_pitch_yaw *= 4;
        break;
      }
      case CameraMotion::Rpy: {
        const Swing s = swing(t, 3.4);
        const double degree = kDegree;
        if (s.axis == 0) roll_pitch_yaw[0] += 38 * degree * direction_ * s.value;
        if (s.axis == 1) roll_pitch_yaw[1] += degree * (27 * s.value + 8 * s.bump);
        if (s.axis == 2) roll_pitch_yaw[2] += 28 * degree * direction_ * s.value;
        p += Eigen::Vector3d(0.025 * tremor(6, t), 0.02 * tremor(7, t), 0.025 * tremor(8, t));
        break;
      }
      case CameraMotion::Turn: {
        const double azimuth = direction_ * 2 * kPi * t / 11.0;
        looks = rotation(azimuth, 0, 0);
        p += Eigen::Vector3d(0.4 * std::sin(azimuth), 0.02 * tremor(7, t), 0.4 * (std::cos(azimuth) - 1));
        roll_pitch_yaw *= 4;
        break;
      }
    }
    Pose T_world_camera = identity_pose();
    T_world_camera.linear() = looks * rotation(roll_pitch_yaw[2], roll_pitch_yaw[1], roll_pitch_yaw[0]);
    T_world_camera.translation() = p;
    return T_world_camera;
  }

 private:
  struct Tremor {
    std::array<double, 3> frequency{};
    std::array<double, 3> phase{};
  };
  /// One period of a back-and-forth motion that starts and ends at rest, and its axis.
  struct Swing {
    int axis;
    double value;  ///< in [-1, 1]
    double bump;   ///< in [0, 1]
  };
  [[nodiscard]] Swing swing(double t, double period) const {
    const double turn = std::floor(t / period);
    const double s = t / period - turn;
    const double x = 2 * s - 1;
    const double x4 = x * x * x * x;
    const double at_rest = 1 - x4 * x4;
    const int axis = (((static_cast<int>(turn) + first_axis_) % 3) + 3) % 3;
    return {axis, std::sin(2 * kPi * s) * at_rest, 0.5 * (1 - std::cos(2 * kPi * s))};
  }
  /// Sum of three sines, amplitude about 1.
  [[nodiscard]] double tremor(std::size_t i, double t) const {
    const Tremor& m = tremor_[i];
    double v = 0;
    double a = 0.7;
    for (std::size_t k = 0; k < 3; ++k, a *= 0.45) v += a * std::sin(2 * kPi * m.frequency[k] * t + m.phase[k]);
    return v;
  }
  /// Yaw to the right, then pitch up, then roll clockwise [rad].
  static Eigen::Matrix3d rotation(double yaw, double pitch, double roll) {
    return (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()) *
            Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()))
        .toRotationMatrix();
  }

  CameraMotion motion_;
  std::array<Tremor, 9> tremor_{};
  int first_axis_ = 0;
  double direction_ = 1;
  double phase_ = 0;
};

}  // namespace testing
APSO_NAMESPACE_END
