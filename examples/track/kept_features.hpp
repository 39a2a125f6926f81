/// \file
/// Features and tracks of frames in a file, so that several runs on the same images, whatever else they do, find them once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include <opencv2/core.hpp>

#include <apso/io/parameters.hpp>
#include <apso/opencv/feature_front_end.hpp>
#include <apso/opencv/feature_tracker.hpp>

#include "kept_file.hpp"

namespace track {

/// They depend on the settings of the front end, on the image, and on all images before it, from which the tracks come. Give it each image,
/// in order, by see().
class KeptFeatures {
 public:
  KeptFeatures(const std::string& file, const apso::opencv::FeatureTrackerOptions& options)
      : keypoints_(static_cast<std::size_t>(options.orb.features + options.orb.levels)),
        tracks_(static_cast<std::size_t>(options.lk.tracks)),
        file_(file, sizeof(Counts) + keypoints_ * (sizeof(apso::Keypoint) + kDescriptor) + tracks_ * sizeof(apso::PointTrack),
              "features\n" + apso::write_parameters(options.orb) + '\n' + apso::write_parameters(options.lk), "features are found again") {}

  /// The image of frame i, whose features are to be read or written.
  void see(const cv::Mat& gray) {
    for (int y = 0; y < gray.rows; ++y) images_ = KeptFile::checksum(images_, gray.ptr(y), static_cast<std::size_t>(gray.cols));
  }

  /// \param ms what it took the run that found them [ms]
  /// \return false: they are not there
  [[nodiscard]] bool read(int i, apso::opencv::ImageFeatures& out, double& ms) {
    if (!file_.read(i, images_)) return false;
    const unsigned char* from = file_.bytes();
    Counts counts;
    const auto take = [&from](void* to, std::size_t bytes) {
      if (bytes > 0) std::memcpy(to, from, bytes);
      from += bytes;
    };
    take(&counts, sizeof counts);
    out.keypoints.resize(counts.keypoints);
    out.descriptors.create(static_cast<int>(counts.keypoints), kDescriptor);
    out.tracks.resize(counts.tracks);
    take(out.keypoints.data(), counts.keypoints * sizeof(apso::Keypoint));
    take(out.descriptors.data, counts.keypoints * kDescriptor);
    take(out.tracks.data(), counts.tracks * sizeof(apso::PointTrack));
    ms = counts.ms;
    return true;
  }

  /// Keeps them if there is room.
  void write(int i, const apso::opencv::ImageFeatures& features, double ms) {
    const Counts counts{features.keypoints.size(), features.tracks.size(), ms};
    if (counts.keypoints > keypoints_ || counts.tracks > tracks_ || !features.descriptors.isContinuous()) return;
    unsigned char* to = file_.bytes();
    const auto put = [&to](const void* from, std::size_t bytes) {
      if (bytes > 0) std::memcpy(to, from, bytes);
      to += bytes;
    };
    put(&counts, sizeof counts);
    put(features.keypoints.data(), counts.keypoints * sizeof(apso::Keypoint));
    put(features.descriptors.data, counts.keypoints * kDescriptor);
    put(features.tracks.data(), counts.tracks * sizeof(apso::PointTrack));
    file_.write(i, images_);
  }

 private:
  static constexpr int kDescriptor = 32;  // bytes
  struct Counts {
    std::size_t keypoints = 0;
    std::size_t tracks = 0;
    double ms = 0;
  };

  std::size_t keypoints_;  // room for so many
  std::size_t tracks_;
  KeptFile file_;
  std::uint64_t images_ = 0;  // checksum of all that were seen
};

}  // namespace track
