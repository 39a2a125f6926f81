/// \file
/// Model of a structured-light RGB-D sensor: motion blur, exposure drift and noise of the colours;
/// noise, quantisation and holes of the depth.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/testing/synthetic_render.hpp>
#include <apso/testing/synthetic_texture.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

/// 4096 values of a normal distribution of variance 1, indexed by 12 random bits.
class NormalTable {
 public:
  NormalTable() {
    Random rng(0x4E6F726DULL);
    double sum = 0;
    double sum2 = 0;
    for (float& v : values_) {
      double s = -6;
      for (int i = 0; i < 12; ++i) s += rng.uniform();
      v = static_cast<float>(s);
      sum += s;
      sum2 += s * s;
    }
    const double n = static_cast<double>(values_.size());
    const auto mean = static_cast<float>(sum / n);
    const auto scale = static_cast<float>(1 / std::sqrt(sum2 / n - (sum / n) * (sum / n)));
    for (float& v : values_) v = (v - mean) * scale;
  }
  [[nodiscard]] float operator()(std::uint64_t bits) const { return values_[bits & 4095U]; }

 private:
  std::array<float, 4096> values_{};
};

/// Relative velocity of camera and surfaces, for the motion blur.
struct ImageMotion {
  Eigen::Vector3f angular = Eigen::Vector3f::Zero();  ///< of the camera, in the camera [rad/s]
  std::vector<Eigen::Vector3f> linear;                ///< camera minus surface, in the camera [m/s]; [0] static, [1 + i] limb i
};

/// Turns the drawn image into recorded colours.
/// \param exposure exposure time [s], 0: no blur
/// \param gain     brightness factor of this frame
/// \param noise    standard deviation [grey values of 255]; 0: none
/// \param max_taps samples along a blurred path: blur of up to twice as many pixels is smooth
inline void expose(const Canvas3d& drawn, std::size_t faces, const Pinhole& camera, const ImageMotion& motion, double exposure, double gain,
                   double noise, std::uint64_t seed, const NormalTable& normal, Image<std::uint8_t>& rgb, Image<float>& intensity,
                   int max_taps = 12) {
  const int width = camera.width;
  const int height = camera.height;
  rgb.resize(3 * width, height);
  intensity.resize(width, height);
  const auto factor = static_cast<float>(gain);
  const auto sigma = static_cast<float>(noise);
  const auto fx = static_cast<float>(camera.fx);
  const auto fy = static_cast<float>(camera.fy);
  const auto open = static_cast<float>(exposure);
  const float last_x = static_cast<float>(width - 1) - 0.01F;  // a bilinear tap there stays inside
  const float last_y = static_cast<float>(height - 1) - 0.01F;
  // nothing moves by more than this many pixels while the shutter is open
  float fastest = 0;
  for (const Eigen::Vector3f& v : motion.linear) fastest = std::max(fastest, v.norm());
  const bool moves = open * fx * (fastest / 0.5F + 2 * motion.angular.norm()) > 0.75F;
  const Eigen::Vector3f& w = motion.angular;
  for (int y = 0; y < height; ++y) {
    const Lanes* colour = drawn.colour.row(y);
    const std::uint16_t* id = drawn.surface.row(y);
    const std::uint16_t* above = drawn.surface.row(std::max(0, y - 1));
    const std::uint16_t* below = drawn.surface.row(std::min(height - 1, y + 1));
    const float* iz = drawn.inverse_depth.row(y);
    std::uint8_t* to = rgb.row(y);
    float* grey = intensity.row(y);
    const float b = (static_cast<float>(y) - static_cast<float>(camera.cy)) / fy;
    for (int x = 0; x < width; ++x) {
      float du = 0;
      float dv = 0;
      if (moves) {
        const float a = (static_cast<float>(x) - static_cast<float>(camera.cx)) / fx;
        const Eigen::Vector3f& v = motion.linear[id[x] < faces ? 0 : id[x] - faces + 1];
        du = open * fx * (iz[x] * (a * v.z() - v.x()) + a * b * w.x() - (1 + a * a) * w.y() + b * w.z());
        dv = open * fy * (iz[x] * (b * v.z() - v.y()) + (1 + b * b) * w.x() - a * b * w.y() - a * w.z());
      }
      const float length = std::max(std::abs(du), std::abs(dv));
      float r;
      float g;
      float bl;
      if (length > 0.75F) {  // mean along the path of the surface during the exposure
        const int taps = std::min(max_taps, 2 + static_cast<int>(0.5F * length));
        Lanes sum = 0;
        const float step = 1.0F / static_cast<float>(taps);
        for (int k = 0; k < taps; ++k) {
          const float s = (static_cast<float>(k) + 0.5F) * step - 0.5F;
          const float px = std::min(last_x, std::max(0.0F, static_cast<float>(x) + s * du));
          const float py = std::min(last_y, std::max(0.0F, static_cast<float>(y) + s * dv));
          const auto x256 = static_cast<unsigned>(px * 256.0F);
          const auto y256 = static_cast<unsigned>(py * 256.0F);
          const Lanes* p = drawn.colour.row(static_cast<int>(y256 >> 8)) + (x256 >> 8);
          const Lanes upper = mix_lanes(p[0], p[1], x256 & 255U);
          const Lanes lower = mix_lanes(p[width], p[width + 1], x256 & 255U);
          sum += mix_lanes(upper, lower, y256 & 255U);
        }
        r = static_cast<float>(sum & 0xFFFFU) * step;
        g = static_cast<float>((sum >> 32) & 0xFFFFU) * step;
        bl = static_cast<float>((sum >> 16) & 0xFFFFU) * step;
      } else {
        const int xl = std::max(0, x - 1);
        const int xr = std::min(width - 1, x + 1);
        Lanes c = colour[x];
        if (id[xl] != id[x] || id[xr] != id[x] || above[x] != id[x] || below[x] != id[x]) {  // smooth outlines
          const Lanes* ca = drawn.colour.row(std::max(0, y - 1));
          const Lanes* cb = drawn.colour.row(std::min(height - 1, y + 1));
          const Lanes sum = 4 * c + 2 * (colour[xl] + colour[xr] + ca[x] + cb[x]) + ca[xl] + ca[xr] + cb[xl] + cb[xr];
          c = (sum >> 4) & kLaneMask;
        }
        r = static_cast<float>(c & 0xFFU);
        g = static_cast<float>((c >> 32) & 0xFFU);
        bl = static_cast<float>((c >> 16) & 0xFFU);
      }
      r *= factor;
      g *= factor;
      bl *= factor;
      if (sigma > 0) {  // most of it common to the channels
        const std::uint64_t bits = hash64(seed + static_cast<std::uint64_t>(y) * 65536U + static_cast<std::uint64_t>(x));
        const float common = sigma * normal(bits);
        r += common + 0.5F * sigma * normal(bits >> 12);
        g += common + 0.5F * sigma * normal(bits >> 24);
        bl += common + 0.5F * sigma * normal(bits >> 36);
      }
      const auto byte = [](float v) { return static_cast<std::uint8_t>(std::min(255.0F, std::max(0.0F, v + 0.5F))); };
      to[3 * x] = byte(r);
      to[3 * x + 1] = byte(g);
      to[3 * x + 2] = byte(bl);
      grey[x] = (0.299F * static_cast<float>(to[3 * x]) + 0.587F * static_cast<float>(to[3 * x + 1]) +
                 0.114F * static_cast<float>(to[3 * x + 2])) *
                (1.0F / 255.0F);
    }
  }
}

/// The depth image of a structured-light sensor.
///
/// The standard deviation is max(1 mm, 1.425e-3 z^2) (Khoshelham & Elberink, Sensors 2012), of which a part comes from
/// the quantisation of the disparity in steps of 1/8 pixel, (z^2 / 43.5 m px) / 8, and a part is common to neighbours.
/// There are holes outside the range 0.4 .. 8 m (increasingly from 6 m on), at grazing angles, and in the shadow of near
/// objects: the projector is 7.5 cm to the side of the camera.
inline void sense_depth(const Canvas3d& drawn, const Renderer& renderer, const Pinhole& camera, std::uint64_t seed,
                        const NormalTable& normal, Image<float>& depth) {
  constexpr float kBaseline = 0.075F;  // [m]
  constexpr float kDisparity = 43.5F;  // focal length of the infrared camera times baseline [px m]
  constexpr float kCell = 4;           // size of the common part of the noise [px]
  const int width = camera.width;
  const int height = camera.height;
  depth.resize(width, height);
  const float shadow_scale = static_cast<float>(camera.fx) * kBaseline;
  const auto cell_noise = [&](int i, int j) {
    const std::uint64_t h = hash64((seed ^ 0xC0117ULL) + static_cast<std::uint64_t>(j) * 65536U + static_cast<std::uint64_t>(i));
    return normal(h);
  };
  const int cells = width / static_cast<int>(kCell) + 2;
  std::vector<float> low(static_cast<std::size_t>(cells));
  for (int y = 0; y < height; ++y) {
    const float fy = static_cast<float>(y) / kCell;
    const int j = static_cast<int>(fy);
    const float by = fy - static_cast<float>(j);
    for (int i = 0; i < cells; ++i) {
      low[static_cast<std::size_t>(i)] = (1 - by) * cell_noise(i, j) + by * cell_noise(i, j + 1);
    }
    const float* iz = drawn.inverse_depth.row(y);
    const std::uint16_t* surface = drawn.surface.row(y);
    float* out = depth.row(y);
    float seen = 1e9F;  // smallest column of the projector that a surface to the right has taken
    for (int x = width - 1; x >= 0; --x) {
      out[x] = 0;
      if (iz[x] <= 0) continue;
      const float column = static_cast<float>(x) - shadow_scale * iz[x];
      const bool shadow = column > seen + 1.5F;
      seen = std::min(seen, column);
      const float z = 1 / iz[x];
      if (shadow || z < 0.4F || z > 8.0F) continue;
      const std::uint64_t bits = hash64((seed ^ 0xDE9714ULL) + static_cast<std::uint64_t>(y) * 65536U + static_cast<std::uint64_t>(x));
      const float chance = static_cast<float>(bits >> 48) * (1.0F / 65536.0F);
      if (z > 6.0F && chance < 0.5F * (z - 6.0F)) continue;
      const float grazing = renderer.incidence(x, y, z, surface[x]);
      if (grazing < 0.05F + 0.15F * chance) continue;
      const float fx = static_cast<float>(x) / kCell;
      const auto i = static_cast<std::size_t>(fx);
      const float bx = fx - static_cast<float>(i);
      const float common = (1 - bx) * low[i] + bx * low[i + 1];
      // variances: common 0.44 on average over the cell, so 0.9 common + 0.8 own make one
      const float unit = 0.9F * common + 0.8F * normal(bits);
      const float total = depth_sigma(z);
      const float step = z * z / (8 * kDisparity);
      const float rest = std::sqrt(std::max(0.2F * total * total, total * total - step * step * (1.0F / 12.0F)));
      const float measured = z + rest * unit;
      if (measured < 0.2F) continue;
      const float disparity = std::floor(kDisparity / measured * 8.0F + 0.5F) * 0.125F;
      out[x] = kDisparity / disparity;
    }
  }
}

}  // namespace testing
APSO_NAMESPACE_END
