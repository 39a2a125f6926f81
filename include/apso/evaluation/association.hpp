/// \file
/// Which poses of two trajectories belong to the same instant. Two rules are in use in the literature, and they
/// give different pairs, hence different errors; both are here.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <queue>
#include <tuple>
#include <vector>

#include <apso/config.hpp>
#include <apso/evaluation/trajectory.hpp>

APSO_NAMESPACE_BEGIN

/// Indices of two timestamps that belong together.
struct StampMatch {
  std::size_t first = 0;   ///< index into the first list
  std::size_t second = 0;  ///< index into the second list
};

/// Rule of association.
enum class AssociationRule {
  Tum,  ///< greedy one-to-one, < 0.02 s (the scripts of the TUM RGB-D benchmark)
  Evo   ///< nearest neighbour of the shorter in the longer list, <= 0.01 s (evo 1.x)
};
[[nodiscard]] constexpr std::array<const char*, 2> enum_names(AssociationRule) { return {"tum", "evo"}; }

/// Largest difference of time that the authors of a rule take by default [s].
[[nodiscard]] constexpr double default_max_difference(AssociationRule rule) { return rule == AssociationRule::Tum ? 0.02 : 0.01; }

namespace detail {
/// Index of the value nearest to t in a non-empty sorted list; the smaller index on a tie.
[[nodiscard]] inline std::size_t nearest_stamp(const std::vector<double>& sorted, double t) {
  const auto after = std::lower_bound(sorted.begin(), sorted.end(), t);
  if (after == sorted.begin()) return 0;
  const auto before = after - 1;
  const bool take_before = after == sorted.end() || std::abs(*before - t) <= std::abs(*after - t);
  return static_cast<std::size_t>((take_before ? before : after) - sorted.begin());
}
inline void expects_stamps(const std::vector<double>& stamps, const char* message) {
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    expects(std::isfinite(stamps[i]) && (i == 0 || stamps[i - 1] < stamps[i]), message);
  }
}
}  // namespace detail

/// Association of the TUM scripts (associate.py, evaluate_ate.py): of all pairs closer than max_difference, sorted by
/// (difference, first, second), each is taken whose two members are still free. O(n log n) whatever max_difference is.
/// \param first,second strictly increasing timestamps [s]
/// \param max_difference pairs must be closer than this [s]
/// \param offset_second added to the stamps of the second list [s]
/// \return matches in the order of the first list
[[nodiscard]] inline std::vector<StampMatch> associate_tum(const std::vector<double>& first, const std::vector<double>& second,
                                                           double max_difference = 0.02, double offset_second = 0) {
  detail::expects_stamps(first, "associate_tum: first timestamps must be finite and strictly increasing");
  detail::expects_stamps(second, "associate_tum: second timestamps must be finite and strictly increasing");
  expects(max_difference >= 0 && std::isfinite(offset_second), "associate_tum: max_difference must be >= 0");
  // Of the free stamps of both lists in the order of time, the closest pair are neighbours: only those are looked at, and when a
  // pair is taken, those beside it become neighbours.
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  const std::size_t n = first.size();
  const auto stamp = [&](std::size_t i) { return i < n ? first[i] : second[i - n] + offset_second; };
  std::vector<std::size_t> order(n + second.size());  // by time; numbers from n on are of the second list
  for (std::size_t a = 0, b = n, i = 0; i < order.size(); ++i) {
    const bool take_a = b == order.size() || (a < n && stamp(a) <= stamp(b));
    order[i] = take_a ? a++ : b++;
  }
  std::vector<std::size_t> before(order.size(), kNone), after(order.size(), kNone);
  for (std::size_t i = 1; i < order.size(); ++i) {
    before[order[i]] = order[i - 1];
    after[order[i - 1]] = order[i];
  }
  using Pair = std::tuple<double, std::size_t, std::size_t>;  // difference, first, second
  std::priority_queue<Pair, std::vector<Pair>, std::greater<>> closest;
  const auto offer = [&](std::size_t i, std::size_t j) {
    if (i == kNone || j == kNone || (i < n) == (j < n)) return;
    const double difference = std::abs(stamp(std::min(i, j)) - stamp(std::max(i, j)));
    if (difference < max_difference) closest.emplace(difference, std::min(i, j), std::max(i, j));
  };
  for (std::size_t i = 1; i < order.size(); ++i) offer(order[i - 1], order[i]);
  std::vector<std::size_t> partner_of_first(n, kNone);
  std::vector<char> used(order.size(), 0);
  const auto remove = [&](std::size_t i) {
    used[i] = 1;
    if (before[i] != kNone) after[before[i]] = after[i];
    if (after[i] != kNone) before[after[i]] = before[i];
  };
  while (!closest.empty()) {
    const auto [difference, a, b] = closest.top();
    closest.pop();
    if (used[a] != 0 || used[b] != 0) continue;
    partner_of_first[a] = b - n;
    remove(a);
    remove(b);
    const bool a_first = stamp(a) <= stamp(b);
    offer(before[a_first ? a : b], after[a_first ? b : a]);
  }
  std::vector<StampMatch> matches;
  for (std::size_t a = 0; a < first.size(); ++a) {
    if (partner_of_first[a] != kNone) matches.push_back({a, partner_of_first[a]});
  }
  return matches;
}

/// Association of evo 1.x (`evo_ape tum`): for every stamp of the shorter list (the second one when both are equally
/// long) the nearest stamp of the longer list, if it is not farther than max_difference. Not one-to-one: a stamp of the
/// longer list may be used twice.
/// \param first,second strictly increasing timestamps [s]
/// \param max_difference pairs must not be farther apart than this [s]
/// \param offset_second added to the stamps of the second list [s]
/// \return matches in the order of the shorter list
[[nodiscard]] inline std::vector<StampMatch> associate_evo(const std::vector<double>& first, const std::vector<double>& second,
                                                           double max_difference = 0.01, double offset_second = 0) {
  detail::expects_stamps(first, "associate_evo: first timestamps must be finite and strictly increasing");
  detail::expects_stamps(second, "associate_evo: second timestamps must be finite and strictly increasing");
  expects(max_difference >= 0 && std::isfinite(offset_second), "associate_evo: max_difference must be >= 0");
  const bool second_longer = second.size() > first.size();
  const std::vector<double>& shorter = second_longer ? first : second;
  std::vector<double> longer = second_longer ? second : first;
  for (double& t : longer) t += second_longer ? offset_second : -offset_second;
  std::vector<StampMatch> matches;
  if (shorter.empty()) return matches;
  for (std::size_t i = 0; i < shorter.size(); ++i) {
    const std::size_t j = detail::nearest_stamp(longer, shorter[i]);
    if (!(std::abs(longer[j] - shorter[i]) <= max_difference)) continue;
    matches.push_back(second_longer ? StampMatch{i, j} : StampMatch{j, i});
  }
  return matches;
}

/// Association by the rule given.
/// \param first,second strictly increasing stamps [s], or trajectories: any range of numbers or of stamped poses
/// \param max_difference largest difference of a pair [s]; 0: the one that the authors of the rule use
/// \param offset_second added to the stamps of the second list [s]
template <class First = std::vector<double>, class Second = std::vector<double>>
[[nodiscard]] std::vector<StampMatch> associate(const First& first, const Second& second, AssociationRule rule, double max_difference = 0,
                                                double offset_second = 0) {
  const double limit = max_difference > 0 ? max_difference : default_max_difference(rule);
  const std::vector<double> a = timestamps(first);
  const std::vector<double> b = timestamps(second);
  return rule == AssociationRule::Tum ? associate_tum(a, b, limit, offset_second) : associate_evo(a, b, limit, offset_second);
}

APSO_NAMESPACE_END
