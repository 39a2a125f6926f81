// What it costs to bring your own image type: the depth of the same frames as the library's own view of float metres, and in
// types of others. The first is what the ratios are to: foreign rows of float within 3 %, raw 16 bit within 5 %.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <benchmark/benchmark.h>

#include <apso/align.hpp>
#include <apso/io/camera_model.hpp>
#include <apso/opencv/adapters.hpp>
#include <apso/pipeline/working_copy.hpp>
#include <apso/traits/images/byte_image.hpp>
#include <apso/traits/images/eigen_image.hpp>
#include <apso/traits/images/rectifier.hpp>

#include "../examples/integrate/types/recipes.hpp"
#include "../tests/foreign_types.hpp"
#include "../tests/refinement/room.hpp"
#include "counters.hpp"

namespace {
using EigenRows = Eigen::Array<std::uint16_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
constexpr float kMillimetre = 0.001F;

// The depth of a room in whole millimetres, in every type.
struct DepthTypes {
  foreign::PaddedU16 padded;
  apso::Image<float> metres;  // native
  foreign::FloatMillimetres millimetres;
  foreign::XyzCloud cloud;
  host::NestedImage nested;
  host::VectorImage vector;
  cv::Mat_<std::uint16_t> mat;
  EigenRows eigen;
  std::vector<std::uint8_t> bytes;
  explicit DepthTypes(const apso::Image<float>& z)
      : padded(foreign::padded_u16(z, kMillimetre)),
        metres(foreign::native(padded, kMillimetre)),
        millimetres(foreign::float_millimetres(metres)),
        cloud(foreign::xyz_cloud(metres, 525, 320, 240)) {
    const int w = metres.width(), h = metres.height();
    vector = {w, h, {}};
    for (int y = 0; y < h; ++y) {
      nested.emplace_back(metres.row(y), metres.row(y) + w);
      vector.pixels.insert(vector.pixels.end(), padded.line(y), padded.line(y) + w);
    }
    mat = cv::Mat_<std::uint16_t>(h, w, vector.pixels.data()).clone();
    eigen = Eigen::Map<EigenRows>(vector.pixels.data(), h, w);
    bytes.resize(2 * vector.pixels.size());
    std::memcpy(bytes.data(), vector.pixels.data(), bytes.size());
  }
};
struct Scene {
  apso::Pinhole camera = room::camera(640);
  apso::Pose truth = room::pose(.03, -.01, .02, .7, -1.2, .3);
  room::Frame reference = room::render(camera, apso::Pose::Identity(), {}, 1);
  room::Frame current = room::render(camera, truth, {}, 2);
  DepthTypes reference_depth{reference.depth};
  DepthTypes current_depth{current.depth};
};
const Scene& scene() {
  static const Scene s;
  return s;
}

// Reading alone: all rows, once.
template <class Get>
void read(benchmark::State& state, Get get) {
  const auto& image = get(scene().current_depth);
  std::vector<float> buffer;
  const int height = scene().camera.height;
  for (auto _ : state) {
    auto row = apso::rows(image, buffer);
    for (int y = 0; y < height; ++y) {
      const float* z = row(y);
      benchmark::DoNotOptimize(z);
      benchmark::ClobberMemory();
    }
  }
}

// Reading, in what has to be done anyway: the pyramid of the current frame.
template <class Get>
void pyramid(benchmark::State& state, Get get) {
  const Scene& s = scene();
  const auto& depth = get(s.current_depth);
  const auto frame = apso::frame(0, s.current.intensity, depth, s.camera);
  apso::FramePyramid p;
  for (auto _ : state) {
    p.build(frame, s.camera, {}, {}, apso::PyramidRole::Current);
    benchmark::ClobberMemory();
  }
  count_pixels(state, s.camera.width, s.camera.height);
}

template <class Get>
void align(benchmark::State& state, Get get) {
  const Scene& s = scene();
  const auto run = [&](const auto& a, const auto& b) {
    return apso::align(apso::frame(0, s.reference.intensity, a, s.camera), apso::frame(1, s.current.intensity, b, s.camera));
  };
  const apso::PairAlignment<> expected = run(s.reference_depth.metres, s.current_depth.metres);
  const auto& a = get(s.reference_depth);
  const auto& b = get(s.current_depth);
  apso::PairAlignment<> result;
  for (auto _ : state) {
    result = run(a, b);
    benchmark::DoNotOptimize(result);
  }
  count_pixels(state, s.camera.width, s.camera.height);
  state.counters["iterations"] = result.detail.iterations;
  state.counters["error_mm"] = 1e3 * (result.T_current_reference.translation() - apso::inverse(s.truth).translation()).norm();
  // float millimetres are rounded twice
  if ((result.T_current_reference.matrix() - expected.T_current_reference.matrix()).norm() > 1e-4) {
    state.SkipWithError("another result than the library's own type");
  }
}

// The one copy of a frame that the pipeline takes.
template <class Get>
void working_copy(benchmark::State& state, Get get) {
  const Scene& s = scene();
  const auto& depth = get(s.reference_depth);
  const auto frame = apso::frame(0.0, s.reference.intensity, depth, s.camera);
  apso::detail::WorkingCopy work;
  for (auto _ : state) {
    work.take(frame, s.camera.width, s.camera.height);
    benchmark::DoNotOptimize(work.frame());
    benchmark::ClobberMemory();
  }
  count_pixels(state, s.camera.width, s.camera.height);
}

void rectify_intensity(benchmark::State& state) {
  const apso::Rectifier rectifier(apso::camera_by_name("tum-fr1"), 640, 480);
  apso::Image<float> out;
  for (auto _ : state) {
    rectifier.intensity(scene().reference.intensity, out);
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
  count_pixels(state, 640, 480);
}
void rectify_depth(benchmark::State& state) {
  const apso::Rectifier rectifier(apso::camera_by_name("tum-fr1"), 640, 480);
  apso::Image<float> out;
  for (auto _ : state) {
    rectifier.depth(apso::scaled(scene().reference_depth.padded, kMillimetre), out);
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
  count_pixels(state, 640, 480);
}

const auto own_float = [](const DepthTypes& d) -> const auto& { return d.metres; };
const auto float_rows = [](const DepthTypes& d) -> const auto& { return d.nested; };
const auto float_millimetres = [](const DepthTypes& d) { return apso::scaled(d.millimetres, kMillimetre); };
const auto raw_16_bit = [](const DepthTypes& d) { return apso::scaled(d.padded, kMillimetre); };
const auto vector_16_bit = [](const DepthTypes& d) { return apso::scaled(d.vector, kMillimetre); };
const auto cv_mat = [](const DepthTypes& d) { return apso::scaled(d.mat, kMillimetre); };
const auto eigen_rows = [](const DepthTypes& d) { return apso::scaled(d.eigen, kMillimetre); };
const auto cloud = [](const DepthTypes& d) -> const auto& { return d.cloud; };
const auto bytes = [](const DepthTypes& d) {
  const std::size_t step = 2 * static_cast<std::size_t>(d.vector.cols);
  return apso::scaled(apso::byte_image<std::uint16_t>(d.bytes.data(), d.bytes.size(), d.vector.cols, d.vector.rows, step), kMillimetre);
};

// The pose conversions, to show that they vanish beside everything else.
template <class PoseT>
void pose_round_trip(benchmark::State& state) {
  apso::Pose T = scene().truth;
  for (auto _ : state) {
    benchmark::DoNotOptimize(T);
    const PoseT theirs = apso::from_pose<PoseT>(T);
    benchmark::DoNotOptimize(theirs);
    T = apso::to_pose(theirs);
  }
}
}  // namespace

#define APSO_BENCH_TYPE(type)                  \
  BENCHMARK_CAPTURE(read, type, type);         \
  BENCHMARK_CAPTURE(pyramid, type, type);      \
  BENCHMARK_CAPTURE(working_copy, type, type); \
  BENCHMARK_CAPTURE(align, type, type)
APSO_BENCH_TYPE(own_float);
APSO_BENCH_TYPE(float_rows);
APSO_BENCH_TYPE(float_millimetres);
APSO_BENCH_TYPE(raw_16_bit);
APSO_BENCH_TYPE(vector_16_bit);
APSO_BENCH_TYPE(cv_mat);
APSO_BENCH_TYPE(eigen_rows);
APSO_BENCH_TYPE(cloud);
APSO_BENCH_TYPE(bytes);
BENCHMARK(rectify_intensity);
BENCHMARK(rectify_depth);
BENCHMARK_TEMPLATE(pose_round_trip, apso::Pose);
BENCHMARK_TEMPLATE(pose_round_trip, Eigen::Isometry3f);
BENCHMARK_TEMPLATE(pose_round_trip, host::QuaternionPose);
BENCHMARK_TEMPLATE(pose_round_trip, foreign::DualQuaternionPose);
BENCHMARK_TEMPLATE(pose_round_trip, cv::Affine3d);
