/// \file
/// The scores of one frame and their weighted combination f, equation (2): a score may be missing.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>

#include <apso/config.hpp>
#include <apso/quality/score_list.hpp>
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
  contract_violation(std::string("the weights ") + name + " must be >= 0 and sum to 1, their sum is " + std::to_string(sum));
}

/// f(S; w) = sum w_i S_i / sum w_i over the components that are present. Missing when none is present or all
/// present ones have weight 0.
/// \tparam Score Quality or Deviation
template <class Score, std::size_t N>
[[nodiscard]] std::optional<Score> weighted_mean(const std::array<std::optional<Score>, N>& scores, const std::array<double, N>& weights) {
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

/// One score of one frame.
template <class S>
struct ScoreResult {
  using Score = S;
  std::optional<typename S::Value> value;         ///< missing is not zero
  double weight = 0;                              ///< in the weighted mean, [0,1]
  typename score_traits<S>::Measured measured{};  ///< what the value was computed from
};
/// The scores of a list.
template <class List>
struct ScoreResults;
template <class... S>
struct ScoreResults<ScoreList<S...>> {
  using List = ScoreList<S...>;
  std::tuple<ScoreResult<S>...> each;
  template <class T>
  [[nodiscard]] ScoreResult<T>& get() {
    return std::get<score_index<T>(List{})>(each);
  }
  template <class T>
  [[nodiscard]] const ScoreResult<T>& get() const {
    return std::get<score_index<T>(List{})>(each);
  }
};

namespace detail {
/// A score as the kind that its weighted mean is of.
template <class To, class From>
[[nodiscard]] std::optional<To> as_score(const std::optional<From>& score) {
  if (!score) return std::nullopt;
  if constexpr (std::is_same_v<To, From>) return score;
  else return score->complement();
}
}  // namespace detail

/// Equation (2) or (7): the weighted mean of the scores of a list. Missing ones leave their weight to the others.
/// \tparam To Quality for S_total, Deviation for S_change; a score of the other kind enters by its complement
template <class To, class... S>
[[nodiscard]] std::optional<To> mean_of_scores(const ScoreResults<ScoreList<S...>>& scores, const ScoreWeights<ScoreList<S...>>& weights) {
  using List = ScoreList<S...>;
  return weighted_mean<To, sizeof...(S)>({detail::as_score<To>(std::get<score_index<S>(List{})>(scores.each).value)...}, weights.values());
}

APSO_NAMESPACE_END
