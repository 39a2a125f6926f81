/// \file
/// All that is drawn of the frames of a run: overlays, the small pictures of the report, masks, the video and the window.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>

#include <apso/opencv/drawing.hpp>
#include <apso/opencv/mask_image.hpp>
#include <apso/pipeline/pipeline.hpp>
#include <apso/pipeline/report.hpp>
#include <apso/types/keypoint.hpp>

#include "../report/pictures.hpp"
#include "arguments.hpp"
#include "frame_source.hpp"
#include "pictures.hpp"
#include "results.hpp"
#include "video.hpp"
#include "view.hpp"
#include "window.hpp"
#include "write_behind.hpp"

namespace track {

/// Draws what the arguments ask for; an overlay that several need is drawn once. Files are written on another thread if there are several.
class FramePictures {
 public:
  /// \param a,source,folder must outlive this
  /// \param window of --live; null: none
  FramePictures(const Arguments& a, const FrameSource& source, ResultFolder& folder, std::unique_ptr<Window> window)
      : arguments_(&a), source_(&source), folder_(&folder), window_(std::move(window)), writer_(a.threads > 1), overlays_(folder, writer_) {
    if (!a.video.empty()) video_.emplace(folder.file(a.video), source.timestamps());
    if (video_ || window_) view_.emplace(source.groundtruth());
  }

  /// \param i,total number of the frame, and of all frames
  void offer(int i, int total, const LoadedFrame& frame, const apso::Observation& observation, const std::vector<apso::Keypoint>& keypoints,
             const apso::FrameReport& report) {
    const double time = frame.timestamp - source_->timestamp(0);
    cv::Mat overlay;
    const auto draw = [&] {
      if (overlay.empty()) overlay = apso::opencv::draw_overlay(frame.colour, observation, keypoints, report);
      return overlay;
    };
    if (!arguments_->no_pictures) overlays_.offer({i, total, time, source_->label(i)}, report, draw);
    if (arguments_->report) {
      writer_.add([file = folder_->file(report::picture_name(i)), picture = draw(), rows = frame.colour.rows] {
        report::write_picture(file, picture, rows);
      });
    }
    if (view_) {
      const cv::Mat picture = view_->draw(draw(), report, i, time);
      if (video_) writer_.add([this, picture] { video_->write(picture); });
      if (window_) window_->show(picture);
    }
    if (arguments_->write_masks) {
      cv::Mat picture;
      apso::opencv::mask_to_8bit(observation.mask, picture);
      writer_.add([file = folder_->file("masks/" + frame.name + ".png"), picture] { write_image(file, picture); });
    }
  }

  /// Waits until all pictures of frames are written. What could not be is thrown here.
  void wait() { writer_.finish(); }
  /// Closes the video.
  void finish() {
    if (video_) video_->finish();
  }
  [[nodiscard]] const OverlayChooser& overlays() const { return overlays_; }

 private:
  const Arguments* arguments_;
  const FrameSource* source_;
  ResultFolder* folder_;
  std::unique_ptr<Window> window_;
  std::optional<View> view_;  ///< of --video and --live
  std::optional<VideoFile> video_;
  WriteBehind writer_;  ///< after the video: its thread ends before that
  OverlayChooser overlays_;
};

}  // namespace track
