/// \file
/// Overlay pictures of selected frames, the contact sheet, and the one-page overview.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/evaluation/ate.hpp>
#include <apso/pipeline/report.hpp>

#include "data_uri.hpp"
#include "plots.hpp"
#include "results.hpp"
#include "write_behind.hpp"

namespace track {

/// A frame on offer for a picture.
struct OfferedFrame {
  int number = 0;
  int total = 0;      ///< frames of the run
  double time = 0;    ///< since the first frame [s]
  std::string label;  ///< known difficulty; empty: none
};

/// Selects the frames that tell what happened: where a state, a known difficulty or the kind of scene changes, where a BAD frame
/// is refined, and some at regular intervals. Writes their pictures.
class OverlayChooser {
 public:
  OverlayChooser(ResultFolder& folder, WriteBehind& writer) : folder_(&folder), writer_(&writer) {}

  template <class Draw>
  void offer(const OfferedFrame& frame, const apso::FrameReport& report, Draw&& draw) {
    const int step = std::max(1, frame.total / regular);
    std::string why = changes(frame, report);
    if (why.empty() && frame.number % step == step / 2) why = to_string(report.state);
    if (why.empty()) return;
    const cv::Mat picture = draw();
    char text[120];
    std::snprintf(text, sizeof text, "overlays/%06d.png", frame.number);
    writer_->add([file = folder_->file(text), picture] { write_image(file, picture); });
    std::snprintf(text, sizeof text, "frame %d, %.2f s: %s", frame.number, frame.time, why.c_str());
    cv::Mat small;
    cv::resize(picture, small, {std::max(1, picture.cols / 2), std::max(1, picture.rows / 2)}, 0, 0, cv::INTER_AREA);
    cv::rectangle(small, {0, 0, small.cols, 17}, {30, 30, 30}, cv::FILLED);
    cv::putText(small, text, {4, 12}, cv::FONT_HERSHEY_SIMPLEX, 0.4, {255, 255, 255}, 1, cv::LINE_AA);
    tiles_.push_back(small);
  }

  /// Writes the contact sheet. \return it; empty without pictures
  cv::Mat finish() const {
    if (tiles_.empty()) return {};
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
    return sheet;
  }

 private:
  static constexpr int regular = 6;   // pictures at regular intervals
  static constexpr int per_kind = 3;  // pictures of one kind of change
  /// What changed with this frame; empty: nothing, or there are pictures enough of it.
  std::string changes(const OfferedFrame& frame, const apso::FrameReport& report) {
    const auto enough = [&](const std::string& kind) { return ++told_[kind] > per_kind; };
    const apso::Assessment& a = report.assessment;
    const std::string scene = a.scenario_dynamic   ? "dynamic scene"
                              : a.scenario_objects ? "objects in the scene"
                              : a.scenario_static  ? "static scene"
                                                   : "mixed scene";
    const bool repaired = report.state == apso::SceneState::Bad && report.refined;
    std::string why;
    if (report.state != state_) why = std::string(to_string(report.state)) + " begins";
    if (repaired && !repaired_) why += std::string(why.empty() ? "BAD" : "") + ", refined";
    if (!why.empty() && enough(why)) why.clear();
    if (why.empty() && frame.label != label_ && !enough("label")) why = frame.label.empty() ? "end of " + label_ : frame.label + " begins";
    // the kind of scene may flicker: not again within a tenth of the run
    if (why.empty() && scene != scene_ && frame.number - scene_told_ >= frame.total / 10 && !enough("scene")) {
      why = scene;
      scene_told_ = frame.number;
    }
    state_ = report.state;
    repaired_ = repaired;
    label_ = frame.label;
    scene_ = scene;
    return why;
  }

  ResultFolder* folder_;
  WriteBehind* writer_;
  std::vector<cv::Mat> tiles_;
  std::map<std::string, int> told_;  ///< pictures of each kind of change
  apso::SceneState state_ = apso::SceneState::Initialising;
  bool repaired_ = false;
  std::string label_;
  std::string scene_ = "mixed scene";
  int scene_told_ = 0;
};

/// Trajectory, scores and contact sheet in one picture.
inline void write_overview(ResultFolder& folder, cv::Mat sheet) {
  const std::filesystem::path& out = folder.unfinished();
  for (const char* part : {"scores.png", "scores.svg", "trajectory.png", "trajectory.svg"}) {
    if (!std::filesystem::exists(out / part)) return;
  }
  const cv::Mat scores = cv::imread((out / "scores.png").string());
  const cv::Mat trajectory = cv::imread((out / "trajectory.png").string());
  if (scores.empty() || trajectory.empty() || sheet.empty()) return;
  cv::Mat left;
  cv::resize(trajectory, left, {trajectory.cols * scores.rows / trajectory.rows, scores.rows}, 0, 0, cv::INTER_AREA);
  cv::Mat top;
  cv::hconcat(left, scores, top);
  cv::resize(sheet, sheet, {top.cols, sheet.rows * top.cols / sheet.cols}, 0, 0, cv::INTER_AREA);
  cv::Mat page;
  cv::vconcat(top, sheet, page);
  write_image(folder.file("overview.png"), page);

  // The same page, of the plots as lines and text, and of the sheet as JPEG. Each is a picture of its own, so that the names that
  // gnuplot gives to its marks do not meet.
  std::string svg =
      "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" "
      "xmlns:xlink=\"http://www.w3.org/1999/xlink\" viewBox=\"0 0 " +
      std::to_string(page.cols) + ' ' + std::to_string(page.rows) + "\">\n";
  const auto place = [&svg](int x, int y, cv::Size size, const std::string& picture) {
    svg += "<image x=\"" + std::to_string(x) + "\" y=\"" + std::to_string(y) + "\" width=\"" + std::to_string(size.width) + "\" height=\"" +
           std::to_string(size.height) + "\" xlink:href=\"" + picture + "\"/>\n";
  };
  const auto plot = [&out](const char* name) {
    std::ifstream in(out / name, std::ios::binary);
    return data_uri("image/svg+xml", {std::istreambuf_iterator<char>(in), {}});
  };
  std::vector<unsigned char> jpeg;
  if (!cv::imencode(".jpg", sheet, jpeg)) throw apso::io_error("contact_sheet.png: cannot be encoded as JPEG");
  place(0, 0, left.size(), plot("trajectory.svg"));
  place(left.cols, 0, scores.size(), plot("scores.svg"));
  place(0, top.rows, sheet.size(), data_uri("image/jpeg", {jpeg.begin(), jpeg.end()}));
  write_file(folder.file("overview.svg"), svg + "</svg>\n");
}

/// The plots of a run in all formats, the contact sheet, and the overview with them.
inline void write_pictures(const PlottedRun& run, const OverlayChooser& overlays, ResultFolder& folder) {
  Plots plots;
  for (const char* format : {".png", ".svg", ".pdf"}) {
    plot_trajectory(folder.file(std::string("trajectory") + format), run, plots);
    plot_scores(folder.file(std::string("scores") + format), run, plots);
  }
  const cv::Mat sheet = overlays.finish();  // while they are drawn
  for (Gnuplot& plot : plots) plot.finish();
  write_overview(folder, sheet);
}

/// What the plots show of a run. \param title name of the sequence \param truth empty: none that can be compared
inline PlottedRun plotted_run(const std::string& title, const std::vector<apso::FrameReport>& reports, const apso::Trajectory& truth,
                              const apso::Trajectory& features, const apso::Trajectory& final_poses) {
  PlottedRun run{title, reports, features, final_poses, {}, {}, {}, 0, 0};
  apso::AteOptions options;
  const auto errors = [&](const apso::Trajectory& estimate, std::vector<std::vector<double>>& rows) {
    const apso::AteResult ate = truth.empty() || estimate.empty() ? apso::AteResult{} : apso::ate(truth, estimate, options);
    for (std::size_t i = 0; i < ate.errors.size(); ++i) {
      const double time = estimate[ate.pairs[i].second].timestamp - run.start();
      // a gap of more than some frames is no line
      if (i > 0 && time - rows.back()[0] > 5 * run.seconds() / static_cast<double>(reports.size())) rows.push_back({time, std::nan("")});
      rows.push_back({time, ate.errors[i]});
    }
    return ate;
  };
  errors(features, run.feature_error);
  const apso::AteResult ate = errors(final_poses, run.error);
  if (!succeeded(ate.status)) return run;
  run.rmse = ate.statistics.rmse;
  run.pairs = ate.errors.size();
  const apso::Pose T_estimate_truth = apso::inverse(ate.T_groundtruth_estimate);
  for (const auto& p : truth) {
    if (p.timestamp < final_poses.front().timestamp || p.timestamp > final_poses.back().timestamp) continue;
    run.truth.push_back({p.timestamp, T_estimate_truth * p.T_world_body});
  }
  return run;
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
