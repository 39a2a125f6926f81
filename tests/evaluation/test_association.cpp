// The fast association of the TUM rule against its definition, and its size.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>
#include <vector>

#include <apso/evaluation/association.hpp>

using namespace apso;

namespace {
// associate.py word by word: all pairs that are close enough, sorted, taken while both are free.
std::vector<std::pair<std::size_t, std::size_t>> as_defined(const std::vector<double>& first, const std::vector<double>& second,
                                                            double max_difference, double offset) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> potential;
  for (std::size_t a = 0; a < first.size(); ++a) {
    for (std::size_t b = 0; b < second.size(); ++b) {
      const double difference = std::abs(first[a] - (second[b] + offset));
      if (difference < max_difference) potential.emplace_back(difference, a, b);
    }
  }
  std::sort(potential.begin(), potential.end());
  std::vector<bool> a_taken(first.size()), b_taken(second.size());
  std::vector<std::pair<std::size_t, std::size_t>> matches;
  for (const auto& [difference, a, b] : potential) {
    if (a_taken[a] || b_taken[b]) continue;
    a_taken[a] = b_taken[b] = true;
    matches.emplace_back(a, b);
  }
  std::sort(matches.begin(), matches.end());
  return matches;
}

// Increasing multiples of 1/8, so that every difference is exact and many are equal.
std::vector<double> stamps(std::mt19937& rng, int count, int largest_gap) {
  std::vector<double> out;
  double t = 0.125 * static_cast<double>(rng() % 40);
  for (int i = 0; i < count; ++i) {
    out.push_back(t);
    t += 0.125 * static_cast<double>(1 + rng() % static_cast<unsigned>(largest_gap));
  }
  return out;
}
}  // namespace

TEST_CASE("association finds the pairs of the benchmark's script, with ties and whatever the largest difference") {
  std::mt19937 rng(22);
  for (int i = 0; i < 3000; ++i) {
    const std::vector<double> a = stamps(rng, static_cast<int>(rng() % 25), 1 + static_cast<int>(rng() % 8));
    const std::vector<double> b = stamps(rng, static_cast<int>(rng() % 25), 1 + static_cast<int>(rng() % 8));
    const double limit = 0.125 * static_cast<double>(rng() % 60);
    const double offset = 0.125 * (static_cast<double>(rng() % 17) - 8);
    const auto expected = as_defined(a, b, limit, offset);
    const std::vector<StampMatch> found = associate_tum(a, b, limit, offset);
    REQUIRE(found.size() == expected.size());
    for (std::size_t k = 0; k < found.size(); ++k) {
      CHECK(found[k].first == expected[k].first);
      CHECK(found[k].second == expected[k].second);
    }
  }
}

TEST_CASE("300,000 poses and a largest difference of 100 s: no pair of pairs is ever listed") {
  std::vector<double> a, b;
  for (int i = 0; i < 300000; ++i) {
    a.push_back(i / 30.0);
    b.push_back(i / 30.0 + 0.003);
  }
  const std::vector<StampMatch> found = associate_tum(a, b, 100);
  REQUIRE(found.size() == a.size());
  for (const StampMatch& m : found) REQUIRE(m.first == m.second);
  CHECK(associate_evo(a, b, 100).size() == b.size());
}
