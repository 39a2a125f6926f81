/// \file
/// What moves in the synthetic room: the camera, on the four kinds of path of the TUM freiburg3 recordings, and
/// walking people. All are functions of time, so frames can be rendered in any order.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/math/constants.hpp>
#include <apso/math/se3.hpp>
#include <apso/testing/synthetic_scene.hpp>
#include <apso/testing/synthetic_texture.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

/// Kind of camera path.
enum class CameraMotion {
  Static,      ///< held still: a few millimetres, a few tenths of a degree
  Xyz,         ///< back and forth along one axis after the other, +-0.35 m, fixed orientation
  Halfsphere,  ///< on a half sphere of 1 m diameter, looking at its centre
  Rpy          ///< fast rotation about one axis after the other at a fixed position; sees the ceiling
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

/// A part of a body: a cylinder with round ends, elliptic across its axis.
struct Limb {
  Eigen::Vector3d centre;                              ///< in the world [m]
  Eigen::Matrix3d axes;                                ///< columns: across, along, and the front
  double across = 0.1;                                 ///< half the width [m]
  double front = 0.1;                                  ///< half the thickness [m]
  double half_length = 0;                              ///< of the cylinder, without the round ends [m]
  double end = 0.1;                                    ///< length of each round end [m]
  int texture = 0;                                     ///< index in Scene::textures
  int instance = 1;                                    ///< 1 .. people
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< of the centre, in the world [m/s]
};

/// A person who walks back and forth in front of the camera and stops now and then.
class Walker {
 public:
  static constexpr int kLimbs = 16;

  /// \param number 0, 1, ...: which person; each has a separate lane
  Walker(int number, int people, int first_cloth, std::uint64_t seed, double duration)
      : instance_(number + 1), cloth_(first_cloth + 4 * number) {
    Random rng(hash64(seed ^ 0x57616C6BULL) + 977U * static_cast<std::uint64_t>(number));
    scale_ = rng.uniform(0.95, 1.06);
    gait_ = rng.uniform(0, 2 * kPi);
    const double lane = people > 1 ? static_cast<double>(number) / (people - 1) : 0.4;
    const double near = 1.3 + 0.6 * lane;
    double side = number % 2 == 0 ? -1.0 : 1.0;
    double time = -rng.uniform(0.5, 4.0);
    Eigen::Vector2d at(side * rng.uniform(0.5, 1.1), near);
    while (time < duration + 2) {
      side = -side;
      const double reach = rng.uniform(0.15, 0.75);
      const Eigen::Vector2d to(side * reach, near + rng.uniform(-0.05, 0.25));
      const double speed = rng.uniform(0.55, 1.0);
      const bool stops = rng.uniform() < 0.6;
      Leg leg;
      leg.from = at;
      leg.to = to;
      leg.start = time;
      leg.walk = 1.3 * (to - at).norm() / speed;  // the smooth start and end take their time
      leg.pause = stops ? rng.uniform(1.0, 2.0) : 0.45;
      leg.heading = std::atan2(to.x() - at.x(), to.y() - at.y());
      leg.distance = legs_.empty() ? 0.0 : legs_.back().distance + (legs_.back().to - legs_.back().from).norm();
      time += leg.walk + leg.pause;
      at = to;
      legs_.push_back(leg);
    }
  }

  /// A person placed by `place` instead, facing the camera.
  Walker(int number, int first_cloth) : instance_(number + 1), cloth_(first_cloth + 4 * number) {
    Leg leg;
    leg.heading = kPi;
    legs_.push_back(leg);
  }
  /// Moves a person of the second kind to (x, z) in the world [m].
  void place(const Eigen::Vector2d& at) { legs_[0].from = legs_[0].to = at; }

  /// The body at time t [s].
  void limbs(double t, std::array<Limb, kLimbs>& out) const {
    body(t, out);
    const double h = 1e-3;
    std::array<Limb, kLimbs> later;
    body(t + h, later);
    for (std::size_t i = 0; i < out.size(); ++i) out[i].velocity = (later[i].centre - out[i].centre) / h;
  }

 private:
  struct Leg {
    Eigen::Vector2d from, to;  ///< x and z in the world [m]
    double start = 0, walk = 1, pause = 1;
    double heading = 0;   ///< angle about the world's y, 0 = +z [rad]
    double distance = 0;  ///< walked before [m]
  };

  static double smooth(double s) {
    s = std::min(1.0, std::max(0.0, s));
    return s * s * s * (s * (6 * s - 15) + 10);
  }

  void body(double t, std::array<Limb, kLimbs>& out) const {
    std::size_t i = 0;
    while (i + 1 < legs_.size() && legs_[i + 1].start <= t) ++i;
    const Leg& leg = legs_[i];
    const double s = std::min(1.0, std::max(0.0, (t - leg.start) / leg.walk));
    const double done = smooth(s);
    const Eigen::Vector2d at = leg.from + done * (leg.to - leg.from);
    const double length = (leg.to - leg.from).norm();
    const double speed = 30 * s * s * (1 - s) * (1 - s) * length / leg.walk;
    const double phase = gait_ + 2 * kPi * (leg.distance + done * length) / (1.25 * scale_);
    const double stride = std::min(1.0, speed / 0.7);
    // turns to the next way in the last half second before it starts, by the shorter side
    double heading = leg.heading;
    if (i + 1 < legs_.size()) {
      double turn = legs_[i + 1].heading - leg.heading;
      turn -= 2 * kPi * std::floor((turn + kPi) / (2 * kPi));
      heading += turn * smooth((t - (legs_[i + 1].start - 0.5)) / 0.6);
    }
    if (i > 0) {  // the end of the turn lies in this leg
      double turn = leg.heading - legs_[i - 1].heading;
      turn -= 2 * kPi * std::floor((turn + kPi) / (2 * kPi));
      heading += turn * (smooth((t - (leg.start - 0.5)) / 0.6) - 1);
    }
    // who stops for longer turns to the camera meanwhile
    if (i + 1 < legs_.size() && leg.pause >= 1) {
      const double stop = leg.start + leg.walk;
      const double toward = smooth((t - stop + 0.2) / 0.5) * (1 - smooth((t - (stop + leg.pause - 0.5)) / 0.5));
      double turn = kPi - leg.heading;
      turn -= 2 * kPi * std::floor((turn + kPi) / (2 * kPi));
      heading += toward * turn;
    }
    const double sway = 0.006 * std::sin(2 * kPi * 0.4 * t + gait_);  // nobody stands quite still

    const Eigen::Matrix3d facing = Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitY()).toRotationMatrix();
    const double k = scale_;
    const double bob = 0.018 * stride * std::cos(2 * phase);
    const Eigen::Vector3d ground(at.x() + sway, static_cast<double>(kFloor), at.y());
    const auto world = [&](double x, double y, double z) -> Eigen::Vector3d {
      return ground + facing * Eigen::Vector3d(k * x, k * y, k * z);
    };
    std::size_t n = 0;
    // a limb that hangs from `top` turned forward by `angle` about the lateral axis; returns its lower end
    const auto hang = [&](const Eigen::Vector3d& top, double angle, double limb_length, double across, double front,
                          int texture) -> Eigen::Vector3d {
      Limb& l = out[n++];
      l.axes = facing * Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX()).toRotationMatrix();
      l.half_length = 0.5 * k * limb_length;
      l.centre = top + l.half_length * l.axes.col(1);
      l.across = k * across;
      l.front = k * front;
      l.end = 0.5 * (l.across + l.front);
      l.texture = cloth_ + texture;
      l.instance = instance_;
      return top + 2 * l.half_length * l.axes.col(1);
    };
    const double swing = stride * std::sin(phase);
    const double lean = 0.05 * stride;
    hang(world(0, -1.36 + bob, 0.02), lean, 0.34, 0.185, 0.125, 0);  // chest and belly
    hang(world(0, -1.0 + bob, 0), 0, 0.08, 0.165, 0.12, 1);          // hips
    hang(world(0, -1.53 + bob, 0.02), 0, 0.06, 0.055, 0.055, 3);     // neck
    hang(world(0, -1.655 + bob, 0.03), 0, 0.05, 0.078, 0.098, 2);    // head
    for (int side = -1; side <= 1; side += 2) {
      const double sw = side * swing;
      const double bend = 0.08 + 0.55 * stride * (0.5 + 0.5 * std::sin(phase + (side > 0 ? 0.0 : kPi) - 1.6));
      const Eigen::Vector3d knee = hang(world(0.095 * side, -0.92 + bob, 0), 0.42 * sw, 0.4, 0.082, 0.09, 1);
      const Eigen::Vector3d ankle = hang(knee, 0.42 * sw - bend, 0.4, 0.058, 0.062, 1);
      const Eigen::Vector3d elbow = hang(world(0.225 * side, -1.4 + bob, 0.01), -0.4 * sw, 0.27, 0.055, 0.058, 0);
      const Eigen::Vector3d wrist = hang(elbow, -0.4 * sw + 0.3 + 0.15 * stride, 0.22, 0.043, 0.043, 0);
      hang(wrist, -0.4 * sw + 0.4, 0.1, 0.03, 0.042, 3);           // hand
      hang(ankle, 0.42 * sw - bend + 1.45, 0.14, 0.042, 0.04, 1);  // shoe
    }
  }

  int instance_;
  int cloth_;
  double scale_ = 1;
  double gait_ = 0;
  std::vector<Leg> legs_;
};

}  // namespace testing
APSO_NAMESPACE_END
