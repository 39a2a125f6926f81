// A motion policy of your own, in one file of yours: used alone, joined with one of apso's, by its name in an expression,
// and as the motion policy of the pipeline. Eigen is all this file needs.
#include <cmath>
#include <cstdio>
#include <vector>

#include <apso/motion.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/testing/synthetic.hpp>

// [policy]
// Says that what is nearer than an arm's length belongs to whoever holds the camera.
struct HandsMove {
  explicit HandsMove(float reach_) : reach(reach_) {}

  void observe(const apso::AnyFrame& frame, const apso::Pose&, const std::vector<apso::PointTrack>&, apso::DynamicMask& out) {
    auto depth = apso::rows(frame.depth(), buffer);  // any image of the caller's, row by row
    apso::set_unknown(depth.width(), depth.height(), out);
    for (int y = 0; y < depth.height(); ++y) {
      const float* z = depth(y);
      for (int x = 0; x < depth.width(); ++x) {
        if (!(z[x] > 0)) continue;  // no depth: nothing is known
        out.known(x, y) = 1;
        out.probability(x, y) = z[x] < reach ? 1.0F : 0.0F;
      }
    }
  }
  void remember(const apso::AnyFrame&, const apso::Pose&, const apso::DynamicMask&) {}  // it has no memory
  void reset() {}

  float reach;                // [m]
  std::vector<float> buffer;  // for rows that have to be converted
};
// [/policy]

namespace {
const apso::testing::SyntheticSequence& sequence() {
  static const apso::testing::SyntheticSequence walking("walking_xyz", [] {
    apso::testing::SyntheticOptions o;
    o.width = 320;
    o.height = 240;
    return o;
  }());
  return walking;
}

/// Share of the image that moves in the last of twelve frames.
template <class Policy>
double moving_share(Policy policy) {
  apso::testing::SyntheticFrame image;
  apso::DynamicMask mask;
  for (int i = 0; i < 12; ++i) {
    sequence().render(2 * i, image);
    const auto now = apso::frame(image.timestamp, image.intensity, image.depth, sequence().camera());
    policy.observe(now, image.T_world_camera, {}, mask);
    policy.remember(now, image.T_world_camera, mask);
  }
  return apso::dynamic_ratio(mask);
}
}  // namespace

int main() {
  const apso::Pinhole camera = sequence().camera();
  const float reach = 1.6F;
  const double alone = moving_share(HandsMove(reach));
  const double geometric = moving_share(apso::GeometricMotion(camera));
  // [join]
  const double either = moving_share(apso::GeometricMotion(camera) | HandsMove(reach));
  const apso::PolicyTable own{{"hands", [&] { return HandsMove(reach); }}};
  const double by_name = moving_share(apso::motion_by_name("geometric | hands", camera, {}, own));
  // [/join]

  // [pipeline]
  apso::BasicPipeline<apso::Pose, HandsMove> pipeline(camera, HandsMove(reach));
  // [/pipeline]
  apso::testing::SyntheticFrame image;
  sequence().render(22, image);
  const double inside = pipeline.observe(image.rgbd(), image.T_world_camera).dynamic_ratio;

  std::printf("alone %.4f, geometric %.4f, either %.4f, by name %.4f, in the pipeline %.4f\n", alone, geometric, either, by_name, inside);
  const bool joined = either >= alone && either >= geometric && either < alone + geometric + 1e-9;
  return alone > 0 && geometric > 0 && joined && by_name == either && std::abs(inside - alone) < 1e-12 ? 0 : 1;
}
