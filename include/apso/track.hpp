/// \file
/// Front door: the whole method. A small feature tracker gives a first pose, the pipeline says what moves, whether the frame
/// can be trusted, and refines its pose.
///
/// \code
/// #include <apso/track.hpp>
///
/// apso::LandmarkTracker tracker(camera);     // apso::Pinhole: fx, fy, cx, cy, width, height
/// apso::Pipeline pipeline(camera);
/// for (...) {
///   const auto now = apso::frame(timestamp, grey, apso::scaled(depth, 1 / 5000.F), camera);
///   tracker.begin(now, keypoints, descriptors, tracks);                              // yours
///   const auto prior = tracker.estimate(pipeline.observation().mask.probability);    // with what moved last
///   const auto& seen = pipeline.observe(now, prior.T_world_camera, tracks);          // 1. what moves?
///   const auto pose = tracker.estimate(seen.mask.probability);                       //    a pose without it
///   pipeline.assess(keypoints, tracks,                                               // 2. can it be trusted?
///                   {pose.T_world_camera, pose.T_world_predicted, pose.ok, pose.information, pose.confirmed_matches()});
///   const auto& report = pipeline.conclude();                                        // 3. the refined pose
///   tracker.commit(report.T_world_camera, seen.mask.probability, report.keyframe_allowed);
///   use(report.T_world_camera);   // report.state: Good, Bad, Lost (then the pose is only a prediction), Initialising
/// }
/// \endcode
///
/// What is yours, and of which type it may be:
///
/// | argument    | type                                                                                        |
/// |-------------|---------------------------------------------------------------------------------------------|
/// | grey        | any image; 8 bit, 16 bit, or float in [0,1]                                                 |
/// | depth       | any image in metres, registered to grey; integers say their unit: scaled(depth, 0.001F)     |
/// | keypoints   | any range of corners, e.g. std::vector<cv::KeyPoint>                                        |
/// | descriptors | 32 bytes for each: an image of bytes with 32 columns, or a range of apso::Descriptor        |
/// | tracks      | any range of points followed from the previous frame; apso::none if you have none           |
/// | poses       | apso::BasicLandmarkTracker<MyPose> and apso::BasicPipeline<MyPose> take and give MyPose     |
///
/// With OpenCV, apso/opencv/feature_tracker.hpp finds keypoints, descriptors and tracks in a grey image:
/// examples/minimal_tracker.cpp is a program from a folder of images to a trajectory. If you have a SLAM system already, keep
/// its tracker and use apso/pipeline/pipeline.hpp alone.
///
/// A camera that is lost waits until it sees what the map knows. A program that can deal with a map of several parts calls
/// tracker.reconnect() after commit(), see docs/tracker.md.
///
/// Poses are T_world_camera: they map points of the camera (x right, y down, z forward [m]) into the world, which is the camera
/// of the first frame. Nothing given is referred to after a call has returned. Results are deterministic.
#pragma once

#include <apso/pipeline/pipeline.hpp>
#include <apso/tracker/landmark_tracker.hpp>
#include <apso/traits/frame.hpp>
#include <apso/traits/images/byte_image.hpp>
#include <apso/traits/images/eigen_image.hpp>
#include <apso/traits/images/rows.hpp>
