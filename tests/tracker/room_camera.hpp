// A camera in a synthetic room whose features are followed by a tracker that is right: one frame after another.
#pragma once

#include <doctest/doctest.h>

#include <apso/testing/synthetic_features.hpp>
#include <apso/track.hpp>

/// Sees frame i of a room, and commits the pose that is found. \return that
template <class PoseT>
PoseT track_frame(int i, const apso::testing::SyntheticSequence& room, apso::testing::SyntheticFeatures& found,
                  apso::testing::SyntheticFrame& image, apso::BasicLandmarkTracker<PoseT>& tracker) {
  room.render(i, image);
  found.find(image);
  tracker.begin(image.rgbd(), found.keypoints(), found.descriptors(), apso::none);
  const apso::BasicFeatureResult<PoseT> pose = tracker.estimate();
  REQUIRE(pose.ok);
  tracker.commit(pose.T_world_camera, apso::none, true);
  return pose.T_world_camera;
}
