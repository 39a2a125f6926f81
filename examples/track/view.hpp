/// \file
/// A frame beside the path so far, seen from above: the picture of --video and of --live.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/evaluation/ate.hpp>
#include <apso/evaluation/trajectory.hpp>
#include <apso/opencv/drawing.hpp>
#include <apso/pipeline/report.hpp>

namespace track {

/// Keeps the path while a run grows, and draws it. "Above" is that of the first camera: its x axis points right and its optical
/// axis up in the picture. A ground truth is laid onto the path so far as the ATE does it, so its body need not be the camera.
class View {
 public:
  /// \param truth empty: there is none
  explicit View(apso::Trajectory truth) : truth_(std::move(truth)) {}

  /// \param overlay    the frame with its mask and scores, 8-bit BGR
  /// \param seconds    since the first frame [s]
  /// \return the overlay with the path at its right; width and height are even, which most codecs need
  cv::Mat draw(const cv::Mat& overlay, const apso::FrameReport& report, int frame, double seconds) {
    add(report);
    cv::Mat panel(overlay.rows, overlay.rows * 4 / 5, CV_8UC3, white);
    const std::optional<std::vector<apso::Pose>> truth = known();
    fit(panel.size(), truth);
    grid(panel);
    for (std::size_t i = 1; truth && i < truth->size(); ++i) line(panel, (*truth)[i - 1], (*truth)[i], grey, 3);
    for (std::size_t i = 1; i < path_.size(); ++i) {
      if (!path_[i].lost && !path_[i - 1].lost) line(panel, path_[i - 1].pose, path_[i].pose, blue, 2);
    }
    for (const Step& s : path_) {
      if (s.bad)
        cv::circle(panel, pixel(s.pose.translation()), 3, apso::opencv::state_colour(apso::SceneState::Bad), cv::FILLED, cv::LINE_AA);
    }
    if (!path_.empty() && !path_.back().lost) camera(panel, path_.back().pose);
    legend(panel, frame, seconds, truth.has_value());

    cv::Mat picture;
    cv::hconcat(overlay, panel, picture);
    cv::copyMakeBorder(picture, picture, 0, picture.rows % 2, 0, picture.cols % 2, cv::BORDER_REPLICATE);
    return picture;
  }

 private:
  struct Step {
    apso::Pose pose;
    bool bad;
    bool lost;  ///< there is no pose: the path is interrupted
  };
  inline static const cv::Scalar white{255, 255, 255};
  inline static const cv::Scalar black{30, 30, 30};
  inline static const cv::Scalar pale{225, 225, 225};
  inline static const cv::Scalar grey{188, 181, 175};
  inline static const cv::Scalar blue{178, 114, 0};
  static constexpr int top = 64;     ///< rows of the legend [px]
  static constexpr int margin = 24;  ///< around the path [px]

  void add(const apso::FrameReport& report) {
    const bool lost = report.state == apso::SceneState::Lost;
    path_.push_back({report.T_world_camera, report.state == apso::SceneState::Bad, lost});
    if (!lost) estimate_.push_back({report.timestamp, report.T_world_camera});
  }
  /// The true poses so far, in the world of the estimate; none until they can be laid onto it.
  std::optional<std::vector<apso::Pose>> known() {
    const apso::AteResult ate = truth_.empty() || estimate_.empty() ? apso::AteResult{} : apso::ate(truth_, estimate_);
    rmse_ = ate.statistics.rmse;
    if (ate.pairs.empty() || !succeeded(ate.status)) return {};
    const apso::Pose T_estimate_truth = apso::inverse(ate.T_groundtruth_estimate);
    std::vector<apso::Pose> poses;
    for (const apso::StampedPose& p : truth_) {
      if (p.timestamp >= estimate_.front().timestamp && p.timestamp <= estimate_.back().timestamp)
        poses.push_back(T_estimate_truth * p.T_world_body);
    }
    return poses;
  }

  static cv::Point2d plane(const Eigen::Vector3d& p) { return {p.x(), p.z()}; }
  /// Scale and centre, so that all of the paths is in the picture; at least 0.3 m of the world are.
  void fit(cv::Size size, const std::optional<std::vector<apso::Pose>>& truth) {
    Eigen::AlignedBox2d box;
    const auto include = [&](const apso::Pose& pose) { box.extend(Eigen::Vector2d(pose.translation().x(), pose.translation().z())); };
    for (const apso::StampedPose& p : estimate_) include(p.T_world_body);
    for (std::size_t i = 0; truth && i < truth->size(); ++i) include((*truth)[i]);
    if (box.isEmpty()) box.extend(Eigen::Vector2d::Zero());
    const Eigen::Vector2d extent = box.sizes().cwiseMax(0.3);
    scale_ = std::min((size.width - 2 * margin) / extent.x(), (size.height - top - 2 * margin) / extent.y());
    centre_ = {box.center().x(), box.center().y()};
    middle_ = {0.5 * size.width, 0.5 * (size.height + top)};
  }
  [[nodiscard]] cv::Point pixel(const cv::Point2d& p) const {
    return {cvRound(middle_.x + scale_ * (p.x - centre_.x)), cvRound(middle_.y - scale_ * (p.y - centre_.y))};
  }
  [[nodiscard]] cv::Point pixel(const Eigen::Vector3d& p) const { return pixel(plane(p)); }
  void line(cv::Mat& panel, const apso::Pose& from, const apso::Pose& to, const cv::Scalar& colour, int width) const {
    cv::line(panel, pixel(from.translation()), pixel(to.translation()), colour, width, cv::LINE_AA);
  }
  static void write(cv::Mat& panel, const std::string& text, cv::Point at, const cv::Scalar& colour, double size = 0.42) {
    cv::putText(panel, text, at, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1, cv::LINE_AA);
  }

  /// Lines every 1, 2 or 5 times a power of ten [m], some 60 pixels apart, with the distance written below.
  void grid(cv::Mat& panel) const {
    double step = std::pow(10, std::floor(std::log10(60 / scale_)));
    for (const double factor : {2.0, 2.5, 2.0}) {
      if (step * scale_ < 60) step *= factor;
    }
    const double left = centre_.x - middle_.x / scale_;
    const double bottom = centre_.y - (panel.rows - middle_.y) / scale_;
    for (double x = step * std::ceil(left / step); pixel(cv::Point2d(x, 0)).x < panel.cols; x += step) {
      const int column = pixel(cv::Point2d(x, 0)).x;
      cv::line(panel, {column, top}, {column, panel.rows}, pale);
    }
    for (double z = step * std::ceil(bottom / step); pixel(cv::Point2d(0, z)).y > top; z += step) {
      const int row = pixel(cv::Point2d(0, z)).y;
      cv::line(panel, {0, row}, {panel.cols, row}, pale);
    }
    char text[40];
    std::snprintf(text, sizeof text, "grid %g m", step);
    write(panel, text, {8, panel.rows - 8}, {120, 120, 120});
  }
  /// Where the camera is, and where it looks.
  void camera(cv::Mat& panel, const apso::Pose& pose) const {
    const Eigen::Vector3d axis = pose.rotation().col(2);
    const cv::Point2d ahead(axis.x(), axis.z());
    const cv::Point at = pixel(pose.translation());
    cv::line(panel, at, at + cv::Point(cvRound(22 * ahead.x), cvRound(-22 * ahead.y)), black, 2, cv::LINE_AA);
    cv::circle(panel, at, 5, blue, cv::FILLED, cv::LINE_AA);
    cv::circle(panel, at, 5, black, 1, cv::LINE_AA);
  }
  void legend(cv::Mat& panel, int frame, double seconds, bool known) const {
    cv::rectangle(panel, {0, 0, panel.cols, top}, white, cv::FILLED);
    char text[80];
    std::snprintf(text, sizeof text, "frame %d, %.2f s; path from above", frame, seconds);
    write(panel, text, {8, 18}, black, 0.45);
    int x = 8;
    const auto entry = [&](const char* name, const cv::Scalar& colour, bool dot) {
      if (dot) {
        cv::circle(panel, {x + 10, 38}, 3, colour, cv::FILLED, cv::LINE_AA);
      } else {
        cv::line(panel, {x, 38}, {x + 20, 38}, colour, 3, cv::LINE_AA);
      }
      write(panel, name, {x + 26, 42}, black);
      x += 40 + cv::getTextSize(name, cv::FONT_HERSHEY_SIMPLEX, 0.42, 1, nullptr).width;
    };
    entry("apso", blue, false);
    if (known) entry("ground truth", grey, false);
    entry("BAD", apso::opencv::state_colour(apso::SceneState::Bad), true);
    if (!known) return;
    std::snprintf(text, sizeof text, "ATE rmse so far %.4f m", rmse_);
    write(panel, text, {8, 58}, black);
  }

  apso::Trajectory truth_;
  apso::Trajectory estimate_;
  std::vector<Step> path_;
  double rmse_ = 0;   ///< ATE so far [m]
  double scale_ = 1;  ///< [px/m]
  cv::Point2d centre_;
  cv::Point2d middle_;
};

}  // namespace track
