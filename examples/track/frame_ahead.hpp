/// \file
/// Frames in their order, each loaded and with its features found on another thread while the one before is at work.
#pragma once

#include <array>
#include <cstddef>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include <apso/opencv/feature_front_end.hpp>
#include <apso/opencv/feature_tracker.hpp>

#include "frame_source.hpp"
#include "kept_features.hpp"
#include "output.hpp"

namespace track {

/// A frame that is ready for the tracker.
struct ReadyFrame {
  LoadedFrame images;
  apso::opencv::ImageFeatures features;  ///< none if the frame is broken
  double load_ms = 0;                    ///< time that it took to load the frame
  double features_ms = 0;                ///< ... and to find its features; of the run that found them if they were kept
};

/// Loading and finding features need neither poses nor masks, so they may run ahead; with or without a thread the frames are
/// the same bit by bit.
class FrameAhead {
 public:
  /// \param frames that are going to be asked for, from 0 on
  /// \param thread false: everything is done by whoever asks
  /// \param kept file for the features, which other runs may use; empty: none
  FrameAhead(FrameSource& source, const apso::opencv::FeatureTrackerOptions& options, int frames, bool thread, const std::string& kept = {})
      : source_(&source), front_end_(options.orb, options.lk), frames_(frames), thread_(thread) {
    if (!kept.empty()) kept_.emplace(kept, options);
  }

  /// The next frame; it lives until the next call. What loading throws is thrown here.
  const ReadyFrame& next() {
    if (!ahead_.valid()) begin();
    ahead_.get();
    current_ = 1 - current_;
    if (thread_ && next_ < frames_) begin();
    return frame_[current_];
  }

 private:
  // Of the two frames the one that is not in use is prepared.
  void begin() {
    const auto when = thread_ ? std::launch::async : std::launch::deferred;
    ahead_ = std::async(when, [this, i = next_++, &frame = frame_[1 - current_]] { prepare(i, frame); });
  }
  void prepare(int i, ReadyFrame& out) {
    Stopwatch watch;
    source_->load(i, out.images);
    out.load_ms = watch.lap();
    out.features_ms = 0;
    time_.check(out.images);
    if (!out.images.ok()) return;
    if (kept_) {
      kept_->see(out.images.gray);
      if (kept_->read(i, out.features, out.features_ms)) {
        taken_.push_back(i);
        return;
      }
      go_through_taken();
      watch.lap();
    }
    front_end_.extract(out.images.gray, out.features);
    out.features_ms = watch.lap();
    if (kept_) kept_->write(i, out.features, out.features_ms);
  }
  /// Tracks come from the images before: those that the front end has not seen, as their features were kept, are gone through.
  void go_through_taken() {
    for (const int i : taken_) {
      source_->load(i, again_.images);
      front_end_.extract(again_.images.gray, again_.features);
    }
    taken_.clear();
  }

  FrameSource* source_;
  apso::opencv::FeatureFrontEnd front_end_;
  int frames_;
  bool thread_;
  int next_ = 0;
  TimeGoesOn time_;
  std::size_t current_ = 0;
  std::array<ReadyFrame, 2> frame_;
  std::optional<KeptFeatures> kept_;
  std::vector<int> taken_;  // frames whose features were kept, since the last one that was not
  ReadyFrame again_;
  std::future<void> ahead_;  // last: its thread ends before what it uses
};

}  // namespace track
