/// \file
/// Where the image moves: a probability per pixel, and what can be asked of it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include <apso/config.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/detection.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// Dynamic probability of every pixel. Unknown is not static: ask `known` when the difference matters.
struct DynamicMask {
  Image<float> probability;   ///< [0,1], 1 = dynamic, size of the frame
  Image<std::uint8_t> known;  ///< 1 = there was evidence, 0 = unknown (the probability is then a guess)
};

/// Sets a mask of the given size to "nothing is known".
inline void set_unknown(int width, int height, DynamicMask& out) {
  out.probability.assign(width, height, 0.0F);
  out.known.assign(width, height, 0);
}

/// Dynamic_ratio of the paper as an area: mean probability over the image, unknown pixels with the probability
/// they carry; 0 for an empty mask.
/// \param probability any image of probabilities, [0,1]; NaN counts as 0
[[nodiscard]] inline double dynamic_ratio(const AnyImage& probability) {
  if (probability.empty()) return 0.0;
  std::vector<float> buffer;
  auto read = rows(probability, buffer);
  double sum = 0;
  for (int y = 0; y < probability.height(); ++y) {
    const float* p = read(y);
    float row = 0;
    for (int x = 0; x < probability.width(); ++x) row += p[x] > 0.0F ? std::min(p[x], 1.0F) : 0.0F;
    sum += static_cast<double>(row);
  }
  return clamp01(sum / (static_cast<double>(probability.width()) * probability.height()));
}
[[nodiscard]] inline double dynamic_ratio(const DynamicMask& mask) { return dynamic_ratio(mask.probability); }

/// Share of the pixels that have evidence, [0,1].
[[nodiscard]] inline double known_ratio(const DynamicMask& mask) {
  if (mask.known.empty()) return 0.0;
  std::size_t n = 0;
  for (std::size_t i = 0; i < mask.known.size(); ++i) n += mask.known.data()[i] != 0 ? 1U : 0U;
  return static_cast<double>(n) / static_cast<double>(mask.known.size());
}

/// Largest value within a square of (2 radius + 1)^2 pixels, in place. Separable, and with a cost that hardly
/// depends on the radius (van Herk, Pattern Recognition Letters 1992; Gil & Werman, PAMI 1993).
/// \param radius [px], >= 0
/// \param scratch buffer
template <class T>
void dilate(Image<T>& image, int radius, std::vector<T>& scratch) {
  expects(radius >= 0, "dilate: negative radius");
  const int w = image.width();
  const int h = image.height();
  if (radius == 0 || w == 0 || h == 0) return;
  const int span = 2 * radius + 1;
  // rows: running maxima from the left and from the right of blocks of `span` pixels
  const int padded = (w + 2 * radius + span - 1) / span * span;
  scratch.resize(static_cast<std::size_t>(std::max(3 * padded, w)));
  T* line = scratch.data();
  T* left = line + padded;
  T* right = left + padded;
  for (int y = 0; y < h; ++y) {
    T* p = image.row(y);
    for (int i = 0; i < padded; ++i) line[i] = p[std::clamp(i - radius, 0, w - 1)];
    for (int b = 0; b < padded; b += span) {
      left[b] = line[b];
      for (int i = b + 1; i < b + span; ++i) left[i] = std::max(left[i - 1], line[i]);
      right[b + span - 1] = line[b + span - 1];
      for (int i = b + span - 2; i >= b; --i) right[i] = std::max(right[i + 1], line[i]);
    }
    for (int x = 0; x < w; ++x) p[x] = std::max(right[x], left[x + 2 * radius]);
  }
  // columns: the same on whole rows, which the compiler turns into wide instructions
  const int padded_rows = (h + 2 * radius + span - 1) / span * span;
  const auto W = static_cast<std::size_t>(w);
  scratch.resize(2 * W * static_cast<std::size_t>(padded_rows));
  T* up = scratch.data();
  T* down = up + W * static_cast<std::size_t>(padded_rows);
  const auto source = [&](int i) { return image.row(std::clamp(i - radius, 0, h - 1)); };
  const auto row_of = [&](T* base, int i) { return base + W * static_cast<std::size_t>(i); };
  const auto max_rows = [w](const T* a, const T* b, T* out) {
    for (int x = 0; x < w; ++x) out[x] = std::max(a[x], b[x]);
  };
  for (int b = 0; b < padded_rows; b += span) {
    std::copy_n(source(b), w, row_of(up, b));
    for (int i = b + 1; i < b + span; ++i) max_rows(row_of(up, i - 1), source(i), row_of(up, i));
    std::copy_n(source(b + span - 1), w, row_of(down, b + span - 1));
    for (int i = b + span - 2; i >= b; --i) max_rows(row_of(down, i + 1), source(i), row_of(down, i));
  }
  for (int y = 0; y < h; ++y) max_rows(row_of(down, y), row_of(up, y + 2 * radius), image.row(y));
}

/// How two masks become one.
enum class MaskCombination {
  Union,   ///< 1 - (1-a)(1-b): dynamic when either says so (independent evidence)
  Product  ///< a b: dynamic only when both say so, e.g. "a person" and "it moves"
};

/// Combines `other` into `mask`. Where only one of them knows, that one decides; where neither does, Union takes
/// the larger and Product the smaller guess, and the pixel stays unknown.
inline void combine(const DynamicMask& other, MaskCombination how, DynamicMask& mask) {
  const int w = mask.probability.width();
  const int h = mask.probability.height();
  expects(other.probability.width() == w && other.probability.height() == h, "combine: masks differ in size");
  expects(other.known.size() == other.probability.size() && mask.known.size() == mask.probability.size(),
          "combine: known and probability differ in size");
  for (std::size_t i = 0; i < mask.probability.size(); ++i) {
    float& a = mask.probability.data()[i];
    const float b = other.probability.data()[i];
    std::uint8_t& ka = mask.known.data()[i];
    const bool kb = other.known.data()[i] != 0;
    if (ka != 0 && kb) {
      a = how == MaskCombination::Union ? 1.0F - (1.0F - a) * (1.0F - b) : a * b;
    } else if (kb) {
      a = b;
      ka = 1;
    } else if (ka == 0) {
      a = how == MaskCombination::Union ? std::max(a, b) : std::min(a, b);
    }
  }
}

/// Mask from an image of labels of any type, as networks write them: nonzero (usually 255) = dynamic. Everything is known.
inline void mask_from_labels(const AnyImage& labels, DynamicMask& out) {
  expects(!labels.empty(), "mask_from_labels: empty image");
  out.probability.resize(labels.width(), labels.height());
  out.known.assign(labels.width(), labels.height(), 1);
  for (int y = 0; y < labels.height(); ++y) {
    float* p = out.probability.row(y);
    labels.read_row(y, p, 1.0F);
    for (int x = 0; x < labels.width(); ++x) p[x] = p[x] < 0.0F || p[x] > 0.0F ? 1.0F : 0.0F;  // NaN is no label
  }
}

/// Mask from an image of dynamic probabilities of any type, [0,1]; a pixel that is NaN is unknown.
inline void mask_from_probability(const AnyImage& probability, DynamicMask& out) {
  expects(!probability.empty(), "mask_from_probability: empty image");
  out.probability.resize(probability.width(), probability.height());
  out.known.resize(probability.width(), probability.height());
  for (int y = 0; y < probability.height(); ++y) {
    float* p = out.probability.row(y);
    std::uint8_t* known = out.known.row(y);
    probability.read_row(y, p, 1.0F);
    for (int x = 0; x < probability.width(); ++x) {
      known[x] = p[x] == p[x] ? 1 : 0;
      p[x] = p[x] > 0.0F ? std::min(p[x], 1.0F) : 0.0F;
    }
  }
}

/// Mask from any image: integers are labels (nonzero = dynamic), floating point numbers are probabilities.
template <class ImageT>
void mask_from_image(const ImageT& image, DynamicMask& out) {
  check_image<ImageT>();
  if constexpr (std::is_integral_v<typename image_traits<ImageT>::value_type>) {
    mask_from_labels(image, out);
  } else {
    mask_from_probability(image, out);
  }
}

/// The pixels [x0, x1) x [y0, y1) of an image in which a detection can lie.
struct PixelRange {
  int x0 = 0, x1 = 0, y0 = 0, y1 = 0;
};
/// All of the image for a detection with a mask, else the pixels its box touches.
[[nodiscard]] inline PixelRange pixels_of(const Detection& d, int width, int height) {
  if (!d.mask.empty()) return {0, width, 0, height};
  const auto limit = [](float v, int n) { return static_cast<int>(v == v ? std::clamp(v, 0.0F, static_cast<float>(n)) : 0.0F); };
  return {limit(std::floor(d.box.x), width), limit(std::ceil(d.box.x + d.box.width), width), limit(std::floor(d.box.y), height),
          limit(std::ceil(d.box.y + d.box.height), height)};
}
/// Pixel (x,y) lies on the mask of a detection, or in its box where it has no mask.
[[nodiscard]] inline bool covers(const Detection& d, int x, int y) {
  if (!d.mask.empty()) return d.mask(x, y) != 0;
  const auto u = static_cast<float>(x);
  const auto v = static_cast<float>(y);
  return u >= d.box.x && u < d.box.x + d.box.width && v >= d.box.y && v < d.box.y + d.box.height;
}

/// Mask from detections. A movable object contributes its motion probability, or its score where motion is not
/// known (a semantic mask alone: what can move is taken as moving), on its mask or else in its box; overlapping
/// objects take the larger value. Pixels outside of every object are unknown unless `outside_is_static`.
inline void mask_from_detections(const AnyDetections& detections, int width, int height, bool outside_is_static, DynamicMask& out) {
  expects(width > 0 && height > 0, "mask_from_detections: empty size");
  out.probability.assign(width, height, 0.0F);
  out.known.assign(width, height, outside_is_static ? 1 : 0);
  std::vector<Detection> buffer;
  for (const Detection& d : detections.in(buffer)) {
    if (!d.movable) continue;
    const float value = d.motion_probability == d.motion_probability ? d.motion_probability : d.score;
    const auto p = static_cast<float>(clamp01(static_cast<double>(value)));
    const bool has_mask = !d.mask.empty();
    expects(!has_mask || (d.mask.width == width && d.mask.height == height),
            "mask_from_detections: mask of a detection has another size than the image");
    const PixelRange range = pixels_of(d, width, height);
    for (int y = range.y0; y < range.y1; ++y) {
      for (int x = range.x0; x < range.x1; ++x) {
        if (has_mask && d.mask(x, y) == 0) continue;
        out.probability(x, y) = std::max(out.probability(x, y), p);
        out.known(x, y) = 1;
      }
    }
  }
}

APSO_NAMESPACE_END
