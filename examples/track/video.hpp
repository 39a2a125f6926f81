/// \file
/// A video file of a run.
#pragma once

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>

#include <apso/io/tum_text.hpp>

#include "stamps.hpp"

namespace track {

/// The codec that belongs to the extension of a file; 0: there is none.
inline int video_codec(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (extension == ".avi") return cv::VideoWriter::fourcc('M', 'J', 'P', 'G');
  if (extension == ".mp4") return cv::VideoWriter::fourcc('m', 'p', '4', 'v');
  return 0;
}

/// Pictures of one size become a video with the pace of the recording.
class VideoFile {
 public:
  /// \param file   its extension is one that video_codec() knows
  /// \param stamps of the frames [s]: their median distance is that of the pictures
  VideoFile(std::filesystem::path file, const std::vector<double>& stamps) : file_(std::move(file)) {
    const double step = median_step(stamps);
    if (step > 0) rate_ = std::clamp(1 / step, 1.0, 120.0);
  }

  /// Throws io_error when OpenCV cannot write this kind of video here.
  void write(const cv::Mat& picture) {
    if (pictures_++ == 0 && !writer_.open(file_.string(), video_codec(file_), rate_, picture.size()))
      throw apso::io_error("--video: " + file_.string() + ": cannot be written: OpenCV has no encoder for " + file_.extension().string() +
                           ", or the disk is full");
    writer_.write(picture);
  }

  /// Closes the file. Throws io_error when not all pictures can be read from it: the writer of OpenCV does not tell.
  void finish() {
    if (pictures_ == 0) return;
    writer_.release();
    cv::VideoCapture written(file_.string());
    const int found = written.isOpened() ? cvRound(written.get(cv::CAP_PROP_FRAME_COUNT)) : 0;
    if (found != pictures_)
      throw apso::io_error("--video: " + file_.string() + ": holds " + std::to_string(found) + " of " + std::to_string(pictures_) +
                           " frames (disk full?)");
  }

 private:
  std::filesystem::path file_;
  double rate_ = 30;  ///< pictures per second
  int pictures_ = 0;
  cv::VideoWriter writer_;
};

}  // namespace track
