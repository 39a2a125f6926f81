/// \file
/// The figures of apso_motion: masks against the truth, summed over frames, and the tables of them.
#pragma once

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include <apso/observation/dynamic_mask.hpp>

namespace track {

/// Sums over the frames of one policy on one sequence.
struct MotionScore {
  double iou = 0, recall = 0;  ///< sums over frames with people
  int with_people = 0;
  double false_share = 0;  ///< sum of the shares of static pixels called dynamic
  double worst = 0;
  double ms = 0;
  int frames = 0;
  double ate = -1;  ///< [m]; negative = not known

  /// \param truth 8 bit, nonzero = dynamic, of the size of the mask; empty: nothing is dynamic
  void judge(const apso::DynamicMask& mask, const cv::Mat& truth) {
    apso::expects(truth.empty() || truth.size() == cv::Size(mask.probability.width(), mask.probability.height()),
                  "judge: the sizes differ");
    double both = 0, marked = 0, real = 0;
    const auto size = static_cast<double>(mask.probability.size());
    for (int y = 0; y < mask.probability.height(); ++y) {
      const float* p = mask.probability.row(y);
      const uchar* t = truth.empty() ? nullptr : truth.ptr<uchar>(y);
      for (int x = 0; x < mask.probability.width(); ++x) {
        const bool a = p[x] >= 0.5F;
        const bool b = t != nullptr && t[x] != 0;
        both += a && b ? 1 : 0;
        marked += a ? 1 : 0;
        real += b ? 1 : 0;
      }
    }
    ++frames;
    const double wrong = size > real ? (marked - both) / (size - real) : 0.0;
    false_share += wrong;
    worst = std::max(worst, wrong);
    if (real < 0.01 * size) return;
    ++with_people;
    iou += both / (marked + real - both);
    recall += both / real;
  }
};

inline void print_table(const std::string& sequence, const std::vector<std::string>& policies, const std::vector<MotionScore>& scores) {
  std::printf("\n%s\n\n| policy | IoU | recall | false %% | worst %% | ATE m | ms |\n|---|---|---|---|---|---|---|\n", sequence.c_str());
  for (std::size_t i = 0; i < policies.size(); ++i) {
    const MotionScore& s = scores[i];
    const auto number = [](bool there, const char* format, double v) {
      char text[32];
      std::snprintf(text, sizeof text, format, v);
      return std::string(there ? text : "-");
    };
    const bool people = s.with_people > 0;
    const double n = std::max(1, s.with_people);
    std::printf("| %s | %s | %s | %.2f | %.1f | %s | %.1f |\n", policies[i].c_str(), number(people, "%.3f", s.iou / n).c_str(),
                number(people, "%.3f", s.recall / n).c_str(), 100 * s.false_share / std::max(1, s.frames), 100 * s.worst,
                number(s.ate >= 0, "%.4f", s.ate).c_str(), s.ms);
  }
  std::fflush(stdout);
}

enum class SequenceKind { Walking, Static, Recorded };
struct MeasuredSequence {
  std::string name;
  SequenceKind kind = SequenceKind::Recorded;
  std::vector<MotionScore> scores;  ///< by policy
};

/// One row per policy: means over the synthetic sequences of a kind, then every recording.
inline void print_overview(const std::vector<MeasuredSequence>& all, const std::vector<std::string>& policies) {
  const auto has = [&](SequenceKind kind) {
    return std::any_of(all.begin(), all.end(), [&](const MeasuredSequence& m) { return m.kind == kind; });
  };
  std::string head = "| policy |";
  std::string line = "|---|";
  const auto column = [&](const std::string& name) {
    head += ' ' + name + " |";
    line += "---|";
  };
  if (has(SequenceKind::Walking)) {
    for (const char* name : {"walking: IoU", "recall", "false %", "ATE m"}) column(name);
  }
  if (has(SequenceKind::Static)) {
    for (const char* name : {"static: false %", "worst %"}) column(name);
  }
  for (const MeasuredSequence& m : all) {
    if (m.kind != SequenceKind::Recorded) continue;
    column(m.name + (m.scores.front().with_people > 0 ? ": IoU" : ": dynamic %"));
    if (m.scores.front().ate >= 0) column("ATE m");
  }
  column("ms");
  std::printf("\nall sequences\n\n%s\n%s\n", head.c_str(), line.c_str());
  for (std::size_t i = 0; i < policies.size(); ++i) {
    std::string row = "| " + policies[i] + " |";
    const auto put = [&](const char* format, double v) {
      char text[32];
      std::snprintf(text, sizeof text, format, v);
      row += ' ' + std::string(text) + " |";
    };
    for (const SequenceKind kind : {SequenceKind::Walking, SequenceKind::Static}) {
      if (!has(kind)) continue;
      double iou = 0, recall = 0, people = 0, wrong = 0, frames = 0, ate = 0, worst = 0, n = 0;
      for (const MeasuredSequence& m : all) {
        if (m.kind != kind) continue;
        const MotionScore& s = m.scores[i];
        iou += s.iou;
        recall += s.recall;
        people += s.with_people;
        wrong += s.false_share;
        frames += s.frames;
        ate += s.ate;
        worst = std::max(worst, s.worst);
        n += 1;
      }
      if (kind == SequenceKind::Walking) {
        put("%.3f", iou / std::max(1.0, people));
        put("%.3f", recall / std::max(1.0, people));
        put("%.2f", 100 * wrong / frames);
        put("%.4f", ate / n);
      } else {
        put("%.2f", 100 * wrong / frames);
        put("%.1f", 100 * worst);
      }
    }
    double ms = 0;
    for (const MeasuredSequence& m : all) {
      const MotionScore& s = m.scores[i];
      ms += s.ms / static_cast<double>(all.size());
      if (m.kind != SequenceKind::Recorded) continue;
      const bool people = m.scores.front().with_people > 0;
      put(people ? "%.3f" : "%.2f", people ? s.iou / std::max(1, s.with_people) : 100 * s.false_share / std::max(1, s.frames));
      if (m.scores.front().ate >= 0) put("%.4f", s.ate);
    }
    put("%.1f", ms);
    std::printf("%s\n", row.c_str());
  }
  std::fflush(stdout);
}

}  // namespace track
