// Statistics, association and interpolation on cases small enough to work out by hand.
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <tuple>
#include <vector>

#include <doctest/doctest.h>

#include <apso/evaluation/association.hpp>
#include <apso/evaluation/trajectory.hpp>

namespace {
using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;
Pairs as_pairs(const std::vector<apso::StampMatch>& matches) {
  Pairs p;
  for (const auto& m : matches) p.emplace_back(m.first, m.second);
  return p;
}
}  // namespace

TEST_CASE("statistics of 4 1 3 2") {
  const apso::Statistics s = apso::compute_statistics({4, 1, 3, 2});
  CHECK(s.count == 4);
  CHECK(s.mean == doctest::Approx(2.5));
  CHECK(s.median == doctest::Approx(2.5));
  CHECK(s.rmse == doctest::Approx(std::sqrt(7.5)));
  CHECK(s.std == doctest::Approx(std::sqrt(1.25)));  // of the population: divided by 4, not by 3
  CHECK(s.min == 1);
  CHECK(s.max == 4);
}

TEST_CASE("statistics of one value, of none, of an odd number, and of a bad value") {
  const apso::Statistics one = apso::compute_statistics({7});
  CHECK(one.median == 7);
  CHECK(one.std == 0);
  CHECK(one.rmse == 7);
  const apso::Statistics none = apso::compute_statistics({});
  CHECK(none.count == 0);
  CHECK(none.rmse == 0);
  CHECK(apso::compute_statistics({9, 1, 2}).median == 2);
  CHECK_THROWS_AS((void)apso::compute_statistics({1, std::numeric_limits<double>::quiet_NaN()}), apso::contract_error);
}

TEST_CASE("rmse^2 = mean^2 + std^2 and min <= median <= max for any errors") {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> value(0, 5);
  for (int k = 1; k < 50; ++k) {
    std::vector<double> v;
    for (int i = 0; i < k; ++i) v.push_back(value(random));
    const apso::Statistics s = apso::compute_statistics(v);
    CHECK(s.rmse * s.rmse == doctest::Approx(s.mean * s.mean + s.std * s.std));
    CHECK(s.min <= s.median);
    CHECK(s.median <= s.max);
    std::shuffle(v.begin(), v.end(), random);
    CHECK(apso::compute_statistics(v).rmse == s.rmse);  // bit for bit whatever the order
  }
}

TEST_CASE("TUM association gives a contested stamp to the closer one") {
  CHECK(as_pairs(apso::associate_tum({0.0, 0.01}, {0.008})) == Pairs{{1, 0}});
  // 0.012 takes 0.010, which leaves 0.000 nothing closer than 0.02
  CHECK(as_pairs(apso::associate_tum({0.0, 0.012}, {0.010, 0.025})) == Pairs{{1, 0}});
}

TEST_CASE("the limit is excluded by the TUM rule and included by the evo rule") {
  CHECK(apso::associate_tum({0.0}, {0.5}, 0.5).empty());
  CHECK(apso::associate_tum({0.0}, {0.4375}, 0.5).size() == 1);
  CHECK(apso::associate_evo({0.0}, {0.5}, 0.5).size() == 1);
  CHECK(apso::associate_evo({0.0}, {0.5625}, 0.5).empty());
}

TEST_CASE("evo association looks from the shorter list and may use a stamp twice") {
  CHECK(as_pairs(apso::associate_evo({0, 1, 2}, {0.75, 1.25}, 0.5)) == Pairs{{1, 0}, {1, 1}});
  CHECK(as_pairs(apso::associate_evo({0.75, 1.25}, {0, 1, 2}, 0.5)) == Pairs{{0, 1}, {1, 1}});
  CHECK(as_pairs(apso::associate_evo({0, 1, 2}, {0.5}, 1.0)) == Pairs{{0, 0}});  // tie: the earlier one
}

TEST_CASE("an offset moves the second list, whichever is longer") {
  CHECK(as_pairs(apso::associate_tum({10, 11}, {0, 1}, 0.02, 10)) == Pairs{{0, 0}, {1, 1}});
  CHECK(as_pairs(apso::associate_evo({10, 11}, {0, 1}, 0.01, 10)) == Pairs{{0, 0}, {1, 1}});
  CHECK(as_pairs(apso::associate_evo({10, 11}, {0, 1, 2}, 0.01, 10)) == Pairs{{0, 0}, {1, 1}});
  CHECK(apso::associate_evo({10, 11}, {0, 1, 2}, 0.01, 0).empty());
}

TEST_CASE("association of nothing is nothing") {
  CHECK(apso::associate_tum({}, {1}).empty());
  CHECK(apso::associate_tum({1}, {}).empty());
  CHECK(apso::associate_evo({}, {1}).empty());
  CHECK(apso::associate_evo({1}, {}).empty());
}

TEST_CASE("association refuses unsorted stamps") {
  CHECK_THROWS_AS((void)apso::associate_tum({1, 0}, {1}), apso::contract_error);
  CHECK_THROWS_AS((void)apso::associate_evo({1}, {0, 0}), apso::contract_error);
}

TEST_CASE("the window of the TUM association finds what a search over all pairs finds") {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> stamp(0, 2);
  for (int round = 0; round < 30; ++round) {
    std::vector<double> a;
    std::vector<double> b;
    for (int i = 0; i < 60; ++i) a.push_back(stamp(random));
    for (int i = 0; i < 90; ++i) b.push_back(stamp(random));
    std::sort(a.begin(), a.end());
    std::sort(b.begin(), b.end());
    std::vector<std::tuple<double, double, double, std::size_t, std::size_t>> all;
    for (std::size_t i = 0; i < a.size(); ++i) {
      for (std::size_t j = 0; j < b.size(); ++j) {
        if (std::abs(a[i] - b[j]) < 0.02) all.emplace_back(std::abs(a[i] - b[j]), a[i], b[j], i, j);
      }
    }
    std::sort(all.begin(), all.end());
    std::set<std::size_t> free_a;
    std::set<std::size_t> free_b;
    for (std::size_t i = 0; i < a.size(); ++i) free_a.insert(i);
    for (std::size_t j = 0; j < b.size(); ++j) free_b.insert(j);
    Pairs expected;
    for (const auto& c : all) {
      if (free_a.count(std::get<3>(c)) == 0 || free_b.count(std::get<4>(c)) == 0) continue;
      free_a.erase(std::get<3>(c));
      free_b.erase(std::get<4>(c));
      expected.emplace_back(std::get<3>(c), std::get<4>(c));
    }
    std::sort(expected.begin(), expected.end());
    CHECK(as_pairs(apso::associate_tum(a, b)) == expected);
  }
}
