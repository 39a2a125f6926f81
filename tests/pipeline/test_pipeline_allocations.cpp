// The pipeline copies a frame once, into memory that it keeps: foreign images cost no allocation of the size of an image.
#include <cstddef>
#include <cstdlib>
#include <vector>

#include <doctest/doctest.h>

#include <apso/pipeline/pipeline.hpp>
#include <apso/testing/synthetic.hpp>
#include <apso/traits/frame.hpp>

#include "../counting_allocator.hpp"
#include "../foreign_types.hpp"

using namespace apso;

namespace {
constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr std::size_t kImage = kWidth * kHeight;  // bytes of the smallest image of this size

// What f() allocates in pieces of the size of an image.
template <class F>
counting::Allocations images(F&& f) {
  counting::large = kImage;
  return counting::count(f);
}
testing::SyntheticSequence sequence() {
  testing::SyntheticOptions o;
  o.width = kWidth;
  o.height = kHeight;
  return testing::SyntheticSequence("static_xyz", o);
}
}  // namespace

TEST_CASE("the working copy is two images of float, made once") {
  const testing::SyntheticSequence s = sequence();
  testing::SyntheticFrame image;
  s.render(0, image);
  const foreign::AtOnly grey = foreign::at_only(image.intensity);
  const foreign::PaddedU16 raw = foreign::padded_u16(image.depth, 1 / 5000.0F);
  const auto now = frame(0, grey, scaled(raw, 1 / 5000.0F), s.camera());
  detail::WorkingCopy work;
  const counting::Allocations first = images([&] { work.take(now, kWidth, kHeight); });
  CHECK(first.large_number == 2);
  CHECK(first.large_bytes == 2 * sizeof(float) * kImage);
  CHECK(images([&] { work.take(now, kWidth, kHeight); }).large_number == 0);
}

TEST_CASE("a pipeline that is warm allocates no image, whatever the types of the host") {
  bool every = false;
  SUBCASE("every frame is refined, and each is the reference of the next") { every = true; }
  SUBCASE("BAD frames are refined and not remembered") { every = false; }
  const testing::SyntheticSequence s = sequence();
  PipelineOptions options;
  options.assessor.initialisation.frames = 5;
  options.refine = every ? RefinedFrames::Every : RefinedFrames::BadOnly;
  if (every) options.refiner.memory.capacity = 3;  // soon full
  BasicPipeline<foreign::DualQuaternionPose> pipeline(s.camera(), options);
  testing::SyntheticFrame image;
  std::vector<Keypoint> keypoints;
  for (int y = 5; y < kHeight; y += 10) {
    for (int x = 5; x < kWidth; x += 10) keypoints.push_back({static_cast<float>(x), static_cast<float>(y), 30, 0, 0});
  }
  const std::vector<foreign::Corner> good = foreign::corners(keypoints);
  for (Keypoint& k : keypoints) k.response = 0;
  const std::vector<foreign::Corner> weak = foreign::corners(keypoints);
  bool refined = false;
  const int warm = every ? 90 : 30;
  for (int i = 0; i < warm + 10; ++i) {
    // References keep as many pixels as their frame has selected: the same few frames there and back, so that no new size comes.
    s.render(every ? std::abs(i % 8 - 4) : i, image);
    image.timestamp = i / 30.0;
    const foreign::AtOnly grey = foreign::at_only(image.intensity);
    const foreign::PaddedU16 raw = foreign::padded_u16(image.depth, 1 / 5000.0F);
    const auto T = from_pose<foreign::DualQuaternionPose>(image.T_world_camera);
    const bool bad = i % 10 >= 8;  // some frames are BAD, so that each module has met its work before
    const counting::Allocations frame_costs = images([&] {
      pipeline.observe(frame(image.timestamp, grey, scaled(raw, 1 / 5000.0F), s.camera()), T);
      pipeline.assess(bad ? weak : good, none, {T, T, true});
      pipeline.conclude();
    });
    refined = refined || pipeline.report().refined;
    // the memory of references grows until it is full: it keeps pixels, not images of the host
    const bool remembered = pipeline.report().keyframe_allowed;
    if (i >= warm && (every || !remembered)) CHECK(frame_costs.large_number == 0);
  }
  CHECK(refined);
}
