/// \file
/// Procedural textures of the synthetic room: a portable random generator, a painter and mip-mapped sampling.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN
namespace testing {

/// A bijective hash of 64 bits (the finaliser of SplitMix64).
[[nodiscard]] inline std::uint64_t hash64(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

/// Random numbers that are the same with every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(hash64(seed)) {}
  [[nodiscard]] std::uint64_t next() { return hash64(state_++); }
  /// Uniform in [0,1).
  [[nodiscard]] double uniform() { return static_cast<double>(next() >> 11) * (1.0 / 9007199254740992.0); }
  [[nodiscard]] double uniform(double a, double b) { return a + (b - a) * uniform(); }
  /// Uniform in 0 .. n-1.
  [[nodiscard]] int below(int n) { return static_cast<int>(uniform() * n); }
  [[nodiscard]] int between(int a, int b) { return a + below(b - a + 1); }

 private:
  std::uint64_t state_;
};

/// A colour, 0..255 per channel.
struct Rgb {
  float r = 0, g = 0, b = 0;
  friend Rgb operator*(float s, const Rgb& c) { return {s * c.r, s * c.g, s * c.b}; }
  friend Rgb operator+(const Rgb& a, const Rgb& c) { return {a.r + c.r, a.g + c.g, a.b + c.b}; }
};

/// A colour as saturated as prints and clothes are.
[[nodiscard]] inline Rgb random_colour(Random& rng, double dark = 25, double bright = 235) {
  const auto c = [&] { return static_cast<float>(rng.uniform(dark, bright)); };
  const Rgb full{c(), c(), c()};
  const float grey = 0.299F * full.r + 0.587F * full.g + 0.114F * full.b;
  return 0.55F * full + 0.45F * Rgb{grey, grey, grey};
}

/// What textures are painted on.
class Canvas {
 public:
  Canvas(int width, int height, const Rgb& colour)
      : width_(width), height_(height), pixels_(static_cast<std::size_t>(width * height), colour) {}
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] Rgb& at(int x, int y) { return pixels_[static_cast<std::size_t>(y * width_ + x)]; }
  [[nodiscard]] const Rgb& at(int x, int y) const { return pixels_[static_cast<std::size_t>(y * width_ + x)]; }

  void rectangle(int x0, int y0, int x1, int y1, const Rgb& colour) {
    for (int y = std::max(0, y0); y < std::min(height_, y1); ++y)
      for (int x = std::max(0, x0); x < std::min(width_, x1); ++x) at(x, y) = colour;
  }
  void ellipse(int x0, int y0, int x1, int y1, const Rgb& colour) {
    const float cx = 0.5F * static_cast<float>(x0 + x1 - 1);
    const float cy = 0.5F * static_cast<float>(y0 + y1 - 1);
    const float sx = 2.0F / static_cast<float>(std::max(1, x1 - x0));
    const float sy = 2.0F / static_cast<float>(std::max(1, y1 - y0));
    for (int y = std::max(0, y0); y < std::min(height_, y1); ++y) {
      for (int x = std::max(0, x0); x < std::min(width_, x1); ++x) {
        const float a = (static_cast<float>(x) - cx) * sx;
        const float b = (static_cast<float>(y) - cy) * sy;
        if (a * a + b * b <= 1.0F) at(x, y) = colour;
      }
    }
  }
  /// Adds value noise: random values every `cell` texels, between them interpolated; the same for all channels.
  void noise(int cell, float amplitude, Random& rng) {
    const int nx = width_ / cell;
    const int ny = height_ / cell;
    std::vector<float> lattice(static_cast<std::size_t>(nx * ny));
    for (float& v : lattice) v = amplitude * static_cast<float>(rng.uniform(-1, 1));
    const auto value = [&](int x, int y) { return lattice[static_cast<std::size_t>((y % ny) * nx + x % nx)]; };
    const float step = 1.0F / static_cast<float>(cell);
    for (int y = 0; y < height_; ++y) {
      const float b = static_cast<float>(y % cell) * step;
      for (int x = 0; x < width_; ++x) {
        const float a = static_cast<float>(x % cell) * step;
        const int i = x / cell;
        const int j = y / cell;
        const float v = (1 - b) * ((1 - a) * value(i, j) + a * value(i + 1, j)) + b * ((1 - a) * value(i, j + 1) + a * value(i + 1, j + 1));
        Rgb& p = at(x, y);
        p = p + Rgb{v, v, v};
      }
    }
  }
  /// Lines of signs that look like print; `dot` texels are one dot of a 3x5 sign.
  void print(int x0, int y0, int x1, int y1, int dot, const Rgb& ink, Random& rng) {
    for (int y = y0; y + 5 * dot <= y1; y += 8 * dot) {
      const int end = x1 - rng.below(std::max(1, (x1 - x0) / 3));
      for (int x = x0; x + 3 * dot <= end; x += 4 * dot) {
        const std::uint64_t sign = rng.next();
        if ((sign >> 60) < 3) continue;  // a space
        for (int k = 0; k < 15; ++k) {
          if (((sign >> k) & 1U) == 0) continue;
          const int px = x + (k % 3) * dot;
          const int py = y + (k / 3) * dot;
          rectangle(px, py, px + dot, py + dot, ink);
        }
      }
    }
  }
  /// A poster: frame, ground, shapes of all sizes, some print.
  void poster(int x0, int y0, int x1, int y1, Random& rng) {
    rectangle(x0, y0, x1, y1, random_colour(rng, 15, 90));
    const int frame = 2 + rng.below(3);
    x0 += frame, y0 += frame, x1 -= frame, y1 -= frame;
    rectangle(x0, y0, x1, y1, random_colour(rng, 130, 245));
    const int shapes = 6 + (x1 - x0) * (y1 - y0) / 700;
    for (int i = 0; i < shapes; ++i) {
      const double size = std::pow(rng.uniform(0.06, 0.75), 1.7);
      const int w = std::max(3, static_cast<int>(size * (x1 - x0) * rng.uniform(0.5, 1)));
      const int h = std::max(3, static_cast<int>(size * (y1 - y0) * rng.uniform(0.5, 1)));
      const int x = rng.between(x0, std::max(x0, x1 - w));
      const int y = rng.between(y0, std::max(y0, y1 - h));
      if (rng.uniform() < 0.65) {
        rectangle(x, y, std::min(x1, x + w), std::min(y1, y + h), random_colour(rng));
      } else {
        ellipse(x, y, std::min(x1, x + w), std::min(y1, y + h), random_colour(rng));
      }
    }
    if (rng.uniform() < 0.7) {
      const int top = y0 + (y1 - y0) / 2;
      const int dot = rng.between(1, 3);
      rectangle(x0 + 2, top - 2, x1 - 2, y1 - 2, random_colour(rng, 190, 250));
      print(x0 + 4, top, x1 - 4, y1 - 3, dot, random_colour(rng, 10, 70), rng);
    }
  }

 private:
  int width_;
  int height_;
  std::vector<Rgb> pixels_;
};

/// A colour as four lanes of 16 bits: red, blue, green, none; red in the lowest. One multiplication blends all channels.
using Lanes = std::uint64_t;
inline constexpr Lanes kLaneMask = 0x00FF00FF00FF00FFULL;
/// a + (b - a) f/256 per lane, rounded; f in 0..256.
[[nodiscard]] inline Lanes mix_lanes(Lanes a, Lanes b, unsigned f) {
  return (((a << 8) + (b - a) * f + 0x0080008000800080ULL) >> 8) & kLaneMask;  // borrows between lanes cancel: one multiplication
}

/// log2 of a positive number, off by less than 0.09, continuous and rising.
[[nodiscard]] inline float rough_log2(float x) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &x, sizeof bits);
  return static_cast<float>(bits) * (1.0F / 8388608.0F) - 127.0F;
}

/// An image that repeats in both directions, with box-filtered levels. Sizes are powers of two.
class Texture {
 public:
  explicit Texture(const Canvas& canvas) {
    int w = canvas.width();
    int h = canvas.height();
    expects((w & (w - 1)) == 0 && (h & (h - 1)) == 0 && w >= 16 && h >= 16, "Texture: size must be a power of two");
    Level base{w - 1, h - 1, w, 1.0F, std::vector<Lanes>(static_cast<std::size_t>(w * h))};
    for (int y = 0; y < h; ++y) {
      for (int x = 0; x < w; ++x) {
        const Rgb& c = canvas.at(x, y);
        const auto byte = [](float v) { return static_cast<Lanes>(std::min(255.0F, std::max(0.0F, v)) + 0.5F); };
        base.texels[static_cast<std::size_t>(y * w + x)] = byte(c.r) | (byte(c.b) << 16) | (byte(c.g) << 32);
      }
    }
    levels_.push_back(std::move(base));
    while (w > 8 && h > 8) {
      const Level& from = levels_.back();
      w /= 2;
      h /= 2;
      Level to{w - 1, h - 1, w, from.scale * 0.5F, std::vector<Lanes>(static_cast<std::size_t>(w * h))};
      for (int y = 0; y < h; ++y) {
        for (int x = 0; x < w; ++x) {
          const Lanes* p = from.texels.data() + static_cast<std::ptrdiff_t>(2 * y) * from.width + 2 * x;
          const Lanes sum = p[0] + p[1] + p[from.width] + p[from.width + 1];
          to.texels[static_cast<std::size_t>(y * w + x)] = ((sum + 0x0002000200020002ULL) >> 2) & kLaneMask;
        }
      }
      levels_.push_back(std::move(to));
    }
  }

  /// Colour at (s, t) >= 0 [texels of the finest level], trilinear.
  /// \param lod log2 of the texels that a pixel covers
  [[nodiscard]] Lanes sample(float s, float t, float lod) const {
    const int last = static_cast<int>(levels_.size()) - 1;
    if (!(lod > 0)) return bilinear(levels_.front(), s, t);
    const int level = static_cast<int>(lod);
    if (level >= last) return bilinear(levels_.back(), s, t);
    const auto f = static_cast<unsigned>((lod - static_cast<float>(level)) * 256.0F);
    const auto i = static_cast<std::size_t>(level);
    return mix_lanes(bilinear(levels_[i], s, t), bilinear(levels_[i + 1], s, t), f);
  }

 private:
  struct Level {
    int mask_x;
    int mask_y;
    int width;
    float scale;
    std::vector<Lanes> texels;
  };
  static Lanes bilinear(const Level& l, float s, float t) {
    // centres of texels lie at half numbers; one period is added so that the integer part is a truncation
    const int x = static_cast<int>(s * l.scale * 256.0F) + (l.mask_x + 1) * 256 - 128;
    const int y = static_cast<int>(t * l.scale * 256.0F) + (l.mask_y + 1) * 256 - 128;
    const int x0 = (x >> 8) & l.mask_x;
    const int x1 = (x0 + 1) & l.mask_x;
    const Lanes* r0 = l.texels.data() + static_cast<std::ptrdiff_t>((y >> 8) & l.mask_y) * l.width;
    const Lanes* r1 = l.texels.data() + static_cast<std::ptrdiff_t>(((y >> 8) + 1) & l.mask_y) * l.width;
    const auto fx = static_cast<unsigned>(x & 255);
    const auto fy = static_cast<unsigned>(y & 255);
    return mix_lanes(mix_lanes(r0[x0], r0[x1], fx), mix_lanes(r1[x0], r1[x1], fx), fy);
  }
  std::vector<Level> levels_;
};

}  // namespace testing
APSO_NAMESPACE_END
