/// \file
/// The last n values of a signal with their median and spread.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// Median of the values, which are reordered; the mean of the middle two for an even number, 0 for none.
[[nodiscard]] inline double median_in_place(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

/// Bounded memory of a signal. Values that are not finite are ignored.
class RunningWindow {
 public:
  explicit RunningWindow(std::size_t capacity) : capacity_(capacity) {
    expects(capacity > 0, "RunningWindow: capacity must be > 0");
    values_.reserve(capacity);
    scratch_.reserve(capacity);
  }
  void add(double value) {
    if (!std::isfinite(value)) return;
    if (values_.size() < capacity_) {
      values_.push_back(value);
    } else {
      values_[next_] = value;
    }
    next_ = (next_ + 1) % capacity_;
  }
  void clear() {
    values_.clear();
    next_ = 0;
  }
  [[nodiscard]] std::size_t size() const { return values_.size(); }
  [[nodiscard]] bool full() const { return values_.size() == capacity_; }
  /// Median of the remembered values; 0 when there is none.
  [[nodiscard]] double median() {
    scratch_ = values_;
    return median_in_place(scratch_);
  }
  /// Median absolute deviation from the median, without a factor; 0 when there is none.
  [[nodiscard]] double mad() {
    const double m = median();
    for (double& v : scratch_) v = std::abs(v - m);
    return median_in_place(scratch_);
  }

 private:
  std::size_t capacity_;
  std::size_t next_ = 0;
  std::vector<double> values_;
  std::vector<double> scratch_;
};

APSO_NAMESPACE_END
