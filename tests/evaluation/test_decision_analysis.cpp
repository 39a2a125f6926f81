// ROC, confusion, reliability, rank correlation: values by hand and properties.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <apso/evaluation/decision_analysis.hpp>

using namespace apso;
using doctest::Approx;

TEST_CASE("the area under the curve: by hand") {
  CHECK(area_under_roc({{.9, true}, {.8, true}, {.2, false}, {.1, false}}) == 1);
  CHECK(area_under_roc({{.9, false}, {.8, false}, {.2, true}, {.1, true}}) == 0);
  CHECK(area_under_roc({{.5, true}, {.5, false}, {.5, true}, {.5, false}}) == .5);
  // of the 2 x 3 pairs the event is higher in 4, equal in 1
  CHECK(area_under_roc({{.9, true}, {.4, true}, {.5, false}, {.4, false}, {.1, false}}) == Approx(4.5 / 6));
  CHECK(std::isnan(area_under_roc({})));
  CHECK(std::isnan(area_under_roc({{1, true}})));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(area_under_roc({{.9, true}, {nan, true}, {nan, false}, {.1, false}}) == 1);
}

TEST_CASE("the area is the share of pairs in the right order, whatever monotone scale the score has") {
  std::mt19937 g(3);
  for (int round = 0; round < 20; ++round) {
    std::vector<ScoredEvent> d;
    for (int i = 0; i < 60; ++i) {
      const double s = static_cast<double>(g() % 20U) / 20;
      d.push_back({s, static_cast<double>(g() % 100U) / 100 < s});
    }
    double right = 0;
    double pairs = 0;
    for (const auto& a : d) {
      for (const auto& b : d) {
        if (!a.event || b.event) continue;
        right += a.score > b.score ? 1 : (a.score == b.score ? .5 : 0);
        pairs += 1;
      }
    }
    const double area = area_under_roc(d);
    CHECK(area == Approx(right / pairs).epsilon(1e-12));
    auto turned = d;
    for (auto& x : d) x.score = std::exp(3 * x.score);
    for (auto& x : turned) x.score = -x.score;
    CHECK(area_under_roc(d) == Approx(area).epsilon(1e-12));
    CHECK(area_under_roc(turned) == Approx(1 - area).epsilon(1e-12));
    const auto curve = roc_curve(d);
    CHECK(curve.front().true_positive_rate == 0);
    CHECK(curve.back().true_positive_rate == 1);
    CHECK(curve.back().false_positive_rate == 1);
    for (std::size_t i = 1; i < curve.size(); ++i) {
      CHECK(curve[i].true_positive_rate >= curve[i - 1].true_positive_rate);
      CHECK(curve[i].false_positive_rate >= curve[i - 1].false_positive_rate);
      CHECK(curve[i].threshold < curve[i - 1].threshold);
    }
  }
}

TEST_CASE("confusion and reliability") {
  Confusion c;
  CHECK(std::isnan(c.precision()));
  for (int i = 0; i < 6; ++i) c.add(true, i < 4);
  for (int i = 0; i < 10; ++i) c.add(false, i < 1);
  CHECK(c.precision() == Approx(4. / 6));
  CHECK(c.recall() == Approx(4. / 5));
  CHECK(c.false_alarm_rate() == Approx(2. / 11));
  const auto bins = reliability({{.05, false}, {.08, true}, {.95, true}, {1, true}, {std::nan(""), true}, {2, false}}, 10);
  REQUIRE(bins.size() == 2);
  CHECK(bins[0].count == 2);
  CHECK(bins[0].event_share == .5);
  CHECK(bins[0].mean_score == Approx(.065));
  CHECK(bins[1].event_share == 1);
  CHECK_THROWS_AS((void)reliability({}, 0), contract_error);
}

TEST_CASE("rank correlation") {
  CHECK(rank_correlation({1, 2, 3, 4}, {10, 100, 1000, 1e9}) == Approx(1));
  CHECK(rank_correlation({1, 2, 3, 4}, {4, 3, 2, 1}) == Approx(-1));
  CHECK(rank_correlation({1, 2, 3, 4, 5}, {2, 1, 4, 3, 5}) == Approx(.8));
  CHECK(std::isnan(rank_correlation({1, 1}, {1, 2})));
  CHECK(ranks({5, 1, 5}) == std::vector<double>{2.5, 1, 2.5});
  CHECK_THROWS_AS((void)rank_correlation({1}, {}), contract_error);
}
