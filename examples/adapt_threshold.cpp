// Adaptive thresholds for your own scores: find a reference, then decide frame by frame. No image is read here.
#include <apso/threshold.hpp>
#include <cmath>
#include <cstdio>

int main() {
  int bad = 0;
  // [threshold]
  apso::Initialiser start;
  apso::Benchmark<> benchmark;
  apso::SceneDecision decision;
  apso::ScoredFrame best;
  for (int n = 1; n <= 300; ++n) {
    const bool blurred = n > 200 && n <= 220;  // your own scores, [0,1]
    const apso::ScoredFrame now{n / 30.0, apso::Quality(blurred ? 0.2 : 0.8 + 0.1 * std::sin(n / 30.0))};
    if (!benchmark.present()) {
      const auto step = start.offer(now.S_total);  // th_f and th_s relax with time
      if (step.new_best) best = now;
      if (step.commit) benchmark.set(best);
      continue;
    }
    const apso::Deviation change(blurred ? 0.6 : 0.1);  // and a dynamic ratio of 0.2
    const apso::Decision d = decision.decide(now.S_total, {}, {}, change, 0.2);
    bad += !d.good;
    benchmark.update(now, d.good, change, 1, 0);  // all of the reference is in sight
  }
  std::printf("%d BAD frames, score to beat %.2f\n", bad, benchmark.score_to_beat(10.0));
  // [/threshold]
  return bad == 20 ? 0 : 1;
}
