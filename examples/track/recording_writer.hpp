/// \file
/// Writes a recording in the layout of the TUM RGB-D benchmark, with its camera.
#pragma once

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <sstream>
#include <string>

#include <yaml-cpp/yaml.h>
#include <opencv2/core.hpp>

#include <apso/evaluation/trajectory.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/types/image_view.hpp>
#include <apso/types/pinhole.hpp>

#include "results.hpp"

namespace track {

/// rgb/, depth/ and, where there are any, masks/, with their lists, the ground truth and camera.yaml. Nothing is in its place before
/// finish().
class RecordingWriter {
 public:
  /// \param depth_scale units of the depth images per metre
  /// \throws io_error where something in the folder would be overwritten that no program of apso wrote
  RecordingWriter(const std::string& folder, double depth_scale)
      : out_(folder, {"rgb.txt", "depth.txt", "associations.txt", "groundtruth.txt", "camera.yaml"}), depth_scale_(depth_scale) {}

  /// \param timestamp of both images [s], later than that of the frame before
  /// \param bgr       8-bit colour
  /// \param depth     [m], 0 where there is none; values that the unit cannot hold become the largest that it can
  void add(double timestamp, const cv::Mat& bgr, const apso::ImageView<const float>& depth) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6f", timestamp);
    stamp_ = text;
    const std::string file = stamp_ + ".png";
    write_image(out_.file("rgb/" + file), bgr);
    cv::Mat(depth.height, depth.width, CV_32FC1, const_cast<float*>(depth.data), static_cast<std::size_t>(depth.stride) * sizeof(float))
        .convertTo(units_, CV_16UC1, depth_scale_);
    write_image(out_.file("depth/" + file), units_);
    rgb_ << stamp_ << " rgb/" << file << '\n';
    depth_ << stamp_ << " depth/" << file << '\n';
    associations_ << stamp_ << " rgb/" << file << ' ' << stamp_ << " depth/" << file << '\n';
    ++frames_;
  }
  /// \param mask of the frame that was added last: 8 bit, nonzero where something moves
  void add_mask(const cv::Mat& mask) { write_image(out_.file("masks/" + stamp_ + ".png"), mask); }
  [[nodiscard]] int frames() const { return frames_; }

  /// \param inverse_depth_sigma of the depth [1/m]; 0: not known
  /// \param truth               empty: no groundtruth.txt
  void finish(const std::string& name, const apso::Pinhole& c, double inverse_depth_sigma, const apso::Trajectory& truth) {
    write_file(out_.file("rgb.txt"), rgb_.str());
    write_file(out_.file("depth.txt"), depth_.str());
    write_file(out_.file("associations.txt"), associations_.str());
    if (!truth.empty()) apso::write_trajectory(out_.file("groundtruth.txt").string(), truth);
    YAML::Emitter camera;
    camera.SetDoublePrecision(10);
    camera << YAML::BeginMap << YAML::Key << "name" << YAML::Value << name;
    const auto field = [&](const char* key, double value) { camera << YAML::Key << key << YAML::Value << value; };
    field("fx", c.fx);
    field("fy", c.fy);
    field("cx", c.cx);
    field("cy", c.cy);
    field("width", c.width);
    field("height", c.height);
    field("depth_scale", depth_scale_);
    if (inverse_depth_sigma > 0) field("inverse_depth_sigma", inverse_depth_sigma);
    camera << YAML::EndMap;
    write_file(out_.file("camera.yaml"), std::string(camera.c_str()) + '\n');
    out_.finish();
  }

 private:
  ResultFolder out_;
  double depth_scale_;
  std::ostringstream rgb_, depth_, associations_;
  std::string stamp_;
  cv::Mat units_;
  int frames_ = 0;
};

}  // namespace track
