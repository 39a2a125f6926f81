// Direct alignment beside its peers: on the same pairs, in one run, one thread. First how well each does, then what it
// costs. compare_peers.sh builds and calls it.
#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include <apso/opencv/cameras.hpp>
#include <apso/refinement/align.hpp>
#include <apso/traits/frame.hpp>

#include "alignment_method.hpp"
#include "recording_pairs.hpp"

namespace {
using pairs::Conditions;
using pairs::kDegree;
using pairs::Pair;

class Apso : public Method {
 public:
  Apso(std::string name, std::string key, apso::PyramidOptions pyramid, apso::AlignmentOptions alignment, bool mask = false)
      : name_(std::move(name)), key_(std::move(key)), pyramid_(pyramid), mask_(mask), aligner_(alignment) {}
  std::string name() const override { return name_; }
  std::string key() const override { return key_; }
  int width() const override { return 640 >> pyramid_.finest; }
  void camera(const apso::Pinhole& c) override { camera_ = c; }
  void prepare_reference(const pairs::Image8& f) override { build(f, reference_, apso::PyramidRole::Reference); }
  void prepare_current(const pairs::Image8& f) override { build(f, current_, apso::PyramidRole::Current); }
  Outcome solve(const apso::Pose& guess) override {
    references_.assign(1, {&reference_, apso::Pose::Identity(), 1.0});
    candidates_.assign(1, apso::inverse(guess));
    last = aligner_.align(references_, current_, candidates_);
    confidence = apso::direct_confidence(last).c_dir;
    return {apso::succeeded(last.status) && confidence > 0.5, apso::inverse(last.T_world_camera)};
  }
  // One look at all pixels of the finest level: scales, warp, weights, sums.
  apso::AlignmentResult look(const apso::Pose& T_current_reference) {
    references_.assign(1, {&reference_, apso::Pose::Identity(), 1.0});
    return aligner_.evaluate(references_, current_, apso::inverse(T_current_reference));
  }
  void prepare_both(const pairs::Image8& f) { build(f, current_, apso::PyramidRole::Both); }
  template <class Executor>
  void prepare_with(const Pair& p, const Executor& executor) {
    build(p.reference, reference_, apso::PyramidRole::Reference, executor);
    build(p.current, current_, apso::PyramidRole::Current, executor);
  }
  template <class Executor>
  void solve_with(const Executor& executor) {
    references_.assign(1, {&reference_, apso::Pose::Identity(), 1.0});
    candidates_.assign(1, apso::Pose::Identity());
    last = aligner_.align(references_, current_, candidates_, executor);
  }
  apso::AlignmentResult last;
  double confidence = 0;

 private:
  template <class Executor = apso::SerialExecutor>
  void build(const pairs::Image8& f, apso::FramePyramid& p, apso::PyramidRole role, const Executor& executor = {}) {
    const auto frame = apso::frame(0.0, f.grey, f.depth, camera_);  // 8-bit grey, as OpenCV takes it
    p.build(frame, camera_, mask_ ? f.probability.view() : apso::ImageView<const float>{}, pyramid_, role, executor);
  }
  std::string name_, key_;
  apso::PyramidOptions pyramid_;
  bool mask_;
  apso::Pinhole camera_;
  apso::DirectAligner aligner_;
  apso::FramePyramid reference_, current_;
  std::vector<apso::AlignmentReference> references_;
  std::vector<apso::Pose> candidates_;
};

struct Score {
  int pairs = 0, right = 0, wrong_good = 0, right_good = 0;
  std::vector<double> mm, degrees, all_mm, all_degrees;
  std::map<double, std::pair<int, int>> by_step;  // right, all
};
double median(std::vector<double> v) {
  if (v.empty()) return NAN;
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}
struct Limits {
  double mm = 10, degrees = 0.5;  // right = below both
};

bool verbose = false;

void score(Method& m, const Pair& p, Score& s, const Limits& limits = {}) {
  m.prepare_reference(p.reference);
  m.prepare_current(p.current);
  const Outcome o = m.solve(apso::Pose::Identity());
  const apso::Pose error = apso::inverse(o.T_current_reference) * p.T_current_reference;
  const double mm = 1e3 * error.translation().norm();
  const double degrees = apso::rotation_angle(error) / kDegree;
  const bool right = mm < limits.mm && degrees < limits.degrees;
  ++s.pairs;
  s.right += right ? 1 : 0;
  (right ? s.right_good : s.wrong_good) += o.good ? 1 : 0;
  s.all_mm.push_back(mm);
  s.all_degrees.push_back(degrees);
  if (right) {
    s.mm.push_back(mm);
    s.degrees.push_back(degrees);
  }
  auto& step = s.by_step[p.step];
  step.first += right ? 1 : 0;
  ++step.second;
  if (verbose) {
    std::printf("  %-34s step %.3f moving %.2f: %8.3f mm %7.4f deg %s %s", m.name().c_str(), p.step, p.moving_share, mm, degrees,
                right ? "right" : "WRONG", o.good ? "good" : "bad");
    if (const auto* a = dynamic_cast<const Apso*>(&m)) {
      std::printf("  %s c %.2f valid %.2f sI %.2f sD %.2f it %d", apso::to_string(a->last.status), a->confidence, a->last.valid_share,
                  a->last.scale_intensity, a->last.scale_depth, a->last.iterations);
    }
    std::printf("\n");
  }
}

void print_scores(const std::string& title, const Methods& methods, const std::vector<Score>& scores) {
  std::printf(
      "\n### %s\n\n| method | right | median mm / deg of the right ones | by motion | wrong but called good | right and called good |\n"
      "|---|---|---|---|---|---|\n",
      title.c_str());
  for (std::size_t i = 0; i < methods.size(); ++i) {
    const Score& s = scores[i];
    std::string steps;
    for (const auto& [step, n] : s.by_step) {
      char text[32];
      std::snprintf(text, sizeof text, "%s%.0f", steps.empty() ? "" : "/", 100.0 * n.first / std::max(1, n.second));
      steps += text;
    }
    char right_mm[48] = "-";
    if (!s.mm.empty()) std::snprintf(right_mm, sizeof right_mm, "%.2f / %.4f", median(s.mm), median(s.degrees));
    std::printf("| %s | %d of %d (%.1f %%) | %s | %s | %d of %d | %d of %d |\n", methods[i]->name().c_str(), s.right, s.pairs,
                100.0 * s.right / std::max(1, s.pairs), right_mm, steps.c_str(), s.wrong_good, s.pairs - s.right, s.right_good, s.right);
  }
  std::fflush(stdout);
}

double cpu_ms() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

void time_methods(Methods& methods, const pairs::PairMaker& maker, int count, int repeats) {
  struct Times {
    std::vector<double> reference, current, solve, total;
  };
  std::vector<Times> times(methods.size());
  const double steps[4] = {0.02, 0.04, 0.06, 0.10};
  for (int k = 0; k < count; ++k) {
    const Pair pair = maker.make(k, steps[k % 4], {});
    std::vector<std::array<double, 4>> best(methods.size(), {1e9, 1e9, 1e9, 1e9});
    for (int r = 0; r < repeats; ++r) {
      for (std::size_t i = 0; i < methods.size(); ++i) {  // interleaved: all see the same load of the machine
        const double t0 = cpu_ms();
        methods[i]->prepare_reference(pair.reference);
        const double t1 = cpu_ms();
        methods[i]->prepare_current(pair.current);
        const double t2 = cpu_ms();
        (void)methods[i]->solve(apso::Pose::Identity());
        const double t3 = cpu_ms();
        auto& b = best[i];
        b = {std::min(b[0], t1 - t0), std::min(b[1], t2 - t1), std::min(b[2], t3 - t2), std::min(b[3], t3 - t0)};
      }
    }
    for (std::size_t i = 0; i < methods.size(); ++i) {
      times[i].reference.push_back(best[i][0]);
      times[i].current.push_back(best[i][1]);
      times[i].solve.push_back(best[i][2]);
      times[i].total.push_back(best[i][3]);
    }
  }
  std::printf(
      "\n### Time, one thread [ms of CPU time, median over %d pairs of the best of %d]\n\n"
      "| method | prepare reference | prepare current | solve | a pair | reference prepared before |\n"
      "|---|---|---|---|---|---|\n",
      count, repeats);
  // methods 0 and 1 are ours, at half and at full resolution
  const double ours[2] = {median(times[0].total), median(times[1].total)};
  std::string to_default;
  std::string alike;
  for (std::size_t i = 0; i < methods.size(); ++i) {
    const Times& t = times[i];
    std::printf("| %s | %.2f | %.2f | %.2f | %.2f | %.2f |\n", methods[i]->name().c_str(), median(t.reference), median(t.current),
                median(t.solve), median(t.total), median(t.current) + median(t.solve));
    if (methods[i]->key().empty()) continue;
    const auto add = [&](std::string& line, double to) {
      char text[64];
      std::snprintf(text, sizeof text, " %s=%.2f", methods[i]->key().c_str(), median(t.total) / to);
      line += text;
    };
    add(to_default, ours[0]);
    add(alike, ours[methods[i]->width() > methods[0]->width() ? 1 : 0]);
  }
  std::printf("\nratios to apso at the same resolution:%s\nratios:%s\n", alike.c_str(), to_default.c_str());
}

// A second thread that waits for work without sleeping, so that a pair of a few milliseconds can use it.
class TwoThreads {
 public:
  TwoThreads() : worker_([this] { wait(); }) {}
  ~TwoThreads() {
    stop_ = true;
    worker_.join();
  }
  TwoThreads(const TwoThreads&) = delete;
  TwoThreads& operator=(const TwoThreads&) = delete;
  template <class F>
  void operator()(int n, F&& f) const {
    if (n < 2) {
      for (int i = 0; i < n; ++i) f(i);
      return;
    }
    task_ = [&f](int i) { f(i); };
    done_.store(0, std::memory_order_relaxed);
    ++calls_;
    work_.store(static_cast<std::uint64_t>(calls_) << 48U | static_cast<std::uint64_t>(n) << 32U, std::memory_order_release);
    help(false);
    while (done_.load(std::memory_order_acquire) != n) {
    }
  }

 private:
  // Takes tasks until none is left, the one thread from the first on, the other from the last: what one has written it mostly
  // reads again. Number of the call, tasks in all and tasks taken stand in one word: a thread that comes late to one call sees
  // that nothing of it is left, or takes part in the next.
  void help(bool from_last) const {
    int taken = 0;
    std::uint64_t call = ~std::uint64_t{0};
    for (;;) {
      const std::uint64_t w = work_.fetch_add(1, std::memory_order_acq_rel);
      const auto n = static_cast<int>(w >> 32U & 0xFFFFU);
      if (static_cast<int>(w & 0xFFFFFFFFU) >= n) return;
      if (w >> 48U != call) {
        call = w >> 48U;
        taken = 0;
      }
      task_(from_last ? n - 1 - taken : taken);
      ++taken;
      done_.fetch_add(1, std::memory_order_release);
    }
  }
  void wait() const {
    while (!stop_.load(std::memory_order_relaxed)) {
      // reading alone leaves the line in both caches
      const std::uint64_t w = work_.load(std::memory_order_relaxed);
      if ((w & 0xFFFFFFFFU) < (w >> 32U & 0xFFFFU)) help(true);
    }
  }
  // on lines of their own: each is waited for while others are written
  alignas(64) mutable std::function<void(int)> task_;
  mutable std::uint16_t calls_ = 0;
  alignas(64) mutable std::atomic<std::uint64_t> work_{0};
  alignas(64) mutable std::atomic<int> done_{0};
  alignas(64) std::atomic<bool> stop_{false};
  std::thread worker_;
};

double wall_ms() { return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// 40 passes of 16 short tasks that keep the arithmetic units busy and touch no memory: what two threads can gain at best
// here. It is little where the host runs both on one core.
template <class Executor>
void arithmetic(const Executor& executor) {
  for (int pass = 0; pass < 40; ++pass) {
    executor(16, [&](int i) {
      apso::Lanes x[10];
      for (int k = 0; k < 10; ++k) x[k] = static_cast<float>(i + k);
      for (int n = 0; n < 300; ++n) {
        for (apso::Lanes& l : x) l = l * 0.999F + 0.5F;
      }
      apso::Lanes sum = 0.0F;
      for (const apso::Lanes& l : x) sum += l;
      volatile float sink = sum.sum();
      (void)sink;
    });
  }
}

// What one call needs of time and memory, apart from its peers.
void print_resources(const pairs::PairMaker& maker, const apso::PyramidOptions& half, const apso::PyramidOptions& full, int repeats) {
  std::printf(
      "\n### Parts of the work\n\n| preset | a frame prepared for both roles [ms] | one look at all pixels [ms] | "
      "memory beside the images [MB] | two threads against one, a pair | of that, solving | plain arithmetic |\n"
      "|---|---|---|---|---|---|---|\n");
  const Pair pair = maker.make(0, 0.04, {});
  for (const bool dense : {false, true}) {
    const std::size_t before = mallinfo2().uordblks + mallinfo2().hblkhd;
    Apso a(dense ? "dense" : "default", "", dense ? full : half, dense ? apso::dense_alignment() : apso::AlignmentOptions{});
    a.camera(maker.camera());
    const auto best = [&](const auto& clock, const auto& f) {
      double least = 1e9;
      for (int i = 0; i < 10 * repeats; ++i) {  // they are short
        const double t = clock();
        f();
        least = std::min(least, clock() - t);
      }
      return least;
    };
    a.prepare_reference(pair.reference);
    a.prepare_current(pair.current);
    (void)a.solve(apso::Pose::Identity());
    const std::size_t after = mallinfo2().uordblks + mallinfo2().hblkhd;
    struct Times {
      double pair = 1e9, solve = 1e9, plain = 1e9;
    } one, two;
    const auto measure = [&](const auto& executor, Times& t) {
      t.pair = std::min(t.pair, best(wall_ms, [&] {
                          a.prepare_with(pair, executor);
                          a.solve_with(executor);
                        }));
      t.solve = std::min(t.solve, best(wall_ms, [&] { a.solve_with(executor); }));
      t.plain = std::min(t.plain, best(wall_ms, [&] { arithmetic(executor); }));
    };
    for (int i = 0; i < 4; ++i) {  // in turns; the second thread waits without sleeping and would slow the other down
      measure(apso::SerialExecutor{}, one);
      measure(TwoThreads{}, two);
    }
    const double look = best(cpu_ms, [&] { (void)a.look(pair.T_current_reference); });
    const double prepared = best(cpu_ms, [&] { a.prepare_both(pair.current); });
    std::printf("| %s | %.2f | %.2f | %.1f | %.2f | %.2f | %.2f |\n", a.name().c_str(), prepared, look,
                1e-6 * static_cast<double>(after - before), one.pair / two.pair, one.solve / two.solve, one.plain / two.plain);
  }
  std::fflush(stdout);
}

// A flat wall without texture, a blank picture without depth: nothing there to align to.
pairs::Image8 flat(int width, int height, double grey, double depth) {
  pairs::Image8 f;
  f.grey.assign(width, height, static_cast<std::uint8_t>(grey));
  f.intensity.assign(width, height, static_cast<float>(grey / 255));
  f.depth.assign(width, height, static_cast<float>(depth));
  f.probability.assign(width, height, 0.0F);
  return f;
}
void add_noise(pairs::Image8& f, std::uint64_t seed) {
  apso::testing::Random rng(seed);
  for (std::size_t i = 0; i < f.depth.size(); ++i) {
    const double n = rng.uniform() + rng.uniform() + rng.uniform() + rng.uniform() - 2;  // variance 1/3
    const double m = rng.uniform() + rng.uniform() + rng.uniform() + rng.uniform() - 2;
    f.grey.data()[i] = static_cast<std::uint8_t>(std::clamp(f.grey.data()[i] + 5.2 * n, 0.0, 255.0));
    f.intensity.data()[i] = static_cast<float>(f.grey.data()[i]) / 255.0F;
    const double z = static_cast<double>(f.depth.data()[i]);
    if (z > 0) f.depth.data()[i] = static_cast<float>(z + 1.7 * m * (0.0012 + 0.0019 * (z - 0.4) * (z - 0.4)));
  }
}

// Error with a mask over that of the same motion in the same room without bodies, beside what the covariance expects: how
// much of the loss is due to there being less to see.
void print_mask_cost(const pairs::PairMaker& maker, const apso::PyramidOptions& half, const std::vector<double>& shares, int views,
                     const std::vector<double>& motions) {
  std::printf(
      "\n### What a mask costs, pairs right with and without it\n\n| masked | error over that without bodies, geometric mean | "
      "the same expected from the covariance | pairs whose images share less than a fifth of what is not masked | "
      "too few pixels with depth (300) |\n"
      "|---|---|---|---|---|\n");
  Apso a("", "", half, apso::AlignmentOptions{}, true);
  a.camera(maker.camera());
  struct Result {
    bool right;
    double error, sigma;
    apso::AlignmentResult at_truth;
  };
  const auto solve = [&](const Pair& p) {
    a.prepare_reference(p.reference);
    a.prepare_current(p.current);
    const Outcome o = a.solve(apso::Pose::Identity());
    const apso::Pose e = apso::inverse(o.T_current_reference) * p.T_current_reference;
    const apso::Matrix6& C = a.last.covariance;
    Result r{};
    r.error = e.translation().norm();
    const Limits limits;
    r.right = 1e3 * r.error < limits.mm && apso::rotation_angle(e) < limits.degrees * kDegree && apso::succeeded(a.last.status);
    r.sigma = std::sqrt(C(0, 0) + C(1, 1) + C(2, 2));
    r.at_truth = a.look(p.T_current_reference);
    return r;
  };
  struct Row {
    double error = 0, sigma = 0;  // sums of logarithms
    int n = 0, apart = 0, nothing = 0, all = 0;
  };
  std::vector<Row> rows(shares.size());
  for (int v = 0; v < views; ++v) {
    for (const double step : motions) {
      const Result without = solve(maker.make(v, step, {}));
      for (std::size_t i = 0; i < shares.size(); ++i) {
        Conditions c;
        c.moving_share = shares[i];
        const Result with = solve(maker.make(v, step, c));
        Row& row = rows[i];
        ++row.all;
        row.apart += with.at_truth.valid_share < 0.2 ? 1 : 0;
        row.nothing += with.at_truth.counts.valid_depth < apso::kMinimumAlignedPixels ? 1 : 0;
        if (!with.right || !without.right) continue;
        ++row.n;
        row.error += std::log(with.error / without.error);
        row.sigma += std::log(with.sigma / without.sigma);
      }
    }
  }
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const Row& r = rows[i];
    char ratios[48] = "- | -";
    if (r.n > 0) std::snprintf(ratios, sizeof ratios, "%.2f | %.2f", std::exp(r.error / r.n), std::exp(r.sigma / r.n));
    std::printf("| %.0f %% | %s | %d of %d | %d of %d |\n", 100 * shares[i], ratios, r.apart, r.all, r.nothing, r.all);
  }
  std::fflush(stdout);
}

// Bodies that cover more and more of the view, with the mask of what moves, with one of which half is wrong, and with none.
// \param masked the first of the methods, taking a mask. The others know of none: what is marked has no depth for them.
// The median is that of all pairs, right or not.
void print_moving_shares(Methods& methods, Methods& masked, const pairs::PairMaker& maker, int views) {
  const std::vector<double> shares{0.10, 0.20, 0.30, 0.45, 0.60};
  const std::vector<const char*> masks{"true mask", "half of the mask wrong", "no mask"};
  // [mask][method][share]
  std::vector<std::vector<std::vector<Score>>> scores(masks.size(),
                                                      std::vector<std::vector<Score>>(methods.size(), std::vector<Score>(shares.size())));
  for (std::size_t s = 0; s < shares.size(); ++s) {
    Conditions c;
    c.moving_share = shares[s];
    for (int v = 0; v < views; ++v) {
      for (const double step : {0.01, 0.04, 0.10}) {
        Pair given = maker.make(v, step, c);
        for (std::size_t m = 0; m < masks.size(); ++m) {
          if (m == 1) {
            pairs::spoil_mask(given.reference.probability);
            pairs::spoil_mask(given.current.probability);
          }
          Pair cut = given;
          if (m < 2) {
            pairs::cut_out(cut.reference.probability, cut.reference.depth);
            pairs::cut_out(cut.current.probability, cut.current.depth);
          }
          for (std::size_t i = 0; i < methods.size(); ++i) {
            if (m < 2 && i < masked.size()) score(*masked[i], given, scores[m][i][s]);
            else score(*methods[i], cut, scores[m][i][s]);
          }
        }
      }
    }
  }
  for (std::size_t m = 0; m < masks.size(); ++m) {
    std::printf("\n### Two moving bodies, %s, 1 / 4 / 10 cm: median error of all pairs [mm], and those that are right\n\n| method |",
                masks[m]);
    for (const double share : shares) std::printf(" %.0f %% move |", 100 * share);
    std::printf("\n|---|");
    for (std::size_t s = 0; s < shares.size(); ++s) std::printf("---|");
    std::printf("\n");
    for (std::size_t i = 0; i < methods.size(); ++i) {
      std::printf("| %s |", methods[i]->name().c_str());
      for (const Score& x : scores[m][i]) std::printf(" %.2f, %d of %d |", median(x.all_mm), x.right, x.pairs);
      std::printf("\n");
    }
  }
  std::fflush(stdout);
}

void score_recording(Methods& methods, const std::string& folder, const apso::opencv::CameraModel& camera, const std::string& truth_file,
                     const std::vector<int>& steps, int count) {
  const pairs::RecordingPairs source(folder, camera, truth_file);
  for (auto& m : methods) m->camera(camera.pinhole);
  std::printf("\n### %s, median error of all pairs [mm / deg]\n\n| method |", folder.c_str());
  for (const int s : steps) std::printf(" %d frames apart |", s);
  std::printf("\n|---|");
  for (std::size_t i = 0; i < steps.size(); ++i) std::printf("---|");
  std::printf("\n");
  std::vector<std::vector<Score>> scores(methods.size(), std::vector<Score>(steps.size()));
  for (std::size_t k = 0; k < steps.size(); ++k) {
    source.each(steps[k], count, [&](const Pair& p) {
      for (std::size_t m = 0; m < methods.size(); ++m) score(*methods[m], p, scores[m][k]);
    });
  }
  for (std::size_t m = 0; m < methods.size(); ++m) {
    std::printf("| %s |", methods[m]->name().c_str());
    for (const Score& s : scores[m]) std::printf(" %.1f / %.2f |", median(s.all_mm), median(s.all_degrees));
    std::printf("\n");
  }
  std::fflush(stdout);
}
}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Direct alignment beside its peers"};
  int views = 25;
  int timed = 20;
  int repeats = 5;
  std::uint64_t seed = pairs::kReleaseSeed;
  std::vector<std::string> sets{"kinect", "disparity", "clean", "dynamic", "shares", "masked", "rest", "verdict"};
  std::vector<std::string> without;
  std::string recording, truth, camera;
  std::vector<int> steps{1, 2, 3, 5, 8};
  int max_pairs = std::numeric_limits<int>::max();
  app.add_option("--views", views, "views of each set")->check(CLI::Range(1, 1000));
  app.add_option("--timed", timed, "pairs that are timed; 0 = none")->check(CLI::Range(0, 1000));
  app.add_option("--repeats", repeats, "times each is run")->check(CLI::Range(1, 1000));
  app.add_option("--seed", seed, "of the pairs; the default is another one with each version")->capture_default_str();
  app.add_option("--sets", sets, "kinect disparity clean dynamic shares masked rest verdict parts none");
  app.add_option("--without", without, "peers to leave out: opencv open3d difodo");
  app.add_flag("--verbose", verbose, "every pair");
  app.add_option("--recording", recording, "folder of a recording in the layout of the TUM benchmark");
  app.add_option("--truth", truth, "its trajectory");
  app.add_option("--camera", camera, "of the recording: tum-fr1, tum-fr2, tum-fr3, bonn or icl-nuim");
  app.add_option("--steps", steps, "distances of the frames of a pair");
  app.add_option("--pairs", max_pairs, "maximum number of pairs per distance, evenly spaced (default: all)")->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);

  Methods methods;
  apso::PyramidOptions half;
  apso::PyramidOptions full;
  full.finest = 0;
  full.max_pixels = 0;
  methods.push_back(std::make_unique<Apso>("apso, default (320x240)", "", half, apso::AlignmentOptions{}));
  methods.push_back(std::make_unique<Apso>("apso, dense (640x480)", "", full, apso::dense_alignment()));
  const auto wanted = [&](const char* s) { return std::find(without.begin(), without.end(), s) == without.end(); };
#ifdef APSO_PEER_OPENCV
  if (wanted("opencv")) add_opencv(methods);
#endif
#ifdef APSO_PEER_OPEN3D
  if (wanted("open3d")) add_open3d(methods);
#endif
#ifdef APSO_PEER_DIFODO
  if (wanted("difodo")) add_difodo(methods);
#endif
  (void)wanted;
  const pairs::PairMaker maker(seed);
  for (auto& m : methods) m->camera(maker.camera());
  const auto has = [&](const char* s) { return std::find(sets.begin(), sets.end(), s) != sets.end(); };
  const auto run = [&](const std::string& title, Methods& who, int n, const std::vector<double>& motions, const Conditions& c,
                       const Limits& limits = {}) {
    std::vector<Score> scores(who.size());
    for (int v = 0; v < n; ++v) {
      for (const double step : motions) {
        const Pair p = maker.make(v, step, c);
        for (std::size_t i = 0; i < who.size(); ++i) score(*who[i], p, scores[i], limits);
      }
    }
    print_scores(title, who, scores);
    return scores;
  };
  const std::vector<double> all(pairs::kSteps.begin(), pairs::kSteps.end());
  const std::vector<double> four{0.01, 0.04, 0.10, 0.20};
  if (has("kinect")) run("Noise of a Kinect, 1 cm / 0.5 deg to 20 cm / 10 deg", methods, views, all, {});
  if (has("disparity")) {
    Conditions c;
    c.sensor = apso::testing::DepthSensor::Disparity;
    run("Another depth camera: rounded disparity, read at a place that errs", methods, views, all, c);
  }
  if (has("clean")) {
    Conditions c;
    c.noise = false;
    run("Without noise", methods, std::max(1, views / 3), all, c);
  }
  if (has("dynamic")) {
    Conditions c;
    c.moving_share = 0.16;
    run("Two moving bodies, no mask, 1 / 4 / 10 / 20 cm", methods, std::max(1, views), four, c);
  }
  Methods masked;
  masked.push_back(std::make_unique<Apso>("apso, default, true mask", "", half, apso::AlignmentOptions{}, true));
  masked.push_back(std::make_unique<Apso>("apso, dense, true mask", "", full, apso::dense_alignment(), true));
  for (auto& m : masked) m->camera(maker.camera());
  if (has("shares")) print_moving_shares(methods, masked, maker, std::max(1, views / 2));
  if (has("masked")) {
    for (const double share : {0.30, 0.45, 0.60}) {
      Conditions c;
      c.moving_share = share;
      char title[64];
      std::snprintf(title, sizeof title, "%.0f %% of the image moves, mask given", 100 * share);
      run(title, masked, views, four, c);
    }
    print_mask_cost(maker, half, {0.30, 0.45, 0.60}, views, four);
  }
  if (has("rest")) run("Camera at rest", methods, views, {0.0}, {});
  if (has("verdict")) {
    // pairs that no alignment can get right: different rooms, nothing to see, a bare wall
    std::vector<Score> scores(methods.size());
    Pair p;
    for (int v = 0; v < std::max(1, views); ++v) {
      const Pair a = maker.make(v, 0.04, {});
      const Pair b = maker.make(v + 500, 0.04, {});
      p.reference = a.reference;
      p.current = b.current;
      p.T_current_reference.translation() = Eigen::Vector3d(100, 0, 0);  // nothing is right
      p.step = 1;
      for (std::size_t i = 0; i < methods.size(); ++i) score(*methods[i], p, scores[i]);
      p.step = 2;
      p.reference = flat(640, 480, 120, 0);
      p.current = flat(640, 480, 120, 0);
      for (std::size_t i = 0; i < methods.size(); ++i) score(*methods[i], p, scores[i]);
      p.step = 3;
      p.reference = flat(640, 480, 120, 2.0 + 0.02 * v);
      p.current = flat(640, 480, 120, 2.0 + 0.02 * v);
      add_noise(p.reference, 2 * static_cast<std::uint64_t>(v) + 1);
      add_noise(p.current, 2 * static_cast<std::uint64_t>(v) + 2);
      for (std::size_t i = 0; i < methods.size(); ++i) score(*methods[i], p, scores[i]);
    }
    print_scores("Another room / a blank image / a bare wall: nothing is right", methods, scores);
  }
  if (!recording.empty()) {
    const apso::CameraModel model = apso::camera_by_name(camera);
    score_recording(methods, recording, model, truth.empty() ? recording + "/groundtruth.txt" : truth, steps, max_pairs);
    for (auto& m : methods) m->camera(maker.camera());
  }
  if (has("parts")) print_resources(maker, half, full, std::max(50, repeats));
  if (timed > 0) time_methods(methods, maker, timed, repeats);
  return 0;
}
