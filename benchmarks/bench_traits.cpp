// What it costs to bring your own image type: the same pixels through the library's own view, through types of others that offer
// rows, and through types that are read pixel by pixel. The first is what the ratios are to.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include <benchmark/benchmark.h>

#include <apso/io/camera_model.hpp>
#include <apso/opencv/adapters.hpp>
#include <apso/pipeline/working_copy.hpp>
#include <apso/refinement/align.hpp>
#include <apso/traits/byte_image.hpp>
#include <apso/traits/eigen_image.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/rectifier.hpp>

#include "../examples/integrate/types/recipes.hpp"
#include "../tests/refinement/room.hpp"

// A user's image without row(), so that at() is measured.
struct AtImage {
  int w = 0, h = 0;
  std::vector<std::uint16_t> pixels;
};
template <>
struct apso::image_traits<AtImage> {
  using value_type = std::uint16_t;
  static int width(const AtImage& m) { return m.w; }
  static int height(const AtImage& m) { return m.h; }
  static value_type at(const AtImage& m, int x, int y) { return m.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(m.w) + static_cast<std::size_t>(x)]; }
};

namespace {
using EigenRows = Eigen::Array<std::uint16_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// The depth of a room in millimetres, twice, in every type.
struct Pixels {
  host::VectorImage rows;
  AtImage at;
  cv::Mat_<std::uint16_t> mat;
  EigenRows eigen;
  std::vector<std::uint8_t> bytes;
  [[nodiscard]] apso::ImageView<const std::uint16_t> view() const { return {rows.pixels.data(), rows.cols, rows.rows}; }
  [[nodiscard]] apso::ByteImage<std::uint16_t> buffer() const {
    return apso::byte_image<std::uint16_t>(bytes.data(), bytes.size(), rows.cols, rows.rows, 2 * static_cast<std::size_t>(rows.cols));
  }
  explicit Pixels(const apso::Image<float>& metres) {
    const int w = metres.width(), h = metres.height();
    rows = {w, h, {}};
    for (std::size_t i = 0; i < metres.size(); ++i) rows.pixels.push_back(static_cast<std::uint16_t>(1000 * metres.data()[i] + 0.5F));
    at = {w, h, rows.pixels};
    mat = cv::Mat_<std::uint16_t>(h, w, rows.pixels.data()).clone();
    eigen = Eigen::Map<EigenRows>(rows.pixels.data(), h, w);
    bytes.resize(2 * rows.pixels.size());
    std::memcpy(bytes.data(), rows.pixels.data(), bytes.size());
  }
};
struct Scene {
  apso::Pinhole camera = room::camera(640);
  apso::Pose truth = room::pose(.03, -.01, .02, .7, -1.2, .3);
  room::Frame reference = room::render(camera, apso::Pose::Identity(), {}, 1);
  room::Frame current = room::render(camera, truth, {}, 2);
  Pixels reference_depth{reference.depth};
  Pixels current_depth{current.depth};
};
const Scene& scene() {
  static const Scene s;
  return s;
}

template <class Get>
void copy_to_float(benchmark::State& state, Get get) {
  const auto& image = get(scene().reference_depth);
  apso::Image<float> expected, out;
  apso::copy_to_float(scene().reference_depth.view(), 0.001, expected);
  for (auto _ : state) {
    apso::copy_to_float(image, 0.001, out);
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
  if (std::memcmp(out.data(), expected.data(), out.size() * sizeof(float)) != 0) state.SkipWithError("another result than the view");
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(out.size()));
}

template <class Get>
void align(benchmark::State& state, Get get) {
  const Scene& s = scene();
  apso::PairOptions o;
  o.depth_unit = 0.001;
  const auto run = [&](const auto& a, const auto& b) {
    return apso::align(s.reference.intensity.view(), a, s.current.intensity.view(), b, s.camera, apso::Pose::Identity(), o);
  };
  const apso::PairAlignment expected = run(s.reference_depth.view(), s.current_depth.view());
  const auto& a = get(s.reference_depth);
  const auto& b = get(s.current_depth);
  apso::PairAlignment result;
  for (auto _ : state) {
    result = run(a, b);
    benchmark::DoNotOptimize(result);
  }
  if (result.T_current_reference.matrix() != expected.T_current_reference.matrix()) state.SkipWithError("another result than the view");
}

const auto view = [](const Pixels& p) { return p.view(); };
const auto user_rows = [](const Pixels& p) -> const auto& { return p.rows; };
const auto user_at = [](const Pixels& p) -> const auto& { return p.at; };
const auto cv_mat = [](const Pixels& p) -> const auto& { return p.mat; };
const auto eigen_rows = [](const Pixels& p) -> const auto& { return p.eigen; };
const auto bytes = [](const Pixels& p) { return p.buffer(); };

// The one copy of a frame that the pipeline takes.
template <class Get>
void working_copy(benchmark::State& state, Get get) {
  const Scene& s = scene();
  const auto& depth = get(s);
  const auto frame = apso::frame(0.0, s.reference.intensity, depth, s.camera);
  apso::detail::WorkingCopy work;
  for (auto _ : state) {
    work.take(frame, s.camera.width, s.camera.height);
    benchmark::DoNotOptimize(work.frame());
    benchmark::ClobberMemory();
  }
}
const auto native_depth = [](const Scene& s) -> const auto& { return s.reference.depth; };
const auto raw_depth = [](const Scene& s) { return apso::scaled(s.reference_depth.view(), 0.001F); };

void rectify_intensity(benchmark::State& state) {
  const apso::Rectifier rectifier(apso::camera_by_name("tum-fr1"), 640, 480);
  apso::Image<float> out;
  for (auto _ : state) {
    rectifier.intensity(scene().reference.intensity, out);
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
}
void rectify_depth(benchmark::State& state) {
  const apso::Rectifier rectifier(apso::camera_by_name("tum-fr1"), 640, 480);
  apso::Image<float> out;
  for (auto _ : state) {
    rectifier.depth(apso::scaled(scene().reference_depth.view(), 0.001F), out);
    benchmark::DoNotOptimize(out.data());
    benchmark::ClobberMemory();
  }
}

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

BENCHMARK_CAPTURE(copy_to_float, view, view)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(copy_to_float, user_rows, user_rows)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(copy_to_float, cv_mat, cv_mat)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(copy_to_float, eigen_rows, eigen_rows)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(copy_to_float, user_at, user_at)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(copy_to_float, bytes, bytes)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(align, view, view)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, user_rows, user_rows)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, cv_mat, cv_mat)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, eigen_rows, eigen_rows)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, user_at, user_at)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(align, bytes, bytes)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(working_copy, native_depth, native_depth)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(working_copy, raw_depth, raw_depth)->Unit(benchmark::kMicrosecond);
BENCHMARK(rectify_intensity)->Unit(benchmark::kMicrosecond);
BENCHMARK(rectify_depth)->Unit(benchmark::kMicrosecond);
BENCHMARK_TEMPLATE(pose_round_trip, apso::Pose);
BENCHMARK_TEMPLATE(pose_round_trip, Eigen::Isometry3f);
BENCHMARK_TEMPLATE(pose_round_trip, host::QuaternionPose);
BENCHMARK_TEMPLATE(pose_round_trip, cv::Affine3d);
