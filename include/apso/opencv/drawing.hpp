/// \file
/// Pictures of one frame: mask, boxes, tracks, scores and the verdict, in the manner of the paper's figures.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <apso/pipeline/pipeline.hpp>

APSO_NAMESPACE_BEGIN
namespace opencv {

/// Colour of a state in pictures (BGR).
[[nodiscard]] inline cv::Scalar state_colour(SceneState state) {
  switch (state) {
    case SceneState::Good:
      return {80, 200, 80};
    case SceneState::Bad:
      return {60, 60, 230};
    case SceneState::Lost:
      return {200, 60, 200};
    case SceneState::Initialising:
      break;
  }
  return {220, 180, 60};
}

/// The mask as 8-bit image, 255 = dynamic (probability >= 0.5), 0 = the rest.
inline void mask_to_8bit(const DynamicMask& mask, cv::Mat& out) {
  const Image<float>& p = mask.probability;
  out.create(p.height(), p.width(), CV_8UC1);
  for (int y = 0; y < p.height(); ++y) {
    uchar* row = out.ptr<uchar>(y);
    for (int x = 0; x < p.width(); ++x) row[x] = p(x, y) >= 0.5F ? 255 : 0;
  }
}

/// A colour for an identity (BGR), well apart for identities that follow each other.
[[nodiscard]] inline cv::Scalar identity_colour(int track_id) {
  static const cv::Scalar colours[] = {{255, 200, 60}, {80, 230, 255},  {120, 255, 120}, {255, 120, 255},
                                       {60, 160, 255}, {255, 255, 120}, {180, 140, 255}, {200, 255, 200}};
  return track_id < 0 ? cv::Scalar(255, 255, 255) : colours[track_id % 8];
}

/// Draws what was observed and decided over a copy of the colour image (8-bit BGR).
/// Dynamic pixels are red, objects boxed in the colour of their identity with class (-1 = found by motion alone), score
/// and motion probability ("?" where it is not known), static keypoints green dots.
[[nodiscard]] inline cv::Mat draw_overlay(const cv::Mat& bgr, const Observation& observation, const std::vector<Keypoint>& keypoints,
                                          const FrameReport& report) {
  cv::Mat out = bgr.clone();
  const Image<float>& probability = observation.mask.probability;
  for (int y = 0; y < probability.height() && y < out.rows; ++y) {
    cv::Vec3b* row = out.ptr<cv::Vec3b>(y);
    for (int x = 0; x < probability.width() && x < out.cols; ++x) {
      if (probability(x, y) >= 0.5F) {
        row[x] = cv::Vec3b(static_cast<uchar>(row[x][0] / 2), static_cast<uchar>(row[x][1] / 2), static_cast<uchar>(row[x][2] / 2 + 127));
      }
    }
  }
  for (const Keypoint& k : keypoints) {
    const int x = static_cast<int>(k.x);
    const int y = static_cast<int>(k.y);
    const bool inside = x >= 0 && y >= 0 && x < probability.width() && y < probability.height();
    const bool dynamic = inside && probability(x, y) >= 0.5F;
    cv::circle(out, {x, y}, 1, dynamic ? cv::Scalar(0, 160, 255) : cv::Scalar(0, 255, 0), cv::FILLED);
  }
  for (const Detection& d : observation.objects) {
    const cv::Rect box(static_cast<int>(d.box.x), static_cast<int>(d.box.y), static_cast<int>(d.box.width), static_cast<int>(d.box.height));
    const cv::Scalar colour = identity_colour(d.track_id);
    cv::rectangle(out, box, colour, 2);
    char label[80];
    int n = std::snprintf(label, sizeof label, "#%d", d.track_id);
    if (d.class_id >= 0)
      n += std::snprintf(label + n, sizeof label - static_cast<std::size_t>(n), " class %d %.2f", d.class_id, static_cast<double>(d.score));
    if (d.motion_probability >= 0) {
      std::snprintf(label + n, sizeof label - static_cast<std::size_t>(n), " moves %.2f", static_cast<double>(d.motion_probability));
    } else {
      std::snprintf(label + n, sizeof label - static_cast<std::size_t>(n), " moves ?");
    }
    const cv::Size size = cv::getTextSize(label, cv::FONT_HERSHEY_SIMPLEX, 0.45, 1, nullptr);
    const int left = std::clamp(box.x, 0, std::max(0, out.cols - size.width - 6));
    const int top = std::clamp(box.y, 0, std::max(0, out.rows - 18));
    cv::rectangle(out, cv::Rect(left, top, size.width + 6, 17), colour, cv::FILLED);
    cv::putText(out, label, {left + 3, top + 12}, cv::FONT_HERSHEY_SIMPLEX, 0.45, {20, 20, 20}, 1, cv::LINE_AA);
  }

  // Bottom banner: verdict and scores.
  const Assessment& a = report.assessment;
  const auto text = [](const char* name, const auto& score) {
    char buffer[32];
    if (score) {
      std::snprintf(buffer, sizeof buffer, "%s %.2f  ", name, score->value());
    } else {
      std::snprintf(buffer, sizeof buffer, "%s -  ", name);
    }
    return std::string(buffer);
  };
  cv::Mat banner(58, out.cols, CV_8UC3, cv::Scalar(30, 30, 30));
  cv::rectangle(banner, {0, 0, 8, banner.rows}, state_colour(report.state), cv::FILLED);
  char verdict[160];
  std::snprintf(verdict, sizeof verdict, "%s%s", to_string(report.state),
                report.state == SceneState::Bad && report.refined ? " (repaired)" : "");
  cv::putText(banner, verdict, {16, 18}, cv::FONT_HERSHEY_SIMPLEX, 0.5, state_colour(report.state), 1, cv::LINE_AA);
  const auto line = [&](const std::string& s, int x, int y) {
    cv::putText(banner, s, {x, y}, cv::FONT_HERSHEY_SIMPLEX, 0.42, {230, 230, 230}, 1, cv::LINE_AA);
  };
  char ratio[48];
  std::snprintf(ratio, sizeof ratio, "dynamic %.0f %%", 100.0 * observation.dynamic_ratio);
  line(text("S_final", a.S_final) + text("S_total", MaybeQuality(a.S_total)) + text("S_change", a.S_change) + ratio, 190, 18);
  const auto named = [](std::string& to) {
    return [&to](const char* name, const std::optional<double>& value, double, Better) {
      to += name + (value ? ' ' + two_digits(*value) : std::string(" -")) + "  ";
    };
  };
  std::string of_frame, of_change;
  for_each_frame_score(a, named(of_frame));
  for_each_change_score(a, named(of_change));
  line(of_frame, 16, 36);
  line(of_change, 16, 53);
  cv::vconcat(out, banner, out);
  return out;
}

}  // namespace opencv
APSO_NAMESPACE_END
