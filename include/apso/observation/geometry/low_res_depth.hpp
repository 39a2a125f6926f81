/// \file
/// A small depth image that keeps the edges of the large one, and the neighbourhood limits of its surfaces.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <apso/config.hpp>
#include <apso/math/small_matrix.hpp>
#include <apso/traits/any.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

APSO_NAMESPACE_BEGIN

/// Camera of an image whose pixels cover factor x factor pixels of `camera`; remaining columns and rows are cut off.
[[nodiscard]] inline Pinhole reduced_camera(const Pinhole& camera, int factor) {
  const double f = factor;
  return {camera.fx / f,
          camera.fy / f,
          (camera.cx + 0.5) / f - 0.5,
          (camera.cy + 0.5) / f - 0.5,
          std::max(1, camera.width / factor),
          std::max(1, camera.height / factor)};
}

/// Index of the small pixel that shows a point of the frame [px]; -1 outside the image and for NaN.
[[nodiscard]] inline int small_pixel(float x, float y, int factor, int width, int height) {
  const auto f = static_cast<float>(factor);
  const float u = (x + 0.5F) / f;
  const float v = (y + 0.5F) / f;
  const bool inside = u >= 0 && v >= 0 && u < static_cast<float>(width) && v < static_cast<float>(height);  // false for NaN
  return inside ? static_cast<int>(v) * width + static_cast<int>(u) : -1;
}

/// Difference in depth below which two samples of a block belong to one surface [m].
[[nodiscard]] inline float same_surface(float z) { return 0.03F + 4.0F * depth_sigma(z); }

/// The rows of one row of blocks, as float: pointers into the image where it holds floats, else into a buffer that is
/// used again.
class BlockRows {
 public:
  /// Rows y to y + count - 1 of an image.
  const float* const* read(const AnyImage& image, int y, int count) {
    rows_.resize(static_cast<std::size_t>(count));
    const auto width = static_cast<std::size_t>(image.width());
    for (int j = 0; j < count; ++j) {
      const float*& row = rows_[static_cast<std::size_t>(j)];
      row = image.row_in_place(y + j);
      if (row != nullptr) continue;
      if (buffer_.size() < width * static_cast<std::size_t>(count)) buffer_.resize(width * static_cast<std::size_t>(count));
      float* out = buffer_.data() + width * static_cast<std::size_t>(j);
      image.read_row(y + j, out, 1.0F);
      row = out;
    }
    return rows_.data();
  }

 private:
  std::vector<const float*> rows_;
  std::vector<float> buffer_;
};

/// Reduces a depth image. A pixel takes the surface seen at the middle of its block and averages the samples of
/// that surface only, so that no depth appears between foreground and background. Invalid is 0.
/// \param depth any image [m], read once by rows
/// \param buffer kept by the caller, so that warm calls allocate nothing
inline void reduce_depth(const AnyImage& depth, int factor, const DepthRange& range, int width, int height, BlockRows& buffer,
                         Image<float>& out) {
  out.resize(width, height);
  const int c0 = (factor - 1) / 2;
  const int c1 = factor / 2;
  const int candidates[4][2] = {{c0, c0}, {c1, c1}, {c0, c1}, {c1, c0}};
  for (int y = 0; y < height; ++y) {
    const float* const* block = buffer.read(depth, y * factor, factor);
    for (int x = 0; x < width; ++x) {
      const int left = x * factor;
      float middle = 0;
      for (const auto& c : candidates) {
        const float z = block[c[1]][left + c[0]];
        if (depth_valid(z, range)) {
          middle = z;
          break;
        }
      }
      if (middle > 0) {
        const float tolerance = same_surface(middle);
        float sum = 0;
        float n = 0;
        for (int j = 0; j < factor; ++j) {
          const float* r = block[j] + left;
          for (int i = 0; i < factor; ++i) {
            const bool same = std::abs(r[i] - middle) <= tolerance;  // false for NaN
            sum += same ? r[i] : 0.0F;
            n += same ? 1.0F : 0.0F;
          }
        }
        middle = sum / n;
      }
      out(x, y) = middle;
    }
  }
}

/// Smallest and largest depth in the 3x3 neighbourhood of each pixel, over its valid pixels.
struct DepthLimits {
  Image<float> nearest;   ///< [m]; 0 where the pixel is invalid or most of its neighbourhood is
  Image<float> farthest;  ///< [m]; 0 likewise
};

inline void depth_limits(const Image<float>& z, DepthLimits& out) {
  const int w = z.width();
  const int h = z.height();
  out.nearest.resize(w, h);
  out.farthest.resize(w, h);
  for (int y = 0; y < h; ++y) {
    const int y0 = std::max(0, y - 1);
    const int y1 = std::min(h - 1, y + 1);
    for (int x = 0; x < w; ++x) {
      float lo = 0;
      float hi = 0;
      if (z(x, y) > 0) {
        const int x0 = std::max(0, x - 1);
        const int x1 = std::min(w - 1, x + 1);
        lo = hi = z(x, y);
        int invalid = 0;
        for (int j = y0; j <= y1; ++j) {
          const float* r = z.row(j);
          for (int i = x0; i <= x1; ++i) {
            const bool ok = r[i] > 0;
            invalid += ok ? 0 : 1;
            lo = ok ? std::min(lo, r[i]) : lo;
            hi = ok ? std::max(hi, r[i]) : hi;
          }
        }
        if (invalid > 4) lo = hi = 0;  // the rim of a hole says little about what is free
      }
      out.nearest(x, y) = lo;
      out.farthest(x, y) = hi;
    }
  }
}

/// Unit normals of a small depth image in its camera frame, facing the camera; the zero vector where a neighbour
/// is invalid or lies on another surface.
inline void depth_normals(const Image<float>& z, const Pinhole& camera, std::vector<Eigen::Vector3f>& out) {
  const int w = z.width();
  const int h = z.height();
  out.assign(z.size(), Eigen::Vector3f(0, 0, 0));
  const auto point = [&](int x, int y) {
    return Eigen::Vector3f(static_cast<float>((x - camera.cx) / camera.fx) * z(x, y),
                           static_cast<float>((y - camera.cy) / camera.fy) * z(x, y), z(x, y));
  };
  for (int y = 1; y + 1 < h; ++y) {
    for (int x = 1; x + 1 < w; ++x) {
      const float c = z(x, y);
      const float l = z(x - 1, y);
      const float r = z(x + 1, y);
      const float u = z(x, y - 1);
      const float d = z(x, y + 1);
      if (!(c > 0 && l > 0 && r > 0 && u > 0 && d > 0)) continue;
      // a step shows as a second difference; a slanted plane has (nearly) none
      const float step = same_surface(c);
      if (std::abs(l + r - 2 * c) > step || std::abs(u + d - 2 * c) > step) continue;
      if (std::abs(l - r) > 0.3F * c || std::abs(u - d) > 0.3F * c) continue;
      Eigen::Vector3f n = cross(point(x, y + 1) - point(x, y - 1), point(x + 1, y) - point(x - 1, y));
      const float length = norm(n);
      if (!(length > 0)) continue;
      n = (dot(n, point(x, y)) > 0 ? -1.0F : 1.0F) / length * n;
      out[static_cast<std::size_t>(y) * static_cast<std::size_t>(w) + static_cast<std::size_t>(x)] = n;
    }
  }
}

APSO_NAMESPACE_END
