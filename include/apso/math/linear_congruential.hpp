/// \file
/// A small deterministic source of numbers for sampling, the same on every platform.
#pragma once

#include <cstdint>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// Linear congruential generator of 32 bits with the constants of Numerical Recipes. The high bits are the random ones.
class LinearCongruential {
 public:
  explicit LinearCongruential(std::uint32_t seed) : state_(seed) {}
  std::uint32_t operator()() { return state_ = state_ * 1664525U + 1013904223U; }

 private:
  std::uint32_t state_;
};

APSO_NAMESPACE_END
