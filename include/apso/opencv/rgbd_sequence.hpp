/// \file
/// Recordings in the folder layout of the TUM RGB-D benchmark: rgb.txt and depth.txt, or associations.txt.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/config.hpp>
#include <apso/evaluation/association.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/opencv/cameras.hpp>
#include <apso/options.hpp>
#include <apso/types/frame.hpp>
#include <apso/types/image_view.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// One frame of a recording, rectified. When `error` is not empty the images are empty.
struct SequenceFrame {
  double timestamp = 0;        ///< of the colour image [s]
  double depth_delay = 0;      ///< stamp of the depth image less that of the colour image [s]
  cv::Mat_<cv::Vec3b> colour;  ///< B, G, R
  cv::Mat_<uchar> gray;        ///< 8-bit grey
  Image<float> intensity;      ///< grey in [0,1]
  Image<float> depth;          ///< [m], 0 where nothing was measured
  std::string error;           ///< file and what is wrong with it; empty = the frame is good

  [[nodiscard]] bool ok() const { return error.empty(); }
  /// Views for the library; valid as long as this frame lives.
  [[nodiscard]] RgbdFrame rgbd() const { return {timestamp, intensity.view(), depth.view()}; }
};

struct SequenceOptions {
  double max_difference = 0.02;  ///< between the stamps of a colour image and its depth image [s]
  bool rectify = true;           ///< remove the lens distortion of the camera
  template <class Self, class V>
  static void fields(Self& s, V&& v) {
    v("max_difference", s.max_difference, 0.0, 1.0);
    v("rectify", s.rectify);
  }
};

/// Reads a recording frame by frame. What is wrong with the recording as a whole is an io_error, what is wrong with one
/// frame is told in that frame.
class RgbdSequence {
 public:
  /// \throws io_error naming the file and what was expected
  /// \throws contract_error when the camera or an option makes no sense
  RgbdSequence(const std::string& folder, const CameraModel& camera, const SequenceOptions& options = {})
      : folder_(folder), camera_(checked(camera)), rectifier_(options.rectify ? camera : plain(camera)) {
    namespace fs = std::filesystem;
    validate(options, "sequence");
    std::error_code code;
    if (!fs::exists(folder_, code)) throw io_error(folder + ": no such folder, expected one with rgb.txt and depth.txt");
    if (!fs::is_directory(folder_, code)) throw io_error(folder + ": is no folder, expected one with rgb.txt and depth.txt");
    const fs::path associations = folder_ / "associations.txt";
    if (is_there(associations)) {
      for (ImageAssociation& a : read_associations(associations.string(), &warnings_))
        entries_.push_back({a.rgb_timestamp, a.depth_timestamp - a.rgb_timestamp, std::move(a.rgb_file), std::move(a.depth_file)});
    } else {
      associate_lists(options.max_difference);
    }
    refuse_outside();
    const fs::path groundtruth = folder_ / "groundtruth.txt";
    if (is_there(groundtruth)) groundtruth_ = groundtruth.string();
  }

  [[nodiscard]] int size() const { return static_cast<int>(entries_.size()); }
  [[nodiscard]] const CameraModel& camera() const { return camera_; }
  /// What was put right while reading the lists.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }
  /// Path of groundtruth.txt, empty when there is none; read it with read_trajectory.
  [[nodiscard]] const std::string& groundtruth_path() const { return groundtruth_; }
  [[nodiscard]] double timestamp(int i) const { return entry(i).timestamp; }
  [[nodiscard]] std::string colour_path(int i) const { return (folder_ / entry(i).colour).string(); }
  [[nodiscard]] std::string depth_path(int i) const { return (folder_ / entry(i).depth).string(); }

  [[nodiscard]] SequenceFrame frame(int i) const {
    SequenceFrame f;
    read(i, f);
    return f;
  }

  /// As frame(), into a frame whose memory is used again.
  /// \return false when the frame is broken; see SequenceFrame::error
  bool read(int i, SequenceFrame& out) const {
    out.timestamp = entry(i).timestamp;
    out.depth_delay = entry(i).depth_delay;
    out.error.clear();
    cv::Mat colour;
    cv::Mat depth;
    const std::string rgb_file = colour_path(i);
    const std::string depth_file = depth_path(i);
    out.error = load(rgb_file, cv::IMREAD_COLOR, colour);
    if (out.ok()) out.error = load(depth_file, cv::IMREAD_UNCHANGED, depth);
    if (out.ok() && depth.type() != CV_16UC1)
      out.error = depth_file + ": has " + std::to_string(depth.channels()) + " channel(s) of " + std::to_string(8 * depth.elemSize1()) +
                  " bit, expected one of 16 bit";
    if (out.ok()) out.error = check_size(rgb_file, colour);
    if (out.ok()) out.error = check_size(depth_file, depth);
    if (!out.ok()) {
      out.colour.release();
      out.gray.release();
      out.intensity.resize(0, 0);
      out.depth.resize(0, 0);
      return false;
    }
    rectifier_.colour(colour, out.colour);
    cv::Mat rectified_depth;
    rectifier_.depth(depth, rectified_depth);
    cv::cvtColor(out.colour, out.gray, cv::COLOR_BGR2GRAY);
    const int width = out.gray.cols;
    const int height = out.gray.rows;
    out.intensity.resize(width, height);
    out.depth.resize(width, height);
    const auto metres = static_cast<float>(1.0 / camera_.depth_scale);
    for (int y = 0; y < height; ++y) {
      const uchar* g = out.gray[y];
      const auto* d = rectified_depth.ptr<std::uint16_t>(y);
      float* intensity = out.intensity.row(y);
      float* z = out.depth.row(y);
      for (int x = 0; x < width; ++x) intensity[x] = static_cast<float>(g[x]) * (1.0F / 255.0F);
      for (int x = 0; x < width; ++x) z[x] = static_cast<float>(d[x]) * metres;
    }
    return true;
  }

 private:
  struct Entry {
    double timestamp;
    double depth_delay;
    std::string colour;
    std::string depth;
  };

  static const CameraModel& checked(const CameraModel& camera) {
    camera.validate();
    return camera;
  }
  static CameraModel plain(CameraModel camera) {
    camera.k1 = camera.k2 = camera.p1 = camera.p2 = camera.k3 = 0;
    return camera;
  }
  [[nodiscard]] const Entry& entry(int i) const {
    expects(i >= 0 && i < size(), "RgbdSequence: frame number out of range");
    return entries_[static_cast<std::size_t>(i)];
  }

  /// Also a link that leads nowhere is there: it is an error when it is read, and not a file that the recording does not have.
  static bool is_there(const std::filesystem::path& file) {
    std::error_code code;
    return std::filesystem::exists(std::filesystem::symlink_status(file, code));
  }

  /// The files of the lists are below the folder.
  void refuse_outside() const {
    for (const Entry& e : entries_) {
      for (const std::string& file : {e.colour, e.depth}) {
        const std::filesystem::path path = std::filesystem::path(file).lexically_normal();
        if (path.is_relative() && *path.begin() != "..") continue;
        throw io_error(folder_.string() + ": its lists name '" + file + "', expected files in this folder");
      }
    }
  }

  void associate_lists(double max_difference) {
    const std::string rgb_txt = (folder_ / "rgb.txt").string();
    const std::string depth_txt = (folder_ / "depth.txt").string();
    for (const std::string& list : {rgb_txt, depth_txt})
      if (!is_there(list)) throw io_error(list + ": no such file, expected lines 'timestamp file' (or associations.txt beside it)");
    std::vector<FileListEntry> rgb = read_file_list(rgb_txt, &warnings_);
    std::vector<FileListEntry> depth = read_file_list(depth_txt, &warnings_);
    std::vector<double> rgb_stamps;
    std::vector<double> depth_stamps;
    rgb_stamps.reserve(rgb.size());
    depth_stamps.reserve(depth.size());
    for (const FileListEntry& e : rgb) rgb_stamps.push_back(e.timestamp);
    for (const FileListEntry& e : depth) depth_stamps.push_back(e.timestamp);
    for (const StampMatch& m : associate_tum(rgb_stamps, depth_stamps, max_difference))
      entries_.push_back(
          {rgb[m.first].timestamp, depth[m.second].timestamp - rgb[m.first].timestamp, rgb[m.first].file, depth[m.second].file});
    if (entries_.empty())
      throw io_error(depth_txt + ": no stamp is within " + std::to_string(max_difference) +
                     " s of one in rgb.txt, expected lists of the same recording");
    if (entries_.size() < rgb.size())
      warnings_.push_back(rgb_txt + ": " + std::to_string(rgb.size() - entries_.size()) +
                          " colour image(s) without a depth image in time, left out");
  }

  [[nodiscard]] static std::string load(const std::string& path, int flags, cv::Mat& image) {
    std::error_code code;
    if (!std::filesystem::is_regular_file(path, code)) return path + ": no such file, expected an image";
    const std::uintmax_t size = std::filesystem::file_size(path, code);
    std::vector<char> bytes(code ? 0 : static_cast<std::size_t>(size));
    std::ifstream file(path, std::ios::binary);
    file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    if (!file || bytes.empty()) return path + ": empty or not readable, expected an image";
    try {
      image = cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, bytes.data()), flags);
    } catch (const cv::Exception& e) {
      return path + ": not an image that can be decoded (" + e.err + ")";
    }
    if (image.empty()) return path + ": not an image that can be decoded";
    return {};
  }

  [[nodiscard]] std::string check_size(const std::string& path, const cv::Mat& image) const {
    const Pinhole& p = camera_.pinhole;
    if (image.cols == p.width && image.rows == p.height) return {};
    return path + ": is " + std::to_string(image.cols) + " x " + std::to_string(image.rows) + ", expected " + std::to_string(p.width) +
           " x " + std::to_string(p.height) + " as the camera";
  }

  std::filesystem::path folder_;
  CameraModel camera_;
  Rectifier rectifier_;
  std::vector<Entry> entries_;
  std::vector<std::string> warnings_;
  std::string groundtruth_;
};

}  // namespace opencv
APSO_NAMESPACE_END
