/// \file
/// Robust estimates of the spread of residuals, so that one large error does not hide behind another.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include <apso/config.hpp>
#include <apso/math/lanes/lanes.hpp>
#include <apso/math/lanes/wide_lanes.hpp>

APSO_NAMESPACE_BEGIN

enum class ScaleKind { Mad, StudentT, MeanAbs };
constexpr std::array<const char*, 3> enum_names(ScaleKind) { return {"mad", "student_t", "mean_abs"}; }

/// Median of the values, of an even count the upper of the middle two; may reorder them. 0 for none.
template <class T>
[[nodiscard]] T upper_median(std::vector<T>& values) {
  if (values.empty()) return T(0);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

namespace detail {
/// How many values are below the bound.
[[nodiscard]] inline std::int32_t count_below(const std::vector<float>& values, float bound) {
  return in_widest_lanes([&values, bound](auto lanes) {
    constexpr std::size_t kStep = lanes;
    const std::size_t whole = values.size() - values.size() % kStep;
    BasicIntLanes<lanes> count{};
    for (std::size_t i = 0; i < whole; i += kStep) {
      count = count - (BasicLanes<lanes>::load(values.data() + i) < BasicLanes<lanes>(bound));
    }
    std::int32_t below = 0;
    for (int k = 0; k < lanes; ++k) below += count[k];
    for (std::size_t i = whole; i < values.size(); ++i) below += values[i] < bound ? 1 : 0;
    return below;
  });
}
/// The smallest value that is not below the bound.
[[nodiscard]] inline float least_from(const std::vector<float>& values, float bound) {
  return in_widest_lanes([&values, bound](auto lanes) {
    using L = BasicLanes<lanes>;
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    constexpr std::size_t kStep = lanes;
    const std::size_t whole = values.size() - values.size() % kStep;
    L each = kInfinity;
    for (std::size_t i = 0; i < whole; i += kStep) {
      const L v = L::load(values.data() + i);
      each = min(select(v < L(bound), kInfinity, v), each);
    }
    float least = kInfinity;
    for (int k = 0; k < lanes; ++k) least = std::min(least, each[k]);
    for (std::size_t i = whole; i < values.size(); ++i) least = values[i] < bound ? least : std::min(least, values[i]);
    return least;
  });
}
}  // namespace detail

/// The same for floats without NaN, found by halving the range of bit patterns that holds it: a few vectorised counts are
/// several times faster than partitioning. Leaves the values as they are.
[[nodiscard]] inline float upper_median(std::vector<float>& values) {
  if (values.empty()) return 0;
  const std::size_t n = values.size();
  const auto middle = static_cast<std::int32_t>(n / 2);
  // bit patterns as integers in the order of the floats; the mapping is its own inverse
  const auto ordered = [](std::int32_t pattern) { return pattern < 0 ? pattern ^ 0x7FFFFFFF : pattern; };
  const auto key = [&](float v) {
    std::int32_t pattern;
    std::memcpy(&pattern, &v, sizeof v);
    return std::int64_t{ordered(pattern)};
  };
  const auto value = [&](std::int64_t k) {
    const std::int32_t pattern = ordered(static_cast<std::int32_t>(k));
    float v;
    std::memcpy(&v, &pattern, sizeof v);
    return v;
  };
  std::int64_t low = key(-std::numeric_limits<float>::infinity());
  std::int64_t high = key(std::numeric_limits<float>::infinity()) + 1;
  std::int32_t below_low = 0;                              // values below low, at most `middle`
  std::int32_t below_high = static_cast<std::int32_t>(n);  // values below high, more than that
  while (high - low > 1 && below_high - below_low > 1) {
    const std::int64_t half = low + (high - low) / 2;
    const std::int32_t below = detail::count_below(values, value(half));
    if (below <= middle) {
      low = half;
      below_low = below;
    } else {
      high = half;
      below_high = below;
    }
  }
  return detail::least_from(values, value(low));
}

/// 1.4826 median |r - median r|: the standard deviation of Gaussian residuals, blind to up to half of outliers.
/// Reorders and overwrites the values. 0 for none.
template <class T>
[[nodiscard]] double mad_scale_in_place(std::vector<T>& values) {
  const T m = upper_median(values);
  for (T& r : values) r = std::abs(r - m);
  return 1.4826 * static_cast<double>(upper_median(values));
}

/// Scale of a Student-t distribution: sigma^2 <- mean of r^2 (nu+1)/(nu + r^2/sigma^2), from `start` (or MAD) until the
/// relative change is below 1e-3, at most 50 times (Kerl et al. 2013; stop rule without units).
template <class T>
[[nodiscard]] double t_scale(const std::vector<T>& values, double nu, double start) {
  if (values.empty()) return 0;
  double s2 = start * start;
  if (!(s2 > 0)) return 0;
  for (int i = 0; i < 50; ++i) {
    double sum = 0;
    for (const T r : values) {
      const double r2 = static_cast<double>(r) * static_cast<double>(r);
      sum += r2 * (nu + 1) / (nu + r2 / s2);
    }
    const double next = sum / static_cast<double>(values.size());
    if (!(next > 0)) break;
    const bool done = std::abs(next - s2) <= 1e-3 * s2;
    s2 = next;
    if (done) break;
  }
  return std::sqrt(s2);
}

/// Mean of |r|. 0 for none.
template <class T>
[[nodiscard]] double mean_abs(const std::vector<T>& values) {
  double sum = 0;
  for (const T r : values) sum += std::abs(static_cast<double>(r));
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

/// The chosen scale of the values, which are reordered and overwritten.
template <class T>
[[nodiscard]] double robust_scale_in_place(ScaleKind kind, std::vector<T>& values) {
  switch (kind) {
    case ScaleKind::MeanAbs:
      return mean_abs(values);
    case ScaleKind::StudentT: {
      std::vector<T> copy(values);
      return t_scale(values, 5.0, mad_scale_in_place(copy));
    }
    case ScaleKind::Mad:
      break;
  }
  return mad_scale_in_place(values);
}

/// Covariance of pairs of residuals under a bivariate t distribution with nu = 5 (the joint model of DVO):
/// Sigma <- mean of w r r^T with w = 7/(5 + r^T Sigma^-1 r), until the relative change is below 1e-3, at most 50 times.
template <class T>
[[nodiscard]] Eigen::Matrix2d bivariate_t_scale(const std::vector<T>& a, const std::vector<T>& b) {
  expects(a.size() == b.size(), "bivariate_t_scale: the two residual lists differ in length");
  std::vector<T> copy(a);
  const double sa = std::max(1e-9, mad_scale_in_place(copy));
  copy = b;
  const double sb = std::max(1e-9, mad_scale_in_place(copy));
  double s[3] = {sa * sa, 0, sb * sb};  // 00 01 11
  for (int i = 0; i < 50 && !a.empty(); ++i) {
    const double determinant = s[0] * s[2] - s[1] * s[1];
    double sum[3] = {0, 0, 0};
    for (std::size_t j = 0; j < a.size(); ++j) {
      const auto x = static_cast<double>(a[j]);
      const auto y = static_cast<double>(b[j]);
      const double w = 7.0 / (5.0 + (s[2] * x * x - 2 * s[1] * x * y + s[0] * y * y) / determinant);
      sum[0] += w * x * x;
      sum[1] += w * x * y;
      sum[2] += w * y * y;
    }
    double change[3];
    for (int k = 0; k < 3; ++k) {
      sum[k] = sum[k] / static_cast<double>(a.size()) + (k == 1 ? 0.0 : 1e-18);
      change[k] = sum[k] - s[k];
    }
    const auto squares = [](const double* m) { return m[0] * m[0] + 2 * m[1] * m[1] + m[2] * m[2]; };
    const bool done = squares(change) <= 1e-6 * squares(s);
    for (int k = 0; k < 3; ++k) s[k] = sum[k];
    if (done) break;
  }
  Eigen::Matrix2d sigma;
  sigma(0, 0) = s[0];
  sigma(0, 1) = sigma(1, 0) = s[1];
  sigma(1, 1) = s[2];
  return sigma;
}

APSO_NAMESPACE_END
