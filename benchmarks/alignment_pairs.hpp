// Pairs of RGB-D frames with known motion, for scoring alignments: 25 views of the synthetic room x 8 motions. All of
// a pair depends on its seed alone, so every method sees the very same images.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <apso/math/se3.hpp>
#include <apso/testing/synthetic.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>
#include <apso/version.hpp>

namespace pairs {

using apso::Pose;

using apso::kDegree;
/// The eight motions: translation [m]; each metre comes with 50 degrees (10 cm with 5).
inline constexpr std::array<double, 8> kSteps{0.01, 0.02, 0.04, 0.06, 0.08, 0.10, 0.15, 0.20};

struct Image8 {
  apso::Image<std::uint8_t> grey;
  apso::Image<float> intensity;    ///< grey / 255
  apso::Image<float> depth;        ///< [m], rounded to 1/5000 m as in the files of the TUM benchmark
  apso::Image<float> probability;  ///< 1 on what moves
};

/// Half of what moves is not marked, and as much beside it is marked in error: of each run of marked pixels in a row the left
/// half is dropped, and as many pixels to the right of it are added.
inline void spoil_mask(apso::Image<float>& probability) {
  for (int y = 0; y < probability.height(); ++y) {
    float* row = probability.row(y);
    const int w = probability.width();
    for (int begin = 0; begin < w;) {
      if (!(row[begin] > 0)) {
        ++begin;
        continue;
      }
      int end = begin;
      while (end < w && row[end] > 0) ++end;
      const int half = (end - begin) / 2;
      std::fill(row + begin, row + begin + half, 0.0F);
      int free_until = end;
      while (free_until < std::min(w, end + half) && !(row[free_until] > 0)) ++free_until;
      std::fill(row + end, row + free_until, 1.0F);
      begin = free_until;
    }
  }
}

/// Takes the depth of what is marked away: a mask for methods that know of none.
inline void cut_out(const apso::Image<float>& probability, apso::Image<float>& depth) {
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (probability.data()[i] > 0) depth.data()[i] = 0.0F;
  }
}

struct Pair {
  Image8 reference, current;
  Pose T_current_reference = Pose::Identity();
  double moving_share = 0;  ///< of the pixels of both frames, on average, [0,1]
  double step = 0;          ///< translation [m]
};

struct Conditions {
  bool noise = true;        ///< of image and depth, holes, gain
  double moving_share = 0;  ///< two bodies that cover about this share of both images and move 5 cm each
  double gain = 0.02;       ///< largest change of brightness between the two images
  double image_noise = 3;   ///< [grey values of 255]
  apso::testing::DepthSensor sensor = apso::testing::DepthSensor::StructuredLight;
};

/// The seed of the pairs that are reported: another one with each version of apso, so that nothing can be fitted to it for long.
inline constexpr std::uint64_t kReleaseSeed = 1000003ULL * APSO_VERSION_MAJOR + 1009ULL * APSO_VERSION_MINOR + APSO_VERSION_PATCH + 40000;

/// Of length 1, all directions alike.
inline Eigen::Vector3d random_direction(apso::testing::Random& rng) {
  for (;;) {
    const Eigen::Vector3d d(rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1));
    if (d.norm() > 0.1 && d.norm() < 1) return d.normalized();
  }
}

/// Views of one room, and the bodies in it.
class PairMaker {
 public:
  /// \param seed of the first view; view i uses seed + i
  explicit PairMaker(std::uint64_t seed, int width = 640) : seed_(seed), camera_(apso::testing::freiburg3_camera(width, width * 3 / 4)) {}

  [[nodiscard]] const apso::Pinhole& camera() const { return camera_; }

  /// \param view number of the view; another room, place and direction each
  /// \param step translation [m]; 0 = the camera rests and only the noise differs
  [[nodiscard]] Pair make(int view, double step, const Conditions& c) const {
    using namespace apso::testing;
    const std::uint64_t seed = hash64(seed_ * 1000003U + static_cast<std::uint64_t>(view));
    Random rng(seed);
    const Scene scene = make_room(seed, 2);
    Pose T_world_reference = Pose::Identity();
    T_world_reference.translation() = Eigen::Vector3d(rng.uniform(-.8, .8), rng.uniform(-.4, .2), rng.uniform(-.6, .4));
    T_world_reference.linear() = apso::so3_exp({0, rng.uniform(-40, 40) * kDegree, 0}).toRotationMatrix() *
                                 apso::so3_exp({rng.uniform(-15, 10) * kDegree, 0, 0}).toRotationMatrix() *
                                 apso::so3_exp({0, 0, rng.uniform(-8, 8) * kDegree}).toRotationMatrix();
    Random motion(hash64(seed ^ static_cast<std::uint64_t>(1e6 * step)));
    apso::Twist xi;
    xi << step * random_direction(motion), step * 50 * kDegree * random_direction(motion);
    const Pose T_current_world = apso::se3_exp(xi) * apso::inverse(T_world_reference);
    Pair pair;
    pair.step = step;
    pair.T_current_reference = T_current_world * T_world_reference;
    const std::vector<Limb> before = bodies(scene, T_world_reference, apso::inverse(T_current_world), c.moving_share, rng);
    std::vector<Limb> after = before;
    const std::array<Eigen::Vector3d, 2> way{0.05 * flat_direction(motion), 0.05 * flat_direction(motion)};
    for (Limb& l : after) l.centre += way[static_cast<std::size_t>(l.instance - 1)];
    shoot(scene, T_world_reference, before, c, seed + 1, 1.0, pair.reference);
    shoot(scene, apso::inverse(T_current_world), after, c, hash64(seed + 2) + static_cast<std::uint64_t>(1e6 * step),
          1.0 + c.gain * motion.uniform(-1, 1), pair.current);
    double moving = 0;
    for (std::size_t i = 0; i < pair.current.probability.size(); ++i) {
      moving += static_cast<double>(pair.reference.probability.data()[i] + pair.current.probability.data()[i]);
    }
    pair.moving_share = 0.5 * moving / static_cast<double>(pair.current.probability.size());
    return pair;
  }

 private:
  static Eigen::Vector3d flat_direction(apso::testing::Random& rng) {
    const double a = rng.uniform(0, 360 * kDegree);
    return {std::cos(a), 0, std::sin(a)};
  }

  [[nodiscard]] double share(const apso::testing::Scene& scene, const Pose& T, const std::vector<apso::testing::Limb>& l) const {
    const apso::Pinhole small = apso::testing::freiburg3_camera(80, 60);
    apso::testing::Canvas3d drawn;
    apso::testing::Renderer(scene, small, T, l).draw(drawn);
    int n = 0;
    for (std::size_t i = 0; i < drawn.surface.size(); ++i) n += drawn.surface.data()[i] >= scene.faces.size() ? 1 : 0;
    return static_cast<double>(n) / static_cast<double>(drawn.surface.size());
  }

  // Two people in front of where the camera is halfway, as near as the wanted share of both images, on average, asks for.
  [[nodiscard]] std::vector<apso::testing::Limb> bodies(const apso::testing::Scene& scene, const Pose& T_world_reference,
                                                        const Pose& T_world_current, double wanted, apso::testing::Random& rng) const {
    using namespace apso::testing;
    std::vector<Limb> out;
    if (!(wanted > 0)) return out;
    const double side[2] = {rng.uniform(-.5, -.2), rng.uniform(.2, .5)};  // of the half image
    const double further = rng.uniform(1.0, 1.25);
    const std::uint64_t people = rng.next();
    const Pose T_world_camera = T_world_reference * apso::se3_exp(0.5 * apso::se3_log(apso::inverse(T_world_reference) * T_world_current));
    double near = 0.5;
    double far = 4.0;
    for (int it = 0; it < 14; ++it) {
      const double distance = std::sqrt(near * far);
      out.clear();
      for (int k = 0; k < 2; ++k) {
        const Walker walker(k, 2, scene.first_cloth, people, 10);
        std::array<Limb, Walker::kLimbs> body;
        walker.limbs(3.0, body);
        Eigen::Vector3d middle = Eigen::Vector3d::Zero();
        for (const Limb& l : body) middle += l.centre / Walker::kLimbs;
        const double z = distance * (k == 0 ? 1.0 : further);
        Eigen::Vector3d place = T_world_camera * Eigen::Vector3d(side[k] * 0.6 * z, 0, z);
        place.y() = middle.y();  // on the floor
        for (Limb l : body) {
          l.centre += place - middle;
          out.push_back(l);
        }
      }
      const double both = 0.5 * (share(scene, T_world_reference, out) + share(scene, T_world_current, out));
      (both > wanted ? near : far) = distance;
    }
    return out;
  }

  void shoot(const apso::testing::Scene& scene, const Pose& T_world_camera, const std::vector<apso::testing::Limb>& limbs,
             const Conditions& c, std::uint64_t seed, double gain, Image8& out) const {
    using namespace apso::testing;
    const Renderer renderer(scene, camera_, T_world_camera, limbs);
    Canvas3d drawn;
    renderer.draw(drawn);
    ImageMotion still;
    still.linear.assign(limbs.size() + 1, Eigen::Vector3f::Zero());
    apso::Image<std::uint8_t> rgb;
    expose(drawn, scene.faces.size(), camera_, still, 0.0, c.noise ? gain : 1.0, c.noise ? c.image_noise : 0.0, seed, normal_, rgb,
           out.intensity);
    if (c.noise && c.sensor == DepthSensor::Disparity) {
      sense_disparity(drawn, camera_, seed, normal_, out.depth);
    } else if (c.noise) {
      sense_depth(drawn, renderer, camera_, seed, normal_, out.depth);
    } else {
      out.depth.resize(camera_.width, camera_.height);
      for (std::size_t i = 0; i < out.depth.size(); ++i) {
        const float iz = drawn.inverse_depth.data()[i];
        out.depth.data()[i] = iz > 0 ? 1 / iz : 0.0F;
      }
    }
    out.grey.resize(camera_.width, camera_.height);
    out.probability.resize(camera_.width, camera_.height);
    for (std::size_t i = 0; i < out.depth.size(); ++i) {
      out.grey.data()[i] = static_cast<std::uint8_t>(std::lround(255 * std::clamp(out.intensity.data()[i], 0.0F, 1.0F)));
      out.intensity.data()[i] = static_cast<float>(out.grey.data()[i]) / 255.0F;
      out.depth.data()[i] = std::round(out.depth.data()[i] * 5000.0F) / 5000.0F;
      out.probability.data()[i] = drawn.surface.data()[i] >= scene.faces.size() ? 1.0F : 0.0F;
    }
  }

  std::uint64_t seed_;
  apso::Pinhole camera_;
  apso::testing::NormalTable normal_;
};

}  // namespace pairs
