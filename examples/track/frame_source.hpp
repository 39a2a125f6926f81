/// \file
/// Sources of frames for apso_track: a recording in TUM format, or the synthetic generator.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/evaluation/trajectory.hpp>
#include <apso/io/tum_text.hpp>
#include <apso/opencv/adapters.hpp>
#include <apso/opencv/cameras.hpp>
#include <apso/opencv/detectors/precomputed_motion.hpp>
#include <apso/opencv/mask_image.hpp>
#include <apso/opencv/rgbd_sequence.hpp>
#include <apso/testing/synthetic.hpp>

#include "kept_frames.hpp"

namespace track {

/// One frame ready for the tracker, with its images.
struct LoadedFrame : apso::opencv::SequenceFrame {
  std::string name;                    ///< stem of the colour file, for the names of masks and pictures
  apso::Image<std::uint8_t> instance;  ///< the person at each pixel, 0 = static; empty: not known
  cv::Mat from_x, from_y;              ///< where each pixel was read [px]; empty: where it is now
  /// A mask of the image as it was read, for the image as it is now.
  [[nodiscard]] cv::Mat moved(const cv::Mat& mask) const {
    if (mask.empty() || from_x.empty()) return mask;
    cv::Mat out;
    cv::remap(mask, out, from_x, from_y, cv::INTER_NEAREST, cv::BORDER_REPLICATE);
    return out;
  }
  /// The grey images again, of colours that were changed.
  void take_colour() {
    cv::cvtColor(colour, gray, cv::COLOR_BGR2GRAY);
    for (int y = 0; y < gray.rows; ++y) {
      for (int x = 0; x < gray.cols; ++x) intensity(x, y) = static_cast<float>(gray(y, x)) / 255.0F;
    }
  }
  /// Views for the library; valid as long as this frame lives.
  [[nodiscard]] apso::RgbdFrame rgbd() const {
    apso::RgbdFrame views = SequenceFrame::rgbd();
    views.colour = apso::opencv::as_colour(colour);
    return views;
  }
};

/// Time only goes on: a frame that came twice, or too late, would count as motion within no time.
class TimeGoesOn {
 public:
  /// Makes a frame broken that is not later than one before.
  void check(LoadedFrame& frame) {
    if (!frame.ok()) return;
    if (frame.timestamp > latest_) {
      latest_ = frame.timestamp;
      return;
    }
    char text[120];
    std::snprintf(text, sizeof text, "its stamp, %.6f, is not later than %.6f, which a frame before has", frame.timestamp, latest_);
    frame.error = text;
  }

 private:
  double latest_ = -std::numeric_limits<double>::infinity();  // [s]
};

class FrameSource {
 public:
  virtual ~FrameSource() = default;
  [[nodiscard]] virtual int size() const = 0;
  [[nodiscard]] virtual const apso::Pinhole& camera() const = 0;
  /// Loads frame i, into images whose memory is used again. Says in `error` if the frame is broken and has to be skipped.
  virtual void load(int i, LoadedFrame& out) = 0;
  /// Empty without ground truth.
  [[nodiscard]] virtual const apso::Trajectory& groundtruth() const = 0;
  [[nodiscard]] virtual const std::vector<std::string>& warnings() const = 0;
  [[nodiscard]] virtual double timestamp(int i) const = 0;
  [[nodiscard]] std::vector<double> timestamps() const {
    std::vector<double> all;
    for (int i = 0; i < size(); ++i) all.push_back(timestamp(i));
    return all;
  }
  /// Folders of its images, which links may place outside of the recording; none without files.
  [[nodiscard]] virtual std::set<std::string> folders() const { return {}; }
  /// Stamp of a frame less the time at which it was seen [s].
  [[nodiscard]] virtual double stamp_delay() const { return 0; }
  /// Deviation of an inverse depth [1/m]; 0: not known.
  [[nodiscard]] virtual double inverse_depth_sigma() const { return 0; }
  /// Known difficulty of frame i; empty if none is known.
  [[nodiscard]] virtual std::string label(int) const { return {}; }
};

/// Another source, as it is: what changes frames overrides load(), and the rest where it changes.
class ChangedSource : public FrameSource {
 public:
  explicit ChangedSource(std::unique_ptr<FrameSource> source) : source_(std::move(source)) {}
  int size() const override { return source_->size(); }
  const apso::Pinhole& camera() const override { return source_->camera(); }
  const apso::Trajectory& groundtruth() const override { return source_->groundtruth(); }
  const std::vector<std::string>& warnings() const override { return source_->warnings(); }
  double timestamp(int i) const override { return source_->timestamp(i); }
  std::set<std::string> folders() const override { return source_->folders(); }
  double stamp_delay() const override { return source_->stamp_delay(); }
  double inverse_depth_sigma() const override { return source_->inverse_depth_sigma(); }
  std::string label(int i) const override { return source_->label(i); }

 protected:
  std::unique_ptr<FrameSource> source_;
};

class SyntheticSource final : public FrameSource {
 public:
  /// \param kept file for the rendered frames, which other runs may use; empty: none
  SyntheticSource(const std::string& name, const apso::testing::SyntheticOptions& options, const std::string& kept = {})
      : sequence_(name, options) {
    if (!kept.empty()) kept_.emplace(kept, name, options);
    for (int i = 0; i < sequence_.size(); ++i) truth_.push_back({sequence_.timestamp(i), sequence_.T_world_camera(i)});
  }
  int size() const override { return sequence_.size(); }
  const apso::Pinhole& camera() const override { return sequence_.camera(); }
  void load(int i, LoadedFrame& out) override {
    if (!kept_ || !kept_->read(i, frame_)) {
      sequence_.render(i, frame_);
      if (kept_) kept_->write(i, frame_);
    }
    out.timestamp = sequence_.timestamp(i);
    char name[32];
    std::snprintf(name, sizeof name, "%.6f", out.timestamp);
    out.name = name;
    const cv::Mat rgb(frame_.depth.height(), frame_.depth.width(), CV_8UC3, frame_.rgb.data());
    cv::cvtColor(rgb, out.colour, cv::COLOR_RGB2BGR);
    cv::cvtColor(rgb, out.gray, cv::COLOR_RGB2GRAY);
    std::swap(out.intensity, frame_.intensity);
    std::swap(out.depth, frame_.depth);
    std::swap(out.instance, frame_.instance);
  }
  const apso::Trajectory& groundtruth() const override { return truth_; }
  const std::vector<std::string>& warnings() const override { return warnings_; }
  double timestamp(int i) const override { return sequence_.timestamp(i); }
  std::string label(int i) const override {
    const apso::testing::Stress s = sequence_.stress(i);
    return s == apso::testing::Stress::None ? "" : to_string(s);
  }

 private:
  apso::testing::SyntheticSequence sequence_;
  std::optional<KeptFrames> kept_;
  apso::testing::SyntheticFrame frame_;
  apso::Trajectory truth_;
  std::vector<std::string> warnings_;
};

class RecordedSource final : public FrameSource {
 public:
  RecordedSource(const std::string& folder, const apso::opencv::CameraModel& camera) : sequence_(folder, camera) {
    warnings_ = sequence_.warnings();
    if (!sequence_.groundtruth_path().empty()) truth_ = apso::read_trajectory(sequence_.groundtruth_path(), &warnings_);
  }
  int size() const override { return sequence_.size(); }
  const apso::Pinhole& camera() const override { return sequence_.camera().pinhole; }
  void load(int i, LoadedFrame& out) override {
    sequence_.read(i, out);
    out.name = std::filesystem::path(sequence_.colour_path(i)).stem().string();
  }
  const apso::Trajectory& groundtruth() const override { return truth_; }
  const std::vector<std::string>& warnings() const override { return warnings_; }
  double timestamp(int i) const override { return sequence_.timestamp(i); }
  double stamp_delay() const override { return sequence_.camera().stamp_delay; }
  double inverse_depth_sigma() const override { return sequence_.camera().inverse_depth_sigma; }
  std::set<std::string> folders() const override {
    std::set<std::string> all;
    for (int i = 0; i < size(); ++i) {
      all.insert(std::filesystem::path(sequence_.colour_path(i)).parent_path().string());
      all.insert(std::filesystem::path(sequence_.depth_path(i)).parent_path().string());
    }
    return all;
  }

 private:
  apso::opencv::RgbdSequence sequence_;
  apso::Trajectory truth_;
  std::vector<std::string> warnings_;
};

/// Masks from another program: one image per frame, named by the colour image's timestamp; nonzero = dynamic.
class MaskFolder {
 public:
  explicit MaskFolder(std::string folder) : folder_(std::move(folder)) {
    if (!std::filesystem::is_directory(folder_)) {
      throw apso::io_error(folder_ + ": no such folder; expected one PNG per frame, named by the colour image's timestamp");
    }
  }
  /// The mask of a frame; empty without one that fits.
  cv::Mat load(const std::string& name, const cv::Size& size, apso::opencv::FileUse& use) const {
    const std::string file = (std::filesystem::path(folder_) / (name + ".png")).string();
    if (!std::filesystem::exists(file)) return {};
    try {
      cv::Mat mask = apso::opencv::read_mask(file, size);
      ++use.masks;
      return mask;
    } catch (const apso::io_error& e) {
      use.problems.emplace_back(e.what());
      return {};
    }
  }

 private:
  std::string folder_;
};

}  // namespace track
