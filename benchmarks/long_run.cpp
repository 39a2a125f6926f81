// long_run: the whole method on one camera for hours. Tells the memory after the warm-up and at the end, and a hash of all results,
// which must be the same on any number of threads. scripts/long_run.sh compares threads and ways to compile.

#include <malloc.h>
#include <unistd.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <fstream>
#include <vector>

#include <CLI/CLI.hpp>
#include <opencv2/core.hpp>

#include <apso/opencv/feature_tracker.hpp>
#include <apso/opencv/parallel.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/testing/synthetic.hpp>

namespace {

constexpr double rate = 30;  // [Hz]

/// The bits of everything that comes out, as one number (FNV-1a).
class Hash {
 public:
  template <class T>
  void add(const T& value) {
    unsigned char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    for (const unsigned char b : bytes) value_ = (value_ ^ b) * 0x100000001b3ULL;
  }
  void add(const apso::Pose& T) {
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) add(T(row, column));
    }
  }
  [[nodiscard]] unsigned long long value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ULL;
};

/// Some seconds of a recording in memory, played forth and back without end.
class Loop {
 public:
  Loop(const char* name, const apso::testing::SyntheticOptions& options) : sequence_(name, options) {
    apso::testing::SyntheticFrame frame;
    for (int i = 0; i < sequence_.size(); ++i) {
      sequence_.render(i, frame);
      depth_.push_back(frame.depth);
      grey_.emplace_back(frame.depth.height(), frame.depth.width());
      for (int y = 0; y < frame.depth.height(); ++y) {
        for (int x = 0; x < frame.depth.width(); ++x) grey_.back()(y, x) = static_cast<uchar>(frame.intensity(x, y) * 255 + 0.5F);
      }
    }
  }
  [[nodiscard]] const apso::Pinhole& camera() const { return sequence_.camera(); }
  [[nodiscard]] const cv::Mat_<uchar>& grey(int i) const { return grey_[number(i)]; }
  [[nodiscard]] const apso::Image<float>& depth(int i) const { return depth_[number(i)]; }

 private:
  [[nodiscard]] std::size_t number(int i) const {
    const int turn = sequence_.size() - 1;
    const int k = i % (2 * turn);
    return static_cast<std::size_t>(k < turn ? k : 2 * turn - k);
  }
  apso::testing::SyntheticSequence sequence_;
  std::vector<cv::Mat_<uchar>> grey_;
  std::vector<apso::Image<float>> depth_;
};

struct Memory {
  double resident = 0;   ///< pages of the process in memory [MB]
  double allocated = 0;  ///< what the program asked for and did not give back [MB]
};

Memory memory() {
  long pages = 0;
  long resident = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident;
  const struct mallinfo2 heap = ::mallinfo2();
  return {static_cast<double>(resident * ::sysconf(_SC_PAGESIZE)) / 1e6, static_cast<double>(heap.uordblks + heap.hblkhd) / 1e6};
}

int run(const apso::testing::SyntheticOptions& options, int frames, int warm_up, int threads) {
  const Loop loop("walking_xyz", options);
  cv::setNumThreads(threads);
  apso::opencv::FeatureTracker tracker(loop.camera());
  apso::Pipeline pipeline(loop.camera());
  Hash hash;
  Memory warm;
  Memory end;
  int good = 0;
  int lost = 0;
  auto since = std::chrono::steady_clock::now();
  const auto ms_per_frame = [&since](int n) {
    const auto now = std::chrono::steady_clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - since).count() / n;
    since = now;
    return ms;
  };
  std::printf("frame,resident_MB,allocated_MB,ms_per_frame,keyframes,landmarks,hash\n");
  for (int i = 0; i < frames; ++i) {
    const auto now = apso::frame(i / rate, loop.grey(i), loop.depth(i), loop.camera());
    tracker.begin(loop.grey(i), now);
    const auto prior = tracker.estimate(pipeline.observation().mask.probability);
    const apso::Observation& seen = pipeline.observe(now, prior.T_world_camera, tracker.tracks());
    const auto pose = tracker.estimate(seen.mask.probability);
    pipeline.assess(tracker.keypoints(), tracker.tracks(), {pose.T_world_camera, pose.T_world_predicted, pose.ok, pose.information});
    const apso::FrameReport& report = pipeline.conclude(apso::opencv::ParallelExecutor{});
    tracker.commit(report.T_world_camera, seen.mask.probability, report.keyframe_allowed);

    hash.add(report.T_world_camera);
    hash.add(report.T_world_feature);
    hash.add(report.assessment.S_final ? report.assessment.S_final->value() : -1.0);
    hash.add(static_cast<int>(report.state));
    hash.add(seen.dynamic_ratio);
    hash.add(tracker.landmarks());
    good += report.state == apso::SceneState::Good ? 1 : 0;
    lost += report.state == apso::SceneState::Lost ? 1 : 0;
    if (i + 1 == warm_up || i + 1 == frames || (i + 1) % 2000 == 0) {
      end = memory();
      if (i < warm_up) warm = end;
      const int n = (i + 1) % 2000 == 0 ? 2000 : (i + 1) % 2000;
      std::printf("%d,%.3f,%.3f,%.2f,%d,%d,%016llx\n", i + 1, end.resident, end.allocated, ms_per_frame(n), tracker.keyframes(),
                  tracker.landmarks(), hash.value());
      std::fflush(stdout);
    }
  }
  const double growth = 100 * (end.resident / warm.resident - 1);
  std::printf("%d frames of %d x %d, %d threads: %d GOOD, %d lost; memory %.3f MB after %d frames, %+.2f %% at the end; hash %016llx\n",
              frames, options.width, options.height, threads, good, lost, warm.resident, warm_up, growth, hash.value());
  return growth < 1 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  apso::testing::SyntheticOptions options;
  options.width = 160;
  options.height = 120;
  int frames = 20000;
  int warm_up = 2000;
  int threads = 1;
  CLI::App app{"The whole method for many frames: memory, time and a hash of all results. Exit code 1: the memory grew by 1 % or more."};
  app.add_option("--frames", frames, "how many are processed")->check(CLI::Range(2, 100000000))->capture_default_str();
  app.add_option("--warm-up", warm_up, "frames after which the memory may not grow")->check(CLI::Range(1, 1000000))->capture_default_str();
  app.add_option("--threads", threads, "of the image operations and the refinement")->check(CLI::Range(1, 256))->capture_default_str();
  app.add_option("--width", options.width, "of the images")->check(CLI::Range(64, 4096))->capture_default_str();
  app.add_option("--height", options.height, "of the images")->check(CLI::Range(48, 4096))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  if (warm_up >= frames) {
    std::fprintf(stderr, "long_run: --warm-up %d: expected less than --frames %d\n", warm_up, frames);
    return 2;
  }
  try {
    return run(options, frames, warm_up, threads);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "long_run: %s\n", e.what());
    return 1;
  }
}
