// Random numbers that are the same everywhere.
#pragma once

#include <apso/math/linear_congruential.hpp>

/// Uniform in [0,1).
template <class T>
class Uniform {
 public:
  [[nodiscard]] T operator()() { return static_cast<T>(next_() >> 8U) / T(16777216); }

 private:
  apso::LinearCongruential next_{1};
};
