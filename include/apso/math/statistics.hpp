/// \file
/// The median, and a bounded memory of a signal with its median and spread.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// Median of the length of a vector of three independent components with the standard deviation 1 (chi distribution).
inline constexpr double kMedianOfNorm = 1.538;

/// Median of the values, which are reordered: the mean of the middle two for an even count, 0 for none.
/// upper_median() (robust_scale.hpp) takes the upper of the two instead, which is faster on many floats.
[[nodiscard]] inline double median_in_place(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

/// The last values of a signal and their median. Values that are not finite are ignored.
class RunningMedian {
 public:
  /// \param window how many values are remembered, > 0
  explicit RunningMedian(int window) : window_(static_cast<std::size_t>(window)) {
    expects(window > 0, "RunningMedian: the window must be > 0");
    values_.reserve(window_);  // so that later calls allocate nothing
    scratch_.reserve(window_);
  }
  void add(double value) {
    if (!std::isfinite(value)) return;
    if (values_.size() < window_) {
      values_.push_back(value);
    } else {
      values_[next_] = value;
    }
    next_ = (next_ + 1) % window_;
  }
  void clear() {
    values_.clear();
    next_ = 0;
  }
  [[nodiscard]] int size() const { return static_cast<int>(values_.size()); }
  [[nodiscard]] bool full() const { return values_.size() == window_; }
  /// Median of the remembered values.
  /// \param otherwise the answer when there is none
  [[nodiscard]] double median(double otherwise = 0) {
    if (values_.empty()) return otherwise;
    scratch_ = values_;
    return median_in_place(scratch_);
  }
  /// Median absolute deviation from the median, without a factor; 0 when there is none.
  [[nodiscard]] double mad() {
    const double m = median();
    scratch_ = values_;
    for (double& v : scratch_) v = std::abs(v - m);
    return median_in_place(scratch_);
  }

 private:
  std::size_t window_;
  std::size_t next_ = 0;
  std::vector<double> values_;
  std::vector<double> scratch_;
};

APSO_NAMESPACE_END
