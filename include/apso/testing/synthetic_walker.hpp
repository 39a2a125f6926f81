/// \file
/// The people of the synthetic room: functions of time, so frames can be rendered in any order.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/math/constants.hpp>
#include <apso/testing/synthetic_scene.hpp>
#include <apso/testing/synthetic_texture.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

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
  static constexpr double kRising = 0.8;  ///< from the seat to the first step [s]

  /// \param number 0, 1, ...: which person; each has a separate lane
  /// \param sits   how long the person sits before rising and walking [s]; 0: walks from the start
  Walker(int number, int people, int first_cloth, std::uint64_t seed, double duration, double sits = 0)
      : instance_(number + 1), cloth_(first_cloth + 4 * number), sits_(sits) {
    Random rng(hash64(seed ^ 0x57616C6BULL) + 977U * static_cast<std::uint64_t>(number));
    scale_ = rng.uniform(0.95, 1.06);
    gait_ = rng.uniform(0, 2 * kPi);
    const double lane = people > 1 ? static_cast<double>(number) / (people - 1) : 0.4;
    const double near = 1.3 + 0.6 * lane;
    double side = number % 2 == 0 ? -1.0 : 1.0;
    double time = -rng.uniform(0.5, 4.0);
    if (sits > 0) time = sits + kRising;
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
    Eigen::Vector2d from{0, 0}, to{0, 0};  ///< x and z in the world [m]
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
    // 1: seated, the thighs level, 0.42 m lower
    const double seated = sits_ > 0 ? 1 - smooth((t - sits_) / kRising) : 0.0;
    if (seated > 0) heading += seated * (kPi - heading);              // toward the camera
    const double sway = 0.006 * std::sin(2 * kPi * 0.4 * t + gait_);  // nobody stands quite still

    const Eigen::Matrix3d facing = Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitY()).toRotationMatrix();
    const double k = scale_;
    const double bob = 0.018 * stride * std::cos(2 * phase) + 0.42 * seated;
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
      const Eigen::Vector3d knee = hang(world(0.095 * side, -0.92 + bob, 0), 0.42 * sw + 1.5 * seated, 0.4, 0.082, 0.09, 1);
      const Eigen::Vector3d ankle = hang(knee, 0.42 * sw - bend, 0.4, 0.058, 0.062, 1);
      const Eigen::Vector3d elbow = hang(world(0.225 * side, -1.4 + bob, 0.01), -0.4 * sw, 0.27, 0.055, 0.058, 0);
      const Eigen::Vector3d wrist = hang(elbow, -0.4 * sw + 0.3 + 0.15 * stride, 0.22, 0.043, 0.043, 0);
      hang(wrist, -0.4 * sw + 0.4, 0.1, 0.03, 0.042, 3);           // hand
      hang(ankle, 0.42 * sw - bend + 1.45, 0.14, 0.042, 0.04, 1);  // shoe
    }
  }

  int instance_;
  int cloth_;
  double sits_ = 0;  // [s]
  double scale_ = 1;
  double gait_ = 0;
  std::vector<Leg> legs_;
};

}  // namespace testing
APSO_NAMESPACE_END
