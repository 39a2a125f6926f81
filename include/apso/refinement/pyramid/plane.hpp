/// \file
/// Images as the pyramid keeps them, and how they are halved: functions of a band of rows [y0, y1) of the result, which has its
/// size already, so that bands can be worked on side by side.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>
#include <apso/math/lanes/lane_memory.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN

/// A float image whose rows can be read and written beyond their ends: kPad floats before and at least kPad after each,
/// of unspecified content. Loops over a row need no special last step.
class Plane {
 public:
  static constexpr int kPad = 16;  ///< the most lanes that there are

  /// Changes the size; the content is unspecified. Allocates only when it grows beyond any size before.
  void resize(int width, int height) {
    width_ = width;
    height_ = height;
    stride_ = (width + kPad - 1) / kPad * kPad + 2 * kPad;
    data_.resize(static_cast<std::size_t>(stride_) * static_cast<std::size_t>(height));
  }
  void clear() { resize(0, 0); }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] bool empty() const { return data_.empty(); }
  [[nodiscard]] float* row(int y) { return data_.data() + static_cast<std::ptrdiff_t>(stride_) * y + kPad; }
  [[nodiscard]] const float* row(int y) const { return data_.data() + static_cast<std::ptrdiff_t>(stride_) * y + kPad; }
  [[nodiscard]] ImageView<const float> view() const {
    return empty() ? ImageView<const float>{} : ImageView<const float>{row(0), width_, height_, stride_};
  }

 private:
  std::vector<float> data_;
  int width_ = 0;
  int height_ = 0;
  int stride_ = 0;
};

/// The rows of an image that are in use while it is read from the first to the last: the last kRows of them, in a part of a plane.
class RowWindow {
 public:
  static constexpr int kRows = 4;
  /// \param rows as wide as the image; the window has its rows [kRows index, kRows (index + 1))
  /// \param height of the image
  RowWindow(Plane& rows, int index, int height) : rows_(&rows), first_(kRows * index), height_(height) {}
  [[nodiscard]] int width() const { return rows_->width(); }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] float* row(int y) const { return rows_->row(first_ + y % kRows); }

 private:
  Plane* rows_;
  int first_, height_;
};

/// The rows of an image in bands: few enough that calling for them costs nothing, the same for any executor.
class Bands {
 public:
  static constexpr int kMost = 16;
  /// \param least pixels of a band, about two microseconds of work
  Bands(int rows, int width, int least = 4096)
      : rows_(rows), count_(std::clamp(rows * width / least, 1, std::min(kMost, std::max(1, rows)))) {}
  [[nodiscard]] int count() const { return count_; }
  /// Calls f(band, y0, y1) for all of them.
  template <class Executor, class F>
  void run(const Executor& executor, const F& f) const {
    executor(count_, [&](int i) { f(i, rows_ * i / count_, rows_ * (i + 1) / count_); });
  }

 private:
  int rows_, count_;
};

/// Half the size by the taps 1 3 3 1 (/8) in both directions. A filter with an even number of taps is centred on the
/// 2x2 block that the coarse pixel stands for, as c' = (c + 0.5)/2 - 0.5 and the depth require; an odd one would shift
/// the image by half a pixel.
/// \param in a Plane or RowWindow
/// \param l a row for intermediate results, of a plane as wide as `in` plus two pads
template <class Rows>
void halve_intensity(const Rows& in, Plane& out, float* l, int y0, int y1) {
  in_widest_lanes([&](auto lanes) {
    using L = BasicLanes<lanes>;
    const int w = out.width();
    for (int y = y0; y < y1; ++y) {
      const float* a = in.row(std::max(2 * y - 1, 0));
      const float* b = in.row(2 * y);
      const float* c = in.row(2 * y + 1);
      const float* d = in.row(std::min(2 * y + 2, in.height() - 1));
      for (int x = 0; x < in.width(); x += lanes) {
        (0.125F * (L::load(a + x) + L::load(d + x)) + 0.375F * (L::load(b + x) + L::load(c + x))).store(l + x);
      }
      l[-1] = l[0];
      l[in.width()] = l[in.width() - 1];
      float* o = out.row(y);
      for (int x = 0; x < w; x += lanes) {
        L s0, s1, s2, s3;
        load_pairs(l + 2 * x - 1, s0, s1);
        load_pairs(l + 2 * x + 1, s2, s3);
        (0.125F * (s0 + s3) + 0.375F * (s1 + s2)).store(o + x);
      }
    }
  });
}

/// Smoothed by the taps 1 2 1 (/4) in both directions.
/// \param l as above
inline void smooth_intensity(const Plane& in, Plane& out, float* l, int y0, int y1) {
  in_widest_lanes([&](auto lanes) {
    using L = BasicLanes<lanes>;
    const int w = in.width();
    const int h = in.height();
    for (int y = y0; y < y1; ++y) {
      const float* a = in.row(std::max(y - 1, 0));
      const float* b = in.row(y);
      const float* c = in.row(std::min(y + 1, h - 1));
      for (int x = 0; x < w; x += lanes) {
        (0.25F * (L::load(a + x) + L::load(c + x)) + 0.5F * L::load(b + x)).store(l + x);
      }
      l[-1] = l[0];
      l[w] = l[w - 1];
      float* o = out.row(y);
      for (int x = 0; x < w; x += lanes) {
        (0.25F * (L::load(l + x - 1) + L::load(l + x + 1)) + 0.5F * L::load(l + x)).store(o + x);
      }
    }
  });
}

/// Half the size: the mean of the valid ones of 2x2 depths that lie within 10 cm of their second largest, so never a
/// mean over an edge. 0 stays "invalid".
/// \param in a Plane or RowWindow
template <class Rows>
void halve_depth(const Rows& in, Plane& out, int y0, int y1) {
  in_widest_lanes([&](auto lanes) {
    using L = BasicLanes<lanes>;
    const int w = out.width();
    for (int y = y0; y < y1; ++y) {
      const float* p = in.row(2 * y);
      const float* q = in.row(2 * y + 1);
      float* o = out.row(y);
      for (int x = 0; x < w; x += lanes) {
        L z[4];
        load_pairs(p + 2 * x, z[0], z[1]);
        load_pairs(q + 2 * x, z[2], z[3]);
        const L low01 = min(z[0], z[1]);
        const L high01 = max(z[0], z[1]);
        const L low23 = min(z[2], z[3]);
        const L high23 = max(z[2], z[3]);
        const L high = max(high01, high23);
        // second largest of the valid ones; the only one if there is one
        L second = max(min(high01, high23), max(low01, low23));
        second = select(second > L(0.0F), second, high);
        L sum = 0.0F;
        L n = 0.0F;
        for (const L& v : z) {
          const auto near = (v > L(0.0F)) & (abs(v - second) <= L(0.1F));
          sum += select(near, v, 0.0F);
          n += select(near, 1.0F, 0.0F);
        }
        (sum / max(n, 1.0F)).store(o + x);
      }
    }
  });
}

/// Half the size by the mean of 2x2.
inline void halve_mean(const Plane& in, Plane& out, int y0, int y1) {
  in_widest_lanes([&](auto lanes) {
    using L = BasicLanes<lanes>;
    const int w = out.width();
    for (int y = y0; y < y1; ++y) {
      for (int x = 0; x < w; x += lanes) {
        L a, b, c, d;
        load_pairs(in.row(2 * y) + 2 * x, a, b);
        load_pairs(in.row(2 * y + 1) + 2 * x, c, d);
        (0.25F * ((a + b) + (c + d))).store(out.row(y) + x);
      }
    }
  });
}

/// out = a b.
inline void multiply(const Plane& a, const Plane& b, Plane& out, int y0, int y1) {
  in_widest_lanes([&](auto lanes) {
    using L = BasicLanes<lanes>;
    for (int y = y0; y < y1; ++y) {
      for (int x = 0; x < a.width(); x += lanes) (L::load(a.row(y) + x) * L::load(b.row(y) + x)).store(out.row(y) + x);
    }
  });
}

/// a = a / b where b > least, else 0.
inline void divide(Plane& a, const Plane& b, float least, int y0, int y1) {
  in_widest_lanes([&](auto lanes) {
    using L = BasicLanes<lanes>;
    for (int y = y0; y < y1; ++y) {
      for (int x = 0; x < a.width(); x += lanes) {
        const L d = L::load(b.row(y) + x);
        const auto ok = d > L(least);
        select(ok, L::load(a.row(y) + x) / select(ok, d, 1.0F), 0.0F).store(a.row(y) + x);
      }
    }
  });
}

APSO_NAMESPACE_END
