/// \file
/// Binary descriptors and their distance, keypoints by image cell, and the check that pairs turn alike.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include <apso/config.hpp>
#include <apso/types/keypoint.hpp>

APSO_NAMESPACE_BEGIN

/// A binary descriptor of 256 bits (ORB, Rublee et al., ICCV 2011; BRIEF-32, rBRIEF and LATCH have this size too).
using Descriptor = std::array<std::uint8_t, 32>;

/// Differing bits of two descriptors, 0 .. 256. Counts in parallel within words (Knuth, TAOCP 4A, 7.1.3), so that it is
/// fast without the popcount instruction, which a portable build must not use.
[[nodiscard]] inline int hamming(const Descriptor& a, const Descriptor& b) {
  constexpr std::uint64_t k1 = 0x5555555555555555U;
  constexpr std::uint64_t k2 = 0x3333333333333333U;
  constexpr std::uint64_t k4 = 0x0F0F0F0F0F0F0F0FU;
  std::uint64_t bytes = 0;
  for (std::size_t i = 0; i < 32; i += 8) {
    std::uint64_t u = 0;
    std::uint64_t v = 0;
    std::memcpy(&u, a.data() + i, 8);
    std::memcpy(&v, b.data() + i, 8);
    u ^= v;
    u -= (u >> 1U) & k1;
    u = (u & k2) + ((u >> 2U) & k2);
    bytes += (u + (u >> 4U)) & k4;  // bits of each byte, at most 8
  }
  // at most 32 in each byte; the sum of all may be 256, which has no room in the top byte
  bytes = (bytes & 0x00FF00FF00FF00FFU) + ((bytes >> 8U) & 0x00FF00FF00FF00FFU);
  return static_cast<int>((bytes * 0x0001000100010001U) >> 48U);
}

/// Keypoints by image cell, to find those near a pixel.
class KeypointGrid {
 public:
  void build(const std::vector<Keypoint>& keypoints, int width, int height) {
    columns_ = width / kCell + 1;
    rows_ = height / kCell + 1;
    first_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
    for (const Keypoint& k : keypoints) ++first_[cell(k.x, k.y) + 1];
    for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
    fill_ = first_;
    index_.resize(keypoints.size());
    for (std::size_t i = 0; i < keypoints.size(); ++i)
      index_[static_cast<std::size_t>(fill_[cell(keypoints[i].x, keypoints[i].y)]++)] = static_cast<int>(i);
  }
  /// Calls f(index) for every keypoint in the cells that touch the square of half side `radius` around (x,y).
  template <class F>
  void near(double x, double y, double radius, F&& f) const {
    if (first_.empty()) return;
    const int x0 = std::clamp(static_cast<int>((x - radius) / kCell), 0, columns_ - 1);
    const int x1 = std::clamp(static_cast<int>((x + radius) / kCell), 0, columns_ - 1);
    const int y0 = std::clamp(static_cast<int>((y - radius) / kCell), 0, rows_ - 1);
    const int y1 = std::clamp(static_cast<int>((y + radius) / kCell), 0, rows_ - 1);
    for (int cy = y0; cy <= y1; ++cy) {
      const auto a = static_cast<std::size_t>(first_[static_cast<std::size_t>(cy * columns_ + x0)]);
      const auto b = static_cast<std::size_t>(first_[static_cast<std::size_t>(cy * columns_ + x1) + 1]);
      for (std::size_t i = a; i < b; ++i) f(index_[i]);
    }
  }

 private:
  static constexpr int kCell = 20;
  [[nodiscard]] std::size_t cell(float x, float y) const {
    const int cx = std::clamp(static_cast<int>(x) / kCell, 0, columns_ - 1);
    const int cy = std::clamp(static_cast<int>(y) / kCell, 0, rows_ - 1);
    return static_cast<std::size_t>(cy * columns_ + cx);
  }
  int columns_ = 0;
  int rows_ = 0;
  std::vector<int> first_;
  std::vector<int> fill_;
  std::vector<int> index_;
};

/// Which of the pairs turn by one of the three most common angles (30 bins, Mur-Artal et al., T-RO 2015).
/// \param turns angle of one side minus angle of the other [deg]
[[nodiscard]] inline std::vector<char> rotation_consistent(const std::vector<float>& turns) {
  constexpr int kBins = 30;
  std::array<int, kBins> count{};
  const auto bin = [](float turn) {
    const float t = turn - 360.0F * std::floor(turn / 360.0F);
    return static_cast<std::size_t>(std::clamp(static_cast<int>(t / 12.0F + 0.5F) % kBins, 0, kBins - 1));
  };
  for (float t : turns) ++count[bin(t)];
  std::array<int, 3> best{-1, -1, -1};
  for (int b = 0; b < kBins; ++b) {
    int candidate = b;
    for (int& place : best)
      if (place < 0 || count[static_cast<std::size_t>(candidate)] > count[static_cast<std::size_t>(place)]) {
        std::swap(place, candidate);
        if (candidate < 0) break;
      }
  }
  std::vector<char> keep(turns.size(), 0);
  const int most = count[static_cast<std::size_t>(best[0])];
  for (std::size_t i = 0; i < turns.size(); ++i)
    for (int place : best)
      if (static_cast<int>(bin(turns[i])) == place && count[static_cast<std::size_t>(place)] * 10 >= most) keep[i] = 1;
  return keep;
}

APSO_NAMESPACE_END
