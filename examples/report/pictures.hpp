/// \file
/// The pictures of a report: small ones of every frame, written while tracking, or the overlays of a run without them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/io/tum_text.hpp>

#include "../track/data_uri.hpp"
#include "../track/results.hpp"

namespace report {

inline constexpr const char* picture_folder = "thumbnails";

/// JPEG files of frames, by the number of the frame.
using Pictures = std::map<int, std::string>;

/// At most this wide. JPEG, because a WebP of this size takes ten times as long to encode.
inline std::string small_jpeg(const cv::Mat& picture, int width, int quality) {
  cv::Mat small = picture;
  if (picture.cols > width) cv::resize(picture, small, {width, std::max(1, picture.rows * width / picture.cols)}, 0, 0, cv::INTER_AREA);
  std::vector<unsigned char> bytes;
  if (!cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, quality})) throw apso::io_error("cannot encode a picture");
  return {bytes.begin(), bytes.end()};
}

/// Name of the small picture of a frame in a folder of results.
inline std::string picture_name(int frame) {
  char name[40];
  std::snprintf(name, sizeof name, "%s/%06d.jpg", picture_folder, frame);
  return name;
}

/// Writes the small picture of a frame. \param overlay with its banner, which the page tells in words
inline void write_picture(const std::filesystem::path& file, const cv::Mat& overlay, int rows_without_banner) {
  track::write_file(file, small_jpeg(overlay.rowRange(0, rows_without_banner), 320, 60));
}

/// The small pictures of a run, else its overlays.
inline Pictures read_pictures(const std::filesystem::path& run) {
  namespace fs = std::filesystem;
  const bool every_frame = fs::is_directory(run / picture_folder);
  const fs::path folder = every_frame ? run / picture_folder : run / "overlays";
  Pictures pictures;
  if (!fs::is_directory(folder)) return pictures;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string stem = entry.path().stem().string();
    char* end = nullptr;
    const long frame = std::strtol(stem.c_str(), &end, 10);
    if (stem.empty() || *end != 0 || entry.path().extension() != (every_frame ? ".jpg" : ".png")) continue;  // not ours
    if (every_frame) {
      std::ifstream in(entry.path(), std::ios::binary);
      pictures[static_cast<int>(frame)] = std::string{std::istreambuf_iterator<char>(in), {}};
    } else {
      const cv::Mat overlay = cv::imread(entry.path().string());
      if (!overlay.empty()) pictures[static_cast<int>(frame)] = small_jpeg(overlay, 480, 75);
    }
  }
  return pictures;
}

inline double total_bytes(const std::vector<Pictures>& runs) {
  double sum = 0;
  for (const Pictures& run : runs) {
    for (const auto& picture : run) sum += static_cast<double>(picture.second.size());
  }
  return sum;
}

/// Makes pictures smaller until they need at most `limit` bytes: first in width, then in number.
inline void fit(std::vector<Pictures>& runs, double limit) {
  constexpr int smallest = 160;  // [px] below, nothing can be recognised
  for (int round = 0; round < 3 && total_bytes(runs) > limit; ++round) {
    const double factor = 0.95 * std::sqrt(limit / total_bytes(runs));
    for (Pictures& run : runs) {
      for (auto& [frame, bytes] : run) {
        const cv::Mat picture = cv::imdecode(std::vector<char>(bytes.begin(), bytes.end()), cv::IMREAD_COLOR);
        if (picture.empty()) throw apso::io_error("the picture of frame " + std::to_string(frame) + " cannot be read");
        bytes = small_jpeg(picture, std::max(smallest, static_cast<int>(picture.cols * factor)), 55);
      }
    }
  }
  const double step = std::ceil(total_bytes(runs) / std::max(1.0, limit));
  if (step <= 1) return;
  for (Pictures& run : runs) {
    double i = 0;
    for (auto it = run.begin(); it != run.end(); ++i) it = std::fmod(i, step) == 0 ? std::next(it) : run.erase(it);
  }
}

}  // namespace report
