// The whole method with Eigen alone. Two people walk through a synthetic room; its features come without a detector.
#include <cstdio>

#include <apso/testing/synthetic_features.hpp>
#include <apso/track.hpp>

int main() {
  const apso::testing::SyntheticSequence room("walking_xyz");
  const apso::Pinhole camera = room.camera();
  apso::testing::SyntheticFeatures found(camera);  // in place of your corner detector
  apso::testing::SyntheticFrame image;             // in place of your sensor
  // [track]
  apso::LandmarkTracker tracker(camera);
  apso::Pipeline pipeline(camera);
  for (int i = 0; i < 20; ++i) {
    room.render(i, image);
    found.find(image);
    const auto now = apso::frame(image.timestamp, image.intensity, image.depth, camera);
    tracker.begin(now, found.keypoints(), found.descriptors(), found.tracks());
    const auto prior = tracker.estimate(pipeline.observation().mask.probability);
    const auto& seen = pipeline.observe(now, prior.T_world_camera, found.tracks());
    const auto pose = tracker.estimate(seen.mask.probability);
    pipeline.assess(found.keypoints(), found.tracks(),
                    {pose.T_world_camera, pose.T_world_predicted, pose.ok, pose.information, pose.confirmed_matches()});
    const auto& report = pipeline.conclude();
    tracker.commit(report.T_world_camera, seen.mask.probability, report.keyframe_allowed);
    const double error =
        (report.T_world_camera.translation() - (room.T_world_camera(0).inverse() * room.T_world_camera(i)).translation()).norm();
    std::printf("%2d: %s, %zu objects, error %.4f m\n", i, to_string(report.state), seen.objects.size(), error);
    if (error > 0.02) return 1;
  }
  // [/track]
}
