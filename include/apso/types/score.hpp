/// \file
/// Two kinds of score that cannot be mixed up: Quality (higher is better) and Deviation (higher is worse).
/// Both lie in [0,1] and are never NaN. complement() is the only bridge between them.
#pragma once

#include <optional>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// x limited to [0,1]; NaN becomes 0.
[[nodiscard]] constexpr double clamp01(double x) { return x > 0.0 ? (x < 1.0 ? x : 1.0) : 0.0; }

class Deviation;

/// How good something is: 0 useless, 1 perfect. NaN is taken as 0 (the worst).
class Quality {
 public:
  constexpr Quality() = default;
  explicit constexpr Quality(double value) : value_(clamp01(value)) {}
  [[nodiscard]] constexpr double value() const { return value_; }
  [[nodiscard]] constexpr Deviation complement() const;
  friend constexpr bool operator<(Quality a, Quality b) { return a.value_ < b.value_; }
  friend constexpr bool operator==(Quality a, Quality b) { return a.value_ == b.value_; }

 private:
  double value_ = 0;
};

/// How far something departs from its reference: 0 the same, 1 nothing in common. NaN is taken as 1 (the worst).
class Deviation {
 public:
  constexpr Deviation() = default;
  explicit constexpr Deviation(double value) : value_(value == value ? clamp01(value) : 1.0) {}
  [[nodiscard]] constexpr double value() const { return value_; }
  [[nodiscard]] constexpr Quality complement() const { return Quality(1.0 - value_); }
  friend constexpr bool operator<(Deviation a, Deviation b) { return a.value_ < b.value_; }
  friend constexpr bool operator==(Deviation a, Deviation b) { return a.value_ == b.value_; }

 private:
  double value_ = 0;
};

constexpr Deviation Quality::complement() const { return Deviation(1.0 - value_); }

/// A component that may be missing (no objects, no depth image ...); missing is not zero.
using MaybeQuality = std::optional<Quality>;
using MaybeDeviation = std::optional<Deviation>;

APSO_NAMESPACE_END
