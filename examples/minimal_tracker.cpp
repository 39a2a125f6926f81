// The whole method in one file, to copy and begin with: from a folder in TUM format to a trajectory.
//
//   minimal_tracker FOLDER CAMERA TRAJECTORY      e.g. minimal_tracker fr3_walking_xyz tum-fr3 trajectory.txt
//
// FOLDER holds rgb.txt and depth.txt, or associations.txt. CAMERA is tum-fr1, tum-fr2, tum-fr3, bonn or icl-nuim, or numbers without
// distortion: fx,fy,cx,cy,depth units per metre, and if it is known the deviation of an inverse depth [1/m]. TRAJECTORY is written:
// timestamp tx ty tz qx qy qz qw.
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/evaluation/association.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/opencv/cameras.hpp>
#include <apso/opencv/feature_tracker.hpp>
#include <apso/track.hpp>

namespace {

struct Images {
  double timestamp;
  std::string colour;
  std::string depth;
};

// Colour images with the depth images nearest in time, or as associations.txt pairs them.
std::vector<Images> list_images(const std::string& folder) {
  std::vector<Images> list;
  if (std::ifstream(folder + "/associations.txt")) {
    for (const apso::ImageAssociation& a : apso::read_associations(folder + "/associations.txt"))
      list.push_back({a.rgb_timestamp, folder + "/" + a.rgb_file, folder + "/" + a.depth_file});
    return list;
  }
  const auto colour = apso::read_file_list(folder + "/rgb.txt");
  const auto depth = apso::read_file_list(folder + "/depth.txt");
  std::vector<double> colour_stamps, depth_stamps;
  for (const apso::FileListEntry& e : colour) colour_stamps.push_back(e.timestamp);
  for (const apso::FileListEntry& e : depth) depth_stamps.push_back(e.timestamp);
  for (const apso::StampMatch& m : apso::associate_tum(colour_stamps, depth_stamps, 0.02))
    list.push_back({colour[m.first].timestamp, folder + "/" + colour[m.first].file, folder + "/" + depth[m.second].file});
  return list;
}

apso::CameraModel read_camera(const std::string& text, const cv::Size& size) {
  apso::CameraModel camera;
  apso::Pinhole& p = camera.pinhole;
  double& sigma = camera.inverse_depth_sigma;
  if (std::sscanf(text.c_str(), "%lf,%lf,%lf,%lf,%lf,%lf", &p.fx, &p.fy, &p.cx, &p.cy, &camera.depth_scale, &sigma) < 5)
    return apso::camera_by_name(text);
  p.width = size.width;
  p.height = size.height;
  return camera;
}

void run(const std::string& folder, const std::string& camera_text, const std::string& output) {
  const std::vector<Images> images = list_images(folder);
  if (images.empty()) throw apso::io_error(folder + ": no colour image has a depth image within 0.02 s");
  const apso::CameraModel model = read_camera(camera_text, cv::imread(images.front().colour).size());
  const apso::opencv::Rectifier rectifier(model);
  apso::Trajectory poses;
  cv::Mat colour, grey_mat, depth_mat;

  // [tracker]
  const apso::Pinhole camera = model.pinhole;
  const auto metres = static_cast<float>(1 / model.depth_scale);
  apso::opencv::FeatureTrackerOptions options;
  options.inverse_depth_sigma = model.inverse_depth_sigma;
  apso::opencv::FeatureTracker tracker(camera, options);  // ORB features, Lucas-Kanade tracks, a local map
  apso::PipelineOptions settings;
  apso::take_depth_noise(model.inverse_depth_sigma, settings.refiner);
  apso::Pipeline pipeline(camera, settings);
  for (const Images& i : images) {
    rectifier.colour(cv::imread(i.colour), colour);
    rectifier.depth(cv::imread(i.depth, cv::IMREAD_UNCHANGED), depth_mat);
    cv::cvtColor(colour, grey_mat, cv::COLOR_BGR2GRAY);
    const cv::Mat_<uchar> grey = grey_mat;
    const cv::Mat_<std::uint16_t> depth = depth_mat;
    const auto now = apso::frame(i.timestamp, grey, apso::scaled(depth, metres), camera);

    // A first pose: the last mask is close enough.
    tracker.begin(grey, now);
    const auto prior = tracker.estimate(pipeline.observation().mask.probability);
    // 1. What moves? The features on it are left out of the second pose.
    const apso::Observation& seen = pipeline.observe(now, prior.T_world_camera, tracker.tracks());
    const auto pose = tracker.estimate(seen.mask.probability);
    // 2. Can the frame be trusted?
    pipeline.assess(tracker.keypoints(), tracker.tracks(),
                    {pose.T_world_camera, pose.T_world_predicted, pose.ok, pose.information, pose.confirmed_matches()});
    // 3. The images themselves are aligned with trusted frames, and both poses are joined as far as each is trusted.
    const apso::FrameReport& report = pipeline.conclude();
    // The map learns only from frames that can be trusted.
    tracker.commit(report.T_world_camera, seen.mask.probability, report.keyframe_allowed);
    if (report.state != apso::SceneState::Lost) poses.push_back({i.timestamp, report.T_world_camera});
  }
  // [/tracker]
  apso::write_trajectory(output, poses);
  std::printf("%zu of %zu frames have a pose: %s\n", poses.size(), images.size(), output.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s FOLDER CAMERA TRAJECTORY\n", argv[0]);
    return 2;
  }
  try {
    run(argv[1], argv[2], argv[3]);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", argv[0], e.what());
    return 1;
  }
  return 0;
}
