/// \file
/// How well a score predicts an event: ROC curve and its area, precision and recall of a decision, reliability of
/// the score as a probability, rank correlation. Fawcett, "An introduction to ROC analysis", Pattern Recognition
/// Letters 27, 2006.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <numeric>
#include <vector>

#include <apso/config.hpp>

APSO_NAMESPACE_BEGIN

/// One observation: a score that should be high when the event takes place.
struct ScoredEvent {
  double score = 0;
  bool event = false;
};

/// Your scores and outcomes as events. Throws contract_error when they are not equally many.
/// \param scores any range of numbers
/// \param events any range of what converts to bool
template <class Scores, class Events>
[[nodiscard]] std::vector<ScoredEvent> scored_events(const Scores& scores, const Events& events) {
  std::vector<ScoredEvent> out;
  auto event = std::begin(events);
  for (const auto& score : scores) {
    expects(event != std::end(events), "scored_events: there are more scores than events");
    out.push_back({static_cast<double>(score), static_cast<bool>(*event)});
    ++event;
  }
  expects(event == std::end(events), "scored_events: there are more events than scores");
  return out;
}
/// Any range of pairs of score and outcome as events.
template <class Range>
[[nodiscard]] std::vector<ScoredEvent> scored_events(const Range& range) {
  std::vector<ScoredEvent> out;
  for (const auto& [score, event] : range) out.push_back({static_cast<double>(score), static_cast<bool>(event)});
  return out;
}

/// A point of the ROC curve: what happens when everything from `threshold` on counts as predicted.
struct RocPoint {
  double threshold = 0;
  double false_positive_rate = 0;
  double true_positive_rate = 0;
};

/// The curve from (0,0) to (1,1), one point per distinct score. Empty unless both outcomes occur. Scores that are not
/// finite are left out.
/// \param range ScoredEvents, or pairs of score and outcome
template <class Range = std::vector<ScoredEvent>>
[[nodiscard]] std::vector<RocPoint> roc_curve(const Range& range) {
  std::vector<ScoredEvent> data = scored_events(range);
  data.erase(std::remove_if(data.begin(), data.end(), [](const ScoredEvent& d) { return !std::isfinite(d.score); }), data.end());
  std::sort(data.begin(), data.end(), [](const ScoredEvent& a, const ScoredEvent& b) { return a.score > b.score; });
  const auto events = static_cast<double>(std::count_if(data.begin(), data.end(), [](const auto& d) { return d.event; }));
  const double others = static_cast<double>(data.size()) - events;
  std::vector<RocPoint> curve;
  if (!(events > 0) || !(others > 0)) return curve;
  curve.push_back({std::numeric_limits<double>::infinity(), 0, 0});
  double hits = 0;
  double alarms = 0;
  for (std::size_t i = 0; i < data.size(); ++i) {
    (data[i].event ? hits : alarms) += 1;
    if (i + 1 < data.size() && data[i + 1].score == data[i].score) continue;  // ties move along the diagonal
    curve.push_back({data[i].score, alarms / others, hits / events});
  }
  return curve;
}

/// Area under the curve: the probability that an event scores higher than a non-event, ties counting half. NaN for
/// an empty curve; 0.5 is chance.
[[nodiscard]] inline double area_under(const std::vector<RocPoint>& curve) {
  if (curve.empty()) return std::numeric_limits<double>::quiet_NaN();
  double area = 0;
  for (std::size_t i = 1; i < curve.size(); ++i) {
    area += (curve[i].false_positive_rate - curve[i - 1].false_positive_rate) * 0.5 *
            (curve[i].true_positive_rate + curve[i - 1].true_positive_rate);
  }
  return area;
}
template <class Range = std::vector<ScoredEvent>>
[[nodiscard]] double area_under_roc(const Range& range) {
  return area_under(roc_curve(range));
}

/// Counts of a yes-or-no prediction.
struct Confusion {
  int hits = 0;          ///< predicted, and it came
  int false_alarms = 0;  ///< predicted, and it did not come
  int misses = 0;        ///< not predicted, but it came
  int quiet = 0;         ///< neither
  void add(bool predicted, bool event) { ++(predicted ? (event ? hits : false_alarms) : (event ? misses : quiet)); }
  /// hits / predicted; NaN when nothing was predicted.
  [[nodiscard]] double precision() const { return ratio(hits, hits + false_alarms); }
  /// hits / events; NaN without events.
  [[nodiscard]] double recall() const { return ratio(hits, hits + misses); }
  /// false alarms / non-events; NaN without non-events.
  [[nodiscard]] double false_alarm_rate() const { return ratio(false_alarms, false_alarms + quiet); }

 private:
  [[nodiscard]] static double ratio(int a, int b) { return b > 0 ? static_cast<double>(a) / b : std::numeric_limits<double>::quiet_NaN(); }
};

/// One bin of a reliability diagram.
struct ReliabilityBin {
  double mean_score = 0;
  double event_share = 0;  ///< how often the event came
  int count = 0;
};

/// Bins of equal width over [0,1]; empty bins are left out. Scores outside of [0,1] or NaN are left out.
/// \param range ScoredEvents, or pairs of score and outcome
template <class Range = std::vector<ScoredEvent>>
[[nodiscard]] std::vector<ReliabilityBin> reliability(const Range& range, int bins = 10) {
  expects(bins > 0, "reliability: bins must be > 0");
  std::vector<ReliabilityBin> all(static_cast<std::size_t>(bins));
  for (const ScoredEvent& d : scored_events(range)) {
    if (!(d.score >= 0 && d.score <= 1)) continue;
    ReliabilityBin& b = all[static_cast<std::size_t>(std::min(bins - 1, static_cast<int>(d.score * bins)))];
    b.mean_score += d.score;
    b.event_share += d.event ? 1 : 0;
    ++b.count;
  }
  all.erase(std::remove_if(all.begin(), all.end(), [](const ReliabilityBin& b) { return b.count == 0; }), all.end());
  for (ReliabilityBin& b : all) {
    b.mean_score /= b.count;
    b.event_share /= b.count;
  }
  return all;
}

/// Ranks from 1, ties get their mean rank.
[[nodiscard]] inline std::vector<double> ranks(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  std::vector<double> rank(values.size());
  for (std::size_t i = 0; i < order.size();) {
    std::size_t j = i;
    while (j < order.size() && values[order[j]] == values[order[i]]) ++j;
    for (std::size_t k = i; k < j; ++k) rank[order[k]] = 0.5 * static_cast<double>(i + j + 1);
    i = j;
  }
  return rank;
}

/// Spearman's rank correlation of pairs without NaN: in [-1,1]; NaN for fewer than two pairs or a constant side.
[[nodiscard]] inline double rank_correlation(const std::vector<double>& x, const std::vector<double>& y) {
  expects(x.size() == y.size(), "rank_correlation: x and y differ in size");
  const std::vector<double> a = ranks(x);
  const std::vector<double> b = ranks(y);
  const double mean = 0.5 * (static_cast<double>(x.size()) + 1);
  double ab = 0;
  double aa = 0;
  double bb = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean) * (b[i] - mean);
    aa += (a[i] - mean) * (a[i] - mean);
    bb += (b[i] - mean) * (b[i] - mean);
  }
  return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : std::numeric_limits<double>::quiet_NaN();
}

APSO_NAMESPACE_END
