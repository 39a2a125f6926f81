// Assignment against trying all permutations.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <apso/math/assignment.hpp>

namespace {
using namespace apso;

double total(const std::vector<double>& cost, std::size_t columns, const std::vector<int>& column_of, double limit) {
  double sum = 0;
  for (std::size_t i = 0; i < column_of.size(); ++i) {
    sum += column_of[i] >= 0 ? cost[i * columns + static_cast<std::size_t>(column_of[i])] : limit;
  }
  return sum;
}

/// Smallest total over all ways to give each row a column of its own or none.
double best(const std::vector<double>& cost, std::size_t rows, std::size_t columns, double limit) {
  std::vector<int> place;  // columns, then one "none" per row
  for (std::size_t j = 0; j < columns + rows; ++j) place.push_back(j < columns ? static_cast<int>(j) : -1);
  std::sort(place.begin(), place.end());
  double least = std::numeric_limits<double>::infinity();
  do {
    std::vector<int> chosen(place.begin(), place.begin() + static_cast<std::ptrdiff_t>(rows));
    bool allowed = true;
    for (std::size_t i = 0; i < rows; ++i)
      allowed = allowed && (chosen[i] < 0 || cost[i * columns + static_cast<std::size_t>(chosen[i])] < limit);
    if (allowed) least = std::min(least, total(cost, columns, chosen, limit));
  } while (std::next_permutation(place.begin(), place.end()));
  return least;
}

TEST_CASE("assignment finds the smallest total, for every shape, with forbidden pairs") {
  unsigned state = 7;
  const auto random = [&] {
    state = state * 1664525U + 1013904223U;
    return static_cast<double>(state >> 8) / 16777216.0;
  };
  AssignmentScratch scratch;
  std::vector<int> column_of;
  for (int round = 0; round < 60; ++round) {
    const std::size_t rows = 1 + static_cast<std::size_t>(round % 4);
    const std::size_t columns = 1 + static_cast<std::size_t>(round / 4 % 4);
    std::vector<double> cost(rows * columns);
    for (double& c : cost) c = random() < 0.15 ? std::numeric_limits<double>::infinity() : random();
    assign(cost, rows, columns, 0.8, column_of, scratch);
    REQUIRE(column_of.size() == rows);
    std::vector<int> seen;
    for (std::size_t i = 0; i < rows; ++i) {
      if (column_of[i] < 0) continue;
      CHECK(cost[i * columns + static_cast<std::size_t>(column_of[i])] < 0.8);
      CHECK(std::find(seen.begin(), seen.end(), column_of[i]) == seen.end());
      seen.push_back(column_of[i]);
    }
    CHECK(total(cost, columns, column_of, 0.8) == doctest::Approx(best(cost, rows, columns, 0.8)));
  }
}

TEST_CASE("assignment: the greedy choice is not the best one, NaN is forbidden, nothing to assign") {
  AssignmentScratch scratch;
  std::vector<int> column_of;
  assign({0.1, 0.2, 0.15, 0.9}, 2, 2, 1.0, column_of, scratch);  // greedy: 0.1 + 0.9
  CHECK(column_of == std::vector<int>{1, 0});
  assign({std::nan(""), 0.5}, 1, 2, 1.0, column_of, scratch);
  CHECK(column_of == std::vector<int>{1});
  assign({}, 0, 3, 1.0, column_of, scratch);
  CHECK(column_of.empty());
  assign({}, 2, 0, 1.0, column_of, scratch);
  CHECK(column_of == std::vector<int>{-1, -1});
  CHECK_THROWS_AS(assign({1.0}, 2, 2, 1.0, column_of, scratch), contract_error);
}

}  // namespace
