/// \file
/// Synthetic RGB-D recordings of a furnished room in which people walk, with exact poses and exact masks of what
/// moves: ground truth for tests, benchmarks and first steps without a download.
///
/// \code
/// const apso::testing::SyntheticSequence sequence("walking_xyz", {});
/// apso::testing::SyntheticFrame frame;
/// for (int i = 0; i < sequence.size(); ++i) {
///   sequence.render(i, frame);
///   use(frame.intensity, frame.depth, frame.T_world_camera);
/// }
/// \endcode
///
/// A name combines the people (walking: `people` of them, rising: the same, who sit for two seconds first, static: none) and the
/// camera motion (xyz, halfsphere, rpy, static), like the recordings freiburg3_walking_* of the TUM RGB-D benchmark (Sturm et al.,
/// IROS 2012).
/// stress_*: the path of static_xyz with intervals in which features fail, labelled by `SyntheticFrame::stress`
/// (synthetic_stress.hpp lists the causes; stress_all has all of them in turn, one round takes 540 frames).
/// World: x right, y down, z into the room [m]. A frame depends only on the name, the options and its number.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/se3.hpp>
#include <apso/options.hpp>
#include <apso/testing/synthetic_disparity.hpp>
#include <apso/testing/synthetic_motion.hpp>
#include <apso/testing/synthetic_render.hpp>
#include <apso/testing/synthetic_scene.hpp>
#include <apso/testing/synthetic_sensor.hpp>
#include <apso/testing/synthetic_stress.hpp>
#include <apso/testing/synthetic_walker.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

inline constexpr double kExposureTime = 0.012;  ///< of the synthetic camera [s]
inline constexpr double kSittingTime = 2.0;     ///< of the people of rising_* before they rise and walk [s]
inline constexpr double kImageNoise = 2.0;      ///< of the synthetic camera: standard deviation [grey values of 255]

/// Noise of the depth.
enum class DepthSensor {
  StructuredLight,  ///< sense_depth(): the noise that direct alignment expects
  Disparity,        ///< sense_disparity(): another one
};
constexpr std::array<const char*, 2> enum_names(DepthSensor) { return {"structured_light", "disparity"}; }

/// Settings of a synthetic recording.
struct SyntheticOptions {
  int frames = 300;   ///< length, at 30 Hz
  int width = 640;    ///< pixels; the camera of freiburg3 is scaled to this size
  int height = 480;   ///< pixels
  int people = 2;     ///< walking people; only recordings named walking_* and rising_* have them
  unsigned seed = 1;  ///< room, people, path and noise all depend on it
  bool noise = true;  ///< noise of colour and depth, holes in the depth; false: exact
  DepthSensor sensor = DepthSensor::StructuredLight;
  bool blur = true;            ///< motion blur
  bool exposure_drift = true;  ///< slow brightness changes of up to about 10 %

  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("frames", s.frames, 1, 1000000);
    v("width", s.width, 32, 4096);
    v("height", s.height, 24, 4096);
    v("people", s.people, 0, 3);
    v("seed", s.seed, 0U, 4294967295U);
    v("noise", s.noise);
    v("sensor", s.sensor);
    v("blur", s.blur);
    v("exposure_drift", s.exposure_drift);
  }
};

/// One frame with ground truth. The pose is that at the middle of the exposure.
struct SyntheticFrame {
  double timestamp = 0;          ///< [s]
  Image<std::uint8_t> rgb;       ///< R, G, B interleaved: 3 * width columns
  Image<float> intensity;        ///< grey value of rgb, in [0,1]
  Image<float> depth;            ///< [m], 0 = invalid
  Image<std::uint8_t> instance;  ///< 0: static, k: person k
  Pose T_world_camera = identity_pose();
  Stress stress = Stress::None;  ///< known difficulty

  /// Views of intensity and depth; valid during the lifetime of this frame.
  [[nodiscard]] RgbdFrame rgbd() const { return {timestamp, intensity.view(), depth.view()}; }
};

/// Share of the pixels that belong to people, in [0,1].
[[nodiscard]] inline double dynamic_share(const SyntheticFrame& frame) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < frame.instance.size(); ++i) count += frame.instance.data()[i] != 0 ? 1 : 0;
  return frame.instance.empty() ? 0.0 : static_cast<double>(count) / static_cast<double>(frame.instance.size());
}

/// The true dynamic probability: 1 on people, 0 elsewhere.
inline void true_dynamic_probability(const SyntheticFrame& frame, Image<float>& probability) {
  probability.resize(frame.instance.width(), frame.instance.height());
  for (std::size_t i = 0; i < frame.instance.size(); ++i) {
    probability.data()[i] = frame.instance.data()[i] != 0 ? 1.0F : 0.0F;
  }
}

/// The camera of the freiburg3 recordings, scaled to another image size.
[[nodiscard]] inline Pinhole freiburg3_camera(int width = 640, int height = 480) {
  const double sx = width / 640.0;
  const double sy = height / 480.0;
  return {535.4 * sx, 539.2 * sy, (320.1 + 0.5) * sx - 0.5, (247.6 + 0.5) * sy - 0.5, width, height};
}

/// A recording whose frames are rendered on demand.
class SyntheticSequence {
 public:
  /// \param name one of names(); anything else throws contract_error that lists them
  explicit SyntheticSequence(const std::string& name, const SyntheticOptions& options = {})
      : options_(checked(name, options)),
        camera_(freiburg3_camera(options.width, options.height)),
        people_(starts(name, "walking_") || starts(name, "rising_") ? options.people : 0),
        path_(motion_of(name), options.seed),
        stress_(starts(name, "stress_") ? StressPlan(name.substr(7), options.seed) : StressPlan()),
        scene_(make_room(options.seed, stress_.active() ? StressPlan::kBlockers : people_)) {
    if (stress_.active()) {
      for (int i = 0; i < StressPlan::kBlockers; ++i) blockers_.emplace_back(i, scene_.first_cloth);
    }
    for (int i = 0; i < people_; ++i) {
      walkers_.emplace_back(i, people_, scene_.first_cloth, options.seed, options.frames / kRate,
                            starts(name, "rising_") ? kSittingTime : 0.0);
    }
    Random rng(options.seed ^ 0x4578706FULL);
    exposure_phase_ = rng.uniform(0, 2 * kPi);
  }

  /// All names that the constructor accepts.
  [[nodiscard]] static std::vector<std::string> names() {
    return {"walking_xyz",    "walking_halfsphere", "walking_rpy",  "walking_static",    "rising_xyz",   "rising_halfsphere",
            "rising_rpy",     "rising_static",      "static_xyz",   "static_halfsphere", "static_rpy",   "static_static",
            "stress_ceiling", "stress_roll",        "stress_crowd", "stress_dark",       "stress_flash", "stress_dropout",
            "stress_all",     "walking_360",        "static_360"};
  }

  [[nodiscard]] int size() const { return options_.frames; }
  [[nodiscard]] const Pinhole& camera() const { return camera_; }
  [[nodiscard]] const SyntheticOptions& options() const { return options_; }
  /// Number of people in the recording: 0 except in walking_* and rising_*.
  [[nodiscard]] int people() const { return people_; }
  /// Time of frame i [s].
  [[nodiscard]] double timestamp(int i) const { return i / kRate; }
  /// True pose of frame i, without rendering it.
  [[nodiscard]] Pose T_world_camera(int i) const { return pose_at(timestamp(i)); }
  /// Known difficulty of frame i.
  [[nodiscard]] Stress stress(int i) const { return stress_.label(timestamp(i), velocity_at(timestamp(i)).tail<3>().norm()); }

  /// Renders frame i, 0 <= i < size(). The images of `out` are reused.
  void render(int i, SyntheticFrame& out) const {
    expects(i >= 0 && i < options_.frames, "SyntheticSequence::render: frame number out of range");
    const double t = timestamp(i);
    out.timestamp = t;
    out.T_world_camera = pose_at(t);
    out.stress = stress(i);

    std::vector<Limb> limbs;
    std::array<Limb, Walker::kLimbs> body;
    for (const Walker& w : walkers_) {
      w.limbs(t, body);
      limbs.insert(limbs.end(), body.begin(), body.end());
    }
    for (std::size_t b = 0; b < blockers_.size(); ++b) {
      if (!add_blocker(b, t, limbs)) break;
    }
    const Renderer renderer(scene_, camera_, out.T_world_camera, limbs);
    Canvas3d drawn;
    renderer.draw(drawn);

    const std::size_t faces = scene_.faces.size();
    out.instance.resize(camera_.width, camera_.height);
    for (std::size_t k = 0; k < out.instance.size(); ++k) {
      const std::uint16_t id = drawn.surface.data()[k];
      out.instance.data()[k] = id < faces ? std::uint8_t{0} : static_cast<std::uint8_t>(limbs[id - faces].instance);
    }

    const Twist velocity = velocity_at(t);
    ImageMotion motion;
    motion.angular = velocity.tail<3>().cast<float>();
    motion.linear.push_back(velocity.head<3>().cast<float>());
    for (const Limb& limb : limbs) {
      const Eigen::Vector3d relative = velocity.head<3>() - out.T_world_camera.linear().transpose() * limb.velocity;
      motion.linear.push_back(relative.cast<float>());
    }
    double gain = 1;
    if (options_.exposure_drift) {
      gain += 0.07 * std::sin(2 * kPi * t / 8.7 + exposure_phase_) + 0.03 * std::sin(2 * kPi * t / 3.1 + 2 * exposure_phase_);
    }
    if (stress_.active()) gain *= stress_.light(t);
    const std::uint64_t seed = hash64(options_.seed + 0x5EED00000000ULL * static_cast<std::uint64_t>(i + 1));
    const double shutter = stress_.exposure(t, options_.blur ? kExposureTime : 0.0);
    expose(drawn, faces, camera_, motion, shutter, gain, options_.noise ? kImageNoise : 0.0, seed, normal_, out.rgb, out.intensity,
           stress_.active() ? 64 : 12);
    if (options_.noise && options_.sensor == DepthSensor::Disparity) {
      sense_disparity(drawn, camera_, seed, normal_, out.depth);
    } else if (options_.noise) {
      sense_depth(drawn, renderer, camera_, seed, normal_, out.depth);
    } else {
      out.depth.resize(camera_.width, camera_.height);
      for (std::size_t k = 0; k < out.depth.size(); ++k) {
        const float iz = drawn.inverse_depth.data()[k];
        out.depth.data()[k] = iz > 0 ? 1 / iz : 0.0F;
      }
    }
    if (stress_.depth_fails(t)) out.depth.assign(camera_.width, camera_.height, 0.0F);
  }

 private:
  [[nodiscard]] Pose pose_at(double t) const {
    Pose T = path_(t);
    if (stress_.active()) T.linear() = T.linear() * stress_.turn(t);
    return T;
  }
  /// Velocity of the camera in its own frame, by central differences.
  [[nodiscard]] Twist velocity_at(double t) const {
    const double h = 1e-3;
    return se3_log(inverse(pose_at(t - h)) * pose_at(t + h)) / (2 * h);
  }
  /// Places a person half a metre in front of the camera, slightly to the left or right; false outside of a
  /// Crowd interval.
  bool add_blocker(std::size_t number, double t, std::vector<Limb>& limbs) const {
    const StressPlan::Moment m = stress_.at(t);
    if (m.cause != Stress::Crowd) return false;
    const auto place = [&](double when) -> Eigen::Vector2d {
      const double start = StressPlan::kFirst + m.number * StressPlan::kEvery;
      const Eigen::Vector3d camera = path_(start + 1.0).translation();
      const double side = number == 0 ? -1.0 : 1.0;
      const double close = StressPlan::arrival(when - start);
      const double drift = 0.08 * std::sin(1.9 * when + 2.0 * static_cast<double>(number));  // nobody stands still
      return {camera.x() + side * (0.29 + 1.3 * (1 - close)) + drift, camera.z() + 0.68 + 0.04 * side};
    };
    const double h = 1e-3;
    Walker person = blockers_[number];
    std::array<Limb, Walker::kLimbs> body;
    std::array<Limb, Walker::kLimbs> later;
    person.place(place(t + h));
    person.limbs(t + h, later);
    person.place(place(t));
    person.limbs(t, body);
    for (std::size_t i = 0; i < body.size(); ++i) body[i].velocity = (later[i].centre - body[i].centre) / h;
    limbs.insert(limbs.end(), body.begin(), body.end());
    return true;
  }

  static constexpr double kRate = 30;  // frames per second

  static const SyntheticOptions& checked(const std::string& name, const SyntheticOptions& options) {
    std::string known;
    bool found = false;
    for (const std::string& n : names()) {
      known += (known.empty() ? "" : ", ") + n;
      found = found || n == name;
    }
    if (!found) contract_violation("unknown synthetic sequence '" + name + "', known are: " + known);
    validate(options, "synthetic");
    return options;
  }
  static bool starts(const std::string& name, const char* with) { return name.rfind(with, 0) == 0; }
  static CameraMotion motion_of(const std::string& name) {
    const std::string kind = name.substr(name.find('_') + 1);
    if (kind == "xyz" || starts(name, "stress_")) return CameraMotion::Xyz;
    if (kind == "halfsphere") return CameraMotion::Halfsphere;
    if (kind == "rpy") return CameraMotion::Rpy;
    if (kind == "360") return CameraMotion::Turn;
    return CameraMotion::Static;
  }

  SyntheticOptions options_;
  Pinhole camera_;
  int people_;
  CameraPath path_;
  StressPlan stress_;
  Scene scene_;
  std::vector<Walker> walkers_;
  std::vector<Walker> blockers_;
  NormalTable normal_;
  double exposure_phase_ = 0;
};

}  // namespace testing
APSO_NAMESPACE_END
