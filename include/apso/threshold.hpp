/// \file
/// Front door: what score is good enough? The adaptive thresholds, the benchmark and the decision, for scores of any origin.
///
/// Nothing here reads an image: the scores may come from score.hpp or from your own system. The shortest complete use:
/// \code
///   #include <apso/threshold.hpp>
///   apso::Initialiser start;        // finds the first reference: thresholds that relax with time
///   apso::Benchmark<> benchmark;    // the score to beat
///   apso::SceneDecision decision;   // GOOD or BAD
///   // for each frame:
///   if (!benchmark.present()) {
///     const auto step = start.offer(S_total);
///     if (step.new_best) best = {timestamp, S_total};
///     if (step.commit) benchmark.set(best);
///   } else {
///     const apso::Decision d = decision.decide(S_total, S_feature, S_conf, S_change, dynamic_ratio);
///     decision.remember(d, d.good);
///     benchmark.update({timestamp, S_total}, d.good, S_change, overlap, steady_frames);
///   }
/// \endcode
///
/// | part                                     | equation of the paper | a rule of your own                               |
/// |------------------------------------------|-----------------------|--------------------------------------------------|
/// | `Initialiser`: th_f, th_s                | (3), (4), (5)         | `BasicInitialiser<Thresholds>`, see AdaptiveThresholds |
/// | `SceneDecision`: weights, S_final, th_differ | (6), (8), (9), (11) | `BasicSceneDecision<Threshold>`, see DecisionThreshold |
/// | `Benchmark<Frame>`: the score to beat    | (10)                  |                                                  |
///
/// `BasicAssessor<FrameScores, ChangeScores, Thresholds, Threshold>` takes both rules. Scores are a Quality or a Deviation,
/// made from a number in [0,1]; a missing one is `std::nullopt`. Settings out of their range are a contract_error.
#pragma once

#include <apso/quality/benchmark.hpp>
#include <apso/quality/decision.hpp>
#include <apso/quality/threshold.hpp>
#include <apso/types/score.hpp>
