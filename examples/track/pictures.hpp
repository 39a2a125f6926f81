/// \file
/// Overlay pictures of selected frames, the contact sheet, and the one-page overview.
#pragma once

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <nlohmann/json.hpp>
#include <yaml-cpp/yaml.h>

#include <apso/evaluation/ate.hpp>
#include <apso/pipeline/report.hpp>

#include "results.hpp"

namespace track {

/// Selects every n-th frame and the first frame of each BAD or LOST run, up to a maximum, and writes their pictures.
class OverlayChooser {
 public:
  explicit OverlayChooser(ResultFolder& folder) : folder_(&folder) {}

  template <class Draw>
  void offer(int frame, int total, const apso::FrameReport& report, Draw&& draw) {
    const int step = std::max(1, total / regular);
    const bool problem = report.state == apso::SceneState::Bad || report.state == apso::SceneState::Lost;
    const bool begins = problem && !was_problem_ && problems_ < max_problems;
    was_problem_ = problem;
    if (frame % step != step / 2 && !begins) return;
    problems_ += begins ? 1 : 0;
    const cv::Mat picture = draw();
    char name[32];
    std::snprintf(name, sizeof name, "%06d.png", frame);
    write_image(folder_->file(std::string("overlays/") + name), picture);
    cv::Mat small;
    cv::resize(picture, small, {std::max(1, picture.cols / 2), std::max(1, picture.rows / 2)}, 0, 0, cv::INTER_AREA);
    tiles_.push_back(small);
  }

  /// Writes the contact sheet.
  void finish() const {
    if (tiles_.empty()) return;
    constexpr std::size_t columns = 4;
    std::vector<cv::Mat> rows;
    for (std::size_t i = 0; i < tiles_.size(); i += columns) {
      std::vector<cv::Mat> row(tiles_.begin() + static_cast<std::ptrdiff_t>(i),
                               tiles_.begin() + static_cast<std::ptrdiff_t>(std::min(i + columns, tiles_.size())));
      while (row.size() < columns) row.emplace_back(tiles_.front().size(), tiles_.front().type(), cv::Scalar(255, 255, 255));
      cv::Mat joined;
      cv::hconcat(row, joined);
      rows.push_back(joined);
    }
    cv::Mat sheet;
    cv::vconcat(rows, sheet);
    write_image(folder_->file("contact_sheet.png"), sheet);
  }

 private:
  static constexpr int regular = 12;       // pictures at regular intervals
  static constexpr int max_problems = 12;  // pictures of BAD or LOST runs
  ResultFolder* folder_;
  std::vector<cv::Mat> tiles_;
  int problems_ = 0;
  bool was_problem_ = false;
};

/// Trajectory, scores and contact sheet in one picture.
inline void write_overview(ResultFolder& folder) {
  const std::filesystem::path& out = folder.unfinished();
  for (const char* part : {"scores.png", "trajectory.png", "contact_sheet.png"}) {
    if (!std::filesystem::exists(out / part)) return;
  }
  const cv::Mat scores = cv::imread((out / "scores.png").string());
  const cv::Mat trajectory = cv::imread((out / "trajectory.png").string());
  cv::Mat sheet = cv::imread((out / "contact_sheet.png").string());
  if (scores.empty() || trajectory.empty() || sheet.empty()) return;
  cv::Mat left;
  cv::resize(trajectory, left, {trajectory.cols * scores.rows / trajectory.rows, scores.rows}, 0, 0, cv::INTER_AREA);
  cv::Mat top;
  cv::hconcat(left, scores, top);
  cv::resize(sheet, sheet, {top.cols, sheet.rows * top.cols / sheet.cols}, 0, 0, cv::INTER_AREA);
  cv::Mat page;
  cv::vconcat(top, sheet, page);
  write_image(folder.file("overview.png"), page);
}

/// Ground truth moved into the frame of the estimate, for plotting; empty if too few poses match.
inline apso::Trajectory aligned_truth(const apso::Trajectory& truth, const apso::Trajectory& estimate) {
  apso::AteOptions options;
  options.association = apso::AssociationRule::Evo;
  const apso::AteResult ate = apso::ate(truth, estimate, options);
  if (!succeeded(ate.status)) return {};
  const apso::Pose T_estimate_truth = apso::inverse(ate.T_groundtruth_estimate);
  apso::Trajectory moved;
  for (const auto& p : truth) {
    if (p.timestamp < estimate.front().timestamp || p.timestamp > estimate.back().timestamp) continue;
    moved.push_back({p.timestamp, T_estimate_truth * p.T_world_body});
  }
  return moved;
}

inline nlohmann::json yaml_to_json(const YAML::Node& node) {
  if (node.IsMap()) {
    nlohmann::json map = nlohmann::json::object();
    for (const auto& entry : node) map[entry.first.Scalar()] = yaml_to_json(entry.second);
    return map;
  }
  if (node.IsSequence()) {
    nlohmann::json list = nlohmann::json::array();
    for (const auto& item : node) list.push_back(yaml_to_json(item));
    return list;
  }
  return nlohmann::json::accept(node.Scalar()) ? nlohmann::json::parse(node.Scalar()) : nlohmann::json(node.Scalar());
}
inline nlohmann::json yaml_to_json(const std::string& text) { return yaml_to_json(YAML::Load(text)); }

}  // namespace track
