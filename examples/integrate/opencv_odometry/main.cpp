// opencv_odometry FOLDER CAMERA TRAJECTORY [plain]: a recording in TUM format through OpenCV's RGB-D odometry, with apso or without.
// CAMERA is a camera.yaml or the name of one: tum-fr1, tum-fr2, tum-fr3, bonn, icl-nuim.
#include <cstdio>
#include <exception>
#include <string>

#include <opencv2/core.hpp>

#include <apso/evaluation/trajectory.hpp>
#include <apso/io/camera_yaml.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/opencv/cameras.hpp>
#include <apso/opencv/rgbd_sequence.hpp>

#include "odometry.hpp"

int main(int argc, char** argv) {
  if (argc != 4 && !(argc == 5 && std::string(argv[4]) == "plain")) {
    std::fprintf(stderr, "usage: %s FOLDER CAMERA TRAJECTORY [plain]\n", argv[0]);
    return 2;
  }
  try {
    const std::string camera = argv[2];
    const bool file = camera.size() > 5 && camera.substr(camera.size() - 5) == ".yaml";
    const apso::opencv::RgbdSequence recording(argv[1], file ? apso::camera_from_yaml(camera) : apso::camera_by_name(camera));
    Odometry odometry(recording.camera().pinhole, argc == 4);
    apso::Trajectory poses;
    for (int i = 0; i < recording.size(); ++i) {
      apso::opencv::SequenceFrame f;
      if (!recording.read(i, f)) {
        std::fprintf(stderr, "%s\n", f.error.c_str());
        continue;
      }
      poses.push_back({f.timestamp, odometry.track(f.timestamp, f.gray, cv::Mat(f.gray.size(), CV_32F, f.depth.data()))});
    }
    apso::write_trajectory(argv[3], poses);
    std::printf("%zu of %d frames have a pose: %s\n", poses.size(), recording.size(), argv[3]);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", argv[0], e.what());
    return 1;
  }
  return 0;
}
