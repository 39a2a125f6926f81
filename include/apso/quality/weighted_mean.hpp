/// \file
/// The weighted combination f of the paper (eq. function_f), for scores that may be missing.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>

#include <apso/config.hpp>
#include <apso/types/score.hpp>

APSO_NAMESPACE_BEGIN

/// Throws contract_error unless all weights are >= 0 and their sum is 1 to 1e-6.
template <std::size_t N>
void validate_weights(const std::array<double, N>& weights, const char* name) {
  double sum = 0;
  bool ok = true;
  for (const double w : weights) {
    ok = ok && w >= 0;  // false for NaN
    sum += w;
  }
  if (ok && std::abs(sum - 1.0) <= 1e-6) return;
  contract_violation(std::string("the weights ") + name + " must be >= 0 and sum to 1, their sum is " +
                     std::to_string(sum));
}

/// f(S; w) = sum w_i S_i / sum w_i over the components that are present. Missing when none is present or all
/// present ones have weight 0.
/// \tparam Score Quality or Deviation
template <class Score, std::size_t N>
[[nodiscard]] std::optional<Score> weighted_mean(const std::array<std::optional<Score>, N>& scores,
                                                 const std::array<double, N>& weights) {
  validate_weights(weights, "of a weighted mean");
  double sum = 0;
  double weight = 0;
  for (std::size_t i = 0; i < N; ++i) {
    if (!scores[i]) continue;
    sum += weights[i] * scores[i]->value();
    weight += weights[i];
  }
  if (!(weight > 0)) return std::nullopt;
  return Score(sum / weight);
}

APSO_NAMESPACE_END
