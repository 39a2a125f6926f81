/// \file
/// Intervals of a synthetic recording in which feature tracking is expected to fail: the ground truth for evaluating
/// decisions.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/testing/synthetic_motion.hpp>
#include <apso/testing/synthetic_texture.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

/// Known difficulty of a frame.
enum class Stress {
  None,
  Ceiling,  ///< the camera quickly turns up to a plain ceiling and back
  Roll,     ///< fast rotation, mostly roll, with a long exposure: motion blur of 40 pixels and more
  Crowd,    ///< people stand close to the camera: most of the image moves with them
  Dark,     ///< the light goes out: 5 % of the brightness, the noise stays
  Flash,    ///< overexposed for four frames: only the darkest objects remain visible
  Dropout   ///< no depth
};
constexpr std::array<const char*, 7> enum_names(Stress) { return {"none", "ceiling", "roll", "crowd", "dark", "flash", "dropout"}; }
[[nodiscard]] constexpr const char* to_string(Stress s) { return enum_names(Stress{})[static_cast<std::size_t>(s)]; }

/// When each interval occurs, and how it changes camera, light and sensor. Intervals begin at 1.8 s and every 2.6 s after that;
/// "all" has all causes in turn.
class StressPlan {
 public:
  static constexpr double kFirst = 1.8;   ///< start of the first interval [s]
  static constexpr double kEvery = 2.6;   ///< from start to start [s]
  static constexpr double kLength = 2.0;  ///< of the longest kind of interval [s]
  static constexpr int kBlockers = 2;     ///< people who come close in a Crowd span

  StressPlan() = default;
  /// \param kind name of a cause, or "all"
  StressPlan(const std::string& kind, std::uint64_t seed) : active_(true) {
    all_ = kind == "all";
    for (std::size_t i = 0; i < enum_names(Stress{}).size(); ++i) {
      if (kind == enum_names(Stress{})[i]) cause_ = static_cast<Stress>(i);
    }
    Random rng(seed ^ 0x53747265ULL);
    side_ = rng.uniform() < 0.5 ? -1.0 : 1.0;
    strength_ = rng.uniform(0.9, 1.1);
  }
  [[nodiscard]] bool active() const { return active_; }

  /// One span: its cause, and the time since its start [s].
  struct Moment {
    Stress cause = Stress::None;
    double since = 0;
    int number = -1;
  };
  [[nodiscard]] Moment at(double t) const {
    Moment m;
    if (!active_ || t < kFirst) return m;
    m.number = static_cast<int>((t - kFirst) / kEvery);
    m.since = t - kFirst - m.number * kEvery;
    if (m.since < kLength) m.cause = cause_of(m.number);
    return m;
  }
  [[nodiscard]] Stress cause_of(int span) const {
    if (!active_ || span < 0) return Stress::None;
    return all_ ? static_cast<Stress>(1 + span % 6) : cause_;
  }

  /// Rotation added to the path of the camera.
  [[nodiscard]] Eigen::Matrix3d turn(double t) const {
    const Moment m = at(t);
    double yaw = 0, pitch = 0, roll = 0;
    const double degree = kPi / 180;
    if (m.cause == Stress::Ceiling) {
      pitch = 78 * degree * plateau(m.since, 0, 2.0, 0.6);
    } else if (m.cause == Stress::Roll && m.since < 1.0) {
      const double x = 2 * m.since - 1;
      const double rest = 1 - std::pow(x, 8);
      const double way = side_ * (m.number % 2 == 0 ? 1 : -1) * strength_ * rest * degree;
      roll = 70 * way * std::sin(2 * kPi * m.since);
      yaw = 25 * way * std::sin(3 * kPi * m.since);
    }
    return (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()) *
            Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()))
        .toRotationMatrix();
  }
  /// Factor of the brightness.
  [[nodiscard]] double light(double t) const {
    const Moment m = at(t);
    if (m.cause == Stress::Dark) return 1 - 0.95 * plateau(m.since, 0, 1.2, 0.1);
    if (m.cause == Stress::Flash) return flashing(m.since) ? 12.0 * strength_ : 1.0;
    return 1;
  }
  /// How long the shutter is open [s].
  [[nodiscard]] double exposure(double t, double usual) const {
    const Moment m = at(t);
    return m.cause == Stress::Roll && m.since < 1.0 && usual > 0 ? std::max(usual, 0.028) : usual;
  }
  [[nodiscard]] bool depth_fails(double t) const {
    const Moment m = at(t);
    return m.cause == Stress::Dropout && m.since < 1.0;
  }
  /// How close blocker 0 or 1 has come: 0 out of view, 1 in front of the camera.
  [[nodiscard]] static double arrival(double since) { return plateau(since, 0, 2.0, 0.4); }

  /// What troubles the frame at time t.
  /// \param angular_speed of the camera [rad/s]
  [[nodiscard]] Stress label(double t, double angular_speed) const {
    const Moment m = at(t);
    switch (m.cause) {
      case Stress::Ceiling:
        return plateau(m.since, 0, 2.0, 0.6) * 78 >= 18 ? m.cause : Stress::None;
      case Stress::Roll:
        return m.since < 1.0 && angular_speed >= 60 * kPi / 180 ? m.cause : Stress::None;
      case Stress::Crowd:
        return arrival(m.since) >= 0.97 ? m.cause : Stress::None;
      case Stress::Dark:
        return light(t) <= 0.12 ? m.cause : Stress::None;
      case Stress::Flash:
        return flashing(m.since) ? m.cause : Stress::None;
      case Stress::Dropout:
        return depth_fails(t) ? m.cause : Stress::None;
      case Stress::None:
        break;
    }
    return Stress::None;
  }

 private:
  static double smooth(double s) {
    s = std::min(1.0, std::max(0.0, s));
    return s * s * (3 - 2 * s);
  }
  /// Rises from 0 to 1 from `begin` on, falls to 0 until `end`, within `ramp` each [s].
  static double plateau(double s, double begin, double end, double ramp) { return smooth((s - begin) / ramp) * smooth((end - s) / ramp); }
  /// Three flashes, 0.4 s apart, of 0.14 s each.
  static bool flashing(double since) { return since < 1.0 && std::fmod(since, 0.4) < 0.14; }

  bool active_ = false;
  bool all_ = false;
  Stress cause_ = Stress::None;
  double side_ = 1;
  double strength_ = 1;
};

}  // namespace testing
APSO_NAMESPACE_END
